//! Where the points of scans belong: units, axes, matrices, and reprojection from one coordinate reference system to
//! another.
//!
//! [`Placing`] is what is requested. It is a [`pointmill_format::ScanMaps`], so that every scan that is opened with it
//! comes with its points in their places:
//!
//! ```
//! use pointmill_crs::{Placing, Units};
//! use pointmill_format::{OpenOptions, Wanted, open_scan};
//!
//! # let file = std::env::temp_dir().join(format!("pointmill-placing-{}.xyz", std::process::id()));
//! # std::fs::write(&file, "500000000 5400000000 1000\n600000000 5400000000 1000\n")?;
//! let placing = Placing::default().with_units(Units::Millimetre);
//! let placing = placing.with_crs("EPSG:25832")?.with_target("EPSG:4258")?;
//! let scan = open_scan(&file, &OpenOptions::default().maps(placing))?;
//! let bounds = scan.bounds_hint().ok_or("no points")?;
//! assert!((bounds.min[0] - 9.0).abs() < 1e-9 && bounds.min[2] == 1.0);
//! # std::fs::remove_file(file)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Projections and the registry of systems are those of the crates `proj-core` and `proj-wkt`; docs/inputs.md has their
//! measured agreement with PROJ. What they cannot do exactly is refused, not approximated: changes of datum that need a
//! grid or have no published parameters, and changes of the reference of heights.

#![cfg_attr(
    not(test),
    warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::unwrap_in_result)
)]
#![forbid(unsafe_code)]

mod heights;
mod operation;
mod placing;
mod projection;
mod system;
mod units;

pub use placing::Placing;
pub use system::CrsError;
pub use units::Units;

//! What each setting of pointmill costs and buys, measured on the user's own scene.
//!
//! A [`Measurement`] runs the program once per setting of a grid ([`Axes`]), as users do, and compares what the dataset
//! decodes to with the scans: positions, colours by level, holes, and pictures as renderers draw them with those of the whole cloud.
//! [`report::write_all`] writes the result ([`Measured`]) for programs, spreadsheets and people.
//!
//! ```
//! use pointmill_measure::{Axes, Axis};
//!
//! let axes = Axes::parse("output=potree2+batches,encoding")?;
//! let settings = axes.settings()?;
//! assert_eq!(settings.len(), 4);
//! assert_eq!(settings[1].arguments, ["--to", "potree2", "--encoding", "brotli"]);
//! assert_eq!(settings[1].value(Axis::Encoding), Some("compressed"));
//! # Ok::<(), String>(())
//! ```

#![cfg_attr(
    not(test),
    warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::unwrap_in_result)
)]
#![deny(unsafe_code)]

mod axis;
mod choice;
mod cloud;
mod colour;
mod decoded;
mod error;
mod image;
mod measurement;
mod position;
mod program;
pub mod report;
pub mod result;
mod sample;
mod trades;
mod views;

pub use axis::{Axes, Axis, Setting};
pub use colour::LevelError;
pub use error::MeasureError;
pub use image::ImageError;
pub use measurement::{Measurement, Shown, Watch};
pub use position::AxisError;
pub use result::Measured;

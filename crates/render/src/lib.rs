//! Pictures of point clouds, drawn on the processor as renderers draw them.
//!
//! Datasets are read through `pointmill-format` alone: an octree node by node under a budget of points, a binary tree leaf by
//! leaf with a material for far and one for near, quantised batches with a level of detail and as many bits as the picture
//! needs. Scans are drawn whole, piece by piece. [`Canvas`] takes points from anywhere else.
//!
//! ```
//! use pointmill_format::open_octree;
//! use pointmill_render::{Camera, Size, Style, View, render_octree};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let octree = open_octree(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/potree2/default"))?;
//! let size = Size::new(160, 120)?;
//! let camera = Camera::fit(&octree.info().cube, View::South, size);
//! let picture = render_octree(&*octree, &camera, size, &Style::default(), 1_000_000, 2)?;
//! println!("{} points of {} nodes", picture.drawn.points, picture.drawn.nodes);
//! let bytes = picture.png()?;
//! # assert!(picture.covered() > 0 && !bytes.is_empty());
//! # Ok(())
//! # }
//! ```
//!
//! The same input gives the same picture, whatever the number of threads: ties are decided by value, sums are integers.

#![cfg_attr(
    not(test),
    warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::unwrap_in_result)
)]
#![deny(unsafe_code)]

mod boxes;
mod camera;
mod canvas;
mod colours;
mod draw;
mod error;
mod flight;
mod overview;
mod picture;
mod projection;
mod raster;
mod render;
mod scene;
mod shading;
mod sources;
mod style;
mod vector;
mod workers;

pub use camera::{Camera, Size, View};
pub use canvas::Canvas;
pub use error::{CameraError, RenderError};
pub use flight::{Flight, FlightError};
pub use picture::{Drawn, Picture};
pub use pointmill_format::octree::Order;
pub use render::{render_batches, render_bintree, render_octree};
pub use scene::{Scene, render_dataset};
pub use style::{Bits, Colour, PointSize, Shape, Style};

//! Scans: files of points, of any kind, opened by content and decoded in pieces.

mod archive;
mod batches;
mod chosen;
mod dataset_note;
mod decimal;
mod decode;
mod depth_options;
mod image;
mod info;
mod mapped;
mod open;
mod other_kind;
#[cfg(feature = "text")]
mod partial;
#[cfg(any(feature = "depth", feature = "e57", feature = "las", feature = "pcd", feature = "ply", feature = "text"))]
#[cfg_attr(not(all(feature = "e57", feature = "las", feature = "text")), allow(dead_code))]
mod quantities;
#[cfg(any(feature = "e57", feature = "las", feature = "pcd", feature = "ply", feature = "text"))]
mod source;
mod unit;
mod wanted;
mod warning;
// each reader uses its part of it: a build with few of them leaves some of it idle
#[cfg(any(feature = "pcd", feature = "ply", feature = "text"))]
#[cfg_attr(not(all(feature = "pcd", feature = "ply", feature = "text")), allow(dead_code, unused_imports))]
mod tabular;

#[cfg(feature = "depth")]
pub mod depth;
#[cfg(feature = "e57")]
pub mod e57;
#[cfg(feature = "las")]
pub mod las;
#[cfg(feature = "pcd")]
pub mod pcd;
#[cfg(feature = "ply")]
pub mod ply;
#[cfg(feature = "text")]
pub mod text;

pub use batches::Batches;
pub use chosen::scans_named;
pub use dataset_note::DatasetNote;
pub use decimal::Decimal;
pub use decode::{MAX_BATCH_BYTES, MAX_BATCH_POINTS, Scan, Scratch, Sink};
pub(crate) use decode::{batch_bytes, batch_points, fitting_batch, point_bytes, resize};
pub use depth_options::{DepthFilter, DepthOptions, Intrinsics};
pub use image::{Blob, ImageEncoding, ImageGeometry, ImageKind, ImagePose, ScanImage};
pub use info::{Crs, Piece, Resolution, ScanInfo, ScanPart};
pub(crate) use mapped::mapped;
pub use mapped::{PointMap, ScanMap, ScanMaps};
pub(crate) use open::open_file;
pub use open::{OpenOptions, ScanKind, supported_scans};
pub use other_kind::OtherKind;
pub use unit::Unit;
pub use wanted::{UnknownAttribute, Wanted};
pub use warning::{Counted, ScanWarning};

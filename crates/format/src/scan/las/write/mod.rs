//! Writing LAS and LAZ: the records, and what stands around them.
//!
//! [`RecordLayout`] says which field of a LAS record holds which attribute, and encodes many records at once, the inverse of
//! the reader: what is written is read with the same values. [`Heading`] makes the bytes before and behind the records or
//! chunks; these may be written meanwhile, by any number of threads. `ChunkEncoder` (feature `laz`) compresses one chunk, of LAZ
//! and of COPC.
//!
//! ```
//! use pointmill_format::scan::las::write::{RecordLayout, StridedColumn};
//! use pointmill_format::{Attribute, AttributeType, Changes, Column};
//!
//! let attributes = [Attribute::new("intensity", AttributeType::UInt16, 1), Attribute::new("rgb", AttributeType::UInt16, 3)];
//! let layout = RecordLayout::choose(&attributes, &[0, 1, 2, 3, 6, 7, 8])?;
//! assert_eq!((layout.point_format(), layout.record_len()), (2, 26));
//!
//! let columns = [Column::UInt16(vec![7, 8]), Column::UInt16(vec![1, 2, 3, 4, 5, 6])];
//! let columns = [Some(StridedColumn::of(&columns[0], 1)), Some(StridedColumn::of(&columns[1], 3))];
//! let axes = [[10, 11], [20, 21], [30, 31]].map(Vec::from);
//! let positions = axes.each_ref().map(|axis| StridedColumn::of_axis(axis));
//! let (mut records, mut changes) = (vec![0; 2 * layout.record_len()], vec![Changes::default(); 2]);
//! layout.put(&positions, &columns, &mut records, &mut changes);
//! assert_eq!(records[26..30], 11i32.to_le_bytes());
//! # Ok::<(), pointmill_format::WriteError>(())
//! ```

#[cfg(feature = "laz")]
mod chunk;
mod crs;
pub(crate) mod header;
mod heading;
mod kernels;
mod layout;
pub(crate) mod records;
mod strided;
mod tally;

#[cfg(feature = "laz")]
pub use chunk::ChunkEncoder;
pub use crs::{CrsKind, CrsRecords};
pub use heading::{Ending, Heading};
pub use layout::{FieldPlace, RecordLayout};
pub use strided::StridedColumn;
pub use tally::{Summary, Tally};

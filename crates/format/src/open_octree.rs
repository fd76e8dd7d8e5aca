//! Opens an octree of any kind.

use std::path::Path;

use crate::dataset_kind::{DatasetKind, locate};
use crate::octree::Octree;
use crate::{ReadError, potree1, potree2};

/// Opens the octree at `path`: a folder or its marker file, as the names of files tell ([`locate`]), (feature `zip`) an archive
/// with Potree 1.x in it, or (feature `las`) a COPC file.
///
/// # Errors
/// There is no dataset, or one that is no octree, or those of opening it.
pub fn open_octree(path: impl AsRef<Path>) -> Result<Box<dyn Octree>, ReadError> {
    let located = locate(path)?;
    match located.kind {
        DatasetKind::Potree1 => Ok(Box::new(potree1::Dataset::open(&located.path)?)),
        DatasetKind::Potree2 => Ok(Box::new(potree2::Dataset::open(&located.path)?)),
        #[cfg(feature = "las")]
        DatasetKind::Copc => Ok(Box::new(crate::copc::Dataset::open(&located.path)?)),
        other => Err(ReadError::unsupported(&located.path, format!("a {}, no octree", other.title()))),
    }
}

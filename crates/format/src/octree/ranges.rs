//! Which bytes of an index are taken.

use std::collections::BTreeMap;
use std::path::Path;

use crate::{NodeKey, ReadError};

/// The byte ranges of the chunks read so far. No two may overlap: that is what keeps a walk over hostile proxies from
/// going round in circles, and the number of nodes below what the file can hold.
#[derive(Debug, Clone, Default)]
pub(crate) struct ChunkRanges {
    /// Start → (end, root of the chunk).
    by_start: BTreeMap<u64, (u64, NodeKey)>,
}

impl ChunkRanges {
    /// Adds the chunk of `root`, or reports which chunk is there already.
    pub(crate) fn claim(&mut self, root: NodeKey, start: u64, size: u64, path: &Path) -> Result<(), ReadError> {
        let end = start.saturating_add(size);
        if let Some((_, (other_end, other))) = self.by_start.range(..end).next_back()
            && *other_end > start
        {
            let what = format!("the hierarchy chunk of {root} overlaps the one of {other}");
            return Err(ReadError::broken(path, start, what));
        }
        self.by_start.insert(start, (end, root));
        Ok(())
    }
}

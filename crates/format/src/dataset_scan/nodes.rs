//! The nodes of an octree that are read, all at once.

use crate::octree::{ChunkRanges, Octree, OctreeInfo, OctreeNode};
use crate::{NodeKey, OpenOptions, ReadError};

/// Bytes that the list of nodes may take, if nothing else is allowed.
const MOST_BYTES: u64 = 1 << 30;

/// The deepest level that is read.
pub(super) fn deepest(options: &OpenOptions, info: &OctreeInfo) -> u8 {
    let by_spacing = options.min_spacing.map(|least| {
        let is_read = |level: &u8| info.spacing_at(*level) >= least;
        (1..=NodeKey::MAX_LEVEL).take_while(is_read).last().unwrap_or(0)
    });
    let levels = [options.max_level, by_spacing];
    levels.into_iter().flatten().fold(NodeKey::MAX_LEVEL, u8::min)
}

/// The nodes down to the level `deepest`, in no order; `points` of each as the index says.
///
/// # Errors
/// Those of [`Octree::chunk`]; chunks that overlap; more nodes than there may be memory for.
pub(super) fn list(octree: &dyn Octree, deepest: u8, options: &OpenOptions) -> Result<Vec<OctreeNode>, ReadError> {
    let most = options.description_bytes.unwrap_or(MOST_BYTES) / size_of::<OctreeNode>() as u64;
    let (mut ranges, mut nodes, mut waiting) = (ChunkRanges::default(), Vec::new(), vec![octree.root()]);
    while let Some(proxy) = waiting.pop() {
        let path = octree.locate_index(&proxy);
        if proxy.byte_size > 0 {
            ranges.claim(proxy.key, proxy.byte_offset, proxy.byte_size, &path)?;
        }
        for node in octree.chunk(&proxy)?.into_iter().filter(|node| node.key.level <= deepest) {
            if !node.is_proxy {
                nodes.push(node);
            } else if node.key == proxy.key {
                let what = format!("the hierarchy chunk of {} begins with a proxy", node.key);
                return Err(ReadError::broken(path, node.byte_offset, what));
            } else {
                waiting.push(node);
            }
        }
        if nodes.len() as u64 > most {
            let what = format!("more than {most} nodes, whose list would take more memory than is allowed");
            return Err(ReadError::memory(path, what));
        }
    }
    Ok(nodes)
}

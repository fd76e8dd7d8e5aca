//! Where finished nodes go: the octree knows no format.

use pointmill_format::{NodeKey, NodePoints};
use serde::{Deserialize, Serialize};

use crate::cloud::Checksum;
use crate::error::ConvertError;
use crate::job::KeptFile;

/// A node that nothing changes any more, and where its bytes are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct FinishedNode {
    pub(crate) key: NodeKey,
    pub(crate) points: u32,
    /// Among the bytes of the whole tree.
    pub(crate) byte_offset: u64,
    pub(crate) byte_size: u64,
}

/// What a format does with finished nodes. Threads encode them alone; the octree decides the order of the bytes, which
/// depends on the tree alone.
pub(crate) trait NodeSink: Sync {
    /// One thread's means to encode nodes.
    type Encoder<'s>: NodeEncoder + Send
    where
        Self: 's;

    /// Means for one more thread.
    fn encoder(&self) -> Self::Encoder<'_>;

    /// Takes the bytes of `nodes`, which begin at `offset` among the bytes of the whole tree. Called from several threads,
    /// in any order; every node comes once, here or in parts.
    ///
    /// # Errors
    /// Whatever writing them meets.
    fn write(&self, nodes: &[FinishedNode], bytes: &[u8], offset: u64) -> Result<(), ConvertError>;

    /// Takes what an encoder has noticed ([`NodeEncoder::take_notes`]), perhaps in another process.
    ///
    /// # Errors
    /// Notes of something else.
    fn add_notes(&self, notes: &[u8]) -> Result<(), ConvertError>;

    /// The file of the nodes, if a job has it, too; offsets count from the first node of the tree.
    fn kept(&self) -> Option<KeptFile<'_>>;

    /// The tree that nodes may be taken from.
    fn earlier(&self) -> Option<&dyn EarlierTree> {
        None
    }

    /// Takes a part of the bytes of a node that has too many to have them in memory together: those from `at` on. The parts
    /// of a node come in order.
    ///
    /// # Errors
    /// As [`Self::write`].
    fn write_part(&self, node: &FinishedNode, bytes: &[u8], at: u64) -> Result<(), ConvertError>;
}

/// A tree that was made before, in the same cube and with the same settings, in the bytes of the same format: what no new
/// point touches is taken from it ([`super::earlier`]).
pub(crate) trait EarlierTree: Sync {
    /// All nodes.
    ///
    /// # Errors
    /// They cannot be read.
    fn nodes(&self) -> Result<Vec<FinishedNode>, ConvertError>;

    /// [`super::OctreeSettings::unit_points`] of that tree.
    fn unit_points(&self) -> u64;

    /// Fills `out` with the bytes from `offset` on.
    ///
    /// # Errors
    /// They cannot be read.
    fn read(&self, offset: u64, out: &mut [u8]) -> Result<(), ConvertError>;

    /// Appends the points of a node to `out`, as stored records of the run; `bytes`: those of the node.
    ///
    /// # Errors
    /// They cannot be decoded.
    fn records(
        &self,
        node: &FinishedNode,
        bytes: &[u8],
        points: &mut NodePoints,
        out: &mut Vec<u8>,
    ) -> Result<(), ConvertError>;
}

/// Makes the bytes of nodes.
pub(crate) trait NodeEncoder {
    /// Appends the bytes of a node to `out`. `records` are as stored; every one is added to `written` as it is read.
    ///
    /// # Errors
    /// A node that the format cannot hold.
    fn encode<'r>(
        &mut self,
        key: NodeKey,
        records: impl ExactSizeIterator<Item = &'r [u8]>,
        written: &mut Checksum,
        out: &mut Vec<u8>,
    ) -> Result<(), ConvertError>;

    /// What was noticed since the last call, or since the beginning: of the points of these nodes. What nobody takes goes to the
    /// sink once the encoder is dropped.
    ///
    /// # Errors
    /// It cannot be put into bytes.
    fn take_notes(&mut self) -> Result<Vec<u8>, ConvertError>;

    /// Notices of stored records, but for some of them, what [`Self::encode`] does, where their bytes are there already
    /// ([`NodeSink::earlier`]).
    fn notice(&mut self, _records: &mut [u8], _but_for: &mut [u8]) {}

    /// Bytes of a point, if the bytes of a node are those of its points one after the other, so that they may be encoded in
    /// parts.
    fn row_bytes(&self) -> Option<u64>;

    /// Bytes of a node before those of its points. Of a node that is encoded in parts the sink makes them.
    fn head_bytes(&self, _key: NodeKey) -> u64 {
        0
    }

    /// Bytes of memory that encoding takes for each point of a node beside its record, otherwise.
    fn bytes_per_point(&self) -> u64;
}

/// A number of points as nodes have it.
pub(super) fn points_of(count: u64) -> Result<u32, ConvertError> {
    u32::try_from(count)
        .map_err(|_| crate::error::Unsupported::CrowdedNode { points: count, max: u64::from(u32::MAX) }.into())
}

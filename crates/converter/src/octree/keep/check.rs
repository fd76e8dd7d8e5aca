//! Whether what a unit has left can be of it: what it counts, and where it says that nodes are. Its checksums say that it is as it
//! was written, not by whom.

use std::collections::HashSet;

use pointmill_format::NodeKey;

use super::super::sink::FinishedNode;
use super::{Kept, KeptPiece, Of};
use crate::cloud::{Checksum, lies_in};

/// No unit has more points: sums of such counts fit.
const MOST_POINTS: u64 = 1 << 48;

impl Kept {
    /// True if it can be of that unit: what it counts, and where it says that nodes are. The places that it names are looked up
    /// without being asked for again. `bytes`: of all that is behind one another in a stream of a piece, or of a large node.
    pub(super) fn can_be_of(&self, of: Of, stride: u64, bytes: impl Fn(usize, usize) -> Option<u64>) -> bool {
        let mut written = vec![0u64; of.streams];
        for (i, piece) in self.pieces.iter().enumerate() {
            let is_sound = match piece {
                KeptPiece::Nodes(runs) => {
                    runs.len() == of.streams
                        && runs.iter().enumerate().all(|(stream, nodes)| {
                            written[stream] += nodes.iter().map(|node| u64::from(node.points)).sum::<u64>();
                            nodes.iter().all(|node| lies_in(node.key, of.key)) && bytes(i, stream) == end_of(nodes)
                        })
                }
                KeptPiece::Large { key, points, .. } => {
                    lies_in(*key, of.key) && points.checked_mul(stride).is_some_and(|all| bytes(i, 0) == Some(all))
                }
            };
            if !is_sound {
                return false;
            }
        }
        let is_root = match self.root.first() {
            Some(root) => root.key == of.key && of.key != NodeKey::ROOT,
            None => of.key == NodeKey::ROOT,
        };
        let sums: Vec<u64> = self.written.iter().map(Checksum::count).collect();
        is_root
            && self.are_below(of.key)
            && sums == written
            && self.notes.len() == of.streams
            && self.ledger.can_be_of(MOST_POINTS)
            && self.overfull_leaves <= MOST_POINTS
    }

    /// True if no node comes twice, each is below another one of the unit or its root, and streams have the same nodes.
    fn are_below(&self, root: NodeKey) -> bool {
        let mut keys: Vec<NodeKey> = self.root.iter().map(|node| node.key).collect();
        for piece in &self.pieces {
            match piece {
                KeptPiece::Large { key, .. } => keys.push(*key),
                KeptPiece::Nodes(runs) => {
                    let nodes = |run: &[FinishedNode]| run.iter().map(|n| (n.key, n.points)).collect::<Vec<_>>();
                    let first = runs.first().map_or(Vec::new(), |run| nodes(run));
                    if runs.iter().any(|run| nodes(run) != first) {
                        return false;
                    }
                    keys.extend(first.into_iter().map(|(key, _)| key));
                }
            }
        }
        let count = keys.len();
        let keys: HashSet<NodeKey> = keys.into_iter().collect();
        let is_below = |key: &NodeKey| *key == root || key.parent().is_some_and(|parent| keys.contains(&parent));
        keys.len() == count && keys.iter().all(is_below)
    }
}

/// Where nodes end that follow one another from byte 0 on; `None`: they do not.
fn end_of(nodes: &[FinishedNode]) -> Option<u64> {
    nodes.iter().try_fold(0u64, |end, node| {
        let next = end.checked_add(node.byte_size);
        next.filter(|_| node.byte_offset == end && node.points > 0)
    })
}

//! What a unit leaves for other processes: sections of a file, in this order.
//!
//! | section | content | who reads it |
//! |---|---|---|
//! | 0 | what the unit came to ([`Kept`]) | all |
//! | 1 | what it has taken near its borders | units that touch it |
//! | 2 | records of the nodes that are pending, in preorder | the unit above it |
//! | 3 … | of each piece: the bytes of its nodes, a section for each stream; or the records of a large node | who puts all together |
//!
//! If the bytes are in the output already, because a job has that, too, there is one section in the place of those from 3 on: where
//! they are.

mod check;

use std::iter::Peekable;
use std::sync::Arc;

use pointmill_format::NodeKey;
use serde::{Deserialize, Serialize};

use super::finished::{Piece, Run};
use super::list::{List, Lists};
use super::raise::{Pending, Points};
use super::sink::FinishedNode;
use super::unit::{BuiltUnit, Outer};
use crate::cloud::{Checksum, Ledger, TREE_BITS, TreePoint, lies_in};
use crate::error::ConvertError;
use crate::job::{KeptFile, Place, UnitReader, UnitWriter};
use crate::runtime::DiskFile;

/// Records of a pending node up to this size are taken into memory; larger ones stay in the file.
const LARGE_BYTES: u64 = 1 << 20;

const KEPT: usize = 0;
const BORDERS: usize = 1;
const PENDING: usize = 2;
const PIECES: usize = 3;

#[derive(Serialize, Deserialize)]
struct Kept {
    is_in_place: bool,
    pieces: Vec<KeptPiece>,
    /// The root, and what is pending below it, in preorder; empty: it is that of the tree.
    root: Vec<KeptNode>,
    ledger: Ledger,
    written: Vec<Checksum>,
    overfull_leaves: u64,
    notes: Vec<Vec<u8>>,
}

#[derive(Serialize, Deserialize)]
enum KeptPiece {
    /// For each stream.
    Nodes(Vec<Vec<FinishedNode>>),
    Large {
        key: NodeKey,
        points: u64,
        is_one_place: bool,
    },
}

#[derive(Clone, Copy, Serialize, Deserialize)]
struct KeptNode {
    key: NodeKey,
    points: u64,
    is_one_place: bool,
    is_inner: bool,
}

/// Which unit a file is of.
#[derive(Clone, Copy)]
pub(super) struct Of {
    pub(super) key: NodeKey,
    pub(super) streams: usize,
}

/// Puts a unit into its file.
pub(super) fn write(unit: &BuiltUnit, lists: &Lists, file: &mut UnitWriter) -> Result<(), ConvertError> {
    write_head(unit, false, lists, file)?;
    for piece in &unit.pieces {
        match piece {
            Piece::Nodes(runs) => {
                for run in runs {
                    file.begin();
                    file.write(&run.bytes)?;
                }
            }
            Piece::Large(_, list) => {
                file.begin();
                write_list(list, lists, file)?;
            }
        }
    }
    Ok(())
}

/// Puts a unit without large nodes into its file, but for its bytes, which have no place in the output yet.
pub(super) fn write_first(unit: &BuiltUnit, lists: &Lists, file: &mut UnitWriter) -> Result<(), ConvertError> {
    write_head(unit, true, lists, file)?;
    file.pause()
}

/// Ends what [`write_first`] began; `places`: of each piece, in each stream.
pub(super) fn write_places(mut file: UnitWriter, places: &[Place]) -> Result<(), ConvertError> {
    file.put(&places)?;
    file.finish(false) // what the disk loses is found out by its sums, and made again
}

fn write_head(unit: &BuiltUnit, is_in_place: bool, lists: &Lists, file: &mut UnitWriter) -> Result<(), ConvertError> {
    let piece = |piece: &Piece| match piece {
        Piece::Nodes(runs) => KeptPiece::Nodes(runs.iter().map(|run| run.nodes.clone()).collect()),
        Piece::Large(key, list) => {
            KeptPiece::Large { key: *key, points: list.count(), is_one_place: list.is_one_place }
        }
    };
    file.put(&Kept {
        is_in_place,
        pieces: unit.pieces.iter().map(piece).collect(),
        root: unit.root.as_ref().map(kept_nodes).unwrap_or_default(),
        ledger: unit.ledger.clone(),
        written: unit.written.clone(),
        overfull_leaves: unit.overfull_leaves,
        notes: unit.notes.clone(),
    })?;
    file.put(&unit.outer)?;
    file.begin();
    unit.root.iter().try_for_each(|root| write_pending(root, lists, file))
}

fn kept_nodes(node: &Pending<List>) -> Vec<KeptNode> {
    let Pending { key, points, is_inner, children } = node;
    let (is_one_place, points) = (points.is_one_place, points.count());
    let mut nodes = vec![KeptNode { key: *key, points, is_one_place, is_inner: *is_inner }];
    nodes.extend(children.iter().flat_map(kept_nodes));
    nodes
}

fn write_pending(node: &Pending<List>, lists: &Lists, file: &mut UnitWriter) -> Result<(), ConvertError> {
    write_list(&node.points, lists, file)?;
    node.children.iter().try_for_each(|child| write_pending(child, lists, file))
}

fn write_list(list: &List, lists: &Lists, file: &mut UnitWriter) -> Result<(), ConvertError> {
    lists.each(list, |records| file.write(records).map(|()| true))
}

/// All that a unit has left; `kept`: the output in each stream, if a job has it.
pub(super) fn read(
    file: &UnitReader,
    of: Of,
    lists: &Lists,
    kept: Option<&[KeptFile<'_>]>,
) -> Result<BuiltUnit, ConvertError> {
    let unit: Kept = file.get(KEPT)?;
    let places = if unit.is_in_place { Some(places_of(file, &unit, kept.unwrap_or_default())?) } else { None };
    if !unit.can_be_of(of, lists.stride as u64, lengths(file, &unit, places.as_deref())) {
        return Err(file.damaged(0));
    }
    let (mut places, mut section) = (places.into_iter().flatten(), PIECES);
    let mut pieces = Vec::with_capacity(unit.pieces.len());
    for piece in unit.pieces {
        pieces.push(match piece {
            KeptPiece::Nodes(runs) if unit.is_in_place => {
                let run = |nodes| Run { nodes, bytes: Vec::new(), in_place: places.next() };
                Piece::Nodes(runs.into_iter().map(run).collect())
            }
            KeptPiece::Nodes(runs) => {
                let run = |nodes| {
                    let bytes = file.bytes(section)?;
                    section += 1;
                    Ok(Run { nodes, bytes, in_place: None })
                };
                Piece::Nodes(runs.into_iter().map(run).collect::<Result<_, ConvertError>>()?)
            }
            KeptPiece::Large { key, points, is_one_place } => {
                let (bytes, start) = file.place(section)?;
                section += 1;
                Piece::Large(key, List::in_file(bytes, start, points, is_one_place))
            }
        });
    }
    let root = read_pending(file, unit.root, lists)?;
    let Kept { ledger, written, overfull_leaves, notes, .. } = Kept { pieces: Vec::new(), root: Vec::new(), ..unit };
    let outer = read_outer(file, of)?;
    Ok(BuiltUnit { pieces, root, ledger, written, overfull_leaves, notes, outer, file: None })
}

/// How many bytes a unit has left of a piece in a stream.
fn lengths(file: &UnitReader, unit: &Kept, places: Option<&[Place]>) -> impl Fn(usize, usize) -> Option<u64> {
    let mut first = 0;
    let firsts = unit.pieces.iter().map(|piece| {
        let count = match piece {
            KeptPiece::Nodes(runs) => runs.len(),
            KeptPiece::Large { .. } => 1,
        };
        first += count;
        first - count
    });
    let firsts: Vec<usize> = firsts.collect();
    let bytes: Vec<u64> = match places {
        Some(places) => places.iter().map(|place| place.bytes).collect(),
        None => (PIECES..file.sections()).map(|section| file.len(section)).collect(),
    };
    move |piece, stream| bytes.get(firsts.get(piece)? + stream).copied()
}

/// Where the bytes of a unit are in the output, of each piece in each stream.
///
/// # Errors
/// They are not there any more.
fn places_of(file: &UnitReader, unit: &Kept, kept: &[KeptFile<'_>]) -> Result<Vec<Place>, ConvertError> {
    let places: Vec<Place> = file.get(PIECES)?;
    let streams = unit.pieces.iter().flat_map(|piece| match piece {
        KeptPiece::Nodes(runs) => 0..runs.len(),
        KeptPiece::Large { .. } => 0..usize::MAX, // has no place
    });
    let mut of = places.iter();
    for stream in streams {
        let (Some(place), Some(kept)) = (of.next(), kept.get(stream)) else { return Err(file.damaged(0)) };
        if !kept.holds(place)? {
            return Err(file.damaged(0));
        }
    }
    if of.next().is_none() { Ok(places) } else { Err(file.damaged(0)) }
}

/// What a unit has taken near its borders.
pub(super) fn read_outer(file: &UnitReader, of: Of) -> Result<Outer, ConvertError> {
    let outer: Outer = file.get(BORDERS)?;
    let is_there = |point: &TreePoint| point.0.iter().all(|t| t >> TREE_BITS == 0);
    let is_sound = outer.iter().all(|(node, points)| lies_in(*node, of.key) && points.iter().all(is_there));
    if is_sound { Ok(outer) } else { Err(file.damaged(0)) }
}

/// The root of a unit, with what is pending below it; `None`: that of the tree.
pub(super) fn read_root(file: &UnitReader, of: Of, lists: &Lists) -> Result<Option<Pending<List>>, ConvertError> {
    let kept: Kept = file.get(KEPT)?;
    if !kept.can_be_of(of, lists.stride as u64, lengths(file, &kept, None)) {
        return Err(file.damaged(0));
    }
    read_pending(file, kept.root, lists)
}

fn read_pending(file: &UnitReader, nodes: Vec<KeptNode>, lists: &Lists) -> Result<Option<Pending<List>>, ConvertError> {
    let stride = lists.stride as u64;
    let records = nodes.iter().try_fold(0u64, |all, node| all.checked_add(node.points));
    if records.and_then(|records| records.checked_mul(stride)) != Some(file.len(PENDING)) {
        return Err(file.damaged(0));
    }
    let (bytes, mut at) = file.place(PENDING)?;
    let mut nodes = nodes.into_iter().peekable();
    let root = nodes.next().map(|root| pending(root, &mut nodes, &bytes, &mut at, lists)).transpose()?;
    // one that is no child of any before it
    if nodes.next().is_none() { Ok(root) } else { Err(file.damaged(0)) }
}

/// A node and those below it, which come next. No deeper than levels go, since a child is one level below its parent.
fn pending(
    node: KeptNode,
    next: &mut Peekable<impl Iterator<Item = KeptNode>>,
    file: &Arc<DiskFile>,
    at: &mut u64,
    lists: &Lists,
) -> Result<Pending<List>, ConvertError> {
    let (start, bytes) = (*at, node.points * lists.stride as u64);
    *at += bytes;
    let points = if bytes > LARGE_BYTES || node.is_one_place {
        List::in_file(Arc::clone(file), start, node.points, node.is_one_place)
    } else {
        let mut records = vec![0; bytes as usize];
        file.read_at(&mut records, start, "reading a unit")?;
        let mut list = List::of_chunk(records, lists.stride);
        lists.admit(&mut list)?;
        list
    };
    let mut children = Vec::new();
    while let Some(child) = next.next_if(|child| lies_in(child.key, node.key) && child.key.parent() == Some(node.key)) {
        children.push(pending(child, next, file, at, lists)?);
    }
    Ok(Pending { key: node.key, points, is_inner: node.is_inner, children })
}

#[cfg(test)]
mod tests;

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

use std::sync::Arc;

use pointmill_format::NodeKey;
use serde::{Deserialize, Serialize};

use super::finished::{Piece, Run};
use super::list::{List, Lists};
use super::raise::{Pending, Points};
use super::sink::FinishedNode;
use super::unit::{BuiltUnit, Outer};
use crate::cloud::{Checksum, Ledger};
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
    root: Option<KeptNode>,
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

#[derive(Serialize, Deserialize)]
struct KeptNode {
    key: NodeKey,
    points: u64,
    is_one_place: bool,
    is_inner: bool,
    children: Vec<KeptNode>,
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
        root: unit.root.as_ref().map(kept_node),
        ledger: unit.ledger.clone(),
        written: unit.written.clone(),
        overfull_leaves: unit.overfull_leaves,
        notes: unit.notes.clone(),
    })?;
    file.put(&unit.outer)?;
    file.begin();
    unit.root.iter().try_for_each(|root| write_pending(root, lists, file))
}

fn kept_node(node: &Pending<List>) -> KeptNode {
    KeptNode {
        key: node.key,
        points: node.points.count(),
        is_one_place: node.points.is_one_place,
        is_inner: node.is_inner,
        children: node.children.iter().map(kept_node).collect(),
    }
}

fn write_pending(node: &Pending<List>, lists: &Lists, file: &mut UnitWriter) -> Result<(), ConvertError> {
    write_list(&node.points, lists, file)?;
    node.children.iter().try_for_each(|child| write_pending(child, lists, file))
}

fn write_list(list: &List, lists: &Lists, file: &mut UnitWriter) -> Result<(), ConvertError> {
    lists.each(list, |records| file.write(records).map(|()| true))
}

/// All that a unit has left; `kept`: the output in each stream, if a job has it.
pub(super) fn read(file: &UnitReader, lists: &Lists, kept: Option<&[KeptFile<'_>]>) -> Result<BuiltUnit, ConvertError> {
    let unit: Kept = file.get(KEPT)?;
    let places = if unit.is_in_place { Some(places_of(file, &unit, kept.unwrap_or_default())?) } else { None };
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
    let root = unit.root.map(|root| read_pending(file, root, lists)).transpose()?;
    let Kept { ledger, written, overfull_leaves, notes, .. } = Kept { pieces: Vec::new(), root: None, ..unit };
    let outer = read_outer(file)?;
    Ok(BuiltUnit { pieces, root, ledger, written, overfull_leaves, notes, outer, file: None, is_taken_over: false })
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
pub(super) fn read_outer(file: &UnitReader) -> Result<Outer, ConvertError> {
    file.get(BORDERS)
}

/// The root of a unit, with what is pending below it; `None`: that of the tree.
pub(super) fn read_root(file: &UnitReader, lists: &Lists) -> Result<Option<Pending<List>>, ConvertError> {
    let kept: Kept = file.get(KEPT)?;
    kept.root.map(|root| read_pending(file, root, lists)).transpose()
}

fn read_pending(file: &UnitReader, root: KeptNode, lists: &Lists) -> Result<Pending<List>, ConvertError> {
    let (bytes, start) = file.place(PENDING)?;
    let mut at = start;
    let node = pending(root, &bytes, &mut at, lists)?;
    if at - start == file.len(PENDING) { Ok(node) } else { Err(file.damaged(at)) }
}

fn pending(node: KeptNode, file: &Arc<DiskFile>, at: &mut u64, lists: &Lists) -> Result<Pending<List>, ConvertError> {
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
    let children = node.children.into_iter().map(|child| pending(child, file, at, lists)).collect::<Result<_, _>>()?;
    Ok(Pending { key: node.key, points, is_inner: node.is_inner, children })
}

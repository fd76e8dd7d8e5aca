//! Whether what a unit has left can be of its task: every number that others look something up by.

use pointmill_format::batches::{BATCH_POINTS, Layout, Part as Of, PointSection};

use super::buckets::Task;
use super::lod::{Edges, OpenCell};
use super::output::{ORIGINAL_BYTES, Part, Piece, pieces};
use super::task::TaskResults;
use crate::job::Said;

/// What a unit came to: figures, what is kept until the end, and entries of the originals.
pub(super) type CameTo = (TaskResults, Part, Vec<u8>);

/// True if it can be of the task with that number.
pub(super) fn can_be_of(said: &Said<u64, CameTo>, index: usize, task: &Task, layout: &Layout) -> bool {
    let (results, part, originals) = &said.came_to;
    let pieces: Vec<Piece> = pieces(task.first_point, task.points).collect();
    are_bytes_of(said, &pieces, layout)
        && are_figures(results, index, task)
        && part.can_be_of(&pieces, task.points, layout)
        && are_originals(part.originals(), originals, &pieces, layout)
}

/// True if these are the bytes of all pieces and no others: colours and attributes, and planes where a batch is whole.
fn are_bytes_of(said: &Said<u64, CameTo>, pieces: &[Piece], layout: &Layout) -> bool {
    let is_there = |of: Of, piece: &Piece| matches!(of, Of::Colour | Of::Attribute(_)) || piece.is_whole(layout);
    let place = |PointSection { section, bytes_per_point, .. }: PointSection, piece: &Piece| {
        let first = layout.slot(piece.batch).1 + piece.start;
        (Layout::point_offset(section, bytes_per_point, first), bytes_per_point * piece.range.len() as u64)
    };
    let of_piece = |piece| layout.sections().filter(move |s| is_there(s.part, piece)).map(move |s| place(s, piece));
    let mut expected: Vec<(u64, u64)> = pieces.iter().flat_map(of_piece).collect();
    let in_place = said.in_place.iter().flatten();
    let mut found: Vec<_> = in_place.clone().map(|(offset, at)| (*offset, at.bytes)).collect();
    found.extend(&said.belong);
    expected.sort_unstable();
    found.sort_unstable();
    found == expected && in_place.into_iter().all(|(offset, at)| *offset == at.offset)
}

fn are_figures(results: &TaskResults, index: usize, task: &Task) -> bool {
    let TaskResults { ledger, lod_points, changed, edges } = results;
    let points = lod_points.iter().try_fold(0u64, |all, points| all.checked_add(*points));
    let is_cell = |cell: &OpenCell| {
        let is_of_task = cell.candidate.checked_sub(task.first_point).is_some_and(|at| at < task.points);
        is_of_task && cell.colours.can_be_of(task.points)
    };
    let are_cells = |edges: &Edges| match edges {
        Edges::One(only) => is_cell(only),
        Edges::Two(first, last) => is_cell(first) && is_cell(last),
    };
    let is_own = |(of, edges): &(usize, [Option<Edges>; _])| *of == index && edges.iter().flatten().all(are_cells);
    points == Some(task.points)
        && *changed <= task.points
        && ledger.can_be_of(task.points)
        && edges.len() == 1
        && edges.iter().all(is_own)
}

/// True if entries are those of pieces, each in ascending order of its storage indices.
fn are_originals(of_pieces: &[(u32, u32)], entries: &[u8], pieces: &[Piece], layout: &Layout) -> bool {
    let (mut entries, rest) = entries.as_chunks::<ORIGINAL_BYTES>();
    for (first, count) in of_pieces {
        let Some((own, others)) = entries.split_at_checked(*count as usize) else { return false };
        let index = |entry: &[u8; ORIGINAL_BYTES]| u64::from_le_bytes(*entry) as u32;
        let is_piece = |piece: &Piece| layout.slot(piece.batch).1 + piece.start == *first;
        let end = first.saturating_add(BATCH_POINTS);
        let are_inside = own.iter().map(index).all(|index| (*first..end).contains(&index));
        if !pieces.iter().any(is_piece) || !are_inside || !own.is_sorted_by(|a, b| index(a) < index(b)) {
            return false;
        }
        entries = others;
    }
    rest.is_empty() && entries.is_empty()
}

//! Cuts the cloud into chunks: octree nodes small enough to be built in memory, alone. Which nodes these are changes
//! nothing in the output; it is a matter of memory and load.

use pointmill_format::NodeKey;

use crate::error::ConvertError;
use crate::gather::{Cell, Gathered, Grouping, Segment};
use crate::grid::TREE_BITS;
use crate::records::RecordFrame;

/// A subtree that is built alone.
#[derive(Debug)]
pub(crate) struct Chunk {
    pub(crate) key: NodeKey,
    pub(crate) points: u64,
    /// Where its records are, in order of block.
    pub(crate) segments: Vec<Segment>,
}

/// Levels by which a cell that is too large is divided at once.
const SPLIT_LEVELS: u32 = 3;

/// Records looked at together while a cell is divided.
const SPLIT_POINTS: usize = 65_536;

/// The chunks of the cloud, in Morton order, none larger than `max_points` unless its points share one place.
pub(crate) fn plan(gathered: &mut Gathered, frame: &RecordFrame, max_points: u64) -> Result<Vec<Chunk>, ConvertError> {
    let mut cells = Vec::with_capacity(gathered.cells.len());
    for cell in std::mem::take(&mut gathered.cells) {
        divide(cell, gathered, frame, max_points, &mut cells)?;
    }
    let mut chunks = Vec::new();
    choose(NodeKey::ROOT, &mut cells, max_points, &mut chunks);
    Ok(chunks)
}

/// Divides a cell until every part fits, or holds one place only.
fn divide(
    cell: Cell,
    gathered: &Gathered,
    frame: &RecordFrame,
    max_points: u64,
    out: &mut Vec<Cell>,
) -> Result<(), ConvertError> {
    let mut stack = vec![cell];
    while let Some(cell) = stack.pop() {
        if cell.points <= max_points || cell.is_one_place {
            out.push(cell);
            continue;
        }
        let mut parts = divide_once(&cell, gathered, frame)?;
        // The stack returns the last first.
        parts.reverse();
        stack.append(&mut parts);
    }
    Ok(())
}

fn divide_once(cell: &Cell, gathered: &Gathered, frame: &RecordFrame) -> Result<Vec<Cell>, ConvertError> {
    let level = (u32::from(cell.key.level) + SPLIT_LEVELS).min(TREE_BITS);
    let mut parts: Vec<Cell> = Vec::new();
    let mut grouping = Grouping::default();
    let (mut records, mut sorted, mut cells) = (Vec::new(), Vec::new(), Vec::new());
    let mut extremes: Option<([u32; 3], [u32; 3])> = None;
    for segment in &cell.segments {
        let mut start = 0;
        while start < segment.count {
            let count = (segment.count - start).min(SPLIT_POINTS as u32);
            let part = Segment { block: segment.block, start: segment.start + start, count };
            start += count;
            records.clear();
            let source = gathered.store.take(part, &mut records)?;
            cells.clear();
            for record in records.chunks_exact(frame.stride) {
                let t = frame.tree(record);
                let (lo, hi) = extremes.get_or_insert((t, t));
                for a in 0..3 {
                    lo[a] = lo[a].min(t[a]);
                    hi[a] = hi[a].max(t[a]);
                }
                cells.push(crate::morton::interleave(t.map(|t| (t >> (TREE_BITS - level)) & 0x1f_ffff)));
            }
            grouping.group(&cells);
            sorted.clear();
            for &i in &grouping.order {
                let at = i as usize * frame.stride;
                sorted.extend_from_slice(&records[at..at + frame.stride]);
            }
            let block = gathered.store.open(source)?;
            gathered.store.fill(block, &mut sorted)?;
            let mut at = 0;
            for &(_, count) in &grouping.groups {
                let first = grouping.order[at as usize] as usize * frame.stride;
                let t = frame.tree(&records[first..first + frame.stride]);
                let [x, y, z] = t.map(|t| t >> (TREE_BITS - level));
                let key = NodeKey { level: level as u8, x, y, z };
                let segment = Segment { block, start: at, count };
                at += count;
                match parts.iter_mut().find(|p| p.key == key) {
                    Some(part) => {
                        part.points += u64::from(count);
                        part.segments.push(segment);
                    }
                    None => {
                        parts.push(Cell {
                            key,
                            points: u64::from(count),
                            segments: vec![segment],
                            is_one_place: false,
                        });
                    }
                }
            }
        }
    }
    if extremes.is_some_and(|(lo, hi)| lo == hi) {
        parts.iter_mut().for_each(|p| p.is_one_place = true);
    }
    parts.sort_unstable_by(|a, b| crate::morton::compare([a.key.x, a.key.y, a.key.z], [b.key.x, b.key.y, b.key.z]));
    Ok(parts)
}

/// The highest nodes that are small enough (or hold one place only) become chunks.
fn choose(node: NodeKey, cells: &mut [Cell], max_points: u64, out: &mut Vec<Chunk>) {
    let points: u64 = cells.iter().map(|c| c.points).sum();
    if points == 0 {
        return;
    }
    let is_last = cells.len() == 1 && (cells[0].is_one_place || cells[0].key == node);
    if points <= max_points || is_last {
        let mut segments: Vec<Segment> = cells.iter_mut().flat_map(|c| std::mem::take(&mut c.segments)).collect();
        segments.sort_unstable_by_key(|s| (s.block, s.start));
        segments.dedup_by(|next, previous| {
            let joins = next.block == previous.block && next.start == previous.start + previous.count;
            if joins {
                previous.count += next.count;
            }
            joins
        });
        out.push(Chunk { key: node, points, segments });
        return;
    }
    let mut rest = cells;
    for child in (0..8).filter_map(|c| node.child(c)) {
        let inside = rest.iter().take_while(|c| c.key.ancestor(child.level) == Some(child)).count();
        let (mine, others) = rest.split_at_mut(inside);
        choose(child, mine, max_points, out);
        rest = others;
    }
    debug_assert!(rest.is_empty());
}

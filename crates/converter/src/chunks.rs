//! Cuts the cloud into chunks: octree nodes small enough to be built in memory, alone. Which nodes these are changes
//! nothing in the output; it is a matter of memory and load.

use pointmill_format::NodeKey;

use crate::error::ConvertError;
use crate::gather::{Cell, Gathered, Grouping, Moments, Segment};
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
pub(crate) fn plan(gathered: &Gathered, frame: &RecordFrame, max_points: u64) -> Result<Vec<Chunk>, ConvertError> {
    let mut cells = Vec::with_capacity(gathered.cells.len());
    for cell in &gathered.cells {
        divide(cell.clone(), gathered, frame, max_points, &mut cells)?;
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
    let mut division = Division::new(cell, gathered, frame);
    let mut records = Vec::new();
    let mut source = None;
    for segment in &cell.segments {
        let mut start = 0;
        while start < segment.count {
            let before = records.len();
            let room = SPLIT_POINTS - before / frame.stride;
            let count = (segment.count - start).min(room as u32);
            let part = Segment { block: segment.block, start: segment.start + start, count };
            start += count;
            let from = gathered.store.take(part, &mut records)?;
            if let Some(source) = source.filter(|s| *s != from) {
                // A block holds records of one source.
                let rest = records.split_off(before);
                division.add(&records, source)?;
                records = rest;
            }
            source = Some(from);
            if records.len() >= SPLIT_POINTS * frame.stride {
                division.add(&records, from)?;
                records.clear();
            }
        }
    }
    if let Some(source) = source {
        division.add(&records, source)?;
    }
    Ok(division.finish())
}

/// The parts of a cell, as far as they are known.
struct Division<'a> {
    gathered: &'a Gathered,
    frame: &'a RecordFrame,
    level: u32,
    parts: Vec<Cell>,
    extremes: Option<([u32; 3], [u32; 3])>,
    grouping: Grouping,
    cells: Vec<u64>,
    sorted: Vec<u8>,
}

impl<'a> Division<'a> {
    fn new(cell: &Cell, gathered: &'a Gathered, frame: &'a RecordFrame) -> Self {
        Self {
            gathered,
            frame,
            level: (u32::from(cell.key.level) + SPLIT_LEVELS).min(TREE_BITS),
            parts: Vec::new(),
            extremes: None,
            grouping: Grouping::default(),
            cells: Vec::new(),
            sorted: Vec::new(),
        }
    }

    /// Puts records of one source, many at a time so that the parts come in long segments, into a block of their own.
    fn add(&mut self, records: &[u8], source: u32) -> Result<(), ConvertError> {
        let (stride, level, frame) = (self.frame.stride, self.level, self.frame);
        if records.is_empty() {
            return Ok(());
        }
        self.cells.clear();
        for record in records.chunks_exact(stride) {
            let t = frame.tree(record);
            let (lo, hi) = self.extremes.get_or_insert((t, t));
            for a in 0..3 {
                lo[a] = lo[a].min(t[a]);
                hi[a] = hi[a].max(t[a]);
            }
            self.cells.push(crate::morton::interleave(t.map(|t| (t >> (TREE_BITS - level)) & 0x1f_ffff)));
        }
        self.grouping.group(&self.cells);
        self.sorted.clear();
        for &i in &self.grouping.order {
            let at = i as usize * stride;
            self.sorted.extend_from_slice(&records[at..at + stride]);
        }
        let block = self.gathered.store.open(source)?;
        self.gathered.store.refill(block, &mut self.sorted)?;
        let mut at = 0;
        for &(_, count) in &self.grouping.groups {
            let first = self.grouping.order[at as usize] as usize * stride;
            let t = frame.tree(&records[first..first + stride]);
            let [x, y, z] = t.map(|t| t >> (TREE_BITS - level));
            let key = NodeKey { level: level as u8, x, y, z };
            let segment = Segment { block, start: at, count };
            at += count;
            match self.parts.iter_mut().find(|p| p.key == key) {
                Some(part) => {
                    part.points += u64::from(count);
                    part.segments.push(segment);
                }
                None => {
                    let (points, segments) = (u64::from(count), vec![segment]);
                    self.parts.push(Cell { key, points, segments, is_one_place: false, moments: Moments::default() });
                }
            }
        }
        Ok(())
    }

    fn finish(mut self) -> Vec<Cell> {
        if self.extremes.is_some_and(|(lo, hi)| lo == hi) {
            self.parts.iter_mut().for_each(|p| p.is_one_place = true);
        }
        let xyz = |p: &Cell| [p.key.x, p.key.y, p.key.z];
        self.parts.sort_unstable_by(|a, b| crate::morton::compare(xyz(a), xyz(b)));
        self.parts
    }
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

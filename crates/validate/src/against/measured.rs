//! What lattice and format do to the positions of the sources, measured while they are compared.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use super::block::Block;
use super::rules::Rules;
use crate::accuracy::{Ordered, Side};

/// What was measured.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Measured {
    /// The lattice against the sources.
    pub(crate) lattice: Side,
    /// What is decoded against the lattice, where only the sources tell the integers.
    pub(crate) format: Option<Side>,
}

/// A place in the dataset, what a reader decodes there (bits), and the integers that it stands for.
type Row = (i64, [u64; 3], [i64; 3]);

/// What is measured of the blocks of all files, in any order.
pub(super) struct Parts<'a> {
    rules: &'a Rules,
    by_block: Ordered<(usize, u64), [Side; 2]>,
    /// Points are gathered to find those that fall together; if they fit into memory.
    rows: Mutex<Vec<Row>>,
    counts_merged: bool,
    /// The job's point and the mark of every position, to find those that fall together.
    places: Mutex<Vec<([i64; 3], u64)>>,
    counts_fallen: bool,
    moves: AtomicBool,
}

impl<'a> Parts<'a> {
    /// `memory_bytes`: of which half may be used.
    pub(super) fn new(rules: &'a Rules, points: u64, memory_bytes: u64) -> Self {
        let rows = if rules.stored.is_some() { room(points, memory_bytes / 4) } else { None };
        let places = room(points, memory_bytes / 4);
        Self {
            rules,
            by_block: Ordered::default(),
            counts_merged: rows.is_some(),
            rows: Mutex::new(rows.unwrap_or_default()),
            counts_fallen: places.is_some(),
            places: Mutex::new(places.unwrap_or_default()),
            moves: AtomicBool::new(false),
        }
    }

    /// Takes in a block of the file `at`.
    pub(super) fn add(&self, block: &Block, at: usize) {
        let (mut lattice, mut format) = (Side::default(), Side::default());
        let (mut rows, mut places) = (Vec::new(), Vec::new());
        let moved = &block.moved;
        for i in (0..block.len()).filter(|i| block.keep[*i]) {
            let at = |columns: &[Vec<f64>; 3]| columns.each_ref().map(|c| c[i]);
            lattice.deviation.add(at(&moved.lattice), at(&moved.world));
            lattice.lost += u64::from(moved.lost[i]);
            if let Some(mark) = moved.marks.get(i).filter(|_| self.counts_fallen) {
                places.push((moved.steps.get(i).copied().unwrap_or_else(|| block.position(i)), *mark));
            }
            if let (Some(stored), Some(step)) = (&self.rules.stored, moved.steps.get(i)) {
                let (words, meant) = (block.position(i), self.rules.meant(*step));
                let decoded = stored.world(words);
                format.deviation.add([0, 1, 2].map(|a| decoded[a] - meant[a]), meant);
                let back = [0, 1, 2].map(|a| self.rules.steps(a, decoded[a]));
                format.lost += u64::from(back != *step);
                if self.counts_merged {
                    rows.push((words[0] >> 32, decoded.map(|v| (v + 0.0).to_bits()), *step));
                }
            }
        }
        if lattice.deviation.max != [0.0; 3] {
            self.moves.store(true, Relaxed);
        }
        self.by_block.put((at, moved.first), [lattice, format]);
        if let Ok(mut all) = self.rows.lock() {
            all.append(&mut rows);
        }
        if let Ok(mut all) = self.places.lock() {
            all.append(&mut places);
        }
    }

    pub(super) fn finish(self) -> Measured {
        let [mut lattice, mut format] = [Side::default(); 2];
        self.by_block.finish().for_each(|[l, f]| {
            lattice.merge(&l);
            format.merge(&f);
        });
        let places = self.places.into_inner().unwrap_or_default();
        lattice.merged = match self.moves.into_inner() {
            false => Some(0), // what does not move does not fall together
            true => self.counts_fallen.then(|| fallen(places)),
        };
        let rows = self.rows.into_inner().unwrap_or_default();
        format.merged = self.counts_merged.then(|| merged(rows));
        Measured { lattice, format: self.rules.stored.is_some().then_some(format) }
    }
}

/// Memory for so many values, if it is within `most` bytes. It is touched as it is filled, and does not grow.
fn room<T>(values: u64, most: u64) -> Option<Vec<T>> {
    let mut room = Vec::new();
    let fits = values.saturating_mul(size_of::<T>() as u64) <= most;
    (fits && room.try_reserve_exact(usize::try_from(values).ok()?).is_ok()).then_some(room)
}

/// Points that share their point of the lattice with another position of the sources.
fn fallen(mut places: Vec<([i64; 3], u64)>) -> u64 {
    places.sort_unstable();
    let shared = places.chunk_by(|a, b| a.0 == b.0).filter(|p| p.first().map(|r| r.1) != p.last().map(|r| r.1));
    shared.map(|p| p.len() as u64).sum()
}

/// Points that are decoded to the position of another point of the lattice.
fn merged(mut rows: Vec<Row>) -> u64 {
    rows.sort_unstable();
    let places = rows.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1));
    places.filter(|p| p.first().map(|r| r.2) != p.last().map(|r| r.2)).map(|p| p.len() as u64).sum()
}

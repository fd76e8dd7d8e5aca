//! Levels of detail of a task's points, in one pass in Morton order with one open cell a level.

use pointmill_format::batches::{ColourSum, colour_word, rgb_of};
use serde::{Deserialize, Serialize};

use super::frame::Frame;

/// Levels that have cells.
pub(super) const LEVELS: usize = 3;

/// What is known of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct OpenCell {
    /// Its index in the grid of its level.
    pub(super) key: [u32; 3],
    pub(super) colours: ColourSum,
    pub(super) distance_squared: f64,
    /// Morton index of the point nearest to the centre; while a task goes on, counted from its first point.
    pub(super) candidate: u64,
    /// Once the task has ended: the candidate's colour word before averaging, and its word so far.
    pub(super) word: u32,
    pub(super) shown: u32,
}

/// Cells of one level of a task that may go on in its neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) enum Edges {
    /// All points lie in one cell.
    One(OpenCell),
    /// The first and the last.
    Two(OpenCell, OpenCell),
}

/// The pass over the points of a task.
#[derive(Debug, Default)]
pub(super) struct Levels {
    points: u64,
    open: [Option<OpenCell>; LEVELS],
    first: [Option<OpenCell>; LEVELS],
}

impl Levels {
    /// Takes the next points, in order: relative positions (an axis each) and colour words before averaging. Words of
    /// the candidates of finished cells are replaced in `shown`, which holds all points of the task from its first on,
    /// coarser levels later.
    pub(super) fn add(&mut self, frame: &Frame, relative: [&[f64]; 3], words: &[u32], shown: &mut [u32]) {
        let [x, y, z] = relative;
        for (((x, y), z), word) in x.iter().zip(y).zip(z).zip(words) {
            let fine = [*x, *y, *z].map(|r| frame.cells(r) * 4.0);
            let key = fine.map(|v| v as u32);
            let changed = self.open[2]
                .map_or(u32::MAX, |open| (open.key[0] ^ key[0]) | (open.key[1] ^ key[1]) | (open.key[2] ^ key[2]));
            if changed != 0 {
                self.close_down_to(changed, shown);
                for (level, open) in self.open.iter_mut().enumerate() {
                    let key = key.map(|k| k >> (2 - level));
                    open.get_or_insert_with(|| OpenCell {
                        key,
                        colours: ColourSum::default(),
                        distance_squared: f64::INFINITY,
                        candidate: self.points,
                        word: 0,
                        shown: 0,
                    });
                }
            }
            for (level, open) in self.open.iter_mut().enumerate() {
                let Some(open) = open else { continue };
                // dividing by powers of two is exact: these are u · 2^level and the cell's index
                let d = |a: usize| fine[a] * [0.25, 0.5, 1.0][level] - (f64::from(key[a] >> (2 - level)) + 0.5);
                let [dx, dy, dz] = [d(0), d(1), d(2)];
                let distance_squared = (dx * dx + dy * dy) + dz * dz;
                if distance_squared < open.distance_squared {
                    (open.distance_squared, open.candidate) = (distance_squared, self.points);
                }
            }
            if let Some(open) = &mut self.open[2] {
                open.colours.add(*word);
            }
            self.points += 1;
        }
    }

    /// Ends the cells that a change of these bits of the finest index leaves.
    fn close_down_to(&mut self, changed: u32, shown: &mut [u32]) {
        for level in (0..LEVELS).rev().take_while(|level| changed >> (2 - level) != 0) {
            let Some(cell) = self.open[level].take() else { continue };
            if level > 0
                && let Some(parent) = &mut self.open[level - 1]
            {
                parent.colours.merge(&cell.colours);
            }
            match &self.first[level] {
                None => self.first[level] = Some(cell),
                Some(_) => {
                    if let Some(word) = shown.get_mut(cell.candidate as usize) {
                        *word = colour_word(cell.colours.mean(), level as u8);
                    }
                }
            }
        }
    }

    /// Ends the pass. The first and the last cell of each level are not finished: others may go on with them.
    /// `first_point`: points of the cloud before this task; `words` and `shown`: before and after averaging.
    pub(super) fn finish(mut self, first_point: u64, words: &[u32], shown: &[u32]) -> [Option<Edges>; LEVELS] {
        for level in (1..LEVELS).rev() {
            if let [Some(parent), Some(cell)] = &mut self.open[level - 1..=level] {
                parent.colours.merge(&cell.colours);
            }
        }
        let complete = |cell: OpenCell| {
            let at = |words: &[u32]| words.get(cell.candidate as usize).copied().unwrap_or_default();
            OpenCell { candidate: cell.candidate + first_point, word: at(words), shown: at(shown), ..cell }
        };
        std::array::from_fn(|level| match (self.first[level], self.open[level]) {
            (None, Some(only)) => Some(Edges::One(complete(only))),
            (Some(first), Some(last)) => Some(Edges::Two(complete(first), complete(last))),
            (_, None) => None,
        })
    }
}

/// Joins the open cells of tasks in Morton order, one level; hands every finished cell to `done`.
pub(super) fn join(edges: impl Iterator<Item = Edges>, mut done: impl FnMut(OpenCell)) {
    let mut open: Option<OpenCell> = None;
    for task in edges {
        let (first, last) = match task {
            Edges::One(only) => (only, None),
            Edges::Two(first, last) => (first, Some(last)),
        };
        match &mut open {
            Some(open) if open.key == first.key => {
                open.colours.merge(&first.colours);
                // of equals the one before stays
                let nearer = if first.distance_squared < open.distance_squared { first } else { *open };
                *open = OpenCell { colours: open.colours, ..nearer };
            }
            _ => open.replace(first).into_iter().for_each(&mut done),
        }
        if let Some(last) = last {
            open.replace(last).into_iter().for_each(&mut done);
        }
    }
    open.into_iter().for_each(done);
}

/// The word of a candidate of `level`.
pub(super) fn shown_word(cell: &OpenCell, level: usize) -> u32 {
    colour_word(cell.colours.mean(), level as u8)
}

/// A word of the highest level: its own colour.
pub(super) fn unselected(word: u32) -> u32 {
    colour_word(rgb_of(word), LEVELS as u8)
}

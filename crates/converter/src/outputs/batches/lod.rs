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

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use pointmill_format::batches::{Grid, lod_of};
    use pointmill_format::{Aabb, Lattice};
    use pointmill_testkit::Random;

    use super::*;
    use crate::cloud::{JobPoint, StoredOrigin};
    use crate::outputs::batches::frame::code_of;

    const CELL: f64 = 2.0;

    /// Points in Morton order, in cells, on a raster of eighths: many are as far from a center as others. Of each, a word.
    fn points() -> (Vec<[f64; 3]>, Vec<u32>) {
        let mut random = Random::new(4);
        let mut next = |end: u64| random.below(end) as f64 / 8.0;
        let mut points: Vec<[f64; 3]> = (0..400).map(|_| [next(40), next(40), next(12)]).collect();
        points.extend((0..200).map(|_| [next(4), 3.0 + next(3), next(3)])); // a crowd in a few cells
        points.sort_by_key(|u| code_of(u.map(|v| (v * 4.0) as u32)));
        let words = points.iter().map(|_| random.next_u32() & 0xFF_FFFF).collect();
        (points, words)
    }

    /// All at once: of each cell the first that is nearest to the center shows the mean, coarser levels before finer ones.
    fn plain(points: &[[f64; 3]], words: &[u32]) -> Vec<u32> {
        let mut shown: Vec<u32> = words.iter().map(|w| unselected(*w)).collect();
        for level in (0..LEVELS).rev() {
            let scaled = |i: usize| points[i].map(|v| v * 2f64.powi(level as i32));
            let mut cells: HashMap<[u32; 3], Vec<usize>> = HashMap::new();
            (0..points.len()).for_each(|i| cells.entry(scaled(i).map(|v| v as u32)).or_default().push(i));
            for (key, members) in cells {
                let distance = |i: usize| (0..3).map(|a| (scaled(i)[a] - f64::from(key[a]) - 0.5).powi(2)).sum::<f64>();
                let nearest = members.iter().copied().min_by(|i, j| distance(*i).total_cmp(&distance(*j))).unwrap();
                let mut colours = ColourSum::default();
                members.iter().for_each(|i| colours.add(words[*i]));
                shown[nearest] = colour_word(colours.mean(), level as u8);
            }
        }
        shown
    }

    /// In tasks of `size` points, each in two parts.
    fn in_tasks(points: &[[f64; 3]], words: &[u32], size: usize) -> Vec<u32> {
        let tight = Aabb { min: [0.0; 3], max: [10.0; 3] };
        let lattice = Lattice { scale: [0.25; 3], offset: [0.0; 3] };
        let origin = StoredOrigin(JobPoint([0; 3]));
        let frame = Frame::of_grid(Grid::new(&tight, CELL).unwrap(), tight, lattice, origin);
        let mut shown: Vec<u32> = words.iter().map(|w| unselected(*w)).collect();
        let mut edges: [Vec<Edges>; LEVELS] = Default::default();
        for (task, points) in points.chunks(size).enumerate() {
            let first = task * size;
            let words = &words[first..first + points.len()];
            let shown = &mut shown[first..first + points.len()];
            let relative = [0, 1, 2].map(|a| points.iter().map(|u| u[a] * CELL).collect::<Vec<f64>>());
            let mut levels = Levels::default();
            for part in [0..points.len() / 2, points.len() / 2..points.len()] {
                let [x, y, z] = &relative;
                levels.add(&frame, [&x[part.clone()], &y[part.clone()], &z[part.clone()]], &words[part.clone()], shown);
            }
            for (all, edges) in edges.iter_mut().zip(levels.finish(first as u64, words, shown)) {
                all.extend(edges);
            }
        }
        let before = shown.clone();
        for (level, edges) in edges.into_iter().enumerate() {
            join(edges.into_iter(), |cell| {
                let at = cell.candidate as usize;
                assert_eq!((cell.word, cell.shown), (words[at], before[at]));
                if usize::from(lod_of(shown[at])) > level {
                    shown[at] = shown_word(&cell, level);
                }
            });
        }
        shown
    }

    #[test]
    fn cells_are_those_of_all_points_at_once_however_tasks_cut_them() {
        let (points, words) = points();
        let expected = plain(&points, &words);
        for size in [1, 2, 7, 50, 333, points.len()] {
            assert_eq!(in_tasks(&points, &words, size), expected, "tasks of {size} points");
        }
    }

    #[test]
    fn a_task_without_points_has_no_cells() {
        assert_eq!(Levels::default().finish(5, &[], &[]), [None; LEVELS]);
    }
}

//! Levels of detail (§4): candidates and mean colours, in one pass over the Morton order with three open cells.

use super::examine::{COLOUR_UNKNOWN, POSITION_UNCERTAIN, Seen};
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::place::Place;

/// A point of a cell, as reports and colours need it.
#[derive(Debug, Clone, Copy)]
struct Member {
    index: u64,
    /// Its batch in Morton order.
    batch: u32,
    /// Colour and level, as stored.
    word: u32,
}

/// A cell whose points are passing by.
#[derive(Debug, Clone, Copy)]
struct Cell {
    number: u128,
    points: u64,
    /// r, g, b before averaging.
    sums: [u64; 3],
    nearest: f64,
    candidate: Member,
    /// Points of this level, the first and the last of them.
    of_level: u64,
    ends_of_level: Option<[Member; 2]>,
    /// Positions, and so membership and distances, are not certain.
    uncertain: bool,
    /// The colour of a point before averaging is lost.
    colour_unknown: bool,
}

/// What is open, and what was found.
#[derive(Debug)]
pub(crate) struct Levels {
    open: [Option<Cell>; 3],
    /// The point before was uncertain.
    uncertain_before: bool,
    averaged: bool,
    cells: u64,
    /// Cells that were not judged.
    pub(crate) uncertain_cells: u64,
}

impl Levels {
    pub(crate) fn new(averaged: bool) -> Self {
        Self { open: [None; 3], uncertain_before: false, averaged, cells: 0, uncertain_cells: 0 }
    }

    /// The next batch of the Morton order.
    pub(crate) fn add(&mut self, batch: &Seen, findings: &Findings) {
        for i in 0..batch.stored.len() {
            for level in 0..3 {
                self.add_point(batch, i, level, findings);
            }
            self.uncertain_before = batch.flags[i] & POSITION_UNCERTAIN != 0;
        }
    }

    #[inline]
    fn add_point(&mut self, batch: &Seen, i: usize, level: usize, findings: &Findings) {
        let uncertain = batch.flags[i] & POSITION_UNCERTAIN != 0;
        let number = batch.grid.cell_of(batch.codes[i], level as i32);
        let (index, word) = (batch.first_index + i as u64, batch.stored[i]);
        let member = Member { index, batch: batch.number as u32, word };
        let distance = batch.distances[i][level];
        if self.open[level].is_none_or(|cell| cell.number != number) {
            if let Some(cell) = &mut self.open[level] {
                cell.uncertain |= uncertain;
            }
            self.close(level, findings);
            self.open[level] = Some(Cell {
                number,
                points: 0,
                sums: [0; 3],
                nearest: f64::INFINITY,
                candidate: member,
                of_level: 0,
                ends_of_level: None,
                uncertain: self.uncertain_before,
                colour_unknown: false,
            });
        }
        let Some(cell) = &mut self.open[level] else { return };
        cell.points += 1;
        let original = batch.original[i];
        for (sum, shift) in cell.sums.iter_mut().zip([0, 8, 16]) {
            *sum += u64::from(original >> shift & 255);
        }
        if distance < cell.nearest {
            cell.nearest = distance;
            cell.candidate = member;
        }
        if member.word >> 24 == level as u32 {
            cell.of_level += 1;
            cell.ends_of_level = Some([cell.ends_of_level.map_or(member, |[first, _]| first), member]);
        }
        cell.uncertain |= uncertain;
        cell.colour_unknown |= batch.flags[i] & COLOUR_UNKNOWN != 0;
    }

    /// Points are missing here: what is open cannot be judged, nor what opens next.
    pub(crate) fn gap(&mut self, findings: &Findings) {
        for level in 0..3 {
            if let Some(cell) = &mut self.open[level] {
                cell.uncertain = true;
            }
            self.close(level, findings);
        }
        self.uncertain_before = true;
    }

    /// The order has ended.
    pub(crate) fn finish(&mut self, findings: &Findings) {
        (0..3).for_each(|level| self.close(level, findings));
        findings.checked(Check::Levels, self.cells);
    }

    /// A cell is complete. Points of its level must be its candidate, and the candidate's level must not be finer:
    /// for all cells together this means that every point has exactly its level.
    fn close(&mut self, level: usize, findings: &Findings) {
        let Some(cell) = self.open[level].take() else { return };
        if cell.uncertain {
            self.uncertain_cells += 1;
            return;
        }
        self.cells += 1;
        let stored = cell.candidate.word >> 24;
        let fault = |member: Member, expected: String, found: u32| {
            let subject = format!("level of point {}", member.index);
            let finding = Finding::new(Check::Levels, subject, expected, found).points(1);
            findings.push(finding.at(Place::Batch(member.batch)));
        };
        if stored > level as u32 {
            let why = format!("{level}, nearest to the centre of {} points", cell.points);
            fault(cell.candidate, why, stored);
        }
        let others = cell.of_level - u64::from(stored == level as u32);
        if let (1.., Some([first, last])) = (others, cell.ends_of_level) {
            let nearest = cell.candidate.index;
            let expected = format!("above {level}: point {nearest} is nearer to the centre or comes first");
            fault(if last.index == nearest { first } else { last }, expected, level as u32);
            findings.more(Check::Levels, others - 1);
        }
        if stored == level as u32 && self.averaged && !cell.colour_unknown {
            findings.checked(Check::Colours, 1);
            mean_colour(&cell, findings);
        }
    }
}

fn mean_colour(cell: &Cell, findings: &Findings) {
    let mean = cell.sums.map(|sum| (sum + cell.points / 2) / cell.points);
    let stored = [0, 8, 16].map(|shift| u64::from(cell.candidate.word >> shift & 255));
    if mean != stored {
        let subject = format!("colour of point {}, mean of {} points", cell.candidate.index, cell.points);
        let finding = Finding::new(Check::Colours, subject, mean.to_vec(), stored.to_vec());
        findings.push(finding.points(1).at(Place::Batch(cell.candidate.batch)));
    }
}

//! The order of points (§3.1), as far as positions are known.

use std::cmp::Ordering;

use super::batch::{Grid, Points, Raw, corners};

/// What a point is sorted by.
#[derive(Debug, Clone)]
pub(crate) struct Key {
    /// Least and greatest Morton code that the point may have; equal if its position is known.
    codes: [u128; 2],
    lattice: [i64; 3],
    /// The colour before averaging; `None` if it is lost.
    colour: Option<u32>,
    /// Bytes of the extra attributes.
    extras: Vec<u8>,
    /// Storage index, for reports.
    pub(crate) index: u64,
}

impl Key {
    /// The key of point `i` with Morton code `code`.
    pub(crate) fn new(
        raw: &Raw,
        points: &Points,
        grid: &Grid,
        bits: u32,
        code: u128,
        i: usize,
        colour: Option<u32>,
    ) -> Self {
        let codes = if points.ambiguous[i] { corners(raw, i, bits).map(|r| grid.code(r)) } else { [code; 2] };
        let n = raw.len();
        let extras = raw.extras.iter().flat_map(|bytes| element(bytes, n, i)).copied().collect();
        Self { codes, lattice: points.lattice(i), colour, extras, index: raw.index(i) }
    }

    /// True if this point certainly belongs behind `next`.
    pub(crate) fn is_behind(&self, next: &Self) -> bool {
        if self.codes[0] != self.codes[1] || next.codes[0] != next.codes[1] {
            return self.codes[0] > next.codes[1];
        }
        let positions = self.codes[0].cmp(&next.codes[0]).then(self.lattice.cmp(&next.lattice));
        match (self.colour, next.colour) {
            _ if positions != Ordering::Equal => positions == Ordering::Greater,
            (Some(a), Some(b)) => a.cmp(&b).then_with(|| self.extras.cmp(&next.extras)) == Ordering::Greater,
            _ => false, // a colour is lost, and what comes after it decides nothing
        }
    }

    /// For reports.
    pub(crate) fn describe(&self) -> String {
        format!("Morton code {:#x}, X Y Z {:?}", self.codes[0], self.lattice)
    }
}

/// The bytes of point `i` of `n`.
fn element(bytes: &[u8], n: usize, i: usize) -> &[u8] {
    let stride = bytes.len() / n.max(1);
    bytes.get(i * stride..(i + 1) * stride).unwrap_or_default()
}

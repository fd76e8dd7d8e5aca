//! The order of points (§3.1), as far as positions are known.

use std::cmp::Ordering;

use super::batch::{Grid, Points, Raw, corners};

/// What a point is sorted by.
#[derive(Debug, Clone)]
pub(crate) struct Key {
    /// Least and greatest Morton code that the point may have.
    codes: [u128; 2],
    /// `None` if the planes leave a choice: what is nearest to the middle of the cell is no fact about the point.
    lattice: Option<[i64; 3]>,
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
        let lattice = (!points.ambiguous[i]).then(|| points.lattice(i));
        Self { codes, lattice, colour, extras, index: raw.index(i) }
    }

    /// True if this point certainly belongs behind `next`.
    pub(crate) fn is_behind(&self, next: &Self) -> bool {
        let (Some(here), Some(there)) = (self.lattice, next.lattice) else {
            return self.codes[0] > next.codes[1];
        };
        let positions = self.codes[0].cmp(&next.codes[0]).then(here.cmp(&there));
        match (self.colour, next.colour) {
            _ if positions != Ordering::Equal => positions == Ordering::Greater,
            (Some(a), Some(b)) => a.cmp(&b).then_with(|| self.extras.cmp(&next.extras)) == Ordering::Greater,
            _ => false, // a colour is lost, and what comes after it decides nothing
        }
    }

    /// For reports.
    pub(crate) fn describe(&self) -> String {
        let [least, greatest] = self.codes;
        match self.lattice {
            Some(lattice) => format!("Morton code {least:#x}, X Y Z {lattice:?}"),
            None => format!("Morton code {least:#x} to {greatest:#x}"),
        }
    }
}

/// The bytes of point `i` of `n`.
fn element(bytes: &[u8], n: usize, i: usize) -> &[u8] {
    let stride = bytes.len() / n.max(1);
    bytes.get(i * stride..(i + 1) * stride).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(codes: [u128; 2], lattice: Option<[i64; 3]>, colour: u32) -> Key {
        Key { codes, lattice, colour: Some(colour), extras: Vec::new(), index: 0 }
    }

    #[test]
    fn of_a_position_that_is_not_known_the_codes_alone_decide() {
        // a cell of the planes inside of one of the order: the same code, and no more is known
        let unknown = |code: u128, colour| key([code; 2], None, colour);
        assert!(!unknown(7, 2).is_behind(&unknown(7, 1)), "nothing says that these are of one place");
        assert!(!unknown(7, 2).is_behind(&key([7; 2], Some([0; 3]), 1)));
        assert!(unknown(8, 1).is_behind(&unknown(7, 1)) && !unknown(7, 1).is_behind(&unknown(8, 1)));
        assert!(!key([3, 9], None, 0).is_behind(&key([5, 5], Some([0; 3]), 0)));
        assert!(key([6, 9], None, 0).is_behind(&key([5, 5], Some([0; 3]), 0)));
    }

    #[test]
    fn known_positions_are_ordered_to_the_last() {
        let known = |lattice, colour| key([7; 2], Some(lattice), colour);
        assert!(known([1, 0, 0], 0).is_behind(&known([0, 9, 9], 0)));
        assert!(known([1, 0, 0], 2).is_behind(&known([1, 0, 0], 1)));
        assert!(!known([1, 0, 0], 1).is_behind(&known([1, 0, 0], 1)));
    }
}

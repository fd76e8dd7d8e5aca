//! The range of the colours of one input, small: there may be very many inputs.

use pointmill_format::Column;
use serde::{Deserialize, Serialize};

use crate::runtime::{Vectors, vectorized};

/// Least and greatest red, green and blue of 16 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ColourRange {
    min: [u16; 3],
    max: [u16; 3],
}

impl Default for ColourRange {
    /// Of no colour.
    fn default() -> Self {
        Self { min: [u16::MAX; 3], max: [0; 3] }
    }
}

vectorized! {
    fn include(range: &mut ColourRange, column: &Column, selection: Option<&[u32]>) = ColourRange::include_anyhow;
}

/// Values that are compared at once: whole colours, and vectors of the processor.
const LANES: usize = 24;

impl ColourRange {
    /// Includes the colours of `column` (three `u16` a point) that `selection` names (`None`: all).
    pub(crate) fn include(&mut self, column: &Column, selection: Option<&[u32]>) {
        include(Vectors::best(), self, column, selection);
    }

    #[inline(always)]
    fn include_anyhow(&mut self, column: &Column, selection: Option<&[u32]>) {
        let Column::UInt16(values) = column else { return };
        let colours = values.as_chunks::<3>().0;
        match selection {
            Some(chosen) => chosen.iter().for_each(|i| self.add(colours[*i as usize])),
            None => {
                let (mut min, mut max) = ([u16::MAX; LANES], [0; LANES]);
                let (lanes, rest) = values.as_chunks::<LANES>();
                for values in lanes {
                    for i in 0..LANES {
                        min[i] = min[i].min(values[i]);
                        max[i] = max[i].max(values[i]);
                    }
                }
                if !lanes.is_empty() {
                    min.as_chunks::<3>().0.iter().chain(max.as_chunks::<3>().0).for_each(|colour| self.add(*colour));
                }
                rest.as_chunks::<3>().0.iter().for_each(|colour| self.add(*colour));
            }
        }
    }

    /// Includes a colour.
    pub(crate) fn add(&mut self, colour: [u16; 3]) {
        for (e, v) in colour.into_iter().enumerate() {
            self.min[e] = self.min[e].min(v);
            self.max[e] = self.max[e].max(v);
        }
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        for e in 0..3 {
            self.min[e] = self.min[e].min(other.min[e]);
            self.max[e] = self.max[e].max(other.max[e]);
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.min[0] > self.max[0]
    }

    /// True if no value needs more than 8 bits.
    pub(crate) fn fits_eight_bits(&self) -> bool {
        self.max.iter().all(|v| *v <= 255)
    }

    /// True if some value is above 0.
    pub(crate) fn is_lit(&self) -> bool {
        self.max.iter().any(|v| *v > 0)
    }

    /// Least and greatest values as numbers; `None` if there is no colour.
    pub(crate) fn ends(&self) -> Option<[[f64; 3]; 2]> {
        (!self.is_empty()).then(|| [self.min.map(f64::from), self.max.map(f64::from)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_range_is_that_of_all_colours_or_of_the_chosen_ones() {
        let mut values: Vec<u16> = (0..300).map(|i| 1000 + i % 7).collect();
        values[3 * 50 + 1] = 9;
        values[3 * 99 + 2] = 60_000;
        let column = Column::UInt16(values);
        let (mut all, mut chosen) = (ColourRange::default(), ColourRange::default());
        all.include(&column, None);
        assert_eq!(all, ColourRange { min: [1000, 9, 1000], max: [1006, 1006, 60_000] });
        assert!(!all.fits_eight_bits() && chosen.is_empty() && !chosen.is_lit() && chosen.ends().is_none());
        chosen.include(&column, Some(&[0, 50]));
        let Column::UInt16(values) = &column else { panic!() };
        let of = |e: usize| (values[e].min(values[150 + e]), values[e].max(values[150 + e]));
        let ends = [[0, 1, 2].map(|e| f64::from(of(e).0)), [0, 1, 2].map(|e| f64::from(of(e).1))];
        assert_eq!(chosen.ends(), Some(ends));
        let mut few = ColourRange::default();
        few.include(&Column::UInt16(vec![3, 200, 255]), None);
        assert!(few.fits_eight_bits() && few.is_lit());
        few.merge(&all);
        assert_eq!(few, ColourRange { min: [3, 9, 255], max: [1006, 1006, 60_000] });
    }
    #[test]
    fn each_set_of_instructions_finds_the_range_of_each_channel() {
        let mut random = pointmill_testkit::Random::new(4);
        // none, fewer than are compared at once, as many, and some more
        for points in [0, 1, 7, 8, 9, 16, 203] {
            let channel = |i: usize, v: u64| (1 + 100 * (i % 3) as u64 + v) as u16;
            let values: Vec<u16> = (0..3 * points).map(|i| channel(i, random.below(60_000))).collect();
            let some: Vec<u32> = (0..points as u32).filter(|i| i % 4 == 1).collect();
            let all: Vec<u32> = (0..points as u32).collect();
            for selection in [None, Some(&some[..])] {
                let of = |e: usize| selection.unwrap_or(&all).iter().map(move |i| 3 * *i as usize + e);
                let least = |e| of(e).map(|i| values[i]).min().unwrap_or(u16::MAX);
                let greatest = |e| of(e).map(|i| values[i]).max().unwrap_or(0);
                let expected = ColourRange { min: [0, 1, 2].map(least), max: [0, 1, 2].map(greatest) };
                let column = Column::UInt16(values.clone());
                for vectors in Vectors::all() {
                    let mut found = ColourRange::default();
                    include(vectors, &mut found, &column, selection);
                    assert_eq!(found, expected, "{vectors:?}, {points} points");
                }
            }
        }
    }
}

//! The range of the values of an attribute.

use pointmill_format::{Column, with_column};
use serde::{Deserialize, Serialize};

use crate::runtime::{Vectors, vectorized};

/// Smallest and largest value of each element; NaN and infinities are not values.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Range {
    pub(crate) min: Vec<f64>,
    pub(crate) max: Vec<f64>,
    /// Values that are not finite were seen.
    pub(crate) has_non_finite: bool,
}

impl Range {
    pub(crate) fn new(elements: usize) -> Self {
        Self { min: vec![f64::INFINITY; elements], max: vec![f64::NEG_INFINITY; elements], has_non_finite: false }
    }

    /// True if it can be of an attribute with so many elements.
    pub(crate) fn can_be_of(&self, elements: usize) -> bool {
        [self.min.len(), self.max.len()] == [elements; 2] && !self.min.iter().chain(&self.max).any(|v| v.is_nan())
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        for e in 0..self.min.len() {
            self.min[e] = self.min[e].min(other.min[e]);
            self.max[e] = self.max[e].max(other.max[e]);
        }
        self.has_non_finite |= other.has_non_finite;
    }

    /// Includes a value that every element takes.
    pub(crate) fn add(&mut self, value: f64) {
        for e in 0..self.min.len() {
            self.min[e] = self.min[e].min(value);
            self.max[e] = self.max[e].max(value);
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.min.iter().zip(&self.max).any(|(a, b)| a > b)
    }

    /// The one value that all points have, for each element.
    pub(crate) fn constant(&self) -> Option<&[f64]> {
        (!self.has_non_finite && self.min == self.max).then_some(&self.min)
    }

    /// Includes the points of `column` that `selection` names (`None`: all).
    pub(crate) fn include(&mut self, column: &Column, selection: Option<&[u32]>) {
        include(Vectors::best(), self, column, selection);
    }

    #[inline(always)]
    fn include_anyhow(&mut self, column: &Column, selection: Option<&[u32]>) {
        let elements = self.min.len();
        for e in 0..elements {
            let (min, max, odd) = with_column!(column, v => match (selection, elements) {
                (None, 1) => extremes!(v.iter().copied()),
                (None, _) => extremes!(v.iter().skip(e).step_by(elements).copied()),
                (Some(s), _) => extremes!(s.iter().map(|i| v[*i as usize * elements + e])),
            });
            self.min[e] = self.min[e].min(min);
            self.max[e] = self.max[e].max(max);
            self.has_non_finite |= odd;
        }
    }
}

vectorized! {
    fn include(range: &mut Range, column: &Column, selection: Option<&[u32]>) = Range::include_anyhow;
}

/// Smallest, largest and "something was not finite" of an iterator of numbers, in the numbers' own type first (the
/// compiler makes vector code of it), as `f64` at the end.
macro_rules! extremes {
    ($values:expr) => {{
        use $crate::cloud::range::Number;
        let mut values = $values;
        match values.next() {
            None => (f64::INFINITY, f64::NEG_INFINITY, false),
            Some(first) => {
                let (mut min, mut max, mut odd) = (first, first, !first.is_finite_number());
                for v in values {
                    min = if v < min || !min.is_finite_number() { v } else { min };
                    max = if v > max || !max.is_finite_number() { v } else { max };
                    odd |= !v.is_finite_number();
                }
                if odd { Number::finite_extremes($values) } else { (min.as_f64(), max.as_f64(), false) }
            }
        }
    }};
}
use extremes;

/// What the extremes need of a number.
trait Number: Copy + PartialOrd {
    fn is_finite_number(self) -> bool;
    fn as_f64(self) -> f64;

    /// Slow but sure: used when something is not finite.
    fn finite_extremes(values: impl Iterator<Item = Self>) -> (f64, f64, bool) {
        let finite = values.filter(|v| v.is_finite_number()).map(Self::as_f64);
        let (min, max) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        (min, max, true)
    }
}

macro_rules! integers {
    ($($t:ty),*) => {$(impl Number for $t {
        #[inline]
        fn is_finite_number(self) -> bool { true }
        #[inline]
        fn as_f64(self) -> f64 { self as f64 }
    })*};
}
integers!(i8, u8, i16, u16, i32, u32, i64, u64);

macro_rules! floats {
    ($($t:ty),*) => {$(impl Number for $t {
        #[inline]
        fn is_finite_number(self) -> bool { self.is_finite() }
        #[inline]
        fn as_f64(self) -> f64 { f64::from(self) }
    })*};
}
floats!(f32, f64);

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;

    #[test]
    fn ranges_skip_what_is_not_a_number_and_say_so() {
        let mut r = Range::new(1);
        r.include(&Column::Float64(vec![f64::NAN, 3.0, -1.0, f64::INFINITY]), None);
        assert_eq!((r.min[0], r.max[0], r.has_non_finite), (-1.0, 3.0, true));
        let mut all_nan = Range::new(1);
        all_nan.include(&Column::Float32(vec![f32::NAN]), None);
        assert!(all_nan.is_empty() && all_nan.constant().is_none());
    }

    #[test]
    fn ranges_are_kept_by_element_and_by_selection() {
        let mut r = Range::new(3);
        let column = Column::UInt16(vec![1, 2, 3, 10, 0, 30, 99, 99, 99]);
        r.include(&column, Some(&[0, 1]));
        assert_eq!((r.min.clone(), r.max.clone()), (vec![1.0, 0.0, 3.0], vec![10.0, 2.0, 30.0]));
        r.include(&column, None);
        assert_eq!(r.max, [99.0; 3]);
    }

    /// The range of all values that are chosen, one after the other.
    fn plain(column: &Column, elements: usize, selection: Option<&[u32]>) -> Range {
        let values: Vec<f64> = with_column!(column, v => v.iter().map(|v| v.as_f64()).collect());
        let all: Vec<u32> = (0..(values.len() / elements) as u32).collect();
        let mut range = Range::new(elements);
        for point in selection.unwrap_or(&all) {
            for e in 0..elements {
                let value = values[*point as usize * elements + e];
                if !value.is_finite() {
                    range.has_non_finite = true;
                    continue;
                }
                if value < range.min[e] {
                    range.min[e] = value;
                }
                if value > range.max[e] {
                    range.max[e] = value;
                }
            }
        }
        range
    }

    #[test]
    fn each_set_of_instructions_finds_the_range_of_every_type() {
        let mut random = Random::new(11);
        let wide: Vec<u64> = (0..3 * 331).map(|_| random.next_u64()).collect();
        let floats = |odd: bool| -> Vec<f64> {
            let value = |(i, v): (usize, &u64)| if odd && i % 97 == 5 { f64::NAN } else { (*v as i64) as f64 / 1e9 };
            wide.iter().enumerate().map(value).collect()
        };
        let singles = |odd: bool| floats(odd).iter().map(|v| *v as f32).collect();
        let columns = [
            Column::Int8(wide.iter().map(|v| (*v >> 57) as i8 - 9).collect()),
            Column::UInt8(wide.iter().map(|v| (*v >> 57) as u8 + 9).collect()),
            Column::Int16(wide.iter().map(|v| *v as i16 >> 1).collect()),
            Column::UInt16(wide.iter().map(|v| *v as u16 >> 1 | 1).collect()),
            Column::Int32(wide.iter().map(|v| *v as i32 >> 1).collect()),
            Column::UInt32(wide.iter().map(|v| *v as u32 >> 1 | 1).collect()),
            Column::Int64(wide.iter().map(|v| *v as i64 >> 1).collect()),
            Column::UInt64(wide.iter().map(|v| *v >> 1 | 1).collect()),
            Column::Float32(singles(false)),
            Column::Float32(singles(true)),
            Column::Float64(floats(false)),
            Column::Float64(floats(true)),
        ];
        let some: Vec<u32> = (0..331).filter(|i| i % 3 == 1).collect();
        for (column, elements) in columns.iter().flat_map(|c| [(c, 1), (c, 3)]) {
            for selection in [None, Some(&some[..]), Some(&[7]), Some(&[])] {
                let expected = plain(column, elements, selection);
                for vectors in Vectors::all() {
                    let mut found = Range::new(elements);
                    include(vectors, &mut found, column, selection);
                    let all = |r: &Range| (r.min.clone(), r.max.clone(), r.has_non_finite);
                    assert_eq!(all(&found), all(&expected), "{vectors:?} {:?} x {elements}", column.ty());
                }
            }
        }
    }
}

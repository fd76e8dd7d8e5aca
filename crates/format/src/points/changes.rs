//! What became of values that could not stay as they were, counted.

use std::fmt;

/// Values of one attribute that could not stay as they were, counted by what became of them.
///
/// A reader counts what it changes itself ([`crate::PointBatch::changes`]), a converter what it changes afterwards.
///
/// ```
/// use pointmill_format::Changes;
///
/// let mut changes = Changes::default();
/// changes.clamp(-3.0);
/// changes.clamp(70_000.0);
/// changes.not_finite += 1;
/// let line = "2 values are outside the range and take its nearest end, 1 is not finite and becomes 0 (-3 to 70000)";
/// assert_eq!(changes.to_string(), line);
/// ```
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Changes {
    /// Outside the range that is declared or can be held: the nearest end was taken.
    pub clamped: u64,
    /// Between two values that can be held: the nearest was taken.
    pub rounded: u64,
    /// NaN or infinite where there are no such values: 0 was taken.
    pub not_finite: u64,
    /// Outside the range that can be held, where the nearest end would mean something else: 0 was taken.
    pub out_of_range: u64,
    /// Points for which a part of the source (a scan of several, a short row) has no value: 0 was taken.
    pub missing: u64,
    /// Least and greatest value among those that were clamped, rounded or out of range.
    pub extremes: Option<[f64; 2]>,
}

impl Changes {
    /// Counts a value whose nearest end was taken.
    pub fn clamp(&mut self, value: f64) {
        self.clamped += 1;
        self.include(value);
    }

    /// Counts a value that was rounded.
    pub fn round(&mut self, value: f64) {
        self.rounded += 1;
        self.include(value);
    }

    /// Counts a value that became 0 because it cannot be held.
    pub fn leave_out(&mut self, value: f64) {
        self.out_of_range += 1;
        self.include(value);
    }

    /// Counts what `other` has counted, too.
    pub fn merge(&mut self, other: &Self) {
        self.clamped += other.clamped;
        self.rounded += other.rounded;
        self.not_finite += other.not_finite;
        self.out_of_range += other.out_of_range;
        self.missing += other.missing;
        if let Some([least, greatest]) = other.extremes {
            self.include(least);
            self.include(greatest);
        }
    }

    /// Values that became others; what is missing is not among them.
    pub fn values(&self) -> u64 {
        self.clamped + self.rounded + self.not_finite + self.out_of_range
    }

    /// True if nothing was counted.
    pub fn is_empty(&self) -> bool {
        self.values() == 0 && self.missing == 0
    }

    fn include(&mut self, value: f64) {
        if value.is_finite() {
            let [least, greatest] = self.extremes.unwrap_or([value; 2]);
            self.extremes = Some([least.min(value), greatest.max(value)]);
        }
    }
}

impl fmt::Display for Changes {
    /// What became of the values, without those that are missing.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let causes = [
            (self.clamped, "outside the range and take its nearest end", "outside the range and takes its nearest end"),
            (self.rounded, "rounded", "rounded"),
            (self.not_finite, "not finite and become 0", "not finite and becomes 0"),
            (self.out_of_range, "too large to be held and become 0", "too large to be held and becomes 0"),
        ];
        let mut separator = "";
        for (count, many, one) in causes.into_iter().filter(|(count, ..)| *count > 0) {
            let (noun, nouns) = if separator.is_empty() { (" value", " values") } else { ("", "") };
            match count {
                1 => write!(f, "{separator}1{noun} is {one}")?,
                n => write!(f, "{separator}{n}{nouns} are {many}")?,
            }
            separator = ", ";
        }
        match self.extremes {
            Some([least, greatest]) if least == greatest => write!(f, " ({least})"),
            Some([least, greatest]) => write!(f, " ({least} to {greatest})"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_extremes_add_up() {
        let mut a = Changes::default();
        assert!(a.is_empty() && a.to_string().is_empty());
        a.round(0.5);
        let mut b = Changes { missing: 4, ..Changes::default() };
        b.leave_out(300.0);
        b.clamp(f64::INFINITY);
        a.merge(&b);
        assert_eq!((a.values(), a.missing, a.extremes), (3, 4, Some([0.5, 300.0])));
        assert_eq!(
            a.to_string(),
            "1 value is outside the range and takes its nearest end, 1 is rounded, 1 is too large to be held and \
             becomes 0 (0.5 to 300)"
        );
    }
}

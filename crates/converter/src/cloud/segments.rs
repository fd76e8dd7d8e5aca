//! Where records are: runs of consecutive records of one block.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// A run of records of one block.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Segment {
    pub(crate) block: u32,
    pub(crate) start: u32,
    pub(crate) count: u32,
}

impl Segment {
    /// The record of the block behind it.
    pub(crate) fn end(&self) -> u64 {
        u64::from(self.start) + u64::from(self.count)
    }

    /// The same records in segments of at most `count`.
    pub(crate) fn split(self, count: u32) -> impl Iterator<Item = Self> {
        let part = move |at: u32| Self { start: self.start + at, count: count.min(self.count - at), ..self };
        (0..self.count).step_by(count.max(1) as usize).map(part)
    }

    /// True if `next` begins where this ends.
    fn is_followed_by(&self, next: &Self) -> bool {
        next.block == self.block && u64::from(next.start) == self.end()
    }
}

/// The records of a cell, a chunk or any other part of the cloud. Copies share their memory until one changes.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "Vec<Segment>", into = "Vec<Segment>")]
pub(crate) struct Segments(Arc<Vec<Segment>>);

impl Segments {
    /// Adds a segment; one that continues the last is joined to it.
    pub(crate) fn push(&mut self, segment: Segment) {
        let all = Arc::make_mut(&mut self.0);
        match all.last_mut() {
            Some(last) if last.is_followed_by(&segment) => last.count += segment.count,
            _ => all.push(segment),
        }
    }

    /// Adds all of `other`.
    pub(crate) fn append(&mut self, other: Self) {
        if self.is_empty() {
            *self = other;
        } else {
            Arc::make_mut(&mut self.0).extend_from_slice(&other.0);
        }
    }

    /// Memory that they take, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        (self.0.capacity() * size_of::<Segment>()) as u64
    }

    /// Puts the segments in order of block and joins those that follow each other.
    pub(crate) fn sort(&mut self) {
        let all = Arc::make_mut(&mut self.0);
        all.sort_unstable_by_key(|s| (s.block, s.start));
        all.dedup_by(|next, previous| {
            let joins = previous.is_followed_by(next);
            if joins {
                previous.count += next.count;
            }
            joins
        });
    }

    /// The same of blocks that have got numbers greater by `by`.
    pub(crate) fn shift(&mut self, by: u32) {
        Arc::make_mut(&mut self.0).iter_mut().for_each(|segment| segment.block = segment.block.wrapping_add(by));
    }

    /// Number of records.
    pub(crate) fn points(&self) -> u64 {
        self.0.iter().map(|s| u64::from(s.count)).sum()
    }

    pub(crate) fn iter(&self) -> std::slice::Iter<'_, Segment> {
        self.0.iter()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl From<Vec<Segment>> for Segments {
    fn from(all: Vec<Segment>) -> Self {
        Self(Arc::new(all))
    }
}

impl From<Segments> for Vec<Segment> {
    fn from(segments: Segments) -> Self {
        Arc::unwrap_or_clone(segments.0)
    }
}

impl<'a> IntoIterator for &'a Segments {
    type Item = &'a Segment;
    type IntoIter = std::slice::Iter<'a, Segment>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl Extend<Segment> for Segments {
    fn extend<I: IntoIterator<Item = Segment>>(&mut self, segments: I) {
        segments.into_iter().for_each(|s| self.push(s));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(block: u32, start: u32, count: u32) -> Segment {
        Segment { block, start, count }
    }

    #[test]
    fn a_segment_is_split_without_a_gap() {
        let parts: Vec<Segment> = segment(3, 10, 7).split(3).collect();
        assert_eq!(parts, [segment(3, 10, 3), segment(3, 13, 3), segment(3, 16, 1)]);
        assert_eq!(segment(3, 10, 0).split(3).count(), 0);
    }

    #[test]
    fn neighbours_are_joined_and_nothing_else() {
        let mut segments = Segments::default();
        segments.extend([segment(1, 0, 5), segment(1, 5, 2), segment(0, 7, 1), segment(1, 9, 1), segment(0, 4, 3)]);
        assert_eq!(segments.points(), 12);
        segments.sort();
        let found: Vec<Segment> = segments.iter().copied().collect();
        assert_eq!(found, [segment(0, 4, 4), segment(1, 0, 7), segment(1, 9, 1)]);
    }
}

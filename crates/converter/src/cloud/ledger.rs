//! Every point accounted for: sums over records, before and after the changes made on purpose.

use serde::{Deserialize, Serialize};

use super::checksum::Checksum;
use super::segments::Segment;
use super::store::Store;
use super::widening::Widening;
use crate::error::ConvertError;

/// Order-independent sums over the records that an output wrote.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Ledger {
    /// Records as they were written.
    pub(crate) written: Checksum,
    /// Records before and after their colours were widened.
    narrow: Checksum,
    wide: Checksum,
    /// Duplicates that were dropped.
    dropped: Checksum,
    /// Dropped points by class; no entries if there were none.
    pub(crate) classes_dropped: Vec<u64>,
}

impl Ledger {
    /// What the written records would add up to without the changes made on purpose: equals the sum of what was read.
    pub(crate) fn unaltered(&self) -> Checksum {
        let mut sum = self.written;
        sum.merge(&self.dropped);
        sum.replace(&self.wide, &self.narrow);
        sum
    }

    /// Points that were written.
    pub(crate) fn points(&self) -> u64 {
        self.written.count()
    }

    /// Points that were dropped as duplicates.
    pub(crate) fn duplicates_dropped(&self) -> u64 {
        self.dropped.count()
    }

    /// Counts a duplicate that is not written; `class`: its classification, if there is one.
    pub(crate) fn drop_duplicate(&mut self, record: &[u8], class: Option<u8>) {
        self.dropped.add(record);
        if let Some(class) = class {
            self.classes_dropped.resize(256, 0);
            self.classes_dropped[usize::from(class)] += 1;
        }
    }

    /// True if it can be of so many points at most.
    pub(crate) fn can_be_of(&self, points: u64) -> bool {
        let classes = &self.classes_dropped;
        let sums = [&self.written, &self.narrow, &self.wide, &self.dropped];
        sums.into_iter().all(|sum| sum.count() <= points)
            && (classes.is_empty() || classes.len() == 256)
            && classes.iter().all(|dropped| *dropped <= self.dropped.count())
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        self.written.merge(&other.written);
        self.narrow.merge(&other.narrow);
        self.wide.merge(&other.wide);
        self.dropped.merge(&other.dropped);
        if self.classes_dropped.len() < other.classes_dropped.len() {
            self.classes_dropped.resize(other.classes_dropped.len(), 0);
        }
        self.classes_dropped.iter_mut().zip(&other.classes_dropped).for_each(|(a, b)| *a += b);
    }

    /// Fails unless all that was read, `read`, was written or dropped.
    pub(crate) fn check(&self, read: &Checksum) -> Result<(), ConvertError> {
        let written = self.unaltered();
        if *read == written {
            return Ok(());
        }
        Err(ConvertError::Internal(format!("points were lost on the way: read {read:?}, written {written:?}")))
    }

    /// Appends the records of a segment to `records`, with colours of the depth that outputs have: `widening` has those
    /// of 8 bits, which become 16.
    pub(crate) fn load(
        &mut self,
        store: &Store,
        segment: Segment,
        stride: usize,
        widening: &Widening,
        records: &mut Vec<u8>,
    ) -> Result<(), ConvertError> {
        let start = records.len();
        let group = store.take(segment, records)?;
        if let Some(rgb) = widening.of(group) {
            let fresh = &mut records[start..];
            self.narrow.add_all(fresh, stride);
            for record in fresh.chunks_exact_mut(stride) {
                for channel in record[rgb..rgb + 6].as_chunks_mut::<2>().0 {
                    *channel = u16::from_le_bytes(*channel).wrapping_mul(257).to_le_bytes();
                }
            }
            self.wide.add_all(fresh, stride);
        }
        Ok(())
    }
}

//! The originals (§6.4): colours before averaging, by ascending storage index.

use pointmill_format::ReadError;

use super::bytes::{Bytes, u32_at};
use super::formulas::BATCH;
use super::header::Header;
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// Where the entries of each slot are.
#[derive(Debug)]
pub(crate) struct Originals {
    /// First byte of the entries.
    at: u64,
    /// Entries before each slot; one more than there are slots.
    before: Vec<u64>,
}

/// An original colour, bits 24–31 as they stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Entry {
    pub(crate) index: u32,
    pub(crate) word: u32,
}

/// Reads `count` entries once: order, range, top bytes. `None` if their order does not allow to find them again.
///
/// # Errors
/// The operating system cannot read the file.
pub(crate) fn read(
    bytes: &Bytes,
    header: &Header,
    count: u64,
    findings: &Findings,
) -> Result<Option<Originals>, ReadError> {
    const STEP: u64 = 1 << 17;
    let at = header.originals_at + 8;
    findings.checked(Check::Originals, count);
    let mut before = vec![0; header.batches as usize + 1];
    let (mut raw, mut last, mut coloured) = (Vec::new(), None, 0);
    let mut done = 0;
    while done < count {
        let n = (count - done).min(STEP);
        bytes.read(at + 8 * done, 8 * n, &mut raw)?;
        for (i, entry) in raw.chunks_exact(8).enumerate() {
            let Entry { index, word } = entry_at(entry);
            if last.is_some_and(|last| last >= index) || u64::from(index) >= header.points {
                let subject = format!("storage index of original {}", done + i as u64);
                let least = last.map_or(0, |last| u64::from(last) + 1);
                let expected = format!("ascending: {least} to {}", header.points.saturating_sub(1));
                findings.push(Finding::new(Check::Originals, subject, expected, index));
                return Ok(None);
            }
            last = Some(index);
            coloured += u64::from(word >> 24 != 0);
            before[(u64::from(index) / BATCH) as usize + 1] += 1;
        }
        done += n;
    }
    if coloured > 0 {
        let finding = Finding::new(Check::Originals, "top byte of original colours", 0, "other values");
        findings.push(finding.points(coloured));
    }
    let mut sum = 0;
    for entries in &mut before {
        sum += *entries;
        *entries = sum;
    }
    Ok(Some(Originals { at, before }))
}

fn entry_at(bytes: &[u8]) -> Entry {
    Entry { index: u32_at(bytes, 0), word: u32_at(bytes, 4) }
}

impl Originals {
    /// The entries of `slot`.
    ///
    /// # Errors
    /// The operating system cannot read the file.
    pub(crate) fn of_slot(&self, bytes: &Bytes, slot: u64, raw: &mut Vec<u8>) -> Result<Vec<Entry>, ReadError> {
        let slot = slot as usize;
        let (from, to) = (self.before[slot], self.before[slot + 1]);
        bytes.read(self.at + 8 * from, 8 * (to - from), raw)?;
        Ok(raw.chunks_exact(8).map(entry_at).collect())
    }
}

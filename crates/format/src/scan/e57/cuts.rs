//! Cutting a scan into pieces that decode alone.
//!
//! The values of a field are one stream of bits, strewn over the packets; streams of different fields need not keep
//! step. Record r of a field of b bits starts at bit r·b of its stream, so a pass over the heads of the packets finds
//! where a range of records begins in each of them.

use std::collections::VecDeque;

use super::fields::Field;
use super::packets::{BrokenChain, Packet, Section};
use super::pages::Pages;

/// A run of records of one scan.
#[derive(Debug, Clone)]
pub(super) struct Cut {
    /// Index of the scan in the file.
    pub(super) scan: usize,
    pub(super) records: u64,
    /// Logical offsets of the first packet with something of it, and behind the last.
    pub(super) start: u64,
    pub(super) end: u64,
    /// For each field that has bits: bytes of its stream, from the first packet on, that belong to earlier records.
    pub(super) skip: Box<[u64]>,
    /// Why it cannot be read, if that is known already.
    pub(super) lost: Option<BrokenChain>,
}

/// What a pass over the packets of a scan found.
#[derive(Debug, Default)]
pub(super) struct Found {
    pub(super) cuts: Vec<Cut>,
    /// Declared records that are not there although no packet is damaged.
    pub(super) missing: u64,
    /// What ended the pass early, if no record is lost by it.
    pub(super) fault: Option<BrokenChain>,
}

/// Numbers that are remembered of the packets seen so far: 8 MiB.
const MAX_REMEMBERED: usize = 1 << 20;

/// Cuts `records` records of `fields` into pieces of `step` (a multiple of 8, so that each starts at a byte border).
pub(super) fn cut(
    pages: &mut Pages<'_>,
    section: Result<Section, BrokenChain>,
    scan: usize,
    fields: &[Field],
    records: u64,
    step: u64,
) -> Found {
    let bits: Vec<u64> = fields.iter().map(|f| u64::from(f.encoding.bits())).collect();
    let mut found = Found::default();
    let (section, mut fault) = match section {
        Ok(section) => (section, None),
        Err(fault) => (Section { packets: 0, end: 0 }, Some(fault)),
    };
    let mut chain = Chain { bits: &bits, at: section.packets, total: vec![0; bits.len()], recent: VecDeque::new() };
    let (mut done, mut sizes) = (0, Vec::new());
    while done < records {
        let next = records.min(done + step);
        if chain.holds(next) {
            found.cuts.push(chain.take(scan, done, next));
            done = next;
        } else if fault.is_some() || chain.at >= section.end {
            break;
        } else {
            match Packet::read(pages, chain.at, section.end, bits.len(), &mut sizes) {
                Ok(packet) => chain.push(packet, &sizes),
                Err(e) => fault = Some(e),
            }
        }
    }
    let there = chain.records().min(records);
    if there > done {
        found.cuts.push(chain.take(scan, done, there));
        done = there;
    }
    let missing = records - done;
    // no more can be lost than the rest of the section could hold
    let could = (section.end.saturating_sub(chain.at) * 8).checked_div(bits.iter().sum()).unwrap_or(0).min(missing);
    match fault {
        Some(fault) if could > 0 => {
            let (start, end, skip) = (chain.at, section.end, Box::default());
            found.missing = missing - could;
            found.cuts.push(Cut { scan, records: could, start, end, skip, lost: Some(fault) });
        }
        fault => (found.missing, found.fault) = (missing, fault),
    }
    found
}

/// The packets seen so far.
struct Chain<'a> {
    bits: &'a [u64],
    /// Logical offset behind them.
    at: u64,
    /// Bytes of each stream in them.
    total: Vec<u64>,
    /// Those that hold something of records that are not cut yet: start, and `total` before it.
    recent: VecDeque<(u64, Box<[u64]>)>,
}

impl Chain<'_> {
    fn push(&mut self, packet: Packet, sizes: &[u64]) {
        if packet.streams.is_some() {
            if self.recent.len() * self.bits.len() >= MAX_REMEMBERED {
                self.forget_some();
            }
            self.recent.push_back((self.at, self.total.as_slice().into()));
            self.total.iter_mut().zip(sizes).for_each(|(total, size)| *total += size);
        }
        self.at += packet.len;
    }

    /// Forgets every other packet, where streams are so far from keeping step that there are too many: pieces begin with
    /// earlier packets, and pass over more.
    fn forget_some(&mut self) {
        let mut keep = false;
        self.recent.retain(|_| {
            keep = !keep;
            keep
        });
    }

    /// True if the first `records` records are complete.
    fn holds(&self, records: u64) -> bool {
        self.bits.iter().zip(&self.total).all(|(bits, total)| {
            let needed = records.checked_mul(*bits).map(|b| b.div_ceil(8));
            needed.is_some_and(|needed| needed <= *total)
        })
    }

    /// How many records are complete.
    fn records(&self) -> u64 {
        let counts = self.bits.iter().zip(&self.total).filter(|(bits, _)| **bits > 0);
        counts.map(|(bits, total)| total * 8 / bits).min().unwrap_or(0)
    }

    /// The cut of the records `first..next`, which the packets hold; `first` is a multiple of 8.
    fn take(&mut self, scan: usize, first: u64, next: u64) -> Cut {
        let start_byte = |field: usize| first / 8 * self.bits[field];
        // a packet is behind us once all streams begin in later ones
        while let Some((_, after)) = self.recent.get(1) {
            if !(0..after.len()).all(|f| self.bits[f] == 0 || after[f] <= start_byte(f)) {
                break;
            }
            self.recent.pop_front();
        }
        let with_bits = || (0..self.bits.len()).filter(|f| self.bits[*f] > 0);
        let (start, skip) = match self.recent.front() {
            Some((start, before)) => (*start, with_bits().map(|f| start_byte(f).saturating_sub(before[f])).collect()),
            None => (self.at, with_bits().map(|_| 0).collect()),
        };
        Cut { scan, records: next - first, start, end: self.at, skip, lost: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_far_from_keeping_step_are_cut_right_from_few_remembered_packets() {
        let bits = [8, 0, 8];
        let mut chain = Chain { bits: &bits, at: 0, total: vec![0; 3], recent: VecDeque::new() };
        let packets = MAX_REMEMBERED as u64;
        // all of one stream, then all of the other: a byte a packet of 8
        for i in 0..2 * packets {
            let is_first = u64::from(i < packets);
            chain.push(Packet { len: 8, streams: Some(0) }, &[is_first, 7, 1 - is_first]);
            assert!(chain.recent.len() * bits.len() <= MAX_REMEMBERED + bits.len());
        }
        assert_eq!(chain.records(), packets);
        for first in [0, packets / 2, packets - 8] {
            let cut = chain.take(0, first, first + 8);
            // bytes of the first stream before the cut's first packet, and of the second
            let before = [(cut.start / 8).min(packets), (cut.start / 8).saturating_sub(packets)];
            assert_eq!([before[0] + cut.skip[0], before[1] + cut.skip[1]], [first; 2], "{cut:?}");
        }
    }
}

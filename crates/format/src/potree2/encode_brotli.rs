//! A node's records as Potree's BROTLI encoding keeps them.

use std::io;

use crate::{Attribute, AttributeType};

use super::metadata::planar_size;
use super::{brotli, morton};

/// Memory that a thread reuses from node to node.
#[derive(Debug, Default)]
pub struct BrotliScratch {
    /// Morton code (96 bits) and index (32 bits) of every point.
    order: Vec<u128>,
    /// Records in that order.
    sorted: Vec<u8>,
    /// The planes before compression.
    planar: Vec<u8>,
}

/// Encodes the points of one node as one complete Brotli stream (window 22) and appends it to `out`.
///
/// `records`: DEFAULT records of `attributes`, interleaved, in any order; `position` (int32 × 3) is the first
/// attribute, an `rgb` is uint16 × 3. `quality`: 0–11. The points are sorted by the Morton code of their position, then
/// by the bytes of their records, so the result does not depend on the order of `records`.
///
/// Positions are stored as they are. (PotreeConverter 2.1.1 stores every coordinate plus one.)
///
/// # Errors
/// `InvalidInput` for attributes, lengths or a quality other than these, or more than 2^32 points.
pub fn encode_brotli(
    attributes: &[Attribute],
    records: &[u8],
    quality: u8,
    scratch: &mut BrotliScratch,
    out: &mut Vec<u8>,
) -> io::Result<()> {
    let record_len: usize = attributes.iter().map(Attribute::size).sum();
    check(attributes, records.len(), record_len)?;
    scratch.sort(records, record_len);
    scratch.planarise(attributes, record_len);
    brotli::compress(&scratch.planar, quality, out)
}

fn check(attributes: &[Attribute], len: usize, record_len: usize) -> io::Result<()> {
    let is = |a: &Attribute, name, ty| a.name == name && a.ty == ty && a.elements == 3;
    let refuse = |what: &str| Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    if !attributes.first().is_some_and(|a| is(a, "position", AttributeType::Int32)) {
        return refuse("the first attribute is not position, int32 x 3");
    }
    if !attributes.iter().all(|a| a.name != "rgb" || is(a, "rgb", AttributeType::UInt16)) {
        return refuse("rgb is not uint16 x 3");
    }
    if !len.is_multiple_of(record_len) || u32::try_from(len / record_len).is_err() {
        return refuse("not a whole number of records, or too many");
    }
    Ok(())
}

impl BrotliScratch {
    /// Fills `sorted` with `records` in canonical order.
    fn sort(&mut self, records: &[u8], record_len: usize) {
        let record = |code: u128| {
            let at = (code as u32) as usize * record_len;
            &records[at..at + record_len]
        };
        self.order.clear();
        self.order.extend(records.chunks_exact(record_len).enumerate().map(|(index, r)| {
            let (upper, lower) = morton::position_words(position(r));
            u128::from(upper) << 80 | u128::from(lower) << 32 | index as u128
        }));
        self.order.sort_unstable();
        for run in self.order.chunk_by_mut(|a, b| a >> 32 == b >> 32).filter(|run| run.len() > 1) {
            run.sort_unstable_by(|a, b| record(*a).cmp(record(*b)));
        }
        self.sorted.clear();
        self.sorted.reserve(records.len());
        for code in &self.order {
            self.sorted.extend_from_slice(record(*code));
        }
    }

    /// Fills `planar` from `order` and `sorted`.
    fn planarise(&mut self, attributes: &[Attribute], record_len: usize) {
        self.planar.clear();
        self.planar.reserve(self.order.len() * attributes.iter().map(planar_size).sum::<usize>());
        let mut at = 0;
        for attribute in attributes {
            let size = attribute.size();
            let values = self.sorted.chunks_exact(record_len).map(|r| &r[at..at + size]);
            match attribute.name.as_str() {
                "position" => {
                    for code in &self.order {
                        let upper = (code >> 80) as u64;
                        let lower = (code >> 32) as u64 & 0xffff_ffff_ffff;
                        self.planar.extend_from_slice(&upper.to_le_bytes());
                        self.planar.extend_from_slice(&lower.to_le_bytes());
                    }
                }
                "rgb" => {
                    for v in values {
                        let channel = |c: usize| u16::from_le_bytes([v[2 * c], v[2 * c + 1]]);
                        let code = morton::interleave(channel(0), channel(1), channel(2));
                        self.planar.extend_from_slice(&code.to_le_bytes());
                    }
                }
                _ => values.for_each(|v| self.planar.extend_from_slice(v)),
            }
            at += size;
        }
    }
}

fn position(record: &[u8]) -> [i32; 3] {
    std::array::from_fn(|a| i32::from_le_bytes([0, 1, 2, 3].map(|b| record[4 * a + b])))
}

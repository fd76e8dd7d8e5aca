//! A node's records as Potree's BROTLI encoding keeps them.

use std::ops::RangeInclusive;

use crate::{Attribute, AttributeType, WriteError};

use super::columns::{Column, ColumnEncoder, MAX_NUMBER};
use super::metadata::planar_size;
use super::{brotli, morton};
use crate::geometry::morton::morton21;

/// Memory that a thread reuses from node to node.
#[derive(Debug, Default)]
pub struct BrotliScratch {
    /// Morton code of every point, 96 bits: the upper word from bit 48 on, then the lower one. Sorted in the end.
    codes: Vec<u128>,
    /// Codes without what all share, with the index of the point in the low bits.
    keys: Vec<u64>,
    /// The same where 64 bits are too few.
    wide_keys: Vec<u128>,
    /// Indices of the points in the order in which they are stored.
    order: Vec<u32>,
    /// Records in that order.
    sorted: Vec<u8>,
    /// The planes before compression.
    planar: Vec<u8>,
    columns: ColumnEncoder,
}

/// At these qualities the planes are encoded as the columns of numbers that they are.
const BY_COLUMN: RangeInclusive<u8> = 5..=9;

/// Nodes of fewer points are left to the library: descriptions of codes would be most of the stream.
const MIN_POINTS: usize = 64;

/// Encodes the points of one node as one complete Brotli stream (window 22) and appends it to `out`.
///
/// `records`: DEFAULT records of `attributes`, interleaved, in any order; `position` (int32 × 3) is the first
/// attribute, an `rgb` is uint16 × 3. `quality`: 0–11; from 5 to 9 columns are encoded as what they are, for which the
/// library's methods are slower and larger. The points are sorted by the Morton code of their position, then
/// by the bytes of their records, so the result does not depend on the order of `records`.
///
/// Positions are stored as they are. (PotreeConverter 2.1.1 stores every coordinate plus one.)
///
/// # Errors
/// [`WriteError::Input`] for attributes, lengths or a quality other than these, or more than 2^32 points.
pub fn encode_brotli(
    attributes: &[Attribute],
    records: &[u8],
    quality: u8,
    scratch: &mut BrotliScratch,
    out: &mut Vec<u8>,
) -> Result<(), WriteError> {
    encode_brotli_while(attributes, records, quality, scratch, &|| true, out)
}

/// [`encode_brotli`] that can be stopped: `goes_on` is asked many times a second. High qualities take seconds for a large
/// node.
///
/// # Errors
/// As [`encode_brotli`]; [`WriteError::Stopped`] once `goes_on` has said no, with `out` as it was.
pub fn encode_brotli_while(
    attributes: &[Attribute],
    records: &[u8],
    quality: u8,
    scratch: &mut BrotliScratch,
    goes_on: &dyn Fn() -> bool,
    out: &mut Vec<u8>,
) -> Result<(), WriteError> {
    let record_len: usize = attributes.iter().map(Attribute::size).sum();
    check(attributes, records.len(), record_len)?;
    scratch.sort(records, record_len);
    scratch.planarise(attributes, record_len);
    let columns = columns(attributes).filter(|_| BY_COLUMN.contains(&quality) && scratch.order.len() >= MIN_POINTS);
    match columns {
        Some(columns) => scratch.columns.encode(&scratch.planar, &columns, scratch.order.len(), goes_on, out),
        None => brotli::compress(&scratch.planar, quality, goes_on, out),
    }
}

/// What the planes of these attributes are; `None` if there are wider ones than numbers.
fn columns(attributes: &[Attribute]) -> Option<Vec<Column>> {
    let column = |a: &Attribute| match (a.name.as_str(), a.size()) {
        ("position", _) => Some(Column::Positions),
        ("rgb", _) => Some(Column::Colours),
        (_, size @ 1..=MAX_NUMBER) => Some(Column::Numbers(size)),
        _ => None,
    };
    attributes.iter().map(column).collect()
}

fn check(attributes: &[Attribute], len: usize, record_len: usize) -> Result<(), WriteError> {
    let is = |a: &Attribute, name, ty| a.name == name && a.ty == ty && a.elements == 3;
    let refuse = |what: &str| Err(WriteError::input(what));
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
    /// Fills `order` and `sorted` with `records` in canonical order.
    fn sort(&mut self, records: &[u8], record_len: usize) {
        let record = |index: &u32| &records[*index as usize * record_len..][..record_len];
        self.codes.clear();
        self.codes.extend(records.chunks_exact(record_len).map(|r| {
            let (upper, lower) = morton::position_words(position(r));
            u128::from(upper) << 48 | u128::from(lower)
        }));
        self.sort_codes();
        let mut start = 0;
        for run in self.codes.chunk_by(|a, b| a == b) {
            let end = start + run.len();
            if run.len() > 1 {
                self.order[start..end].sort_unstable_by(|a, b| record(a).cmp(record(b)));
            }
            start = end;
        }
        self.sorted.clear();
        self.sorted.reserve(records.len());
        self.order.iter().for_each(|index| self.sorted.extend_from_slice(record(index)));
    }

    /// Sorts `codes` and fills `order` with the indices that they had. The points of a node share the high bits of
    /// their codes, so what differs fits 64 bits together with the index, in all but very wide nodes: shorter keys sort
    /// faster.
    fn sort_codes(&mut self) {
        let first = self.codes.first().copied().unwrap_or(0);
        let differing = self.codes.iter().fold(0, |bits, code| bits | (code ^ first));
        let code_bits = u128::BITS - differing.leading_zeros();
        let index_bits = usize::BITS - self.codes.len().leading_zeros();
        self.order.clear();
        if code_bits + index_bits <= u64::BITS {
            let mask = (1u128 << code_bits) - 1;
            let key = |(index, code): (usize, &u128)| ((code & mask) as u64) << index_bits | index as u64;
            self.keys.clear();
            self.keys.extend(self.codes.iter().enumerate().map(key));
            self.keys.sort_unstable();
            self.order.extend(self.keys.iter().map(|key| (key & ((1 << index_bits) - 1)) as u32));
            let code = |key: &u64| first & !mask | u128::from(key >> index_bits);
            self.codes.iter_mut().zip(&self.keys).for_each(|(out, key)| *out = code(key));
        } else {
            self.wide_keys.clear();
            self.wide_keys.extend(self.codes.iter().enumerate().map(|(index, code)| code << 32 | index as u128));
            self.wide_keys.sort_unstable();
            self.order.extend(self.wide_keys.iter().map(|key| *key as u32));
            self.codes.iter_mut().zip(&self.wide_keys).for_each(|(out, key)| *out = key >> 32);
        }
    }

    /// Fills `planar` from `codes` and `sorted`.
    fn planarise(&mut self, attributes: &[Attribute], record_len: usize) {
        let count = self.order.len();
        self.planar.resize(count * attributes.iter().map(planar_size).sum::<usize>(), 0);
        let mut rest = self.planar.as_mut_slice();
        let mut at = 0;
        for attribute in attributes {
            let (plane, after) = rest.split_at_mut(count * planar_size(attribute));
            rest = after;
            let values = self.sorted.chunks_exact(record_len).map(|r| &r[at..at + attribute.size()]);
            match (attribute.name.as_str(), attribute.size()) {
                ("position", _) => {
                    for (out, code) in plane.as_chunks_mut::<16>().0.iter_mut().zip(&self.codes) {
                        let (upper, lower) = ((code >> 48) as u64, *code as u64 & 0xffff_ffff_ffff);
                        *out = (u128::from(lower) << 64 | u128::from(upper)).to_le_bytes();
                    }
                }
                ("rgb", _) => {
                    for (out, v) in plane.as_chunks_mut::<8>().0.iter_mut().zip(values) {
                        let channel = |c: usize| u16::from_le_bytes([v[2 * c], v[2 * c + 1]]);
                        *out = morton21([0, 1, 2].map(|c| u32::from(channel(c)))).to_le_bytes();
                    }
                }
                // The usual sizes by name: a copy of a known length is a single instruction.
                (_, 1) => copy::<1>(plane, values),
                (_, 2) => copy::<2>(plane, values),
                (_, 4) => copy::<4>(plane, values),
                (_, 8) => copy::<8>(plane, values),
                (_, size) => plane.chunks_exact_mut(size).zip(values).for_each(|(out, v)| out.copy_from_slice(v)),
            }
            at += attribute.size();
        }
    }
}

fn copy<'v, const N: usize>(plane: &mut [u8], values: impl Iterator<Item = &'v [u8]>) {
    for (out, value) in plane.as_chunks_mut::<N>().0.iter_mut().zip(values) {
        out.copy_from_slice(value);
    }
}

fn position(record: &[u8]) -> [i32; 3] {
    std::array::from_fn(|a| i32::from_le_bytes([0, 1, 2, 3].map(|b| record[4 * a + b])))
}

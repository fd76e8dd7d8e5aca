//! The chunk behind a chunk: decoded in turn with it, which takes much less time than the one after the other, and kept
//! until it is asked for.

use super::laz::{Filled, LayeredPair, Pair, Parts, Stop};
use crate::Piece;

/// A chunk is decoded ahead if neither its bytes nor its records are more.
const MOST_BYTES: u64 = 4 << 20;

/// Whether a chunk may be decoded ahead.
pub(super) fn is_small(chunk: &Piece, record_len: usize) -> bool {
    chunk.points.saturating_mul(record_len as u64).max(chunk.byte_len) <= MOST_BYTES
}

/// A chunk that was decoded ahead.
#[derive(Debug)]
pub(super) struct Ahead {
    /// Which scan and piece it is, and what of it is decoded.
    pub(super) of: (u64, usize, Parts),
    pub(super) records: Vec<u8>,
    /// Bytes of the good records.
    pub(super) good: usize,
    /// Why there are no more, if those are not all.
    pub(super) result: Result<(), Stop>,
}

impl Ahead {
    /// Hands over what was decoded, as a decoder does.
    pub(super) fn reader(&mut self, record_len: usize) -> Reader<'_> {
        Reader { ahead: self, record_len, at: 0 }
    }
}

/// A place in a chunk that was decoded ahead.
pub(super) struct Reader<'a> {
    ahead: &'a mut Ahead,
    record_len: usize,
    at: usize,
}

impl Reader<'_> {
    /// Fills `out` with whole records.
    pub(super) fn fill(&mut self, out: &mut [u8]) -> Filled {
        let Self { ahead, record_len, at } = self;
        let there = &ahead.records[*at..ahead.good];
        let n = out.len().min(there.len());
        out[..n].copy_from_slice(&there[..n]);
        *at += n;
        let result = if n < out.len() { std::mem::replace(&mut ahead.result, Ok(())) } else { Ok(()) };
        (n / *record_len, result)
    }
}

/// Two chunks that are decoded in turn.
pub(super) enum Chunks<'m, 'a> {
    Pointwise(Pair<'m, 'a>),
    Layered(LayeredPair<'m, 'a>),
}

impl Chunks<'_, '_> {
    fn fill(&mut self, outs: [&mut [u8]; 2]) -> [Filled; 2] {
        match self {
            Self::Pointwise(pair) => pair.fill(outs),
            Self::Layered(pair) => pair.fill(outs),
        }
    }
}

/// Decodes a chunk, and the one behind it ahead.
pub(super) struct Two<'m, 'a> {
    pair: Chunks<'m, 'a>,
    record_len: usize,
    ahead: Ahead,
}

impl<'m, 'a> Two<'m, 'a> {
    /// `ahead`: the records that the second chunk has, of which none is good yet.
    pub(super) fn new(pair: Chunks<'m, 'a>, record_len: usize, ahead: Ahead) -> Self {
        Self { pair, record_len, ahead }
    }

    /// Fills `out` with whole records of the first chunk.
    pub(super) fn fill(&mut self, out: &mut [u8]) -> Filled {
        let Self { pair, record_len, ahead } = self;
        let left = if ahead.result.is_ok() { ahead.records.len() - ahead.good } else { 0 };
        let of_second = &mut ahead.records[ahead.good..][..left.min(out.len())];
        let [filled, (good, result)] = pair.fill([out, of_second]);
        ahead.good += good * *record_len;
        if left > 0 {
            ahead.result = result;
        }
        filled
    }

    /// The second chunk, decoded to its end.
    pub(super) fn finish(mut self) -> Ahead {
        while self.ahead.result.is_ok() && self.ahead.good < self.ahead.records.len() {
            let left = self.ahead.records.len() - self.ahead.good;
            let [_, (good, result)] = self.pair.fill([&mut [], &mut self.ahead.records[self.ahead.good..][..left]]);
            self.ahead.good += good * self.record_len;
            self.ahead.result = result;
        }
        self.ahead
    }
}

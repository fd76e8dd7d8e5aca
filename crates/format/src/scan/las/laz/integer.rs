//! Integers as corrections of predictions.

use super::coder::Coder;
use super::in_turn::in_turn;
use super::model::{BitModel, Bytes, Small};

/// Corrections of up to so many bits have a model of all their values; larger ones of their upper so many bits, and the
/// rest is stored as it is.
const MODEL_BITS: u32 = 8;

/// Decodes integers near their predictions: first the number of bits of the correction, then the correction.
#[derive(Debug, Clone)]
pub(super) struct Integer {
    /// Numbers of bits, by context.
    bits: Vec<Small>,
    /// Corrections 0 and 1.
    bit: BitModel,
    /// Corrections of 1 to 31 bits.
    corrections: Vec<Bytes>,
    /// Bits of the last correction.
    last_bits: usize,
}

impl Integer {
    /// Integers of `bits` (8 to 32) bits. Results are right in their lower `bits` bits.
    pub(super) fn new(bits: usize, contexts: usize) -> Self {
        let values = |bits: usize| 1 << bits.min(MODEL_BITS as usize);
        Self {
            bits: vec![Small::new(bits + 1); contexts],
            bit: BitModel::new(),
            corrections: (1..=bits.min(31)).map(|bits| Bytes::new(values(bits))).collect(),
            last_bits: 0,
        }
    }

    /// Forgets everything.
    pub(super) fn reset(&mut self) {
        self.bits.iter_mut().for_each(Small::reset);
        self.bit = BitModel::new();
        self.corrections.iter_mut().for_each(Bytes::reset);
        self.last_bits = 0;
    }

    /// Bits of the last correction, 0 to 32.
    #[inline(always)]
    pub(super) fn last_bits(&self) -> usize {
        self.last_bits
    }

    /// The next integer; `context` is less than the number of contexts.
    #[inline(always)]
    pub(super) fn next(&mut self, coder: &mut Coder<'_>, predicted: i32, context: usize) -> i32 {
        let bits = coder.symbol(&mut self.bits[context]);
        self.correct(coder, bits, predicted)
    }

    /// The next integers of several decoders, in turn.
    #[inline(always)]
    pub(super) fn next_of<const L: usize>(
        integers: [&mut Self; L],
        coders: &mut [Coder<'_>; L],
        predicted: [i32; L],
        contexts: [usize; L],
    ) -> [i32; L] {
        let (mut bits, mut out) = ([0; L], [0; L]);
        in_turn!(|l| bits[l] = coders[l].symbol(&mut integers[l].bits[contexts[l]]));
        in_turn!(|l| out[l] = integers[l].correct(&mut coders[l], bits[l], predicted[l]));
        out
    }

    /// The integer whose correction has so many bits.
    #[inline(always)]
    fn correct(&mut self, coder: &mut Coder<'_>, bits: usize, predicted: i32) -> i32 {
        self.last_bits = bits;
        let Some(model) = self.corrections.get_mut(bits.wrapping_sub(1)) else {
            return predicted.wrapping_add(match bits {
                0 => i32::from(coder.bit(&mut self.bit)),
                _ => i32::MIN,
            });
        };
        let correction = correction(coder, model, bits as u32);
        // the lower half stands for −(2^bits − 1) to −2^(bits−1), the upper one for 2^(bits−1) + 1 to 2^bits
        let is_upper = correction >> (bits - 1) != 0;
        let shift = if is_upper { 1 } else { 1u32.wrapping_sub(1 << bits) };
        predicted.wrapping_add(correction.wrapping_add(shift).cast_signed())
    }
}

#[inline(always)]
fn correction(coder: &mut Coder<'_>, model: &mut Bytes, bits: u32) -> u32 {
    let upper = coder.symbol(model) as u32;
    if bits <= MODEL_BITS {
        return upper;
    }
    let rest = bits - MODEL_BITS;
    upper << rest | coder.bits(rest)
}

//! The arithmetic decoder: an interval of the numbers of 32 bits that narrows with each symbol.
//!
//! `value` < `length` holds from the start on, whatever the bytes are, so no symbol is beyond its model. Bytes that are
//! not there read as zeros, and [`Coder::is_off`] tells: callers ask after each point, so that damage costs at most the
//! work of one point.

use super::model::{BitModel, END, Model, SHARE_BITS};

/// Numbers of more bits are in two parts.
const FEW_BITS: u32 = 19;

/// Added to the place of a decoder that has met what no encoder writes.
const BROKEN: usize = usize::MAX / 2;

/// A decoder at a place in some bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coder<'a> {
    bytes: &'a [u8],
    at: usize,
    value: u32,
    length: u32,
}

/// A decoder between two looks at its bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Paused {
    /// The next byte; beyond the end if bytes were missing.
    pub(super) at: usize,
    value: u32,
    length: u32,
}

impl Paused {
    /// Goes on in `bytes`.
    pub(super) fn resume(self, bytes: &[u8]) -> Coder<'_> {
        let Self { at, value, length } = self;
        Coder { bytes, at, value, length }
    }
}

/// What is not worth the space in a loop gets a copy of the decoder, which itself may be in registers then.
#[inline(always)]
pub(super) fn by_copy<'a, T>(coder: &mut Coder<'a>, next: impl FnOnce(&mut Coder<'a>) -> T) -> T {
    let mut copy = *coder;
    let value = next(&mut copy);
    *coder = copy;
    value
}

impl<'a> Coder<'a> {
    /// Bytes that a decoder reads before its first symbol.
    pub(super) const START: usize = 4;

    /// Starts at byte `at`.
    pub(super) fn start(bytes: &'a [u8], at: usize) -> Self {
        let mut coder = Self { bytes, at, value: 0, length: u32::MAX };
        coder.value = coder.ahead();
        coder.at += Self::START;
        if coder.value == u32::MAX {
            coder.fail();
        }
        coder
    }

    pub(super) fn pause(self) -> Paused {
        let Self { at, value, length, .. } = self;
        Paused { at, value, length }
    }

    /// The next byte; beyond the end if bytes were missing.
    #[inline(always)]
    pub(super) fn at(&self) -> usize {
        if self.is_broken() { self.at - BROKEN } else { self.at }
    }

    /// True once bytes were missing or made no sense: what was decoded since the last question is worth nothing.
    #[inline(always)]
    pub(super) fn is_off(&self) -> bool {
        self.at > self.bytes.len()
    }

    /// True once the bytes made no sense.
    #[inline(always)]
    pub(super) fn is_broken(&self) -> bool {
        self.at >= BROKEN
    }

    /// Met what no encoder writes; if bytes were missing before, that is the reason.
    #[inline(always)]
    pub(super) fn fail(&mut self) {
        if !self.is_off() {
            self.at += BROKEN;
        }
        self.value = 0;
    }

    /// The next four bytes, the first the highest.
    #[inline(always)]
    fn ahead(&self) -> u32 {
        match self.bytes.get(self.at..).and_then(|rest| rest.first_chunk()) {
            Some(bytes) => u32::from_be_bytes(*bytes),
            None => self.ahead_at_end(),
        }
    }

    #[cold]
    fn ahead_at_end(&self) -> u32 {
        let mut bytes = [0; 4];
        for (byte, there) in bytes.iter_mut().zip(self.bytes.get(self.at..).unwrap_or_default()) {
            *byte = *there;
        }
        u32::from_be_bytes(bytes)
    }

    /// Without a branch: how many bytes are due follows from the symbol, which nobody can predict.
    #[inline(always)]
    fn stretch(&mut self) {
        let is_below = |bits: u32| u32::from(self.length < 1 << bits);
        // an interval has at least a number, so that three bytes suffice
        let by = (is_below(24) + is_below(16) + is_below(8)) * 8;
        let wide = u64::from(self.value) << 32 | u64::from(self.ahead());
        self.value = (wide << by >> 32) as u32;
        self.length <<= by;
        self.at += (by >> 3) as usize;
    }

    /// A symbol of a model; less than its number of symbols.
    #[inline(always)]
    pub(super) fn symbol<const N: usize, const T: usize>(&mut self, model: &mut Model<N, T>) -> usize {
        model.prepare();
        let unit = self.length >> SHARE_BITS;
        let share = self.value.checked_div(unit).unwrap_or(0);
        let (symbol, low, high) = model.take(share);
        let start = low * unit;
        // what the division cuts off belongs to the last symbol
        let end = if high == u32::from(END) { self.length } else { high * unit };
        self.value -= start;
        self.length = end - start;
        self.stretch();
        symbol
    }

    /// A bit of a model.
    #[inline(always)]
    pub(super) fn bit(&mut self, model: &mut BitModel) -> bool {
        let zero = model.zero * (self.length >> BitModel::SHARE_BITS);
        let bit = self.value >= zero;
        if bit {
            self.value -= zero;
            self.length -= zero;
        } else {
            self.length = zero;
        }
        self.stretch();
        model.count(bit);
        bit
    }

    /// A number of `bits` (1 to 32) bits, all of its values equally likely.
    #[inline(always)]
    pub(super) fn bits(&mut self, bits: u32) -> u32 {
        if bits > FEW_BITS {
            return by_copy(self, |coder| coder.many_bits(bits));
        }
        self.few_bits(bits)
    }

    #[cold]
    #[inline(never)]
    fn many_bits(&mut self, bits: u32) -> u32 {
        let low = self.few_bits(16);
        self.few_bits(bits - 16) << 16 | low
    }

    #[inline(always)]
    fn few_bits(&mut self, bits: u32) -> u32 {
        self.length >>= bits;
        let number = self.value.checked_div(self.length).unwrap_or(0);
        self.value -= number * self.length;
        self.stretch();
        if number >> bits != 0 {
            self.fail();
            return 0;
        }
        number
    }

    /// A number of 64 bits.
    #[inline(always)]
    pub(super) fn bits_64(&mut self) -> u64 {
        let low = u64::from(self.bits(32));
        u64::from(self.bits(32)) << 32 | low
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::Bytes;
    use super::*;

    #[test]
    fn any_bytes_give_symbols_of_the_model_and_the_end_is_told() {
        let random: Vec<u8> = (0..4000u32).map(|i| (i.wrapping_mul(0x9e37_79b1) >> 13) as u8).collect();
        for bytes in [&random[..], &[0xff; 500], &[0; 500], &[0xff, 0xff, 0xff, 0xfe, 0xff, 0xff], &[1], &[]] {
            let mut coder = Coder::start(bytes, 0);
            let (mut model, mut bit) = (Bytes::new(256), BitModel::new());
            // an adapted model needs less than 0.01 bits a symbol, never nothing
            for round in 0.. {
                assert!(round < 2000 * (bytes.len() + 8), "it must end");
                if coder.is_off() {
                    break;
                }
                assert!(coder.symbol(&mut model) < 256);
                coder.bit(&mut bit);
                assert!(coder.value < coder.length && coder.length >= 1 << 24);
                if round % 50 == 0 {
                    coder.bits(1 + round as u32 % 31);
                }
            }
        }
    }

    #[test]
    fn what_no_encoder_writes_is_broken() {
        assert!(Coder::start(&[0xff; 20], 0).is_broken());
        let mut coder = Coder::start(&[0xff, 0xff, 0xff, 0xfe, 0, 0], 0);
        assert!(!coder.is_off());
        coder.bits(19); // 2^32 − 2 is behind the last of 2^19 equal parts
        assert!(coder.is_off() && coder.is_broken());
        let cut = Coder::start(&[1, 2, 3], 0);
        assert!(cut.is_off() && !cut.is_broken());
    }

    #[test]
    fn a_paused_decoder_goes_on_where_it_was_in_other_bytes() {
        let bytes: Vec<u8> = (0..400u32).map(|i| (i * i) as u8).collect();
        let symbols = |pause: bool| {
            let mut model = Bytes::new(256);
            let mut coder = Coder::start(&bytes, 0);
            let mut out = Vec::new();
            for i in 0..200 {
                if pause && i == 100 {
                    let mut paused = coder.pause();
                    let gone = paused.at;
                    paused.at = 0;
                    coder = paused.resume(&bytes[gone..]);
                }
                out.push(coder.symbol(&mut model));
            }
            out
        };
        assert_eq!(symbols(false), symbols(true));
    }
}

//! What stands before a byte says what the byte may be: contexts of literals (RFC 7932, section 7.1), and what bytes cost
//! in them.

use super::logs::log2;

/// Elements have no more bytes than this.
pub(super) const MAX_SIZE: usize = 16;

/// Contexts that a byte may have.
pub(super) const CONTEXTS: usize = 64;

/// Bytes that tell which contexts serve a column, and what its bytes cost.
const SAMPLE: usize = 4096;

/// How the bytes before make a context.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Mode {
    /// The six low bits of the last byte.
    #[default]
    LowBits = 0,
    /// The six high bits of the last byte.
    HighBits = 1,
    /// The classes of both bytes before, as if they had a sign.
    Classes = 3,
}

const MODES: [Mode; 3] = [Mode::LowBits, Mode::HighBits, Mode::Classes];

/// What the last byte, and the one before it, add to the context.
type Parts = [[u8; 256]; 2];

static LOW_BITS: Parts = parts(Mode::LowBits);
static HIGH_BITS: Parts = parts(Mode::HighBits);
static BY_CLASS: Parts = parts(Mode::Classes);

const fn parts(mode: Mode) -> Parts {
    let mut parts = [[0; 256]; 2];
    let mut byte = 0;
    while byte < 256 {
        match mode {
            Mode::LowBits => parts[0][byte] = byte as u8 & 63,
            Mode::HighBits => parts[0][byte] = byte as u8 >> 2,
            Mode::Classes => {
                parts[0][byte] = class(byte as u8) << 3;
                parts[1][byte] = class(byte as u8);
            }
        }
        byte += 1;
    }
    parts
}

/// The class of a byte: as a number with a sign, near zero or far from it.
const fn class(byte: u8) -> u8 {
    match byte {
        0 => 0,
        1..=15 => 1,
        16..=63 => 2,
        64..=127 => 3,
        128..=191 => 4,
        192..=239 => 5,
        240..=254 => 6,
        255 => 7,
    }
}

impl Mode {
    fn parts(self) -> &'static Parts {
        match self {
            Self::LowBits => &LOW_BITS,
            Self::HighBits => &HIGH_BITS,
            Self::Classes => &BY_CLASS,
        }
    }

    /// Calls `f` with each of `bytes` and its context, below [`CONTEXTS`]. `before`: the two bytes before them, the last
    /// one last.
    #[inline]
    pub(super) fn each(self, bytes: &[u8], mut before: [u8; 2], mut f: impl FnMut(u8, usize)) {
        let [last, other] = self.parts();
        for &byte in bytes {
            let context = last[usize::from(before[1])] | other[usize::from(before[0])];
            f(byte, usize::from(context) % CONTEXTS);
            before = [before[1], byte];
        }
    }
}

/// Counts of bytes by context.
pub(super) type Counts = [[u16; 256]; CONTEXTS];

/// Chooses the mode under which the bytes of some elements cost least, and tells what they cost as they are by their place
/// in the element, in parts of a bit.
///
/// What a byte costs is told by those before it in the sample, so that many contexts pay for what they take to learn.
pub(super) fn weigh(column: &[u8], size: usize, counts: &mut Counts) -> (Mode, [u32; MAX_SIZE]) {
    let all = column.len() / size;
    let step = (all * size).div_ceil(SAMPLE).max(1);
    let mut best = (u64::MAX, Mode::Classes, [0; MAX_SIZE]);
    for mode in MODES {
        counts.fill([0; 256]);
        let (mut totals, mut costs) = ([0u32; CONTEXTS], [0; MAX_SIZE]);
        let mut sampled = 0;
        for at in (0..all).skip(1).step_by(step).map(|number| number * size) {
            sampled += 1;
            let mut place = 0;
            mode.each(&column[at..at + size], [column[at.saturating_sub(2)], column[at - 1]], |byte, context| {
                let (total, count) = (&mut totals[context], &mut counts[context][usize::from(byte)]);
                // each byte was seen a sixteenth of a time before the first
                costs[place] += log2(16 * *total + 256) - log2(16 * u32::from(*count) + 1);
                *total += 1;
                *count += 1;
                place += 1;
            });
        }
        let sum = costs.iter().sum();
        if sum < best.0 {
            best = (sum, mode, costs.map(|cost| (cost / sampled.max(1)) as u32));
        }
    }
    (best.1, best.2)
}

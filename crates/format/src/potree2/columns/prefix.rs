//! Prefix codes: made of counts, described and used (RFC 7932, section 3).

use super::bits::BitWriter;

/// No code of a symbol is longer.
const MAX_BITS: u8 = 15;

/// No code of a code length is longer.
const MAX_LENGTH_BITS: u8 = 5;

/// The order in which the lengths of the codes of code lengths are stored.
const LENGTH_ORDER: [usize; 18] = [1, 2, 3, 4, 0, 5, 17, 6, 16, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/// How such a length, 0 to 5, is stored: the bits and how many.
const STORED_LENGTHS: [(u64, u32); 6] = [(0b00, 2), (0b0111, 4), (0b011, 3), (0b10, 2), (0b01, 2), (0b1111, 4)];

/// Repeats the length before it; repeats zero.
const REPEAT: u8 = 16;
const ZEROS: u8 = 17;

/// A prefix code for the symbols below a limit.
#[derive(Debug, Default)]
pub(super) struct PrefixCode {
    /// Of each symbol, the bits of its code from bit 8 on, and how many below.
    codes: Vec<u32>,
    lengths: Vec<u8>,
    tree: Tree,
}

impl PrefixCode {
    /// Makes the code for symbols that occur `counts` times, and writes its description.
    pub(super) fn write_description(&mut self, counts: &[u32], bits: &mut BitWriter<'_>) {
        self.lengths.clear();
        self.lengths.resize(counts.len(), 0);
        let used = self.tree.lengths(counts, MAX_BITS, &mut self.lengths);
        if used <= 4 {
            self.write_simple(bits);
        } else {
            self.write_complex(bits);
        }
        self.assign();
    }

    /// Writes one symbol.
    #[inline]
    pub(super) fn write(&self, symbol: usize, bits: &mut BitWriter<'_>) {
        let code = self.codes[symbol];
        bits.write(u64::from(code >> 8), code & 0xff);
    }

    /// The bits of a symbol and how many.
    #[inline]
    pub(super) fn code(&self, symbol: usize) -> (u64, u32) {
        let code = self.codes[symbol];
        (u64::from(code >> 8), code & 0xff)
    }

    /// Gives out codes in the order of lengths, then of symbols. A single symbol takes no bits.
    fn assign(&mut self) {
        self.codes.clear();
        self.codes.resize(self.lengths.len(), 0);
        assign(&self.lengths, &mut self.codes);
    }

    /// Up to four symbols are listed.
    fn write_simple(&mut self, bits: &mut BitWriter<'_>) {
        let mut listed: Vec<(u8, usize)> = Vec::with_capacity(4);
        listed.extend(self.lengths.iter().enumerate().filter(|(_, l)| **l > 0).map(|(symbol, l)| (*l, symbol)));
        listed.sort_unstable();
        if listed.is_empty() {
            listed.push((1, 0));
            self.lengths[0] = 1;
        }
        let symbol_bits = usize::BITS - (self.lengths.len() - 1).leading_zeros();
        bits.write(1, 2);
        bits.write(listed.len() as u64 - 1, 2);
        listed.iter().for_each(|(_, symbol)| bits.write(*symbol as u64, symbol_bits));
        if let [.., (last, _)] = listed[..]
            && listed.len() == 4
        {
            bits.write(u64::from(last == 3), 1);
        }
    }

    fn write_complex(&mut self, bits: &mut BitWriter<'_>) {
        let steps = shorten(&self.lengths);
        let mut counts = [0; 18];
        steps.iter().for_each(|(code, _)| counts[usize::from(*code)] += 1);
        let mut lengths = [0; 18];
        let used = self.tree.lengths(&counts, MAX_LENGTH_BITS, &mut lengths);
        write_lengths(&lengths, used, bits);
        let mut codes = [0; 18];
        assign(&lengths, &mut codes);
        for (code, extra) in steps {
            let stored = codes[usize::from(code)];
            bits.write(u64::from(stored >> 8), stored & 0xff);
            match code {
                REPEAT => bits.write(extra, 2),
                ZEROS => bits.write(extra, 3),
                _ => {}
            }
        }
    }
}

/// Writes the lengths of the codes of code lengths. `used`: how many are not zero; with several, zeros at the end are
/// omitted.
fn write_lengths(lengths: &[u8; 18], used: usize, bits: &mut BitWriter<'_>) {
    let in_order = LENGTH_ORDER.map(|code| lengths[code]);
    let end = if used > 1 { in_order.iter().rposition(|l| *l > 0).map_or(0, |last| last + 1) } else { 18 };
    let skip = match in_order {
        [0, 0, 0, ..] => 3,
        [0, 0, ..] => 2,
        _ => 0,
    };
    bits.write(skip as u64, 2);
    for length in &in_order[skip..end] {
        let (stored, count) = STORED_LENGTHS[usize::from(*length)];
        bits.write(stored, count);
    }
}

/// Canonical codes, written from their highest bit on. A single symbol takes no bits.
fn assign(lengths: &[u8], codes: &mut [u32]) {
    let mut starts = [0u32; MAX_BITS as usize + 2];
    lengths.iter().filter(|l| **l > 0).for_each(|l| starts[usize::from(*l) + 1] += 1);
    if starts.iter().sum::<u32>() < 2 {
        return;
    }
    for length in 1..starts.len() {
        starts[length] = (starts[length - 1] + starts[length]) << 1;
    }
    for (code, &length) in codes.iter_mut().zip(lengths).filter(|(_, l)| **l > 0) {
        let next = &mut starts[usize::from(length)];
        *code = (*next).reverse_bits() >> (32 - u32::from(length)) << 8 | u32::from(length);
        *next += 1;
    }
}

/// The lengths as codes with their extra bits, runs shortened, up to the last that is not zero.
fn shorten(lengths: &[u8]) -> Vec<(u8, u64)> {
    let end = lengths.iter().rposition(|l| *l > 0).map_or(0, |last| last + 1);
    let mut steps = Vec::with_capacity(end);
    let mut before = 8;
    for run in lengths[..end].chunk_by(|a, b| a == b) {
        let (length, mut left) = (run[0], run.len());
        if length > 0 && length != before {
            steps.push((length, 0));
            (before, left) = (length, left - 1);
        }
        if left < 3 {
            steps.extend(std::iter::repeat_n((length, 0), left));
        } else if length == 0 {
            repeat(ZEROS, 3, left, &mut steps);
        } else {
            repeat(REPEAT, 2, left, &mut steps);
        }
    }
    steps
}

/// A run of at least 3 as repetitions: each that follows another multiplies what was there before by 2^`digit_bits`.
fn repeat(code: u8, digit_bits: u32, count: usize, steps: &mut Vec<(u8, u64)>) {
    let start = steps.len();
    let mut left = count - 3;
    loop {
        steps.push((code, left as u64 & ((1 << digit_bits) - 1)));
        left >>= digit_bits;
        if left == 0 {
            break;
        }
        left -= 1;
    }
    steps[start..].reverse();
}

/// Memory for the tree of a code.
#[derive(Debug, Default)]
struct Tree {
    /// Symbols with their counts, the rarest first: the count in the high bits.
    leaves: Vec<u64>,
    /// Counts of the inner nodes, in ascending order.
    inner: Vec<u64>,
    /// Of every leaf, then of every inner node, which inner node is above it; in the end its depth.
    above: Vec<u32>,
}

impl Tree {
    /// Fills `lengths` with the lengths of an optimal code for `counts`, none above `limit`; unused symbols have none.
    /// Returns how many symbols are used. The only one of a code gets the length 1.
    fn lengths(&mut self, counts: &[u32], limit: u8, lengths: &mut [u8]) -> usize {
        self.leaves.clear();
        let used = counts.iter().enumerate().filter(|(_, count)| **count > 0);
        self.leaves.extend(used.map(|(symbol, count)| u64::from(*count) << 32 | symbol as u64));
        if let [only] = self.leaves[..] {
            lengths[only as u32 as usize] = 1;
        }
        if self.leaves.len() < 2 {
            return self.leaves.len();
        }
        self.leaves.sort_unstable();
        // Rare symbols are taken for more frequent until the tree is flat enough.
        let mut floor = 1;
        while self.build(floor) > u32::from(limit) {
            floor *= 2;
        }
        for (leaf, depth) in self.leaves.iter().zip(&self.above) {
            lengths[*leaf as u32 as usize] = *depth as u8;
        }
        self.leaves.len()
    }

    /// Joins the two rarest again and again; returns the greatest depth.
    fn build(&mut self, floor: u64) -> u32 {
        let count = self.leaves.len();
        let leaf_count = |leaf: &u64| (leaf >> 32).max(floor);
        self.inner.clear();
        self.above.clear();
        self.above.resize(2 * count - 1, 0);
        let (mut leaf, mut inner) = (0, 0);
        for node in 0..count - 1 {
            let mut sum = 0;
            for _ in 0..2 {
                let of_leaf = self.leaves.get(leaf).map_or(u64::MAX, leaf_count);
                let of_inner = self.inner.get(inner).copied().unwrap_or(u64::MAX);
                let taken = if of_leaf <= of_inner { &mut leaf } else { &mut inner };
                let at = if of_leaf <= of_inner { *taken } else { count + *taken };
                self.above[at] = (count + node) as u32;
                *taken += 1;
                sum += of_leaf.min(of_inner);
            }
            self.inner.push(sum);
        }
        let root = 2 * count - 2;
        self.above[root] = 0;
        for node in (0..root).rev() {
            self.above[node] = self.above[self.above[node] as usize] + 1;
        }
        self.above[..count].iter().copied().max().unwrap_or(0)
    }
}

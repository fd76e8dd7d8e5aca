//! Adaptive models: how the interval of the arithmetic coder is shared among symbols, learnt from those before.

/// Shares of the interval are counted in 1/32,768.
pub(super) const SHARE_BITS: u32 = 15;

/// The bound behind the last symbol: above every share.
pub(super) const END: u16 = u16::MAX;

/// Bounds that are looked at beside the first one, before the search becomes a loop.
const AHEAD: usize = 3;

/// A model of at most `N` − 3 symbols, a power of two,, as LASzip's: counts of the symbols so far, and bounds that are worked out anew
/// now and then. `T`: entries of the table that shortens the search for a symbol, a power of two.
///
/// A model that was not used since [`Self::reset`] costs nothing: it is filled when its first symbol is due.
#[derive(Debug, Clone)]
pub(super) struct Model<const N: usize, const T: usize> {
    symbols: u16,
    /// Symbols until new bounds are due.
    left: u16,
    /// Symbols from the last bounds to the next ones.
    cycle: u16,
    /// Bits of a share within a part of the table.
    part_bits: u16,
    /// Sum of the counts when the bounds were worked out; 0 before the first symbol.
    total: u32,
    /// The symbol in whose share each part of the interval begins, or one before it: in units of [`Self::UNIT`].
    table: [u8; T],
    /// Where the share of each symbol begins, the first at 0; [`END`] from `symbols` on.
    bounds: [u16; N],
    counts: [u16; N],
}

/// Models of up to 16 symbols.
pub(super) type Tiny = Model<19, 32>;
/// Models of up to 64 symbols, but far fewer as a rule.
pub(super) type Small = Model<67, 128>;
/// Models of 64 symbols.
pub(super) type Flags = Model<67, 128>;
/// Models of 128 symbols.
pub(super) type Changes = Model<131, 256>;
/// Models of the values of a byte, or of the upper bits of a number.
pub(super) type Bytes = Model<259, 256>;
/// Models of the multiples of a time step.
pub(super) type Multiples = Model<1027, 256>;

impl<const N: usize, const T: usize> Model<N, T> {
    /// Counts are halved when they sum to more.
    const MAX_TOTAL: u32 = 1 << SHARE_BITS;
    /// The most symbols.
    const MOST: usize = N - AHEAD;
    /// Entries of the table are bytes.
    const UNIT: usize = Self::MOST.div_ceil(1 + u8::MAX as usize);

    /// A model of `symbols` (2 to `N` − 3) symbols.
    pub(super) fn new(symbols: usize) -> Self {
        let symbols = symbols.clamp(2, Self::MOST);
        let parts = (2 * symbols).next_power_of_two().clamp(16, T);
        let part_bits = (SHARE_BITS - parts.trailing_zeros()) as u16;
        let symbols = symbols as u16;
        Self { symbols, left: 0, cycle: 0, part_bits, total: 0, table: [0; T], bounds: [END; N], counts: [0; N] }
    }

    /// Forgets everything.
    pub(super) fn reset(&mut self) {
        (self.left, self.total) = (0, 0);
    }

    /// The symbol whose share holds `share`, and its bounds; the symbol is counted. What is above all shares belongs to
    /// the last symbol.
    #[inline(always)]
    pub(super) fn take(&mut self, share: u32) -> (usize, u32, u32) {
        let (symbol, low, high) = self.find(share);
        self.counts[symbol] += 1;
        (symbol, low, high)
    }

    /// To be called before [`Self::take`].
    #[inline(always)]
    pub(super) fn prepare(&mut self) {
        let (left, is_due) = self.left.overflowing_sub(1);
        self.left = left;
        if is_due {
            self.renew();
        }
    }

    /// Without a branch that depends on the symbol, which nobody can predict, unless several small shares are in a part.
    #[inline(always)]
    fn find(&self, share: u32) -> (usize, u32, u32) {
        // a share above all others begins its search at some symbol before its own
        let part = share >> self.part_bits;
        let first = (usize::from(self.table[part as usize & (T - 1)]) * Self::UNIT) & (Self::MOST - 1);
        let bound = |ahead: usize| u32::from(self.bounds[first + ahead]);
        let [b0, b1, b2, b3] = [bound(0), bound(1), bound(2), bound(3)];
        if share >= b3 {
            return self.search(first, share);
        }
        let (second, third) = (share >= b1, share >= b2);
        let (low, high) = if second { (b1, b2) } else { (b0, b1) };
        let (low, high) = if third { (b2, b3) } else { (low, high) };
        (first + usize::from(second) + usize::from(third), low, high)
    }

    #[cold]
    fn search(&self, first: usize, share: u32) -> (usize, u32, u32) {
        let bound = |symbol: usize| u32::from(self.bounds[symbol]);
        let mut symbol = first + AHEAD;
        while symbol + 1 < usize::from(self.symbols) && bound(symbol + 1) <= share {
            symbol += 1;
        }
        (symbol, bound(symbol), bound(symbol + 1))
    }

    /// Starts the model, or works out bounds from the counts, before a symbol.
    #[cold]
    #[inline(never)]
    fn renew(&mut self) {
        let symbols = u32::from(self.symbols);
        if self.total == 0 {
            self.counts[..symbols as usize].fill(1);
            self.total = symbols;
            self.cycle = ((symbols + 6) >> 1) as u16;
        } else {
            self.total += u32::from(self.cycle);
            if self.total > Self::MAX_TOTAL {
                self.halve();
            }
            self.cycle = (u32::from(self.cycle) * 5 / 4).min((symbols + 6) << 3) as u16;
        }
        self.left = self.cycle - 1;
        self.share_out();
    }

    fn halve(&mut self) {
        self.total = 0;
        for count in &mut self.counts[..usize::from(self.symbols)] {
            *count = (*count + 1) >> 1;
            self.total += u32::from(*count);
        }
    }

    fn share_out(&mut self) {
        let scale = (1 << 31) / self.total.max(1);
        let symbols = usize::from(self.symbols);
        let parts = 1 << (SHARE_BITS as u16 - self.part_bits);
        let table = &mut self.table[..parts];
        table.fill(0);
        let mut before = 0;
        for (symbol, (bound, count)) in self.bounds[..symbols].iter_mut().zip(&self.counts).enumerate() {
            *bound = ((scale * before) >> (31 - SHARE_BITS)) as u16;
            before += u32::from(*count);
            // of the symbols that begin within a part, the last is the first to be tried in the next one
            let part = (usize::from(*bound) + (1 << self.part_bits) - 1) >> self.part_bits;
            if let Some(entry) = table.get_mut(part) {
                *entry = (symbol / Self::UNIT) as u8;
            }
        }
        let mut last = 0;
        for entry in table {
            last = last.max(*entry);
            *entry = last;
        }
    }
}

/// A model of two symbols, which counts zeros alone.
#[derive(Debug, Clone)]
pub(super) struct BitModel {
    zeros: u16,
    total: u16,
    left: u16,
    cycle: u16,
    /// The share of zero, in 1/8,192.
    pub(super) zero: u32,
}

impl BitModel {
    /// Bits of [`Self::zero`].
    pub(super) const SHARE_BITS: u32 = 13;

    pub(super) const fn new() -> Self {
        Self { zeros: 1, total: 2, left: 4, cycle: 4, zero: 1 << (Self::SHARE_BITS - 1) }
    }

    #[inline(always)]
    pub(super) fn count(&mut self, bit: bool) {
        self.zeros += u16::from(!bit);
        self.left -= 1;
        if self.left == 0 {
            self.renew();
        }
    }

    #[cold]
    fn renew(&mut self) {
        self.total += self.cycle;
        if self.total > 1 << Self::SHARE_BITS {
            self.total = (self.total + 1) >> 1;
            self.zeros = (self.zeros + 1) >> 1;
            self.total += u16::from(self.zeros == self.total);
        }
        self.zero = (u32::from(self.zeros) * ((1 << 31) / u32::from(self.total))) >> (31 - Self::SHARE_BITS);
        self.cycle = (self.cycle * 5 / 4).min(64);
        self.left = self.cycle;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever is counted, every share belongs to exactly the symbol between whose bounds it is, and none is empty.
    fn check<const N: usize, const T: usize>(symbols: usize, next: impl Fn(u32) -> u32) {
        let mut model = Model::<N, T>::new(symbols);
        let mut seed = 1u32;
        for _ in 0..20_000 {
            model.prepare();
            seed = next(seed);
            let share = seed >> 8 & 0x7fff;
            let (symbol, low, high) = model.take(share);
            assert!(symbol < symbols && low <= share && share < high, "{symbol}: {low} {share} {high}");
            assert_eq!(high == u32::from(END), symbol + 1 == symbols);
        }
        assert!(model.bounds[..symbols].windows(2).all(|pair| pair[0] < pair[1]));
        model.reset();
        model.prepare();
        for above in [0x7fff, 0x8000, 0x803f] {
            assert_eq!(model.take(above).0, symbols - 1, "equal shares again");
        }
    }

    #[test]
    fn the_search_finds_the_symbol_of_every_share() {
        let random = |x: u32| x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        check::<19, 32>(2, random);
        check::<19, 32>(16, random);
        check::<67, 128>(33, random);
        check::<67, 128>(64, random);
        check::<259, 256>(32, random);
        check::<259, 256>(256, random);
        check::<1027, 256>(515, random);
        // the first symbol alone, then the last alone: shares as unequal as can be
        check::<259, 256>(256, |_| 0);
        check::<259, 256>(256, |_| u32::MAX);
        check::<19, 32>(6, |_| u32::MAX);
    }

    #[test]
    fn a_bit_model_never_gives_a_bit_all() {
        for bit in [false, true] {
            let mut model = BitModel::new();
            for _ in 0..50_000 {
                model.count(bit);
                assert!((1..1 << BitModel::SHARE_BITS).contains(&model.zero), "{}", model.zero);
            }
        }
    }
}

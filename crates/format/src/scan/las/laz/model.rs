//! Adaptive models: how the interval of the arithmetic coder is shared among symbols, learnt from those before.

/// Shares of the interval are counted in 1/32,768.
pub(super) const SHARE_BITS: u32 = 15;

/// The bound behind the last symbol: above every share.
pub(super) const END: u16 = u16::MAX;

/// A model of at most `N` symbols, as LASzip's: counts of the symbols so far, and bounds that are worked out anew now
/// and then. `T`: entries of the table that shortens the search for a symbol, a power of two; 0 where `N` bounds are
/// compared at once.
///
/// A model that was not used since [`Self::reset`] costs nothing: it is filled when its first symbol is due.
#[derive(Debug, Clone)]
pub(super) struct Model<const N: usize, const T: usize> {
    symbols: u16,
    /// Symbols until new bounds are due.
    left: u16,
    /// Symbols from the last bounds to the next ones.
    cycle: u16,
    /// Sum of the counts when the bounds were worked out; 0 before the first symbol.
    total: u32,
    /// Where the share of each symbol begins, the first at 0; [`END`] from `symbols` on.
    bounds: [u16; N],
    counts: [u16; N],
    /// The symbol in whose share each of `T` equal parts of the interval begins.
    table: [u16; T],
}

/// Models of few symbols.
pub(super) type Tiny = Model<16, 0>;
/// Models of up to 40 symbols.
pub(super) type Small = Model<40, 0>;
/// Models of 64 symbols.
pub(super) type Flags = Model<64, 32>;
/// Models of 128 symbols.
pub(super) type Changes = Model<128, 64>;
/// Models of the values of a byte, or of the upper bits of a number.
pub(super) type Bytes = Model<256, 128>;
/// Models of the multiples of a time step.
pub(super) type Multiples = Model<516, 128>;

impl<const N: usize, const T: usize> Model<N, T> {
    /// Counts are halved when they sum to more.
    const MAX_TOTAL: u32 = 1 << SHARE_BITS;

    /// A model of `symbols` (2 to `N`) symbols.
    pub(super) fn new(symbols: usize) -> Self {
        let symbols = symbols.clamp(2, N) as u16;
        Self { symbols, left: 0, cycle: 0, total: 0, bounds: [END; N], counts: [0; N], table: [0; T] }
    }

    /// Forgets everything.
    pub(super) fn reset(&mut self) {
        (self.left, self.total) = (0, 0);
    }

    /// The symbol whose share holds `share`, and its bounds; the symbol is counted.
    #[inline(always)]
    pub(super) fn take(&mut self, share: u16) -> (usize, u16, u16) {
        let symbol = self.find(share);
        self.counts[symbol] += 1;
        self.left -= 1;
        (symbol, self.bounds[symbol], self.bounds.get(symbol + 1).copied().unwrap_or(END))
    }

    /// To be called before [`Self::take`].
    #[inline(always)]
    pub(super) fn prepare(&mut self) {
        if self.left == 0 {
            self.renew();
        }
    }

    #[inline(always)]
    fn find(&self, share: u16) -> usize {
        if T == 0 {
            // no branch depends on the symbol, which nobody can predict
            let begun: u16 = self.bounds.iter().map(|bound| u16::from(*bound <= share)).sum();
            return (usize::from(begun).wrapping_sub(1)).min(N - 1);
        }
        let part = usize::from(share) >> (SHARE_BITS - T.trailing_zeros());
        let mut symbol = self.table.get(part).map_or(0, |first| usize::from(*first)).min(N - 1);
        while symbol + 1 < N && self.bounds[symbol + 1] <= share {
            symbol += 1;
        }
        symbol
    }

    /// Starts the model, or works out bounds from the counts.
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
        self.left = self.cycle;
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
        let mut before = 0;
        let symbols = usize::from(self.symbols);
        for (bound, count) in self.bounds[..symbols].iter_mut().zip(&self.counts) {
            *bound = ((scale * before) >> (31 - SHARE_BITS)) as u16;
            before += u32::from(*count);
        }
        if T == 0 {
            return;
        }
        let part_bits = SHARE_BITS - T.trailing_zeros();
        let mut filled = 0;
        for (symbol, next) in self.bounds[1..symbols].iter().enumerate() {
            let end = (usize::from(*next) + (1 << part_bits) - 1) >> part_bits;
            if filled < end {
                self.table[filled..end].fill(symbol as u16);
                filled = end;
            }
        }
        self.table[filled..].fill(self.symbols - 1);
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

/// A model for each of up to 256 contexts, made when its context first occurs.
#[derive(Debug, Clone)]
pub(super) struct Family<const N: usize, const T: usize> {
    /// One more than the index in `models`; 0 for a context that did not occur.
    places: [u16; 256],
    models: Vec<Model<N, T>>,
    used: usize,
}

impl<const N: usize, const T: usize> Family<N, T> {
    /// Models of `N` symbols.
    pub(super) fn new() -> Self {
        Self { places: [0; 256], models: Vec::new(), used: 0 }
    }

    /// Forgets everything.
    pub(super) fn reset(&mut self) {
        if self.used > 0 {
            self.places.fill(0);
            self.used = 0;
        }
    }

    #[inline]
    pub(super) fn of(&mut self, context: u8) -> &mut Model<N, T> {
        let context = usize::from(context);
        if self.places[context] == 0 {
            self.add(context);
        }
        &mut self.models[usize::from(self.places[context]) - 1]
    }

    #[cold]
    fn add(&mut self, context: usize) {
        match self.models.get_mut(self.used) {
            Some(model) => model.reset(),
            None => self.models.push(Model::new(N)),
        }
        self.used += 1;
        self.places[context] = self.used as u16;
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
            let share = (seed >> 8) as u16 & 0x7fff;
            let (symbol, low, high) = model.take(share);
            assert!(symbol < symbols && low <= share && share < high, "{symbol}: {low} {share} {high}");
            assert_eq!(high == END, symbol + 1 == symbols);
        }
        assert!(model.bounds[..symbols].windows(2).all(|pair| pair[0] < pair[1]));
        model.reset();
        model.prepare();
        assert_eq!(model.take(0x7fff).0, symbols - 1, "equal shares again");
    }

    #[test]
    fn the_search_finds_the_symbol_of_every_share() {
        let random = |x: u32| x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        check::<16, 0>(2, random);
        check::<16, 0>(16, random);
        check::<40, 0>(33, random);
        check::<64, 32>(64, random);
        check::<256, 128>(32, random);
        check::<256, 128>(256, random);
        check::<516, 128>(515, random);
        // the first symbol alone, then the last alone: shares as unequal as can be
        check::<256, 128>(256, |_| 0);
        check::<256, 128>(256, |_| u32::MAX);
        check::<16, 0>(6, |_| u32::MAX);
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

    #[test]
    fn models_of_a_family_are_separate_and_start_anew() {
        let mut family = Family::<64, 32>::new();
        for context in [7, 200, 7] {
            let model = family.of(context);
            model.prepare();
            model.take(100);
        }
        assert_eq!((family.of(7).total, family.of(200).counts[0], family.used), (64, 2, 2));
        family.reset();
        assert_eq!((family.of(200).total, family.used), (0, 1));
    }
}

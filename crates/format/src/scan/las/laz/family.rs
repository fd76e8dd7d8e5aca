//! Models by context.

use super::model::Model;

/// Families of models of so many symbols as theirs.
pub(super) type TinyFamily = Family<19, 32>;
pub(super) type FlagsFamily = Family<67, 128>;
pub(super) type BytesFamily = Family<259, 256>;

/// A model for each of up to 256 contexts, made when its context first occurs.
#[derive(Debug, Clone)]
pub(super) struct Family<const N: usize, const T: usize> {
    /// One more than the index in `models`; 0 for a context that did not occur.
    places: [u16; 256],
    /// What a model is before its first symbol.
    fresh: Model<N, T>,
    models: Vec<Model<N, T>>,
    used: usize,
}

impl<const N: usize, const T: usize> Family<N, T> {
    /// Models of `symbols` symbols.
    pub(super) fn new(symbols: usize) -> Self {
        Self { places: [0; 256], fresh: Model::new(symbols), models: Vec::new(), used: 0 }
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
            None => self.models.push(self.fresh.clone()),
        }
        self.used += 1;
        self.places[context] = self.used as u16;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_of_a_family_are_separate_and_start_anew() {
        let mut family = FlagsFamily::new(64);
        let take = |family: &mut FlagsFamily, context: u8, symbols: usize| {
            let model = family.of(context);
            let shares = (0..symbols).map(|_| {
                model.prepare();
                let (_, low, high) = model.take(100);
                high - low
            });
            shares.last()
        };
        let fresh = Some((1 << 15) / 64);
        assert_eq!(take(&mut family, 7, 1), fresh);
        assert!(take(&mut family, 7, 40) > fresh, "a symbol that came often has a larger share");
        assert_eq!(take(&mut family, 200, 1), fresh);
        assert_eq!(family.used, 2);
        family.reset();
        assert_eq!((take(&mut family, 7, 1), family.used), (fresh, 1));
    }
}

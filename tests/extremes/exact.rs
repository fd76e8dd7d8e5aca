//! Sums and products of doubles without any rounding, so that errors of an arithmetic are not judged by another that errs.

/// An exact sum of doubles: components whose bits do not overlap, the smallest first (Shewchuk 1997, grow-expansion).
///
/// Exact while no product is below 2^-968 or above 2^1023; the suite's are far from both.
#[derive(Debug, Clone, Default)]
pub(crate) struct Exact(Vec<f64>);

impl Exact {
    pub(crate) fn of(value: f64) -> Self {
        Self(vec![value])
    }

    pub(crate) fn integer(value: i128) -> Self {
        // 43 bits each are exact as doubles, and so are their places
        let parts = [value >> 86, (value >> 43) & ((1 << 43) - 1), value & ((1 << 43) - 1)];
        let powers = [2f64.powi(86), 2f64.powi(43), 1.0];
        parts.into_iter().zip(powers).fold(Self::default(), |sum, (part, power)| sum.plus(part as f64 * power))
    }

    pub(crate) fn plus(mut self, value: f64) -> Self {
        let mut carried = value;
        for component in &mut self.0 {
            let sum = carried + *component;
            let part = sum - carried;
            *component = (carried - (sum - part)) + (*component - part);
            carried = sum;
        }
        self.0.push(carried);
        self
    }

    /// Adds `a · b`.
    pub(crate) fn plus_product(self, a: f64, b: f64) -> Self {
        let product = a * b;
        self.plus(a.mul_add(b, -product)).plus(product)
    }

    pub(crate) fn plus_all(self, other: &Self) -> Self {
        other.0.iter().fold(self, |sum, component| sum.plus(*component))
    }

    pub(crate) fn minus(self, other: &Self) -> Self {
        other.0.iter().fold(self, |sum, component| sum.plus(-component))
    }

    /// This many times as much.
    pub(crate) fn times(&self, factor: f64) -> Self {
        self.0.iter().fold(Self::default(), |sum, component| sum.plus_product(*component, factor))
    }

    /// The nearest double, or its neighbour.
    pub(crate) fn value(&self) -> f64 {
        self.0.iter().sum()
    }
}

#[test]
fn nothing_is_rounded() {
    let tiny = Exact::of(1e9).plus(1e-9).plus(-1e9);
    assert_eq!(tiny.value(), 1e-9);
    // 0.1 · 3 is 0.3000000000000000166, not the double 0.30000000000000004
    let product = Exact::default().plus_product(0.1, 3.0).plus(-0.3);
    assert_eq!(product.value(), 3.0 * (0.1 - 0.09375) - (0.3 - 0.28125), "both sides are exact");
    let huge = (1i128 << 100) + 7;
    assert_eq!(Exact::integer(huge).plus(-2f64.powi(100)).value(), 7.0);
    assert_eq!(Exact::integer(-huge).minus(&Exact::integer(-huge)).value(), 0.0);
    assert_eq!(Exact::of(1e16).plus(1.0).times(3.0).plus(-3e16).value(), 3.0);
}

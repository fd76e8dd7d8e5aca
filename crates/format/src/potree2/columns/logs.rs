//! Logarithms in whole numbers: the same on every machine.

/// Parts that a bit is counted in.
pub(super) const BIT: u64 = 1 << PRECISION;

const PRECISION: u32 = 12;

/// Numbers up to this are looked up.
const TABLE: usize = 1 << 12;

/// log2 of `1..TABLE`, in parts of a bit.
static LOGS: [u16; TABLE] = table();

/// Each bit of the fraction is whether the square of the number, brought into 1..2 before, is 2 or more.
const fn table() -> [u16; TABLE] {
    let mut logs = [0; TABLE];
    let mut n = 1;
    while n < TABLE {
        let whole = n.ilog2();
        let mut x = (n as u64) << (31 - whole); // 1..2 with 31 bits behind the point
        let mut log = whole as u16;
        let mut bit = 0;
        while bit < PRECISION {
            x = (x * x) >> 31;
            let two = x >> 32;
            log = log << 1 | two as u16;
            x >>= two;
            bit += 1;
        }
        logs[n] = log;
        n += 1;
    }
    logs
}

/// log2 of `n` in parts of a bit, rounded down; 0 for 0. Of large numbers the first 12 binary digits count.
#[inline]
pub(super) fn log2(n: u32) -> u64 {
    let shift = (u32::BITS - n.leading_zeros()).saturating_sub(TABLE.ilog2());
    u64::from(LOGS[(n >> shift) as usize]) + BIT * u64::from(shift)
}

/// `n` times its logarithm.
#[inline]
pub(super) fn weighted_log(n: u32) -> u64 {
    u64::from(n) * log2(n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_are_those_of_mathematics() {
        for n in (1..5000).chain([65_535, 65_536, 1_000_003, u32::MAX]) {
            let right = f64::from(n).log2() * BIT as f64;
            let log = log2(n) as f64;
            assert!(log <= right + 1e-6 && log > right - 4.0, "{n}: {log}, not {right}");
        }
        assert_eq!(log2(0), 0);
    }
}

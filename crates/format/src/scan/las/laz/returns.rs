//! Which context the number of a return and the number of returns select.

/// Contexts of the differences of x and y, and of intensity, for formats 0–5: `[number of returns][return]`.
const CONTEXTS_8: [[u8; 8]; 8] = [
    [15, 14, 13, 12, 11, 10, 9, 8],
    [14, 0, 1, 3, 6, 10, 10, 9],
    [13, 1, 2, 4, 7, 11, 11, 10],
    [12, 3, 4, 5, 8, 12, 12, 11],
    [11, 6, 7, 8, 9, 13, 13, 12],
    [10, 10, 11, 12, 13, 14, 14, 13],
    [9, 10, 11, 12, 13, 14, 15, 14],
    [8, 9, 10, 11, 12, 13, 14, 15],
];

/// Contexts of the differences of x and y for formats 6–10: a row for each number of returns, a digit for each return.
const CONTEXTS_16: [&[u8; 16]; 16] = [
    b"0123453445555555",
    b"1013333333333333",
    b"2124444444433333",
    b"3345444444444444",
    b"4344544444444444",
    b"5344454444444444",
    b"3344445444444444",
    b"4344444544444444",
    b"4344444454444444",
    b"5344444445444444",
    b"5344444444544444",
    b"5334444444455444",
    b"5334444444455544",
    b"5334444444445554",
    b"5334444444444555",
    b"5334444444444455",
];

/// 0 to 15, for formats 0–5. Both numbers have three bits.
#[inline(always)]
pub(super) fn context_8(returns: u8, number: u8) -> usize {
    usize::from(CONTEXTS_8[usize::from(returns & 7)][usize::from(number & 7)])
}

/// 0 to 5, for formats 6–10. Both numbers have four bits.
#[inline(always)]
pub(super) fn context_16(returns: u8, number: u8) -> usize {
    usize::from(CONTEXTS_16[usize::from(returns & 15)][usize::from(number & 15)] & 7)
}

/// How deep the pulse has gone, 0 to 7: context of the height.
#[inline(always)]
pub(super) fn level(returns: u8, number: u8) -> usize {
    usize::from(returns.abs_diff(number).min(7))
}

//! Little-endian fields of a byte slice. A field beyond the end reads as zeros; callers check lengths first.

fn field<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes.get(at..).and_then(|b| b.first_chunk::<N>()).copied().unwrap_or([0; N])
}

pub(super) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(field(bytes, at))
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(field(bytes, at))
}

pub(super) fn i32_at(bytes: &[u8], at: usize) -> i32 {
    i32::from_le_bytes(field(bytes, at))
}

pub(super) fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(field(bytes, at))
}

pub(super) fn i64_at(bytes: &[u8], at: usize) -> i64 {
    i64::from_le_bytes(field(bytes, at))
}

pub(super) fn f64_at(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(field(bytes, at))
}

/// Three consecutive doubles.
pub(super) fn f64x3_at(bytes: &[u8], at: usize) -> [f64; 3] {
    std::array::from_fn(|i| f64_at(bytes, at + 8 * i))
}

/// Text of a fixed-size field: up to the first zero byte, UTF-8, else Latin-1 (which old writers used).
pub(super) fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    match std::str::from_utf8(&bytes[..end]) {
        Ok(s) => s.trim().to_owned(),
        Err(_) => bytes[..end].iter().map(|b| char::from(*b)).collect::<String>().trim().to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_ends_at_zero_and_falls_back_to_latin_1() {
        assert_eq!(text(b"abc\0def"), "abc");
        assert_eq!(text("Höhe".as_bytes()), "Höhe");
        assert_eq!(text(b"H\xf6he\0\0"), "Höhe");
        assert_eq!(text(b""), "");
    }

    #[test]
    fn a_field_beyond_the_end_reads_as_zero() {
        assert_eq!(u32_at(&[1, 0, 0], 0), 0);
        assert_eq!(u16_at(&[1, 2, 3], 1), 0x0302);
        assert_eq!(f64_at(&[], usize::MAX), 0.0);
    }
}

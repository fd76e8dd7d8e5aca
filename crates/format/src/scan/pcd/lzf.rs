//! LZF decompression.
//!
//! A control byte below 32 says that one byte more than its value stand as they are. Any other is a copy: its upper
//! three bits are the length less 2 (7: the next byte adds to it), its lower five and the next byte the distance less 1.

/// The most that `compressed` bytes can become: three bytes copy at most 264.
pub(super) fn most(compressed: u64) -> u64 {
    compressed.saturating_mul(88)
}

/// Replaces `out` by the `len` decompressed bytes.
///
/// `Err` says why the block is damaged. `len` is the caller's to bound ([`most`]).
pub(super) fn decompress(compressed: &[u8], len: usize, out: &mut Vec<u8>) -> Result<(), String> {
    out.clear();
    out.reserve(len);
    let mut at = 0;
    let cut = |at: usize| format!("the compressed block ends within a step (byte {at} of it)");
    while let Some(&control) = compressed.get(at) {
        at += 1;
        let control = usize::from(control);
        if control < 32 {
            let literal = compressed.get(at..at + control + 1).ok_or_else(|| cut(at))?;
            out.extend_from_slice(literal);
            at += control + 1;
        } else {
            let mut count = control >> 5;
            if count == 7 {
                count += usize::from(*compressed.get(at).ok_or_else(|| cut(at))?);
                at += 1;
            }
            let low = usize::from(*compressed.get(at).ok_or_else(|| cut(at))?);
            at += 1;
            let distance = ((control & 31) << 8 | low) + 1;
            copy(out, distance, count + 2)
                .ok_or_else(|| format!("the compressed block copies from before its start (byte {at} of it)"))?;
        }
        if out.len() > len {
            return Err(format!("the compressed block becomes more than the {len} bytes that it claims"));
        }
    }
    if out.len() < len {
        return Err(format!("the compressed block becomes {} bytes, not {len}", out.len()));
    }
    Ok(())
}

/// Repeats `count` bytes from `distance` back; they may overlap what is being written.
fn copy(out: &mut Vec<u8>, distance: usize, count: usize) -> Option<()> {
    let start = out.len().checked_sub(distance)?;
    if distance >= count {
        out.extend_from_within(start..start + count);
    } else {
        for i in start..start + count {
            out.push(out[i]);
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(bytes: &[u8], len: usize) -> Result<Vec<u8>, String> {
        let mut out = Vec::new();
        decompress(bytes, len, &mut out).map(|()| out)
    }

    #[test]
    fn literals_near_copies_and_long_copies_are_undone() {
        assert_eq!(run(&[2, b'a', b'b', b'c'], 3).unwrap(), b"abc");
        // one literal, then 3 bytes from 1 back
        assert_eq!(run(&[0, b'a', 0x20, 0], 4).unwrap(), b"aaaa");
        // 7 + 255 + 2 bytes from 2 back
        let long = run(&[1, b'a', b'b', 0xe0, 255, 1], 266).unwrap();
        assert_eq!((long.len(), &long[260..]), (266, b"ababab".as_slice()));
    }

    #[test]
    fn damage_is_told() {
        assert!(run(&[5, b'a'], 6).unwrap_err().contains("ends within"));
        assert!(run(&[0, b'a', 0x20, 9], 4).unwrap_err().contains("before its start"));
        assert!(run(&[2, 1, 2, 3], 2).unwrap_err().contains("more than"));
        assert!(run(&[2, 1, 2, 3], 4).unwrap_err().contains("becomes 3"));
        assert!(run(&[0xe0], 4).is_err() && run(&[0xe0, 1], 4).is_err() && run(&[0x20], 4).is_err());
    }
}

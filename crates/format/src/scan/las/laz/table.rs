//! The entries of a chunk table.

use super::coder::Coder;
use super::integer::Integer;

/// Contexts of the two numbers of an entry.
const POINTS: usize = 0;
const BYTES: usize = 1;

/// The points (0 where `has_points` is not set) and bytes of `count` chunks, each predicted from the chunk before;
/// `None` if the bytes end before, or make no sense.
pub(in super::super) fn decode_entries(coded: &[u8], count: usize, has_points: bool) -> Option<Vec<(u32, u32)>> {
    let mut out = Vec::with_capacity(count);
    if count == 0 {
        return Some(out);
    }
    let mut integers = Integer::new(32, 2);
    let mut coder = Coder::start(coded, 0);
    let (mut points, mut bytes) = (0, 0);
    while out.len() < count && !coder.is_off() {
        if has_points {
            points = integers.next(&mut coder, points, POINTS);
        }
        bytes = integers.next(&mut coder, bytes, BYTES);
        out.push((points.cast_unsigned(), bytes.cast_unsigned()));
    }
    (!coder.is_off()).then_some(out)
}

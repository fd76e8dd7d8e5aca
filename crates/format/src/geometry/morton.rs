//! Morton codes: bit k of x at bit 3k, of y at 3k + 1, of z at 3k + 2.

/// The code of coordinates below 2^21: 63 bits. Higher bits of the coordinates are ignored.
pub const fn morton21(coordinates: [u32; 3]) -> u64 {
    spread21(coordinates[0]) | spread21(coordinates[1]) << 1 | spread21(coordinates[2]) << 2
}

/// The code of any coordinates: 96 bits.
pub const fn morton32(coordinates: [u32; 3]) -> u128 {
    let [x, y, z] = coordinates;
    let high = morton21([x >> 16, y >> 16, z >> 16]);
    let low = morton21([x & 0xffff, y & 0xffff, z & 0xffff]);
    (high as u128) << 48 | low as u128
}

/// The coordinates of a code of 16 bits per axis; bits 48 and up are ignored.
pub(crate) const fn deinterleave16(code: u64) -> [u16; 3] {
    [gather16(code), gather16(code >> 1), gather16(code >> 2)]
}

/// Bit 3k goes to bit k.
const fn gather16(code: u64) -> u16 {
    let mut v = code & 0x2492_4924_9249;
    v = (v | v >> 2) & 0x0c30_c30c_30c3;
    v = (v | v >> 4) & 0x00f0_0f00_f00f;
    v = (v | v >> 8) & 0x0000_ff00_00ff;
    (v | v >> 16) as u16
}

/// Bit k goes to bit 3k.
const fn spread21(v: u32) -> u64 {
    let mut v = v as u64 & 0x1f_ffff;
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bit_by_bit(coordinates: [u32; 3]) -> u128 {
        let bits = (0..32).flat_map(|k| (0..3).map(move |a| (k, a)));
        bits.fold(0, |code, (k, a)| code | u128::from(coordinates[a] >> k & 1) << (3 * k + a))
    }

    #[test]
    fn every_bit_goes_to_its_place() {
        for axis in 0..3 {
            for bit in 0..32 {
                let mut c = [0; 3];
                c[axis] = 1 << bit;
                assert_eq!(morton32(c), bit_by_bit(c));
                assert_eq!(u128::from(morton21(c)), if bit < 21 { bit_by_bit(c) } else { 0 });
                assert_eq!(deinterleave16(morton21(c)), c.map(|v| v as u16));
            }
        }
        let c = [0x89ab_cdef, 0x0123_4567, 0xffff_0f0f];
        assert_eq!(morton32(c), bit_by_bit(c));
    }

    #[test]
    fn the_codes_of_the_worked_example_hold() {
        assert_eq!(morton21([471_859, 104_857, 52_428]), 0x004b_d0bd_0bd0_bd0b);
        assert_eq!(morton21([1_179_648, 131_072, 524_288]), 0x1818_0000_0000_0000);
    }
}

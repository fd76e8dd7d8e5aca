//! Normals in two bytes.

/// The value that a byte stands for: −1 to 1.
fn signed(byte: u8) -> f32 {
    f32::from(byte) / 255.0 * 2.0 - 1.0
}

/// A normal of length 1 of the octahedron that is unfolded into a square.
pub(super) fn from_oct16([u, v]: [u8; 2]) -> [f32; 3] {
    let [u, v] = [u, v].map(signed);
    let z = 1.0 - u.abs() - v.abs();
    let [x, y] = if z >= 0.0 { [u, v] } else { [(1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v)] };
    let length = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|c| c / length)
}

/// A normal of the Lambert azimuthal projection.
pub(super) fn from_spheremap([x, y]: [u8; 2]) -> [f32; 3] {
    let [x, y] = [x, y].map(signed);
    let l = (1.0 - x * x - y * y).max(0.0);
    [2.0 * x * l.sqrt(), 2.0 * y * l.sqrt(), 2.0 * l - 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: [f32; 3], expected: [f32; 3]) {
        // a step of a byte is 1/128
        let off = (0..3).map(|a| (found[a] - expected[a]).abs()).fold(0.0, f32::max);
        assert!(off < 0.02, "{found:?}, not {expected:?}");
    }

    #[test]
    fn bytes_of_known_normals_come_back() {
        for (bytes, normal) in [
            ([128, 128], [0.0, 0.0, 1.0]),
            ([255, 128], [1.0, 0.0, 0.0]),
            ([128, 0], [0.0, -1.0, 0.0]),
            ([0, 0], [0.0, 0.0, -1.0]),
            ([255, 255], [0.0, 0.0, -1.0]),
            ([170, 170], [0.577, 0.577, 0.577]),
            ([212, 212], [0.577, 0.577, -0.577]),
            ([43, 212], [-0.577, 0.577, -0.577]),
        ] {
            near(from_oct16(bytes), normal);
        }
        // e = n_xy / |n_xy| · sqrt((1 − nz) / 2)
        for (bytes, normal) in [
            ([127, 127], [0.0, 0.0, 1.0]),
            ([217, 127], [1.0, 0.0, 0.0]),
            ([127, 37], [0.0, -1.0, 0.0]),
            ([174, 187], [0.588, 0.752, 0.298]),
            ([0, 0], [0.0, 0.0, -1.0]),
        ] {
            near(from_spheremap(bytes), normal);
        }
    }

    #[test]
    fn all_bytes_give_finite_normals() {
        for bytes in (0..=u16::MAX).map(u16::to_le_bytes) {
            let length = |n: [f32; 3]| n.iter().map(|c| c * c).sum::<f32>();
            assert!((length(from_oct16(bytes)) - 1.0).abs() < 1e-5, "{bytes:?}");
            assert!(length(from_spheremap(bytes)) < 1.001, "{bytes:?}");
        }
    }
}

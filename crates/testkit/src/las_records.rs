//! What stands around and behind the fields of points: variable length records and extra bytes, added to a LAS file.

use crate::Random;
use crate::damage::{put, u32_at};

/// A variable length record: user id, record id, data.
pub type Vlr<'a> = (&'a str, u16, Vec<u8>);

/// The LAS file with these records before its points, behind those that it has.
pub fn with_vlrs(las: &[u8], records: &[Vlr<'_>]) -> Vec<u8> {
    let start = u32_at(las, 96) as usize;
    let mut out = las[..start].to_vec();
    for (user_id, record_id, data) in records {
        let mut head = [0; 54];
        put(&mut head, 2, user_id.as_bytes());
        put(&mut head, 18, &record_id.to_le_bytes());
        put(&mut head, 20, &(data.len() as u16).to_le_bytes());
        out.extend(head);
        out.extend(data);
    }
    let new_start = out.len() as u32;
    put(&mut out, 96, &new_start.to_le_bytes());
    let count = u32_at(las, 100) + records.len() as u32;
    put(&mut out, 100, &count.to_le_bytes());
    out.extend(&las[start..]);
    out
}

/// The uncompressed LAS file with `extra(i)` behind the record of point `i`, the same number of bytes for each.
pub fn with_extra(las: &[u8], extra: impl Fn(usize) -> Vec<u8>) -> Vec<u8> {
    let (start, len) = (u32_at(las, 96) as usize, usize::from(u16::from_le_bytes([las[105], las[106]])));
    let mut out = las[..start].to_vec();
    let new_len = (len + extra(0).len()) as u16;
    put(&mut out, 105, &new_len.to_le_bytes());
    for (i, record) in las[start..].chunks_exact(len).enumerate() {
        out.extend(record);
        out.extend(extra(i));
    }
    out
}

/// A descriptor of the Extra Bytes record (LASF_Spec 4); `scale`: where it has one.
pub fn descriptor(data_type: u8, name: &str, scale: Option<f64>) -> Vec<u8> {
    let mut out = vec![0; 192];
    put(&mut out, 2, &[data_type, u8::from(scale.is_some()) << 3]);
    put(&mut out, 4, name.as_bytes());
    put(&mut out, 112, &scale.unwrap_or_default().to_le_bytes());
    out
}

/// 16-bit integers as bytes: a directory of GeoTIFF keys.
pub fn shorts(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Bytes of a record of each point format.
const RECORD_LEN: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// Extra bytes of a point of [`random_las`].
pub const RANDOM_EXTRA: usize = 14;

/// A LAS 1.4 file of points of any format with random values in every field, in extra bytes a triple of floats ("beam") and a
/// scaled number ("Amplitude"); times are finite. Coordinates are 0 to `side` steps.
pub fn random_las(point_format: u8, points: usize, scale: [f64; 3], offset: [f64; 3], side: u64) -> Vec<u8> {
    let mut random = Random::new(u64::from(point_format) + 1);
    let own = RECORD_LEN[usize::from(point_format)];
    let mut out = vec![0; 375];
    put(&mut out, 0, b"LASF");
    put(&mut out, 24, &[1, 4]);
    put(&mut out, 94, &375u16.to_le_bytes());
    put(&mut out, 96, &375u32.to_le_bytes());
    put(&mut out, 104, &[point_format]);
    put(&mut out, 105, &((own + RANDOM_EXTRA) as u16).to_le_bytes());
    for axis in 0..3 {
        put(&mut out, 131 + 8 * axis, &scale[axis].to_le_bytes());
        put(&mut out, 155 + 8 * axis, &offset[axis].to_le_bytes());
        put(&mut out, 179 + 16 * axis, &(offset[axis] + side as f64 * scale[axis]).to_le_bytes());
        put(&mut out, 187 + 16 * axis, &offset[axis].to_le_bytes());
    }
    put(&mut out, 247, &(points as u64).to_le_bytes());
    for i in 0..points {
        let start = out.len();
        out.extend((0..own + RANDOM_EXTRA).map(|_| random.index(256) as u8));
        if !matches!(point_format, 0 | 2) {
            let time_at = if point_format >= 6 { 22 } else { 20 };
            put(&mut out, start + time_at, &(i as f64 * 0.37 - 50.0).to_le_bytes());
        }
        (0..3).for_each(|axis| put(&mut out, start + 4 * axis, &(random.below(side) as i32).to_le_bytes()));
        (0..3).for_each(|e| put(&mut out, start + own + 4 * e, &(random.unit() as f32).to_le_bytes()));
    }
    let mut scaled = descriptor(3, "Amplitude", Some(0.01));
    scaled[160..164].copy_from_slice(b"echo");
    with_vlrs(&out, &[("LASF_Spec", 4, [descriptor(29, "beam", None), scaled].concat())])
}

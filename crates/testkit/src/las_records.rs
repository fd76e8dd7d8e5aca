//! What stands around and behind the fields of points: variable length records and extra bytes, added to a LAS file.

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

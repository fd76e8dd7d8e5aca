//! LAZ chunks: the input is a point format, sizes and compressed bytes, which become a file whose head is sound, so that
//! all of the input reaches the decoder.

#![no_main]

use pointmill_format::scan::las;

/// Bytes of a record, without extra bytes.
const RECORD_LEN: [u16; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let [format, extra, version, points_low, points_high, rest @ ..] = bytes else { return };
    let (format, extra) = (format % 11, extra % 9);
    let points = u32::from(u16::from_le_bytes([*points_low, *points_high])).max(1);
    let layered = format >= 6;
    let version = u16::from(version % 2) + if layered { 3 } else { 1 };
    let record_len = RECORD_LEN[usize::from(format)] + u16::from(extra);
    let items = items(format, extra, version);

    let mut file = vec![0; 375];
    file[..4].copy_from_slice(b"LASF");
    file[24..26].copy_from_slice(&[1, 4]);
    file[94..96].copy_from_slice(&375u16.to_le_bytes());
    file[100..104].copy_from_slice(&1u32.to_le_bytes());
    file[104] = format | 0x80;
    file[105..107].copy_from_slice(&record_len.to_le_bytes());
    for axis in 0..3 {
        file[131 + 8 * axis..139 + 8 * axis].copy_from_slice(&0.01f64.to_le_bytes());
    }
    file[247..255].copy_from_slice(&u64::from(points).to_le_bytes());

    let mut record = vec![0; 34];
    record[0] = if layered { 3 } else { 1 };
    record[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    record[32] = items.len() as u8;
    items.iter().for_each(|item| record.extend(item.map(u16::to_le_bytes).as_flattened()));
    file.extend([0, 0]);
    file.extend(b"laszip encoded\0\0");
    file.extend([22204, record.len() as u16].map(u16::to_le_bytes).as_flattened());
    file.extend([0; 32]);
    file.extend(record);
    let start = file.len() as u32;
    file[96..100].copy_from_slice(&start.to_le_bytes());
    match layered {
        false => file.extend(rest),
        true => layered_chunk(&mut file, rest, points, record_len, &items),
    }
    pointmill_fuzz::read(&file, |path| las::open(path));
});

/// Items of a record as the LASzip record has them: type, bytes, version.
fn items(format: u8, extra: u8, version: u16) -> Vec<[u16; 3]> {
    let kinds: &[[u16; 2]] = match format {
        0 => &[[6, 20]],
        1 => &[[6, 20], [7, 8]],
        2 => &[[6, 20], [8, 6]],
        3 => &[[6, 20], [7, 8], [8, 6]],
        4 => &[[6, 20], [7, 8], [9, 29]],
        5 => &[[6, 20], [7, 8], [8, 6], [9, 29]],
        6 => &[[10, 30]],
        7 => &[[10, 30], [11, 6]],
        8 => &[[10, 30], [12, 8]],
        9 => &[[10, 30], [13, 29]],
        _ => &[[10, 30], [12, 8], [13, 29]],
    };
    let extra_bytes = [if format < 6 { 0 } else { 14 }, u16::from(extra)];
    let kinds = kinds.iter().copied().chain((extra > 0).then_some(extra_bytes));
    kinds.map(|[kind, bytes]| [kind, bytes, version]).collect()
}

/// A chunk without a table: the first record, then a byte for the size of each layer, then the layers.
fn layered_chunk(file: &mut Vec<u8>, input: &[u8], points: u32, record_len: u16, items: &[[u16; 3]]) {
    let layers: u16 = items
        .iter()
        .map(|[kind, bytes, _]| match kind {
            10 => 9,
            12 => 2,
            14 => *bytes,
            _ => 1,
        })
        .sum();
    let (first, input) = input.split_at(input.len().min(usize::from(record_len)));
    let (sizes, mut data) = input.split_at(input.len().min(usize::from(layers)));
    file.extend((-1i64).to_le_bytes());
    file.extend(first);
    file.extend(vec![0; usize::from(record_len) - first.len()]);
    file.extend(points.to_le_bytes());
    let mut layers_data: Vec<u8> = Vec::new();
    for layer in 0..usize::from(layers) {
        let size = sizes.get(layer).map_or(0, |size| usize::from(*size)).min(data.len());
        let (this, behind) = data.split_at(size);
        file.extend((size as u32).to_le_bytes());
        layers_data.extend(this);
        data = behind;
    }
    file.extend(layers_data);
}

//! Honest damage: cut files, wrong counts, lost chunk tables. What is there is read, what is missing is reported.

use laz::LazVlrBuilder;
use pointmill_testkit::damage::{put, u32_at};

use crate::common::{LAS, fixture, laz_file, points_start, read_bytes};

const LEGACY_COUNT: usize = 107;
const COUNT: usize = 247;

#[test]
fn a_cut_las_file_gives_its_whole_records() {
    let whole = fixture("format3.las");
    let start = points_start(&whole);
    for (bytes, points) in [(start, 0), (start + 33, 0), (start + 34, 1), (start + 34 * 100 + 5, 100)] {
        let cloud = read_bytes(&whole[..bytes]).unwrap();
        assert_eq!((cloud.len(), cloud.promised), (points, points as u64));
        assert_eq!(cloud.info.points_declared, 150);
        assert!(cloud.warned(&format!("{} are missing", 150 - points)), "{:?}", cloud.info.warnings);
    }
}

#[test]
fn a_header_count_too_high_gives_the_points_that_are_there() {
    for count in [160, u32::MAX] {
        let mut bytes = fixture("format3.las");
        put(&mut bytes, LEGACY_COUNT, &count.to_le_bytes());
        let cloud = read_bytes(&bytes).unwrap();
        assert_eq!(cloud.len(), 150);
        assert!(cloud.warned("are missing"));
    }
    for file in ["format6.las", "format6.laz", "evlrs.las", "chunks_fixed_format7.laz", "chunks_variable_format7.laz"] {
        let right = read_bytes(&fixture(file)).unwrap();
        for count in [right.len() as u64 + 10, 1 << 63, u64::MAX] {
            let mut bytes = fixture(file);
            put(&mut bytes, COUNT, &count.to_le_bytes());
            let cloud = read_bytes(&bytes).unwrap();
            assert_eq!(cloud.xyz, right.xyz, "{file}");
            assert!(cloud.warned("are missing"), "{file}");
            assert!(cloud.errors.is_empty(), "{file}: {:?}", cloud.errors);
        }
    }
}

#[test]
fn the_last_chunk_of_records_is_counted_when_the_header_cannot_be_right() {
    let right = read_bytes(&fixture("chunks_fixed_format3.laz")).unwrap();
    let mut bytes = fixture("chunks_fixed_format3.laz");
    put(&mut bytes, LEGACY_COUNT, &481u32.to_le_bytes()); // four chunks of 120 hold 480
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!(cloud.xyz, right.xyz);
    assert!(cloud.warned("the chunks hold 400: 81 are missing"), "{:?}", cloud.info.warnings);
    // 410 could be: it shows only when the last chunk is decoded
    put(&mut bytes, LEGACY_COUNT, &410u32.to_le_bytes());
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!(cloud.xyz, right.xyz);
    assert!(cloud.errors[0].what().contains("gives 40 of its 50 points"), "{}", cloud.errors[0]);
}

#[test]
fn a_header_count_too_low_is_obeyed_and_told() {
    for (file, at) in
        [("format3.las", LEGACY_COUNT), ("chunks_fixed_format3.laz", LEGACY_COUNT), ("format6.laz", COUNT)]
    {
        let right = read_bytes(&fixture(file)).unwrap();
        for count in [0u32, 7, 125] {
            let mut bytes = fixture(file);
            put(&mut bytes, LEGACY_COUNT, &count.to_le_bytes());
            put(&mut bytes, at, &count.to_le_bytes());
            let cloud = read_bytes(&bytes).unwrap();
            assert_eq!(cloud.xyz[0], right.xyz[0][..count as usize], "{file}");
            assert_eq!(cloud.info.warnings.len(), 1, "{file}: {:?}", cloud.info.warnings);
        }
    }
}

#[test]
fn the_64_bit_count_wins_unless_it_is_zero() {
    let mut bytes = fixture("format6.las");
    put(&mut bytes, LEGACY_COUNT, &5u32.to_le_bytes());
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!((cloud.len(), cloud.warned("legacy")), (150, true));
    put(&mut bytes, COUNT, &0u64.to_le_bytes());
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!((cloud.len(), cloud.warned("legacy")), (5, true));
}

/// Files without a usable chunk table: chunks of records, then layered ones.
#[test]
fn all_points_are_read_without_a_chunk_table() {
    for file in ["chunks_fixed_format3.laz", "chunks_fixed_format7.laz", "chunks_variable_format7.laz", "format10.laz"]
    {
        let whole = fixture(file);
        let right = read_bytes(&whole).unwrap();
        let start = points_start(&whole);
        let table = u32_at(&whole, start) as usize;
        let mut broken = Vec::new();
        for offset in [-1i64, 0, 7, i64::MAX, i64::MIN, start as i64 + 100] {
            let mut bytes = whole.clone();
            put(&mut bytes, start, &offset.to_le_bytes());
            broken.push(bytes);
        }
        for count in [0u32, 1, 3, 5, u32::MAX] {
            let mut bytes = whole.clone();
            put(&mut bytes, table + 4, &count.to_le_bytes());
            broken.push(bytes);
        }
        let mut flipped = whole.clone();
        flipped[table + 9] ^= 0x55;
        broken.push(flipped);
        broken.push(whole[..table].to_vec());
        for (i, bytes) in broken.iter().enumerate().filter(|(_, bytes)| **bytes != whole) {
            let cloud = read_bytes(bytes).unwrap();
            assert_eq!(cloud.xyz, right.xyz, "{file}, variant {i}: {:?} {:?}", cloud.info.warnings, cloud.errors);
            assert_eq!(cloud.columns.len(), right.columns.len());
            let told =
                ["the chunk table is unusable", "the chunk table is wrong"].iter().any(|words| cloud.warned(words));
            assert!(told, "{file}, variant {i}");
            assert!(cloud.errors.is_empty());
        }
    }
}

#[test]
fn a_chunk_table_may_be_announced_at_the_end_of_the_file() {
    for file in ["chunks_fixed_format3.laz", "chunks_variable_format7.laz"] {
        let mut bytes = fixture(file);
        let start = points_start(&bytes);
        let offset = bytes[start..start + 8].to_vec();
        put(&mut bytes, start, &(-1i64).to_le_bytes());
        bytes.extend(offset);
        let cloud = read_bytes(&bytes).unwrap();
        assert_eq!((cloud.len(), cloud.info.warnings.len()), (400, 0), "{:?}", cloud.info.warnings);
    }
}

#[test]
fn a_cut_laz_file_gives_what_is_before_the_cut() {
    let whole = fixture("chunks_fixed_format7.laz");
    let right = read_bytes(&whole).unwrap();
    let cloud = read_bytes(&whole[..whole.len() / 2]).unwrap();
    assert!(cloud.len() >= 120 && cloud.len().is_multiple_of(120), "whole chunks");
    assert_eq!(cloud.xyz[0], right.xyz[0][..cloud.len()]);
    assert!(cloud.warned("are missing"));

    let whole = fixture("chunks_fixed_format3.laz");
    let right = read_bytes(&whole).unwrap();
    let cloud = read_bytes(&whole[..whole.len() / 2]).unwrap();
    assert!((150..250).contains(&cloud.len()), "points, not only chunks: {}", cloud.len());
    assert_eq!(cloud.xyz[0], right.xyz[0][..cloud.len()]);
    assert!(cloud.errors[0].to_string().contains("cut short"), "{}", cloud.errors[0]);
}

#[test]
fn records_around_the_points_may_be_lost_without_losing_points() {
    let mut bytes = fixture("evlrs.las");
    let evlr_start = u32_at(&bytes, 235) as usize;
    let cloud = read_bytes(&bytes[..evlr_start + 70]).unwrap();
    assert_eq!((cloud.len(), cloud.info.crs.wkt.is_none(), cloud.warned("EVLR 0 of 3")), (20, true, true));
    put(&mut bytes, evlr_start + 20, &(1u64 << 40).to_le_bytes());
    assert_eq!(read_bytes(&bytes).unwrap().len(), 20);
    put(&mut bytes, 235, &u64::MAX.to_le_bytes());
    assert_eq!(read_bytes(&bytes).unwrap().len(), 20);
    put(&mut bytes, 243, &u32::MAX.to_le_bytes());
    assert_eq!(read_bytes(&bytes).unwrap().len(), 20);

    let mut bytes = fixture("geotiff.las");
    put(&mut bytes, 100, &u32::MAX.to_le_bytes());
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!((cloud.len(), cloud.info.crs.epsg, cloud.info.warnings.len()), (20, Some(32633), 1));
}

#[test]
fn bounds_that_are_nonsense_are_none() {
    let mut bytes = fixture("format0.las");
    put(&mut bytes, 179, &f64::NAN.to_le_bytes());
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!((cloud.info.bounds_declared, cloud.len()), (None, 150));
}

#[test]
fn extra_bytes_that_do_not_fit_or_are_not_documented_are_told() {
    let mut bytes = fixture("extra_bytes_format3.las");
    let at = bytes.windows(9).position(|w| w == b"extra u1\0").unwrap() - 4;
    bytes[at + 2 + 192 * 2] = 99; // the third descriptor: a type that does not exist
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!((cloud.len(), cloud.info.attributes.len()), (100, 12 + 2));
    assert!(cloud.warned("extra u2") && cloud.warned("not documented"), "{:?}", cloud.info.warnings);
    put(&mut bytes, at - 54 + 18, &5u16.to_le_bytes()); // no longer an Extra Bytes record
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!((cloud.info.attributes.len(), cloud.warned("the last 42 bytes")), (12, true), "{:?}", cloud.info);
}

#[test]
fn a_path_may_have_any_letters_and_folders_and_empty_files_are_errors() {
    let folder = tempfile::Builder::new().prefix("Höhe 点云 ").tempdir().unwrap();
    let path = folder.path().join("прогулка ☃.laz");
    std::fs::write(&path, fixture("format7.laz")).unwrap();
    assert_eq!(LAS.read(&path).unwrap().len(), 150);
    assert!(LAS.read(folder.path()).is_err());
    assert!(LAS.read(&folder.path().join("none.las")).unwrap_err().to_string().contains("opening"));
    assert!(read_bytes(b"").unwrap_err().to_string().contains("the file is empty"));
    assert!(read_bytes(b"ply\n").unwrap_err().to_string().contains("not a LAS"));
}

/// 150,000 points in one chunk: three batches of the same decoder.
#[test]
fn a_chunk_larger_than_a_batch_comes_in_several() {
    for (point_format, len) in [(0u8, 20usize), (6, 30)] {
        let n = 150_000usize;
        let points: Vec<u8> = (0..n)
            .flat_map(|i| {
                let mut record = vec![0; len];
                put(&mut record, 0, &(i as i32).to_le_bytes());
                record
            })
            .collect();
        let vlr = LazVlrBuilder::default().with_point_format(point_format, 0).unwrap();
        let vlr = vlr.with_fixed_chunk_size(n as u32).build();
        let bytes = laz_file(point_format, vlr, n, |compressor| compressor.compress_many(&points).unwrap());
        let cloud = read_bytes(&bytes).unwrap();
        assert!(
            cloud.errors.is_empty() && cloud.info.warnings.is_empty(),
            "{:?} {:?}",
            cloud.errors,
            cloud.info.warnings
        );
        assert!(cloud.xyz[0].iter().copied().eq((0..n).map(|i| i as f64)));
    }
}

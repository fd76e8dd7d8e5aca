//! What records say about the points: several of extra bytes, and LASzip's compatibility mode.

use laz::{LasZipCompressor, LazItemRecordBuilder, LazVlr};
use pointmill_format::Column;
use pointmill_testkit::damage::{put, u32_at};
use pointmill_testkit::las::Las;
use pointmill_testkit::las_records::{Vlr, descriptor, with_extra, with_vlrs};
use pointmill_testkit::reader::Cloud;

use crate::common::read_bytes;

const EXTRA_BYTES: u16 = 4;

fn record(descriptors: &[Vec<u8>]) -> Vlr<'static> {
    ("LASF_Spec", EXTRA_BYTES, descriptors.concat())
}

fn points(n: i32) -> Vec<u8> {
    let mut las = Las::numbered((0..n).map(|i| [i, i, i]));
    las.point_format = 6;
    las.bytes()
}

/// The attributes behind the standard ones of format 6.
fn extra_names(cloud: &Cloud) -> Vec<&str> {
    cloud.info.attributes.iter().skip(12).map(|a| a.name.as_str()).collect()
}

/// As four programs in a row leave a file: each adds its own record.
#[test]
fn extra_bytes_records_are_joined_where_their_widths_add_up() {
    let extra = |i: usize| {
        let mut out = (1000 + i as u16).to_le_bytes().to_vec();
        out.extend((-500 - i as i16).to_le_bytes());
        out.push(i as u8);
        out.extend((i as f32 / 4.0).to_le_bytes());
        out.extend((70_000 + i as u32).to_le_bytes());
        out
    };
    let first = record(&[descriptor(3, "Amplitude", Some(0.01)), descriptor(4, "Reflectance", Some(0.01))]);
    let second = record(&[descriptor(1, "confidence", None)]);
    let third = record(&[descriptor(9, "Distance", None), descriptor(5, "Group", None)]);
    let las = with_vlrs(&with_extra(&points(8), extra), &[first.clone(), second, first, third]);
    let cloud = read_bytes(&las).unwrap();
    assert_eq!(extra_names(&cloud), ["Amplitude", "Reflectance", "confidence", "Distance", "Group"]);
    assert_eq!(cloud.column("Amplitude"), &Column::UInt16((1000..1008).collect()));
    assert_eq!(cloud.column("Reflectance"), &Column::Int16((0..8).map(|i| -500 - i).collect()));
    assert_eq!(cloud.column("confidence"), &Column::UInt8((0..8).collect()));
    assert_eq!(cloud.column("Distance"), &Column::Float32((0..8).map(|i| i as f32 / 4.0).collect()));
    assert_eq!(cloud.column("Group"), &Column::UInt32((70_000..70_008).collect()));
    assert_eq!(cloud.info.attributes[12].scale, [0.01]);
    assert!(cloud.warned("4 Extra Bytes records; joined in order, numbers 1, 2, 4 describe all 13 extra bytes"));
}

#[test]
fn a_new_record_for_all_attributes_replaces_the_old_one() {
    let las = with_extra(&points(3), |i| vec![i as u8, 10 + i as u8]);
    let old = record(&[descriptor(1, "a", None)]);
    let new = record(&[descriptor(1, "a", None), descriptor(1, "b", None)]);
    let cloud = read_bytes(&with_vlrs(&las, &[old.clone(), new])).unwrap();
    assert_eq!(extra_names(&cloud), ["a", "b"]);
    assert_eq!(cloud.column("b"), &Column::UInt8(vec![10, 11, 12]));
    assert!(cloud.warned("number 2 describes all 2 extra bytes"), "{:?}", cloud.info.warnings);
    let cloud = read_bytes(&with_vlrs(&las, &[old, record(&[descriptor(5, "c", None)])])).unwrap();
    assert_eq!(extra_names(&cloud), ["a"]);
    assert!(cloud.warned("of 1, 4 bytes per point, which do not add up to its 2 extra bytes; number 1 is taken"));
}

#[test]
fn a_record_that_is_also_among_the_extended_ones_counts_once() {
    let (_, _, data) = record(&[descriptor(1, "a", None)]);
    let las = with_extra(&points(3), |i| vec![i as u8]);
    let mut las = with_vlrs(&las, &[("LASF_Spec", EXTRA_BYTES, data.clone())]);
    let start = las.len() as u64;
    put(&mut las, 235, &start.to_le_bytes());
    put(&mut las, 243, &1u32.to_le_bytes());
    let mut head = [0; 60];
    put(&mut head, 2, b"LASF_Spec");
    put(&mut head, 18, &EXTRA_BYTES.to_le_bytes());
    put(&mut head, 20, &(data.len() as u64).to_le_bytes());
    las.extend(head);
    las.extend(data);
    let cloud = read_bytes(&las).unwrap();
    assert_eq!((cloud.len(), extra_names(&cloud)), (3, vec!["a"]));
}

/// A point as LAS 1.4 has it: return, number of returns, class, flags, channel, scan angle.
type Extended = (u8, u8, u8, u8, u8, i16);

const EXTENDED: [Extended; 6] = [
    (1, 1, 2, 0, 0, 0),
    (9, 12, 64, 8, 3, 30_000),
    (12, 12, 200, 4, 1, -30_000),
    (3, 9, 31, 1, 2, 2501),
    (7, 7, 41, 2, 0, -1),
    (15, 15, 255, 15, 3, -15_003),
];

/// A LAS 1.2 file of format 1 or 3 (with near infrared) as LASzip writes [`EXTENDED`] in compatibility mode, between two
/// attributes of its own.
fn compatible(point_format: u8) -> Vec<u8> {
    let mut las = Las::numbered((0..EXTENDED.len() as i32).map(|i| [i, 2 * i, 3 * i]));
    let format_len = if point_format == 1 { 28 } else { 34 };
    let mut out = las.bytes();
    let start = u32_at(&out, 96) as usize;
    let records = out.split_off(start);
    put(&mut out, 104, &[point_format]);
    put(&mut out, 105, &(format_len as u16).to_le_bytes());
    for (record, (number, of, class, flags, _, angle)) in records.chunks_exact(34).zip(EXTENDED) {
        let mut record = record[..format_len].to_vec();
        record[14] = old_return(number, of) | of.min(7) << 3;
        record[15] = if class > 31 { 0 } else { class } | (flags & 7) << 5;
        record[16] = rank(angle).cast_unsigned();
        out.extend(record);
    }
    let extra = |i: usize| {
        let (number, of, class, flags, channel, angle) = EXTENDED[i];
        let mut out = vec![100 + i as u8];
        out.extend((angle - (f32::from(rank(angle)) / 0.006).round() as i16).to_le_bytes());
        out.push((number - old_return(number, of)) << 4 | (of - of.min(7)));
        out.push(if class > 31 { class } else { 0 });
        out.push(channel << 1 | flags >> 3);
        if point_format == 3 {
            out.extend((40_000 + i as u16).to_le_bytes());
        }
        out.push(200 + i as u8);
        out
    };
    las.points.clear();
    let mut names = vec![
        descriptor(1, "mine", None),
        descriptor(4, "LAS 1.4 scan angle", Some(0.006)),
        descriptor(1, "LAS 1.4 extended returns", None),
        descriptor(1, "LAS 1.4 classification", None),
        descriptor(1, "LAS 1.4 flags and channel", None),
    ];
    if point_format == 3 {
        names.push(descriptor(3, "LAS 1.4 NIR band", None));
    }
    names.push(descriptor(1, "yours", None));
    let mut header = vec![0; 156];
    put(&mut header, 2, &[3]);
    put(&mut header, 28, &(EXTENDED.len() as u64).to_le_bytes());
    with_vlrs(&with_extra(&out, extra), &[("lascompatible", 22204, header), record(&names)])
}

/// The return number that fits three bits, counted from the end where it is near the end.
fn old_return(number: u8, of: u8) -> u8 {
    match of.saturating_sub(number) {
        _ if of <= 7 || number <= 4 => number,
        from_the_end @ 0..3 => 7 - from_the_end,
        _ => 4,
    }
}

/// Whole degrees.
fn rank(angle: i16) -> i8 {
    (f32::from(angle) * 0.006).round() as i8
}

fn check(cloud: &Cloud) {
    let columns = ["return number", "number of returns", "classification", "classification flags", "scanner channel"]
        .map(|name| cloud.column(name));
    for (i, (number, of, class, flags, channel, _)) in EXTENDED.into_iter().enumerate() {
        let found = columns.map(|column| match column {
            Column::UInt8(values) => values[i],
            other => panic!("{other:?}"),
        });
        assert_eq!(found, [number, of, class, flags, channel], "point {i}");
    }
    assert_eq!(cloud.column("scan angle"), &Column::Int16(EXTENDED.map(|p| p.5).to_vec()));
    assert_eq!(cloud.column("mine"), &Column::UInt8((100..106).collect()));
    assert_eq!(cloud.column("yours"), &Column::UInt8((200..206).collect()));
    assert_eq!(cloud.info.warnings, []);
    assert!(!cloud.info.attributes.iter().any(|a| a.name.starts_with("LAS 1.4") || a.name == "scan angle rank"));
}

#[test]
fn compatibility_mode_gives_the_fields_of_the_newer_formats() {
    let cloud = read_bytes(&compatible(1)).unwrap();
    check(&cloud);
    assert_eq!(cloud.info.format, "LAS 1.2, point format 6, stored as 1 in LASzip's compatibility mode");
    let cloud = read_bytes(&compatible(3)).unwrap();
    check(&cloud);
    assert_eq!(cloud.info.format, "LAS 1.2, point format 8, stored as 3 in LASzip's compatibility mode");
    assert_eq!(cloud.column("nir"), &Column::UInt16((40_000..40_006).collect()));
    assert_eq!(cloud.column("gps-time"), &Column::Float64((0..6).map(|i| i as f64 * 0.001).collect()));
}

#[test]
fn compatibility_mode_is_read_compressed_too() {
    for (point_format, extra) in [(1, 7), (3, 9)] {
        let las = compatible(point_format);
        let items = match point_format {
            1 => LazItemRecordBuilder::default_version_of::<laz::las::Point1>(extra),
            _ => LazItemRecordBuilder::default_version_of::<laz::las::Point3>(extra),
        };
        let start = u32_at(&las, 96) as usize;
        let mut compressor =
            LasZipCompressor::new(std::io::Cursor::new(Vec::new()), LazVlr::from_laz_items(items)).unwrap();
        compressor.compress_many(&las[start..]).unwrap();
        compressor.done().unwrap();
        let mut data = Vec::new();
        compressor.vlr().write_to(&mut data).unwrap();
        let laz = with_vlrs(&las[..start], &[("laszip encoded", 22204, data)]);
        let (start, mut laz) = (laz.len() as i64, laz);
        laz[104] |= 0x80;
        let mut points = compressor.into_inner().into_inner();
        // the place of the chunk table counts from the start of the file
        let table = i64::from_le_bytes(points[..8].try_into().unwrap()) + start;
        points[..8].copy_from_slice(&table.to_le_bytes());
        laz.extend(points);
        let cloud = read_bytes(&laz).unwrap();
        check(&cloud);
        assert!(cloud.info.format.starts_with("LAZ 1.2, point format "), "{}", cloud.info.format);
    }
}

#[test]
fn compatibility_mode_counts_and_what_is_not_it() {
    let mut las = compatible(1);
    put(&mut las, 107, &0u32.to_le_bytes());
    let cloud = read_bytes(&las).unwrap();
    assert_eq!(cloud.len(), 6);
    assert!(cloud.warned("the record of LASzip's compatibility mode 6"));
    // a version of later days, a reserved name that is missing: the points are read as they are stored
    let version = find(&compatible(1), b"lascompatible") + 52 + 2;
    let name = find(&compatible(1), b"LAS 1.4 classification");
    for (at, byte) in [(version, 9), (name, b'l')] {
        let mut las = compatible(1);
        las[at] = byte;
        let cloud = read_bytes(&las).unwrap();
        assert!(cloud.warned("does not fit the points"), "{:?}", cloud.info.warnings);
        assert_eq!((cloud.len(), cloud.info.format.as_str()), (6, "LAS 1.2, point format 1"));
        assert!(cloud.info.attribute("LAS 1.4 scan angle").is_some());
    }
}

fn find(bytes: &[u8], what: &[u8]) -> usize {
    bytes.windows(what.len()).position(|w| w == what).unwrap()
}

//! What is written is read: by our reader, and by the crate `las`, from records of every point format.

use las::Point;
use pointmill_format::scan::las::write::{
    ChunkEncoder, CrsKind, CrsRecords, FieldPlace, Heading, RecordLayout, StridedColumn, Tally,
};
use pointmill_format::{Attribute, AttributeType, Changes, Column, Crs, Lattice};
use pointmill_testkit::damage::put;
use pointmill_testkit::files::temporary;
use pointmill_testkit::las_records::random_las;
use pointmill_testkit::reader::Cloud;

use crate::common::read_bytes;

const LATTICE: Lattice = Lattice { scale: [0.001, 0.002, 0.01], offset: [500_000.0, -4_000_000.0, 0.5] };

/// All that this writer knows.
pub(crate) const WRITTEN: [u8; 7] = [0, 1, 2, 3, 6, 7, 8];

/// Random records of that format, some of them at the ends of what integers hold.
fn random_file(point_format: u8, points: usize) -> Vec<u8> {
    let mut out = random_las(point_format, points, LATTICE.scale, LATTICE.offset, 1 << 20);
    let (start, len) = (records_start(&out), usize::from(u16::from_le_bytes([out[105], out[106]])));
    for (i, xyz) in [[i32::MIN; 3], [i32::MAX, i32::MIN, 0], [i32::MAX; 3]].into_iter().enumerate() {
        xyz.iter().enumerate().for_each(|(a, v)| put(&mut out, start + 7 * i * len + 4 * a, &v.to_le_bytes()));
    }
    out
}

/// The file of the points of `cloud`, whatever format is chosen for them.
pub(crate) fn written(cloud: &Cloud, allowed: &[u8], is_compressed: bool) -> (RecordLayout, Vec<u8>, Vec<Changes>) {
    let layout = RecordLayout::choose(&cloud.info.attributes, allowed).unwrap();
    let axes = cloud.xyz.each_ref().map(|axis| axis.iter().map(|v| *v as i32).collect::<Vec<_>>());
    let positions = axes.each_ref().map(|axis| StridedColumn::of_axis(axis));
    let columns = cloud.columns.iter().zip(cloud.info.attributes.iter());
    let columns: Vec<_> = columns.map(|(column, a)| Some(StridedColumn::of(column, a.elements))).collect();
    let mut records = vec![0xAA; cloud.len() * layout.record_len()];
    let mut changes = vec![Changes::default(); columns.len()];
    layout.put(&positions, &columns, &mut records, &mut changes);
    let mut heading = Heading::new(layout.clone(), cloud.info.lattice.unwrap(), cloud.len() as u64);
    heading.is_compressed = is_compressed;
    (layout, file(&heading, &records, 700), changes)
}

/// The file of these records; `chunk`: points of a chunk.
pub(crate) fn file(heading: &Heading, records: &[u8], chunk: usize) -> Vec<u8> {
    let (len, mut tally) = (heading.layout.record_len(), Tally::default());
    // in parts, as threads count them
    for part in records.chunks(13 * len) {
        let mut own = Tally::default();
        own.add(&heading.layout, part);
        tally.merge(&own);
    }
    let start = heading.points_start().unwrap();
    let (mut points, mut table) = (records.to_vec(), Vec::new());
    if heading.is_compressed {
        let encoder = ChunkEncoder::new(&heading.layout).unwrap();
        let chunks: Vec<(usize, Vec<u8>)> =
            records.chunks(chunk * len).map(|part| (part.len() / len, encoder.encode(part).unwrap())).collect();
        let entries: Vec<_> = chunks.iter().map(|(points, bytes)| (*points as u32, bytes.len() as u32)).collect();
        table = encoder.table(&entries).unwrap();
        points = chunks.into_iter().flat_map(|(_, bytes)| bytes).collect();
    }
    let summary = tally.summary(&heading.lattice);
    let ending = heading.finish(&summary, start + points.len() as u64, &table).unwrap();
    assert_eq!((ending.head.len() as u64, ending.tail_start), (start, start + points.len() as u64));
    [ending.head, points, ending.tail].concat()
}

/// Attributes, positions and columns are the same.
#[track_caller]
pub(crate) fn assert_same(a: &Cloud, b: &Cloud) {
    assert_eq!(a.info.attributes, b.info.attributes);
    assert_eq!((&a.info.lattice, &a.info.crs), (&b.info.lattice, &b.info.crs));
    assert_eq!(a.xyz, b.xyz);
    for (attribute, (a, b)) in a.info.attributes.iter().zip(a.columns.iter().zip(&b.columns)) {
        // not a number, too
        assert_eq!(bits(a), bits(b), "{}", attribute.name);
    }
}

fn bits(column: &Column) -> Vec<i128> {
    pointmill_testkit::reader::integers(column)
}

#[test]
fn records_of_every_point_format_come_back_as_they_were() {
    for point_format in 0..=10 {
        let original = random_file(point_format, 2000);
        let cloud = read_bytes(&original).unwrap();
        for is_compressed in [false, true] {
            let (layout, bytes, changes) = written(&cloud, &WRITTEN, is_compressed);
            // without the wave packets
            let expected = [0, 1, 2, 3, 1, 3, 6, 7, 8, 6, 8][usize::from(point_format)];
            assert_eq!(layout.point_format(), expected, "{point_format}");
            assert_eq!(changes, vec![Changes::default(); changes.len()]);
            let found = read_bytes(&bytes).unwrap();
            assert_same(&found, &cloud);
            assert_eq!(found.info.warnings, []);
            let kind = if is_compressed { "LAZ" } else { "LAS" };
            assert_eq!(found.info.format, format!("{kind} 1.4, point format {expected}"));
            if !is_compressed && expected == point_format {
                let (start, len) = (records_start(&original), layout.record_len());
                assert!(original[start..].chunks(len).eq(bytes[records_start(&bytes)..].chunks(len)), "{point_format}");
            }
        }
    }
}

fn records_start(bytes: &[u8]) -> usize {
    pointmill_testkit::damage::u32_at(bytes, 96) as usize
}

fn las_points(bytes: &[u8]) -> (las::Header, Vec<Point>) {
    let mut reader = las::Reader::from_path(temporary(bytes)).unwrap();
    let points = reader.read_all().unwrap().points().map(Result::unwrap).collect();
    (reader.header().clone(), points)
}

#[test]
fn the_crate_las_reads_the_same_points_as_of_the_original() {
    for point_format in 0..=10 {
        let original = random_file(point_format, 2000);
        let cloud = read_bytes(&original).unwrap();
        let (_, mut expected) = las_points(&original);
        expected.iter_mut().for_each(|point| point.waveform = None);
        for is_compressed in [false, true] {
            let (_, bytes, _) = written(&cloud, &WRITTEN, is_compressed);
            let (header, points) = las_points(&bytes);
            assert!(points == expected, "{point_format}, {is_compressed}");
            assert_eq!(header.number_of_points(), 2000);
            let returns = |n: u8| points.iter().filter(|point| point.return_number == n).count() as u64;
            for n in 1..=5 {
                assert_eq!(header.number_of_points_by_return(n), Some(returns(n)), "{point_format}, {n}");
            }
            let bounds = header.bounds();
            let least = points.iter().map(|p| p.x).fold(f64::INFINITY, f64::min);
            let most = points.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
            assert!((bounds.min.x - least).abs() < 1e-6 && (bounds.max.z - most).abs() < 1e-6);
        }
    }
}

#[test]
fn files_are_of_the_oldest_version_that_holds_everything() {
    let attributes = |names: &[&str]| -> Vec<Attribute> {
        names.iter().map(|name| Attribute::new(*name, AttributeType::UInt16, 1)).collect()
    };
    let version = |names: &[&str], crs: Crs, most: u64| {
        let layout = RecordLayout::choose(&attributes(names), &WRITTEN).unwrap();
        let mut heading = Heading::new(layout, LATTICE, most);
        heading.crs = CrsRecords::new(&crs, CrsKind::Projected);
        let bytes = file(&heading, &[], 1);
        let cloud = read_bytes(&bytes).unwrap();
        assert_eq!((cloud.len(), &cloud.info.crs), (0, &crs));
        (bytes[25], cloud.info.format)
    };
    let wkt = || Crs::new(Some("GEOGCS[\"a\"]".into()), None, None);
    let last = u64::from(u32::MAX);
    assert_eq!(version(&["intensity"], Crs::default(), last), (2, "LAS 1.2, point format 0".into()));
    assert_eq!(version(&["intensity"], Crs::new(None, Some(25832), None), 5).0, 2);
    assert_eq!(version(&["intensity"], wkt(), 5).0, 4);
    assert_eq!(version(&["intensity", "echo"], Crs::default(), 5).0, 4);
    assert_eq!(version(&["intensity", "nir"], Crs::default(), 5), (4, "LAS 1.4, point format 8".into()));
    assert_eq!(version(&["intensity"], Crs::default(), last + 1).0, 4);
}

#[test]
fn more_points_than_old_headers_can_count_are_counted_in_the_new_fields_alone() {
    let layout = RecordLayout::choose(&[], &[0]).unwrap();
    let mut heading = Heading::new(layout, LATTICE, 5_000_000_000);
    let mut summary = Tally::default().summary(&LATTICE);
    (summary.points, summary.points_by_return[0]) = (5_000_000_000, 5_000_000_000);
    let ending = heading.finish(&summary, 375 + 20 * summary.points, &[]).unwrap();
    assert_eq!(ending.head[107..131], [0; 24]);
    assert_eq!(ending.head[247..263], [5_000_000_000u64.to_le_bytes(), 5_000_000_000u64.to_le_bytes()].concat());
    heading.most_points -= 1;
    assert!(heading.finish(&summary, 9, &[]).is_err());
}

#[test]
fn records_that_are_too_long_for_their_place_stand_behind_the_points() {
    let wkt = format!("PROJCS[\"{}\"]", "x".repeat(70_000));
    let crs = Crs::new(Some(wkt), None, None);
    let attributes: Vec<_> = (0..400).map(|i| Attribute::new(format!("band {i}"), AttributeType::UInt8, 1)).collect();
    for is_compressed in [false, true] {
        let layout = RecordLayout::choose(&attributes, &WRITTEN).unwrap();
        let records: Vec<u8> = (0..50 * layout.record_len()).map(|i| (i / 7) as u8).collect();
        let mut heading = Heading::new(layout, LATTICE, 50);
        heading.is_compressed = is_compressed;
        heading.crs = CrsRecords::new(&crs, CrsKind::Projected);
        let cloud = read_bytes(&file(&heading, &records, 20)).unwrap();
        assert_eq!((cloud.len(), &cloud.info.crs, &cloud.info.warnings[..]), (50, &crs, &[][..]));
        assert_eq!(cloud.info.attributes[cloud.info.attributes.len() - 400..], attributes);
        assert_eq!(cloud.column("band 399"), &Column::UInt8((1..=50).map(|i| ((i * 420 - 1) / 7) as u8).collect()));
    }
}

#[test]
fn old_attributes_in_new_formats_keep_their_fields() {
    let cloud = read_bytes(&random_file(3, 500)).unwrap();
    let (layout, bytes, changes) = written(&cloud, &[6, 7, 8], true);
    assert_eq!((layout.point_format(), changes.iter().all(Changes::is_empty)), (7, true));
    let rank = cloud.info.attribute("scan angle rank").unwrap().0;
    for (i, place) in layout.places().iter().enumerate() {
        let expected = match cloud.info.attributes[i].name.as_str() {
            "beam" | "Amplitude" => FieldPlace::ExtraBytes,
            _ if i == rank => FieldPlace::AngleField,
            _ => FieldPlace::Field,
        };
        assert_eq!(*place, expected, "{}", cloud.info.attributes[i].name);
    }
    let found = read_bytes(&bytes).unwrap();
    for attribute in cloud.info.attributes.iter().filter(|a| a.name != "scan angle rank") {
        assert_eq!(bits(found.column(&attribute.name)), bits(cloud.column(&attribute.name)), "{}", attribute.name);
    }
    let degrees: Vec<f64> = found.values("scan angle").iter().map(|steps| (steps * 0.006).round()).collect();
    assert_eq!(degrees, cloud.values("scan angle rank"));
}

//! Which field takes which attribute, and what becomes of values that do not fit.

use pointmill_format::scan::las::write::{ChunkEncoder, FieldPlace, RecordLayout, StridedColumn};
use pointmill_format::{Attribute, AttributeType as T, Changes, Column};

use crate::write::WRITTEN;

fn attribute(name: &str, ty: T) -> Attribute {
    Attribute::new(name, ty, 1)
}

fn chosen(attributes: &[Attribute]) -> RecordLayout {
    RecordLayout::choose(attributes, &WRITTEN).unwrap()
}

/// The record of one point at 1, 2, 3 with these values, and what had to be changed.
fn put(layout: &RecordLayout, columns: &[(&Column, usize)]) -> (Vec<u8>, Vec<Changes>) {
    let columns: Vec<_> = columns.iter().map(|(c, elements)| Some(StridedColumn::of(c, *elements))).collect();
    let axes = [[1], [2], [3]];
    let mut record = vec![9; layout.record_len()];
    let mut changes = vec![Changes::default(); columns.len()];
    layout.put(&axes.each_ref().map(|axis| StridedColumn::of_axis(axis)), &columns, &mut record, &mut changes);
    (record, changes)
}

#[test]
fn the_format_is_the_shortest_in_which_attributes_have_fields_that_hold_them() {
    let rgb = || Attribute::new("rgb", T::UInt16, 3);
    let (time, class, rank) = (
        attribute("gps-time", T::Float64),
        attribute("classification", T::UInt8),
        attribute("scan angle rank", T::Int8),
    );
    for (attributes, format, len) in [
        (vec![], 0, 20),
        (vec![rgb()], 2, 26),
        (vec![time.clone()], 1, 28),
        (vec![rgb(), time], 3, 34),
        // any class
        (vec![class.clone()], 6, 30),
        // a class of LAS
        (vec![class, rank, rgb()], 2, 26),
        (vec![rgb(), attribute("nir", T::UInt16)], 8, 38),
        (vec![attribute("scan angle", T::Int16)], 6, 30),
        (vec![attribute("scanner channel", T::UInt8), rgb()], 7, 36),
        // no field holds them
        (vec![attribute("intensity", T::Float32), attribute("scan angle", T::Float64)], 0, 32),
        (vec![Attribute::new("rgb", T::UInt8, 3)], 0, 23),
    ] {
        let layout = chosen(&attributes);
        assert_eq!((layout.point_format(), layout.record_len()), (format, len), "{attributes:?}");
    }
    assert!(RecordLayout::choose(&[], &[4, 5, 9, 10]).is_err());
    let wide: Vec<_> = (0..9000).map(|i| attribute(&format!("a{i}"), T::Float64)).collect();
    assert!(RecordLayout::choose(&wide, &WRITTEN).is_err());
    let layout = chosen(&wide[..300]);
    assert!(ChunkEncoder::new(&layout).unwrap_err().to_string().contains("2400 extra bytes"));
}

#[test]
fn what_has_no_field_goes_to_extra_bytes_under_names_that_fit() {
    let long = "a name that is longer than thirty-two bytes";
    let mut wide = Attribute::new("spectrum", T::UInt16, 5);
    (wide.scale, wide.offset) = (vec![0.5, 1.0, 2.0, 3.0, 4.0], vec![0.0, 0.0, 7.0, 0.0, 0.0]);
    let attributes =
        [attribute(long, T::UInt8), attribute(&format!("{long} too"), T::Int64), wide, attribute("b", T::Int8)];
    let layout = chosen(&attributes);
    let names: Vec<_> = layout.extra_bytes().iter().map(|a| a.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "a name that is longer than thirt",
            "a name that is longer than 2",
            "spectrum 0",
            "spectrum 1",
            "spectrum 2",
            "spectrum 3",
            "spectrum 4",
            "b"
        ]
    );
    assert_eq!((layout.extra_bytes()[4].scale[0], layout.extra_bytes()[4].offset[0]), (2.0, 7.0));
    assert_eq!(layout.places(), [FieldPlace::ExtraBytes; 4]);
    let columns =
        [Column::UInt8(vec![7]), Column::Int64(vec![-2]), Column::UInt16(vec![1, 2, 3, 4, 5]), Column::Int8(vec![-1])];
    let columns: Vec<_> = columns.iter().zip([1, 1, 5, 1]).collect();
    let (record, _) = put(&layout, &columns);
    assert_eq!(record[20..], [7, 254, 255, 255, 255, 255, 255, 255, 255, 1, 0, 2, 0, 3, 0, 4, 0, 5, 0, 255]);
}

#[test]
fn values_that_no_field_holds_are_counted_and_never_wrap() {
    let attributes = [
        attribute("return number", T::UInt8),
        attribute("classification", T::Float32),
        attribute("classification flags", T::UInt8),
        attribute("point source id", T::Int32),
        attribute("edge of flight line", T::UInt8),
        attribute("user data", T::Float64),
    ];
    let layout = chosen(&attributes);
    assert_eq!(layout.point_format(), 6);
    assert_eq!(layout.places(), [FieldPlace::Field; 6]);
    let with = |returns, class, flags, source, edge, user| {
        let columns = [
            Column::UInt8(vec![returns]),
            Column::Float32(vec![class]),
            Column::UInt8(vec![flags]),
            Column::Int32(vec![source]),
            Column::UInt8(vec![edge]),
            Column::Float64(vec![user]),
        ];
        let columns: Vec<_> = columns.iter().map(|c| (c, 1)).collect();
        let (record, changes) = put(&layout, &columns);
        let source = u16::from_le_bytes([record[20], record[21]]);
        ([record[14], record[15], record[16], record[17]], source, changes)
    };
    let (bytes, source, changes) = with(15, 255.0, 15, 65_535, 1, 255.0);
    assert_eq!((bytes, source, changes.iter().all(Changes::is_empty)), ([0xff, 0x8f, 255, 255], 65_535, true));
    let (bytes, source, changes) = with(16, 256.0, 16, -1, 2, 255.6);
    assert_eq!((bytes, source), ([0xff, 0x80, 0, 255], 0));
    let clamped = |value| {
        let mut changes = Changes::default();
        changes.clamp(value);
        changes
    };
    let left_out = |value| {
        let mut changes = Changes::default();
        changes.leave_out(value);
        changes
    };
    assert_eq!(changes, [clamped(16.0), left_out(256.0), left_out(16.0), left_out(-1.0), clamped(2.0), clamped(255.6)]);
    let (bytes, _, changes) = with(1, f32::NAN, 0, 1, 0, 2.4);
    assert_eq!((bytes, changes[1].not_finite, changes[5].rounded), ([0x11, 0, 0, 2], 1, 1));
}

#[test]
fn degrees_become_steps_and_what_is_no_step_is_counted() {
    let layout = RecordLayout::choose(&[attribute("scan angle", T::Float64)], &[6]).unwrap();
    assert_eq!(layout.places(), [FieldPlace::AngleField]);
    for (degrees, steps, is_changed) in [
        (-90.0, -15_000, false),
        (12.0, 2000, false),
        (7.0, 1167, false), // a whole degree comes back by rounding
        (0.006 * 1001.0, 1001, false),
        (0.01, 2, true),
        (400.0, i16::MAX, true),
        (f64::NAN, 0, true),
    ] {
        let column = Column::Float64(vec![degrees]);
        let (record, changes) = put(&layout, &[(&column, 1)]);
        assert_eq!(i16::from_le_bytes([record[18], record[19]]), steps, "{degrees}");
        assert_eq!(!changes[0].is_empty(), is_changed, "{degrees}");
    }
}

#[test]
fn without_returns_every_point_is_the_only_one() {
    assert_eq!(put(&chosen(&[]), &[]).0[14], 0b0000_1001);
    let layout = RecordLayout::choose(&[], &[6]).unwrap();
    assert_eq!(put(&layout, &[]).0[14], 0x11);
}

#[test]
fn columns_are_taken_from_wherever_they_lie() {
    let attributes = [
        Attribute::new("rgb", T::UInt16, 3),
        attribute("intensity", T::UInt16),
        attribute("classification", T::UInt8),
        attribute("scan angle rank", T::Int8),
    ];
    let layout = chosen(&attributes);
    // records of a store: x, y, z, rgb, intensity, class, angle, and two bytes that are no attribute
    let stride = 12 + 6 + 2 + 1 + 1 + 2;
    let rows: Vec<u8> = (0..1500 * stride).map(|i| (i as u32).wrapping_mul(0x9e37_79b1) as u8 >> 1).collect();
    let rows: Vec<u8> =
        rows.chunks(stride).flat_map(|row| [&row[..20], &[row[20] & 31], &row[21..]].concat()).collect();
    let view = |first, ty, elements| StridedColumn::new(&rows, first, stride, ty, elements);
    let positions = [0, 4, 8].map(|at| view(at, T::Int32, 1));
    let columns = [
        Some(view(12, T::UInt16, 3)),
        Some(view(18, T::UInt16, 1)),
        Some(view(20, T::UInt8, 1)),
        Some(view(21, T::Int8, 1)),
    ];
    let (mut out, mut changes) = (vec![7; 1500 * 26], vec![Changes::default(); 4]);
    layout.put(&positions, &columns, &mut out, &mut changes);
    for (record, row) in out.chunks(26).zip(rows.chunks(stride)) {
        assert_eq!(record[..14], [&row[..12], &row[18..20]].concat());
        assert_eq!(record[14..20], [9, row[20], row[21], 0, 0, 0]);
        assert_eq!(record[20..26], row[12..18]);
    }
    // what a source does not have
    layout.put(&positions, &[None, None, None, None], &mut out, &mut changes);
    assert_eq!(out[12..26], [0, 0, 9, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    assert!(changes.iter().all(Changes::is_empty));
}

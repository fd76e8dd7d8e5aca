//! Faults of the header, the description, records and places.

use pointmill_validate::Check;
use serde_json::{Value, json};

use super::cloud::{BATCH, assert_only, broken, check, good};

#[test]
fn a_header_that_readers_refuse() {
    let (bytes, _) = good().bytes();
    for (at, byte) in [(0, b'q'), (8, 2), (13, 0), (24, 1), (20, 1), (111, 0x7f)] {
        let mut bytes = bytes.clone();
        bytes[at] = byte;
        let outcome = check(&bytes);
        assert_only(&outcome, Check::Header, 1);
        assert!(outcome.checks.iter().skip(1).all(|c| c.skipped.is_some()));
    }
    assert_only(&check(&bytes[..200]), Check::Header, 1);
    assert_only(&check(b""), Check::Header, 1);
}

#[test]
fn header_fields_that_contradict_each_other() {
    let (bytes, _) = good().bytes();
    // batch count, n, a reserved word, a reserved byte, an unknown flag
    for (at, byte) in [(28, 5), (116, 32), (188, 1), (255, 1), (112, 15 + 64)] {
        let mut bytes = bytes.clone();
        bytes[at] = byte;
        assert_only(&check(&bytes), Check::Header, 1);
    }
}

#[test]
fn an_origin_that_is_not_the_floor_of_the_box() {
    let mut parts = good();
    parts.origin[1] += 1.0;
    assert!(broken(&parts.validate()).contains(&Check::Header));
}

#[test]
fn a_morton_cube_that_is_larger_than_it_must_be() {
    let mut parts = good();
    parts.exponent += 1;
    assert_only(&parts.validate(), Check::Header, 1);
}

#[test]
fn a_tight_box_that_is_one_step_too_large() {
    let mut parts = good();
    parts.max[2] += 0.001;
    assert_only(&parts.validate(), Check::TightBox, 1);
}

#[test]
fn flags_that_say_what_is_not_there() {
    let mut parts = good();
    parts.flags = 7; // averaged, no originals: allowed, and colours cannot be checked
    let outcome = parts.validate();
    assert!(outcome.ok && outcome.check(Check::Colours).unwrap().skipped.is_some(), "{:#?}", outcome.problems);
    let (mut bytes, _) = good().bytes();
    bytes[112] = 7; // originals without their flag
    assert!(broken(&check(&bytes)).contains(&Check::Header));
}

#[test]
fn a_file_cut_short_or_long() {
    let (mut bytes, places) = good().bytes();
    for len in [bytes.len() - 1, places["description"], places["lo10"] + 5, 300] {
        assert_only(&check(&bytes[..len]), Check::Description, 1);
    }
    bytes.push(b' ');
    assert_only(&check(&bytes), Check::Sections, 1);
}

#[test]
fn a_gap_with_something_in_it() {
    let (bytes, places) = good().bytes();
    for section in ["hi10", "originals", "description"] {
        let mut bytes = bytes.clone();
        bytes[places[section] - 1] = 1;
        assert_only(&check(&bytes), Check::Sections, 1);
    }
}

/// Overwrites a section's offset in the header.
fn moved(header_at: usize, offset: u64) -> Vec<u8> {
    let (mut bytes, _) = good().bytes();
    bytes[header_at..header_at + 8].copy_from_slice(&offset.to_le_bytes());
    bytes
}

#[test]
fn a_section_that_is_not_where_it_can_be() {
    let outcome = check(&moved(128, u64::MAX - 7));
    assert_only(&outcome, Check::Sections, 1);
    assert!(outcome.check(Check::Levels).unwrap().skipped.is_some());
    assert!(broken(&check(&moved(128, 256))).contains(&Check::Sections)); // on the batch records
    assert!(broken(&check(&moved(152, 260))).contains(&Check::Sections)); // on no multiple of 256
    let (_, places) = good().bytes();
    let past = places["description"] as u64;
    assert!(broken(&check(&moved(160, past))).contains(&Check::Sections)); // a count out of JSON
}

#[test]
fn a_description_that_is_incomplete_or_disagrees() {
    let change = |path: &str, value: Value| {
        let mut parts = good();
        *parts.description.pointer_mut(path).unwrap() = value;
        parts.validate()
    };
    for (path, value) in [
        ("/version", json!(1)),
        ("/projection", Value::Null),
        ("/lattice/scale/0", json!(0.0)),
        ("/attributes", json!({})),
        ("/attributes/0/elements", json!(0)),
        ("/attributes/0/type", json!("uint17")),
        ("/attributes/1/name", json!("intensity")),
        ("/attributes/0/min", json!([1, 2])),
        ("/colour", json!("cmyk")),
        ("/errors/20", Value::Null),
        ("/errors/10/rms/1", json!(-1.0)),
        ("/sourceStep", json!([1, 2])),
        ("/intensityRange", json!([2, 1])),
        ("/intensityRange", json!([0.25, 1])),
    ] {
        assert_eq!(broken(&change(path, value.clone())), [Check::Description], "{path} {value}");
    }
    let mut parts = good();
    parts.description["attributes"][0]["bytes"] = json!(2 * parts.points + 2);
    assert_only(&parts.validate(), Check::Description, 1);
}

#[test]
fn a_description_that_is_no_json() {
    let (mut bytes, places) = good().bytes();
    bytes[places["description"]] = b'[';
    assert_only(&check(&bytes), Check::Description, 1);
}

#[test]
fn attribute_ranges_that_nothing_attains() {
    let mut parts = good();
    parts.description["attributes"][0]["max"] = json!([1020]);
    assert_only(&parts.validate(), Check::AttributeRanges, 1);
}

#[test]
fn a_record_that_tells_another_slot_or_count() {
    let (bytes, places) = good().bytes();
    for (field, value) in [(12, BATCH as u32 + 4), (28, 10_239)] {
        let mut bytes = bytes.clone();
        let at = places["batches"] + 2 * 32 + field;
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        assert_only(&check(&bytes), Check::BatchRecords, 1);
    }
}

#[test]
fn a_record_without_a_box() {
    let mut parts = good();
    parts.boxes[2][0][1] = f32::NAN;
    let outcome = parts.validate();
    assert_only(&outcome, Check::BatchRecords, 1);
    assert!(outcome.check(Check::Errors).unwrap().skipped.is_some());
}

#[test]
fn wrong_error_figures() {
    for (path, factor) in
        [("/errors/10/max/0", 1.0 + 1e-15), ("/errors/20/max/2", 0.5), ("/errors/30/rms/1", 1.0 + 1e-8)]
    {
        let mut parts = good();
        let value = parts.description.pointer_mut(path).unwrap();
        *value = json!(value.as_f64().unwrap() * factor);
        assert_only(&parts.validate(), Check::Errors, 1);
    }
}

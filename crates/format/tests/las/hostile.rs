//! Headers made to break a reader: each is one clear error, or is read without believing it.

use pointmill_format::ErrorKind;
use pointmill_testkit::damage::{put, u32_at};

use crate::common::{fixture, points_start, read_bytes};

const POINTS_START: usize = 96;
const RECORD_LEN: usize = 105;
const SCALE: usize = 131;

fn refused(bytes: &[u8], words: &str) {
    let error = read_bytes(bytes).unwrap_err();
    assert!(matches!(error.kind(), ErrorKind::Broken), "{error}");
    assert!(error.to_string().contains(words), "{error}");
}

/// Perhaps sound, but of a kind that is not known.
fn unsupported(bytes: &[u8], words: &str) {
    let error = read_bytes(bytes).unwrap_err();
    assert!(matches!(error.kind(), ErrorKind::Unsupported), "{error}");
    assert!(error.to_string().contains(words), "{error}");
}

/// Where the data of the LASzip record starts.
fn laszip(bytes: &[u8]) -> usize {
    bytes.windows(14).position(|w| w == b"laszip encoded").unwrap() - 2 + 54
}

#[test]
fn records_that_cannot_hold_their_format_are_refused() {
    for file in ["format3.las", "format3.laz"] {
        for len in [0u16, 1, 33] {
            let mut bytes = fixture(file);
            put(&mut bytes, RECORD_LEN, &len.to_le_bytes());
            refused(&bytes, "point format 3 needs 34");
        }
    }
}

#[test]
fn points_beyond_the_end_or_inside_the_header_are_refused() {
    let mut bytes = fixture("format3.las");
    put(&mut bytes, POINTS_START, &u32::MAX.to_le_bytes());
    refused(&bytes, "the points start at byte 4294967295");
    put(&mut bytes, POINTS_START, &10u32.to_le_bytes());
    refused(&bytes, "inside the header");
    refused(&fixture("format3.las")[..100], "cut short");
}

#[test]
fn a_scale_that_places_no_point_is_refused() {
    for scale in [0.0, -0.01, f64::NAN, f64::INFINITY] {
        let mut bytes = fixture("format3.las");
        put(&mut bytes, SCALE + 8, &scale.to_le_bytes());
        refused(&bytes, "scale");
    }
}

#[test]
fn versions_and_formats_that_are_not_known_are_named() {
    for (at, value, words) in [(25, 9, "LAS version 1.9"), (24, 2, "LAS version 2.2"), (104, 11, "point format 11")] {
        let mut bytes = fixture("format3.las");
        bytes[at] = value;
        let error = read_bytes(&bytes).unwrap_err();
        assert!(matches!(error.kind(), ErrorKind::Unsupported));
        assert!(error.to_string().contains(words), "{error}");
    }
}

#[test]
fn a_laszip_record_that_does_not_fit_the_header_is_refused() {
    for file in ["format3.laz", "format7.laz", "extra_bytes_format3.laz", "extra_bytes_format7.laz"] {
        let whole = fixture(file);
        let record = laszip(&whole);
        let with = |at: usize, new: u16| {
            let mut bytes = whole.clone();
            put(&mut bytes, record + at, &new.to_le_bytes());
            bytes
        };
        refused(&with(32, 0), "0 items");
        refused(&with(32, u16::MAX), "65535 items");
        refused(&with(32, 1), "LASzip items");
        unsupported(&with(0, 7), "compressor 7");
        unsupported(&with(2, 1), "coder 1");
        refused(&with(34, 99), "LASzip record");
        refused(&with(34 + 2, 4), "claims 4 bytes");
        unsupported(&with(34 + 4, 9), "version 9");
        let mut longer = whole.clone();
        put(&mut longer, RECORD_LEN, &60_000u16.to_le_bytes());
        unsupported(&longer, "extra bytes");
        let mut without = whole.clone();
        put(&mut without, record - 54 + 18, &1u16.to_le_bytes());
        refused(&without, "no LASzip record");
    }
}

#[test]
fn layers_that_claim_gigabytes_are_an_error_and_no_allocation() {
    let whole = fixture("format7.laz");
    let record_len = 36;
    let sizes = points_start(&whole) + 8 + record_len + 4;
    for layer in 0..10 {
        let mut bytes = whole.clone();
        put(&mut bytes, sizes + 4 * layer, &u32::MAX.to_le_bytes());
        let cloud = read_bytes(&bytes).unwrap();
        assert_eq!(cloud.len(), 0);
        assert!(cloud.warned("150 are missing"), "{:?}", cloud.info.warnings);
    }
}

#[test]
fn a_point_count_that_the_bytes_cannot_hold_is_cut_down_for_pointwise_files_too() {
    // chunked made point-wise: compressor 1 has no chunk table, its points begin at once
    let mut bytes = fixture("format3.laz");
    let (record, start) = (laszip(&bytes), points_start(&bytes));
    let table = u32_at(&bytes, start) as usize;
    put(&mut bytes, record, &1u16.to_le_bytes());
    bytes.truncate(table);
    bytes.drain(start..start + 8);
    let right = read_bytes(&fixture("format3.laz")).unwrap();
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!(cloud.xyz, right.xyz);
    put(&mut bytes, 107, &u32::MAX.to_le_bytes());
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!(cloud.xyz, right.xyz);
    assert!(cloud.promised < 20_000_000 && cloud.warned("more than"), "{}", cloud.promised);
    assert!(cloud.errors[0].to_string().contains("gives 150 of"), "{}", cloud.errors[0]);
}

#[test]
fn a_laszip_record_left_over_in_an_unpacked_file_does_not_matter() {
    let laz = fixture("format3.laz");
    let mut bytes = laz[..points_start(&laz)].to_vec();
    bytes[104] &= 0x3f;
    let las = fixture("format3.las");
    bytes.extend(&las[points_start(&las)..]);
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!(cloud.xyz, read_bytes(&las).unwrap().xyz);
    assert!(cloud.warned("ignored"));
}

/// Found by fuzzing: the user id of a record stood in a warning as it was.
#[test]
fn names_with_line_breaks_leave_warnings_one_line() {
    let mut bytes = fixture("evlrs.las");
    let at = u64::from_le_bytes(*bytes[235..].first_chunk().unwrap()) as usize;
    put(&mut bytes, at + 2, b"a\nb\r\x1b[31m");
    put(&mut bytes, at + 20, &u64::MAX.to_le_bytes());
    let cloud = read_bytes(&bytes).unwrap();
    assert!(cloud.warned("a b  [31m") && cloud.info.warnings.iter().all(|w| !w.to_string().contains(char::is_control)));
}

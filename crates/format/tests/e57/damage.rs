//! Damage of one kind at a time: what is lost is reported, the rest is read.

use crate::common::{fixture, read_bytes, repair, replace};

#[test]
fn headers_that_lie_are_told_with_their_byte() {
    let refused = |at: usize, value: u64, words: &str| {
        let mut bytes = fixture("no_z.e57");
        bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
        repair(&mut bytes);
        let error = read_bytes(&bytes).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    refused(0, 0, "not an E57 file (byte 0)");
    refused(8, 2, "E57 version 2.0");
    refused(24, u64::MAX, "the XML section should be");
    refused(32, u64::MAX, "the XML section should be");
    refused(32, 1 << 40, "the XML section should be 1099511627776 bytes");
    refused(40, 0, "pages of 0 bytes");
    refused(40, 4096, "pages of 4096 bytes");
    let mut bytes = fixture("no_z.e57");
    bytes[16] ^= 1;
    repair(&mut bytes);
    assert!(read_bytes(&bytes).unwrap().warned("the header declares 2049 bytes, the file has 2048"));
}

#[test]
fn a_record_count_beyond_the_data_gives_the_points_that_are_there() {
    for (old, new) in [("\"200\"", "\"999\""), ("\"200\"", "\"201\"")] {
        let mut bytes = fixture("scans.e57");
        replace(&mut bytes, &format!("recordCount={old}"), &format!("recordCount={new}"));
        let cloud = read_bytes(&bytes).unwrap();
        assert!(cloud.errors.is_empty());
        // fields of few bits are padded to whole bytes, doubles are not
        assert_eq!(cloud.len(), 600);
        assert!(cloud.warned("points are declared, 200 are there"), "{:?}", cloud.info.warnings);
    }
}

#[test]
fn points_without_a_bit_are_limited() {
    let count = |n: u64| {
        let mut bytes = fixture("constant.e57");
        replace(&mut bytes, "recordCount=\"5\"", &format!("recordCount=\"{n}\""));
        read_bytes(&bytes)
    };
    assert_eq!(count(65_536).unwrap().len(), 65_536);
    let error = count(1 << 60).unwrap_err().to_string();
    assert!(error.contains("scan 1: 1152921504606846976 points without a bit of data"), "{error}");
}

#[test]
fn a_broken_chain_of_packets_loses_the_rest_and_says_where() {
    let whole = read_bytes(&fixture("packets.e57")).unwrap();
    let mut bytes = fixture("packets.e57");
    // the first packet is an ordinary one; the type of the second, an ignored packet, becomes unknown
    let first = 48 + 32;
    let len = usize::from(u16::from_le_bytes([bytes[first + 2], bytes[first + 3]])) + 1;
    let second = first + len;
    let at = second / 1020 * 1024 + second % 1020;
    assert_eq!(bytes[at], 2);
    bytes[at] = 7;
    repair(&mut bytes);
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!(cloud.errors.len(), 1);
    let error = cloud.errors[0].to_string();
    assert!(error.contains("type 7") && error.contains(&format!("(byte {at})")), "{error}");
    assert!(cloud.promised <= whole.promised && cloud.len() < whole.len());
}

/// The offset of a scan's section as it stands in the XML.
fn section(bytes: &[u8], scan: usize) -> String {
    let logical: Vec<u8> = bytes.chunks_exact(1024).flat_map(|page| &page[..1020]).copied().collect();
    let text = String::from_utf8_lossy(&logical).into_owned();
    let rest = text.split("fileOffset=\"").nth(scan + 1).unwrap();
    format!("fileOffset=\"{}\"", rest.split('"').next().unwrap())
}

#[test]
fn two_scans_in_one_place_are_read_once() {
    let mut bytes = fixture("scans.e57");
    let (second, third) = (section(&bytes, 1), section(&bytes, 2));
    replace(&mut bytes, &third, &second);
    let cloud = read_bytes(&bytes).unwrap();
    assert!(cloud.warned("scan 3: its points are those of an earlier scan"), "{:?}", cloud.info.warnings);
    assert_eq!(cloud.len(), 400);
}

#[test]
fn a_scan_without_a_section_loses_its_points_alone() {
    let mut bytes = fixture("scans.e57");
    let second = section(&bytes, 1);
    replace(&mut bytes, &second, "fileOffset=\"999999999\"");
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!((cloud.len(), cloud.errors.len()), (400, 0));
    assert!(cloud.warned("scan 2: 200 points are declared, 0 are there (page"), "{:?}", cloud.info.warnings);
}

#[test]
fn an_image_that_cannot_be_described_does_not_stop_the_points() {
    let mut bytes = fixture("empty_scans.e57");
    replace(&mut bytes, "<imageWidth type=\"Integer\">2", "<imageWidth type=\"Integer\">two");
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!((cloud.len(), cloud.info.images.len()), (10, 1));
    let why = "the description of image 1 is not understood (imageWidth is \"two\", not a number); it is ignored";
    assert!(cloud.warned(why) && cloud.warned("1 image is in the file"), "{:?}", cloud.info.warnings);
}

#[test]
fn scans_without_positions_are_refused() {
    let mut bytes = fixture("no_z.e57");
    replace(&mut bytes, "<cartesianY ", "<cartesianQ ");
    let error = read_bytes(&bytes).unwrap_err();
    assert!(error.to_string().contains("scan 1: its points have neither x and y nor range"), "{error}");
}

//! Files that deviate from the standard as those of real writers do: read, and told.

use pointmill_format::scan::e57::{self, E57Options};
use pointmill_testkit::damage::{put, u64_at};
use pointmill_testkit::{files, reader};

use crate::common::{fixture, read_bytes, repair, replace};

/// Reads a file that deviates and must have all points of the fixture it was made from; its warnings.
fn told(bytes: &[u8], points: usize) -> Vec<String> {
    let cloud = read_bytes(bytes).unwrap();
    assert_eq!((cloud.len(), cloud.errors.len()), (points, 0));
    cloud.info.warnings.iter().map(ToString::to_string).collect()
}

/// Sets a number of the header.
fn with_header(name: &str, at: usize, value: impl Fn(u64) -> u64) -> Vec<u8> {
    let mut bytes = fixture(name);
    let value = value(u64_at(&bytes, at));
    put(&mut bytes, at, &value.to_le_bytes());
    repair(&mut bytes);
    bytes
}

#[test]
fn a_last_page_without_its_checksum_is_read_as_far_as_it_is_there() {
    for name in ["normals.e57", "spherical.e57"] {
        let bytes = fixture(name);
        let points = read_bytes(&bytes).unwrap().len();
        for missing in [1, 2, 3, 4, 5, 20] {
            let told = told(&bytes[..bytes.len() - missing], points);
            let line =
                format!("the last page of the file lacks {missing} of its 1024 bytes, of its checksum or before it");
            assert!(told.len() == 1 && told[0].starts_with(&line), "{name} without {missing}: {told:?}");
        }
        let longer = [&bytes, &b"and more"[..]].concat();
        let line = format!("the header declares {} bytes, the file has {}", bytes.len(), bytes.len() + 8);
        assert_eq!(told(&longer, points), [line]);
    }
}

#[test]
fn lengths_in_the_header_that_are_off_by_some_bytes_lose_nothing() {
    let right = fixture("normals.e57");
    let (file, xml) = (u64_at(&right, 16), u64_at(&right, 32));
    for by in [-1i64, 1, -4, 4, 1024] {
        let bytes = with_header("normals.e57", 16, |v| v.wrapping_add_signed(by));
        let line = format!("the header declares {} bytes, the file has {file}", file.wrapping_add_signed(by));
        assert_eq!(told(&bytes, 100), [line]);
    }
    let text_end = {
        let logical: Vec<u8> = right.chunks_exact(1024).flat_map(|page| &page[..1020]).copied().collect();
        let start = u64_at(&right, 24) as usize;
        let start = start - start / 1024 * 4;
        logical[start..start + xml as usize].trim_ascii_end().len() as u64
    };
    // too short, too long by some bytes, and as many as it has with the checksums
    for len in [text_end - 1, text_end - 9, text_end - 300, xml + 3, xml + xml / 1020 * 4 + 400] {
        let bytes = with_header("normals.e57", 32, |_| len);
        let told = told(&bytes, 100);
        let line = format!("the header declares {len} bytes of XML; ");
        assert!(told.iter().all(|t| t.starts_with(&line)) && told.len() <= 1, "{len}: {told:?}");
        assert!(len > text_end || told.len() == 1, "{len}: {told:?}");
    }
    for by in [-7i64, -60, 5, 30] {
        let bytes = with_header("normals.e57", 24, |v| v.wrapping_add_signed(by));
        assert_eq!(told(&bytes, 100).len(), 1, "{by}");
    }
}

#[test]
fn xml_that_other_readers_refuse_is_read() {
    let edited = |name: &str, edits: &[(&str, &str)]| {
        let mut bytes = fixture(name);
        edits.iter().for_each(|(old, new)| replace(&mut bytes, old, new));
        bytes
    };
    let namespace = "xmlns:nor=\"http://www.libe57.org/E57_EXT_surface_normals.txt\"";
    let twice = edited("normals.e57", &[(namespace, &format!("{namespace} {namespace}"))]);
    assert_eq!(told(&twice, 100), ["the XML declares xmlns:nor twice; the first is taken"]);
    let undeclared = edited("normals.e57", &[(namespace, "")]);
    assert_eq!(told(&undeclared, 100), Vec::<String>::new());
    // no images, no file GUID, no root type; a pose without rotation
    let bare = edited(
        "scans.e57",
        &[("images2D", "imagesOfNone"), ("images2D", "imagesOfNone"), ("<guid ", "<guido "), ("</guid>", "</guido>")],
    );
    assert_eq!(told(&bare, 600), ["scan 3: the rotation is no unit quaternion; it is normalised"]);
    let commas = edited("scans.e57", &[("-4.0000005e+06", "-4,0000005e+06")]);
    let cloud = read_bytes(&commas).unwrap();
    assert!(cloud.warned("numbers of the XML have decimal commas"), "{:?}", cloud.info.warnings);
    assert_eq!(cloud.info.parts[0].translation[1], -4_000_000.5);
    let undescribed = edited("scans.e57", &[("<points ", "<pints "), ("</points>", "</pints>")]);
    assert!(told(&undescribed, 400).contains(&"scan 1: no points are described for it".to_owned()));
}

#[test]
fn the_xml_may_be_as_large_as_the_memory_it_is_given() {
    let mut bytes = fixture("no_z.e57");
    // an extension with a long text, as some programs embed their projects
    replace(&mut bytes, "<data3D ", &format!("<x:project>{}</x:project><data3D ", "na ".repeat(200_000)));
    let path = files::temporary(&bytes);
    let open = |max| e57::open_with(&path, E57Options::default().max_xml(max));
    let scan = open(1 << 20).unwrap();
    assert_eq!(reader::read(scan.as_ref(), &pointmill_format::Wanted::all(scan.info())).len(), 5);
    let error = open(100_000).err().unwrap().to_string();
    assert!(error.contains("bytes, more than the 100000 that may be held; let it take more memory"), "{error}");
}

#[test]
fn scans_are_chosen_by_number_or_name_and_keep_their_number() {
    let path = files::fixture("e57").join("scans.e57");
    let all = crate::common::read("scans.e57");
    for (choice, expected) in [("2", 200..400), ("3", 400..600)] {
        let options = E57Options::default().keep_row_column(true).scans(Some(vec![choice.to_owned()]));
        let scan = e57::open_with(&path, options).unwrap();
        assert_eq!(scan.info().format, "E57 1.0, 1 of 3 scans");
        let cloud = reader::read(scan.as_ref(), &pointmill_format::Wanted::all(scan.info()));
        let bits = |v: &[f64]| v.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert!((0..3).all(|a| bits(&cloud.xyz[a]) == bits(&all.xyz[a][expected.clone()])), "scan {choice}");
        let index = choice.parse::<f64>().unwrap() - 1.0;
        assert!(cloud.values("point source id").iter().all(|v| *v == index));
        let part = &cloud.info.parts[0];
        assert_eq!((cloud.info.parts.len(), part.number, part.range.clone()), (1, index as usize + 1, 0..200));
    }
    let none = e57::open_with(&path, E57Options::default().scans(Some(vec!["Hall".to_owned()]))).unwrap();
    assert_eq!(none.pieces().len(), 0);
    let told: Vec<_> = none.info().warnings.iter().map(ToString::to_string).collect();
    assert!(told.contains(&"none of its 3 scans was chosen; nothing of it is read".to_owned()), "{told:?}");
}

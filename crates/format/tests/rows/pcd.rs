//! PCD headers and values as programs in the field write them, each with its right values.

use std::ops::ControlFlow;

use pointmill_format::{Scratch, Wanted};
use pointmill_testkit::files;

use crate::common::{ROWS, read_bytes};

/// A file of version .7 with these lines in place of FIELDS, SIZE, TYPE and COUNT.
fn pcd(fields: &str, points: u64, data: &str) -> Vec<u8> {
    format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n{fields}WIDTH {points}\nHEIGHT 1\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA {data}"
    )
    .into_bytes()
}

const XYZ: &str = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n";
const XYZ_RGB: &str = "FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n";

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// The two lengths and the block.
fn block(compressed: &[u8], decompressed: usize) -> Vec<u8> {
    let lengths = [compressed.len(), decompressed].map(|n| u32::try_from(n).unwrap().to_le_bytes());
    [lengths.concat().as_slice(), compressed].concat()
}

#[test]
fn padding_and_fields_of_count_0_take_the_bytes_that_they_say() {
    // 4 bytes of padding, an intensity, nothing, 3 bytes of padding: 23 bytes a point
    let fields = "FIELDS x y z _ intensity _ ring _ label\nSIZE 4 4 4 1 4 1 1 1 2\nTYPE F F F U F U U U U\n\
                  COUNT 1 1 1 4 1 0 0 3 1\n";
    let mut bytes = pcd(fields, 2, "binary\n");
    for i in 0..2u8 {
        bytes.extend(floats(&[f32::from(i), 2.0, 3.0]));
        bytes.extend([0xaa; 4]);
        bytes.extend((50.0 + f32::from(i)).to_le_bytes());
        bytes.extend([0xbb; 3]);
        bytes.extend((700 + u16::from(i)).to_le_bytes());
    }
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!(cloud.xyz, [[0.0, 1.0], [2.0, 2.0], [3.0, 3.0]]);
    assert_eq!((cloud.values("intensity"), cloud.values("label")), (vec![50.0, 51.0], vec![700.0, 701.0]));
    assert_eq!(cloud.attributes(), "intensity floatx1, label uint16x1");
    assert!(cloud.warned("the field ring has COUNT 0: it holds no values") && cloud.info.warnings.len() == 1);
    // an empty field takes no number of a line either
    let rows = "1 2 3 0 0 0 0 50 0 0 0 700\n4 5 6 0 0 0 0 51 0 0 0 701\n";
    let cloud = read_bytes([pcd(fields, 2, "ascii\n"), rows.into()].concat()).unwrap();
    assert_eq!((cloud.values("intensity"), cloud.values("label")), (vec![50.0, 51.0], vec![700.0, 701.0]));
}

#[test]
fn words_types_and_encodings_count_in_any_case() {
    let head = "version .7\nFields x y z timestamp tag\nsize 4 4 4 8 2\nType f f f f i\ncount 1 1 1 1 1\nwidth 1\n\
                Height 1\npoints 1\ndata ASCII\n";
    let cloud = read_bytes(format!("{head}1.5 2.5 3.5 2530.875404584 -7\n")).unwrap();
    assert_eq!(cloud.attributes(), "timestamp doublex1, tag int16x1");
    assert_eq!((cloud.values("timestamp"), cloud.values("tag")), (vec![2_530.875_404_584], vec![-7.0]));
    assert_eq!(cloud.info.format, "PCD .7, ascii, float32 positions");
}

#[test]
fn any_line_ends_are_read_and_data_may_begin_with_a_line_feed() {
    // 10 is 0x41200000, so that x of the first point is 0x0a at its start if its low byte is set
    let first = f32::from_le_bytes([0x0a, 0, 0x20, 0x41]);
    let data = floats(&[first, 2.0, 3.0, 4.0, 5.0, 6.0]);
    for end in ["\n", "\r\n", "\r"] {
        let head = String::from_utf8(pcd(XYZ, 2, "binary\n")).unwrap().replace('\n', end);
        let cloud = read_bytes([head.as_bytes(), &data].concat()).unwrap();
        assert_eq!(cloud.xyz[0], [f64::from(first), 4.0], "{end:?}");
        // cut short, so that the length decides nothing
        let cloud = read_bytes([head.as_bytes(), &data[..20]].concat()).unwrap();
        assert_eq!(cloud.xyz[0], [f64::from(first)], "{end:?}");
        let head = String::from_utf8(pcd(XYZ, 2, "binary_compressed\n")).unwrap().replace('\n', end);
        let planes = [0, 3, 1, 4, 2, 5].map(|i| [first, 2.0, 3.0, 4.0, 5.0, 6.0][i]);
        let cloud = read_bytes([head.as_bytes(), &block(&floats(&planes), 24)].concat()).unwrap();
        assert_eq!(cloud.xyz, [[f64::from(first), 4.0], [2.0, 5.0], [3.0, 6.0]], "{end:?}");
    }
    let text = pcd(XYZ, 2, "ascii\n1 2 3\n4 5 6\n");
    let cloud = read_bytes([b"\xef\xbb\xbf".as_slice(), &text].concat()).unwrap();
    assert_eq!(cloud.xyz, [[1.0, 4.0], [2.0, 5.0], [3.0, 6.0]]);
}

#[test]
fn a_block_that_was_not_worth_compressing_is_read() {
    let planes = floats(&[0.1, 4.7, 0.2, 5.3, 0.3, 6.9]);
    let [x, y, z] = [[0.1, 4.7], [0.2, 5.3], [0.3, 6.9]].map(|p: [f32; 2]| p.map(f64::from));
    let head = pcd(XYZ, 2, "binary_compressed\n");
    let stored = read_bytes([head.as_slice(), &block(&planes, 24)].concat()).unwrap();
    // 24 bytes as they stand, announced by a byte
    let literal = [&[23u8], planes.as_slice()].concat();
    let literal = read_bytes([head.as_slice(), &block(&literal, 24)].concat()).unwrap();
    for cloud in [stored, literal] {
        assert_eq!((cloud.xyz, cloud.errors.len()), ([x.to_vec(), y.to_vec(), z.to_vec()], 0));
    }
}

#[test]
fn a_packed_colour_in_text_is_a_float_or_the_digits_of_its_bits() {
    let rows = "0 0 0 4.2108e+06\n0 0 0 4210800\n0 0 0 8.206463e-39\n0 0 0 -8355712\n0 0 0 -1.7014118e+38\n0 0 0 0\n";
    let cloud = read_bytes([pcd(XYZ_RGB, 6, "ascii\n"), rows.into()].concat()).unwrap();
    let expected: [[u8; 3]; 6] =
        [[0x80, 0x80, 0xe0], [0x40, 0x40, 0x70], [89, 92, 72], [0x80, 0x80, 0x80], [0, 0, 0], [0, 0, 0]];
    assert_eq!(cloud.values("rgb"), expected.as_flattened().iter().map(|v| f64::from(*v)).collect::<Vec<_>>());
    assert!(cloud.info.warnings.is_empty());
    let whole = XYZ_RGB.replace("F F F F", "F F F U");
    let rows = "0 0 0 4286611584\n0 0 0 255\n";
    let cloud = read_bytes([pcd(&whole, 2, "ascii\n"), rows.into()].concat()).unwrap();
    assert_eq!(cloud.values("rgb"), [128.0, 128.0, 128.0, 0.0, 0.0, 255.0]);
}

#[test]
fn a_colour_that_is_nan_keeps_its_bits_in_binary_and_is_told_in_text() {
    let mut bytes = pcd(XYZ_RGB, 1, "binary\n");
    bytes.extend(floats(&[1.0, 2.0, 3.0]));
    bytes.extend(0xffc8_0a14u32.to_le_bytes());
    let cloud = read_bytes(&bytes).unwrap();
    assert_eq!((cloud.values("rgb"), cloud.info.warnings.len()), (vec![200.0, 10.0, 20.0], 0));
    let text = [pcd(XYZ_RGB, 2, "ascii\n"), b"1 2 3 nan\n1 2 3 1e-40\n".to_vec()].concat();
    let cloud = read_bytes(&text).unwrap();
    assert_eq!(cloud.values("rgb"), [0.0, 0.0, 0.0, 1.0, 22.0, 194.0]);
    let scan = (ROWS.open)(&files::temporary(&text)).unwrap();
    let (wanted, mut lost) = (Wanted::all(scan.info()), Vec::new());
    scan.decode(0, &wanted, &mut Scratch::default(), &mut |batch| {
        lost.extend(batch.changes().map(|(column, changes)| (column, changes.not_finite)));
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(lost, [(0, 1)]);
}

#[test]
fn three_small_numbers_called_rgb_are_a_colour() {
    let fields = "FIELDS x y z rgb\nSIZE 4 4 4 1\nTYPE F F F U\nCOUNT 1 1 1 3\n";
    let cloud = read_bytes([pcd(fields, 1, "ascii\n"), b"1 2 3 10 20 30\n".to_vec()].concat()).unwrap();
    assert_eq!((cloud.attributes().as_str(), cloud.values("rgb")), ("rgb uint16x3", vec![10.0, 20.0, 30.0]));
}

#[test]
fn of_two_point_counts_the_one_that_is_there_is_taken() {
    let head = |points: u64| {
        let text = String::from_utf8(pcd(XYZ, 2, "binary\n")).unwrap();
        text.replace("POINTS 2", &format!("POINTS {points}"))
    };
    let data = floats(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    for points in [0, 1, 9] {
        let cloud = read_bytes([head(points).as_bytes(), &data].concat()).unwrap();
        assert_eq!((cloud.info.points_declared, cloud.len()), (2, 2));
        let told = format!("WIDTH 2 times HEIGHT 1 is not POINTS {points}; 2 are taken");
        assert!(cloud.warned(&told) && cloud.info.warnings.len() == 1, "{:?}", cloud.info.warnings);
        let ascii = head(points).replace("binary", "ascii") + "1 2 3\n4 5 6\n";
        assert_eq!(read_bytes(ascii).unwrap().len(), 2);
    }
    // WIDTH and HEIGHT wrong
    let ascii = head(3).replace("binary", "ascii") + "1 2 3\n4 5 6\n7 8 9\n";
    let cloud = read_bytes(ascii).unwrap();
    assert!(cloud.len() == 3 && cloud.warned("is not POINTS 3; 3 are taken"));
}

#[test]
fn points_beyond_the_declared_ones_are_told() {
    let data = floats(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let cloud = read_bytes([pcd(XYZ, 1, "binary\n"), data].concat()).unwrap();
    assert!(cloud.len() == 1 && cloud.warned("declares 1 points; the 12 bytes that follow them are not read"));
    let cloud = read_bytes(pcd(XYZ, 1, "ascii\n1 2 3\n4 5 6\n")).unwrap();
    assert!(cloud.len() == 1 && cloud.warned("declares 1 points; the 6 bytes that follow them are not read"));
    assert!(read_bytes(pcd(XYZ, 1, "ascii\n1 2 3\n\n \n")).unwrap().info.warnings.is_empty());
}

#[test]
fn headers_of_old_and_odd_writers_are_read() {
    // without VERSION, SIZE, TYPE, COUNT, HEIGHT, as the first versions were
    let cloud = read_bytes("# made by hand\nCOLUMNS x y z\nPOINTS 1\nDATA ascii\n1 2 3\n").unwrap();
    assert_eq!(
        (cloud.xyz.clone(), cloud.info.format.as_str()),
        ([[1.0], [2.0], [3.0]].map(Vec::from), "PCD, ascii, float32 positions")
    );
    assert!(cloud.warned("no SIZE and TYPE"));
    // a word that no version knows
    let text = String::from_utf8(pcd(XYZ, 1, "ascii\n1 2 3\n")).unwrap().replace("WIDTH", "SENSOR lidar\nWIDTH");
    assert!(read_bytes(text).unwrap().warned("the header line \"SENSOR\" is not known"));
}

//! Small files written in the test: one rule each.

use std::ops::ControlFlow;

use pointmill_format::scan::text::{self, TextOptions};
use pointmill_format::{ReadError, Wanted};

use pointmill_testkit::files;
use pointmill_testkit::reader::{self, Cloud};

use crate::common::{ROWS, read_bytes};

fn ply(kind: &str, rest: &str) -> String {
    format!("ply\nformat {kind} 1.0\n{rest}")
}

fn with(bytes: &str, columns: &[&str], separator: Option<char>) -> Result<Cloud, ReadError> {
    let mut options = TextOptions::default();
    options.columns = (!columns.is_empty()).then(|| columns.iter().map(|c| (*c).to_owned()).collect());
    options.separator = separator;
    let file = files::temporary(bytes.as_bytes());
    let scan = text::open(&file, &options)?;
    Ok(reader::read(scan.as_ref(), &Wanted::all(scan.info())))
}

#[test]
fn a_count_beyond_2_to_the_32_is_declared_and_only_what_is_there_is_read() {
    let header =
        ply("ascii", "element vertex 5000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n");
    let cloud = read_bytes(header + "1 2 3\n4 5 6\n").unwrap();
    assert_eq!((cloud.info.points_declared, cloud.len()), (5_000_000_000, 2));
    assert!(cloud.warned("declares 5000000000 points, 2 whole ones are there"));
    let binary = "element vertex 18446744073709551615\nproperty float x\nproperty float y\nend_header\n12345678";
    let cloud = read_bytes(ply("binary_big_endian", binary)).unwrap();
    assert_eq!((cloud.info.points_declared, cloud.len()), (u64::MAX, 1));
}

#[test]
fn hostile_elements_before_the_vertices_end_at_the_file() {
    for element in [
        "element a 18446744073709551615\nproperty double v\n",
        "element a 18446744073709551615\nproperty list uchar double v\n",
        "element a 1\nproperty list uint double v\n",
    ] {
        let rest = format!(
            "{element}element vertex 1\nproperty float x\nproperty float y\nend_header\n\u{7f}\u{7f}\u{7f}\u{7f}"
        );
        let e = read_bytes(ply("binary_little_endian", &rest)).unwrap_err();
        assert!(e.what().contains("of element a end outside the file"), "{e}");
    }
    let nothing =
        "element a 18446744073709551615\nelement vertex 1\nproperty char x\nproperty char y\nend_header\n\x01\x02";
    assert_eq!(read_bytes(ply("binary_little_endian", nothing)).unwrap().xyz, [[1.0], [2.0], [0.0]]);
}

#[test]
fn a_bad_number_is_named_with_its_byte_and_the_points_of_other_pieces_stay() {
    let e = &read_bytes("1 2 3\n4 five 6\n").unwrap().errors[0];
    assert_eq!(e.offset(), Some(8));
    assert!(e.what().contains("\"five\" is not a number"), "{e}");
    let e = &read_bytes("1 2 3\n4 5\n").unwrap().errors[0];
    assert_eq!(e.what(), "the line has 2 numbers, 3 are expected");
    let e = &read_bytes("1 2 3\n4 5 6 7\n").unwrap().errors[0];
    assert_eq!((e.what().as_str(), e.offset()), ("the line has more than the 3 numbers that are expected", Some(12)));
}

#[test]
fn float_colours_above_one_are_integers() {
    let header = "element vertex 2\nproperty float x\nproperty float y\nproperty float red\nproperty float green\n\
                  property float blue\nend_header\n";
    let colours = |rows: &str| read_bytes(ply("ascii", header) + rows).unwrap().values("rgb");
    assert_eq!(colours("0 0 0 0.5 1\n0 0 1 0 0\n"), [0.0, 32768.0, 65535.0, 65535.0, 0.0, 0.0]);
    assert_eq!(colours("0 0 0 127.5 255\n0 0 1 0 0\n"), [0.0, 128.0, 255.0, 1.0, 0.0, 0.0]);
}

#[test]
fn classes_keep_their_type() {
    let header = "element vertex 2\nproperty short x\nproperty short y\nproperty short classification\nend_header\n";
    let bytes: Vec<u8> = [1i16, 2, -3, 4, 5, 300].iter().flat_map(|v| v.to_le_bytes()).collect();
    let cloud = read_bytes([ply("binary_little_endian", header).into_bytes(), bytes].concat()).unwrap();
    assert_eq!(
        (cloud.attributes().as_str(), cloud.values("classification")),
        ("classification int16x1", vec![-3.0, 300.0])
    );
}

#[test]
fn a_colour_that_does_not_fit_is_an_error() {
    let header = "element vertex 1\nproperty short x\nproperty short y\nproperty short red\nproperty short green\n\
                  property short blue\nend_header\n";
    let bytes: Vec<u8> = [1i16, 2, 3, 4, -300].iter().flat_map(|v| v.to_le_bytes()).collect();
    let bytes = [ply("binary_little_endian", header).into_bytes(), bytes].concat();
    let e = &read_bytes(&bytes).unwrap().errors[0];
    assert_eq!(
        (e.what().as_str(), e.offset()),
        ("the value -300 does not fit its column", Some(bytes.len() as u64 - 2))
    );
}

#[test]
fn columns_can_be_named_typed_and_left_out() {
    let cloud = with("1;2;3;7;8\n4;5;6;9;10\n", &["z", "-", "y", "quality:uint8", "x"], None).unwrap();
    assert_eq!(cloud.xyz, [[8.0, 10.0], [3.0, 6.0], [1.0, 4.0]]);
    assert_eq!(cloud.attributes(), "quality uint8x1");
    let e = with("1 2 3\n", &["x", "y"], None).unwrap_err();
    assert!(e.to_string().contains("2 columns are named (x, y) but the row has 3"), "{e}");
    let e = with("1 2 3\n", &["x", "y", "z:byte"], None).unwrap_err();
    assert!(e.to_string().contains("the type \"byte\" of column z is not known; types are"), "{e}");
    let e = with("1 2 3\n", &["x", "a", "z"], None).unwrap_err();
    assert!(e.to_string().contains("there is no y"), "{e}");
}

#[test]
fn a_separator_can_be_given() {
    let cloud = with("1|2|3\n4| 5 |6\n", &[], Some('|')).unwrap();
    assert_eq!(cloud.xyz[1], [2.0, 5.0]);
    assert_eq!(with("1|2|3\n", &[], None).unwrap_err().kind_name(), "Broken");
}

trait KindName {
    fn kind_name(&self) -> &'static str;
}

impl KindName for ReadError {
    fn kind_name(&self) -> &'static str {
        match self.kind() {
            pointmill_format::ErrorKind::Broken => "Broken",
            pointmill_format::ErrorKind::Unsupported => "Unsupported",
            pointmill_format::ErrorKind::Io(_) => "Io",
        }
    }
}

#[test]
fn words_in_a_column_leave_it_out_with_a_warning() {
    let cloud = read_bytes("x,y,z,name,i\n1,2,3,oak,7\n4,5,6,\"a, b\",8\n").unwrap();
    assert!(cloud.warned("column 4 (name) holds no numbers"));
    assert_eq!((cloud.attributes().as_str(), cloud.values("intensity")), ("intensity uint16x1", vec![7.0, 8.0]));
}

#[test]
fn intensity_is_a_float_where_a_sample_is_no_small_integer() {
    assert_eq!(read_bytes("1 2 3 0.5\n").unwrap().attributes(), "intensity floatx1");
    assert_eq!(read_bytes("1 2 3 70000\n").unwrap().attributes(), "intensity floatx1");
    assert_eq!(read_bytes("1 2 3 65535\n").unwrap().attributes(), "intensity uint16x1");
}

#[test]
fn a_second_header_line_and_wide_text_are_refused_with_advice() {
    let e = read_bytes("x y z\nin metres here\n1 2 3\n4 5 6\n").unwrap_err();
    assert!(e.to_string().contains("only one header line"), "{e}");
    let e = read_bytes(b"\xff\xfe1\x002\x00").unwrap_err();
    assert!(e.to_string().contains("UTF-16"), "{e}");
}

#[test]
fn a_wrong_count_in_pts_is_told() {
    assert!(read_bytes("3\n1 2 3\n4 5 6\n").unwrap().warned("declares 3 points, 2 whole ones are there"));
    let cloud = read_bytes("1\n1 2 3\n4 5 6\n").unwrap();
    assert!(cloud.warned("declares 1 points; all 2") && cloud.len() == 2);
}

#[test]
fn a_grid_that_cannot_be_and_a_cut_ptx_header_are_told() {
    let head = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    let e = read_bytes(format!("99999999999999\n99999999999999\n{head}")).unwrap_err();
    assert!(e.what().contains("cannot be"), "{e}");
    let e = read_bytes("2\n3\n0 0 0\n1 0 0\n").unwrap_err();
    assert!(e.what().contains("4 of 10 header lines"), "{e}");
    let cloud = read_bytes(format!("2\n3\n{head}1 2 3 0.5\n")).unwrap();
    assert!(cloud.warned("declares 6 points, 1 whole"), "{:?}", cloud.info);
    assert_eq!(cloud.info.points_declared, 6);
}

#[test]
fn pcd_blocks_that_cannot_be_are_refused_before_memory_is_taken() {
    let head = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 300000000\nHEIGHT 1\n\
                POINTS 300000000\nDATA binary_compressed\n";
    let mut bytes = head.as_bytes().to_vec();
    bytes.extend(4u32.to_le_bytes());
    bytes.extend(3_600_000_000u32.to_le_bytes());
    bytes.extend([1, 2, 3, 4]);
    let e = read_bytes(&bytes).unwrap_err();
    assert!(e.what().contains("cannot be in a block of 4 bytes"), "{e}");
}

#[test]
fn very_many_empty_scans_take_time_for_their_bytes_only() {
    let scan = "0\n0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    let start = std::time::Instant::now();
    let cloud = read_bytes(scan.repeat(20_000)).unwrap();
    assert_eq!((cloud.len(), cloud.info.format.as_str()), (0, "PTX, 20000 scans, 0 grid cells"));
    assert!(start.elapsed().as_secs() < 60);
}

#[test]
fn very_wide_rows_are_refused_or_come_in_small_batches() {
    let e = read_bytes("1 ".repeat(5000) + "\n1\n").unwrap_err();
    assert!(e.what().contains("5000 columns"), "{e}");
    let mut header = "element vertex 100000\nproperty float x\nproperty float y\n".to_owned();
    (0..4000).for_each(|i| header += &format!("property double p{i}\n"));
    let scan =
        (ROWS.open)(&files::temporary((ply("ascii", &header) + "end_header\n" + &"1\n".repeat(100_000)).as_bytes()))
            .unwrap();
    let mut scratch = pointmill_format::Scratch::default();
    let result = scan.decode(0, &Wanted::all(scan.info()), &mut scratch, &mut |_| ControlFlow::Continue(()));
    assert!(result.unwrap_err().what().contains("the line has 1 numbers, 4002 are expected"));
    let batch = scratch.batch.unwrap();
    assert!(batch.columns.iter().map(|c| c.len() * 8).sum::<usize>() <= 64 << 20);
}

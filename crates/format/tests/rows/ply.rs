//! PLY headers and bodies as programs in the field write them, each with its right values.

use crate::common::read_bytes;

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";

fn ply(kind: &str, rest: &str) -> String {
    format!("ply\nformat {kind} 1.0\n{rest}end_header\n")
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

#[test]
fn any_line_ends_of_the_header_are_read_and_data_may_begin_with_a_line_feed() {
    let first = f32::from_le_bytes([0x0a, 0x0d, 0x20, 0x41]);
    let points = [first, 2.0, 3.0, 4.0, 5.0, 6.0];
    let header = ply("binary_little_endian", &format!("comment a\nelement vertex 2\n{XYZ}"));
    for end in ["\n", "\r\n", "\r"] {
        let head = header.replace('\n', end);
        let cloud = read_bytes([head.as_bytes(), &floats(&points)].concat()).unwrap();
        assert_eq!(cloud.xyz[0], [f64::from(first), 4.0], "{end:?}");
        assert!(cloud.info.warnings.is_empty(), "{end:?}: {:?}", cloud.info.warnings);
        // cut short, and with faces: the length decides nothing, the lines before do
        let cloud = read_bytes([head.as_bytes(), &floats(&points)[..20]].concat()).unwrap();
        assert_eq!(cloud.xyz[0], [f64::from(first)], "{end:?}");
        let faces = format!("{XYZ}element face 1\nproperty list uchar int vertex_indices\n");
        let head = header.replace(XYZ, &faces).replace('\n', end);
        let bytes = [head.as_bytes(), &floats(&points), &[1, 0, 0, 0, 0]].concat();
        assert_eq!(read_bytes(&bytes).unwrap().xyz[0], [f64::from(first), 4.0], "{end:?}");
    }
}

#[test]
fn where_line_ends_are_mixed_the_length_decides() {
    let header = ply("binary_big_endian", &format!("element vertex 1\n{XYZ}"));
    let data: Vec<u8> = [8.5f32, 2.0, 3.0].iter().flat_map(|v| v.to_be_bytes()).collect();
    let line_feed = f32::from_be_bytes([0x0a, 1, 2, 3]);
    let begins_with_lf: Vec<u8> = [line_feed, 2.0, 3.0].iter().flat_map(|v| v.to_be_bytes()).collect();
    // CR lines, but CR LF at the end; LF lines, but CR at the end
    let cr = header.replace('\n', "\r") + "\n";
    assert_eq!(read_bytes([cr.as_bytes(), &data].concat()).unwrap().xyz[0], [8.5]);
    let lf = header.trim_end().to_owned() + "\r";
    assert_eq!(read_bytes([lf.as_bytes(), &data].concat()).unwrap().xyz[0], [8.5]);
    assert_eq!(read_bytes([lf.as_bytes(), &begins_with_lf].concat()).unwrap().xyz[0], [f64::from(line_feed)]);
    let mixed = header.replacen('\n', "\r\n", 2).replacen("y\n", "y\r", 1);
    assert_eq!(read_bytes([mixed.as_bytes(), &data].concat()).unwrap().xyz[0], [8.5]);
}

#[test]
fn odd_but_legal_headers_are_read() {
    let header = "\u{feff}ply  \nobj_info num_cols 2\nformat   ascii\t1.0\ncomment\nelement\tcamera 1\n\
                  property list uchar int pixels\nelement  Vertex   2 \nproperty  FLOAT32  X\nproperty Double y\n\
                  property LIST uchar int tags\nproperty Float z\nproperty UChar Red\nproperty uint8 Green\n\
                  property uchar BLUE\n  end_header  \n2 8 9\n1 2 0 3 10 20 30\n4 5 2 7 7 6 40 50 60\n";
    let cloud = read_bytes(header).unwrap();
    assert_eq!(cloud.xyz, [[1.0, 4.0], [2.0, 5.0], [3.0, 6.0]]);
    assert_eq!((cloud.values("rgb"), cloud.info.warnings.len()), (vec![10.0, 20.0, 30.0, 40.0, 50.0, 60.0], 0));
}

/// A cloud of 3 coloured points as rows of numbers, and its right values.
const ROWS: [&str; 3] =
    ["-0.729748 0.578763 -1.0109 125 137 139", "1 2 3 4 5 6", "-0.725628 0.583082 -1.01844 122 137 132"];
const COLOURED: &str = "property float32 x\nproperty float32 y\nproperty float32 z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n";

#[test]
fn a_row_may_take_several_lines_or_share_one() {
    let header = ply("ascii", &format!("element vertex 3\n{COLOURED}"));
    let wrapped: String =
        ROWS.iter().flat_map(|r| r.split(' ')).enumerate().fold(String::new(), |text, (i, number)| {
            // "x y z", then "r g b", as a depth camera's program writes it; the line ends are blanks before others
            text + number + if i % 3 == 2 { " \n" } else { " " }
        });
    let each_its_own = ROWS.join(" ").replace(' ', "\n");
    for (what, body) in [
        ("one a line", ROWS.join("\n")),
        ("wrapped", wrapped),
        ("all on one line", ROWS.join(" ")),
        ("two, then one", ROWS.join(" ").replacen(" 1 2 3", "\n1 2 3", 1)),
        ("a number a line", each_its_own.clone()),
        ("the same with CR LF", each_its_own.replace('\n', "\r\n")),
        ("rows that end with CR", ROWS.join("\r")),
        ("all kinds of line ends, and empty lines", format!("\r\n\n{}\r{}\r\n\n{}\n", ROWS[0], ROWS[1], ROWS[2])),
    ] {
        let cloud = read_bytes(format!("{header}{body}")).unwrap();
        assert!(cloud.errors.is_empty() && cloud.info.warnings.is_empty(), "{what}: {:?}", cloud.errors);
        assert_eq!(cloud.xyz[0], [-0.729748, 1.0, -0.725628], "{what}");
        assert_eq!(cloud.xyz[2], [-1.0109, 3.0, -1.01844], "{what}");
        assert_eq!(cloud.values("rgb"), [125.0, 137.0, 139.0, 4.0, 5.0, 6.0, 122.0, 137.0, 132.0], "{what}");
    }
    // the header, too, ends its lines with CR
    let cloud = read_bytes(format!("{header}{}\n", ROWS.join("\n")).replace('\n', "\r")).unwrap();
    assert_eq!((cloud.xyz[1].as_slice(), cloud.errors.len()), ([0.578763, 2.0, 0.583082].as_slice(), 0));
}

#[test]
fn a_stream_has_its_other_elements_and_lists() {
    let header = ply(
        "ascii",
        "element camera 1\nproperty float a\nproperty float b\nelement vertex 2\nproperty float x\nproperty float y\n\
         property list uchar int tags\nproperty float z\nelement face 2\nproperty list uchar int vertex_indices\n",
    );
    let cloud = read_bytes(header.clone() + "7\n8\n1 2\n2 9 9 3\n4 5 0\n6\n3 0 1 1 3\n0 1 0\n").unwrap();
    assert_eq!((cloud.xyz, cloud.info.warnings.len()), ([vec![1.0, 4.0], vec![2.0, 5.0], vec![3.0, 6.0]], 0));
    // the camera alone is wrapped: lines would make its second number a point
    let cloud = read_bytes(header + "7\n8\n1 2 2 9 9 3\n4 5 0 6\n3 0 1 1\n3 0 1 0\n").unwrap();
    assert_eq!(cloud.xyz[2], [3.0, 6.0]);
}

#[test]
fn a_stream_that_is_cut_gives_its_whole_rows_and_lines_of_too_few_or_many_numbers_are_errors() {
    let header = ply("ascii", &format!("element vertex 3\n{COLOURED}"));
    let cloud = read_bytes(format!("{header}-0.5 0.25 1\n10 20 30\n1 2 3\n4 5 6\n7 8 9\n")).unwrap();
    assert_eq!((cloud.len(), cloud.values("rgb")), (2, vec![10.0, 20.0, 30.0, 4.0, 5.0, 6.0]));
    assert!(cloud.warned("declares 3 points, 2 whole ones are there: 1 are missing") && cloud.errors.is_empty());
    // no colours in rows of a header that has them, and more columns than the header has
    let few = read_bytes(format!("{header}1 2 3\n4 5 6\n7 8 9\n")).unwrap();
    assert_eq!(few.errors[0].what(), "the line has 3 numbers, 6 are expected");
    let many = read_bytes(format!("{header}{}", ROWS.join(" 255\n") + " 255\n")).unwrap();
    assert_eq!(many.errors[0].what(), "the line has more than the 6 numbers that are expected");
}

#[test]
fn a_long_file_that_wraps_late_is_read_as_a_stream() {
    let header = ply("ascii", "element vertex 300000\nproperty double x\nproperty double y\nproperty double z\n");
    let rows: String =
        (0..300_000).map(|i| format!("{i}.25 100000.5{}{i}\n", if i < 5000 { ' ' } else { '\n' })).collect();
    let cloud = read_bytes(header + &rows).unwrap();
    assert_eq!((cloud.len(), cloud.errors.len()), (300_000, 0));
    assert!(cloud.xyz[0].iter().zip(0..).all(|(x, i)| *x == f64::from(i) + 0.25));
    assert!(cloud.xyz[2].iter().zip(0..).all(|(z, i)| *z == f64::from(i)));
}

#[test]
fn points_beyond_the_declared_ones_are_told() {
    let binary = ply("binary_little_endian", &format!("element vertex 1\n{XYZ}"));
    let cloud = read_bytes([binary.as_bytes(), &floats(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0])].concat()).unwrap();
    assert!(cloud.len() == 1 && cloud.warned("declares 1 points; the 12 bytes that follow them are not read"));
    let ascii = ply("ascii", &format!("element vertex 1\n{XYZ}"));
    let cloud = read_bytes(ascii + "1 2 3\n4 5 6\n").unwrap();
    assert!(cloud.len() == 1 && cloud.warned("the 6 bytes that follow them are not read"));
}

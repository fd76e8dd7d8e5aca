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

/// Two splats of one chunk from (0,0,0) to (1,1,1): the least and the greatest.
fn compressed(chunk: &str, bounds: &[f32], vertex: &str) -> Vec<u8> {
    let head = ply("binary_little_endian", &format!("{chunk}element vertex 2\n{vertex}"));
    let splats = [0, 0, 0, 0x0080_ff40u32, u32::MAX, u32::MAX, u32::MAX, u32::MAX];
    [head.into_bytes(), floats(bounds), splats.iter().flat_map(|v| v.to_le_bytes()).collect()].concat()
}

fn of_floats(names: &[&str]) -> String {
    names.iter().map(|name| format!("property float {name}\n")).collect()
}

const BOUNDS: [&str; 12] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
];
const VALUES: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, -5.0, -6.0, -7.0, 1.0, 2.0, 3.0];
const PACKED: &str = "property uint packed_position\nproperty uint packed_rotation\nproperty uint packed_scale\nproperty uint packed_color\n";

#[test]
fn compressed_splats_are_unpacked_with_and_without_bounds_of_colours() {
    let chunk = format!("element chunk 1\n{}", of_floats(&BOUNDS));
    let cloud = read_bytes(compressed(&chunk, &VALUES, PACKED)).unwrap();
    assert_eq!(cloud.xyz, [[0.0, 1.0], [0.0, 1.0], [0.0, 1.0]]);
    assert_eq!(cloud.values("rgb"), [0.0, 128.0, 255.0, 255.0, 255.0, 255.0]);
    assert_eq!((cloud.values("alpha"), cloud.values("scale_1")), (vec![64.0, 255.0], vec![-6.0, 2.0]));
    assert_eq!(cloud.info.format, "PLY 1.0, binary little-endian, compressed splats");
    // red of 0.5 to 1, green beyond both ends, blue of 0 alone
    let colours = ["min_r", "min_g", "min_b", "max_r", "max_g", "max_b"];
    let chunk = format!("{chunk}{}", of_floats(&colours));
    let values = [VALUES.as_slice(), &[0.5, -1.0, 0.0, 1.0, 2.0, 0.0]].concat();
    let cloud = read_bytes(compressed(&chunk, &values, PACKED)).unwrap();
    assert_eq!(cloud.values("rgb"), [128.0, 129.0, 0.0, 255.0, 255.0, 0.0]);
    assert!(cloud.warned("it is made from the splats' harmonics") && cloud.info.warnings.len() == 1);
}

#[test]
fn compressed_splats_of_another_layout_are_named_and_not_called_damaged() {
    let chunk = format!("element chunk 1\n{}", of_floats(&BOUNDS));
    let named = |bytes: &[u8], why: &str| {
        let e = read_bytes(bytes).unwrap_err();
        assert!(matches!(e.kind(), pointmill_format::ErrorKind::Unsupported), "{e}");
        assert!(e.to_string().contains("its points are compressed splats") && e.what().contains(why), "{e}");
    };
    named(&compressed("", &[], PACKED), "without the element chunk");
    named(&compressed(&chunk.replace("min_z", "low_z"), &VALUES, PACKED), "whose chunks have no min_z or max_z");
    named(&compressed(&chunk, &VALUES, &PACKED.replace("uint packed_color", "ushort packed_color")), "packed_color");
    named(&compressed(&chunk, &VALUES, &format!("{PACKED}property uint packed_normal\n")), "not known");
    let text = String::from_utf8_lossy(&compressed(&chunk, &[], PACKED)).replace("binary_little_endian", "ascii");
    named(text.as_bytes(), "as text");
    let few = compressed(&chunk, &VALUES, PACKED);
    let few = String::from_utf8_lossy(&few).replace("vertex 2", "vertex 257");
    assert!(read_bytes(few).unwrap_err().what().contains("257 splats need 2 chunks, 1 are declared"));
    // cut short within the second
    let whole = compressed(&chunk, &VALUES, PACKED);
    let cloud = read_bytes(&whole[..whole.len() - 1]).unwrap();
    assert!(cloud.len() == 1 && cloud.warned("declares 2 points, 1 whole ones are there"));
}

#[test]
fn harmonics_colour_splats_that_have_no_other_colour() {
    let names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"];
    let rows = "0 0 0 1.7724539 -1.7724539 0 0.5\n1 1 1 0.25 9 nan -2\n";
    let header = |more: &str| ply("ascii", &format!("element vertex 2\n{}{more}", of_floats(&names)));
    let cloud = read_bytes(header("") + rows).unwrap();
    assert_eq!(cloud.attributes(), "rgb uint16x3, f_dc_0 floatx1, f_dc_1 floatx1, f_dc_2 floatx1, opacity floatx1");
    assert_eq!(cloud.values("rgb"), [255.0, 0.0, 128.0, 145.0, 255.0, 0.0]);
    assert_eq!(
        (cloud.values("f_dc_0"), cloud.values("opacity")),
        (vec![f64::from(1.772_453_9f32), 0.25], vec![0.5, -2.0])
    );
    assert!(cloud.warned("0.5 + 0.28209479 · f_dc"));
    // a colour of their own comes first
    let rows = "0 0 0 1.7 -1.7 0 0.5 1 2 3\n1 1 1 0 9 0 -2 4 5 6\n";
    let own = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let cloud = read_bytes(header(own) + rows).unwrap();
    assert_eq!((cloud.values("rgb"), cloud.info.warnings.len()), (vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 0));
}

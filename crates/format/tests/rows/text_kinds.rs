//! Text as spreadsheets, statistics programs and scanners write it: decimal commas, titles, row numbers, counts.

use pointmill_format::scan::text::{self, TextOptions};
use pointmill_format::{Advice, Decimal, ReadError, Wanted};
use pointmill_testkit::files;
use pointmill_testkit::reader::{self, Cloud};

use crate::common::read_bytes;

fn with(bytes: &str, options: &TextOptions) -> Result<Cloud, ReadError> {
    let file = files::temporary(bytes.as_bytes());
    let scan = text::open(&file, options)?;
    Ok(reader::read(scan.as_ref(), &Wanted::all(scan.info())))
}

/// The points of a file that reads without errors.
fn points(bytes: &str) -> Vec<[f64; 3]> {
    let cloud = read_bytes(bytes).unwrap_or_else(|e| panic!("{bytes}: {e}"));
    assert!(cloud.errors.is_empty(), "{bytes}: {:?}", cloud.errors);
    let [x, y, z] = &cloud.xyz;
    x.iter().zip(y).zip(z).map(|((x, y), z)| [*x, *y, *z]).collect()
}

#[test]
fn decimal_commas_are_read_between_blanks_tabs_and_semicolons() {
    let expected = [[345678.123, 5432109.456, 87.25], [345679.125, -5432110.5, 88.0]];
    for bytes in [
        "345678,123 5432109,456 87,250\n345679,125 -5432110,500 88,000\n",
        "345678,123\t5432109,456\t87,25\r\n345679,125\t-5432110,5\t88\r\n",
        "X;Y;Z\n345678,123;5432109,456;87,25\n345679,125;-5432110,5;8,8e1\n",
        "\u{feff}//X, Y, Z\n345678,123  5432109,456 \t87,25\n345679,125 -5432110,5 88\n",
        "\"345678,123\",\"5432109,456\",\"87,25\"\n\"345679,125\",\"-5432110,5\",\"88\"\n",
        "2\n345678,123 5432109,456 87,25\n345679,125 -5432110,5 88\n",
    ] {
        assert_eq!(points(bytes), expected, "{bytes}");
        assert!(read_bytes(bytes).unwrap().warned("commas are decimal marks, as in 345678,123"), "{bytes}");
    }
    let cloud = read_bytes("x;y;z;i;scalar_q\n1,5;2,5;3,5;7;0,25\n").unwrap();
    assert_eq!((cloud.values("intensity"), cloud.values("scalar_q")), (vec![7.0], vec![0.25]));
}

#[test]
fn the_decimal_mark_can_be_given() {
    let comma = TextOptions::default().decimal(Decimal::Comma);
    let cloud = with("1,5, 2,5, 3,5\n", &comma).unwrap();
    assert_eq!(cloud.xyz, [[1.5], [2.5], [3.5]]);
    assert!(cloud.info.warnings.is_empty(), "what was asked for is no news: {:?}", cloud.info.warnings);
    let cloud = with("1,234 5,678 87\n", &comma).unwrap();
    assert_eq!(cloud.xyz, [[1.234], [5.678], [87.0]]);
    let point = TextOptions::default().decimal(Decimal::Point);
    let cloud = with("1,5 2,5 3,5\n", &point).unwrap();
    assert_eq!((cloud.xyz, cloud.info.attributes.len()), ([vec![1.0], vec![5.0], vec![2.0]], 1));
}

#[test]
fn commas_that_cannot_be_told_are_an_error() {
    for bytes in ["1,2 3\n4,5 6\n", "1,5, 2,5, 3,5\n", "1,234;5,678;87\n", "345678,123 5432109.456 87\n"] {
        let error = read_bytes(bytes).unwrap_err();
        assert_eq!((error.advice(), error.offset()), (Some(&Advice::DecimalMark), Some(0)), "{bytes}: {error}");
    }
}

#[test]
fn rows_of_another_shape_are_errors_and_no_other_values() {
    let usual = "1.5,2.5,3.5\n".repeat(40);
    let other = |rows: &str, odd: &str| read_bytes(rows.repeat(20_000) + odd).unwrap().errors[0].to_string();
    assert!(other(&usual, "1,5 2\n").contains("\"5 2\" is not a number"));
    let error = other("1,5 2,5 3,5\n", "1.5 2,5 3\n");
    assert!(error.contains("\"1.5\" is not a number with a decimal comma"), "{error}");
    let error = other("1 2 3\n", "1,5 2,5 3,5\n");
    assert!(
        error.contains("\"1,5\" is not a number") && error.contains("say whether commas are decimal marks"),
        "{error}"
    );
}

#[test]
fn a_column_that_numbers_the_rows_is_omitted() {
    for bytes in [
        ",x,y,z,intensity\n0,1.5,2.5,3.5,10\n1,4.5,5.5,6.5,20\n",
        "\"\",\"x\",\"y\",\"z\",\"intensity\"\n\"1\",1.5,2.5,3.5,10\n\"2\",4.5,5.5,6.5,20\n",
        "\"x\" \"y\" \"z\" \"intensity\"\n\"1\" 1.5 2.5 3.5 10\n\"2\" 4.5 5.5 6.5 20\n",
        "x y z intensity\n1 1.5 2.5 3.5 10\n2 4.5 5.5 6.5 20\n",
        "Unnamed: 0;x;y;z;i\n17;1,5;2,5;3,5;10\n19;4,5;5,5;6,5;20\n",
        ",0,1,2,3\n0,1.5,2.5,3.5,10\n1,4.5,5.5,6.5,20\n",
        "0,1.5,2.5,3.5,10\n1,4.5,5.5,6.5,20\n",
        "\"\" \"x\" \"y\" \"z\" \"i\"\n\"a\" 1.5 2.5 3.5 10\n\"b\" 4.5 5.5 6.5 20\n",
    ] {
        assert_eq!(points(bytes), [[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]], "{bytes}");
        let cloud = read_bytes(bytes).unwrap();
        assert!(cloud.warned("column 1 numbers or names the rows; it is omitted"), "{bytes}");
        assert_eq!(cloud.info.attributes.len(), 1, "{bytes}");
        assert_eq!(cloud.values("intensity"), [10.0, 20.0], "{bytes}");
    }
}

#[test]
fn a_first_column_with_values_of_its_own_is_kept() {
    let cloud = read_bytes(",x,y,z\n0.5,1,2,3\n0.75,4,5,6\n").unwrap();
    assert_eq!(cloud.values("column 1"), [0.5, 0.75]);
    let cloud = read_bytes("id,x,y,z\n1,1.5,2.5,3.5\n2,4.5,5.5,6.5\n").unwrap();
    assert_eq!(cloud.values("id"), [1.0, 2.0]);
    assert_eq!(points("0 1 2 3\n1 4 5 6\n"), [[0.0, 1.0, 2.0], [1.0, 4.0, 5.0]]);
}

#[test]
fn titles_of_numbers_are_no_point() {
    let cloud = read_bytes("0,1,2\n1.5,2.5,3.5\n4.5,5.5,6.5\n").unwrap();
    assert_eq!((cloud.len(), cloud.xyz[0][0]), (2, 1.5));
    assert!(cloud.warned("the first line (0,1,2) has titles of columns, no point"));
    assert_eq!(read_bytes("0,1,2\n3,4,5\n").unwrap().len(), 2);
}

#[test]
fn titles_a_count_and_rows_make_a_pts() {
    let rows = "1.5;2.5;3.5;1;0.5;0;0.514534\n4.5;5.5;6.5;0;0;1;0.25\n";
    for head in ["//X;Y;Z;Rf;Gf;Bf;Intensity\n2\n", "2\n//X;Y;Z;Rf;Gf;Bf;Intensity\n", "X;Y;Z;R;G;B;Intensity\n2\n"] {
        let cloud = read_bytes(format!("{head}{rows}")).unwrap();
        assert_eq!((cloud.info.format.as_str(), cloud.info.points_declared), ("PTS, 7 columns", 2), "{head}");
        assert_eq!(cloud.xyz, [[1.5, 4.5], [2.5, 5.5], [3.5, 6.5]], "{head}");
        assert_eq!(cloud.values("rgb"), [65535.0, 32768.0, 0.0, 0.0, 0.0, 65535.0], "{head}");
        assert_eq!(cloud.values("intensity"), [f64::from(0.514534f32), 0.25], "{head}");
        assert!(cloud.info.warnings.is_empty(), "{:?}", cloud.info.warnings);
    }
    let pure = read_bytes("//X Y Z Rf Gf Bf\n1 2 3 1 0 1\n").unwrap();
    assert_eq!(pure.values("rgb"), [65535.0, 0.0, 65535.0], "by name, whatever the values");
}

#[test]
fn intensities_of_pts_are_shifted_only_if_one_is_negative() {
    let intensity = |bytes: &str| {
        let cloud = read_bytes(bytes).unwrap();
        let (_, attribute) = cloud.info.attribute("intensity").unwrap();
        (cloud.values("intensity"), attribute.description.contains("+ 2048"))
    };
    assert_eq!(intensity("2\n1 2 3 0 9 9 9\n1 2 3 62 9 9 9\n"), (vec![0.0, 62.0], false));
    assert_eq!(intensity("1 2 3 0 9 9 9\n1 2 3 62 9 9 9\n"), (vec![0.0, 62.0], false));
    assert_eq!(intensity("2\n1 2 3 -2048\n1 2 3 2047\n"), (vec![0.0, 4095.0], true));
    assert_eq!(intensity("2\n1 2 3 -3000\n1 2 3 2047\n"), (vec![-3000.0, 2047.0], false));
    assert_eq!(intensity("2\n1 2 3 0\n1 2 3 65535\n"), (vec![0.0, 65535.0], false));
}

#[test]
fn names_of_other_programs_are_matched() {
    let cloud =
        read_bytes("\"Points:0\",\"Points:1\",\"Points:2\",\"Normals:0\",\"Intensity\"\n1.5,2.5,3.5,0,7\n").unwrap();
    assert_eq!(cloud.xyz, [[1.5], [2.5], [3.5]]);
    assert_eq!(cloud.attributes(), "intensity uint16x1, Normals:0 doublex1");
    assert_eq!(points("lat,lon,height\n48.5,9.25,400\n"), [[9.25, 48.5, 400.0]]);
    assert_eq!(points("Northing;Easting;Elevation [m]\n48,5;9,25;400\n"), [[9.25, 48.5, 400.0]]);
    assert_eq!(points("X,x,y,z\n1,1.5,2.5,3.5\n"), [[1.5, 2.5, 3.5]]);
    assert!(read_bytes("X,Y,X\n1,2,3\n").unwrap().warned("column 3 (X) is called like a coordinate"));
}

#[test]
fn values_that_are_not_what_the_title_says_are_attributes() {
    let cloud = read_bytes("x y z r g b class\n1 2 3 -4 5 6 300\n").unwrap();
    assert_eq!(cloud.attributes(), "classification int16x1, r doublex1, g doublex1, b doublex1");
    assert!(cloud.warned("column 4 (r) holds values that are none of that kind"));
    let cloud = read_bytes("1 2 3 -0.5 7 8\n").unwrap();
    assert_eq!(cloud.attributes(), "column 4 doublex1, column 5 doublex1, column 6 doublex1");
}

#[test]
fn missing_values_and_quotes_are_read() {
    let cloud = read_bytes("x,y,z,q\n1,2,3,\n4,5,6,\"7\"\nNA,8,9,NULL\n").unwrap();
    assert!(cloud.errors.is_empty(), "{:?}", cloud.errors);
    assert!(cloud.xyz[0][2].is_nan() && cloud.values("q")[0].is_nan() && cloud.values("q")[2].is_nan());
    assert_eq!(cloud.values("q")[1], 7.0);
    let cloud = read_bytes("x,y,z,when\n1,2,3,2020-01-01 12:00:00\n4,5,6,\"2020, \"\"later\"\"\"\n").unwrap();
    assert!(cloud.errors.is_empty() && cloud.warned("column 4 (when) holds no numbers"), "{:?}", cloud.errors);
    assert_eq!(points("x;y;z;\n1;2;3;\n"), [[1.0, 2.0, 3.0]]);
}

#[test]
fn a_damaged_row_is_an_error_wherever_it_stands() {
    for bytes in
        ["1,five,3\n4,5,6\n7,8,9\n", "4,5,6\n1,five,3\n7,8,9\n", "1.2.3 4 5\n1 2 3\n4 5 6\n", "1 234.5;2;3\n4;5;6\n"]
    {
        let cloud = read_bytes(bytes).unwrap();
        assert_eq!((cloud.errors.len(), cloud.info.warnings.len()), (1, 0), "{bytes}: {:?}", cloud.info.warnings);
    }
}

#[test]
fn points_may_have_names() {
    let cloud = read_bytes("name,x,y,z\nP1,1.5,2.5,3.5\nP2,4.5,5.5,6.5\n").unwrap();
    assert_eq!(cloud.xyz, [[1.5, 4.5], [2.5, 5.5], [3.5, 6.5]]);
    assert!(cloud.warned("column 1 (name) holds no numbers"));
}

#[test]
fn lines_may_end_with_cr() {
    assert_eq!(points("1 2 3\r4 5 6\r"), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    assert_eq!(points("x;y;z\r1,5;2,5;3,5"), [[1.5, 2.5, 3.5]]);
    assert_eq!(points("2\r1 2 3\r4 5 6"), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
}

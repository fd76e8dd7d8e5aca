//! Points as lines of numbers: XYZ, TXT, CSV, ASC; PTS; PTX; OFF; OBJ.
//!
//! [`open`] detects the five kinds by content ([`kind`]), counts the lines (one pass over the newlines, so that
//! every piece knows the number of its first point) and looks at some thousand rows to learn what the columns hold.
//!
//! **Separator and decimal mark** (`dialect.rs`), by a sample of the rows: `;` if the first row has one, else `,`, else
//! blanks and tabs; a comma is a decimal mark where that alone makes numbers of all fields, and an error where it may be
//! both. An empty field is NaN, quotes around a field are dropped. Lines that start with `#`, `//` or `%` are comments.
//!
//! **Columns**, first what applies:
//! 1. [`TextOptions::columns`];
//! 2. titles (`titles.rs`): a line with less than two numbers, or a comment that names x and y. A first column that
//!    numbers the rows and has no title is skipped (`index_column.rs`);
//! 3. their number: 3 are x y z; 4 x y z intensity; 6 x y z and r g b, or a normal where all sampled ones have length
//!    1; 7 x y z intensity r g b, or x y z r g b intensity where columns 4–6 are whole numbers of 0–255 and one of 5–7
//!    is not; 9 x y z r g b and a normal; 10 x y z intensity r g b and a normal. With any other number, and where the
//!    values are no colours, those from the fourth on become attributes "column 4", ….
//!
//! **Values**: positions are doubles. Colours are "rgb" of `uint16`, as they are (rounded) or, where no sample is
//! above 1 and one is no whole number, 0–1 as 0–65535. Intensity is `uint16` if all samples are whole numbers of
//! 0–65535, else `float`. In PTS whole numbers of −2048…2047 become 0–4095 if one is negative. Classification is
//! `uint8`, or the least of `int16` and `int32` that holds all samples, everything else `double`, or what the name says after a colon (`quality:uint8`, Potree's type names). A
//! later row that does not fit is an error, never a guess.
//!
//! **PTS**: lines with one whole number are counts (a file may have several). **PTX**: the matrix of each scan is applied
//! in double precision; grid cells at 0 0 0 are places without a point, not points; with more than one scan, "point
//! source id" is the index of a point's scan. **OFF**: vertices with the colours and normals of COFF, NOFF, CNOFF and
//! STOFF; faces are not read. **OBJ**: the vertices `v x y z [w] [r g b]`; the weight w, faces, lines, normals and texture
//! coordinates are not read. Colours of 0–1 are taken as such, even if all of them are 0 or 1.
//!
//! Sources: Leica Geosystems, "PTS File Format", "PTX File Format"; Geomview manual, "OFF Files"; Alias|Wavefront,
//! "Object Files (.obj)".

mod column;
mod commas;
mod dialect;
mod head;
mod index_column;
mod obj;
mod off;
mod options;
mod pts;
mod ptx;
mod rows;
mod table;
mod title_names;
mod titles;
mod xyz;

use std::path::Path;

use crate::scan::source::Source;
use crate::{Advice, Fault, ReadError, Scan};
use rows::{filled, is_comment, is_count, number_count};

pub use options::TextOptions;

/// The kinds of text, detected by content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TextKind {
    /// Lines of numbers: XYZ, TXT, CSV, ASC.
    Xyz,
    /// Leica's, with a count line first.
    Pts,
    /// Leica's, with scan grids and matrices.
    Ptx,
    /// Geomview's object file format.
    Off,
    /// Wavefront's object files.
    Obj,
}

/// What the first bytes of a file (some kB) are, if they are text of points.
///
/// Also binary formats may hold such lines: ask for those first. A file that a user names may be opened as text without
/// this.
pub fn kind(first_bytes: &[u8]) -> Option<TextKind> {
    if is_off(first_bytes) {
        return Some(TextKind::Off);
    }
    if is_obj(first_bytes) {
        return Some(TextKind::Obj);
    }
    if is_ptx(first_bytes) {
        return Some(TextKind::Ptx);
    }
    if is_pts(first_bytes) {
        return Some(TextKind::Pts);
    }
    is_xyz(first_bytes).then_some(TextKind::Xyz)
}

/// True for OFF, with any of its prefixes.
pub fn is_off(first_bytes: &[u8]) -> bool {
    off::Keyword::find(first_bytes).is_some()
}

/// True for Wavefront OBJ: lines of its keywords alone, vertices, normals or texture coordinates among them.
pub fn is_obj(first_bytes: &[u8]) -> bool {
    obj::is_obj(first_bytes)
}

/// True for PTS: a line of one whole number, then one of three numbers or more; comments and a line of titles may stand
/// before either.
pub fn is_pts(first_bytes: &[u8]) -> bool {
    let (mut counts, mut titles) = (0, 0);
    for line in filled(first_bytes).into_iter().filter(|line| !is_comment(line)) {
        if is_count(line) {
            counts += 1;
        } else if number_count(line) >= 3 {
            return counts == 1;
        } else {
            titles += 1;
        }
        if counts > 1 || titles > 1 {
            break;
        }
    }
    false
}

/// True for PTX: two lines of one whole number each, then one of three numbers.
pub fn is_ptx(first_bytes: &[u8]) -> bool {
    let lines = filled(first_bytes);
    matches!(lines.as_slice(), [columns, rows, scanner, ..]
        if is_count(columns) && is_count(rows) && number_count(scanner) == 3)
}

/// True if most lines are rows of three numbers or more, but for a header.
pub fn is_xyz(first_bytes: &[u8]) -> bool {
    if first_bytes.contains(&0) {
        return false;
    }
    let lines = filled(first_bytes);
    let data: Vec<_> = lines.iter().filter(|l| !is_comment(l)).collect();
    let rows = data.iter().filter(|l| number_count(l) >= 3).count();
    rows > 0 && rows * 2 >= data.len().saturating_sub(1)
}

/// True for text whose first line has the titles x and y: points also where [`kind`] does not say so, because words come
/// first in each row or there are only two numbers.
pub fn has_titles(first_bytes: &[u8]) -> bool {
    !first_bytes.contains(&0) && head::titles_name_x_and_y(&filled(first_bytes)) == Some(true)
}

/// True for text that is no scan: a table whose titles are not those of points, or lines without a row of numbers.
///
/// A file that a user names may be opened all the same, with [`TextOptions::columns`].
pub fn is_other_text(first_bytes: &[u8]) -> bool {
    if first_bytes.is_empty() || first_bytes.contains(&0) {
        return false;
    }
    match kind(first_bytes) {
        Some(TextKind::Xyz) => head::titles_name_x_and_y(&filled(first_bytes)) == Some(false),
        Some(_) => false,
        // comments may be long, and the rows behind them
        None => filled(first_bytes).iter().any(|line| !is_comment(line)),
    }
}

/// Opens a file of any of the five kinds. One that is none of them by content is tried as XYZ.
///
/// # Errors
/// Not text, columns that cannot be determined or do not fit `options`, a header (PTX, OFF) that is cut short or makes
/// no sense, a line of more than 1 MiB.
pub fn open(path: impl AsRef<Path>, options: &TextOptions) -> Result<Box<dyn Scan>, ReadError> {
    let path = path.as_ref();
    let source = Source::open(path)?;
    let first = source.vec_at(0, 64 << 10)?;
    if first.is_empty() {
        return Err(ReadError::broken(path, 0, Fault::Empty).advise(Advice::WrongFile));
    }
    if first.starts_with(&[0xff, 0xfe]) || first.starts_with(&[0xfe, 0xff]) {
        return Err(ReadError::unsupported(path, "the text is UTF-16").advise("save it as UTF-8"));
    }
    if let Some(at) = first.iter().position(|b| *b == 0) {
        return Err(ReadError::broken(path, at as u64, "not text: it has zero bytes").advise(Advice::WrongFile));
    }
    match kind(&first) {
        Some(TextKind::Off) => off::open(source),
        Some(TextKind::Obj) => obj::open(source),
        Some(TextKind::Ptx) => ptx::open(source),
        Some(TextKind::Pts) => pts::open(source, options),
        Some(TextKind::Xyz) | None => xyz::open(source, options),
    }
}

/// Whether these names can be the columns of a file ([`TextOptions::columns`]).
///
/// # Errors
/// What is wrong with them, for people: x or y is missing, a name stands twice, a type is not known.
pub fn check_columns(names: &[String]) -> Result<(), String> {
    column::check(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_told_by_content() {
        let cases: [(&[u8], Option<TextKind>); 13] = [
            (b"1 2 3\n4 5 6\n", Some(TextKind::Xyz)),
            (b"\xef\xbb\xbfX,Y,Z\r\n1,2,3\r\n", Some(TextKind::Xyz)),
            (b"//X Y Z R\n1 2 3 4\n", Some(TextKind::Xyz)),
            (b"2\n1 2 3\n1 2 3\n", Some(TextKind::Pts)),
            (b"2\n3\n0 0 0\n1 0 0\n", Some(TextKind::Ptx)),
            (b"OFF\n8 6 12\n", Some(TextKind::Off)),
            (b"COFF 8 6 12\n", Some(TextKind::Off)),
            (b"# Blender\no Cube\nv 1 2 3\n", Some(TextKind::Obj)),
            (b"OFFSET of the scan\n", None),
            (b"Dear reader,\nthis is a letter of 3 lines\nand no scan\n", None),
            (b"{\"a\": [1, 2, 3]}\n", None),
            (b"1 2 3\0\n", None),
            (b"", None),
        ];
        for (bytes, expected) in cases {
            assert_eq!(kind(bytes), expected, "{:?}", String::from_utf8_lossy(bytes));
        }
        for pts in ["//X Y Z\n2\n1 2 3\n", "X;Y;Z\n2\n1;2;3\n", "2\nX Y Z\n1 2 3\n", "# a\n2\n1,5 2,5 3,5\n"] {
            assert_eq!(kind(pts.as_bytes()), Some(TextKind::Pts), "{pts}");
        }
        assert_eq!(kind(b"1,5;2,5;3,5\n"), Some(TextKind::Xyz));
    }

    #[test]
    fn tables_and_prose_are_told_from_points() {
        for other in [
            "time,temperature,humidity\n1,20.5,40\n2,21,41\n",
            "version: 1\nn_points: 2\n{\n}\n",
            "3\nwater\nO 0 0 0\nH 0 0 1\nH 0 1 0\n",
            "name;date\na;2020\n",
        ] {
            assert!(is_other_text(other.as_bytes()), "{other}");
        }
        for scan in [
            "x,y,q\n1,2,3\n",
            "1,2,3\n",
            ",0,1,2\n0,1.5,2,3\n",
            "# a\n",
            "",
            "1 2\0",
            "2\n1 2 3\n",
            "lat lon h\n1 2 3\n",
        ] {
            assert!(!is_other_text(scan.as_bytes()), "{scan}");
        }
    }
}

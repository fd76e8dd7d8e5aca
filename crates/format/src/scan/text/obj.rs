//! Wavefront OBJ: the vertices (`v x y z [w] [r g b]`). Faces, lines, normals and texture coordinates are not read.

use super::column::Column;
use super::rows::{BOM, fields, filled, is_comment, is_number};
use super::table::Table;
use crate::scan::source::Source;
use crate::scan::tabular::{LineRule, lines};
use crate::{Advice, ReadError, Scan};

/// First words of lines, but for `v`.
const KEYWORDS: [&[u8]; 23] = [
    b"vt",
    b"vn",
    b"vp",
    b"f",
    b"l",
    b"p",
    b"o",
    b"g",
    b"s",
    b"mg",
    b"mtllib",
    b"usemtl",
    b"usemap",
    b"maplib",
    b"lod",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"cstype",
    b"deg",
    b"curv",
    b"surf",
    b"end",
];

/// The least that says that a text is OBJ: nothing but its keywords, and a vertex, a normal or a texture coordinate among
/// them.
pub(super) fn is_obj(first_bytes: &[u8]) -> bool {
    let mut numbers = false;
    for line in filled(first_bytes).into_iter().filter(|line| !is_comment(line)) {
        let words = fields(line, None);
        let Some((word, values)) = words.split_first() else { continue };
        if !(*word == b"v" || KEYWORDS.contains(word)) {
            return false;
        }
        let least = if word.starts_with(b"v") { 2 } else { usize::MAX };
        numbers |= values.len() >= least && values.iter().take(2).all(|value| is_number(value));
    }
    numbers && !first_bytes.contains(&0)
}

/// True for a vertex: `v` and a blank.
fn is_vertex(line: &[u8]) -> bool {
    matches!(line.trim_ascii_start(), [b'v', b' ' | b'\t', ..])
}

/// The columns of a vertex with that many numbers behind its `v`.
fn columns(numbers: usize) -> Option<Vec<&'static str>> {
    // the keyword, and a weight, are no attributes
    let mut names = vec!["-", "x", "y", "z"];
    match numbers {
        3 => {}
        4 => names.push("-"),
        6 => names.extend(["r", "g", "b"]),
        7 => names.extend(["-", "r", "g", "b"]),
        _ => return None,
    }
    Some(names)
}

pub(super) fn open(source: Source) -> Result<Box<dyn Scan>, ReadError> {
    let start = if source.vec_at(0, 3)? == BOM { BOM.len() as u64 } else { 0 };
    let index = lines::index(&source, start, u64::MAX, is_vertex)?;
    let mut first = None;
    lines::walk(&source, start, |at, line| {
        if first.is_none() && is_vertex(line) {
            first = Some((at, line.to_vec()));
        }
        Ok(first.is_none())
    })?;
    let (first_row, row) = first.unwrap_or((start, b"v 0 0 0".to_vec()));
    let count = fields(&row, None).iter().skip(1).take_while(|field| is_number(field)).count();
    let broken = |what| ReadError::broken(source.path(), first_row, what).advise(Advice::ExportAgain);
    let names = columns(count)
        .ok_or_else(|| broken(format!("a vertex has {count} numbers, 3 or 4 are expected, or 6 or 7 with a colour")))?;
    let columns: Result<Vec<_>, _> = names.iter().map(|name| Column::named(name)).collect();
    let columns = columns.map_err(broken)?;
    let mut numeric = vec![true; names.len()];
    numeric[0] = false;
    let table = Table {
        format: format!("OBJ, {count} numbers a vertex"),
        declared: index.rows,
        pieces: index.pieces,
        rule: LineRule::new(None, is_vertex),
        warnings: Vec::new(),
        numeric,
        row_numbers: false,
        pts_intensity: false,
        unit_colours: true,
        first_row,
        source,
    };
    Ok(Box::new(table.scan(Some(columns))?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keywords_and_numbers_make_an_obj() {
        for obj in
            ["v 1 2 3\n", "# made\nmtllib a.mtl\no a\n\tv 1 2 3\nvn 0 0 1\nf 1//1 1//1 1//1\n", "vt 0.5 1\nvn 0 0 1\n"]
        {
            assert!(is_obj(obj.as_bytes()), "{obj}");
        }
        for other in ["v for victory\n", "v 1 2 3\nand more\n", "1 2 3\n", "o\n", "f 1 2 3\n", "v 1 2 3\0\n", ""] {
            assert!(!is_obj(other.as_bytes()), "{other}");
        }
    }

    #[test]
    fn the_numbers_of_a_vertex_say_what_they_are() {
        let names = |count| columns(count).map(|names| names.join(" "));
        assert_eq!(names(4).unwrap(), "- x y z -");
        assert_eq!(names(7).unwrap(), "- x y z - r g b");
        assert_eq!([2, 5, 8].map(columns), [None, None, None]);
        assert!(is_vertex(b" v\t1 2 3") && !is_vertex(b"vn 1 2 3") && !is_vertex(b"v"));
    }
}

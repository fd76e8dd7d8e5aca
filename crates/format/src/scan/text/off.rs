//! OFF: a keyword, three counts, the vertices. Faces and edges are not read.

use super::column::Column;
use super::rows::{BOM, fields, is_data, is_number};
use super::table::Table;
use crate::scan::source::Source;
use crate::scan::tabular::{LineRule, lines, reconcile};
use crate::{Advice, ReadError, Scan};

/// What the first word says of the vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Keyword {
    texture: bool,
    colours: bool,
    normals: bool,
    /// Homogeneous or n-dimensional coordinates.
    other_space: bool,
    /// Bytes from the start of the file to the end of the word.
    end: usize,
}

impl Keyword {
    pub(super) fn find(first_bytes: &[u8]) -> Option<Self> {
        let text = first_bytes.strip_prefix(BOM).unwrap_or(first_bytes);
        let (at, line) = lines::lines(text).find(|(_, line)| is_data(line))?;
        let start = line.iter().position(|b| *b > b' ')?;
        let word = fields(line, None).first().copied()?;
        let mut rest = word.strip_suffix(b"OFF")?;
        let mut take = |prefix: &[u8]| match rest.strip_prefix(prefix) {
            Some(after) => {
                rest = after;
                true
            }
            None => false,
        };
        let (texture, colours, normals) = (take(b"ST"), take(b"C"), take(b"N"));
        let other_space = take(b"4") | take(b"n");
        let end = first_bytes.len() - text.len() + at + start + word.len();
        rest.is_empty().then_some(Self { texture, colours, normals, other_space, end })
    }

    /// Names of the `count` numbers of a vertex.
    fn columns(self, count: usize) -> Option<Vec<&'static str>> {
        let mut names = vec!["x", "y", "z"];
        if self.normals {
            names.extend(["nx", "ny", "nz"]);
        }
        let left = count.checked_sub(names.len() + if self.texture { 2 } else { 0 })?;
        match left {
            0 => {}
            // also without the C: writers forget it
            3 => names.extend(["r", "g", "b"]),
            4 => names.extend(["r", "g", "b", "alpha"]),
            _ => return None,
        }
        if self.texture {
            names.extend(["s", "t"]);
        }
        Some(names)
    }
}

pub(super) fn open(source: Source) -> Result<Box<dyn Scan>, ReadError> {
    let first = source.vec_at(0, 64 << 10)?;
    let broken = |at: u64, what: String| ReadError::broken(source.path(), at, what).advise(Advice::ExportAgain);
    let keyword = Keyword::find(&first).ok_or_else(|| broken(0, "the OFF keyword is missing".to_owned()))?;
    let (counts_at, counts, start) = counts(&source, &first, keyword)?;
    if counts.first().is_some_and(|c| *c == b"BINARY") || keyword.other_space {
        let what = "binary, homogeneous and n-dimensional OFF are not read, OFF, COFF, NOFF and STOFF are";
        return Err(ReadError::unsupported(source.path(), what));
    }
    let declared: Option<u64> = counts.first().and_then(|c| std::str::from_utf8(c).ok()).and_then(|t| t.parse().ok());
    let declared = declared.ok_or_else(|| broken(counts_at, "the number of vertices is missing".to_owned()))?;
    let index = lines::index(&source, start, declared, is_data)?;
    let mut warnings = Vec::new();
    reconcile(declared, index.rows, &mut warnings);
    let head = lines::first_filled(&source, start, 1000)?;
    let row = head.into_iter().find(|(_, line)| is_data(line)).filter(|_| declared > 0);
    let (first_row, row) = row.unwrap_or((start, b"0 0 0".to_vec()));
    let count = fields(without_comment(&row), None).iter().take_while(|f| is_number(f)).count();
    let names = keyword.columns(count).ok_or_else(|| {
        broken(first_row, format!("a vertex has {count} numbers, which the keyword does not explain"))
    })?;
    let columns: Result<Vec<_>, _> = names.iter().map(|name| Column::named(name)).collect();
    let columns = columns.map_err(|what| broken(first_row, what))?;
    let table = Table {
        format: format!("OFF, {} columns", names.len()),
        declared,
        pieces: index.pieces,
        rule: LineRule::new(None, is_data),
        warnings,
        numeric: vec![true; names.len()],
        row_numbers: false,
        pts_intensity: false,
        unit_colours: false,
        first_row,
        source,
    };
    Ok(Box::new(table.scan(Some(columns))?))
}

/// The counts, behind the keyword or on the next line: their place, the counts, and where the vertices start.
fn counts<'a>(source: &Source, first: &'a [u8], keyword: Keyword) -> Result<(u64, Vec<&'a [u8]>, u64), ReadError> {
    let mut at = keyword.end;
    for (place, line) in lines::lines(&first[keyword.end..]) {
        at = keyword.end + place;
        if is_data(line) {
            let (end, _) = lines::skip(source, at as u64, 1)?;
            return Ok((at as u64, fields(without_comment(line), None), end));
        }
    }
    Err(ReadError::broken(source.path(), at as u64, "the counts of vertices and faces are missing")
        .advise(Advice::CutShort))
}

fn without_comment(line: &[u8]) -> &[u8] {
    line.split(|b| *b == b'#').next().unwrap_or(line)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_keyword_says_what_a_vertex_has() {
        let names =
            |word: &str, count| Keyword::find(word.as_bytes()).and_then(|k| k.columns(count)).map(|n| n.join(" "));
        assert_eq!(names("OFF\n", 3).unwrap(), "x y z");
        assert_eq!(names("# made\nCOFF 1 0 0\n", 7).unwrap(), "x y z r g b alpha");
        assert_eq!(names("STCNOFF", 11).unwrap(), "x y z nx ny nz r g b s t");
        assert_eq!(names("OFF", 5), None);
        assert_eq!(names("BOFF", 3), None);
    }
}

//! Where the vertices lie, behind the elements before them.

use super::header::{Element, Encoding, Header, Kind, Property};
use crate::scan::source::Source;
use crate::scan::tabular::stream::{RowShape, Rows};
use crate::scan::tabular::{self, Endian, Part, Storage, binary, lines, reconcile, text_rows, warn_of_bytes_behind};
use crate::{Advice, Piece, ReadError, ScanWarning};

/// Bytes that are read at once while lists are followed.
const WINDOW: u64 = 1 << 20;
/// Bytes after which a piece of rows with lists is closed.
const PIECE_BYTES: u64 = 8 << 20;
/// A row with lists longer than this is taken for damage.
const MAX_ROW: u64 = 64 << 20;

/// The pieces and how to read them.
pub(super) struct Placed {
    pub(super) pieces: Vec<Piece>,
    pub(super) storage: Storage,
}

/// Finds the vertices and cuts them into pieces.
pub(super) fn place(
    source: &Source,
    header: &Header,
    vertices: usize,
    properties: &[tabular::Property],
    warnings: &mut Vec<ScanWarning>,
) -> Result<Placed, ReadError> {
    let (before, vertex) = (&header.elements[..vertices], &header.elements[vertices]);
    let endian = match header.encoding {
        Encoding::Ascii => return ascii(source, header, vertices, warnings),
        Encoding::BinaryLittle => Endian::Little,
        Encoding::BinaryBig => Endian::Big,
    };
    let mut walker = Walker { source, endian, at: header.end, window: Vec::new(), window_at: 0 };
    for element in before {
        walker.pass(element)?;
    }
    let parts = parts(vertex);
    let stride = properties.iter().filter(|p| !p.list).map(|p| p.ty.size()).sum::<usize>();
    if let [Part::Plain(_)] = parts.as_slice() {
        let there = (source.len() - walker.at) / stride as u64;
        let points = reconcile(vertex.count, there, warnings);
        if there > points && vertices + 1 == header.elements.len() {
            let bytes = source.len() - walker.at - points * stride as u64;
            warnings.push(ScanWarning::BytesIgnored { declared: points, bytes });
        }
        let pieces = binary::pieces(walker.at, stride as u64, points);
        return Ok(Placed { pieces, storage: Storage::Records { stride, endian } });
    }
    let pieces = walker.pieces(&parts, vertex.count)?;
    reconcile(vertex.count, pieces.iter().map(|p| p.points).sum(), warnings);
    Ok(Placed { pieces, storage: Storage::Lists { parts, stride, endian } })
}

fn ascii(
    source: &Source,
    header: &Header,
    vertices: usize,
    warnings: &mut Vec<ScanWarning>,
) -> Result<Placed, ReadError> {
    let rows: Vec<Rows> = header.elements.iter().map(rows).collect();
    let (before, points, after) = (&rows[..vertices], &rows[vertices], &rows[vertices + 1..]);
    let found = text_rows::place(source, header.end, lines::is_filled, before, points, after)?;
    reconcile(points.count, found.rows, warnings);
    if after.is_empty() {
        warn_of_bytes_behind(source, found.end, points.count, warnings)?;
    }
    Ok(Placed { pieces: found.pieces, storage: found.storage })
}

/// The rows of an element as text.
fn rows(element: &Element) -> Rows {
    let is_list = |p: &Property| matches!(p.kind, Kind::List { .. });
    Rows { shape: RowShape(element.properties.iter().map(is_list).collect()), count: element.count }
}

/// The bytes of a row: runs of scalars, and lists between them.
fn parts(element: &Element) -> Vec<Part> {
    let mut parts = Vec::new();
    for property in &element.properties {
        match (property.kind, parts.last_mut()) {
            (Kind::Scalar(ty), Some(Part::Plain(len))) => *len += ty.size(),
            (Kind::Scalar(ty), _) => parts.push(Part::Plain(ty.size())),
            (Kind::List { count, item }, _) => parts.push(Part::List { count, item_bytes: item.size() as u64 }),
        }
    }
    parts
}

/// Follows rows through the file.
struct Walker<'a> {
    source: &'a Source,
    endian: Endian,
    at: u64,
    window: Vec<u8>,
    window_at: u64,
}

impl Walker<'_> {
    /// Passes over all rows of an element.
    fn pass(&mut self, element: &Element) -> Result<(), ReadError> {
        let parts = parts(element);
        let cut = |at| {
            let what = format!("the {} rows of element {} end outside the file", element.count, element.name);
            ReadError::broken(self.source.path(), at, what).advise(Advice::CutShort)
        };
        if let [] | [Part::Plain(_)] = parts.as_slice() {
            let stride = parts.iter().map(|p| if let Part::Plain(len) = p { *len as u64 } else { 0 }).sum();
            let end = element.count.checked_mul(stride).and_then(|len| self.at.checked_add(len));
            self.at = end.filter(|end| *end <= self.source.len()).ok_or_else(|| cut(self.source.len()))?;
            return Ok(());
        }
        for _ in 0..element.count {
            self.at = self.row_end(&parts)?.ok_or_else(|| cut(self.at))?;
        }
        Ok(())
    }

    /// Pieces of at most `count` rows with lists, those that are there whole.
    fn pieces(&mut self, parts: &[Part], count: u64) -> Result<Vec<Piece>, ReadError> {
        let mut pieces = Vec::new();
        let mut open = Piece { first_point: 0, points: 0, byte_offset: self.at, byte_len: 0 };
        for _ in 0..count {
            let Some(end) = self.row_end(parts)? else { break };
            if end - self.at > MAX_ROW {
                let what = format!("a vertex has {} bytes of lists", end - self.at);
                return Err(ReadError::broken(self.source.path(), self.at, what).advise(Advice::Damaged));
            }
            self.at = end;
            open.points += 1;
            open.byte_len = end - open.byte_offset;
            if open.points == binary::PIECE_POINTS || open.byte_len >= PIECE_BYTES {
                let next =
                    Piece { first_point: open.first_point + open.points, points: 0, byte_offset: end, byte_len: 0 };
                pieces.push(std::mem::replace(&mut open, next));
            }
        }
        if open.points > 0 {
            pieces.push(open);
        }
        Ok(pieces)
    }

    /// Where the row at the cursor ends; `None` if that is outside the file.
    fn row_end(&mut self, parts: &[Part]) -> Result<Option<u64>, ReadError> {
        let (source, endian, mut at) = (self.source, self.endian, self.at);
        for part in parts {
            let end = match *part {
                Part::Plain(len) => at.checked_add(len as u64),
                Part::List { count, item_bytes } => {
                    let Some(bytes) = self.bytes(at, count.size())? else { return Ok(None) };
                    let items = binary::count(bytes, count, endian).ok_or_else(|| {
                        ReadError::broken(source.path(), at, "a list has a negative number of items")
                            .advise(Advice::Damaged)
                    })?;
                    items.checked_mul(item_bytes).and_then(|len| at.checked_add(count.size() as u64)?.checked_add(len))
                }
            };
            let Some(end) = end.filter(|end| *end <= source.len()) else { return Ok(None) };
            at = end;
        }
        Ok(Some(at))
    }

    /// `len` bytes from `at`, through a window.
    fn bytes(&mut self, at: u64, len: usize) -> Result<Option<&[u8]>, ReadError> {
        if at + len as u64 > self.source.len() {
            return Ok(None);
        }
        let inside = at >= self.window_at && at + len as u64 <= self.window_at + self.window.len() as u64;
        if !inside {
            self.window = self.source.vec_at(at, WINDOW)?;
            self.window_at = at;
        }
        let start = (at - self.window_at) as usize;
        Ok(self.window.get(start..start + len))
    }
}

//! A scan of rows: pieces to batches, whatever the storage.

use crate::{Advice, Fault};
use std::sync::Arc;

use super::ascii::{RowParser, Separator, Tokens};
use super::binary::{self, Misfit, Rows};
use super::decimal_mark::{DecimalMark, NO_NUMBER};
use super::line_reader::LineReader;
use super::lists::{self, ListRows, Part, Window};
use super::number::Endian;
use super::planes::{Failure, PlaneRule};
use super::schema::Schema;
use crate::scan::decode::{batch_bytes, batch_points, fitting_batch, point_bytes, resize};
use crate::scan::source::Source;
use crate::{
    Attribute, Column, Piece, PointBatch, Positions, ReadError, Resolution, Scan, ScanInfo, Scratch, Sink, Wanted,
};

/// Binary rows that are read at once, so that they are still in the second-level cache when they become columns.
const READ_BYTES: usize = 128 << 10;

/// How the rows of a scan lie in its file.
#[derive(Debug)]
pub(crate) enum Storage {
    /// Records of `stride` bytes, one behind the other.
    Records { stride: usize, endian: Endian },
    /// Records with lists in them; without these they have `stride` bytes.
    Lists { parts: Vec<Part>, stride: usize, endian: Endian },
    /// All values of a property together: PCD `binary_compressed`.
    Planes(PlaneRule),
    /// Lines of numbers.
    Lines(LineRule),
    /// Records that are made from what lies in the file.
    Unpacked(Box<dyn Unpack>),
    /// Numbers set apart by blanks, among which line ends count.
    Stream,
}

/// Makes records of rows that are packed otherwise.
pub(crate) trait Unpack: std::fmt::Debug + Send + Sync {
    /// Replaces `out` by the little-endian records of `points` points; returns the bytes of one. `raw` is for its use.
    fn unpack(
        &self,
        source: &Source,
        first_point: u64,
        points: usize,
        raw: &mut Vec<u8>,
        out: &mut Vec<u8>,
    ) -> Result<usize, ReadError>;

    /// Bytes of memory that unpacking `points` points takes.
    fn bytes(&self, points: u64) -> u64;
}

/// Which lines are rows, and what happens to their points.
#[derive(Debug)]
pub(crate) struct LineRule {
    pub(crate) separator: Separator,
    /// Blanks alone do not separate where there is a separator.
    pub(crate) strict: bool,
    pub(crate) decimal: DecimalMark,
    /// Separator and decimal mark were told by a sample of the rows.
    pub(crate) sampled: bool,
    pub(crate) is_row: fn(&[u8]) -> bool,
    /// Least numbers per line; missing ones are 0.
    pub(crate) least: usize,
    /// By first point; empty if the file has none.
    pub(crate) poses: Vec<Pose>,
    /// The column that distinguishes the scans: the index of the point's pose.
    pub(crate) scan_column: Option<usize>,
}

impl LineRule {
    /// Every number of every line, as it stands there.
    pub(crate) fn new(separator: Separator, is_row: fn(&[u8]) -> bool) -> Self {
        Self {
            separator,
            strict: false,
            decimal: DecimalMark::Point,
            sampled: false,
            is_row,
            least: usize::MAX,
            poses: Vec::new(),
            scan_column: None,
        }
    }
}

impl LineRule {
    /// What is wrong with a row, with the decimal marks of the file.
    fn in_its_marks(&self, what: String) -> String {
        if self.decimal == DecimalMark::Point || !what.ends_with("is not a number") {
            return what;
        }
        let marks = what.replace('.', ",").replace(char::from(NO_NUMBER), ".");
        format!("{marks} with a decimal comma")
    }

    /// What to do about a row that does not fit. A comma in it may be meant otherwise than the sample of rows said.
    fn advice(&self, line: &[u8], what: &str) -> Advice {
        match () {
            () if !what.ends_with("is not a number") && is_beyond_the_sample(what) => Advice::WidenColumn,
            () if self.sampled && line.contains(&b',') => Advice::DecimalMark,
            () => Advice::CheckColumns,
        }
    }
}

/// Where a scanner stood: world = (x, y, z, 1) · `rows`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pose {
    pub(crate) first_point: u64,
    pub(crate) rows: [[f64; 3]; 4],
}

/// An open scan of rows.
#[derive(Debug)]
pub(crate) struct RowScan {
    pub(crate) source: Source,
    pub(crate) info: ScanInfo,
    pub(crate) pieces: Vec<Piece>,
    pub(crate) schema: Schema,
    pub(crate) storage: Storage,
}

impl RowScan {
    /// `points`: as the header declares them.
    pub(crate) fn new(source: Source, format: String, points: u64, schema: Schema, storage: Storage) -> Self {
        let info = ScanInfo {
            path: source.path().to_path_buf(),
            format,
            points_declared: points,
            bounds_declared: None,
            lattice: None,
            resolution: [Resolution::Double; 3],
            parts: Vec::new(),
            images: Vec::new(),
            rgb_is_16_bit: false,
            attributes: schema.attributes.clone().into(),
            crs: Default::default(),
            file_bytes: source.len(),
            warnings: Vec::new(),
        };
        Self { source, info, pieces: Vec::new(), schema, storage }
    }
}

impl Scan for RowScan {
    fn info(&self) -> &ScanInfo {
        &self.info
    }

    fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    fn decode(
        &self,
        piece: usize,
        wanted: &Wanted,
        scratch: &mut Scratch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError> {
        let Some(piece) = self.pieces.get(piece) else {
            let fault = Fault::NoSuchPiece { piece, pieces: self.pieces.len() };
            return Err(ReadError::unsupported(self.source.path(), fault));
        };
        self.decoder(wanted).piece(piece, scratch, sink)
    }

    fn decode_bytes(&self, wanted: &Wanted) -> u64 {
        let most = |of: fn(&Piece) -> u64| self.pieces.iter().map(of).max().unwrap_or(0);
        self.decoder(wanted).bytes(most(|piece| piece.points), most(|piece| piece.byte_len))
    }
}

impl RowScan {
    fn decoder<'a>(&'a self, wanted: &'a Wanted) -> Decoder<'a> {
        Decoder {
            source: &self.source,
            schema: &self.schema,
            attributes: &self.info.attributes,
            storage: &self.storage,
            wanted,
        }
    }
}

/// Everything that a decode looks at; a probe looks at the same rows with other columns.
pub(crate) struct Decoder<'a> {
    pub(crate) source: &'a Source,
    pub(crate) schema: &'a Schema,
    /// Those of the schema.
    pub(crate) attributes: &'a Arc<[Attribute]>,
    pub(crate) storage: &'a Storage,
    pub(crate) wanted: &'a Wanted,
}

impl Decoder<'_> {
    /// Memory that a piece of at most `points` points in `bytes` bytes takes.
    fn bytes(&self, points: u64, bytes: u64) -> u64 {
        let points = points.min(batch_points(point_bytes(self.attributes, false)) as u64);
        let batch = batch_bytes(self.attributes, false, self.wanted, points);
        batch
            + match self.storage {
                Storage::Records { stride, .. } => bytes.min(READ_BYTES.max(*stride) as u64),
                Storage::Lists { stride, .. } => bytes.min(lists::WINDOW.max(*stride as u64)) + points * *stride as u64,
                Storage::Planes(rule) => {
                    let needed = rule.needed(&self.schema.fields, self.wanted);
                    points * rule.widest(&needed) as u64 + rule.planes.reader_bytes(&needed)
                }
                Storage::Lines(_) => LineReader::bytes(bytes),
                Storage::Unpacked(unpack) => unpack.bytes(points),
                Storage::Stream => bytes,
            }
    }

    pub(crate) fn piece(&self, piece: &Piece, scratch: &mut Scratch, sink: &mut Sink<'_>) -> Result<(), ReadError> {
        let Scratch { raw, decoded, batch, .. } = scratch;
        let batch = fitting_batch(batch, self.attributes, false);
        match self.storage {
            Storage::Records { stride, endian } => self.records(piece, *stride, *endian, raw, batch, sink),
            Storage::Lists { parts, stride, endian } => {
                let rows = ListRows { parts, stride: *stride, endian: *endian };
                self.lists(piece, &rows, raw, decoded, batch, sink)
            }
            Storage::Planes(rule) => self.planes(piece, rule, decoded, batch, sink),
            Storage::Lines(rule) => self.lines(piece, rule, raw, batch, sink),
            Storage::Unpacked(unpack) => self.unpacked(piece, unpack.as_ref(), raw, decoded, batch, sink),
            Storage::Stream => self.stream(piece, raw, batch, sink),
        }
    }

    fn records(
        &self,
        piece: &Piece,
        stride: usize,
        endian: Endian,
        raw: &mut Vec<u8>,
        batch: &mut PointBatch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError> {
        let at_once = (READ_BYTES / stride).max(1);
        let mut at = piece.byte_offset;
        for (first_point, points) in batches(piece, self.schema) {
            self.prepare(batch, first_point, points);
            for first in (0..points).step_by(at_once) {
                let len = (points - first).min(at_once) * stride;
                let bytes = self.source.slice_at(at, len as u64, raw)?;
                binary::fill(Rows { bytes, stride, endian }, &self.schema.fields, self.wanted, first, batch)
                    .map_err(|m| self.misfit(at + (m.row * stride + m.at) as u64, m))?;
                at += len as u64;
            }
            if sink(batch).is_break() {
                break;
            }
        }
        Ok(())
    }

    fn lists(
        &self,
        piece: &Piece,
        rows: &ListRows<'_>,
        raw: &mut Vec<u8>,
        decoded: &mut Vec<u8>,
        batch: &mut PointBatch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError> {
        let mut bytes = Window::new(self.source, piece.byte_offset + piece.byte_len, raw);
        let mut at = piece.byte_offset;
        for (first_point, points) in batches(piece, self.schema) {
            decoded.clear();
            decoded.reserve_exact(points * rows.stride);
            for _ in 0..points {
                at = rows.compact(&mut bytes, at, decoded)?.ok_or_else(|| {
                    ReadError::broken(self.source.path(), at, "a row ends outside its piece; the file has changed")
                        .advise("convert it once nothing writes to it")
                })?;
            }
            self.prepare(batch, first_point, points);
            let filled = Rows { bytes: decoded, stride: rows.stride, endian: rows.endian };
            binary::fill(filled, &self.schema.fields, self.wanted, 0, batch)
                .map_err(|m| self.misfit(piece.byte_offset, m))?;
            if sink(batch).is_break() {
                break;
            }
        }
        Ok(())
    }

    fn unpacked(
        &self,
        piece: &Piece,
        unpack: &dyn Unpack,
        raw: &mut Vec<u8>,
        decoded: &mut Vec<u8>,
        batch: &mut PointBatch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError> {
        for (first_point, points) in batches(piece, self.schema) {
            let stride = unpack.unpack(self.source, first_point, points, raw, decoded)?;
            self.prepare(batch, first_point, points);
            let rows = Rows { bytes: decoded, stride, endian: Endian::Little };
            binary::fill(rows, &self.schema.fields, self.wanted, 0, batch)
                .map_err(|m| self.misfit(piece.byte_offset, m))?;
            if sink(batch).is_break() {
                break;
            }
        }
        Ok(())
    }

    fn planes(
        &self,
        piece: &Piece,
        rule: &PlaneRule,
        decoded: &mut Vec<u8>,
        batch: &mut PointBatch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError> {
        let fields = &self.schema.fields;
        let needed = rule.needed(fields, self.wanted);
        let mut reader = rule.planes.reader(self.source, piece.first_point, &needed)?;
        for (first_point, points) in batches(piece, self.schema) {
            self.prepare(batch, first_point, points);
            rule.fill(&mut *reader, (fields, self.wanted, &needed), points, decoded, batch).map_err(|failure| {
                match failure {
                    Failure::Misfit(misfit) => self.misfit(piece.byte_offset, misfit),
                    Failure::Read(error) => error,
                }
            })?;
            if sink(batch).is_break() {
                break;
            }
        }
        Ok(())
    }

    fn lines(
        &self,
        piece: &Piece,
        rule: &LineRule,
        raw: &mut Vec<u8>,
        batch: &mut PointBatch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError> {
        let elements: Vec<_> = self.schema.attributes.iter().map(|a| a.elements).collect();
        let Schema { fields, .. } = self.schema;
        let LineRule { separator, strict, least, .. } = *rule;
        let parser = RowParser { fields, wanted: self.wanted, separator, strict, least, elements: &elements };
        let mut points_line = Vec::new();
        let mut lines = LineReader::new(self.source, piece.byte_offset, piece.byte_offset + piece.byte_len, raw);
        for (first_point, points) in batches(piece, self.schema) {
            self.prepare(batch, first_point, points);
            for row in 0..points {
                let (at, line) = lines.next_row(rule.is_row)?.ok_or_else(|| {
                    let what = format!("{row} of {points} lines are left; the file has changed");
                    ReadError::broken(self.source.path(), piece.byte_offset, what)
                        .advise("convert it once nothing writes to it")
                })?;
                let points = rule.decimal.to_points(line, &mut points_line);
                parser.row(points, row, batch).map_err(|m| {
                    let place = at + m.at as u64;
                    let advice = rule.advice(line, &m.what);
                    self.misfit(place, Misfit { what: rule.in_its_marks(m.what), ..m }).advise(advice)
                })?;
            }
            self.pose(rule, batch);
            if sink(batch).is_break() {
                break;
            }
        }
        Ok(())
    }

    fn stream(
        &self,
        piece: &Piece,
        raw: &mut Vec<u8>,
        batch: &mut PointBatch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError> {
        let line = self.source.slice_at(piece.byte_offset, piece.byte_len, raw)?;
        let elements: Vec<_> = self.schema.attributes.iter().map(|a| a.elements).collect();
        let (fields, wanted) = (&self.schema.fields, self.wanted);
        let parser =
            RowParser { fields, wanted, separator: None, strict: false, least: usize::MAX, elements: &elements };
        let mut tokens = Tokens::of(line);
        for (first_point, points) in batches(piece, self.schema) {
            self.prepare(batch, first_point, points);
            for row in 0..points {
                parser.numbers(&mut tokens, row, batch).map_err(|m| self.misfit(piece.byte_offset + m.at as u64, m))?;
            }
            if sink(batch).is_break() {
                break;
            }
        }
        Ok(())
    }

    /// Applies the pose of the batch's scan, and names the scan.
    fn pose(&self, rule: &LineRule, batch: &mut PointBatch) {
        let scan = rule.poses.partition_point(|p| p.first_point <= batch.first_point);
        let Some(pose) = scan.checked_sub(1).and_then(|i| rule.poses.get(i)) else { return };
        if let Positions::World([xs, ys, zs]) = &mut batch.positions {
            for ((x, y), z) in xs.iter_mut().zip(ys).zip(zs) {
                [*x, *y, *z] = pose.apply([*x, *y, *z]);
            }
        }
        if let Some(Column::UInt16(ids)) = rule.scan_column.and_then(|c| batch.columns.get_mut(c)) {
            ids.fill(u16::try_from(scan - 1).unwrap_or(u16::MAX));
        }
    }

    /// Gives the batch room for `points` points.
    fn prepare(&self, batch: &mut PointBatch, first_point: u64, points: usize) {
        batch.first_point = first_point;
        batch.clear_changes();
        if let Positions::World(xyz) = &mut batch.positions {
            xyz.iter_mut().for_each(|axis| resize(axis, points));
            if self.schema.flat {
                xyz[2].fill(0.0);
            }
        }
        for (i, (column, attribute)) in batch.columns.iter_mut().zip(&self.schema.attributes).enumerate() {
            let wanted = self.wanted.is_wanted(i);
            let len = if wanted { points * attribute.elements } else { 0 };
            crate::with_column!(column, v => resize(v, len));
        }
    }

    fn misfit(&self, at: u64, misfit: Misfit) -> ReadError {
        ReadError::broken(self.source.path(), at, Fault::Row(misfit.what)).advise(Advice::CheckColumns)
    }
}

/// True for a number that is sound and does not fit the type that a sample chose for its column.
fn is_beyond_the_sample(what: &str) -> bool {
    ["does not fit", "is not an integer", "is outside"].iter().any(|words| what.contains(words))
}

/// Runs of at most a batch: first point and number of points.
fn batches(piece: &Piece, schema: &Schema) -> impl Iterator<Item = (u64, usize)> + use<> {
    let most = batch_points(point_bytes(&schema.attributes, false));
    let (first, points) = (piece.first_point, piece.points);
    (0..points).step_by(most).map(move |done| (first + done, (points - done).min(most as u64) as usize))
}

impl Pose {
    fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        let m = &self.rows;
        std::array::from_fn(|a| p[0] * m[0][a] + p[1] * m[1][a] + p[2] * m[2][a] + m[3][a])
    }
}

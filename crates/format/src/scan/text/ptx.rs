//! PTX: scan grids, each with ten lines of header.
//!
//! Columns, rows, scanner position, three scanner axes, then the four rows of the matrix that turns (x, y, z, 1) into
//! world coordinates. Cell by cell follow x, y, z, intensity and perhaps red, green, blue.

use super::column::Column;
use super::rows::{fields, is_number};
use super::table::Table;
use crate::scan::source::Source;
use crate::scan::tabular::ascii::{Tokens, parse};
use crate::scan::tabular::{LineRule, Pose, lines, reconcile};
use crate::{Advice, Attribute, AttributeType, Lattice, Piece, ReadError, Scan, ScanPart};

/// Lines of a scan before its cells.
const HEADER_LINES: usize = 10;
/// Scans of a file, each of which is described in memory.
const MAX_SCANS: usize = 100_000;
/// The columns that all PTX files have, and colour.
const COLUMNS: [&str; 7] = ["x", "y", "z", "i:float", "r", "g", "b"];

#[derive(Default)]
struct Grids {
    pieces: Vec<Piece>,
    poses: Vec<Pose>,
    /// Grid cells by the headers, cells that are there, points in them.
    declared: u64,
    cells: u64,
    points: u64,
    /// Numbers of the first cell of each scan: least and most.
    widths: Option<(usize, usize)>,
    first_row: u64,
}

pub(super) fn open(source: Source) -> Result<Box<dyn Scan>, ReadError> {
    let mut grids = Grids::default();
    let mut at = 0;
    while let Some(start) = lines::first_filled(&source, at, 1)?.first().map(|(start, _)| *start) {
        if grids.poses.len() == MAX_SCANS {
            let what = format!("there are more than {MAX_SCANS} scans in it");
            return Err(ReadError::unsupported(source.path(), what).advise("export it in several files"));
        }
        at = grids.scan(&source, start)?;
    }
    let mut warnings = Vec::new();
    reconcile(grids.declared, grids.cells, &mut warnings);
    let missing = grids.declared - grids.cells;
    let (least, most) = grids.widths.unwrap_or((4, 4));
    let columns: Result<Vec<_>, _> = COLUMNS[..most].iter().map(|name| Column::named(name)).collect();
    let columns = columns.map_err(|what| ReadError::unsupported(source.path(), what))?;
    let scans = grids.poses.len();
    let parts = grids.parts();
    let table = Table {
        format: format!("PTX, {scans} scan{}, {} grid cells", if scans == 1 { "" } else { "s" }, grids.cells),
        // cells without a point are none of the points
        declared: grids.points + missing,
        pieces: grids.pieces,
        rule: LineRule { least, poses: grids.poses, ..LineRule::new(None, is_point) },
        warnings,
        numeric: vec![true; most],
        row_numbers: false,
        pts_intensity: false,
        unit_colours: false,
        first_row: grids.first_row,
        source,
    };
    let mut scan = table.scan(Some(columns))?;
    scan.info.parts = parts;
    if scans > 1 {
        let attribute = Attribute::new("point source id", AttributeType::UInt16, 1);
        if let crate::scan::tabular::Storage::Lines(rule) = &mut scan.storage {
            rule.scan_column = Some(scan.schema.attributes.len());
        }
        scan.schema.attributes.push(attribute);
        scan.info.attributes = scan.schema.attributes.clone().into();
    }
    Ok(Box::new(scan))
}

impl Grids {
    /// The descriptions of the scans.
    fn parts(&self) -> Vec<ScanPart> {
        let ends = self.poses.iter().skip(1).map(|p| p.first_point).chain([self.points]);
        let part = |((i, pose), end): ((usize, &Pose), u64)| {
            let [x, y, z, translation] = pose.rows;
            let rotation = std::array::from_fn(|a| [x[a], y[a], z[a]]);
            let range = pose.first_point..end;
            let points = end.saturating_sub(pose.first_point);
            ScanPart { number: i + 1, name: String::new(), points, range, bounds: None, rotation, translation }
        };
        self.poses.iter().enumerate().zip(ends).map(part).collect()
    }

    /// Reads the header at `at` and passes over its cells; returns where they end.
    fn scan(&mut self, source: &Source, at: u64) -> Result<u64, ReadError> {
        let header = Header::read(source, at)?;
        let mut cutter = lines::Cutter::new(header.end, self.points);
        let (mut cells, mut points) = (0, 0);
        let mut first = None;
        let end = lines::walk(source, header.end, |at, line| {
            if cells == header.cells {
                return Ok(false);
            }
            let (cell, point) = (lines::is_filled(line), is_point(line));
            if point && first.is_none() {
                first = Some((at, line.to_vec()));
            }
            cells += u64::from(cell);
            points += u64::from(point);
            cutter.line(at, point);
            Ok(true)
        })?;
        self.pieces.extend(cutter.finish(end));
        self.poses.push(Pose { first_point: self.points, rows: header.matrix });
        self.declared = self.declared.saturating_add(header.cells);
        self.cells += cells;
        self.points += points;
        if let Some((at, line)) = first {
            self.width(source, at, &line)?;
        }
        Ok(end)
    }

    fn width(&mut self, source: &Source, at: u64, line: &[u8]) -> Result<(), ReadError> {
        let numbers = fields(line, None).iter().take_while(|f| is_number(f)).count();
        let width = match numbers {
            0..=2 => {
                let what = format!("a grid cell has {numbers} numbers, 4 or 7 are expected");
                return Err(ReadError::broken(source.path(), at, what).advise(Advice::ExportAgain));
            }
            3 => 3,
            4..=6 => 4,
            _ => 7,
        };
        let (least, most) = self.widths.unwrap_or((width, width));
        if self.widths.is_none() {
            self.first_row = at;
        }
        self.widths = Some((least.min(width), most.max(width)));
        Ok(())
    }
}

/// A line with a position that is not 0 0 0, which says that the scanner got nothing back.
fn is_point(line: &[u8]) -> bool {
    if !lines::is_filled(line) {
        return false;
    }
    // the usual point ends the question with its first digit
    let first = line.iter().find(|b| !matches!(b, b' ' | b'\t' | b'-' | b'+'));
    if first.is_some_and(|b| (b'1'..=b'9').contains(b)) {
        return true;
    }
    let mut tokens = Tokens::of(line);
    !(0..3).all(|_| !tokens.is_empty() && parse(tokens.token()) == Ok(0.0))
}

struct Header {
    cells: u64,
    matrix: [[f64; 3]; 4],
    /// First byte of the cells.
    end: u64,
}

impl Header {
    fn read(source: &Source, at: u64) -> Result<Self, ReadError> {
        let lines = lines::first_filled(source, at, HEADER_LINES)?;
        if lines.len() < HEADER_LINES {
            let what = format!("the scan that starts here has {} of {HEADER_LINES} header lines", lines.len());
            return Err(ReadError::broken(source.path(), at, what).advise(Advice::CutShort));
        }
        let [columns, rows] = [0, 1].map(|i| numbers::<1>(source, &lines[i]));
        let ([columns], [rows]) = (columns?, rows?);
        let whole = |v: f64| (v >= 0.0 && v <= u64::MAX as f64 && v.fract() == 0.0).then_some(v as u64);
        let cells = whole(columns).zip(whole(rows)).and_then(|(c, r)| c.checked_mul(r));
        let cells = cells.ok_or_else(|| {
            let what = format!("a grid of {columns} by {rows} cells cannot be");
            ReadError::broken(source.path(), at, what).advise(Advice::ExportAgain)
        })?;
        for line in &lines[2..6] {
            numbers::<3>(source, line)?;
        }
        let mut matrix = [[0.0; 3]; 4];
        for (row, line) in matrix.iter_mut().zip(&lines[6..]) {
            let [x, y, z, _] = numbers::<4>(source, line)?;
            *row = [x, y, z];
        }
        if let Some(i) = misplaced(&matrix) {
            let what = format!("row {} of the matrix places no point where coordinates can be", i + 1);
            return Err(ReadError::broken(source.path(), lines[6 + i].0, what).advise(Advice::ExportAgain));
        }
        let (end, _) = lines::skip(source, at, HEADER_LINES as u64)?;
        Ok(Self { cells, matrix, end })
    }
}

/// The first row of a matrix that takes points where no coordinate can be; the last row moves them.
fn misplaced(matrix: &[[f64; 3]; 4]) -> Option<usize> {
    let factors = Lattice::FINEST_STEP..=1.0 / Lattice::FINEST_STEP;
    matrix.iter().enumerate().position(|(i, row)| {
        let largest = row.iter().fold(0.0, |largest: f64, v| largest.max(v.abs()));
        if i == 3 { !Lattice::is_sound_offset(largest) } else { largest != 0.0 && !factors.contains(&largest) }
    })
}

/// The `N` finite numbers of a header line.
fn numbers<const N: usize>(source: &Source, (at, line): &(u64, Vec<u8>)) -> Result<[f64; N], ReadError> {
    let values: Option<Vec<f64>> =
        fields(line, None).into_iter().map(|f| parse(f).ok().filter(|v| v.is_finite())).collect();
    values.and_then(|v| v.try_into().ok()).ok_or_else(|| {
        let shown: String = String::from_utf8_lossy(line).chars().take(40).collect();
        let what = format!("the header line {shown:?} should have {N} number{}", if N == 1 { "" } else { "s" });
        ReadError::broken(source.path(), *at, what).advise(Advice::ExportAgain)
    })
}

#[cfg(test)]
mod tests {
    use super::{is_point, misplaced};

    #[test]
    fn matrices_that_place_no_point_are_found_by_their_row() {
        let turn = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [5e5, 5e6, -3.0]];
        assert_eq!(misplaced(&turn), None);
        for (row, value, expected) in [(0, 5e-310, Some(0)), (2, 1e300, Some(2)), (3, 2e30, Some(3)), (1, 1e-15, None)]
        {
            let mut odd = turn;
            odd[row] = [value; 3];
            assert_eq!(misplaced(&odd), expected, "{value:e}");
        }
    }

    #[test]
    fn zeros_in_any_spelling_are_no_point() {
        for line in ["0 0 0 0.5", "0.000 -0.0 0e0 0.5 0 0 0", " 0 0 0"] {
            assert!(!is_point(line.as_bytes()), "{line}");
        }
        for line in ["0 0 0.001 0.5", "-1 0 0 0.5", "0.0 12 0 1", "0 0", "nan nan nan 0"] {
            assert!(is_point(line.as_bytes()), "{line}");
        }
        assert!(!is_point(b"  "));
    }
}

//! Options that say where the points of the scans belong.

use std::fs::File;
use std::io::Read as _;
use std::ops::RangeInclusive;
use std::path::Path;

use clap::{Args as ClapArgs, ValueEnum};
use pointmill_crs::{CrsError, Placing, Units};
use pointmill_format::{Affine, Lattice};

use crate::crs_choice;
use crate::exit::Failure;

/// Numbers of a matrix.
const NUMBERS: usize = 16;

/// The largest factor of a row: with less or more, no step of a scan stays one that coordinates can have.
const FACTORS: RangeInclusive<f64> = Lattice::FINEST_STEP..=1e15;

/// A file of a matrix is smaller.
const MAX_MATRIX_BYTES: u64 = 64 << 10;

/// What becomes of the coordinates of the scans, in the order of the fields.
#[derive(Debug, Default, ClapArgs)]
pub(crate) struct PlacingArgs {
    /// Coordinate reference system of the scans: a proj4 string, EPSG:n or WKT [default: from the inputs]
    #[arg(long, value_name = "TEXT", help_heading = "Placing scans")]
    pub(crate) crs: Option<String>,
    /// Unit of the coordinates of the scans; they are scaled to the unit of the coordinate reference system, or to metres
    /// if there is none
    #[arg(long, value_enum, value_name = "UNIT", help_heading = "Placing scans")]
    pub(crate) units: Option<UnitsArg>,
    /// Axes of the scans: y-up turns (x, y, z) to (x, −z, y), so that z is up
    #[arg(long, value_enum, value_name = "AXES", help_heading = "Placing scans")]
    pub(crate) axes: Option<AxesArg>,
    /// Moves the points by a 4 × 4 matrix: 16 numbers row by row, separated by blanks or commas and quoted, or a text
    /// file that holds them; the last row must be 0 0 0 1
    #[arg(long, value_name = "MATRIX|FILE", allow_hyphen_values = true, help_heading = "Placing scans")]
    pub(crate) transform: Option<String>,
    /// Reprojects the points to this coordinate reference system (EPSG:n, a proj4 string or WKT), after --units, --axes
    /// and --transform
    #[arg(long, value_name = "CRS", help_heading = "Placing scans")]
    pub(crate) reproject: Option<String>,
}

/// Units that have a name here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum UnitsArg {
    /// Millimetres
    Mm,
    /// Centimetres
    Cm,
    /// Metres
    M,
    /// International feet, 0.3048 m
    Ft,
    /// US survey feet, 1200/3937 m
    UsFt,
}

/// Which axis of the scans is up, if it is not z.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum AxesArg {
    /// y, as in graphics
    YUp,
}

impl PlacingArgs {
    /// What to do with the points of every scan; `None`: nothing.
    pub(super) fn placing(&self) -> Result<Option<Placing>, Failure> {
        for (option, text) in [("--crs", &self.crs), ("--reproject", &self.reproject)] {
            text.iter().try_for_each(|text| crs_choice::check(option, text))?;
        }
        let mut placing = Placing::default();
        if let Some(units) = self.units {
            placing = placing.with_units(units.units());
        }
        if self.axes.is_some() {
            placing = placing.with_y_up();
        }
        if let Some(transform) = &self.transform {
            placing = placing.with_transform(matrix("--transform", transform)?);
        }
        if let Some(target) = &self.reproject {
            placing = placing.with_target(target).map_err(|e| refused("--reproject", &e))?;
        }
        if placing.is_nothing() {
            return Ok(None);
        }
        if let Some(crs) = self.crs.as_ref().filter(|_| self.asks_for_crs()) {
            placing = placing.with_crs(crs).map_err(|e| refused("--crs", &e))?;
        }
        Ok(Some(placing))
    }
}

impl PlacingArgs {
    /// The system of the scans is asked for its unit, or for the way from it.
    fn asks_for_crs(&self) -> bool {
        self.units.is_some() || self.reproject.is_some()
    }

    /// Where nothing is written, a system that is not asked for is a mistake.
    pub(crate) fn refuse_idle_crs(&self) -> Result<(), Failure> {
        if self.crs.is_some() && !self.asks_for_crs() {
            return Err(Failure::Usage("--crs requires --units or --reproject here".to_owned()));
        }
        Ok(())
    }
}

impl UnitsArg {
    const fn units(self) -> Units {
        match self {
            Self::Mm => Units::Millimetre,
            Self::Cm => Units::Centimetre,
            Self::M => Units::Metre,
            Self::Ft => Units::Foot,
            Self::UsFt => Units::UsSurveyFoot,
        }
    }
}

fn refused(option: &str, error: &CrsError) -> Failure {
    let line = format!("{option}: {error}");
    if matches!(error, CrsError::NotACrs(_)) { Failure::Usage(line) } else { Failure::Unsupported(line) }
}

/// A matrix, the value of `option`: numbers, or a file of numbers.
pub(super) fn matrix(option: &str, text: &str) -> Result<Affine, Failure> {
    let refuse = |what: String| Failure::Usage(format!("{option}: {what}"));
    let typed = numbers(text);
    let found = match typed {
        Some(numbers) => numbers,
        None => numbers_of_file(option, Path::new(text))?,
    };
    let Ok(rows) = <[f64; NUMBERS]>::try_from(found.as_slice()) else {
        return Err(refuse(format!("{} numbers; a 4 × 4 matrix has {NUMBERS}", found.len())));
    };
    let map = Affine::from_matrix(&rows).map_err(|fault| refuse(fault.to_string()))?;
    for row in rows[..12].chunks_exact(4) {
        let largest = row[..3].iter().fold(0.0, |largest: f64, v| largest.max(v.abs()));
        if !FACTORS.contains(&largest) || !Lattice::is_sound_offset(row[3]) {
            let short = |v: &f64| if v.abs() < 1e15 { v.to_string() } else { format!("{v:e}") };
            let shown = row.iter().map(short).collect::<Vec<_>>().join(" ");
            return Err(refuse(format!("the row {shown} places no point where coordinates can be")));
        }
    }
    Ok(map)
}

fn numbers_of_file(option: &str, path: &Path) -> Result<Vec<f64>, Failure> {
    let refuse = |what: &str| Failure::Usage(format!("{option}: {}: {what}", path.display()));
    if !path.is_file() {
        return Err(refuse("neither 16 numbers nor a file"));
    }
    let io = |e| Failure::io(path, "reading the matrix", &e);
    let mut bytes = Vec::new();
    File::open(path).map_err(io)?.take(MAX_MATRIX_BYTES).read_to_end(&mut bytes).map_err(io)?;
    let text = String::from_utf8_lossy(&bytes);
    numbers(text.trim_start_matches('\u{feff}')).ok_or_else(|| refuse("holds more than numbers"))
}

/// The numbers of a text that holds nothing else.
fn numbers(text: &str) -> Option<Vec<f64>> {
    let fields = text.split(|c: char| c.is_whitespace() || matches!(c, ',' | ';')).filter(|field| !field.is_empty());
    let numbers: Option<Vec<f64>> = fields.map(|field| field.parse().ok()).collect();
    numbers.filter(|numbers| !numbers.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        match matrix("--transform", text) {
            Err(Failure::Usage(line)) => line,
            other => panic!("{text}: {:?}", other.is_ok()),
        }
    }

    #[test]
    fn sixteen_numbers_are_read_however_they_are_separated() {
        let expected = [12.5, -2.0, 4.0];
        for text in [
            "1 0 0 11.5 0 -1 0 0 0 0 1 1 0 0 0 1",
            "1,0,0,11.5, 0,-1,0,0, 0,0,1,1, 0,0,0,1",
            "1 0 0 11.5\r\n0 -1 0 0\r\n0 0 1 1e0\r\n0.000 0.0 0 1.0000\r\n",
        ] {
            assert_eq!(matrix("--transform", text).unwrap().apply([1.0, 2.0, 3.0]), expected, "{text}");
        }
    }

    #[test]
    fn what_is_no_map_of_points_is_refused_with_the_reason() {
        let table = [
            ("1 2 3", "3 numbers; a 4 × 4 matrix has 16"),
            ("0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 1", "singular"),
            ("1 0 0 0 0 1 0 0 0 0 1 0 5 6 7 1", "row by row"),
            ("1 0 0 9 0 1 0 0 0 0 1 0 5 6 7 1", "the last row is 5 6 7 1"),
            ("1e300 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "the row 1e300 0 0 0 places no point"),
            ("5e-310 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "places no point"),
            ("1 0 0 1e31 0 1 0 0 0 0 1 0 0 0 0 1", "places no point"),
            ("1e-20 0 0 0 0 1e-20 0 0 0 0 1e-20 0 0 0 0 1", "places no point"),
            ("1 0 0 nan 0 1 0 0 0 0 1 0 0 0 0 1", "not finite"),
            ("no-such-file.txt", "neither 16 numbers nor a file"),
        ];
        for (text, reason) in table {
            assert!(refused(text).contains(reason), "{text}: {}", refused(text));
        }
    }
}

//! The result as files: for programs, for spreadsheets, for people.

mod csv;
mod html;
mod plot;

use std::path::Path;

use crate::measurement::{Shown, write_whole};
use crate::{MeasureError, Measured};

pub use plot::{Plot, plots};

/// The files that [`write_all`] makes.
pub const FILES: [&str; 3] = ["measure.json", "measure.csv", "report.html"];

/// Writes `measure.json`, `measure.csv` and `report.html` into `folder`, each whole or not at all.
///
/// # Errors
/// A file that cannot be written.
pub fn write_all(folder: &Path, result: &Measured, pictures: &[Shown]) -> Result<(), MeasureError> {
    let json = |error: serde_json::Error| MeasureError::Write { path: folder.join(FILES[0]), error: error.into() };
    let text = serde_json::to_vec_pretty(result).map_err(json)?;
    write_whole(&folder.join(FILES[0]), &text)?;
    let path = folder.join(FILES[1]);
    let table = csv::table(result).map_err(|error| MeasureError::Write { path: path.clone(), error })?;
    write_whole(&path, &table)?;
    write_whole(&folder.join(FILES[2]), html::page(result, pictures).as_bytes())
}

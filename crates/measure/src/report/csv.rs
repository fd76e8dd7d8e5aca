//! A row per setting, a column per figure.

use std::io;

use crate::axis::Axis;
use crate::result::{Measured, Row};

/// The figures of a row, for tables: name, unit, value.
pub(super) type Figure = (&'static str, fn(&Row) -> Option<f64>);

/// What tables show of a row.
pub(super) const FIGURES: [Figure; 13] = [
    ("cpu_seconds_per_million_points", Row::seconds_per_million),
    ("points_per_second", |row| row.cost.as_ref().map(|cost| cost.points_per_second)),
    ("peak_memory_bytes", |row| row.cost.as_ref().map(|cost| cost.peak_memory_bytes as f64)),
    ("bytes_per_point", Row::bytes_per_point),
    ("position_error_max", Row::position_error),
    ("position_error_rms", |row| row.position.map(|axes| axes.iter().map(|a| a.rms).fold(0.0, f64::max))),
    ("position_error_p999", |row| row.position.map(|axes| axes.iter().map(|a| a.p999).fold(0.0, f64::max))),
    ("colour_delta_e_mean_of_levels", Row::colour_error),
    ("picture_error_rms_mean_of_views", Row::picture_error),
    ("picture_ssim_mean_of_views", |row| mean(row.views.iter().map(|view| view.error.ssim))),
    ("picture_holes_mean_of_views", |row| mean(row.views.iter().map(|view| view.error.holes))),
    ("pixels_that_pop", |row| row.popping),
    ("points_too_close", too_close),
];

fn mean(values: impl ExactSizeIterator<Item = f64>) -> Option<f64> {
    let count = values.len();
    (count > 0).then(|| values.sum::<f64>() / count as f64)
}

/// Share of the points of inner nodes that are closer to another one than their level's spacing.
fn too_close(row: &Row) -> Option<f64> {
    let sum = |name: &str| -> f64 { row.sampling.iter().filter_map(|level| level.get(name)?.as_f64()).sum() };
    let sampled = sum("sampled");
    (sampled > 0.0).then(|| sum("close") / sampled)
}

pub(super) fn table(result: &Measured) -> io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let axes = || Axis::ALL.iter().map(|axis| axis.name());
    let head = ["setting"].into_iter().chain(axes()).chain(["options", "on_front", "pictures_by_depth"]);
    writer.write_record(head.chain(FIGURES.iter().map(|(name, _)| *name)).chain(["failed"]))?;
    for row in &result.rows {
        let mut cells = vec![row.name.clone()];
        cells.extend(axes().map(|axis| row.values.get(axis).cloned().unwrap_or_default()));
        cells.extend([row.arguments.join(" "), row.is_on_front.to_string(), row.is_shaded_by_depth.to_string()]);
        cells.extend(FIGURES.iter().map(|(_, figure)| figure(row).map_or_else(String::new, |v| v.to_string())));
        cells.push(row.failed.clone().unwrap_or_default());
        writer.write_record(cells)?;
    }
    writer.into_inner().map_err(|error| io::Error::other(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_has_a_cell_for_each_column_and_names_are_quoted() {
        let row = Row { name: "potree2, \"x\"".to_owned(), failed: Some("no\nspace".to_owned()), ..Row::default() };
        let bytes = table(&Measured { rows: vec![row], ..Measured::default() }).unwrap();
        let mut reader = csv::Reader::from_reader(&bytes[..]);
        let head = reader.headers().unwrap().len();
        let rows: Vec<csv::StringRecord> = reader.records().collect::<Result<_, _>>().unwrap();
        assert_eq!((rows.len(), rows[0].len(), &rows[0][0]), (1, head, "potree2, \"x\""));
        assert_eq!(&rows[0][head - 1], "no\nspace");
    }
}

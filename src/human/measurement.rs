//! The summary of a measurement.

use std::path::Path;

use pointmill_measure::Measured;

use super::quantities::{count, plural, seconds};

/// What was measured, the settings of the profiles, and where the rest stands.
pub(crate) fn summary(result: &Measured, folder: &Path) -> Vec<String> {
    let failed = result.rows.iter().filter(|row| row.failed.is_some()).count();
    let mut lines = vec![format!(
        "{} measured on {} points in {}",
        plural(result.rows.len() as u64, "setting"),
        count(result.scene.points),
        seconds(result.seconds)
    )];
    if failed > 0 {
        lines.push(format!("warning: {} could not be measured; the report says why", plural(failed as u64, "setting")));
    }
    for profile in &result.profiles {
        lines.push(format!("{} {}: {}", profile.output, profile.name, profile.arguments.join(" ")));
    }
    lines.push(format!("see {}", folder.join("report.html").display()));
    lines
}

//! Warnings as lines.

use std::path::PathBuf;

use pointmill_format::Aabb;

use super::Warning;
use super::numbers::grouped;

impl Warning {
    /// The line without the advice.
    pub fn what(&self) -> String {
        match self {
            Self::Scan { path, warning } => format!("{}: {warning}", path.display()),
            Self::OtherFiles { files } => other_files(files),
            Self::OldOutputBack { output } => format!(
                "{}: a run was ended while it replaced this output; the dataset before it is back in its place",
                output.display()
            ),
            Self::Leftover { path, why } => format!("{}: left over, and not removed: {why}", path.display()),
            Self::InputSkipped { error, .. } => format!("input skipped: {error}"),
            Self::PointsSkipped { points, error, .. } => format!("{points} points skipped: {error}"),
            Self::BeginsAnew => "there is no unfinished run to go on with; this one begins anew".to_owned(),
            Self::JobRemoved { folder } => format!(
                "{}: removed; a run that was ended had left it to go on with, and this one begins anew",
                folder.display()
            ),
            Self::NoJob { why } => format!("no run can go on where this one ends: {why}"),
            Self::ReadAgain => "the points lie outside the bounds that were declared or sampled, or their extent does \
                                not fit the chosen step; reading again with the measured bounds"
                .to_owned(),
            Self::AboveCeiling { peak, ceiling } => format!(
                "the run took {} MiB of memory, more than the ceiling of {} MiB; please report this scene",
                peak.div_ceil(1 << 20),
                ceiling >> 20
            ),
            Self::FinerStep { scale, reason } => format!(
                "the coordinates are finer than bounds or a sample showed; reading again with the step {}: {reason}",
                steps(*scale)
            ),
            Self::CoarserStep { scale, reason } => format!("coordinate step {}: {reason}", steps(*scale)),
            Self::OutliersDropped { points, others: Aabb { min, max } } => format!(
                "{points} or more points far from all others are dropped: those outside {min:?} to {max:?}; reading again"
            ),
            Self::CoarseSingle { path, resolution } => format!(
                "{}: stores coordinates in single precision, which resolves {} here and no finer; no tool can restore \
                 what it lacks",
                path.display(),
                steps(*resolution)
            ),
            Self::Outliers { points, factor, holds_back_step, .. } => outliers(*points, *factor, *holds_back_step),
            Self::OriginPoints { points, of } => format!(
                "{} of {} points lie exactly at the origin of their scan, where the scanner stood",
                grouped(*points),
                grouped(*of)
            ),
            Self::SharedPlace { position, points, of, more, .. } => shared_place(*position, *points, *of, *more),
            Self::ValuesChanged { attribute, output: None, changes } => format!("{attribute}: {changes}"),
            Self::ValuesChanged { attribute, output: Some((kind, ty)), changes } => {
                format!("{}: {attribute}, stored as {ty}: {changes}", kind.name())
            }
            Self::AttributesApart { name, elements: [one, two], other } => format!(
                "the inputs have two attributes {name:?}, of {one} and of {two} elements a point; the second is {other:?}"
            ),
            Self::ValuesMissing { attributes, points, files } => missing(attributes, *points, *files),
            Self::MixedRgbDepth { eight_bit, coloured, first } => format!(
                "{eight_bit} of {coloured} inputs with colour have no value above 255 and are taken as 8 bits deep, \
                 the others as 16 (the first is {})",
                first.display()
            ),
            Self::Crs(note) => note.to_string(),
            Self::DifferentCrs { labels } => format!(
                "the inputs have different coordinate reference systems ({}); coordinates are taken as they are and \
                 the projection stays empty",
                labels.join("; ")
            ),
            Self::Viewers { format, note } => format!("{}: {note}", format.name()),
            Self::CrsNotWritten { label } => {
                format!("the coordinate reference system ({label}) is not in the file, which has no place for it")
            }
            Self::ManyFiles { leaves } => format!("{leaves} files, one per leaf"),
            Self::Colours { format, note } => format!("{}: {note}", format.name()),
        }
    }
}

fn other_files(files: &[PathBuf]) -> String {
    let named: Vec<_> = files.iter().take(3).map(|f| f.display().to_string()).collect();
    let (noun, more) = (if files.len() == 1 { "file" } else { "files" }, if files.len() > 3 { ", …" } else { "" });
    format!("{} other {noun} skipped, not scans ({}{more})", files.len(), named.join(", "))
}

/// One number where all axes have the same.
fn steps(scale: [f64; 3]) -> String {
    let short = |v: f64| if (1e-4..1e9).contains(&v) { v.to_string() } else { format!("{v:e}") };
    let [x, y, z] = scale.map(short);
    if x == y && y == z { x } else { format!("{x}, {y}, {z}") }
}

fn missing(attributes: &[String], points: u64, files: u64) -> String {
    let (point, have) = if points == 1 { ("point", "has") } else { ("points", "have") };
    let file = if files == 1 { "file" } else { "files" };
    format!("{}: {points} {point} of {files} {file} {have} none; 0 is written", attributes.join(", "))
}

fn outliers(points: u64, factor: f64, holds_back_step: bool) -> String {
    let (lie, make, them) = if points == 1 { ("point is", "makes", "it") } else { ("points are", "make", "them") };
    let gain = if holds_back_step { "the coordinate step could be finer and " } else { "" };
    format!(
        "{points} {lie} far from all others and {make} the extent at least {} times larger; without {them} {gain}the \
         tree would have fewer levels",
        factor.floor()
    )
}

fn shared_place([x, y, z]: [f64; 3], points: u64, of: u64, more: usize) -> String {
    let more = match more {
        0 => String::new(),
        1 => ", and one more place is shared by at least one in a hundred".to_owned(),
        n => format!(", and {n} more places are each shared by at least one in a hundred"),
    };
    format!("{} of {} points share the position ({x}, {y}, {z}){more}", grouped(points), grouped(of))
}

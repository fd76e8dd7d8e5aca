//! Where settings and advice of the libraries get the names of options: nothing below `src/` knows any.

use pointmill_converter::{Advice, ConvertError, DropReason, MemoryNeed, PlanError, PlanFault, Setting, Warning};
use pointmill_format::{Aabb, Advice as ReadAdvice, ReadError, ScanWarning};

use crate::fitting::{fitted, running};

/// The option that a setting comes from.
fn option(setting: Setting) -> &'static str {
    match setting {
        Setting::Outputs => "--to",
        Setting::LeafCapacity => "--leaf-capacity",
        Setting::MaxNodePoints => "--max-node-points",
        Setting::Spacing => "--spacing",
        Setting::BrotliQuality => "--brotli-quality",
        Setting::Capacity => "--capacity",
        Setting::LodCell => "--lod-cell",
        Setting::Planes => "--planes",
        Setting::Scale => "--scale",
        Setting::Precision => "--precision",
        Setting::Bounds => "--bounds",
        Setting::TempDir => "--temp-dir",
        Setting::Attributes => "--attributes",
        Setting::Derive => "--derive",
        Setting::Neighbours => "--neighbours",
        Setting::Crs => "--crs",
        Setting::Inputs => "INPUT",
        other => other.name(),
    }
}

/// What the user of a command can do.
fn advice_in(command: &str, advice: &Advice) -> String {
    fitted(command, &advice_of_convert(advice)).unwrap_or_else(|| match advice {
        Advice::StartAnew if command.starts_with("job") => Advice::PlanAnew.to_string(),
        other => other.to_string(),
    })
}

/// What the user can do, in options of `convert`.
fn advice_of_convert(advice: &Advice) -> String {
    match advice {
        Advice::ReplaceOutput => "choose another output, or pass --overwrite".to_owned(),
        Advice::RaiseMemory { mib } => format!("pass --memory {mib}MiB or more"),
        Advice::StartAnew => "begin anew: leave out --resume".to_owned(),
        Advice::FreeTemporaryDisk => {
            "free some space there, or put temporary files elsewhere with --temp-dir".to_owned()
        }
        Advice::DropDuplicates => "pass --duplicates drop".to_owned(),
        Advice::KeepDuplicates => "leave out --duplicates drop, or convert to octrees alone".to_owned(),
        Advice::CutBounds { bounds: Some(b) } => format!("--bounds {} keeps all others", bounds_value(b)),
        Advice::CutBounds { bounds: None } => "leave them out with --bounds, or correct the input".to_owned(),
        Advice::CutOutliers { bounds } => format!(
            "--bounds {} keeps all others, --outliers drop drops them, --outliers keep goes on with the coarser step",
            bounds_value(bounds)
        ),
        Advice::SkipInvalid => "pass --invalid skip to leave such points out".to_owned(),
        Advice::SkipOriginPoints => "--origin-points skip leaves them out".to_owned(),
        Advice::DetectRgbDepth => "leave out --rgb-depth 8".to_owned(),
        Advice::SetRgbDepth => "--rgb-depth overrides this".to_owned(),
        Advice::RoundDarkColours => {
            "pass --dark-colours round to round them to 0 or 256, or --rgb-depth 8 if they have 8 bits".to_owned()
        }
        Advice::Project => "--reproject EPSG:n to a system in metres or feet gives a scene to look at".to_owned(),
        Advice::CommasSeparate => "pass --decimal point if they separate columns".to_owned(),
        Advice::NameEpsg => "pass --crs EPSG:n if viewers need the projection".to_owned(),
        Advice::GiveWkt => "pass --crs \"$(cat FILE)\" with its WKT in FILE".to_owned(),
        Advice::GiveProj4 => "pass --crs \"+proj=…\" if viewers need the projection".to_owned(),
        Advice::Reproject => {
            "bring the inputs to one system with --reproject, or name the system of all with --crs".to_owned()
        }
        Advice::NameAttributes => "name the attributes to keep with --attributes".to_owned(),
        Advice::LimitNodes => {
            "--max-node-points limits all but those whose points share one place (--duplicates drop)".to_owned()
        }
        Advice::CoarserStep { least } => format!("choose a step of at least {least} with --scale"),
        Advice::CoarserPrecision { is_by_format: false } => {
            "pass a larger --precision, or convert parts of the scene with --bounds".to_owned()
        }
        Advice::CoarserPrecision { is_by_format: true } => {
            "pass a larger --precision, or choose --to potree2 or copc, which keep integers".to_owned()
        }
        Advice::PackLeaves => "--layout packed puts them into one".to_owned(),
        other => other.to_string(),
    }
}

/// A box as `--bounds` takes it.
fn bounds_value(b: &Aabb) -> String {
    let corner = |c: [f64; 3]| c.map(|v| v.to_string()).join(",");
    format!("{}..{}", corner(b.min), corner(b.max))
}

fn with_advice(what: String, advised: Option<&Advice>) -> String {
    match advised {
        Some(advised) => format!("{what}; {}", advice_in(running(), advised)),
        None => what,
    }
}

/// An error of a conversion, one line.
pub(crate) fn error_line(error: &ConvertError) -> String {
    match error {
        ConvertError::Plan(error) => plan_line(error),
        // fewer threads help where the ceiling holds the share of one
        ConvertError::Memory { ceiling, needed, why: MemoryNeed::Threads { threads: threads @ 2.., .. } }
            if *ceiling >= needed / threads =>
        {
            with_advice(error.what(), error.advice().as_ref()) + ", or fewer --threads"
        }
        other => with_advice(other.what(), other.advice().as_ref()),
    }
}

/// An error of a reader, one line.
pub(crate) fn read_error_line(error: &ReadError) -> String {
    match error.advice() {
        None => error.to_string(),
        Some(advice) => format!("{}; {}", error.what_and_where(), read_advice_in(running(), advice)),
    }
}

/// What helps where a place cannot be searched for scans.
pub(crate) fn skip_unread() -> String {
    fitted(running(), &format!("; pass {}", skip(running()))).unwrap_or_default()
}

/// The option, and what is done with what is left.
fn skip(command: &str) -> String {
    let verb = if matches!(command, "export" | "extract") { command } else { "convert" };
    format!("--unreadable skip to {verb} the rest")
}

/// What the user of a command can do about an input.
fn read_advice_in(command: &str, advice: &ReadAdvice) -> String {
    let with_options = match advice {
        ReadAdvice::SkipUnreadable => format!("copy the file again, or pass {}", skip(command)),
        ReadAdvice::MoreMemory => "pass a larger --memory".to_owned(),
        ReadAdvice::NameCamera => {
            "describe the camera in a JSON file beside it, or with --intrinsics and --depth-scale".to_owned()
        }
        ReadAdvice::NameCrs => "name its coordinate reference system with --crs".to_owned(),
        ReadAdvice::OtherCrs => {
            "choose a system for --reproject on the same datum and with the same heights, or reproject the scan elsewhere"
                .to_owned()
        }
        ReadAdvice::WidenColumn => "the rows that were sampled hold none like it; name the columns, this one with a \
                                    wider type, as in --columns x,y,z,c:int32"
            .to_owned(),
        ReadAdvice::NameColumns => {
            "if it was cut short, copy it again; if its columns are x,y alone, say so with --columns".to_owned()
        }
        ReadAdvice::DetectSeparator => {
            "name the one that the rows have, or leave out --separator to have it detected".to_owned()
        }
        ReadAdvice::DecimalMark => {
            "say whether commas are decimal marks: --decimal comma or --decimal point".to_owned()
        }
        advice => advice.to_string(),
    };
    fitted(command, &with_options).unwrap_or_else(|| match advice {
        ReadAdvice::SkipUnreadable => "copy the file again".to_owned(),
        ReadAdvice::MoreMemory => "this command takes no more".to_owned(),
        advice => advice.to_string(),
    })
}

fn plan_line(error: &PlanError) -> String {
    let option = option(error.setting);
    match &error.fault {
        PlanFault::Cell(what) if error.setting == Setting::LodCell => format!("{option}: {what}, or auto"),
        PlanFault::UnknownUnit => format!(
            "{option}: the unit of the coordinates is unknown; name their system with --crs, or pass a number in units of \
             the coordinates"
        ),
        PlanFault::NotPositive if error.setting == Setting::Precision => format!("{option}: must be a length above 0"),
        PlanFault::NotPositive => format!("{option}: must be a number above 0, or auto"),
        PlanFault::NotOneOf(_) if error.setting == Setting::Planes => format!("{option}: must be 10, 20, 30 or auto"),
        fault => format!("{option}: {fault}"),
    }
}

/// A warning of a conversion, one line.
pub(crate) fn warning_line(warning: &Warning) -> String {
    if let Warning::Scan { warning: ScanWarning::Images { .. }, .. } = warning {
        return format!("{}; pointmill extract writes images", warning.what());
    }
    with_advice(warning.what(), warning.advice().as_ref())
}

/// Why an attribute is not in a dataset.
pub(crate) fn drop_reason(why: &DropReason) -> String {
    let remedy = match why {
        DropReason::NotUsual => "--attributes adds it",
        DropReason::NoPlace("1.7") => "--potree1-version 1.8 has",
        _ => return why.to_string(),
    };
    fitted(running(), remedy).map_or_else(|| why.to_string(), |remedy| format!("{why}; {remedy}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_names_an_option_and_nothing_is_said_twice() {
        crate::fitting::begins("convert", <crate::args::Args as clap::CommandFactory>::command());
        let others = Aabb { min: [0.0, -1.0, 2.5], max: [10.0, 20.0, 30.0] };
        let outliers = Warning::Outliers { points: 2, others, factor: 11.0, holds_back_step: false };
        let line = warning_line(&outliers);
        assert!(line.ends_with("--bounds 0,-1,2.5..10,20,30 keeps all others"), "{line}");
        let memory = ConvertError::Memory {
            ceiling: 1 << 20,
            needed: 90 << 20,
            why: pointmill_converter::MemoryNeed::Part("nodes"),
        };
        assert!(error_line(&memory).ends_with("; pass --memory 91MiB or more"), "{}", error_line(&memory));
    }

    #[test]
    fn a_line_fits_the_command() {
        crate::fitting::begins("convert", <crate::args::Args as clap::CommandFactory>::command());
        let skip = |command| read_advice_in(command, &ReadAdvice::SkipUnreadable);
        assert_eq!(skip("validate"), "copy the file again");
        assert_eq!(skip("convert"), "copy the file again, or pass --unreadable skip to convert the rest");
        assert_eq!(skip("extract"), "copy the file again, or pass --unreadable skip to extract the rest");
        assert_eq!(skip("info"), skip("convert") + " (with 'pointmill convert')");
        assert_eq!(skip("job run"), skip("convert") + " (in a new 'pointmill job plan')");
        let memory = |command| read_advice_in(command, &ReadAdvice::MoreMemory);
        assert_eq!(memory("validate"), "pass a larger --memory");
        assert_eq!(memory("extract"), "this command takes no more");
        assert!(memory("preview").starts_with("pass a larger --memory (with 'pointmill convert', "));
        assert_eq!(read_advice_in("info", &ReadAdvice::Damaged), "it is damaged; copy or export it again");
        assert_eq!(advice_in("convert", &Advice::StartAnew), "begin anew: leave out --resume");
        assert_eq!(advice_in("job run", &Advice::StartAnew), "plan the job anew, in another folder");
        assert_eq!(advice_in("job run", &Advice::RaiseMemory { mib: 5 }), "pass --memory 5MiB or more");
    }
}

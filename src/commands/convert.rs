//! `pointmill convert`: from the options to a `Plan`, a run and a summary.

use std::path::{Path, PathBuf};

use pointmill_converter::{
    AttributeChoice, BatchesSettings, BintreeSettings, Checkpoint, CopcSettings, DarkColours, Duplicates, Encoding,
    Filter, OnFault, OriginPoints, Outliers, Plan, Potree1Settings, Potree1Version, Potree2Settings, Report, RgbDepth,
    Sampling, ScaleChoice, Target, resolve_path,
};
use pointmill_format::bintree::{Layout, SplitRule};
use serde_json::Value;

use super::page_file::PageFile;
use super::report_file::ReportFile;
use super::verify::verify;
use crate::args::{
    Attributes, BROTLI_QUALITY, BatchesArgs, BintreeArgs, CheckpointArg, ConvertArgs, DarkColoursArg, DuplicatesArg,
    EncodingArg, FaultArg, LayoutArg, OriginPointsArg, OutliersArg, Potree1VersionArg, RgbDepthArg, SEED, SamplingArg,
    SplitArg, TargetArg,
};
use crate::datasets;
use crate::exit::{Failure, emit, print_line, to_json};
use crate::flags;
use crate::human::conversion;
use crate::human::progress::Progress;
use crate::inputs::Inputs;
use crate::interrupt::{kept, no_more_checks, stop_flag};

/// What is to be made, and how, as the options say.
pub(super) fn planned(args: &ConvertArgs) -> Result<(Plan, Vec<Target>), Failure> {
    let targets = targets(args)?;
    let mut inputs = args.inputs.expand(&args.output)?;
    if args.unreadable == FaultArg::Fail
        && let Some(failure) = inputs.unread_failure(&flags::skip_unread())
    {
        return Err(failure);
    }
    if !args.talk.quiet {
        inputs.notes.iter().for_each(|note| print_line(note));
    }
    if args.page {
        PageFile::check_formats(args)?;
    }
    if args.append {
        inputs.files.push(appendable(args, &inputs)?);
    }
    let mut plan = plan(args, inputs)?;
    plan.overwrite |= args.append;
    plan.append = args.append;
    if args.append {
        if args.name.is_none() {
            plan.name = name_from(&[], std::slice::from_ref(&args.output));
        }
        made_alike(&plan, &targets)?;
    }
    Ok((plan, targets))
}

/// Refuses to add to a dataset that was made with other settings: they are those of all points.
fn made_alike(plan: &Plan, targets: &[Target]) -> Result<(), Failure> {
    let report = std::fs::read(plan.output.join("report.json")).ok();
    let report: Option<Value> = report.and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let Some(was) = report.as_ref().and_then(|report| report.get("options")?.as_object()) else { return Ok(()) };
    let now = pointmill_converter::settings(plan, targets);
    let differs = |name: &&String| !RESOURCES.contains(&name.as_str()) && was.get(*name) != now.get(*name);
    let Some(name) = was.keys().chain(now.keys()).find(differs) else { return Ok(()) };
    let shown = |value: Option<&Value>| value.map_or_else(|| "not given".to_owned(), ToString::to_string);
    let (was, now) = (shown(was.get(name)), shown(now.get(name)));
    let output = plan.output.display();
    Err(Failure::Usage(format!(
        "{output}: made with another {name}: {was}, now {now}; pass the same options, or leave out --append"
    )))
}

/// Settings of a report that change no byte.
const RESOURCES: [&str; 3] = ["memory", "threads", "to"];

/// The dataset that others are added to, as one more input.
fn appendable(args: &ConvertArgs, inputs: &Inputs) -> Result<PathBuf, Failure> {
    let (output, shown) = (&args.output, args.output.display());
    let placing = &args.inputs.reading.placing;
    let of_all = [
        ("--every", args.every > 1),
        ("--class", args.class.is_some()),
        ("--bounds", args.bounds.is_some()),
        ("--origin-points skip", matches!(args.origin_points, OriginPointsArg::Skip)),
        ("--units", placing.units.is_some()),
        ("--axes", placing.axes.is_some()),
        ("--transform", placing.transform.is_some()),
        ("--reproject", placing.reproject.is_some()),
    ];
    if let Some((option, _)) = of_all.iter().find(|(_, given)| *given) {
        let line = format!(
            "{option} would change the points of {shown}, too; convert the new scans to a dataset with it, and add that"
        );
        return Err(Failure::Usage(line));
    }
    let [to] = args.to[..] else {
        return Err(Failure::Usage("--append adds to one dataset; leave out all --to but one".to_owned()));
    };
    let Some(located) = datasets::named(output)? else {
        return Err(Failure::Usage(format!("{shown}: there is no dataset to add to; leave out --append")));
    };
    if located.kind.name() != to.name() {
        let kind = located.kind;
        return Err(Failure::Usage(format!("{shown}: the dataset is {kind}; pass --to {}", kind.name())));
    }
    let same = |a: &Path, b: &Path| a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b);
    if inputs.files.iter().any(|file| same(file, output) || same(file, &located.path)) {
        return Err(Failure::Usage(format!("{shown}: it is an input already; leave it out")));
    }
    Ok(output.clone())
}

pub(crate) fn run(args: &ConvertArgs) -> Result<(), Failure> {
    let (plan, targets) = planned(args)?;
    if args.dry_run {
        let estimate = pointmill_converter::estimate(&plan, &targets)?;
        return emit(&if args.json { to_json(&estimate)? } else { conversion::estimate(&estimate, &plan) });
    }
    protect_inputs(&plan, args.append)?;
    let page_file = PageFile::requested(args)?;
    let report_file = args.report.as_ref().map(|file| {
        let sources = plan.inputs.iter().chain(&args.inputs.files_from);
        ReportFile::new(file, &plan.output, sources)
    });
    let report_file = report_file.transpose()?;
    let progress = Progress::new(&args.talk, Some(stop_flag()));
    let result = pointmill_converter::convert_verified(&plan, &targets, &progress, &|folder| {
        args.verify.map_or(Ok(()), |how| verify(folder, how, &plan, &progress))
    });
    no_more_checks();
    let for_people = progress.end();
    let report = result.map_err(|error| with_kept(error.into()))?;
    tell(args.json, report_file.as_ref(), &report).map_err(|failure| after_all(failure, &plan.output))?;
    let page = page_file.map(|file| file.write(&plan.name)).transpose();
    let page = page.map_err(|failure| after_all(failure, &plan.output))?;
    if for_people {
        conversion::report(&report, &plan, args.talk.verbose).iter().for_each(|line| print_line(line));
        args.verify.iter().for_each(|how| print_line(how.passed()));
        page.iter()
            .for_each(|file| print_line(&format!("{}: the page that shows it, from any web server", file.display())));
    }
    Ok(())
}

/// The report where it was asked for.
pub(super) fn tell(is_json: bool, file: Option<&ReportFile>, report: &Report) -> Result<(), Failure> {
    if file.is_none() && !is_json {
        return Ok(());
    }
    let text = to_json(report)?;
    file.map_or(Ok(()), |file| file.write(&text))?;
    if is_json { emit(&text) } else { Ok(()) }
}

/// What failed, and what of it is not lost.
fn with_kept(failure: Failure) -> Failure {
    match (failure, kept()) {
        (Failure::Interrupted(_), Some(line)) => Failure::Interrupted(line),
        (failure, Some(line)) => {
            print_line(line.trim_start_matches("interrupted; "));
            failure
        }
        (failure, None) => failure,
    }
}

/// What fails once the dataset is in place must not read as if there were none.
pub(super) fn after_all(failure: Failure, output: &Path) -> Failure {
    match failure {
        Failure::Io(line) => Failure::Io(format!("{line}; the output {} is complete", output.display())),
        other => other,
    }
}

/// The formats with their settings; an option of a format that was not requested is a usage error.
fn targets(args: &ConvertArgs) -> Result<Vec<Target>, Failure> {
    if args.seed.is_some() && args.sampling != Some(SamplingArg::Random) {
        return Err(Failure::Usage("--seed requires --sampling random".to_owned()));
    }
    if args.scale.0.is_some() && args.precision.is_some() {
        return Err(Failure::Usage("--precision chooses the step; leave out --scale".to_owned()));
    }
    if args.brotli_quality.is_some() && args.encoding != Some(EncodingArg::Brotli) {
        return Err(Failure::Usage("--brotli-quality requires --encoding brotli".to_owned()));
    }
    let mut targets = Vec::new();
    for to in &args.to {
        let target = match to {
            TargetArg::Potree2 => potree2_settings(args).into(),
            TargetArg::Bintree => bintree_settings(&args.bintree).into(),
            TargetArg::Batches => batches_settings(&args.batches).into(),
            TargetArg::Potree1 => potree1_settings(args).into(),
            TargetArg::Copc => copc_settings(args).into(),
        };
        targets.push(target);
    }
    let (tree, batches) = (&args.bintree, &args.batches);
    let octrees: &[TargetArg] = &[TargetArg::Potree2, TargetArg::Potree1, TargetArg::Copc];
    let given: &[(&str, &[TargetArg], bool)] = &[
        ("--sampling", octrees, args.sampling.is_some()),
        ("--spacing", octrees, args.spacing.is_some()),
        ("--leaf-capacity", octrees, args.leaf_capacity.is_some()),
        ("--encoding", &[TargetArg::Potree2], args.encoding.is_some()),
        ("--dark-colours", &[TargetArg::Potree2], args.dark_colours.is_some()),
        ("--potree1-version", &[TargetArg::Potree1], args.potree1.potree1_version.is_some()),
        ("--max-node-points", &[TargetArg::Potree1], args.potree1.max_node_points.is_some()),
        ("--archive", &[TargetArg::Potree1], args.potree1.archive),
        ("--capacity", &[TargetArg::Bintree], tree.capacity.is_some()),
        ("--split", &[TargetArg::Bintree], tree.split.is_some()),
        ("--layout", &[TargetArg::Bintree], tree.layout.is_some()),
        ("--lod-cell", &[TargetArg::Batches], batches.lod_cell.is_some()),
        ("--planes", &[TargetArg::Batches], batches.planes.is_some()),
        ("--compress", &[TargetArg::Batches], batches.compress.is_some()),
        ("--no-originals", &[TargetArg::Batches], batches.no_originals),
    ];
    let is_useless = |of: &[TargetArg]| !of.iter().any(|to| args.to.contains(to));
    if let Some((option, of, _)) = given.iter().find(|(_, of, given)| *given && is_useless(of)) {
        let names: Vec<&str> = of.iter().map(|to| to.name()).collect();
        return Err(Failure::Usage(format!("{option} requires --to {}", names.join(" or "))));
    }
    Ok(targets)
}

/// How inner nodes of octrees choose their points.
fn sampling(args: &ConvertArgs) -> Option<Sampling> {
    args.sampling.map(|s| match s {
        SamplingArg::Random => Sampling::Random { seed: args.seed.unwrap_or(SEED) },
        SamplingArg::Poisson => Sampling::Poisson,
        SamplingArg::Grid => Sampling::Grid,
    })
}

fn potree1_settings(args: &ConvertArgs) -> Potree1Settings {
    let default = Potree1Settings::default();
    Potree1Settings {
        sampling: sampling(args).unwrap_or(default.sampling),
        spacing: args.spacing.and_then(|s| s.0),
        leaf_capacity: args.leaf_capacity.unwrap_or(default.leaf_capacity),
        max_node_points: args.potree1.max_node_points,
        version: args.potree1.potree1_version.map_or(default.version, |v| match v {
            Potree1VersionArg::V1_7 => Potree1Version::V1_7,
            Potree1VersionArg::V1_8 => Potree1Version::V1_8,
        }),
        archive: args.potree1.archive,
    }
}

fn copc_settings(args: &ConvertArgs) -> CopcSettings {
    let default = CopcSettings::default();
    CopcSettings {
        sampling: sampling(args).unwrap_or(default.sampling),
        spacing: args.spacing.and_then(|s| s.0),
        leaf_capacity: args.leaf_capacity.unwrap_or(default.leaf_capacity),
    }
}

fn potree2_settings(args: &ConvertArgs) -> Potree2Settings {
    let default = Potree2Settings::default();
    Potree2Settings {
        sampling: sampling(args).unwrap_or(default.sampling),
        encoding: args.encoding.map_or(default.encoding, |e| match e {
            EncodingArg::Brotli => Encoding::Brotli { quality: args.brotli_quality.unwrap_or(BROTLI_QUALITY) },
            EncodingArg::Default => Encoding::Default,
        }),
        spacing: args.spacing.and_then(|s| s.0),
        leaf_capacity: args.leaf_capacity.unwrap_or(default.leaf_capacity),
        dark_colours: args.dark_colours.map_or(default.dark_colours, |d| match d {
            DarkColoursArg::Keep => DarkColours::Keep,
            DarkColoursArg::Round => DarkColours::Round,
        }),
    }
}

fn bintree_settings(args: &BintreeArgs) -> BintreeSettings {
    let default = BintreeSettings::default();
    BintreeSettings {
        capacity: args.capacity.unwrap_or(default.capacity),
        split: args.split.map_or(default.split, |s| match s {
            SplitArg::Mean => SplitRule::Mean,
            SplitArg::Median => SplitRule::Median,
            SplitArg::Midpoint => SplitRule::Midpoint,
        }),
        layout: args.layout.map_or(default.layout, |l| match l {
            LayoutArg::Files => Layout::Files,
            LayoutArg::Packed => Layout::Packed,
        }),
    }
}

fn batches_settings(args: &BatchesArgs) -> BatchesSettings {
    let default = BatchesSettings::default();
    BatchesSettings {
        lod_cell: args.lod_cell.as_ref().map_or(default.lod_cell, |c| c.0),
        planes: args.planes.map_or(default.planes, |p| p.0),
        zstd_level: args.compress,
        originals: !args.no_originals,
    }
}

fn plan(args: &ConvertArgs, inputs: Inputs) -> Result<Plan, Failure> {
    let name = args.name.clone().unwrap_or_else(|| name_from(&args.inputs.inputs, &inputs.files));
    let mut plan = Plan::new(inputs.files, args.output.clone());
    plan.other_files = inputs.other_files;
    plan.skipped_inputs = inputs.unread.into_iter().map(|unread| (unread.path, unread.why)).collect();
    plan.open = args.inputs.options()?;
    plan.name = name;
    plan.attributes = match &args.attributes {
        None => AttributeChoice::Usual,
        Some(Attributes::All) => AttributeChoice::All,
        Some(Attributes::Scene) => AttributeChoice::Scene,
        Some(Attributes::List(names)) => AttributeChoice::List(names.clone()),
    };
    plan.derive = args.derive.plan();
    plan.scale = match (args.scale.0, args.precision) {
        (Some(step), _) => ScaleChoice::Fixed(step),
        (None, Some(precision)) => ScaleChoice::Within(precision),
        (None, None) => ScaleChoice::Auto,
    };
    let origin_points = match args.origin_points {
        OriginPointsArg::Keep => OriginPoints::Keep,
        OriginPointsArg::Skip => OriginPoints::Skip,
    };
    plan.filter = Filter {
        bounds: args.bounds,
        regions: Vec::new(),
        classes: args.class.clone(),
        every: args.every,
        origin_points,
    };
    plan.duplicates = match args.duplicates {
        DuplicatesArg::Keep => Duplicates::Keep,
        DuplicatesArg::Drop => Duplicates::Drop,
    };
    plan.invalid = on_fault(args.invalid);
    plan.outliers = outliers(args.outliers);
    plan.unreadable = on_fault(args.unreadable);
    plan.rgb_depth = match args.rgb_depth {
        RgbDepthArg::Auto => RgbDepth::Auto,
        RgbDepthArg::Eight => RgbDepth::Eight,
        RgbDepthArg::Sixteen => RgbDepth::Sixteen,
    };
    plan.crs.clone_from(&args.inputs.reading.placing.crs);
    plan.resume = args.resume;
    plan.checkpoint = match args.checkpoint.unwrap_or(CheckpointArg::Auto) {
        CheckpointArg::Auto => Checkpoint::Auto,
        CheckpointArg::Always => Checkpoint::Always,
        CheckpointArg::Never => Checkpoint::Never,
        CheckpointArg::Every(points) => {
            plan.checkpoint_points = points;
            Checkpoint::Always
        }
    };
    plan.overwrite = args.overwrite;
    if let Some(bytes) = args.memory {
        plan.memory_bytes = bytes;
    }
    if let Some(threads) = args.threads {
        plan.threads = usize::from(threads.get());
    }
    if let Some(dir) = &args.temp_dir {
        if !dir.is_dir() {
            return Err(Failure::Usage(format!("{}: --temp-dir is not a folder", dir.display())));
        }
        plan.temp_dir = Some(dir.clone());
    }
    Ok(plan)
}

fn outliers(arg: OutliersArg) -> Outliers {
    match arg {
        OutliersArg::Keep => Outliers::Keep,
        OutliersArg::Drop => Outliers::Drop,
        OutliersArg::Fail => Outliers::Fail,
    }
}

fn on_fault(arg: FaultArg) -> OnFault {
    match arg {
        FaultArg::Skip => OnFault::Skip,
        FaultArg::Fail => OnFault::Fail,
    }
}

/// The folder's name if one folder was named, else that of the first scan in order of path, whatever was typed first.
pub(super) fn name_from(typed: &[PathBuf], files: &[PathBuf]) -> String {
    let folder = typed.first().filter(|path| typed.len() == 1 && path.is_dir());
    let full = folder.map(|path| path.canonicalize().unwrap_or_else(|_| path.clone()));
    let name = match &full {
        Some(folder) => folder.file_name(),
        None => files.first().and_then(|file| file.file_stem()),
    };
    name.map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// What is being read is never replaced, nor is anything put into a dataset that is. What else may be, the converter judges.
pub(super) fn protect_inputs(plan: &Plan, is_append: bool) -> Result<(), Failure> {
    // an output that cannot be found is an error of the run
    let Ok(output) = resolve_path(&plan.output) else { return Ok(()) };
    let others = plan.inputs.iter().filter(|input| !(is_append && **input == plan.output));
    let clash = others.into_iter().find_map(|input| {
        let found = input.canonicalize().ok()?;
        let what = if found.starts_with(&output) {
            "would replace"
        } else if output.starts_with(&found) {
            "would be inside of"
        } else {
            return None;
        };
        Some((input, what))
    });
    let Some((input, what)) = clash else { return Ok(()) };
    let (output, input) = (plan.output.display(), input.display());
    Err(Failure::Usage(format!("{output}: the output {what} the input {input}; choose another folder")))
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;
    use crate::args::{Args, Command};

    #[test]
    fn the_defaults_of_the_command_line_are_those_of_the_plan() {
        let args = Args::parse_from(["pointmill", "convert", "a.las", "-o", "out"]);
        let Command::Convert(args) = args.command else { panic!() };
        let files = vec![PathBuf::from("a.las")];
        let inputs = Inputs { files: files.clone(), ..Inputs::default() };
        let given = plan(&args, inputs).unwrap();
        let octree: Target = Potree2Settings::default().into();
        assert_eq!(format!("{:?}", targets(&args).unwrap()), format!("{:?}", [octree]));
        let mut usual = Plan::new(files, "out".into());
        usual.name = "a".to_owned();
        usual.filter.every = 1; // 0 and 1 both keep every point
        usual.checkpoint = Checkpoint::Auto; // a caller of the library asks for it: who does not resume has no use for what is left
        usual.memory_bytes = given.memory_bytes; // memory in use changes between two calls
        assert_eq!(format!("{given:?}"), format!("{usual:?}"));
    }
}

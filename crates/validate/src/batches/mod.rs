//! Quantised batches. `docs/formats/batches.md` is the only source of what is expected.
//!
//! # How positions are known
//! A file holds cells, not points. Where the planes determine the lattice integers X (a cell is finer than a step, or
//! holds one lattice point alone), everything of the page is recomputed from X and compared exactly: q, boxes, order,
//! candidates, error figures. Where they do not, because planes were omitted or the step is very fine, X comes from the
//! sources, if they are given and fit into memory ([`known`]). Else what is certain is checked all the same (boxes and
//! order to within a cell), and the report states what was not.
//!
//! # Tolerances
//! * rms of errors: 10⁻⁹, relative. Everything else about known positions: none.
//!
//! # Memory
//! Batches are streamed in windows, with the blocks that they need of compressed sections, within three quarters of what
//! is left of [`Options::memory_bytes`]; beside them 24 bytes per batch for boxes and 8 for originals.

mod batch;
mod batch_records;
mod blocks;
mod boxes;
mod bytes;
mod description;
mod examine;
mod extents;
mod figures;
mod formulas;
mod header;
mod known;
mod levels;
mod order;
mod originals;
mod positions;
mod ranges;
mod records;
mod sections;
mod task;
mod walk;

use std::path::Path;

use pointmill_format::{DatasetKind, ReadError};
use serde_json::json;

use crate::accuracy::{self, Known};
use crate::against::{Against, Context, Rules};
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::memory::{self, Budget};
use crate::options::{Options, ProgressFn};
use crate::outcome::{AgainstSummary, Outcome, SurfelSummary};
use crate::report;
use crate::surfels::{self, Derived};
use batch_records::Box32;
use bytes::Bytes;
use description::{Colour, Description};
use header::Header;
use known::Unknown;
use positions::Axis;
use records::Records;
use task::Task;
use walk::{Walked, walk};

/// Checks the file `path`.
///
/// # Errors
/// As [`crate::validate`].
pub(crate) fn run(path: &Path, options: &Options, progress: &ProgressFn<'_>) -> Result<Outcome, ReadError> {
    let bytes = Bytes::open(path)?;
    let mut budget = Budget::new(path, options.memory_bytes)?;
    let findings = Findings::new(DatasetKind::Batches, options.max_problems);
    let Some(header) = header::read(&bytes, &findings)? else {
        return Ok(stopped(findings, &[Check::Header], "the header cannot be used", None));
    };
    if header.description_bytes <= description::MAX_BYTES.min(bytes.len) {
        budget.require(header.description_bytes * memory::JSON)?;
    }
    let Some(description) = description::read(&bytes, &header, &findings)? else {
        let done = [Check::Header, Check::Description];
        return Ok(stopped(findings, &done, "the description cannot be used", Some(&header)));
    };
    let Some(sections) = sections::read(&bytes, &header, &description, &findings)? else {
        let done = [Check::Header, Check::Description, Check::Sections, Check::Blocks];
        return Ok(stopped(findings, &done, "a section cannot be used", Some(&header)));
    };
    budget.take(header.batches * task::BATCH_BYTES)?;
    let boxes = batch_records::read(&bytes, &header, &findings)?;
    let originals = match header.originals() {
        true => originals::read(&bytes, &header, sections.originals, &findings)?,
        false => None,
    };
    let determined = lattice_is_determined(&header, &description, &boxes, &findings);
    let report = report::find(path, &findings)?;
    let derived = Derived::of(report.as_ref(), &findings);
    let mut rules = records::rules(&header, &description);
    rules.set_apart(Derived::names_of(derived.as_ref()));
    let mut against = match options.against.as_slice() {
        [] => None,
        paths => Some(Against::open(paths, &options.open, rules.clone())?),
    };
    let mut known = None;
    let mut unknown = None;
    if let (false, Some(against)) = (determined, &mut against) {
        match known::positions(&header, &description.lattice, against, budget.left() / 2, progress)? {
            Ok(positions) => {
                budget.take(header.points * size_of::<[i64; 3]>() as u64)?;
                known = Some(positions);
            }
            Err(why) => {
                against.sums.ignore_positions();
                unknown = Some(why);
            }
        }
    }
    let columns = batch::columns(&sections);
    let window = task::window(&header, &columns, &budget)?;
    let task = Task {
        bytes: &bytes,
        header: &header,
        description: &description,
        boxes: &boxes,
        columns: &columns,
        originals: originals.as_ref(),
        known: known.as_deref(),
        findings: &findings,
        sums: against.as_ref().map(|a| &a.sums),
        progress,
        window,
    };
    let walked = walk(&task)?;
    conclude(&task, &walked);
    let summary = match &against {
        Some(against) => compare(&task, against, &walked, unknown.as_ref(), &budget)?,
        None => {
            findings.skip(Check::Against, "no sources were given");
            None
        }
    };
    let surfels = match &derived {
        Some(derived) => derived_attributes(&task, derived, (&rules, against.as_ref()), &walked, &budget)?,
        None => None,
    };
    let is_measured = walked.unreadable == 0 && walked.uncertain == 0 && walked.foreign == 0;
    let known = Known {
        points: header.points,
        projection: description.json["projection"].as_str().unwrap_or_default(),
        bounds: walked.world,
        lattice: against.as_ref().and_then(Against::measured).map(|m| m.lattice),
        format: is_measured.then_some(walked.errors.side),
    };
    report::check(report.as_ref(), (header.points, header.batches), &findings);
    let accuracy = accuracy::judge(report.as_ref(), &known, &findings);
    let mut outcome = finish(findings, Some(&header));
    outcome.against = summary;
    outcome.surfels = surfels;
    outcome.accuracy = accuracy;
    Ok(outcome)
}

/// True if the planes determine every point's lattice integers, by the boxes. Planes that are absent although they would
/// have determined them are reported: a writer should omit them only when asked to.
fn lattice_is_determined(
    header: &Header,
    description: &Description,
    boxes: &[Option<Box32>],
    findings: &Findings,
) -> bool {
    let fine = |bounds: &Box32, bits: u32| {
        (0..3).all(|a| Axis::new(&description.lattice, header.origin, bounds, a, bits).is_fine())
    };
    let determines = |bits: u32| boxes.iter().flatten().all(|bounds| fine(bounds, bits));
    let now = determines(header.bits());
    if !now && header.bits() < 30 && determines(30) {
        let coarse = boxes.iter().flatten().filter(|bounds| !fine(bounds, header.bits())).count();
        let found = format!("{} planes; cells of {coarse} batches are coarser than the source's step", header.planes());
        let expected = "planes that give every X back, unless fewer were asked for";
        findings.push(Finding::new(Check::Quantisation, "planes", expected, found).warning());
    }
    now
}

/// Checks that need all batches together, and what was not checked.
fn conclude(task: &Task<'_>, walked: &Walked) {
    let Task { header, description, findings, .. } = task;
    let blind = (walked.unreadable > 0).then(|| format!("{} batches could not be read", walked.unreadable));
    let uncertain = (walked.uncertain > 0)
        .then(|| format!("the planes leave a choice of positions for {} points", walked.uncertain));
    let foreign = (walked.foreign > 0).then(|| format!("{} points are no lattice points", walked.foreign));

    match (&blind, &uncertain) {
        (Some(why), _) | (None, Some(why)) => findings.skip(Check::TightBox, why.clone()),
        (None, None) => tight_box(header, walked, findings),
    }
    match blind.as_ref().or(uncertain.as_ref()).or(foreign.as_ref()) {
        Some(why) => findings.note(Check::Errors, why.clone()),
        None => figures::check(header, description, &walked.errors, findings),
    }
    let stated = description.attributes.iter().any(|a| a.min.is_some() || a.max.is_some());
    match &blind {
        Some(why) => findings.skip(Check::AttributeRanges, why.clone()),
        None if !stated && description.intensity_column().is_none() => {
            findings.skip(Check::AttributeRanges, "none are stated");
        }
        None => walked.ranges.check(description, findings),
    }
    if let Some(why) = blind.as_ref().or(uncertain.as_ref()) {
        findings.note(Check::StorageOrder, why.clone());
        findings.note(Check::Quantisation, why.clone());
        findings.note(Check::BatchBoxes, why.clone());
    }
    levels_skipped(task, walked, blind.or(uncertain));
    if !header.compressed() {
        findings.skip(Check::Blocks, "sections are not compressed");
    }
}

fn levels_skipped(task: &Task<'_>, walked: &Walked, why: Option<String>) {
    let Task { header, description, findings, .. } = task;
    if !header.levels() {
        findings.note(Check::Levels, "there are none");
    } else if let Some(why) = &why {
        findings.note(Check::Levels, format!("{} cells were not judged: {why}", walked.uncertain_cells));
    }
    if header.averaged() && task.originals.is_none() {
        let why = if header.originals() { "originals cannot be used" } else { "there are no originals" };
        findings.note(Check::Colours, why);
    } else if let (true, Some(why)) = (header.averaged(), why) {
        findings.note(Check::Colours, format!("{} cells were not judged: {why}", walked.uncertain_cells));
    } else if !header.averaged() && description.colour == Colour::Rgb {
        findings.skip(Check::Colours, "colours are not averaged");
    }
    if !header.originals() {
        findings.note(Check::Originals, "there are none");
    }
}

fn tight_box(header: &Header, walked: &Walked, findings: &Findings) {
    findings.checked(Check::TightBox, header.points);
    let Some(world) = walked.world else { return };
    for (subject, stated, side) in [("min", header.min, 0), ("max", header.max, 1)] {
        let found = world.map(|range| range[side]);
        if stated != found {
            findings.push(Finding::new(Check::TightBox, subject, json!(found), json!(stated)));
        }
    }
}

/// The multiset of points against the sources.
fn compare(
    task: &Task<'_>,
    against: &Against,
    walked: &Walked,
    unknown: Option<&Unknown>,
    budget: &Budget,
) -> Result<Option<AgainstSummary>, ReadError> {
    let findings = task.findings;
    if walked.unreadable > 0 {
        findings.skip(Check::Against, format!("{} batches could not be read", walked.unreadable));
        return Ok(None);
    }
    // records are read in windows again while the sources wait
    let mut budget = budget.clone();
    budget.take(task::window_bytes(task.header, task.columns, task.window))?;
    let context = Context { records: &Records { task }, findings, progress: task.progress, budget: &budget };
    let summary = against.compare(&context)?;
    let mut parts = Vec::new();
    if let Some(unknown) = unknown {
        parts.push(format!("positions, {}", unknown.why()));
    }
    if task.header.averaged() && task.originals.is_none() {
        parts.push("colours, whose originals are absent".to_owned());
    }
    if task.description.colour == Colour::Intensity && task.description.intensity_range.is_none() {
        parts.push("greys, whose range is not stated".to_owned());
    }
    if !parts.is_empty() {
        findings.note(Check::Against, format!("counts and attributes, without {}", parts.join(" and ")));
    }
    Ok(Some(summary))
}

/// Attributes that the conversion has computed.
fn derived_attributes(
    task: &Task<'_>,
    derived: &Derived,
    (rules, against): (&Rules, Option<&Against>),
    walked: &Walked,
    budget: &Budget,
) -> Result<Option<SurfelSummary>, ReadError> {
    let mut budget = budget.clone();
    budget.take(task::window_bytes(task.header, task.columns, task.window))?;
    let open = walked.uncertain + walked.foreign;
    let check = surfels::Task {
        derived,
        rules,
        points: task.header.points,
        unread: (walked.unreadable > 0).then(|| "not all batches could be read".into()),
        uncertain: (open > 0).then(|| "the planes leave a choice of positions".into()),
        is_octahedral: false,
        against,
        threads: rayon::current_num_threads(),
    };
    check.check(&Context {
        records: &Records { task },
        findings: task.findings,
        progress: task.progress,
        budget: &budget,
    })
}

/// The account of a validation that ended early: only `done` was looked at.
fn stopped(findings: Findings, done: &[Check], why: &str, header: Option<&Header>) -> Outcome {
    for check in Check::BATCHES.iter().filter(|c| !done.contains(c)) {
        findings.skip(*check, why);
    }
    let mut outcome = finish(findings, header);
    outcome.ok = false;
    outcome
}

fn finish(findings: Findings, header: Option<&Header>) -> Outcome {
    Outcome {
        encoding: header.map(|h| if h.compressed() { "zstd" } else { "raw" }),
        points: header.map_or(0, |h| h.points),
        nodes: header.map_or(0, |h| h.batches),
        ..Outcome::new(findings)
    }
}

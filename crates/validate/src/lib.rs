//! Does a Potree 2.0 dataset keep the promises of its format, and does it hold every point of its sources?
//!
//! ```no_run
//! use pointmill_validate::{Options, validate};
//!
//! # fn main() -> Result<(), pointmill_format::ReadError> {
//! let options = Options { against: vec!["scan.laz".into()], ..Options::default() };
//! let outcome = validate("clouds/city".as_ref(), &options, &|_| {})?;
//! for problem in &outcome.problems {
//!     println!("{problem}"); // error boxes r042: position (3 points): expected …, found …
//! }
//! assert!(outcome.ok);
//! # Ok(())
//! # }
//! ```
//!
//! The crate believes nobody. It shares the readers of `pointmill-format` and works out every expectation itself, from
//! `docs/formats/potree2.md`: boxes, spacing, order, checksums. That repetition is deliberate. It never sees the
//! converter.
//!
//! # Tolerances
//! * Boxes and the tight box: 4 ulps of the cube's largest coordinate on the axis; everything else about positions is
//!   exact, on integers.
//! * Distances (spacing, coverage): one step of the lattice.
//! * Sides of the cube against each other: 10⁻⁹, relative, and two ulps of its largest coordinate; spacing against
//!   side / 128: 10⁻⁹, relative.
//! * Attributes, counts, byte ranges, checksums: none.
//!
//! # Memory
//! Nodes are streamed. What stays is the table of nodes (about 100 bytes each), for every thread the points of the
//! inner nodes on the path from the root (some megabytes), and a cache of a quarter of [`Options::memory_bytes`].
//! A single node is read as a whole.
#![forbid(unsafe_code)]

mod against;
mod cache;
mod checks;
mod expect;
mod finding;
mod grid;
mod quality;
mod tree;
mod walk;

use std::path::{Path, PathBuf};

use pointmill_format::potree2::{ByteSource, Dataset, DatasetFile, Encoding, Folder};
use pointmill_format::{ErrorKind, OpenOptions, ReadError};
use serde::Serialize;
use serde_json::Value;

pub use against::AgainstSummary;
pub use finding::{Check, CheckResult, Finding, Severity};
pub use quality::LevelQuality;

use against::{Against, Context};
use checks::spacing::Sampling;
use expect::Geometry;
use finding::Findings;
use tree::Tree;
use walk::{Task, Walked, walk};

/// What to check, and with what means.
#[derive(Debug, Clone)]
pub struct Options {
    /// The scans that the dataset was made from, files only; empty: no comparison.
    pub against: Vec<PathBuf>,
    /// What text and E57 files do not say of themselves; as they were opened for the conversion.
    pub open: OpenOptions,
    /// Worker threads; 0: one for each core.
    pub threads: usize,
    /// What caches and the search for differing records may use, bytes. A guide, not a ceiling for the process.
    pub memory_bytes: u64,
    /// Problems listed for each check; all are counted.
    pub max_problems: usize,
    /// Check spacing and coverage and measure quality: the dearest part of a validation.
    pub neighbourhoods: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            against: Vec::new(),
            open: OpenOptions::default(),
            threads: 0,
            memory_bytes: 512 << 20,
            max_problems: 20,
            neighbourhoods: true,
        }
    }
}

/// How far a validation is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// `points` (of the dataset), `sources` (decoding the scans), `differences` (looking for what differs).
    pub phase: &'static str,
    /// Points done in this phase. Calls from several threads may overtake each other.
    pub done: u64,
    /// Points of the phase, as far as is known.
    pub total: u64,
}

/// Receives progress, from worker threads.
pub type ProgressFn<'a> = dyn Fn(Progress) + Sync + 'a;

/// What a validation found. Serialises to the object of `validate --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// No check found an error.
    pub ok: bool,
    /// `potree2`.
    pub format: &'static str,
    /// Encoding of the payloads, if the metadata could be read.
    pub encoding: Option<&'static str>,
    /// Points by the metadata.
    pub points: u64,
    /// Nodes that were reached from the root.
    pub nodes: u64,
    /// One entry for each of [`Check::ALL`], in that order.
    pub checks: Vec<CheckResult>,
    /// Findings, by check, at most [`Options::max_problems`] each; errors before warnings, coarse nodes before fine.
    pub problems: Vec<Finding>,
    /// One entry a level.
    pub quality: Vec<LevelQuality>,
    /// The comparison with the sources, if there was one.
    pub against: Option<AgainstSummary>,
}

/// Checks the dataset in the folder `dataset` (or with the `metadata.json` given). Broken promises are findings, not
/// errors.
///
/// `progress` is called from worker threads, often.
///
/// # Errors
/// The operating system cannot read the dataset (or it is not there), or a source to compare with cannot be opened or
/// decoded to its end.
pub fn validate(dataset: &Path, options: &Options, progress: &ProgressFn<'_>) -> Result<Outcome, ReadError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .thread_name(|i| format!("validate-{i}"))
        .build()
        .map_err(|e| ReadError::io(dataset, "starting threads", std::io::Error::other(e)))?;
    let named_metadata = dataset.file_name().is_some_and(|n| n == DatasetFile::Metadata.name());
    let folder = if named_metadata { dataset.parent().unwrap_or(dataset) } else { dataset };
    pool.install(|| run(folder, options, progress))
}

fn run(folder: &Path, options: &Options, progress: &ProgressFn<'_>) -> Result<Outcome, ReadError> {
    let source = Folder::open(folder)?;
    let findings = Findings::new(options.max_problems);
    let dataset = match Dataset::open(folder) {
        Ok(dataset) => dataset,
        Err(error) if matches!(error.kind, ErrorKind::Io(_)) => return Err(error),
        Err(error) => return unreadable_metadata(folder, findings, error),
    };
    checks::metadata::check(&read_json(folder)?.unwrap_or_default(), &findings);
    let metadata = dataset.metadata();
    let geometry = Geometry { lattice: metadata.lattice, cube: metadata.cube, spacing: metadata.spacing };
    let against = match options.against.as_slice() {
        [] => None,
        paths => Some(Against::open(paths, &options.open, metadata)?),
    };

    let mut tree = tree::walk(&source, metadata.first_chunk_size, &findings)?;
    checks::structure::check(&tree, metadata.points, metadata.depth, &findings);
    let octree_bytes = tree::size_of(&source as &dyn ByteSource, DatasetFile::Octree)?;
    let record_len = (metadata.encoding == Encoding::Default).then(|| metadata.record_len() as u64);
    checks::payload_ranges::check(&mut tree, octree_bytes, record_len, &findings);

    let walked = walk(&Task {
        dataset: &dataset,
        tree: &tree,
        geometry,
        findings: &findings,
        neighbourhoods: options.neighbourhoods && geometry.spacing_is_sane(),
        sampling: Sampling::from_word(metadata.extra.get("pointmill").and_then(|own| own["sampling"].as_str())),
        sums: against.as_ref().map(|a| &a.sums),
        progress,
        cache_bytes: usize::try_from(options.memory_bytes / 4).unwrap_or(usize::MAX),
        max_problems: options.max_problems,
    })?;
    checks::ranges::check(metadata, &geometry, &walked.seen, walked.unreadable == 0, &findings);
    say_what_was_skipped(&walked, &dataset, &geometry, options, &findings);
    let summary = match &against {
        Some(against) => Some(against.compare(&Context {
            dataset: &dataset,
            tree: &tree,
            findings: &findings,
            progress,
            memory_bytes: options.memory_bytes,
        })?),
        None => None,
    };

    let quality = quality(&tree, &walked, &geometry);
    let (checks, problems) = findings.finish();
    Ok(Outcome {
        ok: checks.iter().all(|c| c.ok),
        format: "potree2",
        encoding: Some(metadata.encoding.name()),
        points: metadata.points,
        nodes: tree.nodes.len() as u64,
        checks,
        problems,
        quality,
        against: summary,
    })
}

/// `metadata.json` as a JSON value; `None` if it is none.
fn read_json(folder: &Path) -> Result<Option<Value>, ReadError> {
    let path = folder.join(DatasetFile::Metadata.name());
    let bytes = std::fs::read(&path).map_err(|e| ReadError::io(&path, "reading", e))?;
    Ok(serde_json::from_slice(&bytes).ok())
}

/// All that can be said of a dataset whose metadata makes no sense.
fn unreadable_metadata(folder: &Path, findings: Findings, error: ReadError) -> Result<Outcome, ReadError> {
    for check in Check::ALL.into_iter().filter(|c| *c != Check::Metadata) {
        findings.skip(check, "metadata.json cannot be used");
    }
    if let Some(json) = read_json(folder)? {
        checks::metadata::check(&json, &findings);
    }
    if findings.found(Check::Metadata) == 0 {
        findings.push(Finding::new(Check::Metadata, "metadata.json", "valid metadata", error.what));
    }
    let (checks, problems) = findings.finish();
    Ok(Outcome {
        ok: false,
        format: "potree2",
        encoding: None,
        points: 0,
        nodes: 0,
        checks,
        problems,
        quality: Vec::new(),
        against: None,
    })
}

fn say_what_was_skipped(
    walked: &Walked,
    dataset: &Dataset,
    geometry: &Geometry,
    options: &Options,
    findings: &Findings,
) {
    let metadata = dataset.metadata();
    if metadata.encoding == Encoding::Default {
        findings.skip(Check::Order, "only BROTLI promises an order");
    }
    if metadata.attributes.iter().all(|a| a.histogram.is_none()) {
        findings.skip(Check::Histogram, "there are none");
    }
    if !options.neighbourhoods || !geometry.spacing_is_sane() {
        let why = if options.neighbourhoods { "the spacing is out of proportion" } else { "not asked for" };
        findings.skip(Check::Spacing, why);
        findings.skip(Check::Coverage, why);
    } else if walked.unreadable > 0 {
        findings.skip(Check::Coverage, format!("the points of {} nodes could not be read", walked.unreadable));
    }
    if options.against.is_empty() {
        findings.skip(Check::Against, "no sources were given");
    }
}

fn quality(tree: &Tree, walked: &Walked, geometry: &Geometry) -> Vec<LevelQuality> {
    let levels = walked.tallies.iter().zip(0..);
    let mut quality: Vec<_> = levels.map(|(t, level)| t.figures(level, geometry.spacing_at(level))).collect();
    for node in &tree.nodes {
        let level = &mut quality[usize::from(node.key.level)];
        level.nodes += 1;
        level.inner_nodes += u64::from(node.record.child_mask != 0);
        level.points += u64::from(node.record.points);
    }
    quality
}

//! Mean-split binary trees. `docs/formats/bintree.md` is the only source of what is expected.
//!
//! The reader of the format crate refuses an index that is not a tree; its error is then the only finding. Everything
//! about leaves and splits is computed here, from the bytes of the leaves.
//!
//! # Tolerances
//! None but for the distance of a decoded position from its lattice point: the bound of §5 of the page and two ulps of
//! the coordinate. Splits, boxes, centers and offsets are compared exactly.
//!
//! # Memory
//! About 600 bytes per node. Leaves are read in parallel, one per thread, each as a whole, by fewer threads where not all
//! fit [`Options::memory_bytes`]; what a split needs of the points
//! below it (exact sums, extremes, how many lie at the greatest coordinate) goes up the tree, so every point is read
//! once.

mod degenerate;
mod files;
mod head;
mod leaf;
mod lenient;
mod precision;
mod records;
mod routes;
mod scan;
mod splits;
mod summary;
mod tree;

use std::path::Path;

use pointmill_format::bintree::{Bintree, PACKED_FILE};
use pointmill_format::{Advice, DatasetKind, ReadError};

use crate::accuracy::{self, Known, Side};
use crate::against::{Against, Context};
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::memory::{Budget, on_threads};
use crate::options::{Options, ProgressFn};
use crate::outcome::{AgainstSummary, Outcome};
use crate::report;
use crate::surfels::{self, Derived};
use lenient::Lenient;
use records::Records;
use routes::Routes;
use scan::{Scan, Scanned};
use tree::Tree;

/// What a node takes in all tables together: the reader's, what is found in leaves, summaries, places.
const NODE_BYTES: u64 = 640;

/// Checks the dataset in `folder`.
///
/// # Errors
/// As [`crate::validate`].
pub(crate) fn run(folder: &Path, options: &Options, progress: &ProgressFn<'_>) -> Result<Outcome, ReadError> {
    let findings = Findings::new(DatasetKind::Bintree, options.max_problems);
    let mut budget = Budget::new(folder, options.memory_bytes)?;
    let most_nodes = usize::try_from(budget.left() / NODE_BYTES).unwrap_or(usize::MAX);
    let mut dataset = match Bintree::from_source_within(Lenient::new(folder), most_nodes) {
        Ok(dataset) => dataset,
        Err(error) if error.is_io() || error.advice() == Some(&Advice::MoreMemory) => return Err(error),
        Err(error) => return Ok(unreadable_index(findings, &error)),
    };
    budget.take(dataset.nodes().len() as u64 * NODE_BYTES)?;
    dataset.set_max_leaf_bytes(budget.left());
    let tree = Tree::new(&dataset);
    let lattice_known = head::check(folder, &tree, &findings)?;
    tree.check_capacity(&findings);
    tree.check_unions(&findings);
    let readable = files::check(folder, &tree, &findings)?;
    let report = report::find(folder, &findings)?;
    let derived = Derived::of(report.as_ref(), &findings);
    let mut rules = records::rules(&tree);
    rules.set_apart(Derived::names_of(derived.as_ref()));
    let against = match options.against.as_slice() {
        [] => None,
        paths => Some(Against::open(paths, &options.open, rules.clone())?),
    };
    let sums = against.as_ref().map(|a| &a.sums);
    let scan = Scan { tree: &tree, readable: &readable, lattice_known, sums, findings: &findings, progress };
    let threads = budget.threads(largest_leaf(&tree, &readable))?;
    let Scanned { summaries, ends, quality, deviation } = on_threads(threads, folder, || scan.run())?;
    let leaves_unread = tree.leaves().filter(|(index, _)| !readable[*index as usize]).count() as u64;
    let unknown = Unknown { lattice: !lattice_known, uncertain: quality.uncertain, unread: leaves_unread };
    let summaries = splits::check(&tree, summaries, &findings);
    degenerate::check(&tree, &summaries, &ends, &findings);
    unknown.note_what_was_skipped(&findings);

    let records = Records { tree: &tree, readable: &readable };
    let context = Context { records: &records, findings: &findings, progress, budget: &budget };
    let summary = compare(against.as_ref(), &tree, &unknown, &context)?;
    let header = dataset.header();
    // integers of the lattice, whatever is compared with the sources
    rules.stored = None;
    let surfels = match &derived {
        Some(derived) => surfels::Task {
            derived,
            rules: &rules,
            points: header.points,
            unread: (unknown.unread > 0 || findings.found(Check::LeafFiles) > 0)
                .then(|| "not all leaves could be read".into()),
            uncertain: unknown.integers(),
            is_octahedral: false,
            against: against.as_ref(),
            threads,
        }
        .check(&context)?,
        None => None,
    };

    let measured = against.as_ref().and_then(Against::measured);
    let is_certain = unknown.integers().is_none() && unknown.unread == 0;
    let certain = is_certain.then_some(Side { deviation, lost: 0, merged: Some(0) });
    let known = Known {
        points: header.points,
        projection: &header.projection,
        bounds: tree.nodes().first().map(|root| [0, 1, 2].map(|a| [root.bounds.min[a], root.bounds.max[a]])),
        lattice: measured.map(|m| m.lattice),
        format: certain.or(measured.and_then(|m| m.format)),
    };
    report::check(report.as_ref(), (header.points, dataset.nodes().len() as u64), &findings);
    let accuracy = accuracy::judge(report.as_ref(), &known, &findings);
    Ok(Outcome {
        encoding: Some(header.layout.name()),
        points: header.points,
        nodes: dataset.nodes().len() as u64,
        leaves: Some(quality),
        against: summary,
        surfels,
        accuracy,
        ..Outcome::new(findings)
    })
}

/// Bytes of the largest leaf in memory: as stored, as offsets, positions and integers.
fn largest_leaf(tree: &Tree<'_>, readable: &[bool]) -> u64 {
    const TAKEN_APART: u64 = 3 * (4 + 8 + 8);
    let leaves = tree.leaves().filter(|(index, _)| readable[*index as usize]).map(|(_, leaf)| leaf.count);
    leaves.max().unwrap_or(0).saturating_mul(tree.header().record.stride() as u64 + TAKEN_APART)
}

/// Why some things cannot be known.
struct Unknown {
    /// The index does not state the lattice.
    lattice: bool,
    /// Leaves that are too long for their integers to be certain.
    uncertain: u64,
    /// Leaves that could not be read.
    unread: u64,
}

impl Unknown {
    /// Why integers are not certain, if they are not.
    fn integers(&self) -> Option<String> {
        match self.uncertain {
            _ if self.lattice => Some("the index does not state the lattice".into()),
            0 => None,
            1 => Some("in 1 leaf single precision is too coarse for the lattice".into()),
            n => Some(format!("in {n} leaves single precision is too coarse for the lattice")),
        }
    }

    fn note_what_was_skipped(&self, findings: &Findings) {
        let unread = (self.unread > 0).then(|| format!("{} leaves could not be read", self.unread));
        if let Some(why) = self.integers() {
            [Check::Positions, Check::LeafOrder].into_iter().for_each(|c| findings.note(c, format!("{why}: skipped")));
        }
        if let Some(why) = self.integers().or(unread) {
            for check in [Check::SplitAxis, Check::Split, Check::Sides, Check::Degenerate] {
                findings.note(check, format!("{why}: nodes above were skipped"));
            }
        }
    }
}

/// The comparison with the sources: by integers on the lattice, or, where they are not certain, by the offsets that have
/// to be stored for them.
fn compare(
    against: Option<&Against>,
    tree: &Tree<'_>,
    unknown: &Unknown,
    context: &Context<'_>,
) -> Result<Option<AgainstSummary>, ReadError> {
    let Some(against) = against else {
        context.findings.skip(Check::Against, "no sources were given");
        return Ok(None);
    };
    let rules = against.sums.rules();
    let why_not = match rules.stored {
        _ if unknown.lattice => unknown.integers(),
        // no box showed that these leaves are too long, or offsets are not numbers
        None => unknown.integers(),
        Some(_) if rules.drop_duplicates => unknown.integers(),
        Some(_) if !Routes::are_certain(tree) => Some("the lattice is too fine for doubles".into()),
        Some(_) => None,
    };
    if let Some(why) = why_not {
        context.findings.skip(Check::Against, why);
        return Ok(None);
    }
    against.compare(context).map(Some)
}

/// The outcome for a dataset whose index is not a tree.
fn unreadable_index(findings: Findings, error: &ReadError) -> Outcome {
    let is_leaves = error.path().file_name().is_some_and(|name| name == PACKED_FILE);
    let (check, subject) = if is_leaves { (Check::LeafFiles, PACKED_FILE) } else { (Check::Index, "index.json") };
    for other in Check::BINTREE.iter().filter(|c| **c != check) {
        findings.skip(*other, "index.json cannot be used");
    }
    let at = error.offset().map_or_else(String::new, |at| format!(" (byte {at})"));
    findings.push(Finding::new(check, subject, "a tree", error.what() + &at));
    Outcome::new(findings)
}

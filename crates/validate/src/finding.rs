//! What a validation found: data first, a line of text for people second.

use std::borrow::Cow;
use std::fmt;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use pointmill_format::NodeKey;
use serde::{Serialize, Serializer};
use serde_json::Value;

/// A promise of the format. Each check stands for one; the order is that of reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs)] // `promise` says it
pub enum Check {
    Metadata,
    Hierarchy,
    NodeTypes,
    EmptyNodes,
    Depth,
    PointCount,
    PayloadRanges,
    Payloads,
    Order,
    Coordinates,
    Boxes,
    TightBox,
    AttributeRanges,
    Histogram,
    Spacing,
    Coverage,
    Against,
}

impl Check {
    /// Every check, in the order of reports.
    pub const ALL: [Self; 17] = [
        Self::Metadata,
        Self::Hierarchy,
        Self::NodeTypes,
        Self::EmptyNodes,
        Self::Depth,
        Self::PointCount,
        Self::PayloadRanges,
        Self::Payloads,
        Self::Order,
        Self::Coordinates,
        Self::Boxes,
        Self::TightBox,
        Self::AttributeRanges,
        Self::Histogram,
        Self::Spacing,
        Self::Coverage,
        Self::Against,
    ];

    /// The word in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Metadata => "metadata",
            Self::Hierarchy => "hierarchy",
            Self::NodeTypes => "node-types",
            Self::EmptyNodes => "empty-nodes",
            Self::Depth => "depth",
            Self::PointCount => "point-count",
            Self::PayloadRanges => "payload-ranges",
            Self::Payloads => "payloads",
            Self::Order => "order",
            Self::Coordinates => "coordinates",
            Self::Boxes => "boxes",
            Self::TightBox => "tight-box",
            Self::AttributeRanges => "attribute-ranges",
            Self::Histogram => "histogram",
            Self::Spacing => "spacing",
            Self::Coverage => "coverage",
            Self::Against => "against",
        }
    }

    /// What the dataset promises, in one line.
    pub const fn promise(self) -> &'static str {
        match self {
            Self::Metadata => "metadata.json is complete, in range and consistent",
            Self::Hierarchy => {
                "every hierarchy chunk holds exactly its records; chunks are disjoint and none is orphaned"
            }
            Self::NodeTypes => "a node is of type 0 exactly if it has children",
            Self::EmptyNodes => "no node is empty",
            Self::Depth => "hierarchy.depth is the deepest level that has a node",
            Self::PointCount => "the points of all nodes add up to points",
            Self::PayloadRanges => "payloads have the right size, do not overlap and cover octree.bin",
            Self::Payloads => "every payload decodes to exactly its points",
            Self::Order => "points of a BROTLI node are sorted by Morton code",
            Self::Coordinates => "stored coordinates are 0 or more and below 2^31",
            Self::Boxes => "every point lies in the box of its node",
            Self::TightBox => "min and max of position are the tight box of the points",
            Self::AttributeRanges => "min and max of every attribute bound its values and are attained",
            Self::Histogram => "histograms count the values that are there",
            Self::Spacing => "inner nodes are sampled as promised: no pair closer than the spacing of the level",
            Self::Coverage => "no hole: every point is within two spacings of a point drawn at each level above it",
            Self::Against => "every point and attribute of the sources is in the dataset exactly once",
        }
    }
}

impl Serialize for Check {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// A promise is broken; the dataset is not ok.
    Error,
    /// Unusual or troublesome for some clients, but allowed.
    Warning,
}

/// One broken promise.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Which promise.
    pub check: Check,
    /// How bad.
    pub severity: Severity,
    /// The node, if one is to blame; serialised as its name ("r042").
    #[serde(serialize_with = "node_name")]
    pub node: Option<NodeKey>,
    /// What was looked at ("childMask", "max of intensity").
    pub subject: Cow<'static, str>,
    /// What the format, the geometry or the sources ask for.
    pub expected: Value,
    /// What is there.
    pub found: Value,
    /// How many points are concerned, where points are.
    pub points: Option<u64>,
}

fn node_name<S: Serializer>(node: &Option<NodeKey>, serializer: S) -> Result<S::Ok, S::Error> {
    match node {
        Some(key) => serializer.collect_str(key),
        None => serializer.serialize_none(),
    }
}

impl Finding {
    /// An error about the dataset as a whole.
    pub(crate) fn new(
        check: Check,
        subject: impl Into<Cow<'static, str>>,
        expected: impl Into<Value>,
        found: impl Into<Value>,
    ) -> Self {
        Self {
            check,
            severity: Severity::Error,
            node: None,
            subject: subject.into(),
            expected: expected.into(),
            found: found.into(),
            points: None,
        }
    }

    /// Blames a node.
    pub(crate) fn at(mut self, node: NodeKey) -> Self {
        self.node = Some(node);
        self
    }

    /// Says how many points are concerned.
    pub(crate) fn points(mut self, points: u64) -> Self {
        self.points = Some(points);
        self
    }

    /// Makes it a warning.
    pub(crate) fn warning(mut self) -> Self {
        self.severity = Severity::Warning;
        self
    }

    /// Reports keep the first findings in this order, so that they do not depend on threads.
    fn sort_key(&self) -> (Severity, Option<NodeKey>, String, String, String) {
        let Self { severity, node, subject, expected, found, .. } = self;
        (*severity, *node, subject.to_string(), found.to_string(), expected.to_string())
    }
}

impl fmt::Display for Finding {
    /// One line: `error boxes r042: position of 3 points: expected …, found …`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        write!(f, "{severity} {}", self.check.name())?;
        if let Some(node) = self.node {
            write!(f, " {node}")?;
        }
        write!(f, ": {}", self.subject)?;
        match self.points {
            Some(1) => f.write_str(" (1 point)")?,
            Some(n) => write!(f, " ({n} points)")?,
            None => {}
        }
        write!(f, ": expected {}, found {}", plain(&self.expected), plain(&self.found))
    }
}

/// A string without its quotes, anything else as JSON.
fn plain(value: &Value) -> Cow<'_, str> {
    match value {
        Value::String(s) => Cow::Borrowed(s),
        other => Cow::Owned(other.to_string()),
    }
}

/// The account of one check.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CheckResult {
    /// Which.
    pub name: Check,
    /// What the dataset promises, in one line.
    pub promise: &'static str,
    /// No error; true also of a check that was skipped.
    pub ok: bool,
    /// How many things were looked at; the unit is that of the promise (points, nodes, keys).
    pub checked: u64,
    /// Errors found, listed or not.
    pub found: u64,
    /// Warnings, listed or not.
    pub warnings: u64,
    /// Why it was not (fully) done, if so.
    pub skipped: Option<String>,
}

impl fmt::Display for CheckResult {
    /// One line: `ok      boxes: every point lies in the box of its node (110000 checked)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = match (&self.skipped, self.ok) {
            (_, false) => "BROKEN",
            (Some(_), true) => "skipped",
            (None, true) => "ok",
        };
        write!(f, "{verdict:7} {}: {}", self.name.name(), self.promise)?;
        match &self.skipped {
            Some(why) => write!(f, " ({why})"),
            None if self.found > 0 => write!(f, " ({} checked, {} found)", self.checked, self.found),
            None => write!(f, " ({} checked)", self.checked),
        }
    }
}

#[derive(Debug, Default)]
struct Slot {
    kept: Vec<Finding>,
    found: u64,
    warnings: u64,
    skipped: Option<String>,
}

/// Gathers findings from many threads; keeps the first `cap` of each check in sort order, whoever comes first.
#[derive(Debug)]
pub(crate) struct Findings {
    cap: usize,
    slots: Vec<Mutex<Slot>>,
    checked: Vec<AtomicU64>,
}

impl Findings {
    pub(crate) fn new(cap: usize) -> Self {
        Self {
            cap,
            slots: Check::ALL.map(|_| Mutex::default()).into(),
            checked: Check::ALL.map(|_| AtomicU64::new(0)).into(),
        }
    }

    fn slot(&self, check: Check) -> std::sync::MutexGuard<'_, Slot> {
        self.slots[check as usize].lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Adds a finding.
    pub(crate) fn push(&self, finding: Finding) {
        let mut slot = self.slot(finding.check);
        match finding.severity {
            Severity::Error => slot.found += 1,
            Severity::Warning => slot.warnings += 1,
        }
        slot.kept.push(finding);
        if slot.kept.len() > 2 * self.cap + 16 {
            shorten(&mut slot.kept, self.cap);
        }
    }

    /// Counts `n` more errors of a check without listing them.
    pub(crate) fn more(&self, check: Check, n: u64) {
        self.slot(check).found += n;
    }

    /// How many findings of a check a report lists.
    pub(crate) fn cap(&self) -> usize {
        self.cap
    }

    /// Counts `n` more things that `check` looked at.
    pub(crate) fn checked(&self, check: Check, n: u64) {
        self.checked[check as usize].fetch_add(n, Ordering::Relaxed);
    }

    /// Says that a check was not done, and forgets what it may have found.
    pub(crate) fn skip(&self, check: Check, why: impl Into<String>) {
        *self.slot(check) = Slot { skipped: Some(why.into()), ..Slot::default() };
        self.checked[check as usize].store(0, Ordering::Relaxed);
    }

    /// Errors of a check so far.
    pub(crate) fn found(&self, check: Check) -> u64 {
        self.slot(check).found
    }

    /// Takes over the findings of one check from `other`.
    pub(crate) fn absorb(&self, check: Check, other: &Self) {
        self.checked(check, other.checked[check as usize].load(Ordering::Relaxed));
        let mut from = std::mem::take(&mut *other.slot(check));
        let mut slot = self.slot(check);
        slot.found += from.found;
        slot.warnings += from.warnings;
        slot.kept.append(&mut from.kept);
    }

    /// The account of every check, and the findings that were kept.
    pub(crate) fn finish(self) -> (Vec<CheckResult>, Vec<Finding>) {
        let mut results = Vec::new();
        let mut problems = Vec::new();
        for ((check, slot), checked) in Check::ALL.into_iter().zip(self.slots).zip(self.checked) {
            let mut slot = slot.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
            shorten(&mut slot.kept, self.cap);
            results.push(CheckResult {
                name: check,
                promise: check.promise(),
                ok: slot.found == 0,
                checked: checked.into_inner(),
                found: slot.found,
                warnings: slot.warnings,
                skipped: slot.skipped,
            });
            problems.append(&mut slot.kept);
        }
        (results, problems)
    }
}

fn shorten(findings: &mut Vec<Finding>, cap: usize) {
    findings.sort_by_cached_key(Finding::sort_key);
    findings.truncate(cap);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_capped_list_keeps_the_first_in_order_and_counts_all() {
        let findings = Findings::new(2);
        for level in (0..30).rev() {
            let key = NodeKey { level, x: 0, y: 0, z: 0 };
            findings.push(Finding::new(Check::Boxes, "position", 1, 2).at(key));
        }
        let (results, problems) = findings.finish();
        assert_eq!(results[Check::Boxes as usize].found, 30);
        assert_eq!(problems.iter().map(|p| p.node.unwrap().level).collect::<Vec<_>>(), [0, 1]);
    }

    #[test]
    fn a_finding_prints_on_one_line_and_serialises_with_names() {
        let key = NodeKey::from_name("r04").unwrap();
        let finding = Finding::new(Check::EmptyNodes, "numPoints", "at least 1", 0).at(key);
        assert_eq!(finding.to_string(), "error empty-nodes r04: numPoints: expected at least 1, found 0");
        let json = serde_json::to_value(&finding).unwrap();
        assert_eq!((json["check"].as_str(), json["node"].as_str()), (Some("empty-nodes"), Some("r04")));
    }

    #[test]
    fn checks_are_indexed_by_their_place_in_the_list() {
        assert!(Check::ALL.iter().enumerate().all(|(i, c)| *c as usize == i));
    }
}

//! What a validation found: data first, a line of text for people second.

use std::borrow::Cow;
use std::fmt;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use serde::Serialize;
use serde_json::Value;

use crate::DatasetKind;
use crate::check::Check;
use crate::place::Place;

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// A requirement is not met; the dataset is not ok.
    Error,
    /// Unusual or troublesome for some clients, but allowed.
    Warning,
}

/// One requirement that is not met.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Which requirement.
    pub check: Check,
    /// How bad.
    pub severity: Severity,
    /// The node or batch, if one is to blame; serialised as its name ("r042").
    pub node: Option<Place>,
    /// What was looked at ("childMask", "max of intensity").
    pub subject: Cow<'static, str>,
    /// What the format, the geometry or the sources ask for.
    pub expected: Value,
    /// What is there.
    pub found: Value,
    /// How many points are concerned, where points are.
    pub points: Option<u64>,
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

    /// Blames a node or batch.
    pub(crate) fn at(mut self, place: impl Into<Place>) -> Self {
        self.node = Some(place.into());
        self
    }

    /// Sets how many points are affected.
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
    fn sort_key(&self) -> (Severity, Option<Place>, String, String, String) {
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

/// Counts faults of one kind at one place, and remembers the first.
#[derive(Debug, Default)]
pub(crate) struct Faults {
    count: u64,
    first: Option<(Value, Value)>,
}

impl Faults {
    /// Takes in a fault: what was expected, and what was found.
    pub(crate) fn add(&mut self, expected: impl Into<Value>, found: impl Into<Value>) {
        self.count += 1;
        self.first.get_or_insert_with(|| (expected.into(), found.into()));
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// What to report, if there were any.
    pub(crate) fn finding(
        self,
        check: Check,
        subject: impl Into<Cow<'static, str>>,
        place: impl Into<Place>,
    ) -> Option<Finding> {
        let (expected, found) = self.first?;
        Some(Finding::new(check, subject, expected, found).at(place).points(self.count))
    }

    /// Pushes one finding, if there were any.
    pub(crate) fn report(
        self,
        check: Check,
        subject: impl Into<Cow<'static, str>>,
        place: impl Into<Place>,
        findings: &Findings,
    ) {
        self.finding(check, subject, place).into_iter().for_each(|finding| findings.push(finding));
    }
}

/// The account of one check.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CheckResult {
    /// Which.
    pub name: Check,
    /// The requirement, in one line.
    pub promise: &'static str,
    /// No error; true also of a check that was skipped.
    pub ok: bool,
    /// How many things were checked; the unit is that of the requirement (points, nodes, keys).
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
            (Some(_), true) if self.checked > 0 => "in part",
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
    format: DatasetKind,
    cap: usize,
    /// By [`Check::index`]; those of other formats stay empty.
    slots: Vec<Mutex<Slot>>,
    checked: Vec<AtomicU64>,
    /// The dataset has attributes that a conversion has computed: their checks are reported, too.
    is_derived: AtomicBool,
}

impl Findings {
    /// Keeps at most `cap` findings of each check of `format`.
    pub(crate) fn new(format: DatasetKind, cap: usize) -> Self {
        Self {
            format,
            cap,
            slots: std::iter::repeat_with(Mutex::default).take(Check::COUNT).collect(),
            checked: std::iter::repeat_with(AtomicU64::default).take(Check::COUNT).collect(),
            is_derived: AtomicBool::new(false),
        }
    }

    /// The format whose checks these are.
    pub(crate) fn format(&self) -> DatasetKind {
        self.format
    }

    /// Adds [`Check::DERIVED`] to the checks that are reported.
    pub(crate) fn include_derived(&self) {
        self.is_derived.store(true, Ordering::Relaxed);
    }

    fn slot(&self, check: Check) -> std::sync::MutexGuard<'_, Slot> {
        self.slots[check.index()].lock().unwrap_or_else(std::sync::PoisonError::into_inner)
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
        self.checked[check.index()].fetch_add(n, Ordering::Relaxed);
    }

    /// Records that a check was not done, and discards its findings.
    pub(crate) fn skip(&self, check: Check, why: impl Into<String>) {
        *self.slot(check) = Slot { skipped: Some(why.into()), ..Slot::default() };
        self.checked[check.index()].store(0, Ordering::Relaxed);
    }

    /// Records that a check was done in part, and keeps its findings.
    pub(crate) fn note(&self, check: Check, why: impl Into<String>) {
        self.slot(check).skipped = Some(why.into());
    }

    /// Errors of a check so far.
    pub(crate) fn found(&self, check: Check) -> u64 {
        self.slot(check).found
    }

    /// Takes over the findings of one check from `other`.
    pub(crate) fn absorb(&self, check: Check, other: &Self) {
        self.checked(check, other.checked[check.index()].load(Ordering::Relaxed));
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
        let derived = if self.is_derived.load(Ordering::Relaxed) { Check::DERIVED } else { &[] };
        for check in Check::of(self.format).iter().chain(derived) {
            let mut slot = std::mem::take(&mut *self.slot(*check));
            shorten(&mut slot.kept, self.cap);
            results.push(CheckResult {
                name: *check,
                promise: check.promise(),
                ok: slot.found == 0,
                checked: self.checked[check.index()].load(Ordering::Relaxed),
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
    use pointmill_format::NodeKey;

    use super::*;

    #[test]
    fn a_capped_list_keeps_the_first_in_order_and_counts_all() {
        let findings = Findings::new(DatasetKind::Potree2, 2);
        for level in (0..30).rev() {
            let key = NodeKey { level, x: 0, y: 0, z: 0 };
            findings.push(Finding::new(Check::Boxes, "position", 1, 2).at(key));
        }
        let (results, problems) = findings.finish();
        assert_eq!(results.iter().find(|r| r.name == Check::Boxes).unwrap().found, 30);
        let places = [0, 1].map(|level| Some(Place::Octree(NodeKey { level, x: 0, y: 0, z: 0 })));
        assert_eq!(problems.iter().map(|p| p.node).collect::<Vec<_>>(), places);
    }

    #[test]
    fn a_finding_prints_on_one_line_and_serialises_with_names() {
        let key = NodeKey::from_name("r04").unwrap();
        let finding = Finding::new(Check::EmptyNodes, "numPoints", "at least 1", 0).at(key);
        assert_eq!(finding.to_string(), "error empty-nodes r04: numPoints: expected at least 1, found 0");
        let json = serde_json::to_value(&finding).unwrap();
        assert_eq!((json["check"].as_str(), json["node"].as_str()), (Some("empty-nodes"), Some("r04")));
    }
}

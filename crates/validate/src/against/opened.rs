//! A scan that is open, read as blocks of records in the dataset's terms.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use pointmill_format::{Attribute, AttributeType, AxisGrid, Column, PointBatch, Positions, Scan, Wanted, with_column};

use super::block::{Block, append_exact_words, append_words};
use super::distinct::Residue;
use super::exact::Exact;
use super::follows::Followed;
use super::meaning::{Feed, Meaning, feed, fine_angles};
use super::rules::Conversion::{self, AsStored, FineAngle, Grey, NotWritten, WholeClass};
use super::rules::{Rules, grey};
use super::selection::Selection;

/// A position moved by this part of a step of its scan is neither's: its integer does not come back.
const HALF: f64 = 0.499_999;

/// A scan that is open, and where its columns go.
pub(super) struct Opened {
    pub(super) scan: Box<dyn Scan>,
    /// From its integers to the dataset's lattice, by axis.
    exact: [Option<Exact>; 3],
    /// For each attribute of the dataset: what fills it.
    columns: Vec<Option<Feed>>,
    /// The column that the filter by class looks at.
    classification: Option<usize>,
    selection: Selection,
    /// Columns that must have one value, by the metadata: column, what its values mean, value, and its place among the
    /// constants of the rules.
    constants: Vec<(usize, Meaning, Vec<f64>, usize)>,
    /// Columns that must follow from others, by the metadata.
    follows: Vec<Followed>,
}

/// What all scans together decide for each.
pub(super) struct Common {
    /// By attribute of the dataset: doubles that stand for integers beyond 2⁵³ may be rounded.
    pub(super) rounds: Vec<bool>,
    /// Positions that the lattice makes equal are told apart: some scan has positions that may move.
    pub(super) is_marked: bool,
    /// Points that differ from what is said to be one value throughout, by entry of the rules' constants; of the last pass.
    pub(super) deviating: Vec<AtomicU64>,
    /// The same of what is said to follow from another attribute, by rule.
    pub(super) not_following: Vec<AtomicU64>,
}

/// What is learned of a scan when it is opened first.
pub(super) struct Look {
    pub(super) pieces: usize,
    pub(super) points: u64,
    /// What a thread takes to decode a piece of it, at most, bytes.
    pub(super) decode_bytes: u64,
    /// Positions may move to the lattice of the job.
    pub(super) may_move: bool,
    pub(super) declares_16_bit_colour: bool,
    /// By attribute of the dataset, the type of the column that fills it.
    pub(super) types: Vec<Option<AttributeType>>,
    /// Columns that the dataset does not have.
    pub(super) not_in_dataset: Vec<String>,
}

impl Opened {
    pub(super) fn new(scan: Box<dyn Scan>, rules: &Rules) -> Self {
        let info = scan.info();
        let find = |name: &str| info.attributes.iter().position(|a| a.name == name);
        let attributes = rules.attributes.iter().zip(&rules.conversions);
        let feed = |(a, c): (&Attribute, &Conversion)| match c {
            NotWritten => None,
            c => feed(a, &rules.attributes, &info.attributes, rules.foreign || *c != AsStored),
        };
        let columns = attributes.map(feed).collect();
        let classification = rules.classes.is_some().then(|| find("classification")).flatten();
        let constant = |(i, (name, value)): (usize, &(String, Vec<f64>))| {
            let column = find(name)?;
            Some((column, Meaning::of(&info.attributes[column]), value.clone(), i))
        };
        let constants = rules.constants.iter().enumerate().filter_map(constant).collect();
        let follows = rules.follows.iter().enumerate();
        let follows = follows.filter_map(|rule| Followed::of(rule, &info.attributes)).collect();
        let exact = std::array::from_fn(|a| {
            let own = info.lattice.map(|l| AxisGrid { step: l.scale[a], offset: l.offset[a] });
            own.and_then(|own| Exact::new(own, rules.job_grid(a)))
        });
        let selection = Selection::new(info, rules);
        Self { exact, columns, classification, selection, constants, follows, scan }
    }

    pub(super) fn look(&self, rules: &Rules) -> Look {
        let info = self.scan.info();
        let feeds = self.columns.iter().map(|feed| Some(info.attributes[feed.as_ref()?.column].ty));
        let written = rules.attributes.iter().zip(&rules.conversions).filter(|(_, c)| **c != NotWritten);
        let written: Vec<&str> = written.map(|(a, _)| a.name.as_str()).collect();
        let is_used = |name: &str| self.columns.iter().flatten().any(|feed| info.attributes[feed.column].name == name);
        let is_absent = |name: &&String| !written.contains(&name.as_str()) && !is_used(name);
        let pieces = self.scan.pieces();
        Look {
            pieces: pieces.len(),
            points: pieces.iter().map(|p| p.points).sum(),
            decode_bytes: self.scan.decode_bytes(&self.wanted()),
            may_move: !self.exact.iter().all(|e| e.is_some_and(|e| e.is_whole())),
            declares_16_bit_colour: info.rgb_is_16_bit,
            types: feeds.collect(),
            not_in_dataset: info.attributes.iter().map(|a| &a.name).filter(is_absent).cloned().collect(),
        }
    }

    pub(super) fn wanted(&self) -> Wanted {
        let mut wanted = Wanted::positions(self.scan.info());
        let columns = self.columns.iter().flatten().map(|c| c.column);
        let follows = self.follows.iter().flat_map(|f| [f.column, f.from]);
        for i in columns.chain(self.classification).chain(self.constants.iter().map(|c| c.0)).chain(follows) {
            wanted.set(i, true);
        }
        wanted
    }

    /// Brings points of a batch into the dataset's terms.
    #[allow(clippy::unnecessary_cast)] // one body for every type of column
    pub(super) fn fill(
        &self,
        batch: &PointBatch,
        start: usize,
        points: usize,
        (all, rules): (&Common, &Rules),
        block: &mut Block,
    ) {
        block.reset(rules.attributes.len());
        block.keep.resize(points, true);
        block.moved.lost.resize(points, false);
        block.moved.first = batch.first_point + start as u64;
        for axis in 0..3 {
            self.fill_axis(batch, start, points, axis, rules, block);
        }
        if rules.drop_duplicates {
            block.residues.extend(self.residues(batch, start, points, rules, &block.positions));
        }
        if all.is_marked {
            block.moved.marks.extend(self.residues(batch, start, points, rules, &block.positions));
        }
        self.selection.apply(batch, start, &mut block.keep);
        if let Some(stored) = &rules.stored {
            for i in 0..points {
                let step = block.position(i);
                let words = stored.stored(step);
                block.moved.steps.push(step);
                words.into_iter().enumerate().for_each(|(axis, word)| block.positions[axis][i] = word);
            }
        }
        for (i, attribute) in rules.attributes.iter().enumerate() {
            let feed = self.columns[i].as_ref();
            let words = &mut block.words[i];
            if rules.conversions[i] == WholeClass {
                let class = Attribute::new("classification", AttributeType::Float64, 1);
                append_words(feed.map(|f| (&batch.columns[f.column], f.elements)), start, points, &class, words);
            } else if let (FineAngle, Some(f)) = (rules.conversions[i], feed) {
                let meaning = Meaning::of(&self.scan.info().attributes[f.column]);
                let fine = fine_angles(&meaning.values(&batch.columns[f.column], start, points));
                append_words(Some((&fine, f.elements)), 0, points, attribute, words);
            } else {
                append_feed(feed, batch, start..start + points, (attribute, all.rounds[i]), words);
            }
            match rules.conversions[i] {
                AsStored | FineAngle | NotWritten => {}
                WholeClass => words.iter_mut().for_each(|w| *w = whole_class(*w)),
                Grey(range) => words.iter_mut().for_each(|w| *w = grey(*w, range)),
            }
        }
        if rules.every > 1 {
            let first = batch.first_point + start as u64;
            for (i, keep) in block.keep.iter_mut().enumerate() {
                *keep &= (first + i as u64).is_multiple_of(rules.every);
            }
        }
        if let Some(classes) = &rules.classes {
            let column = self.classification.map(|i| &batch.columns[i]);
            for (i, keep) in block.keep.iter_mut().enumerate() {
                // a scan without classes has never been classified: class 0
                let class = column.map_or(0.0, |c| with_column!(c, v => v.get(start + i).map_or(0.0, |v| *v as f64)));
                *keep &= classes.iter().any(|c| *c as f64 == class);
            }
        }
        for (column, meaning, value, constant) in &self.constants {
            let is_rgb = self.scan.info().attributes[*column].name == "rgb";
            let count = count_deviating(&batch.columns[*column], start, (meaning, value), &block.keep, is_rgb);
            all.deviating[*constant].fetch_add(count, Relaxed);
        }
        for follows in &self.follows {
            let count = follows.count_deviating(&batch.columns, start, &block.keep);
            all.not_following[follows.rule].fetch_add(count, Relaxed);
        }
    }

    /// What the lattice takes away of positions, as a word each.
    fn residues<'a>(
        &'a self,
        batch: &'a PointBatch,
        start: usize,
        points: usize,
        rules: &'a Rules,
        positions: &'a [Vec<i64>; 3],
    ) -> impl Iterator<Item = u64> + 'a {
        let own = self.scan.info().lattice;
        let world = move |axis: usize, i: usize| match (&batch.positions, &own) {
            (Positions::Quantized(p), Some(l)) => f64::from(p[axis][i]) * l.scale[axis] + l.offset[axis],
            (Positions::Quantized(p), None) => f64::from(p[axis][i]),
            (Positions::World(p), _) => p[axis][i],
        };
        (0..points).map(move |i| {
            let mut residue = Residue::default();
            for (axis, stored) in positions.iter().enumerate() {
                residue.add(rules, own.as_ref(), axis, world(axis, start + i), stored[i]);
            }
            residue.word()
        })
    }

    fn fill_axis(
        &self,
        batch: &PointBatch,
        start: usize,
        points: usize,
        axis: usize,
        rules: &Rules,
        block: &mut Block,
    ) {
        let lattice = self.scan.info().lattice;
        let mut take = |i: usize, world: f64, exact: Option<(i64, f64)>| {
            let steps = rules.job_steps(axis, world);
            let job = exact.map_or(steps.round_ties_even() as i64, |(job, _)| job);
            let moved = &mut block.moved;
            let in_doubles = rules.job_world(axis, job as f64) - world;
            let change = exact.map_or(in_doubles, |(_, change)| change);
            moved.world[axis].push(world);
            moved.lattice[axis].push(change);
            moved.lost[i] |= lattice.is_some_and(|own| change.abs() >= HALF * own.scale[axis]);
            block.positions[axis].push(rules.stored_steps(axis, job));
            if rules.foreign {
                block.truncated[axis].push(rules.stored_steps(axis, steps as i64));
            }
            // a point without a finite position is none
            block.keep[i] &= world.is_finite();
        };
        match (&batch.positions, lattice) {
            (Positions::Quantized(values), Some(lattice)) => {
                let (scale, offset) = (lattice.scale[axis], lattice.offset[axis]);
                let values = values[axis][start..start + points].iter().enumerate();
                let exact = self.exact[axis];
                let on_job = |v| exact.map(|e| (e.nearest(v), e.change(v)));
                values.for_each(|(i, v)| take(i, f64::from(*v) * scale + offset, on_job(*v)));
            }
            (Positions::World(values), _) => {
                values[axis][start..start + points].iter().enumerate().for_each(|(i, v)| take(i, *v, None));
            }
            (Positions::Quantized(values), None) => {
                let values = values[axis][start..start + points].iter().enumerate();
                values.for_each(|(i, v)| take(i, f64::from(*v), None));
            }
        }
    }
}

/// The words of some points of a batch, as `attribute` has them. `rounds`: integers that a double does not hold may be
/// rounded.
fn append_feed(
    feed: Option<&Feed>,
    batch: &PointBatch,
    points: Range<usize>,
    (attribute, rounds): (&Attribute, bool),
    out: &mut Vec<u64>,
) {
    let (start, count) = (points.start, points.len());
    match feed {
        Some(Feed { column, meaning: Some(meaning), elements, .. }) => {
            let meant = meaning.values(&batch.columns[*column], start, count);
            append_words(Some((&meant, *elements)), 0, count, attribute, out);
        }
        Some(Feed { column, exact: true, .. }) if !rounds => {
            append_exact_words(&batch.columns[*column], start, count, attribute, out);
        }
        other => {
            let column = other.map(|f| (&batch.columns[f.column], f.elements));
            append_words(column, start, count, attribute, out);
        }
    }
}

/// Bits of a double, to those of the single next to its whole number; 0 if that is not finite or beyond ±2²⁴.
fn whole_class(bits: u64) -> u64 {
    let class = f64::from_bits(bits).round();
    // adding 0 makes −0 the 0 that it means
    let class = if class.abs() <= 16_777_216.0 { class as f32 + 0.0 } else { 0.0 };
    u64::from(class.to_bits())
}

/// Points that are kept and have another value. `is_rgb`: 8-bit values may stand for 16-bit ones.
#[allow(clippy::unnecessary_cast)] // one body for every type of column
fn count_deviating(
    column: &Column,
    start: usize,
    (meaning, value): (&Meaning, &[f64]),
    keep: &[bool],
    is_rgb: bool,
) -> u64 {
    let elements = value.len().max(1);
    let differs = |e: usize, v: f64, constant: f64| !(meaning.is(v, e, constant) || is_rgb && v * 257.0 == constant);
    with_column!(column, values => {
        let points = values.chunks_exact(elements).skip(start).zip(keep);
        points.filter(|(v, keep)| **keep && v.iter().zip(value).enumerate().any(|(e, (v, c))| differs(e, *v as f64, *c))).count() as u64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_become_whole_and_finite() {
        let cases = [
            (2.0, 2.0),
            (2.6, 3.0),
            (-0.2, 0.0),
            (f64::NAN, 0.0),
            (f64::INFINITY, 0.0),
            (3e8, 0.0),
            (16_777_217.0, 0.0),
        ];
        for (class, expected) in cases {
            assert_eq!(whole_class(class.to_bits()), u64::from(f32::to_bits(expected)), "{class}");
        }
    }
}

//! The scans a dataset was made from, read as blocks of records in the dataset's terms.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

use pointmill_format::{
    Attribute, AttributeType, AxisGrid, Column, OpenOptions, PointBatch, Positions, ReadError, Scan, Scratch, Wanted,
    open_scan, with_column,
};
use rayon::prelude::*;

use super::block::{BLOCK_POINTS, Block, append_words};
use super::distinct::Residue;
use super::exact::Exact;
use super::rules::Conversion::{AsStored, Grey, WholeClass};
use super::rules::{Rules, grey};
use super::selection::Selection;
use crate::options::{Progress, ProgressFn};

/// A scan, and where its columns go.
pub(crate) struct Source {
    scan: Box<dyn Scan>,
    /// From its integers to the dataset's lattice, by axis.
    exact: [Option<Exact>; 3],
    /// For each attribute of the dataset: the column of the scan with its name, and its elements.
    columns: Vec<Option<(usize, usize)>>,
    /// The column that the filter by class looks at.
    classification: Option<usize>,
    selection: Selection,
    /// Columns that must have one value, by the metadata: column, elements, value.
    constants: Vec<(usize, Vec<f64>)>,
    /// Points whose value differs from the constant, by entry of `constants`.
    deviating: Vec<AtomicU64>,
}

/// All scans.
pub(crate) struct Sources {
    pub(crate) list: Vec<Source>,
    /// (source, piece), all of them.
    pieces: Vec<(usize, usize)>,
    pub(crate) points: u64,
}

impl Sources {
    /// Opens the files; decodes nothing.
    pub(crate) fn open(paths: &[PathBuf], options: &OpenOptions, rules: &Rules) -> Result<Self, ReadError> {
        let list =
            paths.iter().map(|p| Ok(Source::new(open_scan(p, options)?, rules))).collect::<Result<Vec<_>, _>>()?;
        let pieces = list.iter().enumerate();
        let pieces = pieces.flat_map(|(i, s)| (0..s.scan.pieces().len()).map(move |piece| (i, piece))).collect();
        let points = list.iter().flat_map(|s| s.scan.pieces()).map(|p| p.points).sum();
        Ok(Self { list, pieces, points })
    }

    /// Names of columns of the scans that the dataset does not have, sorted.
    pub(crate) fn not_in_dataset(&self, rules: &Rules) -> Vec<String> {
        let names = self.list.iter().flat_map(|s| s.scan.info().attributes.iter()).map(|a| &a.name);
        let mut names: Vec<String> =
            names.filter(|name| rules.attributes.iter().all(|a| a.name != **name)).cloned().collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Attributes that were dropped as constant but are not: name, points that differ.
    pub(crate) fn deviating(&self) -> Vec<(String, u64)> {
        let mut all: Vec<(String, u64)> = Vec::new();
        for source in &self.list {
            for ((column, _), count) in source.constants.iter().zip(&source.deviating) {
                let name = &source.scan.info().attributes[*column].name;
                match all.iter_mut().find(|(n, _)| n == name) {
                    Some((_, sum)) => *sum += count.load(Relaxed),
                    None => all.push((name.clone(), count.load(Relaxed))),
                }
            }
        }
        all.retain(|(_, count)| *count > 0);
        all
    }

    /// Decodes everything in parallel and hands it over in blocks, with the index of the source and whether the block
    /// has a colour value above 255. `work` is called from many threads.
    pub(crate) fn each_block(
        &self,
        rules: &Rules,
        progress: &ProgressFn<'_>,
        phase: &'static str,
        work: impl Fn(&mut Block, usize) + Sync,
    ) -> Result<(), ReadError> {
        let idle: Mutex<Vec<(Scratch, Block)>> = Mutex::default();
        let done = AtomicU64::new(0);
        let failed = AtomicBool::new(false);
        self.pieces.par_iter().with_max_len(1).try_for_each(|&(at, piece)| {
            if failed.load(Relaxed) {
                return Ok(()); // another piece brings the error
            }
            let source = &self.list[at];
            let pop = idle.lock().map_or(None, |mut idle| idle.pop());
            let (mut scratch, mut block) = pop.unwrap_or_default();
            let wanted = source.wanted();
            let result = source.scan.decode(piece, &wanted, &mut scratch, &mut |batch| {
                for start in (0..batch.len()).step_by(BLOCK_POINTS) {
                    let points = (batch.len() - start).min(BLOCK_POINTS);
                    source.fill(batch, start, points, rules, &mut block);
                    work(&mut block, at);
                }
                let batch_points = batch.len() as u64;
                let done = done.fetch_add(batch_points, Relaxed) + batch_points;
                progress(Progress { phase, done, total: self.points });
                ControlFlow::Continue(())
            });
            if let Ok(mut idle) = idle.lock() {
                idle.push((scratch, block));
            }
            if result.is_err() {
                failed.store(true, Relaxed);
            }
            result
        })
    }
}

impl Source {
    fn new(scan: Box<dyn Scan>, rules: &Rules) -> Self {
        let info = scan.info();
        let find = |name: &str| info.attributes.iter().position(|a| a.name == name);
        let attributes = rules.attributes.iter().zip(&rules.conversions);
        let columns =
            attributes.map(|(a, c)| column_of(a, &info.attributes, rules.foreign || *c != AsStored)).collect();
        let classification = rules.classes.is_some().then(|| find("classification")).flatten();
        let constants: Vec<_> =
            rules.constants.iter().filter_map(|(name, value)| Some((find(name)?, value.clone()))).collect();
        let deviating = constants.iter().map(|_| AtomicU64::new(0)).collect();
        let selection = Selection::new(info, rules);
        let exact = std::array::from_fn(|a| {
            let own = info.lattice.map(|l| AxisGrid { step: l.scale[a], offset: l.offset[a] });
            own.and_then(|own| Exact::new(own, rules.job_grid(a)))
        });
        Self { exact, columns, classification, selection, constants, deviating, scan }
    }

    fn wanted(&self) -> Wanted {
        let mut wanted = Wanted::positions(self.scan.info());
        let columns = self.columns.iter().flatten().map(|c| c.0);
        for i in columns.chain(self.classification).chain(self.constants.iter().map(|c| c.0)) {
            wanted.set(i, true);
        }
        wanted
    }

    /// Brings points of a batch into the dataset's terms.
    #[allow(clippy::unnecessary_cast)] // one body for every type of column
    fn fill(&self, batch: &PointBatch, start: usize, points: usize, rules: &Rules, block: &mut Block) {
        block.reset(rules.attributes.len());
        block.keep.resize(points, true);
        for axis in 0..3 {
            self.fill_axis(batch, start, points, axis, rules, block);
        }
        if rules.drop_duplicates {
            self.fill_residues(batch, start, points, rules, block);
        }
        self.selection.apply(batch, start, &mut block.keep);
        if let Some(stored) = &rules.stored {
            for i in 0..points {
                let words = stored.stored(block.position(i));
                words.into_iter().enumerate().for_each(|(axis, word)| block.positions[axis][i] = word);
            }
        }
        for (i, attribute) in rules.attributes.iter().enumerate() {
            let column = self.columns[i].map(|(c, elements)| (&batch.columns[c], elements));
            let words = &mut block.words[i];
            append_words(column, start, points, attribute, words);
            match rules.conversions[i] {
                AsStored => {}
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
                *keep &= classes.iter().any(|c| f64::from(*c) == class);
            }
        }
        for ((column, value), deviating) in self.constants.iter().zip(&self.deviating) {
            let is_rgb = self.scan.info().attributes[*column].name == "rgb";
            let count = count_deviating(&batch.columns[*column], start, value, &block.keep, is_rgb);
            deviating.fetch_add(count, Relaxed);
        }
    }

    fn fill_residues(&self, batch: &PointBatch, start: usize, points: usize, rules: &Rules, block: &mut Block) {
        let own = self.scan.info().lattice;
        let world = |axis: usize, i: usize| match (&batch.positions, &own) {
            (Positions::Quantized(p), Some(l)) => f64::from(p[axis][i]) * l.scale[axis] + l.offset[axis],
            (Positions::Quantized(p), None) => f64::from(p[axis][i]),
            (Positions::World(p), _) => p[axis][i],
        };
        block.residues.extend((0..points).map(|i| {
            let mut residue = Residue::default();
            for axis in 0..3 {
                let stored = block.positions[axis][i];
                residue.add(rules, own.as_ref(), axis, world(axis, start + i), stored);
            }
            residue.word()
        }));
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
        let mut take = |i: usize, world: f64, exact: Option<i64>| {
            let (rounded, truncated) = rules.quantize(axis, world);
            block.positions[axis].push(exact.unwrap_or(rounded));
            if rules.foreign {
                block.truncated[axis].push(truncated);
            }
            // a point without a finite position is none
            block.keep[i] &= world.is_finite();
        };
        match (&batch.positions, self.scan.info().lattice) {
            (Positions::Quantized(values), Some(lattice)) => {
                let (scale, offset) = (lattice.scale[axis], lattice.offset[axis]);
                let values = values[axis][start..start + points].iter().enumerate();
                let exact = Some(&self.exact[axis]).filter(|_| rules.compare_positions).copied().flatten();
                let on_dataset = |v| exact.map(|e| e.nearest(v) - rules.shift[axis]);
                values.for_each(|(i, v)| take(i, f64::from(*v) * scale + offset, on_dataset(*v)));
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

/// Bits of a single, to those of the whole number next to it; 0 if that is not finite or beyond ±2²⁴.
fn whole_class(bits: u64) -> u64 {
    let class = f32::from_bits(bits as u32).round();
    // adding 0 makes −0 the 0 that it means
    let class = if class.abs() <= 16_777_216.0 { class + 0.0 } else { 0.0 };
    u64::from(class.to_bits())
}

/// The column of a scan, and its elements, that an attribute of the dataset was filled from.
///
/// Scans that mean different things by one name (another type, another scale) have attributes of their own; those after
/// the first are called "name (2)", "name (3)", …. Wide integers may be stored as doubles.
fn column_of(stored: &Attribute, columns: &[Attribute], any_type: bool) -> Option<(usize, usize)> {
    let named = |c: &&Attribute| {
        let suffix = stored.name.strip_prefix(&*c.name);
        let is_number = |n: &str| n.parse::<u32>().is_ok_and(|n| n >= 2);
        suffix.is_some_and(|s| {
            s.is_empty() || s.strip_prefix(" (").and_then(|s| s.strip_suffix(')')).is_some_and(is_number)
        })
    };
    let same = |c: &&Attribute| {
        let ty = match c.ty {
            AttributeType::Int64 | AttributeType::UInt64 => AttributeType::Float64,
            other => other,
        };
        let same_type = ty == stored.ty || c.ty == stored.ty;
        // other converters do as they like with types
        any_type || same_type && c.elements == stored.elements && c.scale == stored.scale && c.offset == stored.offset
    };
    let exact = columns.iter().position(|c| c.name == stored.name && same(&c));
    let found = exact.or_else(|| columns.iter().position(|c| named(&c) && same(&c)));
    found.map(|i| (i, columns[i].elements))
}

/// Points that are kept and have another value. `is_rgb`: 8-bit values may stand for 16-bit ones.
#[allow(clippy::unnecessary_cast)] // one body for every type of column
fn count_deviating(column: &Column, start: usize, value: &[f64], keep: &[bool], is_rgb: bool) -> u64 {
    let elements = value.len().max(1);
    let differs = |v: f64, constant: f64| v != constant && !(is_rgb && v * 257.0 == constant);
    with_column!(column, values => {
        let points = values.chunks_exact(elements).skip(start).zip(keep);
        points.filter(|(v, keep)| **keep && v.iter().zip(value).any(|(v, c)| differs(*v as f64, *c))).count() as u64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_become_whole_and_finite() {
        let cases = [(2.0, 2.0), (2.6, 3.0), (-0.2, 0.0), (f32::NAN, 0.0), (f32::INFINITY, 0.0), (3e8, 0.0)];
        for (class, expected) in cases {
            assert_eq!(whole_class(class.to_bits().into()), u64::from(f32::to_bits(expected)), "{class}");
        }
    }
}

//! Attributes that a conversion has computed: normals, curvatures and radii. `docs/surfels.md` is the only source of what is
//! expected; that they were computed, and how, the report of the conversion says.
//!
//! Works on records as the comparison with the sources has them, and so on every format.
//!
//! # How they are computed again
//! A sample of 1,000 points, of all levels of an octree alike, is chosen by hashes of positions. Then all points of the
//! dataset pass by, and every point of the sample keeps those of its neighbourhood; blocks whose box is too far away are passed
//! over. Differences and their products are summed up as integers, so that no order matters.
//!
//! # Tolerances
//! * Lengths of normals: 10⁻³, of those in 16 bits 0.02. Sides: 10⁻⁶ of the length, of those in 16 bits 0.03. Curvatures: 10⁻⁴, and 10⁻³ of them. Radii: 10⁻⁵ of them.
//! * Angles: 0.1°, and what a covariance that is off by 10⁻⁶ of its largest eigenvalue λ₂ makes of it: 10⁻⁶ · λ₂ / (λ₁ − λ₀).
//!   Normals in 16 bits may be off by 0.4° more, and by the 1.6° that two bytes are off at most.
//! * Not judged: normals and curvatures where the last point of a neighbourhood and the first one beyond are equally far, to
//!   10⁻⁶, and of different places; normals where λ₀ and λ₁ are equal to 10⁻³, or where more than 0.5° would be allowed.
//!
//! # Memory
//! For each point of the sample its neighbourhood, at most 96 bytes a neighbour (of large neighbourhoods fewer points are looked
//! at: a quarter of what is left; nor are there more than 4 · 10⁹ neighbours in all where a distance is given), 8 MiB to choose the sample, and for each thread a block of records.

mod again;
mod columns;
mod derived;
mod eigen;
mod expected;
mod moments;
mod nearest;
mod sample;
mod values;

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use pointmill_format::ReadError;

use crate::against::block::{BLOCK_POINTS, Block};
use crate::against::{Against, Context, Rules};
use crate::check::Check;
use crate::finding::Findings;
use crate::memory::{Budget, on_threads};
use crate::options::Progress;
use crate::outcome::SurfelSummary;
use crate::place::Place;
use again::{Again, Compared};
use columns::Columns;
pub(crate) use derived::Derived;
use derived::{Extent, RADIUS};
use nearest::ENTRY_BYTES;
use sample::Sample;
use values::Values;

/// Points of the sample, at most.
const QUERIES: u64 = 1000;

/// A dataset with attributes that were computed.
pub(crate) struct Task<'a> {
    pub(crate) derived: &'a Derived,
    /// What records have.
    pub(crate) rules: &'a Rules,
    /// Points of the dataset.
    pub(crate) points: u64,
    /// Why not all points could be read, if so.
    pub(crate) unread: Option<String>,
    /// Why the integers of positions are not known, if so.
    pub(crate) uncertain: Option<String>,
    /// Normals are stored in 16 bits.
    pub(crate) is_octahedral: bool,
    /// `None`: nothing is computed again.
    pub(crate) against: Option<&'a Against>,
    /// How many threads may read records.
    pub(crate) threads: usize,
}

impl Task<'_> {
    /// Checks all values, then, where there are sources, a sample of them by the points around.
    ///
    /// # Errors
    /// The operating system could not read, or there is not enough memory.
    pub(crate) fn check(&self, context: &Context<'_>) -> Result<Option<SurfelSummary>, ReadError> {
        let Context { findings, progress, .. } = *context;
        let columns = Columns::new(self.rules, self.derived);
        let values = Values {
            derived: self.derived,
            columns,
            rules: self.rules,
            is_octahedral: self.is_octahedral,
            has_positions: self.uncertain.is_none(),
            findings,
            zero_normals: AtomicU64::new(0),
            zero_radii: AtomicU64::new(0),
        };
        let mut budget = context.budget.clone();
        budget.take(self.threads as u64 * self.block_bytes())?;
        let compared = self.compared(columns);
        let queries = self.queries(&budget);
        let sample = compared.as_ref().ok().map(|_| Sample::new(queries));
        budget.require(sample.as_ref().map_or(0, |_| sample::bytes(queries)))?;
        let done = AtomicU64::new(0);
        let passes = 1 + u64::from(sample.is_some());
        let advance = |points: usize| {
            let done = done.fetch_add(points as u64, Relaxed) + points as u64;
            progress(Progress { phase: "surfels", done, total: passes * self.points });
        };
        self.pass(context, |block, place| {
            values.look(block, place);
            if let Some(sample) = &sample {
                (0..block.len()).for_each(|i| sample.offer(block, i, place, || columns.surfel(block, i)));
            }
            advance(block.len());
        })?;
        values.conclude(self.unread.is_none());
        let (sample, compared) = match (sample, compared) {
            (Some(sample), Ok(compared)) => (sample, compared),
            (_, Err(why)) => {
                findings.skip(Check::Surfels, why);
                return Ok(None);
            }
            (None, Ok(_)) => return Ok(None),
        };
        let (queries, scouts) = sample.finish();
        let again = Again::new(queries, (&scouts, self.points), self.derived.extent, self.rules.lattice.scale);
        drop(scouts);
        self.pass(context, |block, _| {
            again.look(block);
            advance(block.len());
        })?;
        let summary = again.compare(&compared, findings);
        self.note_what_was_kept(&compared, findings);
        Ok(Some(summary))
    }

    fn note_what_was_kept(&self, compared: &Compared<'_>, findings: &Findings) {
        let normals = (self.derived.normals && !compared.normals).then_some("normals");
        let radii = (self.derived.radius && !compared.radii).then_some("radii");
        let kept: Vec<&str> = normals.into_iter().chain(radii).collect();
        if !kept.is_empty() {
            let why = format!("without {}: which are those of the scans is not known", kept.join(" and "));
            findings.note(Check::Surfels, why);
        }
    }

    fn pass(&self, context: &Context<'_>, work: impl Fn(&mut Block, Place) + Sync) -> Result<(), ReadError> {
        on_threads(self.threads, context.budget.path(), || context.records.each_block(self.rules, &work))
    }

    /// A block of records.
    fn block_bytes(&self) -> u64 {
        let words = 3 + self.rules.attributes.iter().map(|a| a.elements).sum::<usize>();
        (words * size_of::<u64>() * BLOCK_POINTS) as u64
    }

    /// How many points are looked at.
    fn queries(&self, budget: &Budget) -> usize {
        let neighbours = match self.derived.extent {
            Extent::Nearest(count) => count as u64 + 2,
            Extent::Within(_) => 4,
        };
        let fit = budget.left() / 4 / (neighbours * ENTRY_BYTES);
        fit.clamp(1, QUERIES) as usize
    }

    /// What of a sample can be compared, or why nothing can.
    fn compared(&self, columns: Columns) -> Result<Compared<'_>, String> {
        let Some(against) = self.against else { return Err("no sources were given".into()) };
        let compared = Compared {
            rules: self.rules,
            columns,
            normals: self.derived.kept_normals == 0,
            // radii of the scans are kept
            radii: !against.have_derived(RADIUS),
            is_octahedral: self.is_octahedral,
        };
        let dropped = self.derived.duplicates_dropped;
        let dropped = (dropped > 0).then(|| format!("{dropped} equal points were dropped, which were neighbours, too"));
        let is_normal = compared.normals && columns.known_normal().is_some();
        let is_any = is_normal || columns.known_curvature().is_some();
        let is_any = is_any || compared.radii && columns.known_radius().is_some();
        let nothing = (!is_any).then(|| "the dataset has nothing that the points around tell".to_owned());
        match self.unread.clone().or(self.uncertain.clone()).or(dropped).or(nothing) {
            Some(why) => Err(why),
            None => Ok(compared),
        }
    }
}

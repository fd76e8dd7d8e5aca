//! What the headers say, put together: all scans and the union of their attributes. Nothing changes it later.

mod bytes;
mod crs;
mod decimals;
mod degrees;
mod derived;
mod divisor;
mod open_scans;
mod opener;
mod probe;
mod recast;
mod same;
mod schema;
mod shared;
mod source;
mod survey;
mod tolerance;
mod union;

use std::cmp::Reverse;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use pointmill_format::{Aabb, Attribute, Scan, Wanted};

pub use crs::{ResolvedCrs, resolve_crs};
pub(crate) use crs::{declared_by as given_crs, resolve_all as resolve_crs_of_all};
pub(crate) use decimals::tidy_product;
pub(crate) use degrees::metres_per_radian;
pub(crate) use recast::{Recast, doubled};
pub(crate) use schema::{MARK_BYTES, POSITION_BYTES, Schema};
pub(crate) use source::Source;
#[cfg(test)]
pub(crate) use source::Stored;
pub(crate) use survey::{Fineness, far_out, intersection, single_step};
pub(crate) use tolerance::Tolerance;
pub(crate) use union::Layout;

use self::divisor::Divisors;
use self::open_scans::OpenScans;
use self::opener::Opener;
use self::probe::{Outcome, Probe, Probed};
use self::shared::Shared;
use self::source::PIECES_TOGETHER;
use self::union::Union;
use crate::error::{ConvertError, InputFault};
use crate::plan::{Plan, ScaleChoice};
use crate::runtime::{Events, Workers};
use crate::warning::Warning;

/// Inputs whose headers are looked at before what they have in common is put together.
const AT_ONCE: usize = 1024;

/// Scans that are asked what decoding takes; of others it is what decoding all columns takes.
const MOST_ASKED: usize = 16;

/// Threads that read headers: more only wait for the disk.
const MOST_THREADS: usize = 32;

/// Everything known before the first point is decoded.
pub(crate) struct Sources {
    /// In order of path.
    pub(crate) all: Vec<Source>,
    /// The union of the attributes of all scans.
    pub(crate) attributes: Schema,
    /// Where the columns of scans are among them: once for all scans that have the same.
    pub(crate) layouts: Vec<Layout>,
    /// Points in the pieces of all scans.
    pub(crate) points_declared: u64,
    /// Points declared by headers but not there.
    pub(crate) points_missing: u64,
    pub(crate) warnings: Vec<Warning>,
    /// How far coordinates may be from those of the scans, if a precision is requested.
    pub(crate) tolerance: Option<Tolerance>,
    /// What all inputs take of the memory until the end of the run, bytes; open scans aside: of these there are few.
    pub(crate) bytes: u64,
    open: OpenScans,
}

/// Headers as they come in.
#[derive(Default)]
struct Found {
    all: Vec<Source>,
    /// By source.
    attributes: Vec<Arc<[Attribute]>>,
    points_declared: u64,
    points_missing: u64,
    warnings: Vec<Warning>,
}

impl Found {
    /// Adds the next input.
    fn add(&mut self, outcome: Outcome, open: &OpenScans) -> Result<(), ConvertError> {
        let mut probed = match outcome {
            Outcome::Open(probed) => probed,
            Outcome::Skipped(warning) => {
                self.warnings.push(*warning);
                return Ok(());
            }
        };
        if let Some(scan) = probed.scan.take() {
            open.keep(self.all.len(), scan)?;
        }
        let Probed { source, attributes, points, points_missing, mut warnings, .. } = *probed;
        let first_pair = self.all.last().map_or(0, Source::end_of_pairs);
        self.all.push(Source { first_pair, ..source });
        self.attributes.push(attributes);
        self.points_declared = self.points_declared.saturating_add(points);
        self.points_missing = self.points_missing.saturating_add(points_missing);
        self.warnings.append(&mut warnings);
        Ok(())
    }

    fn combine(self, open: OpenScans) -> Result<Sources, ConvertError> {
        let Self { mut all, attributes, points_declared, points_missing, mut warnings } = self;
        if all.is_empty() {
            return Err(InputFault::NoneReadable.into());
        }
        let union = Union::of(&attributes);
        warnings.extend(union.warnings);
        all.iter_mut().zip(union.layout_of).for_each(|(source, layout)| source.layout = layout);
        let divisors = Divisors::of(&all, &open)?;
        settle_fineness(&mut all, &divisors);
        let (attributes, layouts) = (union.schema, union.layouts);
        let bytes = bytes::of(&all, &layouts, warnings.len());
        let tolerance = None;
        Ok(Sources { bytes, all, attributes, layouts, points_declared, points_missing, warnings, tolerance, open })
    }
}

impl Sources {
    /// Looks at the headers of all inputs of the plan, in order of path, on its threads.
    ///
    /// # Errors
    /// That of the first input that cannot be read, a ceiling of memory that is too small for so many, or the request to
    /// stop.
    pub(crate) fn open(plan: &Plan, events: &dyn Events) -> Result<Self, ConvertError> {
        let mut paths: Vec<&Path> = plan.inputs.iter().map(PathBuf::as_path).collect();
        paths.sort_unstable();
        paths.dedup();
        bytes::check(plan, &paths)?;
        let workers = Workers::start(plan.threads.min(paths.len()).min(MOST_THREADS), events)?;
        let open = OpenScans::new(Opener::new(plan, workers.threads), plan.threads);
        let probe = Probe { open: &open, unreadable: plan.unreadable, shared: Mutex::new(Shared::default()) };
        let mut found = Found { all: Vec::with_capacity(paths.len()), ..Found::default() };
        if !plan.other_files.is_empty() {
            found.warnings.push(Warning::OtherFiles { files: plan.other_files.clone() });
        }
        found.warnings.extend(plan.skipped_inputs.iter().map(|(path, why)| Warning::InputSkipped {
            path: path.clone(),
            error: format!("{}: {why}", path.display()),
        }));
        for (round, some) in paths.chunks(AT_ONCE).enumerate() {
            for outcome in probe.some(round * AT_ONCE, some, &workers)? {
                found.add(outcome, &open)?;
            }
        }
        drop(probe);
        let mut sources = found.combine(open)?;
        derived::add(&mut sources.attributes, &mut sources.layouts, &plan.derive);
        sources.warnings.iter().for_each(|w| events.warning(w));
        Ok(sources)
    }

    /// The same, with what the plan requests of positions. `keeps_lattice`: all outputs hold points of the lattice as they are.
    ///
    /// # Errors
    /// A length in a unit where that of the coordinates is unknown.
    pub(crate) fn within_precision(self, plan: &Plan, keeps_lattice: bool) -> Result<Self, ConvertError> {
        if !matches!(plan.scale, ScaleChoice::Within(_)) {
            return Ok(self);
        }
        let crs = resolve_crs_of_all(plan, &self.all, &mut Vec::new())?;
        Ok(Self { tolerance: Tolerance::of(plan, &crs, keeps_lattice)?, ..self })
    }

    /// The scan of a source, open.
    ///
    /// # Errors
    /// The file cannot be opened again, or was changed since its header was read.
    pub(crate) fn scan(&self, source: usize) -> Result<Arc<dyn Scan>, ConvertError> {
        self.open.get(source, &self.all[source])
    }

    /// The most that decoding takes on one thread, bytes. `wanted`: the columns that are read of a source.
    ///
    /// # Errors
    /// As [`Self::scan`].
    pub(crate) fn decode_bytes<'w>(&self, wanted: impl Fn(&Source) -> &'w Wanted) -> Result<u64, ConvertError> {
        // scans that take the same for the same columns are alike: one of each is asked, those that take most first
        let mut kinds: Vec<(u64, u32, usize)> =
            self.all.iter().enumerate().map(|(i, s)| (s.decode_bytes, s.layout, i)).collect();
        kinds.sort_unstable_by_key(|(bytes, layout, i)| (Reverse(*bytes), *layout, *i));
        kinds.dedup_by_key(|(bytes, layout, _)| (*bytes, *layout));
        let mut most = 0;
        for (asked, (bytes, _, i)) in kinds.into_iter().enumerate() {
            if bytes <= most {
                break;
            }
            let own = if asked < MOST_ASKED { self.scan(i)?.decode_bytes(wanted(&self.all[i])) } else { bytes };
            most = own.max(most);
        }
        Ok(most)
    }

    /// The number of pairs of pieces of all scans: a thread takes two consecutive pieces of a scan together, since two take
    /// less time in some formats when one thread decodes them ([`pointmill_format::Scratch::next_piece`]).
    pub(crate) fn pairs(&self) -> usize {
        self.all.last().map_or(0, |last| last.end_of_pairs() as usize)
    }

    /// The source of the pair with that number among those of all scans, and its pieces: two, or the last of the source.
    pub(crate) fn pair(&self, number: usize) -> (usize, Range<usize>) {
        // sources without pieces begin where the next one does
        let source = self.all.partition_point(|s| s.first_pair <= number as u64).saturating_sub(1);
        let Some(s) = self.all.get(source) else { return (source, 0..0) };
        let first = (number as u64).saturating_sub(s.first_pair) * PIECES_TOGETHER;
        (source, first as usize..(first + PIECES_TOGETHER).min(u64::from(s.pieces)) as usize)
    }

    /// Points of a pair, as headers say.
    pub(crate) fn pair_points(&self, number: usize) -> u64 {
        let (source, pieces) = self.pair(number);
        let Some(s) = self.all.get(source) else { return 0 };
        s.points_declared * pieces.len() as u64 / u64::from(s.pieces.max(1))
    }

    /// True if headers say where all points are, as opposed to a sample.
    pub(crate) fn declares_bounds(&self) -> bool {
        self.all.iter().filter_map(|s| s.extent.as_ref()).all(|extent| !extent.is_sampled)
    }

    /// What the headers claim (or a sample shows) of where the points are, cut by the filter; a hint.
    pub(crate) fn bounds_hint(&self, cut: Option<&Aabb>) -> Option<Aabb> {
        let extents = self.all.iter().filter_map(|s| s.extent.as_ref());
        let all = extents.fold(Aabb::EMPTY, |all, e| all.union(&e.bounds));
        let hint = match cut {
            Some(cut) if !all.is_empty() => intersection(&all, cut),
            _ => all,
        };
        (!hint.is_empty()).then_some(hint)
    }
}

#[cfg(test)]
impl Sources {
    /// Sources whose pieces alone matter.
    pub(crate) fn with_pairs(mut all: Vec<Source>) -> Self {
        let mut first_pair = 0;
        for source in &mut all {
            source.first_pair = first_pair;
            first_pair = source.end_of_pairs();
        }
        Self::of_headers(all)
    }

    /// Sources whose headers alone matter.
    pub(crate) fn of_headers(all: Vec<Source>) -> Self {
        let open = OpenScans::new(Opener::new(&Plan::new(Vec::new(), "out".into()), 1), 1);
        let attributes = Schema::new(Vec::new());
        let (layouts, warnings, tolerance) = (Vec::new(), Vec::new(), None);
        let (points_declared, points_missing, bytes) = (0, 0, 0);
        Self { all, attributes, layouts, points_declared, points_missing, warnings, tolerance, bytes, open }
    }
}

/// Takes the coarser grids that integers were found to lie on. Neighbours that store coordinates alike share how.
fn settle_fineness(sources: &mut [Source], divisors: &Divisors) {
    let mut last: Option<Arc<source::Stored>> = None;
    for source in sources {
        let Some(lattice) = &source.stored.lattice else { continue };
        let fineness = divisors.fineness(lattice);
        if fineness != source.stored.fineness {
            let stored = source::Stored { fineness, ..(*source.stored).clone() };
            let same = last.filter(|last| **last == stored);
            source.stored = same.unwrap_or_else(|| Arc::new(stored));
            last = Some(Arc::clone(&source.stored));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sources::source::Stored;

    #[test]
    fn pairs_are_of_one_source_and_every_piece_is_in_one() {
        let stored = Stored { lattice: None, resolution: Default::default(), fineness: [Fineness::Double; 3] };
        let mut first_pair = 0;
        let source = |pieces: u32| {
            let source = Source { pieces, first_pair, ..Source::of_header(stored.clone(), None, None) };
            first_pair = source.end_of_pairs();
            source
        };
        let sources = Sources::of_headers([0, 3, 1, 0, 0, 4, 1, 0].map(source).into());
        let pairs: Vec<_> = (0..sources.pairs()).map(|number| sources.pair(number)).collect();
        assert_eq!(pairs, [(1, 0..2), (1, 2..3), (2, 0..1), (5, 0..2), (5, 2..4), (6, 0..1)]);
        assert_eq!(Sources::of_headers(Vec::new()).pairs(), 0);
    }
}

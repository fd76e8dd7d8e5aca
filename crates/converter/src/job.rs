//! What the headers say, put together: open inputs, one lattice, one schema.

use pointmill_format::{Aabb, Advice, ErrorKind, Fault, Lattice, ReadError, Resolution, Scan, Wanted, open_scan};

use crate::axis::{AxisMap, SourceMap};
use crate::error::ConvertError;
use crate::events::Events;
use crate::gather::Stats;
use crate::lattice::{self, Choice, Extent, Steps};
use crate::needs;
use crate::plan::{OnFault, Plan};
use crate::schema::Schema;

/// A scan, and how its points become the job's.
pub(crate) struct Source {
    pub(crate) scan: Box<dyn Scan>,
    /// Where each of its columns goes in the schema; `None`: no output needs it.
    pub(crate) columns: Vec<Option<usize>>,
    /// The columns to decode: those, and what the filter looks at.
    pub(crate) wanted: Wanted,
    /// From its coordinates to the job lattice.
    pub(crate) map: SourceMap,
}

/// Everything known before the first point is decoded.
pub(crate) struct Job {
    pub(crate) sources: Vec<Source>,
    /// What is read: the attributes that some output needs.
    pub(crate) schema: Schema,
    /// Names of the attributes of the inputs that no output needs.
    pub(crate) unread: Vec<String>,
    pub(crate) lattice: Lattice,
    /// Why this lattice, for people.
    pub(crate) lattice_reason: String,
    /// How it may become coarser.
    steps: Steps,
    is_coarsened: bool,
    /// What the headers claim (or a sample shows), cut by the filter; a hint.
    pub(crate) bounds_hint: Option<Aabb>,
    pub(crate) points_declared: u64,
    /// Points declared by headers but not there.
    pub(crate) points_missing: u64,
    pub(crate) warnings: Vec<String>,
}

impl Job {
    /// Opens all inputs of the plan, in order of path.
    pub(crate) fn open(plan: &Plan, events: &dyn Events) -> Result<Self, ConvertError> {
        if plan.inputs.is_empty() {
            return Err(ConvertError::Usage("no inputs; name at least one scan".into()));
        }
        let mut paths = plan.inputs.clone();
        paths.sort();
        paths.dedup();
        let mut warnings = Vec::new();
        let mut scans: Vec<Box<dyn Scan>> = Vec::new();
        let mut points_missing = 0u64;
        for path in &paths {
            match open_scan(path, &plan.open).and_then(|scan| Ok((missing_points(&*scan, plan.unreadable)?, scan))) {
                Ok((missing, scan)) => {
                    warnings.extend(scan.info().warnings.iter().map(|w| format!("{}: {w}", path.display())));
                    points_missing = points_missing.saturating_add(missing);
                    scans.push(scan);
                }
                Err(error) if plan.unreadable == OnFault::Skip && !matches!(error.kind(), ErrorKind::Unsupported) => {
                    warnings.push(format!("left out: {error}"));
                }
                Err(error) => return Err(error.into()),
            }
        }
        if scans.is_empty() {
            return Err(ConvertError::Input("none of the inputs could be read".into()));
        }
        warnings.iter().for_each(|w| events.warning(w));
        Self::combine(plan, scans, points_missing, warnings)
    }

    fn combine(
        plan: &Plan,
        scans: Vec<Box<dyn Scan>>,
        points_missing: u64,
        warnings: Vec<String>,
    ) -> Result<Self, ConvertError> {
        let infos: Vec<_> = scans.iter().map(|s| s.info()).collect();
        let (all, columns) = Schema::union(&infos);
        let needed = needs::needed(plan, &all)?;
        let unread = all.attributes.iter().zip(&needed).filter(|(_, needed)| !**needed);
        let unread = unread.map(|(a, _)| a.name.clone()).collect();
        let (schema, places) = all.reduce(&needed);
        let extents: Vec<_> = scans.iter().map(|s| Extent::of(&**s)).collect();
        let expected = extents.iter().flatten().fold(Aabb::EMPTY, |all, e| all.union(&e.bounds));
        let mut hint = (!expected.is_empty()).then_some(expected);
        if let (Some(h), Some(f)) = (&mut hint, &plan.filter.bounds) {
            for a in 0..3 {
                h.min[a] = h.min[a].max(f.min[a]);
                h.max[a] = h.max[a].min(f.max[a]);
            }
        }
        let hint = hint.filter(|h| !h.is_empty());
        let Choice { lattice, reason, steps } =
            lattice::choose(plan.scale, &infos, &extents, plan.filter.bounds.as_ref());
        if !lattice.is_valid() {
            let bounds = hint.unwrap_or(Aabb::EMPTY);
            return Err(too_far(bounds.min, bounds.max));
        }
        let points_declared = scans.iter().flat_map(|s| s.pieces()).map(|p| p.points).sum();
        let mut job = Self {
            sources: Vec::new(),
            schema,
            unread,
            lattice,
            lattice_reason: reason,
            steps,
            is_coarsened: false,
            bounds_hint: hint,
            points_declared,
            points_missing,
            warnings,
        };
        job.sources = scans
            .into_iter()
            .zip(columns)
            .map(|(scan, columns)| {
                let map = SourceMap::new(scan.info().lattice.as_ref(), &job.lattice);
                let columns: Vec<Option<usize>> = columns.into_iter().map(|c| places[c]).collect();
                let class =
                    |i: usize| plan.filter.classes.is_some() && scan.info().attributes[i].name == "classification";
                let wanted = columns.iter().enumerate().map(|(i, c)| c.is_some() || class(i)).collect::<Wanted>();
                Source { scan, columns, wanted, map }
            })
            .collect();
        Ok(job)
    }

    /// Chooses the lattice anew if what was declared of float scans made it far coarser than the points need: what headers
    /// say may cost a second read, not precision. True if it did.
    pub(crate) fn refine(&mut self, plan: &Plan, stats: &Stats) -> bool {
        let infos: Vec<_> = self.sources.iter().map(|s| s.scan.info()).collect();
        if self.is_coarsened || infos.iter().all(|i| i.lattice.is_some()) {
            return false;
        }
        let measured = stats.sources.iter().map(|s| s.bounds).map(|bounds| Extent { bounds, is_sampled: false });
        let extents: Vec<_> = measured.map(|e| (!e.bounds.is_empty()).then_some(e)).collect();
        let choice = lattice::choose(plan.scale, &infos, &extents, plan.filter.bounds.as_ref());
        if choice.lattice.scale[0] * WORTH_READING_AGAIN > self.lattice.scale[0] {
            return false;
        }
        (self.lattice, self.lattice_reason, self.steps) = (choice.lattice, choice.reason, choice.steps);
        self.map_sources();
        true
    }

    fn map_sources(&mut self) {
        for source in &mut self.sources {
            source.map = SourceMap::new(source.scan.info().lattice.as_ref(), &self.lattice);
        }
    }

    /// Moves the job to a coarser lattice, when its integers turned out too small for the extent.
    pub(crate) fn coarsen(&mut self, bits: u32) {
        let before = self.lattice.scale[0];
        self.lattice.scale = self.lattice.scale.map(|s| self.steps.coarsen(s, 2f64.powi(bits as i32)));
        let factor = (self.lattice.scale[0] / before).round();
        self.lattice_reason =
            format!("{}; made {factor} times coarser, or 31 bits could not hold the extent", self.lattice_reason);
        self.is_coarsened = true;
        self.map_sources();
    }

    /// Least step of the coordinates of the sources, world units; that of the job where a source does not tell.
    pub(crate) fn source_step(&self) -> [f64; 3] {
        let step = |source: &Source, a: usize| match (source.scan.info().lattice, source.scan.info().resolution) {
            (Some(lattice), _) => lattice.scale[a],
            (None, Resolution::Step(step)) => step,
            (None, Resolution::Single | Resolution::Double) => self.lattice.scale[a],
        };
        std::array::from_fn(|a| self.sources.iter().map(|s| step(s, a)).fold(f64::INFINITY, f64::min))
    }

    /// True if the extent of the cloud decided the step.
    pub(crate) fn is_held_back(&self) -> bool {
        self.steps == Steps::Decimal || self.lattice_reason.contains("coarser")
    }

    /// True if some positions may move when they come to the job lattice.
    pub(crate) fn is_lossless(&self) -> bool {
        self.sources.iter().all(|s| s.map.axes.iter().all(AxisMap::is_exact))
    }
}

/// A step that could be so many times finer, had the headers told the truth, is worth a second read.
const WORTH_READING_AGAIN: f64 = 100.0;

/// No renderer's single precision holds coordinates beyond this, and no scanner gives them.
const FARTHEST: f64 = 1e30;

/// True for bounds that cannot be coordinates.
pub(crate) fn far_out(bounds: &Aabb) -> bool {
    bounds.min.iter().chain(&bounds.max).any(|v| v.abs() > FARTHEST)
}

/// The error for them.
pub(crate) fn too_far(min: [f64; 3], max: [f64; 3]) -> ConvertError {
    ConvertError::Input(format!(
        "points lie as far out as {min:?} to {max:?}, which no coordinates do; leave them out with --bounds, or mend the \
         input"
    ))
}

/// Points that the header declares and the file does not hold; an error if the policy says so.
fn missing_points(scan: &dyn Scan, policy: OnFault) -> Result<u64, ReadError> {
    let info = scan.info();
    let found: u64 = scan.pieces().iter().map(|p| p.points).sum();
    let missing = info.points_declared.saturating_sub(found);
    if missing > 0 && policy == OnFault::Fail {
        let fault = Fault::PointsMissing { declared: info.points_declared, found };
        return Err(ReadError::broken(&info.path, info.file_bytes, fault).advise(Advice::SkipUnreadable));
    }
    Ok(missing)
}

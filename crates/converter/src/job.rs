//! What the headers say, put together: open inputs, one lattice, one schema.

use std::fs;
use std::io::Read;
use std::path::Path;

use pointmill_format::{Aabb, ErrorKind, Lattice, ReadError, Scan, las};

use crate::axis::{AxisMap, SourceMap};
use crate::error::ConvertError;
use crate::events::Events;
use crate::plan::{OnFault, Plan, ScaleChoice};
use crate::schema::Schema;

/// A scan, and how its points become the job's.
pub(crate) struct Source {
    pub(crate) scan: Box<dyn Scan>,
    /// Where each of its columns goes in the schema.
    pub(crate) columns: Vec<usize>,
    /// From its coordinates to the job lattice.
    pub(crate) map: SourceMap,
}

/// Everything known before the first point is decoded.
pub(crate) struct Job {
    pub(crate) sources: Vec<Source>,
    pub(crate) schema: Schema,
    pub(crate) lattice: Lattice,
    /// Why this lattice, for people.
    pub(crate) lattice_reason: String,
    /// What the headers claim, cut by the filter; a hint.
    pub(crate) bounds_hint: Option<Aabb>,
    pub(crate) points_declared: u64,
    /// Points declared by headers but not there.
    pub(crate) points_missing: u64,
    pub(crate) warnings: Vec<String>,
}

/// Opens one scan of any kind that is supported; the kind is told by content.
pub(crate) fn open_scan(path: &Path) -> Result<Box<dyn Scan>, ReadError> {
    let mut first = [0; 64];
    let mut file = fs::File::open(path).map_err(|e| ReadError::io(path, "opening the input", e))?;
    let mut len = 0;
    while len < first.len() {
        match file.read(&mut first[len..]).map_err(|e| ReadError::io(path, "reading the first bytes", e))? {
            0 => break,
            n => len += n,
        }
    }
    if len == 0 {
        return Err(ReadError::broken(path, 0, "the file is empty").advise("copy it again, or leave it out"));
    }
    if las::is_las(&first[..len]) {
        return las::open(path);
    }
    Err(ReadError::unsupported(path, "not a scan that this version reads").advise("supported are LAS and LAZ"))
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
            match open_scan(path).and_then(|scan| Ok((missing_points(&*scan, plan.unreadable)?, scan))) {
                Ok((missing, scan)) => {
                    warnings.extend(scan.info().warnings.iter().map(|w| format!("{}: {w}", path.display())));
                    points_missing = points_missing.saturating_add(missing);
                    scans.push(scan);
                }
                Err(error) if plan.unreadable == OnFault::Skip && !matches!(error.kind, ErrorKind::Unsupported) => {
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
        let (schema, columns) = Schema::union(&infos);
        let declared = infos.iter().filter_map(|i| i.bounds_declared).fold(Aabb::EMPTY, |a, b| a.union(&b));
        let mut hint = (!declared.is_empty()).then_some(declared);
        if let (Some(h), Some(f)) = (&mut hint, &plan.filter.bounds) {
            for a in 0..3 {
                h.min[a] = h.min[a].max(f.min[a]);
                h.max[a] = h.max[a].min(f.max[a]);
            }
        }
        let hint = hint.filter(|h| !h.is_empty());
        let lattices: Vec<Lattice> = infos.iter().filter_map(|i| i.lattice).collect();
        let (lattice, lattice_reason) = choose_lattice(plan.scale, &lattices, hint.as_ref());
        let points_declared = scans.iter().flat_map(|s| s.pieces()).map(|p| p.points).sum();
        let mut job = Self {
            sources: Vec::new(),
            schema,
            lattice,
            lattice_reason,
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
                Source { scan, columns, map }
            })
            .collect();
        Ok(job)
    }

    /// Moves the job to a coarser lattice, when its integers turned out too small for the extent.
    pub(crate) fn coarsen(&mut self, bits: u32) {
        let factor = 2f64.powi(bits as i32);
        self.lattice.scale = self.lattice.scale.map(|s| s * factor);
        self.lattice_reason =
            format!("{}; made {factor} times coarser, or 31 bits could not hold the extent", self.lattice_reason);
        for source in &mut self.sources {
            source.map = SourceMap::new(source.scan.info().lattice.as_ref(), &self.lattice);
        }
    }

    /// True if some positions may move when they come to the job lattice.
    pub(crate) fn is_lossless(&self) -> bool {
        self.sources.iter().all(|s| s.map.axes.iter().all(AxisMap::is_exact))
    }
}

/// Points that the header declares and the file does not hold; an error if the policy says so.
fn missing_points(scan: &dyn Scan, policy: OnFault) -> Result<u64, ReadError> {
    let info = scan.info();
    let found: u64 = scan.pieces().iter().map(|p| p.points).sum();
    let missing = info.points_declared.saturating_sub(found);
    if missing > 0 && policy == OnFault::Fail {
        let what = format!("the header declares {} points, the file holds {found}", info.points_declared);
        return Err(ReadError::broken(&info.path, info.file_bytes, what)
            .advise("copy the file again, or pass --unreadable skip to convert the points that are there"));
    }
    Ok(missing)
}

/// The job lattice: the sources' own where they agree, else the finest scale and the smallest offset of that scale.
fn choose_lattice(choice: ScaleChoice, lattices: &[Lattice], hint: Option<&Aabb>) -> (Lattice, String) {
    let Some(first) = lattices.first() else {
        let scale = match choice {
            ScaleChoice::Fixed(s) => s,
            ScaleChoice::Auto => 0.001,
        };
        let offset = hint.map_or([0.0; 3], |h| h.min.map(f64::floor));
        return (Lattice { scale: [scale; 3], offset }, "the inputs have no lattice".into());
    };
    if let ScaleChoice::Fixed(s) = choice {
        let offset = std::array::from_fn(|a| lattices.iter().map(|l| l.offset[a]).fold(f64::INFINITY, f64::min));
        return (Lattice { scale: [s; 3], offset }, "asked for with --scale".into());
    }
    if lattices.iter().all(|l| l == first) {
        return (*first, "that of the sources".into());
    }
    let mut lattice = *first;
    for a in 0..3 {
        let scale = lattices.iter().map(|l| l.scale[a]).fold(f64::INFINITY, f64::min);
        let finest = lattices.iter().filter(|l| l.scale[a] == scale);
        lattice.scale[a] = scale;
        lattice.offset[a] = finest.map(|l| l.offset[a]).fold(f64::INFINITY, f64::min);
    }
    // What headers declare never makes the lattice coarser: they may lie. Points that were read may, see `coarsen`.
    (lattice, "the finest scale of the sources, per axis".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_that_agree_keep_their_lattice_and_others_get_the_finest() {
        let a = Lattice { scale: [0.01; 3], offset: [100.0, 0.0, 0.0] };
        let b = Lattice { scale: [0.001; 3], offset: [200.0, 0.0, -5.0] };
        assert_eq!(choose_lattice(ScaleChoice::Auto, &[a, a], None).0, a);
        assert_eq!(choose_lattice(ScaleChoice::Auto, &[a, b], None).0, b);
        assert_eq!(choose_lattice(ScaleChoice::Fixed(0.5), &[a, b], None).0.offset, [100.0, 0.0, -5.0]);
    }

    #[test]
    fn declared_bounds_however_wide_do_not_make_the_lattice_coarser() {
        let a = Lattice { scale: [0.01; 3], offset: [0.0; 3] };
        let b = Lattice { scale: [0.001; 3], offset: [0.0; 3] };
        let lie = Aabb { min: [-1e12; 3], max: [1e12; 3] };
        assert_eq!(choose_lattice(ScaleChoice::Auto, &[a, b], Some(&lie)).0, b);
    }
}

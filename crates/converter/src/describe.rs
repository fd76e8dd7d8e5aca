//! What is known once every point was read, and what is told of a run.

use pointmill_format::{Aabb, Crs};
use serde_json::{Map, Value, json};

use crate::crs::{self, ResolvedCrs};
use crate::error::ConvertError;
use crate::gather::{Gathered, Range, Stats, is_eight_bit};
use crate::grid::{Cube, tidy_world};
use crate::job::Job;
use crate::plan::{AttributeChoice, Duplicates, Encoding, Plan, RgbDepth, Sampling, Target};
use crate::report::{CoordinateChange, DroppedAttribute, GridReport, InputReport, OutputReport, PointsReport, Report};

/// What is known once every point was read.
pub(crate) struct Description {
    /// For each source: byte offset in a stored record of a colour that is 8 bits deep.
    pub(crate) widen_rgb: Vec<Option<usize>>,
    /// Byte offset of the classification in a stored record, if it is one byte.
    pub(crate) class: Option<usize>,
    /// Ranges of the output, by index of the schema.
    pub(crate) ranges: Vec<Range>,
    pub(crate) crs: ResolvedCrs,
    pub(crate) grid: GridReport,
    warnings: Vec<String>,
}

impl Description {
    pub(crate) fn new(plan: &Plan, job: &Job, stats: &Stats, cube: &Cube) -> Result<Self, ConvertError> {
        let mut warnings = job.warnings.clone();
        warnings.extend_from_slice(&stats.warnings);
        if stats.rounded_values > 0 {
            warnings.push(format!(
                "{} values of 64-bit integers lie beyond 2^53 and were rounded: they are stored as doubles, because Potree \
                 viewers fail on 64-bit integers",
                stats.rounded_values
            ));
        }
        let rgb = job.schema.rgb();
        let depths: Vec<bool> = stats.sources.iter().map(|s| is_eight_bit(plan.rgb_depth, s)).collect();
        let mut ranges = stats.ranges.clone();
        let mut widen_rgb = vec![None; job.sources.len()];
        if let Some(rgb) = rgb {
            for (i, source) in stats.sources.iter().enumerate().filter(|(_, s)| s.kept > 0) {
                let mut range = source.rgb.clone();
                let has_colour = job.sources[i].columns.contains(&Some(rgb));
                if has_colour && depths[i] {
                    if plan.rgb_depth == RgbDepth::Eight && range.max.iter().any(|v| *v > 255.0) {
                        let path = job.sources[i].scan.info().path.display();
                        return Err(ConvertError::Input(format!(
                            "{path}: has colour values above 255, so they cannot be 8 bits deep; leave out --rgb-depth 8"
                        )));
                    }
                    widen_rgb[i] = Some(job.schema.offsets[rgb]);
                    range.min.iter_mut().chain(&mut range.max).for_each(|v| *v *= 257.0);
                }
                ranges[rgb].merge(&range);
            }
            warnings.extend(mixed_depths(job, stats, &depths, rgb));
        }
        let crs = resolve_crs(plan, job, &mut warnings)?;
        let grid = grid_report(job, cube);
        let class = job.schema.find("classification");
        let class = class.filter(|&i| job.schema.attributes[i].size() == 1).map(|i| job.schema.offsets[i]);
        Ok(Self { widen_rgb, class, ranges, crs, grid, warnings })
    }

    /// What a validator or a later run needs to know, and no viewer reads.
    pub(crate) fn own_key(&self, plan: &Plan, job: &Job, dropped: &[DroppedAttribute]) -> Map<String, Value> {
        let mut own = Map::new();
        own.insert("version".into(), env!("CARGO_PKG_VERSION").into());
        own.insert("latticeOffset".into(), json!(job.lattice.offset));
        own.insert("rgbDepth".into(), rgb_depth_name(plan.rgb_depth).into());
        own.insert("duplicates".into(), duplicates_name(plan.duplicates).into());
        let filter = filter_json(plan);
        if !filter.is_empty() {
            own.insert("filter".into(), filter.into());
        }
        if let Some(wkt) = &self.crs.wkt {
            own.insert("wkt".into(), wkt.clone().into());
        }
        // Those that were not asked for are no matter of the dataset: which there were depends on the kind of the scans.
        let constants: Map<_, _> =
            dropped.iter().filter_map(|d| Some((d.name.clone(), json!(d.constant.as_ref()?)))).collect();
        if !constants.is_empty() {
            own.insert("attributesDropped".into(), constants.into());
        }
        own
    }

    /// The account of the run, but for times and memory.
    pub(crate) fn report(&self, plan: &Plan, job: &Job, gathered: &Gathered, outputs: Vec<OutputReport>) -> Report {
        let stats = &gathered.stats;
        let count = stats.points.max(1) as f64;
        let first = outputs.first().cloned().unwrap_or_default();
        let told = outputs.iter().flat_map(|o| &o.warnings);
        Report {
            version: env!("CARGO_PKG_VERSION").into(),
            options: options_json(plan),
            inputs: input_reports(job, Some((stats, &self.widen_rgb))),
            grid: self.grid.clone(),
            points: PointsReport {
                read: stats.sources.iter().map(|s| s.read).sum(),
                written: first.points,
                outside_bounds: stats.outside_bounds,
                other_class: stats.other_class,
                thinned: stats.thinned,
                duplicates_dropped: stats.points - first.points,
                invalid: stats.invalid,
                unreadable: stats.unreadable.saturating_add(job.points_missing),
            },
            coordinate_change: CoordinateChange {
                max: stats.change.max,
                rms: stats.change.sum_of_squares.map(|s| (s / count).sqrt()),
            },
            attributes: first.attributes,
            attributes_dropped: first.attributes_dropped,
            tree: first.tree,
            checksum_in: stats.checksum.to_string(),
            checksum_out: first.checksum,
            temp_bytes: gathered.store.spilled_bytes(),
            output_bytes: outputs.iter().map(|o| o.bytes).sum(),
            warnings: self.warnings.iter().chain(told).cloned().collect(),
            outputs,
            ..Report::default()
        }
    }
}

/// The inputs as the headers (and, once they were read, the points) tell them.
pub(crate) fn input_reports(job: &Job, read: Option<(&Stats, &[Option<usize>])>) -> Vec<InputReport> {
    let flat = |b: Aabb| [b.min[0], b.min[1], b.min[2], b.max[0], b.max[1], b.max[2]];
    let rgb = job.schema.rgb();
    let report = |(i, source): (usize, &crate::job::Source)| {
        let info = source.scan.info();
        let seen = read.map(|(stats, _)| &stats.sources[i]);
        let has_rgb = rgb.is_some_and(|rgb| source.columns.contains(&Some(rgb)));
        InputReport {
            path: info.path.clone(),
            format: info.format.clone(),
            points_declared: info.points_declared,
            points_read: seen.map_or(0, |s| s.read),
            bounds_declared: info.bounds_declared.map(flat),
            bounds_measured: seen.map(|s| s.bounds).filter(|b| !b.is_empty()).map(flat),
            crs: crs::resolve(&info.crs, None).map(|c| c.label).unwrap_or_default(),
            rgb_depth: read.filter(|_| has_rgb).map(|(_, widen)| if widen[i].is_some() { 8 } else { 16 }),
        }
    };
    job.sources.iter().enumerate().map(report).collect()
}

/// The coordinate reference system of all inputs together.
pub(crate) fn resolve_crs(plan: &Plan, job: &Job, warnings: &mut Vec<String>) -> Result<ResolvedCrs, ConvertError> {
    if plan.crs.is_some() {
        let resolved = crs::resolve(&Crs::default(), plan.crs.as_deref())?;
        warnings.extend(resolved.note.clone());
        return Ok(resolved);
    }
    let mut found: Vec<&Crs> = Vec::new();
    for source in &job.sources {
        let crs = &source.scan.info().crs;
        if *crs != Crs::default() && !found.contains(&crs) {
            found.push(crs);
        }
    }
    let mut resolved = Vec::new();
    for crs in found {
        let one = crs::resolve(crs, None)?;
        if !resolved.iter().any(|r: &ResolvedCrs| r.projection == one.projection && r.label == one.label) {
            resolved.push(one);
        }
    }
    match resolved.len() {
        0 => Ok(ResolvedCrs::default()),
        1 => {
            let one = resolved.swap_remove(0);
            warnings.extend(one.note.clone());
            Ok(one)
        }
        _ => {
            let labels: Vec<&str> = resolved.iter().map(|r| r.label.as_str()).collect();
            warnings.push(format!(
                "the inputs have different coordinate reference systems ({}); coordinates are taken as they are and the \
                 projection stays empty; reproject the inputs, or name the system with --crs",
                labels.join("; ")
            ));
            Ok(ResolvedCrs::default())
        }
    }
}

pub(crate) fn grid_report(job: &Job, cube: &Cube) -> GridReport {
    let mut why = job.lattice_reason.clone();
    if !job.is_lossless() {
        why.push_str("; coordinates that do not lie on it are rounded");
    }
    GridReport { scale: job.lattice.scale, offset: cube.offset(&job.lattice), cube_side: cube.side, why }
}

fn mixed_depths(job: &Job, stats: &Stats, eight: &[bool], rgb: usize) -> Option<String> {
    let coloured = |i: &usize| job.sources[*i].columns.contains(&Some(rgb)) && stats.sources[*i].kept > 0;
    // A file without any colour value above 0 is no sign of anything.
    let lit = |i: &usize| stats.sources[*i].rgb.max.iter().any(|v| *v > 0.0);
    let coloured: Vec<usize> = (0..job.sources.len()).filter(coloured).filter(lit).collect();
    let narrow = coloured.iter().filter(|i| eight[**i]).count();
    if narrow == 0 || narrow == coloured.len() {
        return None;
    }
    let first = coloured.iter().find(|i| eight[**i]).map(|i| job.sources[*i].scan.info().path.display().to_string());
    Some(format!(
        "{narrow} of {} inputs with colour hold no value above 255 and are taken as 8 bits deep, the others as 16 ({} is \
         the first); --rgb-depth overrides",
        coloured.len(),
        first.unwrap_or_default()
    ))
}

/// The name of the cloud.
pub(crate) fn name_of(plan: &Plan) -> String {
    if !plan.name.is_empty() {
        return plan.name.clone();
    }

    let stem = plan.output.file_name().map(|n| n.to_string_lossy().into_owned());
    stem.filter(|s| !s.is_empty()).unwrap_or_else(|| "cloud".into())
}

pub(crate) fn sampling_name(sampling: Sampling) -> &'static str {
    match sampling {
        Sampling::Poisson => "poisson",
        Sampling::Grid => "grid",
        Sampling::Random { .. } => "random",
    }
}

fn rgb_depth_name(depth: RgbDepth) -> &'static str {
    match depth {
        RgbDepth::Auto => "auto",
        RgbDepth::Eight => "8",
        RgbDepth::Sixteen => "16",
    }
}

fn duplicates_name(duplicates: Duplicates) -> &'static str {
    match duplicates {
        Duplicates::Keep => "keep",
        Duplicates::Drop => "drop",
    }
}

fn filter_json(plan: &Plan) -> Map<String, Value> {
    let mut filter = Map::new();
    if let Some(b) = &plan.filter.bounds {
        filter.insert("bounds".into(), json!([b.min[0], b.min[1], b.min[2], b.max[0], b.max[1], b.max[2]]));
    }
    if let Some(classes) = &plan.filter.classes {
        filter.insert("classes".into(), json!(classes));
    }
    if plan.filter.every > 1 {
        filter.insert("every".into(), plan.filter.every.into());
    }
    filter
}

fn options_json(plan: &Plan) -> Map<String, Value> {
    let mut options = filter_json(plan);
    options.insert("to".into(), plan.targets.iter().map(Target::name).collect::<Vec<_>>().into());
    for target in &plan.targets {
        match target {
            Target::Potree2 => octree_options(plan, &mut options),
            Target::Bintree(s) => {
                options.insert("capacity".into(), s.capacity.into());
                options.insert("split".into(), s.split.name().into());
                options.insert("layout".into(), s.layout.name().into());
            }
            Target::Batches(s) => {
                options.insert("lod-cell".into(), s.lod_cell.map_or("auto".into(), Value::from));
                options.insert("planes".into(), s.planes.map_or("auto".into(), |p| (u32::from(p) * 10).into()));
                options.insert("originals".into(), s.originals.into());
                if let Some(level) = s.zstd_level {
                    options.insert("zstd-level".into(), level.into());
                }
            }
        }
    }
    let attributes = match &plan.attributes {
        AttributeChoice::Usual => json!("usual"),
        AttributeChoice::All => json!("all"),
        AttributeChoice::Scene => json!("scene"),
        AttributeChoice::List(names) => json!(names),
    };
    options.insert("attributes".into(), attributes);
    options.insert("memory".into(), plan.memory_bytes.into());
    options.insert("threads".into(), plan.threads.into());
    options.insert("duplicates".into(), duplicates_name(plan.duplicates).into());
    options.insert("rgb-depth".into(), rgb_depth_name(plan.rgb_depth).into());
    options
}

fn octree_options(plan: &Plan, options: &mut Map<String, Value>) {
    options.insert("sampling".into(), sampling_name(plan.sampling).into());
    if let Sampling::Random { seed } = plan.sampling {
        options.insert("seed".into(), seed.into());
    }
    match plan.encoding {
        Encoding::Default => options.insert("encoding".into(), "default".into()),
        Encoding::Brotli { quality } => {
            options.insert("brotli-quality".into(), quality.into());
            options.insert("encoding".into(), "brotli".into())
        }
    };
    options.insert("leaf-capacity".into(), plan.leaf_capacity.into());
}

/// World coordinates of the bounds that the headers declare, on the job lattice.
pub(crate) fn tidy_bounds(job: &Job, min: [i64; 3], max: [i64; 3]) -> [f64; 6] {
    let at = |q: [i64; 3], a: usize| tidy_world(q[a], job.lattice.scale[a], job.lattice.offset[a]);
    [at(min, 0), at(min, 1), at(min, 2), at(max, 0), at(max, 1), at(max, 2)]
}

//! Scans: every point is drawn, piece by piece.

use std::ops::ControlFlow;
use std::path::PathBuf;

use pointmill_format::{Aabb, Attribute, OpenOptions, ReadError, Scan, Wanted, open_scan};

use crate::{PointSize, Style};

use super::{Buffers, Points, Source, Take, Unit, UnitSize};

/// Scans that stay open; if there are more, each is opened when it is drawn.
const MOST_OPEN: usize = 64;

/// A scan to draw.
pub(crate) struct ScanFile {
    pub(crate) path: PathBuf,
    /// What its header says.
    pub(crate) points: u64,
    /// For people.
    pub(crate) format: String,
    /// What its header says, unchecked.
    pub(crate) bounds: Option<Aabb>,
    pub(crate) pieces: usize,
    /// What did not stop the reader.
    pub(crate) warnings: Vec<String>,
    attributes: Vec<Attribute>,
    scan: Option<Box<dyn Scan>>,
}

/// Scans as one cloud.
pub(crate) struct ScansSource<'a> {
    files: &'a [ScanFile],
    options: &'a OpenOptions,
    /// Number of the file, and piece; or the whole file.
    units: Vec<(usize, Option<usize>)>,
    size: PointSize,
    /// Between points, world units, where it is known.
    spacing: Option<f32>,
}

impl ScanFile {
    /// Opens scans, and keeps them open if they are few.
    ///
    /// # Errors
    /// Those of [`open_scan`].
    pub(crate) fn open_all(paths: &[PathBuf], options: &OpenOptions) -> Result<Vec<Self>, ReadError> {
        let stay = paths.len() <= MOST_OPEN;
        let open = |path: &PathBuf| {
            let scan = open_scan(path, options)?;
            let info = scan.info();
            let points = scan.pieces().iter().map(|piece| piece.points).sum();
            let (attributes, pieces) = (info.attributes.to_vec(), scan.pieces().len());
            let (format, bounds) = (info.format.clone(), info.bounds_declared);
            let warnings = info.warnings.iter().map(ToString::to_string).collect();
            Ok(Self {
                path: path.clone(),
                points,
                format,
                bounds,
                pieces,
                warnings,
                attributes,
                scan: stay.then_some(scan),
            })
        };
        paths.iter().map(open).collect()
    }

    /// True while it is open.
    pub(crate) fn is_open(&self) -> bool {
        self.scan.is_some()
    }

    /// The scan, open.
    ///
    /// # Errors
    /// Those of [`open_scan`].
    pub(crate) fn with<T>(
        &self,
        options: &OpenOptions,
        work: impl FnOnce(&dyn Scan) -> Result<T, ReadError>,
    ) -> Result<T, ReadError> {
        match &self.scan {
            Some(scan) => work(&**scan),
            None => work(&*open_scan(&self.path, options)?),
        }
    }
}

impl<'a> ScansSource<'a> {
    pub(crate) fn new(files: &'a [ScanFile], options: &'a OpenOptions, style: &Style, spacing: Option<f32>) -> Self {
        let units = files.iter().enumerate().flat_map(|(number, file)| {
            let pieces = if file.scan.is_some() { file.pieces } else { 0 };
            let whole = (pieces == 0 && file.scan.is_none()).then_some((number, None));
            (0..pieces).map(move |piece| (number, Some(piece))).chain(whole)
        });
        Self { files, options, units: units.collect(), size: style.size, spacing }
    }

    fn file(&self, unit: usize) -> Option<(&'a ScanFile, Option<usize>)> {
        let (number, piece) = self.units.get(unit)?;
        Some((self.files.get(*number)?, *piece))
    }
}

impl Source for ScansSource<'_> {
    fn name(&self) -> String {
        match self.files {
            [] => "no scan".to_owned(),
            [one] => one.path.display().to_string(),
            [first, others @ ..] => format!("{} and {} more", first.path.display(), others.len()),
        }
    }

    fn len(&self) -> usize {
        self.units.len()
    }

    fn unit(&self, index: usize) -> Unit {
        let Some((file, piece)) = self.file(index) else { return Unit::new(0) };
        let points = match (&file.scan, piece) {
            (Some(scan), Some(piece)) => scan.pieces().get(piece).map_or(0, |piece| piece.points),
            _ => file.points,
        };
        let size = match (self.size, self.spacing) {
            (PointSize::Pixels(pixels), _) => UnitSize::Pixels(pixels),
            (PointSize::World(size), _) => UnitSize::World(size),
            (PointSize::Adaptive(factor), Some(spacing)) => UnitSize::World(spacing * factor),
            (PointSize::Adaptive(_), None) => UnitSize::One,
        };
        Unit { size, ..Unit::new(points) }
    }

    fn attributes(&self, unit: usize) -> Vec<Attribute> {
        self.file(unit).map_or_else(Vec::new, |(file, _)| file.attributes.clone())
    }

    fn read(&self, unit: usize, wanted: &[&str], buffers: &mut Buffers, take: &mut Take<'_>) -> Result<u64, ReadError> {
        let Some((file, piece)) = self.file(unit) else { return Ok(0) };
        file.with(self.options, |scan| {
            let info = scan.info();
            let mut columns = Wanted::positions(info);
            for (index, attribute) in info.attributes.iter().enumerate() {
                if wanted.contains(&attribute.name.as_str()) || is_normal(attribute, wanted) {
                    columns.set(index, true);
                }
            }
            let range = piece.map_or(0..scan.pieces().len(), |piece| piece..piece + 1);
            let mut bytes = 0;
            for piece in range {
                let mut flow = ControlFlow::Continue(());
                scan.decode(piece, &columns, &mut buffers.scan, &mut |batch| {
                    flow = take(Points::of_batch(batch, info.lattice));
                    flow
                })?;
                bytes += scan.pieces().get(piece).map_or(0, |piece| piece.byte_len);
                if flow.is_break() {
                    break;
                }
            }
            Ok(bytes)
        })
    }
}

/// Normals have several names.
fn is_normal(attribute: &Attribute, wanted: &[&str]) -> bool {
    wanted.contains(&"NormalX") && attribute.name.to_ascii_lowercase().starts_with("normal")
}

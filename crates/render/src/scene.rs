//! A dataset or scans, opened for pictures.

use std::path::{Path, PathBuf};

use pointmill_format::batches::{Batches, MappedFile};
use pointmill_format::bintree::Bintree;
use pointmill_format::octree::Octree;
use pointmill_format::{Aabb, DatasetKind, Located, OpenOptions, ReadError, locate, open_octree};

use crate::draw::draw;
use crate::sources::{ScanFile, ScansSource};
use crate::{Camera, Picture, RenderError, Size, Style, View, overview};
use crate::{render_batches, render_bintree, render_octree};

/// A dataset of any kind, or scans, with what a first look needs to know: where the points are.
///
/// ```
/// use pointmill_render::{Scene, Size, Style};
///
/// let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/bintree/files");
/// let scene = Scene::open(path)?;
/// let size = Size::new(160, 120)?;
/// let picture = scene.render(&scene.best_view(size), size, &Style::default(), u64::MAX, 0)?;
/// assert!(picture.covered() > 0);
/// # Ok::<(), pointmill_render::RenderError>(())
/// ```
pub struct Scene {
    kind: Kind,
    format: String,
    sample: overview::Sample,
}

enum Kind {
    Octree(Box<dyn Octree>),
    Bintree(Box<Bintree>),
    Batches(Box<Batches<MappedFile>>),
    Scans { files: Vec<ScanFile>, options: Box<OpenOptions>, spacing: Option<f32> },
}

impl Scene {
    /// Opens the dataset, or the scan, at `path`; the kind is detected ([`locate`], [`pointmill_format::open_scan`]).
    ///
    /// # Errors
    /// What is no dataset and no scan, and what cannot be read.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        let path = path.as_ref();
        match locate(path) {
            Ok(located) => Self::of_dataset(&located),
            Err(_) => Self::of_scans(&[path.to_path_buf()], OpenOptions::default(), 0),
        }
    }

    /// Opens a dataset.
    ///
    /// # Errors
    /// What cannot be read.
    pub fn of_dataset(located: &Located) -> Result<Self, ReadError> {
        let path = located.marker_path();
        let (kind, sample) = match located.kind {
            DatasetKind::Bintree => {
                let tree = Bintree::open(&path)?;
                let sample = overview::of_bintree(&tree)?;
                (Kind::Bintree(Box::new(tree)), sample)
            }
            DatasetKind::Batches => {
                let batches = Batches::map(&path)?;
                let sample = overview::of_batches(&batches)?;
                (Kind::Batches(Box::new(batches)), sample)
            }
            _ => {
                let octree = open_octree(&path)?;
                let sample = overview::of_octree(&*octree)?;
                (Kind::Octree(octree), sample)
            }
        };
        Ok(Self { kind, format: located.kind.title().to_owned(), sample })
    }

    /// Opens scans (and datasets, as scans) as one cloud. Some of their points are read, to see where they are: of scans in
    /// few pieces all positions, on `threads` threads (0: one per core).
    ///
    /// # Errors
    /// What is no scan, and what cannot be read.
    pub fn of_scans(paths: &[PathBuf], options: OpenOptions, threads: usize) -> Result<Self, ReadError> {
        let files = ScanFile::open_all(paths, &options)?;
        let sample = overview::of_scans(&files, &options, threads)?;
        let format = match &files[..] {
            [one] => one.format.clone(),
            many => format!("{} scans", many.len()),
        };
        let points = files.iter().map(|file| file.points).sum();
        let spacing = sample.spacing(points);
        Ok(Self { kind: Kind::Scans { files, options: Box::new(options), spacing }, format, sample })
    }

    /// What it is, for people: "Potree 2.0".
    pub fn format(&self) -> &str {
        &self.format
    }

    /// True for scans, which are drawn piece by piece, and whole.
    pub fn is_scans(&self) -> bool {
        matches!(self.kind, Kind::Scans { .. })
    }

    /// True for quantised batches, which alone have bits and levels to choose of.
    pub fn is_batches(&self) -> bool {
        matches!(self.kind, Kind::Batches(_))
    }

    /// Disagreements within scans that did not stop the readers, one line each.
    pub fn warnings(&self) -> Vec<String> {
        let Kind::Scans { files, .. } = &self.kind else { return Vec::new() };
        let lines = |file: &ScanFile| file.warnings.iter().map(|w| format!("{}: {w}", file.path.display())).collect();
        files.iter().flat_map(|file| -> Vec<String> { lines(file) }).collect()
    }

    /// Where the points are, as far as a sample or the dataset says, world units; points far from all others do not count. A
    /// box without extent at the origin if there are none.
    pub fn bounds(&self) -> Aabb {
        self.sample.bounds
    }

    /// The camera for a side: all of [`Self::bounds`] is in the picture. [`View::Fit`] is [`Self::best_view`].
    pub fn view(&self, view: View, size: Size) -> Camera {
        if view == View::Fit { self.best_view(size) } else { Camera::fit(&self.bounds(), view, size) }
    }

    /// The camera, of eight that look down at the scene by 30 degrees from around it, from which a sample of the points covers
    /// the most pixels of a small picture.
    pub fn best_view(&self, size: Size) -> Camera {
        self.sample.best_view(size)
    }

    /// Renders it: at most about `budget` points of a dataset, all points of scans. `threads`: 0 is one per core.
    ///
    /// # Errors
    /// As [`render_octree`].
    pub fn render(
        &self,
        camera: &Camera,
        size: Size,
        style: &Style,
        budget: u64,
        threads: usize,
    ) -> Result<Picture, RenderError> {
        match &self.kind {
            Kind::Octree(octree) => render_octree(&**octree, camera, size, style, budget, threads),
            Kind::Bintree(tree) => render_bintree(tree, camera, size, style, budget, threads),
            Kind::Batches(batches) => render_batches(&**batches, camera, size, style, budget, threads),
            Kind::Scans { files, options, spacing } => {
                draw(&ScansSource::new(files, options, style, *spacing), camera, size, style, threads)
            }
        }
    }
}

impl std::fmt::Debug for Scene {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Scene").field("format", &self.format).field("bounds", &self.bounds()).finish_non_exhaustive()
    }
}

/// Opens the dataset or scan at `path` and renders it, from `camera` or else from [`Scene::best_view`].
///
/// # Errors
/// As [`Scene::open`] and [`Scene::render`].
pub fn render_dataset(
    path: impl AsRef<Path>,
    camera: Option<&Camera>,
    size: Size,
    style: &Style,
    budget: u64,
    threads: usize,
) -> Result<Picture, RenderError> {
    let scene = Scene::open(path)?;
    let camera = camera.copied().unwrap_or_else(|| scene.best_view(size));
    scene.render(&camera, size, style, budget, threads)
}

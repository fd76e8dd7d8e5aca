//! A dataset as the server sees it: what the page has to know, and bytes for what it asks.

mod batch_file;
mod batches;
mod bintree;
mod octree;
mod ranges;
mod request;
mod scene;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pointmill_format::{DatasetKind, Located, locate};
use serde_json::Value;

use crate::ViewError;
use crate::refusal::Refusal;
use batches::Batches;
use bintree::Leaves;
use octree::Nodes;
pub(crate) use request::{BatchesRequest, PointsRequest, Work};

/// A dataset that can be served. Threads share it; of an octree the hierarchy is kept as far as it was requested, of a binary
/// tree all nodes, of batches their records.
#[derive(Debug)]
pub struct Dataset {
    /// Canonical: the folder, or the file if the dataset is one.
    path: PathBuf,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Octree(Arc<Nodes>),
    Bintree(Arc<Leaves>),
    Batches(Arc<Batches>),
}

impl Dataset {
    /// Opens the dataset at `path`: a folder, its marker file, or a file that is a dataset.
    ///
    /// # Errors
    /// What is no dataset, and what cannot be read.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ViewError> {
        Self::of_located(&locate(path)?)
    }

    /// Opens a dataset that was found.
    ///
    /// # Errors
    /// What cannot be read.
    pub fn of_located(located: &Located) -> Result<Self, ViewError> {
        let kind = match located.kind {
            DatasetKind::Bintree => Kind::Bintree(Arc::new(Leaves::open(&located.path)?)),
            DatasetKind::Batches => Kind::Batches(Arc::new(Batches::open(&located.path)?)),
            _ => Kind::Octree(Arc::new(Nodes::open(located)?)),
        };
        let system = |error| ViewError::System { what: located.path.display().to_string(), error };
        Ok(Self { path: located.path.canonicalize().map_err(system)?, kind })
    }

    /// Its folder, or its file, without links.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file that the dataset is; `None` of a folder.
    pub(crate) fn single_file(&self) -> Option<&str> {
        if self.path.is_dir() { None } else { self.path.file_name()?.to_str() }
    }

    /// What the page has to know of dataset `number` before it asks for points.
    pub(crate) fn scene(&self, number: usize) -> Value {
        let mut scene = match &self.kind {
            Kind::Octree(nodes) => nodes.scene(),
            Kind::Bintree(leaves) => leaves.scene(),
            Kind::Batches(batches) => batches.scene(),
        };
        scene.name_after(&self.path);
        scene.to_json(number, self.single_file())
    }

    /// Nodes of the octree from the proxy named `of` on; leaves; batches.
    pub(crate) fn nodes(&self, of: Option<&str>) -> Result<Vec<u8>, Refusal> {
        match (&self.kind, of) {
            (Kind::Octree(nodes), Some(name)) => nodes.chunk(name),
            (Kind::Octree(_), None) => {
                Err(Refusal::bad("of=NAME is missing: the node whose chunk is requested, r first"))
            }
            (Kind::Bintree(leaves), None) => Ok(leaves.nodes()),
            (Kind::Batches(batches), None) => batches.nodes(),
            (_, Some(_)) => Err(Refusal::bad("of=NAME is for octrees")),
        }
    }

    /// Points of nodes or leaves.
    pub(crate) fn points(&self, request: PointsRequest) -> Result<Work, Refusal> {
        match &self.kind {
            Kind::Octree(nodes) => {
                let ((found, cost), nodes) = (nodes.find(&request)?, Arc::clone(nodes));
                Ok(Work::new(cost, move || nodes.points(&found, &request)))
            }
            Kind::Bintree(leaves) => {
                let ((found, cost), leaves) = (leaves.find(&request)?, Arc::clone(leaves));
                Ok(Work::new(cost, move || leaves.points(&found, &request)))
            }
            Kind::Batches(_) => Err(Refusal::bad("these are batches: request api/…/batches")),
        }
    }

    /// Words of batches.
    pub(crate) fn batches(&self, request: BatchesRequest) -> Result<Work, Refusal> {
        let Kind::Batches(batches) = &self.kind else {
            return Err(Refusal::bad("these are no batches: request api/…/points"));
        };
        let (cost, batches) = (batches.cost(&request)?, Arc::clone(batches));
        Ok(Work::new(cost, move || batches.words(&request)))
    }

    /// Everything about one stored point.
    pub(crate) fn point(&self, unit: &str, index: u64) -> Result<Value, Refusal> {
        match &self.kind {
            Kind::Octree(nodes) => nodes.point(unit, index),
            Kind::Bintree(leaves) => leaves.point(unit, index),
            Kind::Batches(batches) => batches.point(unit, index),
        }
    }
}

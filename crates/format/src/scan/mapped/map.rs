//! What becomes of the points of scans, as data and as traits.

use std::fmt;
use std::sync::Arc;

use crate::{Affine, ReadError, Scan, ScanWarning};

/// A map of points that is not affine: a change of projection.
pub trait PointMap: fmt::Debug + Send + Sync {
    /// Maps points in place; x, y and z are equally long. A point that has no image becomes NaN.
    fn map(&self, points: [&mut [f64]; 3]);
}

/// What becomes of the points of a scan.
#[derive(Debug, Clone)]
pub struct ScanMap {
    /// First of all.
    pub affine: Affine,
    /// Then this, if there is one.
    pub projection: Option<Arc<dyn PointMap>>,
    /// What the user should know of it; joins the warnings of the scan.
    pub warnings: Vec<ScanWarning>,
}

impl ScanMap {
    /// An affine map.
    #[must_use]
    pub fn new(affine: Affine) -> Self {
        Self { affine, projection: None, warnings: Vec::new() }
    }
}

/// Says for each scan what becomes of its points ([`crate::OpenOptions::maps`]).
pub trait ScanMaps: fmt::Debug + Send + Sync {
    /// The map of a scan that is open; its warnings are those of the map alone.
    ///
    /// # Errors
    /// A scan that cannot be mapped as requested.
    fn of(&self, scan: &dyn Scan) -> Result<ScanMap, ReadError>;

    /// What is requested, for reports: names and values, in the order in which they apply.
    fn settings(&self) -> Vec<(&'static str, String)>;

    /// The coordinate reference system that all points end in (`EPSG:n`, a proj4 definition or WKT), if it is not that of
    /// their scans.
    fn target(&self) -> Option<&str> {
        None
    }
}

/// The same map for every scan.
impl ScanMaps for ScanMap {
    fn of(&self, _: &dyn Scan) -> Result<ScanMap, ReadError> {
        Ok(self.clone())
    }

    fn settings(&self) -> Vec<(&'static str, String)> {
        let projection = self.projection.as_ref().map(|projection| ("projection", format!("{projection:?}")));
        [("transform", self.affine.to_string())].into_iter().chain(projection).collect()
    }
}

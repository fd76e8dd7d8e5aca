//! What is requested, and the map of each scan that follows from it.

use std::sync::Arc;

use pointmill_format::{Advice, Affine, ReadError, Scan, ScanMap, ScanMaps, ScanWarning};

use crate::heights::heights;
use crate::operation::way;
use crate::system::{CrsError, System};
use crate::units::{Units, is_same, name, ratio};

/// What becomes of the points of scans: units, then axes, then a matrix, then a projection.
#[derive(Debug, Clone, Default)]
pub struct Placing {
    units: Option<Units>,
    y_up: bool,
    transform: Option<Affine>,
    /// The system of all scans, whatever these declare.
    crs: Option<System>,
    /// The system to reproject to.
    target: Option<System>,
}

impl Placing {
    /// The coordinates are in this unit. They become metres, or the unit of the coordinate reference system where that
    /// has another; z the unit of its heights.
    #[must_use]
    pub fn with_units(self, units: Units) -> Self {
        Self { units: Some(units), ..self }
    }

    /// y is up: (x, y, z) becomes (x, −z, y).
    #[must_use]
    pub fn with_y_up(self) -> Self {
        Self { y_up: true, ..self }
    }

    /// A map of points, in the units and axes that come before.
    #[must_use]
    pub fn with_transform(self, transform: Affine) -> Self {
        Self { transform: Some(transform), ..self }
    }

    /// The system of all scans, whatever these declare: `EPSG:n`, a `+proj=…` definition or WKT.
    ///
    /// # Errors
    /// A text that is none, or one that is not supported.
    pub fn with_crs(mut self, text: &str) -> Result<Self, CrsError> {
        self.crs = Some(System::parse(text)?);
        Ok(self)
    }

    /// True for `EPSG:n` or `EPSG:n+m` with a number that the tables of this crate do not know.
    #[must_use]
    pub fn is_unknown_code(text: &str) -> bool {
        System::is_unknown_code(text)
    }

    /// The system to reproject to.
    ///
    /// # Errors
    /// A text that is none, or one that is not supported.
    pub fn with_target(mut self, text: &str) -> Result<Self, CrsError> {
        self.target = Some(System::parse(text)?);
        Ok(self)
    }

    /// True if no point moves.
    pub fn is_nothing(&self) -> bool {
        self.units.is_none() && !self.y_up && self.transform.is_none() && self.target.is_none()
    }

    fn system_of(&self, scan: &dyn Scan) -> Result<Option<System>, ReadError> {
        if self.crs.is_some() {
            return Ok(self.crs.clone());
        }
        let info = scan.info();
        System::of_scan(&info.crs)
            .map_err(|e| ReadError::unsupported(&info.path, e.to_string()).advise(Advice::NameCrs))
    }

    /// Factors from the unit of the scan to those of its system, along its axes.
    fn scaling(&self, scan: &dyn Scan, system: Option<&System>, map: &mut ScanMap) -> Result<Affine, ReadError> {
        let Some(units) = self.units else { return Ok(Affine::IDENTITY) };
        let unit = match system.map(System::unit) {
            Some(Some(unit)) => unit,
            None => 1.0,
            Some(None) => {
                let what = "its coordinate reference system is in degrees, which have no unit of length";
                return Err(ReadError::unsupported(&scan.info().path, what).advise(Advice::NameCrs));
            }
        };
        if self.crs.is_none() && system.is_some() && !is_same(units.metres(), unit) {
            map.warnings.push(ScanWarning::UnitsClash { declared: name(unit), given: name(units.metres()) });
        }
        let flat = ratio(units.metres(), unit);
        let up = ratio(units.metres(), system.and_then(System::height_unit).unwrap_or(unit));
        Ok(Affine::scaling(if self.y_up { [flat, up, flat] } else { [flat, flat, up] }))
    }

    /// Adds the projection from `from` to the target.
    fn project(&self, scan: &dyn Scan, from: Option<&System>, to: &System, map: &mut ScanMap) -> Result<(), ReadError> {
        let path = &scan.info().path;
        let Some(from) = from else {
            let what = "it has no coordinate reference system to reproject from";
            return Err(ReadError::unsupported(path, what).advise(Advice::NameCrs));
        };
        let refuse = |why: String| ReadError::unsupported(path, why).advise(Advice::OtherCrs);
        // after a scaling z has the declared unit, or else that of x and y
        let unit = from.height_unit().or_else(|| from.unit().filter(|_| self.units.is_some()));
        let heights = heights(from, to, unit).map_err(refuse)?;
        let file_unit = match (from.unit(), from.defined_unit()) {
            (Some(unit), Some(defined)) => ratio(unit, defined),
            _ => 1.0,
        };
        map.affine = map.affine.then(&Affine::scaling([file_unit, file_unit, heights.factor]));
        let area = scan.bounds_hint().map(|bounds| map.affine.bounds(&bounds));
        let way = way(from, to, area.as_ref()).map_err(refuse)?;
        map.warnings.extend(heights.warning);
        map.warnings.extend(way.datum_change.map(|by| ScanWarning::DatumChange { by }));
        map.projection = Some(Arc::new(way.projection));
        Ok(())
    }
}

impl ScanMaps for Placing {
    fn of(&self, scan: &dyn Scan) -> Result<ScanMap, ReadError> {
        let needs_system = self.units.is_some() || self.target.is_some();
        let system = if needs_system { self.system_of(scan)? } else { None };
        let mut map = ScanMap::new(Affine::IDENTITY);
        let scaling = self.scaling(scan, system.as_ref(), &mut map)?;
        let axes = if self.y_up { Affine::Y_UP } else { Affine::IDENTITY };
        map.affine = scaling.then(&axes).then(&self.transform.unwrap_or(Affine::IDENTITY));
        if let Some(target) = &self.target {
            self.project(scan, system.as_ref(), target, &mut map)?;
        }
        Ok(map)
    }

    fn target(&self) -> Option<&str> {
        self.target.as_ref().map(|target| target.definition.as_str())
    }

    fn settings(&self) -> Vec<(&'static str, String)> {
        let mut settings = Vec::new();
        settings.extend(self.units.map(|units| ("units", units.name().to_owned())));
        settings.extend(self.y_up.then(|| ("axes", "y-up".to_owned())));
        settings.extend(self.transform.map(|map| ("transform", map.to_string())));
        settings.extend(self.target.as_ref().map(|target| ("reproject", target.definition.clone())));
        settings
    }
}

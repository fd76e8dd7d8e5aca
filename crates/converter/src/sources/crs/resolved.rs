//! A coordinate reference system by its code, and what is known of it.

use std::borrow::Cow;

use pointmill_format::Unit;

use super::{proj4, wkt};
use crate::warning::{CrsNote, Proj4Fault};

/// False eastings that differ by less are the same, metres.
const SAME_EASTING: f64 = 0.01;

/// A coordinate reference system as far as it could be resolved.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct ResolvedCrs {
    /// proj4 definition for Potree metadata, beginning with `+proj=`, or empty.
    pub projection: String,
    /// The WKT that was found or given, as it is.
    pub wkt: Option<String>,
    /// For people: "EPSG:2994 NAD83(HARN) / Oregon GIC Lambert (ft)", "WKT: my grid", a proj4 text, or empty.
    pub label: String,
    /// Unit of x and y, where it is known.
    pub unit: Option<Unit>,
    /// Unit of z, where it is known: nothing is concluded from that of x and y.
    pub vertical_unit: Option<Unit>,
    /// x, y and z are measured from the centre of the Earth, z along its axis.
    pub is_geocentric: bool,
    /// The WKT of the table for the code, where the scan says nothing else than the code does.
    pub(super) of_code: Option<&'static str>,
    /// EPSG code of the system of heights, where it stands beside a code.
    pub(super) vertical_code: Option<u32>,
    /// What the user should know: why `projection` is empty although a system is named, that a unit is not the one of
    /// the code, or that WKT and GeoTIFF keys of one file disagree.
    pub notes: Vec<CrsNote>,
}

impl ResolvedCrs {
    /// True if x and y are longitude and latitude, in degrees or another angle.
    pub fn is_geographic(&self) -> bool {
        self.unit.is_some_and(Unit::is_angle)
    }

    /// The system as WKT: what was found or given, if it is whole, else what its code means. `None` if there is no system, or
    /// nothing says it in WKT. A system of heights whose unit is not known, or that cannot stand beside the other, is left out.
    pub fn wkt_text(&self) -> Option<Cow<'_, str>> {
        if let Some(wkt) = self.wkt.as_deref().filter(|text| wkt::is_wkt(text) && wkt::is_whole(text)) {
            return Some(Cow::Borrowed(wkt));
        }
        let horizontal = self.of_code?;
        let heights = self.vertical_code.zip(self.vertical_unit);
        let compound = heights.and_then(|(code, unit)| wkt::compound(horizontal, code, unit));
        Some(compound.map_or(Cow::Borrowed(horizontal), Cow::Owned))
    }

    /// Equal for systems that are the same, though files may declare them in other words.
    pub(super) fn kind(&self) -> String {
        format!("{:?}", (&self.projection, &self.label, self.unit, self.vertical_unit))
    }
}

/// `declared`: the unit that the scan says it has. `false_easting`: metres, where the scan has one of its own.
pub(super) fn from_code(code: u32, declared: Option<Unit>, false_easting: Option<f64>) -> ResolvedCrs {
    let Some(def) = lookup(code) else {
        let (label, notes) = (format!("EPSG:{code}"), vec![CrsNote::NotInTable { code }]);
        return ResolvedCrs { label, notes, unit: declared, ..ResolvedCrs::default() };
    };
    let system = wkt::read(def.wkt).unwrap_or_default();
    let (name, own) = (&system.name, own_unit(&system, def.proj4));
    let unit = declared.unwrap_or(own);
    let (mut projection, mut notes) = unzip(proj4::for_viewers(def.proj4, unit), Some(code));
    let mut label = format!("EPSG:{code} {name}").trim_end().to_owned();
    if unit != own {
        label = format!("{label} in units of {unit}");
        notes.insert(0, CrsNote::Unit { code, own, declared: unit });
    }
    let own_easting = proj4::false_easting(def.proj4);
    if let Some((found, own)) = false_easting.zip(own_easting).filter(|(a, b)| (a - b).abs() > SAME_EASTING) {
        projection.clear();
        notes.push(CrsNote::FalseEasting { code, found, own });
    }
    let vertical_unit = proj4::vertical_unit(def.proj4);
    let is_geocentric = proj4::is_geocentric(def.proj4);
    let is_as_declared = unit == own && !notes.iter().any(|note| matches!(note, CrsNote::FalseEasting { .. }));
    let of_code = is_as_declared.then_some(def.wkt);
    let (wkt, unit, vertical_code) = (None, Some(unit), None);
    ResolvedCrs { projection, wkt, label, unit, vertical_unit, is_geocentric, of_code, vertical_code, notes }
}

/// A definition knows degrees alone: that a system is in grads is in the WKT of the table.
fn own_unit(system: &wkt::WktSystem, proj4: &str) -> Unit {
    system.unit.unwrap_or_else(|| proj4::unit(proj4))
}

/// The unit of x and y of the system with that code.
pub(super) fn unit_of_code(code: u32) -> Option<Unit> {
    let def = lookup(code)?;
    Some(own_unit(&wkt::read(def.wkt).unwrap_or_default(), def.proj4))
}

pub(super) fn lookup(code: u32) -> Option<crs_definitions::Def> {
    crs_definitions::from_code(u16::try_from(code).ok()?)
}

/// The code of the horizontal part if `code` is a compound system of the table, else `code`.
pub(super) fn horizontal(code: u32) -> u32 {
    lookup(code).and_then(|def| wkt::read(def.wkt)?.epsg).unwrap_or(code)
}

/// The projection or nothing, and why; `code`: where the definition comes from the table.
pub(super) fn unzip(result: Result<String, Proj4Fault>, code: Option<u32>) -> (String, Vec<CrsNote>) {
    match result {
        Ok(projection) => (projection, Vec::new()),
        Err(why) => (String::new(), vec![CrsNote::NotForViewers { code, why }]),
    }
}

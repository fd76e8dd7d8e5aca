//! The coordinate reference system as records: WKT, or GeoTIFF keys, the inverse of what is read.

use crate::scan::las::crs::WKT;
use crate::scan::las::geotiff::{self as keys, DIRECTORY, DOUBLES, TEXTS};
use crate::{Crs, Unit};

/// What kind of system an EPSG code names; the code alone does not say it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CrsKind {
    /// In a plane: east and north.
    Projected,
    /// Angles: longitude and latitude.
    Geographic,
    /// Lengths along three axes through the middle of the earth.
    Geocentric,
}

/// The records of a coordinate reference system.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CrsRecords {
    /// Number (of the user `LASF_Projection`) and data.
    pub(super) records: Vec<(u16, Vec<u8>)>,
    /// Of WKT and GeoTIFF keys, the former counts.
    pub(super) is_wkt: bool,
}

impl CrsRecords {
    /// WKT if it is known; GeoTIFF keys if they say something beside it or alone. Keys that define a system by parameters were
    /// not read, and are not written.
    pub fn new(crs: &Crs, kind: CrsKind) -> Self {
        let mut records = Vec::new();
        if let Some(wkt) = &crs.wkt {
            records.push((WKT, [wkt.as_bytes(), &[0]].concat()));
        }
        let keys = Keys::of(crs, kind);
        // keys that define a system by parameters are not written: then the WKT counts
        let is_wkt = crs.wkt.is_some() && !(crs.keys_first && crs.epsg.is_some());
        if let Some(keys) = keys {
            records.extend(keys.records());
        }
        Self { records, is_wkt }
    }

    /// True if nothing is known.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// True if there is WKT, which LAS knows since 1.4.
    pub(super) fn has_wkt(&self) -> bool {
        self.records.iter().any(|(number, _)| *number == WKT)
    }
}

/// GeoTIFF keys.
#[derive(Default)]
struct Keys {
    entries: Vec<[u16; 4]>,
    doubles: Vec<f64>,
    texts: String,
}

impl Keys {
    fn of(crs: &Crs, kind: CrsKind) -> Option<Self> {
        let Crs { epsg, vertical_epsg, unit, vertical_unit, citation, .. } = crs;
        let code = |code: &Option<u32>| code.and_then(|code| u16::try_from(code).ok());
        let (model, system, unit_key, size_key) = match kind {
            CrsKind::Projected => (keys::PROJECTED, keys::PROJECTED_CRS, keys::LINEAR_UNIT, keys::LINEAR_UNIT_SIZE),
            CrsKind::Geographic => (2, keys::GEODETIC_CRS, keys::ANGULAR_UNIT, keys::ANGULAR_UNIT_SIZE),
            CrsKind::Geocentric => {
                (keys::GEOCENTRIC, keys::GEODETIC_CRS, keys::GEOCENTRIC_UNIT, keys::GEOCENTRIC_UNIT_SIZE)
            }
        };
        let mut out = Self::default();
        if let Some(epsg) = code(epsg) {
            out.entries.push([keys::MODEL_TYPE, 0, 1, model]);
            out.entries.push([system, 0, 1, epsg]);
        }
        if let Some(citation) = citation.as_deref().filter(|text| text.is_ascii()) {
            out.entries.push([keys::CITATION, TEXTS, citation.len() as u16 + 1, 0]);
            out.texts = format!("{citation}|");
        }
        if let Some(unit) = unit {
            out.unit(*unit, unit_key, Some(size_key));
        }
        if let Some(epsg) = code(vertical_epsg) {
            out.entries.push([keys::VERTICAL_CRS, 0, 1, epsg]);
        }
        if let Some(unit) = vertical_unit {
            out.unit(*unit, keys::VERTICAL_UNIT, None);
        }
        // entries ascend
        out.entries.sort_unstable();
        (!out.entries.is_empty()).then_some(out)
    }

    /// A unit by its code, else by its size.
    fn unit(&mut self, unit: Unit, key: u16, size_key: Option<u16>) {
        if let Some(code) = unit.epsg() {
            self.entries.push([key, 0, 1, code]);
            return;
        }
        let size = match unit {
            Unit::Length(size) | Unit::Angle(size) => size,
            Unit::Unknown => return,
        };
        if let Some(size_key) = size_key {
            self.entries.push([key, 0, 1, keys::USER_DEFINED]);
            self.entries.push([size_key, DOUBLES, 1, self.doubles.len() as u16]);
            self.doubles.push(size);
        }
    }

    fn records(&self) -> Vec<(u16, Vec<u8>)> {
        let head = [1, 1, 0, self.entries.len() as u16];
        let directory = head.iter().chain(self.entries.iter().flatten()).flat_map(|v| v.to_le_bytes()).collect();
        let mut out = vec![(DIRECTORY, directory)];
        if !self.doubles.is_empty() {
            out.push((DOUBLES, self.doubles.iter().flat_map(|v| v.to_le_bytes()).collect()));
        }
        if !self.texts.is_empty() {
            out.push((TEXTS, [self.texts.as_bytes(), &[0]].concat()));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::las::crs::{USER_ID, read};
    use crate::scan::las::records::{Record, Records};

    fn read_back(crs: &Crs, kind: CrsKind) -> Crs {
        let CrsRecords { records, is_wkt } = CrsRecords::new(crs, kind);
        let record =
            |(record_id, data): (u16, Vec<u8>)| Record { user_id: USER_ID.to_owned(), record_id, data_offset: 0, data };
        let records = Records { kept: records.into_iter().map(record).collect(), ..Records::default() };
        let mut warnings = Vec::new();
        let found = read(&records, is_wkt, &mut warnings);
        assert_eq!(warnings, []);
        found
    }

    #[test]
    fn what_is_written_is_read() {
        let foot = Some(Unit::US_SURVEY_FOOT);
        let odd = Some(Unit::length(0.123));
        let named =
            Crs { citation: Some("mine".into()), ..Crs::new(None, Some(32610), Some(5703)).with_units(odd, foot) };
        let both = Crs { keys_first: true, ..Crs::new(Some("PROJCS[\"Höhe\"]".into()), Some(25832), None) };
        for (crs, kind) in [
            (Crs::default(), CrsKind::Projected),
            (Crs::new(Some("GEOGCS[\"a\"]".into()), None, None), CrsKind::Geographic),
            (Crs::new(None, Some(25832), None).with_units(Some(Unit::METRE), None), CrsKind::Projected),
            (Crs::new(None, Some(4326), None).with_units(Some(Unit::DEGREE), None), CrsKind::Geographic),
            (Crs::new(None, Some(4978), None).with_units(Some(Unit::METRE), None), CrsKind::Geocentric),
            (Crs::new(None, None, None).with_units(Some(Unit::FOOT), Some(Unit::FOOT)), CrsKind::Projected),
            (named, CrsKind::Projected),
            (both.clone(), CrsKind::Projected),
            (Crs { keys_first: false, ..both }, CrsKind::Projected),
        ] {
            assert_eq!(read_back(&crs, kind), crs);
        }
    }
}

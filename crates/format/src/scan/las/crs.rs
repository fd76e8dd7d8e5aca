//! The coordinate reference system: OGC WKT (record 2112) and GeoTIFF keys (record 34735).

use super::bytes::u16_at;
use super::records::Records;
use crate::{Crs, ScanWarning};

const USER_ID: &str = "LASF_Projection";
/// GeoTIFF key ids (GeoTIFF 1.1 §7).
const GEODETIC_CRS: u16 = 2048;
const PROJECTED_CRS: u16 = 3072;
const VERTICAL_CRS: u16 = 4096;

/// Collects what the file says; malformed keys become a line in `warnings`.
pub(super) fn read(records: &Records, warnings: &mut Vec<ScanWarning>) -> Crs {
    let mut crs = Crs::default();
    if let Some(record) = records.find(USER_ID, 2112) {
        let text = String::from_utf8_lossy(&record.data);
        let text = text.trim_end_matches('\0').trim();
        // some writers pad with text after the first zero byte; the definition ends there
        let text = text.split('\0').next().unwrap_or_default();
        crs.wkt = (!text.is_empty()).then(|| text.to_owned());
    }
    if let Some(record) = records.find(USER_ID, 34735) {
        let keys = GeoKeys::parse(&record.data, warnings);
        crs.epsg = keys.epsg(PROJECTED_CRS).or_else(|| keys.epsg(GEODETIC_CRS));
        crs.vertical_epsg = keys.epsg(VERTICAL_CRS);
    }
    crs
}

/// The short-valued keys of a GeoKeyDirectory: (key id, value).
struct GeoKeys(Vec<(u16, u16)>);

impl GeoKeys {
    fn parse(data: &[u8], warnings: &mut Vec<ScanWarning>) -> Self {
        let declared = usize::from(u16_at(data, 6));
        let there = (data.len() / 8).saturating_sub(1);
        if data.len() < 8 || u16_at(data, 0) != 1 || declared > there {
            warnings.push(ScanWarning::GeoTiffKeys { version: u16_at(data, 0), declared, room: there });
        }
        let entry = |i: usize| 8 + 8 * i;
        let keys = (0..declared.min(there))
            // location 0: the value stands in the entry itself
            .filter(|i| u16_at(data, entry(*i) + 2) == 0)
            .map(|i| (u16_at(data, entry(i)), u16_at(data, entry(i) + 6)))
            .collect();
        Self(keys)
    }

    /// The EPSG code under `key`; 0 (undefined) and 32767 and above (user-defined, private) are none.
    fn epsg(&self, key: u16) -> Option<u32> {
        self.0.iter().find(|(id, _)| *id == key).map(|(_, v)| u32::from(*v)).filter(|v| (1..32767).contains(v))
    }
}

#[cfg(test)]
mod tests {
    use super::super::records::Record;
    use super::*;

    fn with(record_id: u16, data: Vec<u8>) -> (Crs, Vec<ScanWarning>) {
        let record = Record { user_id: USER_ID.to_owned(), record_id, data_offset: 0, data };
        let mut warnings = Vec::new();
        (read(&Records { kept: vec![record], evlr_start: None }, &mut warnings), warnings)
    }

    fn keys(values: &[u16]) -> Vec<u8> {
        values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }

    #[test]
    fn wkt_loses_its_padding_and_keeps_its_text() {
        let (crs, warnings) = with(2112, b"PROJCS[\"a\"]\0\0\0".to_vec());
        assert_eq!(crs.wkt.as_deref(), Some("PROJCS[\"a\"]"));
        assert!(warnings.is_empty());
        assert_eq!(with(2112, vec![0; 4]).0.wkt, None);
    }

    #[test]
    fn the_projected_code_wins_over_the_geographic_one() {
        let data = keys(&[1, 1, 0, 3, 2048, 0, 1, 4326, 3072, 0, 1, 32610, 4096, 0, 1, 5703]);
        let (crs, warnings) = with(34735, data);
        assert_eq!((crs.epsg, crs.vertical_epsg), (Some(32610), Some(5703)));
        assert!(warnings.is_empty());
    }

    #[test]
    fn user_defined_codes_are_none_and_cut_keys_are_a_warning() {
        let (crs, warnings) = with(34735, keys(&[1, 1, 0, 9, 2048, 0, 1, 4326, 3072, 0, 1, 32767]));
        assert_eq!((crs.epsg, crs.vertical_epsg), (Some(4326), None));
        assert_eq!(warnings.len(), 1);
        assert_eq!(with(34735, vec![1]).1.len(), 1);
    }
}

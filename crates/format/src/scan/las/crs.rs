//! The coordinate reference system: OGC WKT (record 2112) and GeoTIFF keys (records 34735 to 34737).

use super::geotiff::{self, GeoKeys};
use super::records::Records;
use crate::{Crs, ScanWarning};

pub(super) const USER_ID: &str = "LASF_Projection";
pub(super) const WKT: u16 = 2112;

/// Collects what the file says; what is malformed becomes a line in `warnings`. `wkt_counts`: where there are both WKT
/// and keys, the header says that the WKT counts.
pub(super) fn read(records: &Records, wkt_counts: bool, warnings: &mut Vec<ScanWarning>) -> Crs {
    let mut crs = Crs { wkt: wkt(records, warnings), ..Crs::default() };
    let data = |id: u16| records.find(USER_ID, id).map(|record| &record.data[..]);
    if let Some(directory) = data(geotiff::DIRECTORY) {
        let [doubles, texts] = [geotiff::DOUBLES, geotiff::TEXTS].map(|id| data(id).unwrap_or_default());
        let keys = GeoKeys::parse(directory, doubles, texts, warnings);
        crs.epsg = keys.horizontal();
        crs.vertical_epsg = keys.vertical();
        crs.unit = keys.unit(warnings);
        crs.vertical_unit = keys.vertical_unit(warnings);
        crs.citation = keys.citation();
        crs.is_user_defined = keys.is_user_defined();
        crs.keys_first = !wkt_counts && crs.wkt.is_some() && (crs.epsg.is_some() || crs.is_user_defined);
    }
    crs
}

/// The first WKT record that holds a text.
fn wkt(records: &Records, warnings: &mut Vec<ScanWarning>) -> Option<String> {
    let mut found = false;
    for record in records.kept.iter().filter(|record| record.is(USER_ID, WKT)) {
        found = true;
        let text = String::from_utf8_lossy(&record.data);
        // some writers pad with text after the first zero byte; the definition ends there
        let text = text.split('\0').next().unwrap_or_default().trim();
        if !text.trim_matches('"').trim().is_empty() {
            return Some(text.to_owned());
        }
    }
    if found {
        warnings.push(ScanWarning::WktEmpty);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::super::records::Record;
    use super::*;
    use crate::Unit;

    fn with_all(records: &[(u16, Vec<u8>)], wkt_counts: bool) -> (Crs, Vec<ScanWarning>) {
        let record = |(id, data): &(u16, Vec<u8>)| Record {
            user_id: USER_ID.to_owned(),
            record_id: *id,
            data_offset: 0,
            data: data.clone(),
        };
        let mut warnings = Vec::new();
        let records = Records { kept: records.iter().map(record).collect(), ..Records::default() };
        (read(&records, wkt_counts, &mut warnings), warnings)
    }

    fn with(record_id: u16, data: Vec<u8>) -> (Crs, Vec<ScanWarning>) {
        with_all(&[(record_id, data)], false)
    }

    fn keys(values: &[u16]) -> Vec<u8> {
        values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }

    #[test]
    fn wkt_loses_its_padding_and_keeps_its_text() {
        let (crs, warnings) = with(2112, b"PROJCS[\"a\"]\0\0\0".to_vec());
        assert_eq!(crs.wkt.as_deref(), Some("PROJCS[\"a\"]"));
        assert!(warnings.is_empty());
    }

    #[test]
    fn an_empty_text_is_told_and_a_later_one_is_taken() {
        for empty in [&[0; 4][..], b"", b"\"\"", b" \n\0"] {
            let (crs, warnings) = with(2112, empty.to_vec());
            assert_eq!((crs.wkt, warnings), (None, vec![ScanWarning::WktEmpty]));
            let (crs, warnings) = with_all(&[(2112, empty.to_vec()), (2112, b"GEOGCS[\"a\"]".to_vec())], false);
            assert_eq!((crs.wkt.as_deref(), warnings), (Some("GEOGCS[\"a\"]"), vec![]));
        }
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
        // projected by parameters: the geographic code beneath is not the system of the points
        assert_eq!((crs.epsg, crs.vertical_epsg, crs.is_user_defined), (None, None, true));
        assert_eq!(warnings.len(), 1);
        assert_eq!(with(34735, vec![1]).1.len(), 1);
        let (crs, _) = with(34735, keys(&[1, 1, 0, 2, 1024, 0, 1, 1, 2048, 0, 1, 4269]));
        assert_eq!((crs.epsg, crs.is_user_defined), (None, true));
        let (crs, _) = with(34735, keys(&[1, 1, 0, 2, 1024, 0, 1, 2, 2048, 0, 1, 4269]));
        assert_eq!((crs.epsg, crs.is_user_defined), (Some(4269), false));
    }

    #[test]
    fn units_are_those_of_the_kind_of_system() {
        let unit = |data: &[u16]| with(34735, keys(data)).0.unit;
        let projected = [1, 1, 0, 3, 1024, 0, 1, 1, 3072, 0, 1, 32104, 3076, 0, 1];
        assert_eq!(unit(&[&projected[..], &[9003]].concat()), Some(Unit::US_SURVEY_FOOT));
        assert_eq!(unit(&[&projected[..], &[9002]].concat()), Some(Unit::FOOT));
        assert_eq!(unit(&projected[..12]), None);
        let geographic = [1, 1, 0, 4, 1024, 0, 1, 2, 2048, 0, 1, 4807, 3076, 0, 1, 9001, 2054, 0, 1, 9105];
        assert_eq!(unit(&geographic), Some(Unit::from_epsg(9105)));
        let vertical = [1, 1, 0, 3, 3072, 0, 1, 32104, 4096, 0, 1, 5703, 4099, 0, 1, 9003];
        let (crs, warnings) = with(34735, keys(&vertical));
        assert_eq!((crs.unit, crs.vertical_unit), (None, Some(Unit::US_SURVEY_FOOT)));
        assert!(warnings.is_empty());
    }

    #[test]
    fn a_user_defined_unit_has_its_size_among_the_doubles() {
        let directory = keys(&[1, 1, 0, 3, 3072, 0, 1, 32104, 3076, 0, 1, 32767, 3077, 34736, 1, 1]);
        let doubles: Vec<u8> = [9.0, 0.3048006096].iter().flat_map(|v: &f64| v.to_le_bytes()).collect();
        let (crs, warnings) = with_all(&[(34735, directory.clone()), (34736, doubles)], false);
        assert_eq!((crs.unit, warnings), (Some(Unit::US_SURVEY_FOOT), vec![]));
        let (crs, warnings) = with(34735, directory);
        assert_eq!(
            (crs.unit, warnings),
            (Some(Unit::Unknown), vec![ScanWarning::GeoTiffUnit { key: 3076, code: 32767 }])
        );
    }

    #[test]
    fn the_header_says_which_record_counts_and_the_citation_is_the_projected_ones() {
        let directory = keys(&[1, 1, 0, 3, 1026, 34737, 4, 0, 3072, 0, 1, 32104, 3073, 34737, 5, 4]);
        let all = [(2112, b"PROJCS[\"a\"]".to_vec()), (34735, directory), (34737, b"any|mine|\0".to_vec())];
        let (crs, _) = with_all(&all, false);
        assert_eq!((crs.keys_first, crs.citation.as_deref()), (true, Some("mine")));
        assert!(!with_all(&all, true).0.keys_first && !with_all(&all[1..], false).0.keys_first);
    }
}

//! The coordinate reference system that a dataset names.

use crate::scan::DatasetNote;
use crate::{Crs, ScanWarning};

/// Characters of a text that a warning shows.
const SHOWN: usize = 60;

/// From the WKT of the dataset, and its `projection`: a proj4 definition, `EPSG:n`, or WKT.
pub(super) fn crs_of(wkt: Option<&str>, projection: &str, warnings: &mut Vec<ScanWarning>) -> Crs {
    let mut crs = Crs::new(wkt.map(str::to_owned), None, None);
    let text = projection.trim();
    if text.is_empty() {
        return crs;
    }
    if text.contains("+proj=") {
        crs.proj4 = Some(text.to_owned());
    } else if let Some(code) = code_of(text) {
        crs.epsg = Some(code);
    } else if looks_like_wkt(text) {
        crs.wkt.get_or_insert_with(|| text.to_owned());
    } else {
        let start = text.chars().take(SHOWN).collect();
        warnings.push(ScanWarning::Dataset(DatasetNote::ProjectionUnknown { start }));
    }
    crs
}

fn code_of(text: &str) -> Option<u32> {
    let code = |prefix: &str| {
        let start = text.get(..prefix.len()).filter(|start| start.eq_ignore_ascii_case(prefix))?;
        text[start.len()..].trim().parse().ok()
    };
    ["EPSG:", "+init=EPSG:"].into_iter().find_map(code)
}

/// `KEYWORD[…]`.
fn looks_like_wkt(text: &str) -> bool {
    let keyword = text.split(['[', '(']).next().unwrap_or_default().trim();
    !keyword.is_empty()
        && keyword.len() < text.trim_end().len()
        && keyword.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && text.trim_end().ends_with([']', ')'])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_projection_is_kept_as_what_it_is() {
        let of = |wkt, text| {
            let mut warnings = Vec::new();
            (crs_of(wkt, text, &mut warnings), warnings.len())
        };
        let mut proj4 = Crs { proj4: Some("+proj=utm +zone=33".to_owned()), ..Crs::default() };
        assert_eq!(of(None, " +proj=utm +zone=33\n"), (proj4.clone(), 0));
        proj4.wkt = Some("PROJCS[]".to_owned());
        assert_eq!(of(Some("PROJCS[]"), "+proj=utm +zone=33"), (proj4, 0));
        assert_eq!(of(None, "EPSG:4326"), (Crs::new(None, Some(4326), None), 0));
        assert_eq!(of(None, "GEOGCS[\"a\"]"), (Crs::new(Some("GEOGCS[\"a\"]".to_owned()), None, None), 0));
        assert_eq!(of(None, ""), (Crs::default(), 0));
        assert_eq!(of(None, "UTM 33"), (Crs::default(), 1));
    }
}

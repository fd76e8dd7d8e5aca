//! From what a scan says about its coordinate reference system to what a Potree viewer can use.
//!
//! `projection` of Potree metadata may hold a proj4 definition that the viewer's own proj4js (2.6.2 in Potree 1.8)
//! takes, or nothing: WKT, a bare EPSG code or an unknown `+proj` throws on each frame and nothing is drawn. Codes
//! are looked up in the table of the crate `crs-definitions` (PostGIS' `spatial_ref_sys`, 6,184 systems). A unit that
//! the scan declares goes before the one of its code. Nothing is guessed: a system without a code, with one that the
//! table lacks, or in a unit that proj4 cannot name, leaves `projection` empty and says why.

mod definition;
mod printable;
mod proj4;
mod records;
mod resolved;
mod vertical;
mod wkt;

use std::collections::HashSet;
use std::sync::Arc;

use pointmill_format::Crs;

use super::Source;
use crate::plan::{Plan, PlanError, PlanFault, Setting};
use crate::warning::{CrsNote, Warning};

use printable::printable;
use records::from_proj4;
use resolved::from_code;

pub use records::resolve_crs;
pub use resolved::ResolvedCrs;

/// The coordinate reference system of all points together: the one that they are reprojected to, else what the plan
/// says, else what the scans agree on.
///
/// # Errors
/// A text in the plan that is not a proj4 definition, `EPSG:n` or WKT.
pub(crate) fn resolve_all(
    plan: &Plan,
    sources: &[Source],
    warnings: &mut Vec<Warning>,
) -> Result<ResolvedCrs, PlanError> {
    if let Some(target) = plan.open.maps.as_ref().and_then(|maps| maps.target()) {
        let target = from_text(target)?;
        warnings.extend(target.notes.iter().cloned().map(Warning::Crs));
        return Ok(target);
    }
    // scans that declare the same share it
    let mut seen = HashSet::new();
    let systems = sources.iter().map(|source| &source.crs).filter(|crs| seen.insert(Arc::as_ptr(crs)));
    let found: Vec<&Crs> = systems.map(|crs| &**crs).filter(|crs| **crs != Crs::default()).collect();
    let mut kinds = HashSet::new();
    let resolved = found.iter().copied().map(resolve_crs);
    let mut resolved: Vec<ResolvedCrs> = resolved.filter(|one| kinds.insert(one.kind())).collect();
    let one = match (&plan.crs, resolved.len()) {
        (Some(text), _) => given(text.trim(), &found, &resolved)?,
        (None, 0) => ResolvedCrs::default(),
        (None, 1) => resolved.swap_remove(0),
        (None, _) => {
            let labels = resolved.into_iter().map(|r| r.label).collect();
            warnings.push(Warning::DifferentCrs { labels });
            return Ok(ResolvedCrs::default());
        }
    };
    warnings.extend(one.notes.iter().cloned().map(Warning::Crs));
    Ok(one)
}

/// The system that the plan names. What the scans say of units is kept where they name the same system, and told where
/// they name another.
fn given(text: &str, found: &[&Crs], resolved: &[ResolvedCrs]) -> Result<ResolvedCrs, PlanError> {
    let mut out = from_text(text)?;
    let declared = match resolved {
        [one] => one.unit,
        _ => None,
    };
    let (Some(own), Some(declared)) = (out.unit, declared.filter(|d| Some(*d) != out.unit)) else { return Ok(out) };
    match code_and_height(text) {
        Some((code, _)) if found.iter().all(|crs| records::code_of(crs) == Some(code)) => {
            let same = from_code(code, Some(declared), None);
            out = ResolvedCrs { wkt: out.wkt, vertical_unit: out.vertical_unit.or(same.vertical_unit), ..same };
        }
        _ => out.notes.push(CrsNote::GivenUnit { given: own, declared }),
    }
    Ok(out)
}

fn from_text(text: &str) -> Result<ResolvedCrs, PlanError> {
    let fault = |fault: fn(String) -> PlanFault| Err(PlanError::new(Setting::Crs, fault(printable(text))));
    if let Some((code, height)) = code_and_height(text) {
        let mut out = from_code(code, None, None);
        if let Some(height) = height {
            out.label = format!("{} + EPSG:{height}", out.label);
            out.vertical_unit = vertical::unit_of(height);
        }
        return Ok(out);
    }
    if text.starts_with('+') && text.split_whitespace().any(|t| t.starts_with("+proj=")) {
        if let Some(what) = definition::fault(text) {
            let fault = PlanFault::Definition { text: printable(text), what: printable(&what) };
            return Err(PlanError::new(Setting::Crs, fault));
        }
        return Ok(from_proj4(text));
    }
    match wkt::is_wkt(text) {
        true if !wkt::is_whole(text) => fault(PlanFault::CutWkt),
        true if !wkt::has_quoted_name(text) => fault(PlanFault::EmptyWkt),
        true if wkt::is_followed(text) => fault(PlanFault::LongWkt),
        true if wkt::read(text).is_some_and(|system| system.name.trim().is_empty()) => fault(PlanFault::EmptyWkt),
        true => Ok(resolve_crs(&Crs::new(Some(text.to_owned()), None, None))),
        false => fault(PlanFault::NotACrs),
    }
}

/// What a scan would declare for a text that [`resolve_all`] takes; `None`: a proj4 definition.
pub(crate) fn declared_by(text: &str) -> Option<Crs> {
    match code_and_height(text) {
        Some((code, height)) => Some(Crs::new(None, Some(code), height)),
        None => wkt::is_wkt(text).then(|| Crs::new(Some(text.to_owned()), None, None)),
    }
}

/// `EPSG:n`, or `EPSG:n+m` with a system of heights.
fn code_and_height(text: &str) -> Option<(u32, Option<u32>)> {
    let after = |p: &str| text.get(..p.len()).filter(|t| t.eq_ignore_ascii_case(p)).map(|t| &text[t.len()..]);
    let codes = after("EPSG:").or_else(|| after("+init=EPSG:"))?.trim();
    match codes.split_once('+') {
        Some((code, height)) => Some((code.trim().parse().ok()?, Some(height.trim().parse().ok()?))),
        None => Some((codes.parse().ok()?, None)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn geotiff(code: u32) -> ResolvedCrs {
        resolve_crs(&Crs::new(None, Some(code), None))
    }

    fn in_wkt(text: &str, epsg: Option<u32>) -> ResolvedCrs {
        resolve_crs(&Crs::new(Some(text.into()), epsg, None))
    }

    fn given(text: &str) -> Result<ResolvedCrs, PlanError> {
        from_text(text.trim())
    }

    const OREGON: &str = "+proj=lcc +lat_1=43 +lat_2=45.5 +lat_0=41.75 +lon_0=-120.5 +x_0=399999.9999984 +y_0=0 \
                          +ellps=GRS80 +towgs84=0,0,0,0,0,0,0 +units=ft +no_defs";

    #[test]
    fn geotiff_codes_become_proj4_definitions_with_a_label() {
        let oregon = geotiff(2994);
        assert_eq!(oregon.projection, OREGON);
        assert_eq!(oregon.label, "EPSG:2994 NAD83(HARN) / Oregon GIC Lambert (ft)");
        assert_eq!((oregon.wkt, oregon.notes), (None, vec![]));
        assert_eq!(geotiff(32633).projection, "+proj=utm +zone=33 +datum=WGS84 +units=m +no_defs");
        assert_eq!(geotiff(4326).projection, "+proj=longlat +datum=WGS84 +no_defs");
        assert_eq!(geotiff(25832).label, "EPSG:25832 ETRS89 / UTM zone 32N");
        assert!(geotiff(3857).projection.starts_with("+proj=merc +a=6378137 +b=6378137"));
        assert!(geotiff(3857).projection.contains("+nadgrids=@null"));
        let crs = Crs::new(None, Some(2994), Some(5703));
        assert!(resolve_crs(&crs).label.ends_with("(ft) + EPSG:5703"));
    }

    #[test]
    fn a_compound_code_gives_its_horizontal_part_without_heights() {
        let compound = geotiff(6349);
        assert_eq!(compound.projection, "+proj=longlat +ellps=GRS80 +no_defs");
        assert_eq!(compound.label, "EPSG:6349 NAD83(2011) + NAVD88 height");
        assert_eq!(geotiff(5972).projection, geotiff(25832).projection);
    }

    #[test]
    fn no_table_entry_gives_a_viewer_what_it_cannot_take() {
        let mut resolved = 0;
        for code in 0..=u32::from(u16::MAX) {
            let crs = geotiff(code);
            let p = &crs.projection;
            assert_eq!(p.is_empty(), !crs.notes.is_empty(), "EPSG:{code}");
            assert!(p.is_empty() || p.starts_with("+proj="), "EPSG:{code}: {p}");
            assert!(!p.contains("grids=") || p.contains("+nadgrids=@null"), "EPSG:{code}: {p}");
            assert!(!p.contains("=webmerc") && !p.contains("=labrd") && !p.contains("=eqearth"), "EPSG:{code}: {p}");
            resolved += usize::from(!p.is_empty());
        }
        assert!(resolved > 6000, "{resolved}");
    }

    #[test]
    fn wkt_resolves_by_its_horizontal_code_and_is_kept() {
        let text = r#"COMPD_CS["NAD83 / Oregon LCC (m) + NAVD88 height (ftUS)",PROJCS["NAD83 / Oregon LCC (m)",GEOGCS["NAD83",AUTHORITY["EPSG","4269"]],AUTHORITY["EPSG","2991"]],VERT_CS["NAVD88 height (ftUS)",AUTHORITY["EPSG","6360"]]]"#;
        let crs = in_wkt(text, None);
        assert!(crs.projection.starts_with("+proj=lcc ") && crs.projection.contains("+units=m"), "{}", crs.projection);
        assert_eq!(crs.label, "EPSG:2991 NAD83 / Oregon LCC (m) + NAVD88 height (ftUS)");
        assert_eq!(crs.wkt.as_deref(), Some(text));
    }

    #[test]
    fn wkt_without_a_code_takes_the_geotiff_code_or_stays_empty_with_a_note() {
        let text = r#"PROJCS["NAD_1983_HARN_Lambert",GEOGCS["g",DATUM["d",AUTHORITY["EPSG","6152"]]],UNIT["foot",0.3048,AUTHORITY["EPSG","9002"]]]"#;
        let alone = in_wkt(text, None);
        assert_eq!((alone.projection.as_str(), alone.label.as_str()), ("", "WKT: NAD_1983_HARN_Lambert"));
        assert!(alone.notes[0].to_string().contains("no EPSG code"));
        let both = in_wkt(text, Some(2994));
        assert_eq!((both.projection.as_str(), both.wkt.as_deref()), (OREGON, Some(text)));
        assert_eq!(in_wkt("rubbish", Some(2994)).projection, OREGON);
        assert!(!in_wkt("rubbish", None).notes.is_empty());
    }

    #[test]
    fn a_proj4_extension_serves_when_there_is_no_code() {
        let crs =
            in_wkt(r#"PROJCS["mine",EXTENSION["PROJ4","+proj=tmerc +lon_0=9 +geoidgrids=x.gtx +units=m"]]"#, None);
        assert_eq!(crs.projection, "+proj=tmerc +lon_0=9 +units=m");
        assert_eq!(crs.label, "WKT: mine");
    }

    #[test]
    fn wkt_goes_before_geotiff_keys_and_a_disagreement_is_reported() {
        let utm = r#"PROJCS["WGS 84 / UTM zone 33N",AUTHORITY["EPSG","32633"]]"#;
        assert_eq!(in_wkt(utm, Some(32633)).notes, []);
        let crs = in_wkt(utm, Some(2994));
        assert!(crs.projection.starts_with("+proj=utm +zone=33"));
        assert!(crs.notes[0].to_string().contains("EPSG:2994"));
        // A compound system in the keys agrees with its horizontal part in the text.
        assert_eq!(in_wkt(r#"GEOGCS["NAD83(2011)",AUTHORITY["EPSG","6318"]]"#, Some(6349)).notes, []);
    }

    #[test]
    fn unknown_codes_stay_empty_with_a_note() {
        for code in [1, 1999, 65_536, u32::MAX] {
            let crs = geotiff(code);
            assert_eq!((crs.projection.as_str(), crs.label), ("", format!("EPSG:{code}")));
            assert!(crs.notes[0].to_string().contains("not in the table"));
        }
        assert_eq!(resolve_crs(&Crs::default()), ResolvedCrs::default());
    }

    #[test]
    fn the_override_takes_proj4_codes_and_wkt_and_nothing_else() {
        assert_eq!(given(" epsg:2994 ").unwrap().projection, OREGON);
        assert_eq!(given("+init=epsg:2994").unwrap().projection, OREGON);
        assert_eq!(given("+units=m +proj=utm +zone=32").unwrap().projection, "+proj=utm +units=m +zone=32");
        let text = r#"GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]]"#;
        assert_eq!(given(text).unwrap().wkt.as_deref(), Some(text));
        assert!(given("+proj=labrd +lat_0=1").unwrap().notes[0].to_string().contains("labrd"));
        for nonsense in ["", "32633", "EPSG:", "EPSG:x", "EPSG:-1", "UTM 33", "+lat_0=1", "DATUM[\"x\"]", "é"] {
            assert_eq!(given(nonsense).unwrap_err().setting, Setting::Crs, "{nonsense}");
        }
    }

    #[test]
    fn control_characters_of_a_file_do_not_reach_the_terminal() {
        let crs = in_wkt("PROJCS[\"a\u{1b}[31m\",AUTHORITY[\"EPSG\",\"32633\"]]", None);
        assert_eq!(crs.label, "EPSG:32633 a[31m");
    }
}

//! From what a scan says about its coordinate reference system to what a Potree viewer can use.
//!
//! `projection` of Potree metadata may hold a proj4 definition that the viewer's own proj4js (2.6.2 in Potree 1.8)
//! takes, or nothing: WKT, a bare EPSG code or an unknown `+proj` throws on each frame and nothing is drawn. Codes
//! are looked up in the table of the crate `crs-definitions` (PostGIS' `spatial_ref_sys`, 6,184 systems). Nothing is
//! guessed: a system without a code, or with one that the table lacks, leaves `projection` empty and says why.

mod wkt;

use pointmill_format::Crs;

use super::Source;
use crate::plan::{Plan, PlanError, PlanFault, Setting};
use crate::warning::{CrsNote, Proj4Fault, Warning};

/// What proj4js 2.6.2 can project. Of the table, `webmerc`, `eqearth` and `labrd` are not among these.
const VIEWER_PROJECTIONS: [&str; 28] = [
    "aea", "aeqd", "cass", "cea", "eqc", "eqdc", "etmerc", "geocent", "gnom", "krovak", "laea", "lcc", "longlat",
    "merc", "mill", "moll", "nzmg", "omerc", "ortho", "poly", "qsc", "robin", "sinu", "somerc", "stere", "sterea",
    "tmerc", "utm",
];

/// Longest label, characters.
const MAX_LABEL: usize = 160;

/// A coordinate reference system as far as it could be resolved.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct ResolvedCrs {
    /// proj4 definition for Potree metadata, beginning with `+proj=`, or empty.
    pub(crate) projection: String,
    /// The WKT that was found or given, as it is.
    pub(crate) wkt: Option<String>,
    /// For people: "EPSG:2994 NAD83(HARN) / Oregon GIC Lambert (ft)", "WKT: my grid", a proj4 text, or empty.
    pub(crate) label: String,
    /// What the user should know: why `projection` is empty although a system is named, or that WKT and GeoTIFF keys
    /// of one file disagree.
    pub(crate) note: Option<CrsNote>,
}

/// The coordinate reference system of all inputs together: what the plan says, else what the scans agree on.
///
/// # Errors
/// A text in the plan that is not a proj4 definition, `EPSG:n` or WKT.
pub(crate) fn resolve_all(
    plan: &Plan,
    sources: &[Source],
    warnings: &mut Vec<Warning>,
) -> Result<ResolvedCrs, PlanError> {
    if let Some(text) = &plan.crs {
        let resolved = from_text(text.trim())?;
        warnings.extend(resolved.note.clone().map(Warning::Crs));
        return Ok(resolved);
    }
    let mut found: Vec<&Crs> = Vec::new();
    for source in sources {
        let crs = &source.scan.info().crs;
        if *crs != Crs::default() && !found.contains(&crs) {
            found.push(crs);
        }
    }
    let mut resolved: Vec<ResolvedCrs> = Vec::new();
    for one in found.into_iter().map(resolve_scan) {
        if !resolved.iter().any(|r| r.projection == one.projection && r.label == one.label) {
            resolved.push(one);
        }
    }
    match resolved.len() {
        0 => Ok(ResolvedCrs::default()),
        1 => {
            let one = resolved.swap_remove(0);
            warnings.extend(one.note.clone().map(Warning::Crs));
            Ok(one)
        }
        _ => {
            let labels = resolved.into_iter().map(|r| r.label).collect();
            warnings.push(Warning::DifferentCrs { labels });
            Ok(ResolvedCrs::default())
        }
    }
}

/// What a scan says of its coordinate reference system; WKT goes before GeoTIFF keys.
pub(crate) fn resolve_scan(found: &Crs) -> ResolvedCrs {
    let mut out = match (&found.wkt, found.epsg) {
        (Some(text), epsg) if !text.trim().is_empty() => from_wkt(text, epsg),
        (_, Some(code)) => from_code(code),
        _ => return ResolvedCrs::default(),
    };
    if let (None, Some(code)) = (&out.wkt, found.vertical_epsg) {
        out.label = format!("{} + EPSG:{code}", out.label);
    }
    out
}

fn from_text(text: &str) -> Result<ResolvedCrs, PlanError> {
    let prefix = |p: &str| text.get(..p.len()).filter(|t| t.eq_ignore_ascii_case(p)).map(|t| &text[t.len()..]);
    if let Some(code) = prefix("EPSG:").or_else(|| prefix("+init=EPSG:")).and_then(|n| n.trim().parse().ok()) {
        return Ok(from_code(code));
    }
    if text.starts_with('+') && text.split_whitespace().any(|t| t.starts_with("+proj=")) {
        let (projection, note) = unzip(for_viewers(text), None);
        return Ok(ResolvedCrs { projection, wkt: None, label: printable(text), note });
    }
    if wkt::is_wkt(text) {
        return Ok(from_wkt(text, None));
    }
    Err(PlanError::new(Setting::Crs, PlanFault::NotACrs(printable(text))))
}

/// `geotiff_epsg` stands in for a WKT without a code.
fn from_wkt(text: &str, geotiff_epsg: Option<u32>) -> ResolvedCrs {
    let Some(system) = wkt::read(text) else {
        let mut out = geotiff_epsg.map(from_code).unwrap_or_else(|| ResolvedCrs {
            label: "WKT".into(),
            note: Some(CrsNote::NoSystem),
            ..ResolvedCrs::default()
        });
        out.wkt = Some(text.to_owned());
        return out;
    };
    let mut out = match (system.epsg, &system.proj4, geotiff_epsg) {
        (Some(code), ..) => from_code(code),
        (None, Some(proj4), _) => {
            let (projection, note) = unzip(for_viewers(proj4), None);
            ResolvedCrs { projection, note, ..ResolvedCrs::default() }
        }
        (None, None, Some(code)) => from_code(code),
        (None, None, None) => {
            ResolvedCrs { note: Some(CrsNote::NoCode { name: printable(&system.name) }), ..ResolvedCrs::default() }
        }
    };
    let disagree = |a: u32| geotiff_epsg.filter(|&b| horizontal(a) != horizontal(b));
    if let Some((a, b)) = system.epsg.and_then(|a| Some((a, disagree(a)?))) {
        out.note.get_or_insert(CrsNote::Disagree { wkt: a, geotiff: b });
    }
    out.wkt = Some(text.to_owned());
    out.label = match system.epsg {
        Some(code) => format!("EPSG:{code} {}", printable(&system.name)),
        None if out.label.is_empty() => format!("WKT: {}", printable(&system.name)),
        None => out.label, // from the GeoTIFF keys
    };
    out
}

fn from_code(code: u32) -> ResolvedCrs {
    let Some(def) = lookup(code) else {
        return ResolvedCrs {
            label: format!("EPSG:{code}"),
            note: Some(CrsNote::NotInTable { code }),
            ..ResolvedCrs::default()
        };
    };
    let name = wkt::read(def.wkt).map(|s| s.name).unwrap_or_default();
    let (projection, note) = unzip(for_viewers(def.proj4), Some(code));
    ResolvedCrs { projection, wkt: None, label: format!("EPSG:{code} {name}").trim_end().to_owned(), note }
}

fn lookup(code: u32) -> Option<crs_definitions::Def> {
    crs_definitions::from_code(u16::try_from(code).ok()?)
}

/// The code of the horizontal part if `code` is a compound system of the table, else `code`.
fn horizontal(code: u32) -> u32 {
    lookup(code).and_then(|def| wkt::read(def.wkt)?.epsg).unwrap_or(code)
}

/// A definition that Potree viewers take: `+proj` first, and nothing about heights or grid files, which they have not.
///
/// # Errors
/// Why there is none.
fn for_viewers(proj4: &str) -> Result<String, Proj4Fault> {
    let parameters: Vec<&str> = proj4.split_whitespace().collect();
    let well_formed = |p: &&str| p.len() > 1 && p.starts_with('+') && p.bytes().all(|b| b.is_ascii_graphic());
    let Some(projection) = parameters.iter().find_map(|p| p.strip_prefix("+proj=")) else {
        return Err(Proj4Fault::Missing);
    };
    if !parameters.iter().all(well_formed) {
        return Err(Proj4Fault::Malformed(printable(proj4)));
    }
    if !VIEWER_PROJECTIONS.contains(&projection) {
        return Err(Proj4Fault::UnknownProjection(projection.to_owned()));
    }
    let mut out = format!("+proj={projection}");
    for parameter in parameters {
        let key = parameter.split('=').next().unwrap_or_default();
        let dropped = match key {
            "+proj" | "+geoidgrids" | "+vunits" | "+vto_meter" => true,
            "+nadgrids" => parameter != "+nadgrids=@null",
            _ => false,
        };
        if !dropped {
            out.push(' ');
            out.push_str(parameter);
        }
    }
    Ok(out)
}

/// The projection or nothing, and why; `code`: where the definition comes from the table.
fn unzip(result: Result<String, Proj4Fault>, code: Option<u32>) -> (String, Option<CrsNote>) {
    match result {
        Ok(projection) => (projection, None),
        Err(why) => (String::new(), Some(CrsNote::NotForViewers { code, why })),
    }
}

/// Names come from files: no control characters to the terminal, and no pages of text.
fn printable(name: &str) -> String {
    name.chars().filter(|c| !c.is_control()).take(MAX_LABEL).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn geotiff(code: u32) -> ResolvedCrs {
        resolve_scan(&Crs::new(None, Some(code), None))
    }

    fn in_wkt(text: &str, epsg: Option<u32>) -> ResolvedCrs {
        resolve_scan(&Crs::new(Some(text.into()), epsg, None))
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
        assert_eq!((oregon.wkt, oregon.note), (None, None));
        assert_eq!(geotiff(32633).projection, "+proj=utm +zone=33 +datum=WGS84 +units=m +no_defs");
        assert_eq!(geotiff(4326).projection, "+proj=longlat +datum=WGS84 +no_defs");
        assert_eq!(geotiff(25832).label, "EPSG:25832 ETRS89 / UTM zone 32N");
        assert!(geotiff(3857).projection.starts_with("+proj=merc +a=6378137 +b=6378137"));
        assert!(geotiff(3857).projection.contains("+nadgrids=@null"));
        let crs = Crs::new(None, Some(2994), Some(5703));
        assert!(resolve_scan(&crs).label.ends_with("(ft) + EPSG:5703"));
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
            assert_eq!(p.is_empty(), crs.note.is_some(), "EPSG:{code}");
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
        assert!(alone.note.unwrap().to_string().contains("no EPSG code"));
        let both = in_wkt(text, Some(2994));
        assert_eq!((both.projection.as_str(), both.wkt.as_deref()), (OREGON, Some(text)));
        assert_eq!(in_wkt("rubbish", Some(2994)).projection, OREGON);
        assert!(in_wkt("rubbish", None).note.is_some());
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
        assert_eq!(in_wkt(utm, Some(32633)).note, None);
        let crs = in_wkt(utm, Some(2994));
        assert!(crs.projection.starts_with("+proj=utm +zone=33"));
        assert!(crs.note.unwrap().to_string().contains("EPSG:2994"));
        // A compound system in the keys agrees with its horizontal part in the text.
        assert_eq!(in_wkt(r#"GEOGCS["NAD83(2011)",AUTHORITY["EPSG","6318"]]"#, Some(6349)).note, None);
    }

    #[test]
    fn unknown_codes_stay_empty_with_a_note() {
        for code in [1, 1999, 65_536, u32::MAX] {
            let crs = geotiff(code);
            assert_eq!((crs.projection.as_str(), crs.label), ("", format!("EPSG:{code}")));
            assert!(crs.note.unwrap().to_string().contains("not in the table"));
        }
        assert_eq!(resolve_scan(&Crs::default()), ResolvedCrs::default());
    }

    #[test]
    fn the_override_takes_proj4_codes_and_wkt_and_nothing_else() {
        assert_eq!(given(" epsg:2994 ").unwrap().projection, OREGON);
        assert_eq!(given("+init=epsg:2994").unwrap().projection, OREGON);
        assert_eq!(given("+units=m +proj=utm +zone=32").unwrap().projection, "+proj=utm +units=m +zone=32");
        let text = r#"GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]]"#;
        assert_eq!(given(text).unwrap().wkt.as_deref(), Some(text));
        assert!(given("+proj=labrd +lat_0=1").unwrap().note.unwrap().to_string().contains("labrd"));
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

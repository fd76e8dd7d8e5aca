//! What one scan says in its WKT and its GeoTIFF keys, and which of them is taken.

use pointmill_format::{Crs, Unit};

use super::printable::printable;
use super::resolved::{ResolvedCrs, from_code, horizontal, unit_of_code, unzip};
use super::wkt::{self, WktSystem};
use super::{proj4, vertical};
use crate::warning::CrsNote;

/// What is known of the coordinate reference system that a scan declares: units, a definition for viewers, a name.
///
/// The WKT goes before the GeoTIFF keys, unless they contradict each other and the scan says that the keys count.
pub fn resolve_crs(found: &Crs) -> ResolvedCrs {
    let mut out = from_records(found);
    // datasets have a definition beside the WKT, or alone
    if let Some(definition) = found.proj4.as_deref().filter(|_| out.projection.is_empty()) {
        let own = from_proj4(definition);
        let is_named = !out.label.is_empty();
        out.projection = own.projection;
        out.notes.retain(|note| !matches!(note, CrsNote::NoCode { .. } | CrsNote::NoSystem));
        out.notes.extend(own.notes);
        out.unit = out.unit.or(own.unit);
        out.vertical_unit = out.vertical_unit.or(own.vertical_unit);
        out.is_geocentric |= own.is_geocentric;
        out.label = if is_named { out.label } else { own.label };
    }
    out
}

/// The system of a proj4 definition.
pub(super) fn from_proj4(text: &str) -> ResolvedCrs {
    let unit = proj4::unit(text);
    let (projection, notes) = unzip(proj4::for_viewers(text, unit), None);
    let (unit, vertical_unit) = (Some(unit), proj4::vertical_unit(text));
    let (label, is_geocentric) = (printable(text), proj4::is_geocentric(text));
    ResolvedCrs { projection, wkt: None, label, unit, vertical_unit, is_geocentric, notes }
}

fn from_records(found: &Crs) -> ResolvedCrs {
    let Some(text) = found.wkt.as_deref().filter(|text| !text.trim().is_empty()) else { return from_keys(found) };
    let Some(system) = wkt::read(text) else {
        let mut out = from_keys(found);
        if out.label.is_empty() {
            out.label = "WKT".to_owned();
            out.notes.push(CrsNote::NoSystem);
        }
        return ResolvedCrs { wkt: Some(text.to_owned()), ..out };
    };
    let [in_wkt, in_keys] = [Described::of_wkt(&system), Described::of_keys(found)];
    let odds = in_wkt.contradicts(&in_keys).then(|| CrsNote::Disagree {
        wkt: in_wkt.to_string(),
        geotiff: in_keys.to_string(),
        keys_taken: found.keys_first,
    });
    let mut out = match odds.is_some() && found.keys_first {
        true => from_keys(found),
        false => from_wkt(text, &system, found),
    };
    out.notes.splice(0..0, odds);
    out
}

/// The EPSG code of the system that is taken.
pub(super) fn code_of(found: &Crs) -> Option<u32> {
    let of_wkt = || wkt::read(found.wkt.as_deref()?)?.epsg;
    if found.keys_first { found.epsg.or_else(of_wkt) } else { of_wkt().or(found.epsg) }
}

fn from_keys(found: &Crs) -> ResolvedCrs {
    let mut out = match found.epsg {
        Some(code) => from_code(code, found.unit, None),
        None if found.is_user_defined => {
            let name = printable(found.citation.as_deref().unwrap_or_default());
            let label = format!("GeoTIFF: {}", if name.is_empty() { "user-defined" } else { &name });
            let notes = vec![CrsNote::UserDefined { name }];
            ResolvedCrs { label, notes, unit: found.unit, ..ResolvedCrs::default() }
        }
        None => ResolvedCrs { unit: found.unit, ..ResolvedCrs::default() },
    };
    if let Some(code) = found.vertical_epsg.filter(|_| !out.label.is_empty()) {
        out.label = format!("{} + EPSG:{code}", out.label);
    }
    out.vertical_unit = heights_of_keys(found).or(out.vertical_unit);
    out
}

/// Where the WKT carries no code, that of the keys is taken, in the WKT's own unit.
fn from_wkt(text: &str, system: &WktSystem, found: &Crs) -> ResolvedCrs {
    let name = printable(&system.name);
    let mut out = match (system.epsg, &system.proj4, found.epsg) {
        (Some(code), ..) => from_code(code, system.unit, system.false_easting),
        (None, Some(definition), _) => {
            let unit = system.unit.unwrap_or_else(|| proj4::unit(definition));
            let (projection, notes) = unzip(proj4::for_viewers(definition, unit), None);
            ResolvedCrs { projection, notes, unit: Some(unit), ..ResolvedCrs::default() }
        }
        (None, None, Some(code)) => from_code(code, system.unit.or(found.unit), system.false_easting),
        (None, None, None) => {
            let notes = vec![CrsNote::NoCode { name: name.clone() }];
            ResolvedCrs { notes, unit: system.unit, ..ResolvedCrs::default() }
        }
    };
    out.is_geocentric |= system.is_geocentric || system.proj4.as_deref().is_some_and(proj4::is_geocentric);
    if !system.is_whole {
        out.notes.push(CrsNote::CutWkt);
    }
    out.wkt = Some(text.to_owned());
    out.label = match system.epsg {
        Some(code) => format!("EPSG:{code} {name}{}", other_unit(&out)).trim_end().to_owned(),
        None if !out.label.is_empty() => out.label, // from the GeoTIFF keys
        None if name.trim().is_empty() => "WKT without a name".to_owned(),
        None => format!("WKT: {name}"),
    };
    let of_code = system.vertical_epsg.and_then(vertical::unit_of);
    let said = system.vertical_unit.or(of_code).or_else(|| heights_of_keys(found));
    out.vertical_unit = said.or(out.vertical_unit);
    out
}

/// " in units of US survey foot", where the unit is not that of the code.
fn other_unit(crs: &ResolvedCrs) -> String {
    let other = crs.notes.iter().find_map(|note| match note {
        CrsNote::Unit { declared, .. } => Some(declared),
        _ => None,
    });
    other.map_or_else(String::new, |unit| format!(" in units of {unit}"))
}

fn heights_of_keys(found: &Crs) -> Option<Unit> {
    found.vertical_unit.or_else(|| vertical::unit_of(found.vertical_epsg?))
}

/// What one record says, as far as the records can be compared.
struct Described {
    code: Option<u32>,
    unit: Option<Unit>,
    vertical_code: Option<u32>,
    vertical_unit: Option<Unit>,
}

impl Described {
    fn of_wkt(system: &WktSystem) -> Self {
        let of_code = || system.vertical_epsg.and_then(vertical::unit_of);
        Self {
            code: system.epsg,
            unit: system.unit.or_else(|| unit_of_code(system.epsg?)),
            vertical_code: system.vertical_epsg,
            vertical_unit: system.vertical_unit.or_else(of_code),
        }
    }

    fn of_keys(found: &Crs) -> Self {
        Self {
            code: found.epsg,
            unit: found.unit.or_else(|| unit_of_code(found.epsg?)),
            vertical_code: found.vertical_epsg,
            vertical_unit: heights_of_keys(found),
        }
    }

    fn contradicts(&self, other: &Self) -> bool {
        fn differ<T: PartialEq>(a: Option<T>, b: Option<T>) -> bool {
            a.zip(b).is_some_and(|(a, b)| a != b)
        }
        differ(self.code.map(horizontal), other.code.map(horizontal))
            || differ(self.unit, other.unit)
            || differ(self.vertical_code, other.vertical_code)
            || differ(self.vertical_unit, other.vertical_unit)
    }
}

impl std::fmt::Display for Described {
    /// "EPSG:2994 in units of foot, heights EPSG:5703 in units of metre".
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let part = |code: Option<u32>, unit: Option<Unit>| {
            let code = code.map(|code| format!("EPSG:{code}"));
            let unit = unit.map(|unit| format!("units of {unit}"));
            [code, unit].into_iter().flatten().collect::<Vec<_>>().join(" in ")
        };
        let heights = part(self.vertical_code, self.vertical_unit);
        let heights = if heights.is_empty() { heights } else { format!("heights {heights}") };
        let parts = [part(self.code, self.unit), heights];
        f.write_str(&parts.into_iter().filter(|p| !p.is_empty()).collect::<Vec<_>>().join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::super::resolved::lookup;
    use super::*;

    fn keys(code: u32, unit: Option<Unit>) -> ResolvedCrs {
        resolve_crs(&Crs::new(None, Some(code), None).with_units(unit, None))
    }

    fn in_wkt(text: &str) -> ResolvedCrs {
        resolve_crs(&Crs::new(Some(text.into()), None, None))
    }

    /// Nebraska's system in US survey feet: the false easting stays 500 km.
    const NEBRASKA: &str = "+proj=lcc +lat_1=43 +lat_2=40 +lat_0=39.83333333333334 +lon_0=-100 +x_0=500000 +y_0=0 \
                            +datum=NAD83 +units=us-ft +no_defs";

    #[test]
    fn a_declared_unit_goes_before_that_of_the_code() {
        let feet = keys(32104, Some(Unit::US_SURVEY_FOOT));
        assert_eq!(feet.projection, NEBRASKA);
        assert_eq!(feet.label, "EPSG:32104 NAD83 / Nebraska in units of US survey foot");
        assert_eq!((feet.unit, feet.notes.len()), (Some(Unit::US_SURVEY_FOOT), 1));
        assert!(keys(32104, Some(Unit::FOOT)).projection.contains("+x_0=500000 +y_0=0 +datum=NAD83 +units=ft "));
        assert!(keys(32104, Some(Unit::Length(0.5))).projection.contains(" +to_meter=0.5 "));
        let unknown = keys(32104, Some(Unit::Unknown));
        assert_eq!((unknown.projection.as_str(), unknown.notes.len()), ("", 2));
        let same = keys(32104, Some(Unit::METRE));
        assert_eq!((same.notes.len(), same.projection.contains("+units=m ")), (0, true));
        assert_eq!(keys(2994, None).unit, Some(Unit::FOOT));
    }

    #[test]
    fn geographic_coordinates_are_degrees_or_have_no_definition() {
        assert!(keys(4326, None).is_geographic() && !keys(32633, None).is_geographic());
        for grads in [keys(4807, None), keys(4807, Some(Unit::from_epsg(9105)))] {
            assert_eq!((grads.projection.as_str(), grads.is_geographic(), grads.notes.len()), ("", true, 1));
            assert_eq!(
                grads.notes[0].to_string().split(": ").last(),
                Some("a proj4 definition cannot have coordinates in units of grad")
            );
        }
    }

    #[test]
    fn the_wkts_own_unit_goes_before_that_of_its_code() {
        let text = |easting: &str| {
            format!(
                r#"PROJCS["Nebraska (ftUS)",GEOGCS["NAD83",UNIT["degree",0.0174532925199433]],PARAMETER["false_easting",{easting}],UNIT["US survey foot",0.304800609601219],AUTHORITY["EPSG","32104"]]"#
            )
        };
        let feet = in_wkt(&text("1640416.6666667"));
        assert_eq!((feet.projection.as_str(), feet.unit), (NEBRASKA, Some(Unit::US_SURVEY_FOOT)));
        assert_eq!(feet.label, "EPSG:32104 Nebraska (ftUS) in units of US survey foot");
        // the easting was not converted with the unit: which of both is wrong cannot be told
        let other = in_wkt(&text("500000"));
        assert_eq!(other.projection, "");
        assert!(
            other.notes.iter().any(|n| matches!(n, CrsNote::FalseEasting { code: 32104, .. })),
            "{:?}",
            other.notes
        );
    }

    #[test]
    fn heights_have_their_own_unit() {
        let text = r#"COMPD_CS["c",PROJCS["a",UNIT["metre",1],AUTHORITY["EPSG","26915"]],VERT_CS["h",UNIT["US survey foot",0.3048006096],AUTHORITY["EPSG","6360"]]]"#;
        let crs = in_wkt(text);
        assert_eq!((crs.unit, crs.vertical_unit), (Some(Unit::METRE), Some(Unit::US_SURVEY_FOOT)));
        assert!(crs.projection.contains("+units=m "));
        let heights = |code, unit| resolve_crs(&Crs::new(None, Some(32104), code).with_units(None, unit)).vertical_unit;
        assert_eq!(heights(None, None), None, "nothing is concluded from x and y");
        assert_eq!(heights(Some(6360), None), Some(Unit::US_SURVEY_FOOT));
        assert_eq!(heights(Some(5703), Some(Unit::FOOT)), Some(Unit::FOOT));
    }

    #[test]
    fn records_at_odds_are_named_and_the_header_says_which_counts() {
        let text = r#"PROJCS["NAD83 / Nebraska",UNIT["metre",1],AUTHORITY["EPSG","32104"]]"#;
        let mut crs = Crs::new(Some(text.into()), Some(32104), None).with_units(Some(Unit::US_SURVEY_FOOT), None);
        let wkt = resolve_crs(&crs);
        assert!(wkt.projection.contains("+units=m "), "{}", wkt.projection);
        assert_eq!(
            wkt.notes[0].to_string(),
            "the WKT says EPSG:32104 in units of metre but the GeoTIFF keys say EPSG:32104 in units of US survey \
             foot; the WKT was taken"
        );
        crs.keys_first = true;
        let keys = resolve_crs(&crs);
        assert_eq!((keys.projection.as_str(), keys.wkt.as_deref()), (NEBRASKA, None));
        assert!(keys.notes[0].to_string().ends_with("the keys were taken, as the header says"));
        crs.unit = Some(Unit::METRE);
        let agree = resolve_crs(&crs);
        assert_eq!((agree.wkt.as_deref(), agree.notes.len()), (Some(text), 0));
    }

    #[test]
    fn systems_of_their_own_have_a_name_and_no_projection() {
        let mut crs = Crs::default();
        crs.is_user_defined = true;
        crs.citation = Some("Plant grid".to_owned());
        let resolved = resolve_crs(&crs);
        assert_eq!((resolved.label.as_str(), resolved.projection.as_str()), ("GeoTIFF: Plant grid", ""));
        assert!(resolved.notes[0].to_string().contains("Plant grid"));
        let cut = in_wkt(r#"PROJCS["x",UNIT["metre",1],AUTHORITY["EPSG","32633"]"#);
        assert_eq!((cut.projection.is_empty(), cut.notes), (false, vec![CrsNote::CutWkt]));
        assert_eq!(in_wkt("PROJCS[\"\"]").label, "WKT without a name");
    }

    /// WKT and definition of each system of the table say the same, so none of them makes a note.
    #[test]
    fn no_system_of_the_table_contradicts_itself() {
        let (mut read, mut found) = (0, Vec::new());
        for code in 0..=u32::from(u16::MAX) {
            let Some(def) = lookup(code) else { continue };
            let crs = in_wkt(def.wkt);
            let odd = |n: &&CrsNote| matches!(n, CrsNote::Unit { .. } | CrsNote::FalseEasting { .. } | CrsNote::CutWkt);
            found.extend(crs.notes.iter().find(odd).map(|note| format!("{note:?} {} {}", def.proj4, def.wkt)));
            read += usize::from(crs.unit.is_some());
        }
        assert!(found.is_empty(), "{} of {read}: {}", found.len(), found.join("\n"));
        assert!(read > 6000, "{read}");
    }
}

//! Whether a proj4 definition that was typed can mean something: known names, numbers that are numbers.

use super::proj4::{UNITS, VIEWER_PROJECTIONS, value};

/// Parameters that are numbers: plain, as fractions, or in degrees, minutes and seconds.
const NUMBERS: [&str; 24] = [
    "lat_0",
    "lat_1",
    "lat_2",
    "lat_ts",
    "lat_b",
    "lon_0",
    "lon_1",
    "lon_2",
    "lonc",
    "x_0",
    "y_0",
    "k",
    "k_0",
    "a",
    "b",
    "R",
    "rf",
    "f",
    "es",
    "h",
    "alpha",
    "gamma",
    "to_meter",
    "vto_meter",
];

/// Zones of UTM.
const ZONES: std::ops::RangeInclusive<u8> = 1..=60;

/// Projections of PROJ that viewers do not know: definitions with them are kept, without a projection for viewers.
#[rustfmt::skip]
const OTHER_PROJECTIONS: [&str; 138] = [
    "adams_hemi", "adams_ws1", "adams_ws2", "airocean", "airy", "aitoff", "alsk", "apian", "august", "bacon",
    "bertin1953", "bipc", "boggs", "bonne", "calcofi", "cart", "cc", "ccon", "chamb", "col_urban", "collg", "comill",
    "crast", "denoy", "eck1", "eck2", "eck3", "eck4", "eck5", "eck6", "eqearth", "euler", "fahey", "fouc", "fouc_s",
    "gall", "geoc", "geos", "gins8", "gn_sinu", "goode", "gs48", "gs50", "gstmerc", "guyou", "hammer", "hatano",
    "healpix", "igh", "igh_o", "imoll", "imoll_o", "imw_p", "isea", "kav5", "kav7", "labrd", "lagrng", "larr", "lask",
    "latlon", "latlong", "lcca", "leac", "lee_os", "lonlat", "loxim", "lsat", "mbt_fps", "mbt_s", "mbtfpp", "mbtfpq",
    "mbtfps", "mil_os", "misrsom", "mod_krovak", "murd1", "murd2", "murd3", "natearth", "natearth2", "nell", "nell_h",
    "nicol", "nsper", "ob_tran", "ocea", "oea", "ortel", "patterson", "pconic", "peirce_q", "pipeline", "putp1",
    "putp2", "putp3", "putp3p", "putp4p", "putp5", "putp5p", "putp6", "putp6p", "qua_aut", "rhealpix", "rouss",
    "rpoly", "s2", "sch", "som", "spilhaus", "tcc", "tcea", "times", "tissot", "tobmerc", "topocentric", "tpeqd",
    "tpers", "ups", "urm5", "urmfps", "vandg", "vandg2", "vandg3", "vandg4", "vitk1", "wag1", "wag2", "wag3", "wag4",
    "wag5", "wag6", "wag7", "webmerc", "weren", "wink1", "wink2", "wintri",
];

/// What is wrong with a definition that begins with `+` and has a `+proj=`, if anything is.
pub(super) fn fault(proj4: &str) -> Option<String> {
    let projection = value(proj4, "proj")?;
    if !VIEWER_PROJECTIONS.contains(&projection) && !OTHER_PROJECTIONS.contains(&projection) {
        return Some(format!("has the projection {projection}, which is not known"));
    }
    let number = NUMBERS.iter().find_map(|key| Some((key, value(proj4, key).filter(|text| !is_number(text))?)));
    if let Some((key, text)) = number {
        return Some(format!("has the {key} {text}, which is no number"));
    }
    let unit = ["units", "vunits"].iter().find_map(|key| value(proj4, key));
    if let Some(unit) = unit.filter(|unit| !UNITS.iter().any(|(name, _)| name == unit)) {
        return Some(format!("has the unit {unit}, which is not known"));
    }
    match value(proj4, "zone") {
        Some(zone) if !zone.parse().is_ok_and(|zone| ZONES.contains(&zone)) => {
            Some(format!("has the zone {zone}; there are 1 to 60"))
        }
        None if projection == "utm" && value(proj4, "lon_0").is_none() => Some("has no +zone".to_owned()),
        _ => None,
    }
}

/// True for 9, -1.5e3, 1200/3937, 9d30'15"E.
fn is_number(text: &str) -> bool {
    let digits = text.trim_start_matches(['+', '-']);
    digits.trim_start_matches('.').starts_with(|c: char| c.is_ascii_digit())
        && text.chars().all(|c| c.is_ascii_digit() || "+-.eEdDrR°'\"NSWnsw/".contains(c))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_definition_of_the_table_is_sound() {
        for code in 0..=u32::from(u16::MAX) {
            if let Some(def) = super::super::resolved::lookup(code).filter(|def| def.proj4.contains("+proj=")) {
                assert_eq!(fault(def.proj4), None, "EPSG:{code}: {}", def.proj4);
            }
        }
    }

    #[test]
    fn what_means_nothing_is_named() {
        let table = [
            ("+proj=nope", "projection nope"),
            ("+proj=utm", "no +zone"),
            ("+proj=utm +zone=99", "zone 99"),
            ("+proj=utm +zone=abc", "zone abc"),
            ("+proj=tmerc +lon_0=x", "lon_0 x"),
            ("+proj=tmerc +k=", "k "),
            ("+proj=utm +zone=33 +units=parsec", "unit parsec"),
        ];
        for (text, part) in table {
            assert!(fault(text).is_some_and(|what| what.contains(part)), "{text}: {:?}", fault(text));
        }
        for text in ["+proj=labrd +lat_0=1", "+proj=utm +lon_0=9", "+proj=tmerc +lon_0=9d30'E +to_meter=1200/3937"] {
            assert_eq!(fault(text), None, "{text}");
        }
    }
}

//! proj4 definitions: their unit, and the ones that viewers take.

use pointmill_format::Unit;

use super::printable::printable;
use crate::warning::Proj4Fault;

/// What proj4js 2.6.2 can project. Of the table, `webmerc`, `eqearth` and `labrd` are not among these.
pub(super) const VIEWER_PROJECTIONS: [&str; 28] = [
    "aea", "aeqd", "cass", "cea", "eqc", "eqdc", "etmerc", "geocent", "gnom", "krovak", "laea", "lcc", "longlat",
    "merc", "mill", "moll", "nzmg", "omerc", "ortho", "poly", "qsc", "robin", "sinu", "somerc", "stere", "sterea",
    "tmerc", "utm",
];

/// The names that PROJ has for units of length. proj4js knows the first three; the others are given to it as numbers.
pub(super) const UNITS: [(&str, Unit); 21] = [
    ("m", Unit::METRE),
    ("ft", Unit::FOOT),
    ("us-ft", Unit::US_SURVEY_FOOT),
    ("km", Unit::Length(1000.0)),
    ("dm", Unit::Length(0.1)),
    ("cm", Unit::Length(0.01)),
    ("mm", Unit::Length(0.001)),
    ("in", Unit::Length(0.0254)),
    ("yd", Unit::Length(0.9144)),
    ("mi", Unit::Length(1609.344)),
    ("kmi", Unit::Length(1852.0)),
    ("fath", Unit::Length(1.8288)),
    ("ch", Unit::Length(20.1168)),
    ("link", Unit::Length(0.201168)),
    ("us-in", Unit::Length(100.0 / 3937.0)),
    ("us-yd", Unit::Length(3600.0 / 3937.0)),
    ("us-ch", Unit::Length(79_200.0 / 3937.0)),
    ("us-mi", Unit::Length(6_336_000.0 / 3937.0)),
    ("ind-ft", Unit::Length(0.304_799_510_248_147)),
    ("ind-yd", Unit::Length(0.914_398_530_744_441)),
    ("ind-ch", Unit::Length(20.116_767_5)),
];

/// The unit of x and y: degrees for `+proj=longlat`, else as `+units` or `+to_meter` say, else metres. Lengths among
/// the other parameters (`+x_0`, `+a`) are metres whatever it is.
pub(super) fn unit(proj4: &str) -> Unit {
    if matches!(value(proj4, "proj"), Some("longlat" | "latlong" | "lonlat" | "latlon")) {
        return Unit::DEGREE;
    }
    unit_of(proj4, "units", "to_meter").unwrap_or(Unit::METRE)
}

/// True if x, y and z are measured from the centre of the Earth.
pub(super) fn is_geocentric(proj4: &str) -> bool {
    matches!(value(proj4, "proj"), Some("geocent" | "cart"))
}

/// The unit of z, where it is said.
pub(super) fn vertical_unit(proj4: &str) -> Option<Unit> {
    let geocentric = || is_geocentric(proj4).then(|| unit(proj4));
    unit_of(proj4, "vunits", "vto_meter").or_else(geocentric)
}

/// As PROJ has it: a name goes before a number.
fn unit_of(proj4: &str, name: &str, size: &str) -> Option<Unit> {
    if let Some(name) = value(proj4, name) {
        return Some(UNITS.iter().find(|(of, _)| *of == name).map_or(Unit::Unknown, |(_, unit)| *unit));
    }
    let (over, under) = value(proj4, size).map(|size| size.split_once('/').unwrap_or((size, "1")))?;
    let parse = |number: &str| number.parse::<f64>().unwrap_or(f64::NAN);
    Some(Unit::length(parse(over) / parse(under)))
}

/// False easting, metres: of definitions with one, or of UTM.
pub(super) fn false_easting(proj4: &str) -> Option<f64> {
    match value(proj4, "x_0") {
        Some(text) => text.parse().ok(),
        None => (value(proj4, "proj") == Some("utm")).then_some(500_000.0),
    }
}

pub(super) fn value<'a>(proj4: &'a str, key: &str) -> Option<&'a str> {
    proj4.split_whitespace().find_map(|p| p.strip_prefix('+')?.strip_prefix(key)?.strip_prefix('='))
}

/// A definition that Potree viewers take, of coordinates in `unit`: `+proj` first, and nothing about heights or grid
/// files, which they have not.
///
/// # Errors
/// Why there is none.
pub(super) fn for_viewers(proj4: &str, unit: Unit) -> Result<String, Proj4Fault> {
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
    let is_geographic = self::unit(proj4).is_angle();
    let said = if is_geographic { (unit == Unit::DEGREE).then(String::new) } else { parameter(unit) };
    let mut said = said.ok_or(Proj4Fault::Unit(unit))?;
    let mut out = format!("+proj={projection}");
    for parameter in parameters {
        let key = parameter.split('=').next().unwrap_or_default();
        match key {
            "+proj" | "+geoidgrids" | "+vunits" | "+vto_meter" => continue,
            "+nadgrids" if parameter != "+nadgrids=@null" => continue,
            // in place, once; the first of a definition without any comes at its end
            "+units" | "+to_meter" => push(&mut out, &std::mem::take(&mut said)),
            _ => push(&mut out, parameter),
        }
    }
    if unit != Unit::METRE {
        push(&mut out, &said);
    }
    Ok(out)
}

fn push(out: &mut String, parameter: &str) {
    if !parameter.is_empty() {
        out.push(' ');
        out.push_str(parameter);
    }
}

/// `+units=us-ft`, or the size of a unit that proj4js has no name for.
fn parameter(unit: Unit) -> Option<String> {
    let name = UNITS[..3].iter().find(|(_, of)| *of == unit).map(|(name, _)| format!("+units={name}"));
    name.or_else(|| unit.metres().map(|metres| format!("+to_meter={metres}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_is_that_of_the_name_else_the_number_else_metres() {
        assert_eq!(unit("+proj=tmerc +units=us-ft +x_0=1"), Unit::US_SURVEY_FOOT);
        assert_eq!(unit("+proj=tmerc +to_meter=0.3048"), Unit::FOOT);
        assert_eq!(unit("+proj=tmerc +to_meter=1200/3937"), Unit::US_SURVEY_FOOT);
        assert_eq!(unit("+proj=tmerc +units=ft +to_meter=2"), Unit::FOOT);
        assert_eq!(unit("+proj=utm +zone=3"), Unit::METRE);
        assert_eq!(unit("+proj=utm +units=cubit"), Unit::Unknown);
        assert_eq!(unit("+proj=longlat +units=m"), Unit::DEGREE);
        assert_eq!(vertical_unit("+proj=utm +units=m +vunits=us-ft"), Some(Unit::US_SURVEY_FOOT));
        assert_eq!(vertical_unit("+proj=utm +units=m"), None);
    }

    #[test]
    fn another_unit_takes_the_place_of_the_old_one_and_lengths_stay_metres() {
        let metres = "+proj=lcc +x_0=500000 +units=m +no_defs";
        let with = |unit| for_viewers(metres, unit).unwrap();
        assert_eq!(with(Unit::METRE), metres);
        assert_eq!(with(Unit::US_SURVEY_FOOT), "+proj=lcc +x_0=500000 +units=us-ft +no_defs");
        assert_eq!(with(Unit::Length(0.5)), "+proj=lcc +x_0=500000 +to_meter=0.5 +no_defs");
        assert_eq!(for_viewers("+proj=utm +zone=1", Unit::FOOT).unwrap(), "+proj=utm +zone=1 +units=ft");
        let both = "+proj=lcc +units=us-ft +to_meter=0.3048006096012192";
        assert_eq!(for_viewers(both, Unit::US_SURVEY_FOOT).unwrap(), "+proj=lcc +units=us-ft");
    }

    #[test]
    fn names_that_viewers_do_not_know_become_numbers() {
        let link = "+proj=cass +units=link";
        assert_eq!(for_viewers(link, unit(link)).unwrap(), "+proj=cass +to_meter=0.201168");
    }

    #[test]
    fn what_a_definition_cannot_say_is_refused() {
        for (text, unit) in [
            ("+proj=longlat +datum=WGS84", Unit::from_epsg(9105)),
            ("+proj=longlat +datum=WGS84", Unit::METRE),
            ("+proj=utm +zone=1", Unit::DEGREE),
            ("+proj=utm +zone=1", Unit::Unknown),
        ] {
            assert_eq!(for_viewers(text, unit), Err(Proj4Fault::Unit(unit)), "{text}");
        }
    }
}

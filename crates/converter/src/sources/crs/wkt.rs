//! Well-known text of coordinate reference systems: which code does it carry, and which units?
//!
//! Reads WKT 1 (OGC 01-009, with the habits of GDAL and ESRI) and WKT 2 (OGC 18-010) as a flat list of elements with
//! their depth. Nothing recurses and nothing is interpreted but names, authorities and units, so any bytes are safe.

use pointmill_format::Unit;

/// Real texts have some dozens of elements; what follows after this many is not looked at.
const MAX_ELEMENTS: usize = 4096;

/// The horizontal systems of both versions.
const HORIZONTAL: [&str; 10] = [
    "PROJCS",
    "PROJCRS",
    "PROJECTEDCRS",
    "DERIVEDPROJCRS",
    "GEOGCS",
    "GEOGCRS",
    "GEOGRAPHICCRS",
    "GEODCRS",
    "GEODETICCRS",
    "GEOCCS",
];
/// Systems made of others, which have a name too.
const COMPOUND: [&str; 2] = ["COMPD_CS", "COMPOUNDCRS"];
/// Elements that only hold a system.
const HOLDERS: [&str; 2] = ["BOUNDCRS", "SOURCECRS"];
/// Systems that place nothing on the ground by themselves, but are systems.
const OTHERS: [&str; 4] = ["LOCAL_CS", "ENGCRS", "ENGINEERINGCRS", "FITTED_CS"];
const VERTICAL: [&str; 4] = ["VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS"];
const UNITS: [&str; 4] = ["UNIT", "LENGTHUNIT", "ANGLEUNIT", "ANGULARUNIT"];
/// Names of the parameter that is `+x_0` in proj4, without blanks and underscores.
const FALSE_EASTING: [&str; 3] = ["falseeasting", "eastingatfalseorigin", "eastingatprojectioncentre"];

/// `KEYWORD[value, value, …]`, without its inner elements.
struct Element<'a> {
    depth: usize,
    keyword: &'a str,
    /// The first two values that are not elements, quotes taken off.
    values: [&'a str; 2],
    value_count: usize,
}

/// What a text says about its coordinate reference system.
#[derive(Debug, Default, Clone, PartialEq)]
pub(super) struct WktSystem {
    /// Name of the outermost system (a compound's own), or of the horizontal one if that has none.
    pub(super) name: String,
    /// EPSG code of the horizontal system; of the compound around it if only that has one.
    pub(super) epsg: Option<u32>,
    /// GDAL's `EXTENSION["PROJ4", …]` of the horizontal system.
    pub(super) proj4: Option<String>,
    /// Unit of x and y, where the text says it.
    pub(super) unit: Option<Unit>,
    /// False easting, metres.
    pub(super) false_easting: Option<f64>,
    /// EPSG code of the vertical system.
    pub(super) vertical_epsg: Option<u32>,
    /// Unit of z, where the text says it.
    pub(super) vertical_unit: Option<Unit>,
    /// The horizontal system is geocentric.
    pub(super) is_geocentric: bool,
    /// Brackets and quotes are closed: the text is whole.
    pub(super) is_whole: bool,
}

/// True if the first word of `text` is the keyword of a coordinate reference system.
pub(super) fn is_wkt(text: &str) -> bool {
    let word = text.trim_start().split(['[', '(']).next().unwrap_or_default().trim_end();
    [&HORIZONTAL[..], &COMPOUND, &HOLDERS, &OTHERS, &VERTICAL].iter().any(|words| is_one_of(word, words))
}

/// True if all brackets and quotes of `text` are closed.
pub(super) fn is_whole(text: &str) -> bool {
    elements(text).is_whole
}

/// True if the name of the outermost system stands in quotes, as it must; what holds a system has none.
pub(super) fn has_quoted_name(text: &str) -> bool {
    let (keyword, inner) = text.trim_start().split_once(['[', '(']).unwrap_or((text, ""));
    is_one_of(keyword.trim_end(), &HOLDERS) || inner.trim_start().starts_with('"')
}

/// True if text follows behind the last system.
pub(super) fn is_followed(text: &str) -> bool {
    !text[elements(text).end..].trim().is_empty()
}

/// Finds name, code and units of the horizontal system; `None` if the text has no such system.
pub(super) fn read(text: &str) -> Option<WktSystem> {
    let Elements { found: elements, is_whole, .. } = elements(text);
    let mut at = 0;
    let mut compound = None;
    // Every step goes to a child, so to a higher index: the loop ends.
    while !is_one_of(elements.get(at)?.keyword, &HORIZONTAL) {
        if is_one_of(elements[at].keyword, &COMPOUND) {
            compound.get_or_insert(at);
        } else if !is_one_of(elements[at].keyword, &HOLDERS) {
            return None;
        }
        at = children(&elements, at).find(|&c| {
            let keyword = elements[c].keyword;
            is_one_of(keyword, &HORIZONTAL) || is_one_of(keyword, &COMPOUND) || is_one_of(keyword, &HOLDERS)
        })?;
    }
    let proj4 = children(&elements, at).map(|c| &elements[c]).find_map(|e| {
        let fits = e.keyword.eq_ignore_ascii_case("EXTENSION") && e.values[0].eq_ignore_ascii_case("PROJ4");
        fits.then(|| e.values[1].to_owned())
    });
    let vertical = elements.iter().position(|e| is_one_of(e.keyword, &VERTICAL));
    Some(WktSystem {
        name: elements[compound.unwrap_or(at)].values[0].replace("\"\"", "\""),
        epsg: epsg_of(&elements, at).or_else(|| epsg_of(&elements, compound?)),
        proj4,
        unit: unit_of(&elements, at, 0),
        false_easting: false_easting(&elements, at),
        vertical_epsg: vertical.and_then(|v| epsg_of(&elements, v)),
        vertical_unit: vertical.map_or_else(|| third_unit(&elements, at), |v| unit_of(&elements, v, 0)),
        is_geocentric: is_geocentric(&elements, at),
        is_whole,
    })
}

/// The unit of axis `axis` of a system: the axis' own (WKT 2), else the system's.
fn unit_of(elements: &[Element<'_>], of: usize, axis: usize) -> Option<Unit> {
    let axis = children(elements, of).filter(|&c| elements[c].keyword.eq_ignore_ascii_case("AXIS")).nth(axis);
    let is_angular = is_one_of(elements[of].keyword, &["GEOGCS", "GEOGCRS", "GEOGRAPHICCRS"]);
    axis.and_then(|axis| own_unit(elements, axis, is_angular)).or_else(|| own_unit(elements, of, is_angular))
}

/// The unit of heights of a system with three axes.
fn third_unit(elements: &[Element<'_>], of: usize) -> Option<Unit> {
    let axes = children(elements, of).filter(|&c| elements[c].keyword.eq_ignore_ascii_case("AXIS")).count();
    if axes < 3 { None } else { unit_of(elements, of, 2).filter(|unit| !unit.is_angle()) }
}

/// The unit that is a direct child of element `of`. `is_angular`: what `UNIT` alone means there.
fn own_unit(elements: &[Element<'_>], of: usize, is_angular: bool) -> Option<Unit> {
    let unit = children(elements, of).map(|c| &elements[c]).find(|e| is_one_of(e.keyword, &UNITS))?;
    let size = unit.values[1].parse().unwrap_or(f64::NAN);
    let is_angle = match unit.keyword {
        keyword if keyword.eq_ignore_ascii_case("UNIT") => is_angular,
        keyword => !keyword.eq_ignore_ascii_case("LENGTHUNIT"),
    };
    Some(if is_angle { Unit::angle(size) } else { Unit::length(size) })
}

/// The parameter's own unit (WKT 2) goes before that of the system. WKT 2 has parameters in its `CONVERSION`.
fn false_easting(elements: &[Element<'_>], of: usize) -> Option<f64> {
    let conversion = children(elements, of).find(|&c| elements[c].keyword.eq_ignore_ascii_case("CONVERSION"));
    let parameter = children(elements, conversion.unwrap_or(of)).find(|&c| {
        let name = elements[c].values[0].chars().filter(|c| !"_ ".contains(*c)).collect::<String>();
        elements[c].keyword.eq_ignore_ascii_case("PARAMETER") && is_one_of(&name, &FALSE_EASTING)
    })?;
    let unit = own_unit(elements, parameter, false).or_else(|| unit_of(elements, of, 0))?;
    Some(elements[parameter].values[1].parse::<f64>().ok()? * unit.metres()?)
}

/// The code in the element's own `AUTHORITY["EPSG", n]` or `ID["EPSG", n]`, not in those of its datum or units.
fn epsg_of(elements: &[Element<'_>], of: usize) -> Option<u32> {
    children(elements, of).map(|c| &elements[c]).find_map(|e| {
        let fits = is_one_of(e.keyword, &["AUTHORITY", "ID"]) && e.values[0].eq_ignore_ascii_case("EPSG");
        if fits { e.values[1].parse().ok() } else { None }
    })
}

/// Indices of the direct children of element `of`.
fn children<'e>(elements: &'e [Element<'_>], of: usize) -> impl Iterator<Item = usize> + 'e {
    let depth = elements[of].depth;
    (of + 1..elements.len())
        .take_while(move |&i| elements[i].depth > depth)
        .filter(move |&i| elements[i].depth == depth + 1)
}

/// True of `GEOCCS`, and of a geodetic system of WKT 2 with Cartesian axes.
fn is_geocentric(elements: &[Element<'_>], of: usize) -> bool {
    let is_cartesian =
        |e: &Element<'_>| e.keyword.eq_ignore_ascii_case("CS") && e.values[0].trim().eq_ignore_ascii_case("Cartesian");
    match elements[of].keyword {
        keyword if is_one_of(keyword, &["GEOCCS"]) => true,
        keyword => {
            is_one_of(keyword, &["GEODCRS", "GEODETICCRS"])
                && children(elements, of).any(|c| is_cartesian(&elements[c]))
        }
    }
}

fn is_one_of(keyword: &str, words: &[&str]) -> bool {
    words.iter().any(|w| w.eq_ignore_ascii_case(keyword))
}

/// The elements in order of appearance.
struct Elements<'a> {
    found: Vec<Element<'a>>,
    /// All that were opened are closed.
    is_whole: bool,
    /// The first byte behind them.
    end: usize,
}

/// Ends where the first element is closed and no other follows behind a comma (as ESRI puts the vertical system), or
/// where the text stops making sense.
fn elements(text: &str) -> Elements<'_> {
    let bytes = text.as_bytes();
    let mut found: Vec<Element<'_>> = Vec::new();
    let mut open: Vec<usize> = Vec::new();
    let mut is_whole = false;
    let mut word = ""; // the last word or string that no delimiter has followed yet
    let mut i = 0;
    while let Some(&byte) = bytes.get(i) {
        match byte {
            b'[' | b'(' => {
                if found.len() == MAX_ELEMENTS {
                    break;
                }
                open.push(found.len());
                found.push(Element { depth: open.len() - 1, keyword: word, values: [""; 2], value_count: 0 });
                word = "";
            }
            b',' if open.is_empty() && !found.is_empty() => word = "",
            b',' | b']' | b')' => {
                let Some(&top) = open.last() else { break };
                let element = &mut found[top];
                if let (false, Some(value)) = (word.is_empty(), element.values.get_mut(element.value_count)) {
                    *value = word;
                    element.value_count += 1;
                }
                word = "";
                if byte != b',' {
                    open.pop();
                    if open.is_empty() && !text[i + 1..].trim_start().starts_with(',') {
                        is_whole = true;
                        i += 1;
                        break;
                    }
                }
            }
            b'"' => {
                let Some(len) = string_len(&bytes[i + 1..]) else { break };
                word = &text[i + 1..i + 1 + len];
                i += len + 1;
            }
            _ if byte.is_ascii_whitespace() => {}
            _ => {
                let ends = |b: &u8| b.is_ascii_whitespace() || b"[](),\"".contains(b);
                let len = bytes[i..].iter().position(ends).unwrap_or(bytes.len() - i);
                word = &text[i..i + len];
                i += len - 1;
            }
        }
        i += 1;
    }
    Elements { found, is_whole, end: i.min(bytes.len()) }
}

/// Bytes before the closing quote; a doubled quote stands for one and closes nothing.
fn string_len(bytes: &[u8]) -> Option<usize> {
    let mut i = 0;
    loop {
        i += bytes.get(i..)?.iter().position(|&b| b == b'"')?;
        if bytes.get(i + 1) != Some(&b'"') {
            return Some(i);
        }
        i += 2;
    }
}

/// A system of a code of EPSG with another one for heights, in `unit`, as WKT 1. Nothing but their codes says which these are.
pub(super) fn compound(horizontal: &str, vertical: u32, unit: Unit) -> Option<String> {
    // what is compound itself, three-dimensional or geocentric cannot be a part of one
    let is_flat = ["PROJCS[", "GEOGCS["].iter().any(|keyword| horizontal.trim_start().starts_with(keyword));
    let name = parse_name(horizontal).filter(|_| is_flat)?;
    let Unit::Length(metres) = unit else { return None };
    let authority = unit.epsg().map_or_else(String::new, |code| format!(",AUTHORITY[\"EPSG\",\"{code}\"]"));
    Some(format!(
        "COMPD_CS[\"{name} + EPSG:{vertical}\",{horizontal},VERT_CS[\"EPSG:{vertical}\",VERT_DATUM[\"datum of \
         EPSG:{vertical}\",2005],UNIT[\"{unit}\",{metres}{authority}],AXIS[\"Up\",UP],AUTHORITY[\"EPSG\",\"{vertical}\"]]]"
    ))
}

/// The name of the outermost system.
fn parse_name(text: &str) -> Option<String> {
    Some(read(text)?.name)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GEOGCS: &str = r#"GEOGCS["NAD83",DATUM["North_American_Datum_1983",SPHEROID["GRS 1980",6378137,298.257222101,AUTHORITY["EPSG","7019"]],AUTHORITY["EPSG","6269"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4269"]]"#;

    fn code(text: &str) -> Option<u32> {
        read(text).and_then(|s| s.epsg)
    }

    #[test]
    fn the_code_is_the_horizontal_systems_own_and_not_that_of_a_part_of_it() {
        assert_eq!(code(GEOGCS), Some(4269));
        let parts = format!(r#"PROJCS["x",{GEOGCS},UNIT["metre",1,AUTHORITY["EPSG","9001"]]"#);
        assert_eq!(code(&format!(r#"{parts},AUTHORITY["EPSG","26915"]]"#)), Some(26915));
        assert_eq!(code(&format!("{parts}]")), None);
        assert_eq!(code(&format!(r#"{parts},AUTHORITY["ESRI","102970"]]"#)), None);
        // Some writers put the vertical system inside, after the code.
        let inside = format!(r#"{parts},AUTHORITY["EPSG","2903"],VERTCS["h",AUTHORITY["EPSG","5703"]]]"#);
        assert_eq!(code(&inside), Some(2903));
    }

    #[test]
    fn a_compound_gives_its_horizontal_part_and_its_own_name() {
        let text = format!(
            r#"COMPD_CS["a + b",PROJCS["a",{GEOGCS},AUTHORITY["EPSG","2991"]],VERT_CS["b",AUTHORITY["EPSG","6360"]],AUTHORITY["EPSG","9999"]]"#
        );
        let system = read(&text).unwrap();
        assert_eq!((system.name.as_str(), system.epsg, system.vertical_epsg), ("a + b", Some(2991), Some(6360)));
        let only_outside = r#"COMPOUNDCRS["NAD83(2011) + NAVD88 height",GEOGCRS["NAD83(2011)",DATUM["d",ELLIPSOID["GRS 1980",6378137,298.257222101,LENGTHUNIT["metre",1]]]],VERTCRS["NAVD88 height",ID["EPSG",5703]],ID["EPSG",6349]]"#;
        assert_eq!(code(only_outside), Some(6349));
    }

    #[test]
    fn wkt_2_bound_systems_round_brackets_and_odd_case_are_read() {
        let inner =
            r#"ProjCRS["ETRS89 / UTM zone 32N", BASEGEOGCRS["ETRS89",ID["EPSG",4258]], ID["EPSG" , 25832, "10.1"]]"#;
        assert_eq!(code(inner), Some(25832));
        let bound = format!(r#"BOUNDCRS[SOURCECRS[{inner}],TARGETCRS[GEOGCRS["WGS 84",ID["EPSG",4326]]]]"#);
        assert_eq!(read(&bound).unwrap().name, "ETRS89 / UTM zone 32N");
        assert_eq!(code(&bound), Some(25832));
        assert_eq!(code(r#"GEOGCS("WGS 84",AUTHORITY("EPSG","4326"))"#), Some(4326));
        // No code there is one of a system that stands on its own.
        assert_eq!(code(r#"TARGETCRS[GEOGCRS["WGS 84",ID["EPSG",4326]]]"#), None);
        assert_eq!(code(r#"VERT_CS["h",AUTHORITY["EPSG","5703"]]"#), None);
    }

    /// Units of x and y, and of z.
    fn units(text: &str) -> (Option<Unit>, Option<Unit>) {
        let system = read(text).unwrap();
        (system.unit, system.vertical_unit)
    }

    #[test]
    fn units_are_those_of_the_systems_and_not_of_their_parts() {
        assert_eq!(units(GEOGCS), (Some(Unit::DEGREE), None));
        let feet = format!(r#"PROJCS["x",{GEOGCS},UNIT["Foot_US",0.3048006096012192]]"#);
        assert_eq!(units(&feet), (Some(Unit::US_SURVEY_FOOT), None));
        assert_eq!(units(&format!(r#"PROJCS["x",{GEOGCS}]"#)), (None, None));
        let compound = format!(r#"COMPD_CS["c",{feet},VERT_CS["h",VERT_DATUM["d",2005],UNIT["metre",1]]]"#);
        assert_eq!(units(&compound), (Some(Unit::US_SURVEY_FOOT), Some(Unit::METRE)));
        // ESRI puts the vertical system behind the other
        let behind = format!(r#"{feet}, VERTCS["h",VDATUM["d"],UNIT["Foot",0.3048]]"#);
        assert_eq!(units(&behind), (Some(Unit::US_SURVEY_FOOT), Some(Unit::FOOT)));
        assert_eq!(units(r#"PROJCS["x",UNIT["none",0]]"#), (Some(Unit::Unknown), None));
    }

    #[test]
    fn wkt_2_has_units_at_the_axes_or_behind_them() {
        let axis = |unit: &str, order: u8| format!(r#"AXIS["a",east,ORDER[{order}],{unit}]"#);
        let (us, metre, degree) = (
            r#"LENGTHUNIT["US survey foot",0.304800609601219]"#,
            r#"LENGTHUNIT["metre",1]"#,
            r#"ANGLEUNIT["degree",0.0174532925199433]"#,
        );
        let base = format!(r#"BASEGEOGCRS["g",DATUM["d",ELLIPSOID["e",6378137,298,{metre}]],PRIMEM["p",0,{degree}]]"#);
        let conversion = format!(r#"CONVERSION["c",PARAMETER["False easting",1640416.667,{us}]]"#);
        let projected = format!(r#"PROJCRS["x",{base},{conversion},CS[Cartesian,2],{},{}]"#, axis(us, 1), axis(us, 2));
        assert_eq!(units(&projected), (Some(Unit::US_SURVEY_FOOT), None));
        assert!((read(&projected).unwrap().false_easting.unwrap() - 500_000.0).abs() < 1e-3);
        let shared = format!(r#"PROJCRS["x",{base},CS[Cartesian,2],AXIS["e",east],AXIS["n",north],{us}]"#);
        assert_eq!(units(&shared), (Some(Unit::US_SURVEY_FOOT), None));
        let three = format!(r#"GEOGCRS["x",CS[ellipsoidal,3],{0},{0},{1}]"#, axis(degree, 1), axis(us, 3));
        assert_eq!(units(&three), (Some(Unit::DEGREE), Some(Unit::US_SURVEY_FOOT)));
        let vertical = format!(r#"COMPOUNDCRS["c",{projected},VERTCRS["h",CS[vertical,1],AXIS["H",up],{metre}]]"#);
        assert_eq!(units(&vertical), (Some(Unit::US_SURVEY_FOOT), Some(Unit::METRE)));
    }

    #[test]
    fn a_text_is_whole_when_all_is_closed() {
        for whole in [GEOGCS, "PROJCS[\"a\"]", "PROJCS[\"a\"] , VERTCS[\"b\"]", "PROJCS(\"a]\")"] {
            assert!(is_whole(whole), "{whole}");
        }
        for cut in ["PROJCS[\"x\"", "PROJCS[\"x", "PROJCS[", "PROJCS", "", "PROJCS[\"a\"],VERTCS[\"b\""] {
            assert!(!is_whole(cut), "{cut}");
        }
        // a number that is cut is none
        assert_eq!(read("PROJCS[\"x\",UNIT[\"f\",0.30").unwrap().unit, Some(Unit::Unknown));
    }

    #[test]
    fn quotes_and_brackets_inside_strings_are_text() {
        let text = r#"PROJCS["a ""b"" ],AUTHORITY[""EPSG"",""1""]",AUTHORITY["EPSG","32633"]]"#;
        let system = read(text).unwrap();
        assert_eq!((system.epsg, system.name.starts_with("a \"b\" ],")), (Some(32633), true));
    }

    #[test]
    fn hostile_text_is_survived() {
        let deep = "PROJCS[".repeat(2_000_000);
        assert_eq!(code(&deep), None);
        for text in [
            "",
            "[",
            "]]]",
            "\"",
            "PROJCS",
            "PROJCS[\"",
            "PROJCS[\"a\"\"",
            "é[é\"é",
            ",,,(((",
            "COMPD_CS[]",
            "BOUNDCRS[BOUNDCRS[",
        ] {
            assert_eq!(code(text), None, "{text}");
        }
        let whole = format!(r#"COMPD_CS["ö",PROJCS["é",{GEOGCS},AUTHORITY["EPSG","2991"]]]"#);
        for end in (0..whole.len()).filter(|&i| whole.is_char_boundary(i)) {
            assert!([None, Some(2991)].contains(&code(&whole[..end])), "cut at {end}");
        }
    }
}

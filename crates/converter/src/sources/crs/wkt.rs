//! Well-known text of coordinate reference systems: which code does it carry?
//!
//! Reads WKT 1 (OGC 01-009, with the habits of GDAL and ESRI) and WKT 2 (OGC 18-010) as a flat list of elements with
//! their depth. Nothing recurses and nothing is interpreted but names and authorities, so any bytes are safe.

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
/// Systems made of others, with a name of their own.
const COMPOUND: [&str; 2] = ["COMPD_CS", "COMPOUNDCRS"];
/// Elements that only hold a system.
const HOLDERS: [&str; 2] = ["BOUNDCRS", "SOURCECRS"];
/// Systems that place nothing on the ground by themselves, but are systems.
const OTHERS: [&str; 7] = ["LOCAL_CS", "ENGCRS", "ENGINEERINGCRS", "FITTED_CS", "VERT_CS", "VERTCRS", "VERTICALCRS"];

/// `KEYWORD[value, value, …]`, without its inner elements.
struct Element<'a> {
    depth: usize,
    keyword: &'a str,
    /// The first two values that are not elements, quotes taken off.
    values: [&'a str; 2],
    value_count: usize,
}

/// What a text says about its coordinate reference system.
#[derive(Debug, Default, PartialEq)]
pub(super) struct WktSystem {
    /// Name of the outermost system (a compound's own), or of the horizontal one if that has none.
    pub(super) name: String,
    /// EPSG code of the horizontal system; of the compound around it if only that has one.
    pub(super) epsg: Option<u32>,
    /// GDAL's `EXTENSION["PROJ4", …]` of the horizontal system.
    pub(super) proj4: Option<String>,
}

/// True if the first word of `text` is the keyword of a coordinate reference system.
pub(super) fn is_wkt(text: &str) -> bool {
    let word = text.trim_start().split(['[', '(']).next().unwrap_or_default().trim_end();
    is_one_of(word, &HORIZONTAL) || is_one_of(word, &COMPOUND) || is_one_of(word, &HOLDERS) || is_one_of(word, &OTHERS)
}

/// Finds name and code of the horizontal system; `None` if the text has no such system.
pub(super) fn read(text: &str) -> Option<WktSystem> {
    let elements = elements(text);
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
    Some(WktSystem {
        name: elements[compound.unwrap_or(at)].values[0].replace("\"\"", "\""),
        epsg: epsg_of(&elements, at).or_else(|| epsg_of(&elements, compound?)),
        proj4,
    })
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

fn is_one_of(keyword: &str, words: &[&str]) -> bool {
    words.iter().any(|w| w.eq_ignore_ascii_case(keyword))
}

/// The elements in order of appearance. Ends where the first one is closed, or where the text stops making sense.
fn elements(text: &str) -> Vec<Element<'_>> {
    let bytes = text.as_bytes();
    let mut found: Vec<Element<'_>> = Vec::new();
    let mut open: Vec<usize> = Vec::new();
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
                    if open.is_empty() {
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
    found
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
        assert_eq!(read(&text).unwrap(), WktSystem { name: "a + b".into(), epsg: Some(2991), proj4: None });
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

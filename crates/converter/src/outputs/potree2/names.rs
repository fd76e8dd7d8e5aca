//! Names that viewers stumble over, and those that the attributes get instead (docs/formats/potree2.md, "Names").

use std::collections::{HashMap, HashSet};

use pointmill_format::Attribute;

use crate::warning::{NameFault, RenamedAttribute};

/// What every object of JavaScript has: viewers look names up in objects, find these, and load no node at all.
const JAVASCRIPT: [&str; 12] = [
    "__defineGetter__",
    "__defineSetter__",
    "__lookupGetter__",
    "__lookupSetter__",
    "__proto__",
    "constructor",
    "hasOwnProperty",
    "isPrototypeOf",
    "propertyIsEnumerable",
    "toLocaleString",
    "toString",
    "valueOf",
];

/// What viewers keep vertex data of their own under, or decode as positions or colours.
const VIEWERS: [&str; 21] = [
    "COLOR_PACKED",
    "INDICES",
    "NORMAL",
    "NORMAL_OCT16",
    "NORMAL_SPHEREMAPPED",
    "POSITION_CARTESIAN",
    "RGBA",
    "aExtra",
    "color",
    "indices",
    "mileage",
    "normal",
    "numberOfReturns",
    "pointSourceID",
    "returnNumber",
    "returns",
    "rgba",
    "scanAngle",
    "source id",
    "spacing",
    "unique_id",
];

/// What BA_PointCloud decodes as positions or colours, in letters of any size.
const ANY_SIZE: [&str; 5] = ["color_packed", "position", "position_cartesian", "rgb", "rgba"];

/// iTowns makes shader definitions of names that begin with this, whatever follows.
const NORMAL: &str = "NORMAL";

/// Colourings of Potree's shader, which knows them by letters and digits alone.
const COLOURINGS: [&str; 15] = [
    "composite",
    "depth",
    "elevation",
    "gps_time",
    "height",
    "intensity_gradient",
    "level_of_detail",
    "matcap",
    "number_of_returns",
    "phong",
    "point_source_id",
    "return_number",
    "rgb_and_elevation",
    "rgb_height",
    "source_id",
];

/// The attributes that viewers mean.
const MEANT: [&str; 5] = ["gps-time", "number of returns", "point source id", "return number", "rgb"];

/// The names of the attributes of a dataset beside the position.
#[derive(Debug, Default)]
pub(in crate::outputs) struct Names {
    /// In order.
    pub(in crate::outputs) stored: Vec<String>,
    pub(in crate::outputs) renamed: Vec<RenamedAttribute>,
}

impl Names {
    /// `attributes`: in order, of different names. An underscore behind a name makes it another, and a number if that is
    /// taken.
    pub(in crate::outputs) fn of(attributes: &[&Attribute]) -> Self {
        let mut names = Self::default();
        let mut taken: HashSet<String> = attributes.iter().map(|a| a.name.clone()).collect();
        // where the numbers of a name go on: there may be very many names
        let mut tried: HashMap<String, u64> = HashMap::new();
        for attribute in attributes {
            let name = &attribute.name;
            let Some(why) = fault(name) else {
                names.stored.push(name.clone());
                continue;
            };
            let stem = if why == NameFault::Text { shown(name) } else { base(name) };
            let tried = tried.entry(stem.clone()).or_default();
            let stored_as = loop {
                *tried += 1;
                let new = match *tried {
                    1 if why == NameFault::Text => stem.clone(),
                    1 => format!("{stem}_"),
                    n => format!("{stem}_{n}"),
                };
                if fault(&new).is_none() && taken.insert(new.clone()) {
                    break new;
                }
            };
            names.stored.push(stored_as.clone());
            names.renamed.push(RenamedAttribute::new(name.clone(), stored_as, why));
        }
        names
    }
}

fn fault(name: &str) -> Option<NameFault> {
    if MEANT.contains(&name) {
        None
    } else if JAVASCRIPT.contains(&name) {
        Some(NameFault::JavaScript)
    } else if name != shown(name) {
        Some(NameFault::Text)
    } else if VIEWERS.contains(&name)
        || ANY_SIZE.contains(&&*name.to_ascii_lowercase())
        || name.starts_with(NORMAL) && name != letters(name)
    {
        Some(NameFault::Viewers)
    } else {
        COLOURINGS.contains(&&*letters(name)).then_some(NameFault::Colouring)
    }
}

fn base(name: &str) -> String {
    if name.starts_with(NORMAL) { letters(name) } else { name.to_owned() }
}

/// As shaders know a name.
fn letters(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

/// The name as it comes back from a list in a page: markup is not text there, and blanks are one.
fn shown(name: &str) -> String {
    let plain = |c: char| match c {
        '<' | '>' | '&' => '_',
        c if c.is_control() && !c.is_whitespace() => '_',
        c => c,
    };
    let text: String = name.chars().map(plain).collect();
    let words: Vec<&str> = text.split_whitespace().collect();
    if words.is_empty() { "unnamed".to_owned() } else { words.join(" ") }
}

#[cfg(test)]
mod tests {
    use pointmill_format::AttributeType;

    use super::*;

    fn stored(names: &[&str]) -> Vec<String> {
        let attributes: Vec<Attribute> = names.iter().map(|n| Attribute::new(*n, AttributeType::UInt8, 1)).collect();
        Names::of(&attributes.iter().collect::<Vec<_>>()).stored
    }

    #[test]
    fn what_viewers_mean_and_what_they_do_not_know_keeps_its_name() {
        let names = [
            "rgb",
            "intensity",
            "return number",
            "number of returns",
            "classification",
            "gps-time",
            "scan angle",
            "point source id",
            "NormalX",
            "NormalY",
            "NormalZ",
            "nir",
            "h (2)",
            "Höhe über Grund",
            "Returns",
            "timestamp",
        ];
        assert_eq!(stored(&names), names);
    }

    #[test]
    fn names_that_viewers_have_another_use_for_get_an_underscore() {
        let names = ["constructor", "__proto__", "color", "Position", "RGB", "gps time", "return_number", "height"];
        let expected =
            ["constructor_", "__proto___", "color_", "Position_", "RGB_", "gps time_", "return_number_", "height_"];
        assert_eq!(stored(&names), expected);
        assert_eq!(stored(&["NORMAL", "NORMAL x", "NORMALS"]), ["NORMAL_", "NORMAL_x_", "NORMALS"]);
    }

    #[test]
    fn names_stay_apart() {
        assert_eq!(stored(&["color", "color_", "color__"]), ["color_2", "color_", "color__"]);
        assert_eq!(stored(&["a<b", "a>b", "a_b", ""]), ["a_b_2", "a_b_3", "a_b", "unnamed"]);
        assert_eq!(stored(&["unnamed", "", " x\u{7}  y "]), ["unnamed", "unnamed_2", "x_ y"]);
        assert_eq!(stored(&[" constructor", "constructor"]), ["constructor_2", "constructor_3"]);
    }
}

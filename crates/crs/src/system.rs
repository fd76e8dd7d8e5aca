//! A coordinate reference system, as far as units, heights and projections need it.

use std::fmt;

use pointmill_format::{Crs, Unit};
use proj_core::{AxisOrder, CrsDef, VerticalCrsDef, VerticalCrsKind};
use proj_wkt::parse_crs;

/// Longest text of a definition that is quoted in a message, characters.
const MAX_QUOTED: usize = 60;

/// What the parser puts before a reason.
const PREFIXES: [&str; 3] = ["failed to parse CRS string: ", "unsupported CRS semantics: ", "unknown CRS: "];

/// EPSG codes of all geographic systems whose prime meridian is not Greenwich.
const OTHER_MERIDIANS: [std::ops::RangeInclusive<u32>; 4] = [4801..=4821, 4901..=4904, 5229..=5229, 8042..=8043];

/// Why a text is no coordinate reference system that can be used.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum CrsError {
    /// It is not `EPSG:n`, a `+proj=…` definition or WKT.
    NotACrs(String),
    /// It is one, but has a projection, unit, prime meridian or meaning that is not supported, or an unknown code.
    Unsupported {
        /// The definition, shortened.
        definition: String,
        /// Why, in the words of the parser.
        why: String,
    },
}

impl fmt::Display for CrsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotACrs(text) => write!(f, "\"{text}\" is not EPSG:n, a +proj=… definition or WKT"),
            Self::Unsupported { definition, why } => write!(f, "{definition} cannot be used to reproject: {why}"),
        }
    }
}

impl std::error::Error for CrsError {}

/// What heights are above.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum HeightReference {
    /// Not said.
    Unknown,
    /// The ellipsoid.
    Ellipsoid,
    /// A vertical datum, by its EPSG code: near the sea level.
    Datum(u32),
}

/// A system that was understood.
#[derive(Debug, Clone)]
pub(crate) struct System {
    /// What [`parse_crs`] takes.
    pub(crate) definition: String,
    def: CrsDef,
    /// Unit of x and y that a file declares beside the definition, and of z; metres.
    unit: Option<f64>,
    vertical_unit: Option<f64>,
}

impl System {
    /// True for `EPSG:n` or `EPSG:n+m` with a number that the tables here do not know.
    pub(crate) fn is_unknown_code(text: &str) -> bool {
        let text = text.trim();
        let is_code = text.get(..5).is_some_and(|p| p.eq_ignore_ascii_case("EPSG:")) && is_definition(text);
        is_code && parse_crs(text).is_err_and(|error| error.to_string().contains("unknown EPSG"))
    }

    /// The system of that text: `EPSG:n`, `EPSG:n+m`, a proj4 definition, or WKT.
    pub(crate) fn parse(text: &str) -> Result<Self, CrsError> {
        let text = text.trim();
        if !is_definition(text) {
            return Err(CrsError::NotACrs(quoted(text)));
        }
        let (def, definition) = match parse_crs(text) {
            Ok(def) => (def, text.to_owned()),
            // a projection whose name in WKT is not known may be known by its code
            Err(error) => match code_at_the_end(text).filter(|_| !error.to_string().contains("does not match")) {
                Some(code) => (parse_crs(&code).map_err(|e| unsupported(text, &e))?, code),
                None => return Err(unsupported(text, &error)),
            },
        };
        Ok(Self { definition, def, unit: None, vertical_unit: None })
    }

    /// The system that a scan declares; `None` if it declares none.
    pub(crate) fn of_scan(crs: &Crs) -> Result<Option<Self>, CrsError> {
        let wkt = crs.wkt.as_deref().filter(|wkt| !wkt.trim().is_empty());
        let system = match (wkt, by_keys(crs)) {
            // what cannot be used of one record may be usable of the other: both are of this file
            (Some(wkt), Some(keys)) if crs.keys_first => keys.or_else(|error| Self::parse(wkt).map_err(|_| error)),
            (Some(wkt), Some(keys)) => Self::parse(wkt).or_else(|error| keys.map_err(|_| error)),
            (Some(wkt), None) => Self::parse(wkt),
            (None, Some(keys)) => keys,
            (None, None) => match crs.proj4.as_deref() {
                Some(definition) => Self::parse(definition),
                None => return Ok(None),
            },
        };
        system.map(Some)
    }

    /// With the units that a file declares beside its code.
    fn with_units(mut self, unit: Option<Unit>, vertical: Option<Unit>) -> Result<Self, CrsError> {
        let name = self.name();
        let refuse = |what: &str, unit: Unit| {
            Err(CrsError::Unsupported {
                definition: name.clone(),
                why: format!("the unit of {what} is declared as {unit}"),
            })
        };
        match unit {
            Some(Unit::Length(metres)) if self.defined_unit().is_some() => self.unit = Some(metres),
            Some(Unit::DEGREE) if self.defined_unit().is_none() => {}
            Some(other) => return refuse("x and y", other),
            None => {}
        }
        match vertical {
            Some(Unit::Length(metres)) => self.vertical_unit = Some(metres),
            Some(other) => return refuse("heights", other),
            None => {}
        }
        Ok(self)
    }

    /// The name, for people.
    pub(crate) fn name(&self) -> String {
        match (self.def.epsg(), self.def.name()) {
            (0, "") => quoted(&self.definition),
            (0, name) => name.to_owned(),
            (code, _) => format!("EPSG:{code}"),
        }
    }

    /// Metres of the unit of x and y; `None`: degrees.
    pub(crate) fn unit(&self) -> Option<f64> {
        self.unit.or_else(|| self.defined_unit())
    }

    /// Metres of the unit that the definition gives x and y, whatever the file declares beside it; `None`: degrees.
    pub(crate) fn defined_unit(&self) -> Option<f64> {
        match &self.def {
            CrsDef::Geocentric(_) => Some(1.0),
            def => def.as_projected().map(|projected| projected.linear_unit_to_meter()),
        }
    }

    /// Metres of the unit of heights, if it is declared.
    pub(crate) fn height_unit(&self) -> Option<f64> {
        let geocentric = self.def.is_geocentric().then_some(1.0);
        let defined = self.def.vertical_crs().map(VerticalCrsDef::linear_unit_to_meter);
        geocentric.or(self.vertical_unit).or(defined)
    }

    /// What heights are above.
    pub(crate) fn heights(&self) -> HeightReference {
        match self.def.vertical_crs().map(VerticalCrsDef::kind) {
            Some(VerticalCrsKind::EllipsoidalHeight { .. }) => HeightReference::Ellipsoid,
            Some(VerticalCrsKind::GravityRelatedHeight { vertical_datum_epsg }) => {
                HeightReference::Datum(*vertical_datum_epsg)
            }
            None if self.def.is_geocentric() => HeightReference::Ellipsoid,
            None => HeightReference::Unknown,
        }
    }

    /// True for x, y, z from the centre of the earth.
    pub(crate) fn is_geocentric(&self) -> bool {
        self.def.is_geocentric()
    }

    /// The definition puts north before east. Scans never do: their x is the east.
    pub(crate) fn is_north_first(&self) -> bool {
        self.def.axis_order() == Some(AxisOrder::NorthEast)
    }

    /// Its longitudes do not count from Greenwich; some such systems have grads, too. The library takes them as if they
    /// did (measured: 2.3° off for EPSG:4807), so that these are refused.
    pub(crate) fn has_other_meridian(&self) -> bool {
        let is_one = |code: u32| OTHER_MERIDIANS.iter().any(|codes| codes.contains(&code));
        self.def.base_geographic_crs_epsg().is_some_and(is_one)
    }

    /// EPSG code of the datum, 0 if it has none.
    pub(crate) fn datum(&self) -> u32 {
        self.def.datum().epsg()
    }
}

/// What GeoTIFF keys declare: codes, and units beside them.
fn by_keys(crs: &Crs) -> Option<Result<System, CrsError>> {
    if crs.is_user_defined {
        let definition = crs.citation.as_deref().map_or_else(|| "the system of its GeoTIFF keys".to_owned(), quoted);
        return Some(Err(CrsError::Unsupported { definition, why: "it has no EPSG code".to_owned() }));
    }
    let horizontal = crs.epsg?;
    let pair = crs.vertical_epsg.map(|vertical| format!("EPSG:{horizontal}+{vertical}"));
    let code = pair.filter(|pair| parse_crs(pair).is_ok()).unwrap_or_else(|| format!("EPSG:{horizontal}"));
    Some(System::parse(&code).and_then(|system| system.with_units(crs.unit, crs.vertical_unit)))
}

fn unsupported(text: &str, error: &proj_wkt::ParseError) -> CrsError {
    let why = error.to_string();
    let bare = PREFIXES.iter().fold(why.as_str(), |why, prefix| why.strip_prefix(prefix).unwrap_or(why));
    CrsError::Unsupported { definition: quoted(text), why: one_line(bare) }
}

fn is_definition(text: &str) -> bool {
    let prefix = text.get(..5).is_some_and(|p| p.eq_ignore_ascii_case("EPSG:"));
    let is_wkt = || {
        let keyword = text.split(['[', '(']).next().unwrap_or_default().trim();
        text.contains(['[', '('])
            && !keyword.is_empty()
            && keyword.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    };
    let is_proj4 = || text.starts_with('+') && (text.contains("+proj=") || text.contains("+init="));
    let number = |code: &str| code.parse::<u32>().is_ok();
    if prefix { text[5..].splitn(2, '+').all(number) } else { is_proj4() || is_wkt() }
}

/// The EPSG code that stands at the end of a WKT, which is that of the whole: "EPSG:25832".
fn code_at_the_end(wkt: &str) -> Option<String> {
    let compact: String = wkt.chars().filter(|c| !c.is_whitespace()).collect::<String>().to_ascii_uppercase();
    let (_, tail) = compact.rsplit_once("[\"EPSG\",")?;
    let code = tail.strip_suffix("]]")?.trim_matches('"');
    code.parse::<u32>().ok().map(|code| format!("EPSG:{code}"))
}

/// The parser quotes what it was given.
fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

fn quoted(text: &str) -> String {
    let mut short: String = one_line(text).chars().take(MAX_QUOTED).collect();
    if text.chars().count() > MAX_QUOTED {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definitions_of_every_form_are_understood_with_their_units() {
        let utm = System::parse("EPSG:25832").unwrap();
        assert_eq!((utm.unit(), utm.height_unit(), utm.heights()), (Some(1.0), None, HeightReference::Unknown));
        assert_eq!(System::parse("EPSG:2994").unwrap().unit(), Some(0.3048));
        assert_eq!(System::parse("epsg:4326").unwrap().unit(), None);
        let heights = System::parse("EPSG:25832+5783").unwrap();
        assert_eq!((heights.height_unit(), heights.heights()), (Some(1.0), HeightReference::Datum(5181)));
        assert_eq!(System::parse("EPSG:4979").unwrap().heights(), HeightReference::Ellipsoid);
        let proj4 = System::parse("+proj=utm +zone=10 +datum=WGS84 +units=us-ft +no_defs").unwrap();
        assert!((proj4.unit().unwrap() - 1200.0 / 3937.0).abs() < 1e-12);
        assert!(System::parse("EPSG:4978").unwrap().is_geocentric());
    }

    #[test]
    fn what_is_no_definition_is_told_from_what_is_not_supported() {
        for text in ["", "25832", "EPSG:x", "UTM 32", "proj=utm", "a\nb"] {
            assert!(matches!(System::parse(text), Err(CrsError::NotACrs(_))), "{text}");
        }
        assert!(System::is_unknown_code("EPSG:999999") && System::is_unknown_code(" epsg:25832+99999"));
        for text in ["EPSG:25832", "EPSG:25832+5783", "EPSG:x", "+proj=utm +zone=99", "EPSG:25832+25833"] {
            let known = !System::is_unknown_code(text) || text == "EPSG:25832+25833";
            assert!(known, "{text}");
        }
        for text in ["EPSG:999999", "LOCAL_CS[\"site\"]", "+proj=nonsense", "EPSG:25832+25833"] {
            assert!(matches!(System::parse(text), Err(CrsError::Unsupported { .. })), "{text}");
        }
    }

    #[test]
    fn the_code_of_a_wkt_stands_at_its_end() {
        let wkt =
            "PROJCRS[\"x\",BASEGEOGCRS[\"y\",ID[\"EPSG\",4258]],CONVERSION[\"z\",METHOD[\"w\"]],ID[\"EPSG\",2154] ]";
        assert_eq!(code_at_the_end(wkt).as_deref(), Some("EPSG:2154"));
        assert_eq!(code_at_the_end("PROJCS[\"x\",GEOGCS[\"y\",AUTHORITY[\"EPSG\",\"4258\"]],UNIT[\"m\",1]]"), None);
    }
}

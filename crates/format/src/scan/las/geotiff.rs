//! GeoTIFF keys (records 34735 to 34737): which system, in which units (GeoTIFF 1.1 §7).

use super::bytes::{f64_at, text, u16_at};
use crate::{ScanWarning, Unit};

/// The records: the directory, the doubles and the texts that its entries point to.
pub(super) const DIRECTORY: u16 = 34735;
pub(super) const DOUBLES: u16 = 34736;
pub(super) const TEXTS: u16 = 34737;

/// Ids of keys.
pub(super) const MODEL_TYPE: u16 = 1024;
pub(super) const CITATION: u16 = 1026;
pub(super) const GEODETIC_CRS: u16 = 2048;
const GEODETIC_CITATION: u16 = 2049;
pub(super) const GEOCENTRIC_UNIT: u16 = 2052;
pub(super) const GEOCENTRIC_UNIT_SIZE: u16 = 2053;
pub(super) const ANGULAR_UNIT: u16 = 2054;
pub(super) const ANGULAR_UNIT_SIZE: u16 = 2055;
pub(super) const PROJECTED_CRS: u16 = 3072;
const PROJECTED_CITATION: u16 = 3073;
pub(super) const LINEAR_UNIT: u16 = 3076;
pub(super) const LINEAR_UNIT_SIZE: u16 = 3077;
pub(super) const VERTICAL_CRS: u16 = 4096;
pub(super) const VERTICAL_UNIT: u16 = 4099;

/// Values of [`MODEL_TYPE`].
pub(super) const PROJECTED: u16 = 1;
pub(super) const GEOCENTRIC: u16 = 3;
/// A code that says "by parameters", not by a code.
pub(super) const USER_DEFINED: u16 = 32767;

/// The keys, and the values they point to.
pub(super) struct GeoKeys<'a> {
    /// Key id, where its value is (0: in the entry), how many there are, the value or its index.
    entries: Vec<[u16; 4]>,
    doubles: &'a [u8],
    texts: &'a [u8],
}

impl<'a> GeoKeys<'a> {
    /// Malformed keys become a line in `warnings`; those that are there are taken.
    pub(super) fn parse(data: &[u8], doubles: &'a [u8], texts: &'a [u8], warnings: &mut Vec<ScanWarning>) -> Self {
        let declared = usize::from(u16_at(data, 6));
        let there = (data.len() / 8).saturating_sub(1);
        if data.len() < 8 || u16_at(data, 0) != 1 || declared > there {
            warnings.push(ScanWarning::GeoTiffKeys { version: u16_at(data, 0), declared, room: there });
        }
        let entry = |i: usize| std::array::from_fn(|field| u16_at(data, 8 + 8 * i + 2 * field));
        Self { entries: (0..declared.min(there)).map(entry).collect(), doubles, texts }
    }

    /// The EPSG code of the projected system, else, if there is no projection, of the geographic one.
    pub(super) fn horizontal(&self) -> Option<u32> {
        let geodetic = || if self.is_projected() { None } else { self.epsg(GEODETIC_CRS) };
        self.epsg(PROJECTED_CRS).or_else(geodetic)
    }

    pub(super) fn vertical(&self) -> Option<u32> {
        self.epsg(VERTICAL_CRS)
    }

    /// True if the horizontal system is defined by parameters, not by a code.
    pub(super) fn is_user_defined(&self) -> bool {
        self.horizontal().is_none() && (self.is_projected() || self.short(GEODETIC_CRS) == Some(USER_DEFINED))
    }

    /// True if the keys speak of a projection, whether or not they name it.
    fn is_projected(&self) -> bool {
        self.short(MODEL_TYPE) == Some(PROJECTED) || self.short(PROJECTED_CRS).is_some_and(|code| code != 0)
    }

    /// The declared unit of x and y.
    pub(super) fn unit(&self, warnings: &mut Vec<ScanWarning>) -> Option<Unit> {
        let (key, size) = match self.short(MODEL_TYPE) {
            _ if self.is_projected() => (LINEAR_UNIT, LINEAR_UNIT_SIZE),
            Some(GEOCENTRIC) => (GEOCENTRIC_UNIT, GEOCENTRIC_UNIT_SIZE),
            _ if self.short(GEODETIC_CRS).is_some() => (ANGULAR_UNIT, ANGULAR_UNIT_SIZE),
            _ => (LINEAR_UNIT, LINEAR_UNIT_SIZE),
        };
        let of_size = self.double(size).map(|v| if key == ANGULAR_UNIT { Unit::angle(v) } else { Unit::length(v) });
        let unit = match self.short(key) {
            Some(USER_DEFINED) => of_size.unwrap_or(Unit::Unknown),
            Some(0) | None => of_size?,
            Some(code) => Unit::from_epsg(code),
        };
        let fits = unit.is_angle() == (key == ANGULAR_UNIT);
        self.known(key, if fits { unit } else { Unit::Unknown }, warnings)
    }

    /// The declared unit of z.
    pub(super) fn vertical_unit(&self, warnings: &mut Vec<ScanWarning>) -> Option<Unit> {
        let code = self.short(VERTICAL_UNIT).filter(|code| *code != 0)?;
        let unit = Unit::from_epsg(code);
        self.known(VERTICAL_UNIT, if unit.is_angle() { Unit::Unknown } else { unit }, warnings)
    }

    fn known(&self, key: u16, unit: Unit, warnings: &mut Vec<ScanWarning>) -> Option<Unit> {
        if unit == Unit::Unknown {
            warnings.push(ScanWarning::GeoTiffUnit { key, code: self.short(key).unwrap_or_default() });
        }
        Some(unit)
    }

    /// The name of the system.
    pub(super) fn citation(&self) -> Option<String> {
        let keys = [PROJECTED_CITATION, CITATION, GEODETIC_CITATION];
        keys.into_iter().find_map(|key| self.text(key)).filter(|name| !name.is_empty())
    }

    /// The EPSG code under `key`; 0 (undefined) and 32767 and above (user-defined, private) are none.
    fn epsg(&self, key: u16) -> Option<u32> {
        self.short(key).filter(|v| (1..USER_DEFINED).contains(v)).map(u32::from)
    }

    /// The value that stands in the entry itself.
    fn short(&self, key: u16) -> Option<u16> {
        self.entries.iter().find(|e| e[0] == key && e[1] == 0).map(|e| e[3])
    }

    fn double(&self, key: u16) -> Option<f64> {
        let [.., index] = self.entries.iter().find(|e| e[0] == key && e[1] == DOUBLES)?;
        let at = 8 * usize::from(*index);
        (at + 8 <= self.doubles.len()).then(|| f64_at(self.doubles, at))
    }

    /// The texts end with `|`.
    fn text(&self, key: u16) -> Option<String> {
        let [_, _, count, at] = self.entries.iter().find(|e| e[0] == key && e[1] == TEXTS)?;
        let bytes = self.texts.get(usize::from(*at)..)?;
        let bytes = &bytes[..usize::from(*count).min(bytes.len())];
        Some(text(bytes).trim_end_matches('|').trim().to_owned())
    }
}

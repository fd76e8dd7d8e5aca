//! What becomes of heights when points are reprojected.

use pointmill_format::ScanWarning;

use crate::system::{HeightReference, System};
use crate::units::{is_same, name, ratio};

/// What becomes of heights.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Heights {
    /// Factor of z, before the projection.
    pub(crate) factor: f64,
    /// What the user should know.
    pub(crate) warning: Option<ScanWarning>,
}

/// Heights from one system to another.
///
/// `unit`: metres of the unit of z; `None`: nothing says it.
///
/// # Errors
/// Why they cannot be changed: one line.
pub(crate) fn heights(from: &System, to: &System, unit: Option<f64>) -> Result<Heights, String> {
    let mut warning = None;
    match (from.heights(), to.heights()) {
        (_, HeightReference::Unknown) => {}
        (a, b) if a == b => {}
        (HeightReference::Unknown, HeightReference::Ellipsoid) => {
            warning = Some(ScanWarning::HeightsAboveNothing { target: to.name() });
        }
        (a, b) => return Err(format!("its heights are {}, those of {} {}", words(a), to.name(), words(b))),
    }
    // those of geographic systems are metres
    let wanted = to.height_unit().or(to.unit()).unwrap_or(1.0);
    let factor = match unit {
        Some(unit) => ratio(unit, wanted),
        None if is_same(from.unit().unwrap_or(1.0), wanted) => 1.0,
        None if to.is_geocentric() => {
            return Err(format!("nothing says the unit of its heights, and {} has no axis of heights", to.name()));
        }
        None => {
            let beside = to.unit().map_or_else(|| "degrees".to_owned(), name);
            warning = Some(ScanWarning::HeightsWithoutUnit { beside });
            1.0
        }
    };
    Ok(Heights { factor, warning })
}

fn words(heights: HeightReference) -> String {
    match heights {
        HeightReference::Unknown => "not said to be above anything".to_owned(),
        HeightReference::Ellipsoid => "above the ellipsoid".to_owned(),
        HeightReference::Datum(code) => format!("above the vertical datum EPSG:{code}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn between(from: &str, to: &str, unit: Option<f64>) -> Result<Heights, String> {
        heights(&System::parse(from).unwrap(), &System::parse(to).unwrap(), unit)
    }

    #[test]
    fn heights_are_kept_or_change_their_unit_if_that_is_known() {
        let kept = Heights { factor: 1.0, warning: None };
        assert_eq!(between("EPSG:25832", "EPSG:25833", None), Ok(kept.clone()));
        assert_eq!(between("EPSG:25832+5783", "EPSG:25833", Some(1.0)), Ok(kept.clone()));
        assert_eq!(between("EPSG:25832+5783", "EPSG:25833+5783", Some(1.0)), Ok(kept));
        assert_eq!(between("EPSG:2227", "EPSG:26910", Some(0.3048)).unwrap().factor, 0.3048);
        let unknown = between("EPSG:2227", "EPSG:26910", None).unwrap();
        assert!(
            unknown.factor == 1.0
                && matches!(&unknown.warning, Some(ScanWarning::HeightsWithoutUnit { beside }) if beside == "metres"),
            "{unknown:?}"
        );
    }

    #[test]
    fn no_height_changes_its_reference() {
        for (from, to) in [
            ("EPSG:25832+5783", "EPSG:4936"),
            ("EPSG:25832", "EPSG:25832+5783"),
            ("EPSG:25832+5783", "EPSG:25832+3855"),
            ("EPSG:4979", "EPSG:32632+3855"),
        ] {
            assert!(between(from, to, Some(1.0)).is_err(), "{from} {to}");
        }
        let taken = between("EPSG:32632", "EPSG:4978", None).unwrap().warning;
        assert_eq!(taken, Some(ScanWarning::HeightsAboveNothing { target: "EPSG:4978".to_owned() }));
        assert!(between("EPSG:2227", "EPSG:4978", None).is_err());
    }
}

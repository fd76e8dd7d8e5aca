//! What the report of a conversion says of the attributes that it has computed.

use serde_json::Value;

use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::report::{Derive, Dropped, Reported};

/// Names of the components of a normal.
pub(super) const NORMALS: [&str; 3] = ["NormalX", "NormalY", "NormalZ"];
pub(super) const CURVATURE: &str = "curvature";
pub(super) const RADIUS: &str = "radius";

/// What was computed, how, and of how many points it could not be.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Derived {
    /// Normals and curvatures.
    pub(super) normals: bool,
    pub(super) radius: bool,
    pub(super) extent: Extent,
    pub(super) orient: Orient,
    /// Points that have the normal of their scan; 0 where these were replaced.
    pub(super) kept_normals: u64,
    /// As stated; `None`: nothing is stated.
    pub(super) without_normal: Option<u64>,
    pub(super) without_radius: Option<u64>,
    /// Equal records of which the dataset has one: they were neighbours, too.
    pub(super) duplicates_dropped: u64,
    /// Attributes that the dataset does not have, with the value that all points agree on, if that is why.
    pub(super) left_out: Vec<(String, Option<f64>)>,
}

/// Which points are a neighbourhood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Extent {
    /// So many, with the point itself.
    Nearest(usize),
    /// All within that distance, world units.
    Within(f64),
}

/// To which side normals point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Orient {
    /// To the scanner, whose place a dataset does not have.
    Scanner,
    Up,
    /// The component of the largest magnitude is positive.
    None,
    /// To a place, world units.
    Place([f64; 3]),
}

impl Derived {
    /// `None`: nothing was computed, or what the report has of it, which is a finding then, makes no sense. Where something was,
    /// the checks of it are reported.
    pub(crate) fn of(report: Option<&Reported>, findings: &Findings) -> Option<Self> {
        let report = report?;
        let derive = report.derive.as_ref()?;
        findings.checked(Check::Report, 1);
        match Self::parse(derive, report) {
            Ok(derived) => {
                findings.include_derived();
                Some(derived)
            }
            Err(subject) => {
                let found = derive.settings.clone();
                let subject = format!("{subject} in derive in the report");
                findings.push(Finding::new(Check::Report, subject, "as docs/surfels.md has it", found));
                None
            }
        }
    }

    /// # Errors
    /// The key that makes no sense.
    fn parse(derive: &Derive, report: &Reported) -> Result<Self, &'static str> {
        let Derive { settings, counts } = derive;
        let (normals, is_replaced) = match &settings["normals"] {
            Value::Null => (false, false),
            Value::String(word) if word == "keep" => (true, false),
            Value::String(word) if word == "replace" => (true, true),
            _ => return Err("normals"),
        };
        let radius = match &settings["radius"] {
            Value::Null => false,
            value => value.as_bool().ok_or("radius")?,
        };
        let count = |key: &str| counts[key].as_u64();
        Ok(Self {
            normals,
            radius,
            extent: Extent::parse(settings)?,
            orient: Orient::parse(&settings["orient"])?,
            kept_normals: if is_replaced { 0 } else { count("kept_normals").unwrap_or(0) },
            without_normal: count("without_normal"),
            without_radius: count("without_radius"),
            duplicates_dropped: report.duplicates_dropped,
            left_out: report.attributes_dropped.iter().map(left_out).collect(),
        })
    }

    /// Names of the attributes that were computed, whether the dataset has them or not.
    pub(crate) fn names_of(derived: Option<&Self>) -> Vec<&'static str> {
        derived.map(Self::names).unwrap_or_default()
    }

    fn names(&self) -> Vec<&'static str> {
        let normals = NORMALS.into_iter().chain([CURVATURE]).filter(|_| self.normals);
        normals.chain([RADIUS].into_iter().filter(|_| self.radius)).collect()
    }
}

fn left_out(dropped: &Dropped) -> (String, Option<f64>) {
    let constant = dropped.constant.as_deref().and_then(|values| values.first().copied());
    (dropped.name.clone(), constant)
}

impl Extent {
    fn parse(settings: &Value) -> Result<Self, &'static str> {
        match (&settings["neighbours"], &settings["neighbour_radius"]) {
            (count, Value::Null) => {
                let count = count.as_u64().filter(|count| (3..=1000).contains(count));
                count.map(|count| Self::Nearest(count as usize)).ok_or("neighbours")
            }
            (Value::Null, radius) => {
                let radius = radius.as_f64().filter(|radius| radius.is_finite() && *radius > 0.0);
                radius.map(Self::Within).ok_or("neighbour_radius")
            }
            _ => Err("neighbours and neighbour_radius"),
        }
    }
}

impl Orient {
    fn parse(value: &Value) -> Result<Self, &'static str> {
        match value {
            Value::String(word) => match word.as_str() {
                "scanner" => Ok(Self::Scanner),
                "up" => Ok(Self::Up),
                "none" => Ok(Self::None),
                _ => Err("orient"),
            },
            Value::Null => Ok(Self::Scanner),
            place => {
                let place: Option<Vec<f64>> = place.as_array().into_iter().flatten().map(Value::as_f64).collect();
                place.and_then(|place| place.try_into().ok()).map(Self::Place).ok_or("orient")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use pointmill_format::DatasetKind;
    use serde_json::json;

    use super::*;

    fn parsed(settings: Value) -> (Option<Derived>, usize) {
        let counts = json!({ "points": 9, "kept_normals": 2, "without_normal": 3, "without_radius": 1 });
        let mut report = Reported::default();
        report.derive = Some(Derive { settings, counts });
        let findings = Findings::new(DatasetKind::Potree2, 20);
        (Derived::of(Some(&report), &findings), findings.finish().1.len())
    }

    #[test]
    fn settings_are_read_as_the_report_has_them() {
        let (kept, _) = parsed(json!({ "normals": "keep", "radius": true, "neighbours": 16, "orient": "scanner" }));
        let kept = kept.unwrap();
        assert_eq!((kept.extent, kept.orient, kept.kept_normals), (Extent::Nearest(16), Orient::Scanner, 2));
        assert_eq!(kept.names(), ["NormalX", "NormalY", "NormalZ", "curvature", "radius"]);
        let (replaced, _) =
            parsed(json!({ "normals": "replace", "radius": false, "neighbour_radius": 0.5, "orient": [1, 2.5, -3] }));
        let replaced = replaced.unwrap();
        assert_eq!((replaced.extent, replaced.orient), (Extent::Within(0.5), Orient::Place([1.0, 2.5, -3.0])));
        assert_eq!((replaced.kept_normals, replaced.names().len()), (0, 4));
        assert_eq!(parsed(json!({ "radius": true, "neighbours": 3 })).0.unwrap().names(), ["radius"]);
    }

    #[test]
    fn settings_that_make_no_sense_are_a_finding() {
        for settings in [
            json!({ "normals": "all", "neighbours": 16 }),
            json!({ "radius": 1, "neighbours": 16 }),
            json!({ "radius": true, "neighbours": 2 }),
            json!({ "radius": true, "neighbours": 16, "neighbour_radius": 0.5 }),
            json!({ "radius": true, "neighbour_radius": -1 }),
            json!({ "radius": true }),
            json!({ "normals": "keep", "neighbours": 16, "orient": "down" }),
            json!({ "normals": "keep", "neighbours": 16, "orient": [1, 2] }),
        ] {
            assert_eq!(parsed(settings.clone()), (None, 1), "{settings}");
        }
    }
}

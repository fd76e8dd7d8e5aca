//! The description of a scan ("Data3D" in ASTM E2807 §8.4.3).

use super::element::{Element, MAX_FIELDS};
use super::numbers::{Numbers, no_number};
use crate::scan::e57::fields::Field;

/// What the XML says of a scan.
#[derive(Debug, Clone, Default)]
pub(in crate::scan::e57) struct Cloud {
    /// Among the scans of the file, from 0.
    pub(in crate::scan::e57) index: usize,
    pub(in crate::scan::e57) name: String,
    pub(in crate::scan::e57) guid: String,
    /// True if there is an element that describes points.
    pub(in crate::scan::e57) has_points: bool,
    /// Points that it declares.
    pub(in crate::scan::e57) records: u64,
    /// Physical offset of the points' section.
    pub(in crate::scan::e57) file_offset: u64,
    pub(in crate::scan::e57) fields: Vec<Field>,
    pub(in crate::scan::e57) pose: Option<Placement>,
    /// Least and largest x, y, z, as they stand there.
    pub(in crate::scan::e57) bounds: Option<[[f64; 2]; 3]>,
    pub(in crate::scan::e57) range_max: Option<f64>,
    /// Of red, green, blue: low and high.
    pub(in crate::scan::e57) colour_limits: Option<[[Limit; 2]; 3]>,
    pub(in crate::scan::e57) intensity_limits: Option<[Limit; 2]>,
}

/// A pose as it stands there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::scan::e57) struct Placement {
    /// Quaternion: w, x, y, z.
    pub(in crate::scan::e57) rotation: [f64; 4],
    pub(in crate::scan::e57) translation: [f64; 3],
}

/// An end of a range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::scan::e57) enum Limit {
    /// What is meant.
    Value(f64),
    /// An integer that is scaled as the field is.
    Stored(f64),
}

impl Cloud {
    /// # Errors
    /// What cannot be understood without getting points wrong.
    pub(super) fn read(index: usize, scan: &Element<'_>, numbers: &Numbers) -> Result<Self, String> {
        let text = |name: &str| scan.child_text(name).unwrap_or_default().to_owned();
        let mut cloud = Self { index, name: text("name"), guid: text("guid"), ..Self::default() };
        cloud.pose = scan.child("pose").map(|pose| Placement::read(pose, numbers)).transpose()?;
        if let Some(points) = scan.child("points") {
            cloud.has_points = true;
            let count = |name: &str| -> Result<u64, String> {
                let value = numbers.attribute(points, name)?.ok_or_else(|| format!("its points have no {name}"))?;
                u64::try_from(value).map_err(|_| no_number(name, &value.to_string()))
            };
            (cloud.records, cloud.file_offset) = (count("recordCount")?, count("fileOffset")?);
            let fields = points.child("prototype").map_or(&[][..], |p| p.children.as_slice());
            if fields.len() > MAX_FIELDS {
                return Err(format!("its points have more than {MAX_FIELDS} fields"));
            }
            cloud.fields = fields.iter().map(|f| Field::read(f, numbers)).collect::<Result<_, _>>()?;
        }
        // what cannot be understood of these is as good as not there
        let pair = |parent: &Element<'_>, low: &str, high: &str| Some([low, high].map(|n| limit(parent, n, numbers)));
        let pair = |parent, low, high| pair(parent, low, high).and_then(|[a, b]| Some([a?, b?]));
        cloud.intensity_limits =
            scan.child("intensityLimits").and_then(|l| pair(l, "intensityMinimum", "intensityMaximum"));
        cloud.colour_limits = scan.child("colorLimits").and_then(|l| {
            let red = pair(l, "colorRedMinimum", "colorRedMaximum")?;
            let green = pair(l, "colorGreenMinimum", "colorGreenMaximum")?;
            Some([red, green, pair(l, "colorBlueMinimum", "colorBlueMaximum")?])
        });
        cloud.bounds = scan.child("cartesianBounds").and_then(|b| {
            let end = |name: &str| numbers.child(b, name).ok().flatten();
            Some([
                [end("xMinimum")?, end("xMaximum")?],
                [end("yMinimum")?, end("yMaximum")?],
                [end("zMinimum")?, end("zMaximum")?],
            ])
        });
        cloud.range_max = scan.child("sphericalBounds").and_then(|b| numbers.child(b, "rangeMaximum").ok().flatten());
        Ok(cloud)
    }
}

impl Placement {
    /// No turn and no way.
    pub(in crate::scan::e57) const IDENTITY: Self = Self { rotation: [1.0, 0.0, 0.0, 0.0], translation: [0.0; 3] };

    /// A pose; without rotation or translation there is none of it.
    pub(super) fn read(pose: &Element<'_>, numbers: &Numbers) -> Result<Self, String> {
        let mut placement = Self::IDENTITY;
        if let Some(rotation) = pose.child("rotation") {
            for (value, name) in placement.rotation.iter_mut().zip(["w", "x", "y", "z"]) {
                *value = numbers.child(rotation, name)?.unwrap_or(0.0);
            }
        }
        if let Some(translation) = pose.child("translation") {
            for (value, name) in placement.translation.iter_mut().zip(["x", "y", "z"]) {
                *value = numbers.child(translation, name)?.unwrap_or(0.0);
            }
        }
        Ok(placement)
    }
}

fn limit(parent: &Element<'_>, name: &str, numbers: &Numbers) -> Option<Limit> {
    let element = parent.child(name)?;
    let value = numbers.float(element.text())?;
    let own = |name: &str| element.attribute(name).and_then(|text| numbers.float(text));
    Some(match (element.attribute("type"), own("scale"), own("offset")) {
        (Some("ScaledInteger"), None, None) => Limit::Stored(value),
        (Some("ScaledInteger"), scale, offset) => Limit::Value(value * scale.unwrap_or(1.0) + offset.unwrap_or(0.0)),
        // values of single precision are written with few digits
        (Some("Float"), ..) if element.attribute("precision") == Some("single") => {
            Limit::Value(f64::from(value as f32))
        }
        _ => Limit::Value(value),
    })
}

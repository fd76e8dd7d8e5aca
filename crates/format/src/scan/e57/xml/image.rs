//! The description of an image ("Image2D" in ASTM E2807 §8.4.4).

use super::cloud::Placement;
use super::element::Element;
use super::numbers::{Numbers, no_number};
use crate::{Blob, ImageEncoding, ImageGeometry, ImageKind};

/// What the XML says of an image: up to one for each kind.
#[derive(Debug, Clone)]
pub(in crate::scan::e57) struct Image {
    pub(in crate::scan::e57) name: String,
    /// Of the scan that it belongs to; empty if it does not say.
    pub(in crate::scan::e57) scan_guid: String,
    pub(in crate::scan::e57) pose: Option<Placement>,
    pub(in crate::scan::e57) views: Vec<View>,
}

/// One form of an image.
#[derive(Debug, Clone, Copy)]
pub(in crate::scan::e57) struct View {
    pub(in crate::scan::e57) kind: ImageKind,
    pub(in crate::scan::e57) encoding: ImageEncoding,
    pub(in crate::scan::e57) pixels: [u64; 2],
    pub(in crate::scan::e57) data: Blob,
    pub(in crate::scan::e57) mask: Option<Blob>,
    pub(in crate::scan::e57) geometry: ImageGeometry,
}

/// The forms that an image may have, what can be projected first.
const KINDS: [(&str, ImageKind); 4] = [
    ("pinholeRepresentation", ImageKind::Pinhole),
    ("sphericalRepresentation", ImageKind::Spherical),
    ("cylindricalRepresentation", ImageKind::Cylindrical),
    ("visualReferenceRepresentation", ImageKind::VisualReference),
];

impl Image {
    /// # Errors
    /// What cannot be understood: where its bytes are, its pose or its geometry.
    pub(super) fn read(image: &Element<'_>, numbers: &Numbers) -> Result<Self, String> {
        let text = |name: &str| image.child_text(name).unwrap_or_default().to_owned();
        let views = KINDS.iter().filter_map(|(name, kind)| Some((image.child(name)?, *kind)));
        let views: Vec<_> = views.map(|(view, kind)| View::read(view, kind, numbers)).collect::<Result<_, _>>()?;
        if views.is_empty() {
            return Err("it has no representation".to_owned());
        }
        let pose = image.child("pose").map(|pose| Placement::read(pose, numbers)).transpose()?;
        Ok(Self { name: text("name"), scan_guid: text("associatedData3DGuid"), pose, views })
    }
}

impl View {
    fn read(view: &Element<'_>, kind: ImageKind, numbers: &Numbers) -> Result<Self, String> {
        let number = |name: &str| numbers.child(view, name);
        let pair = |a: &str, b: &str| Ok::<_, String>(number(a)?.zip(number(b)?).map(|(a, b)| [a, b]));
        let size = |name: &str| Ok::<_, String>(number(name)?.filter(|v| *v >= 0.0).unwrap_or(0.0) as u64);
        let (encoding, data) = match (blob(view, "jpegImage", numbers)?, blob(view, "pngImage", numbers)?) {
            (Some(data), _) => (ImageEncoding::Jpeg, data),
            (None, Some(data)) => (ImageEncoding::Png, data),
            (None, None) => return Err("it has neither a JPEG nor a PNG".to_owned()),
        };
        let is_pinhole = kind == ImageKind::Pinhole;
        let principal_point = match kind {
            ImageKind::Cylindrical => number("principalPointY")?.map(|y| [0.0, y]),
            _ => pair("principalPointX", "principalPointY")?,
        };
        let geometry = ImageGeometry {
            focal_length: if is_pinhole { number("focalLength")? } else { None },
            pixel_size: pair("pixelWidth", "pixelHeight")?,
            principal_point,
            radius: number("radius")?,
        };
        let mask = blob(view, "imageMask", numbers)?;
        Ok(Self { kind, encoding, pixels: [size("imageWidth")?, size("imageHeight")?], data, mask, geometry })
    }
}

fn blob(view: &Element<'_>, name: &str, numbers: &Numbers) -> Result<Option<Blob>, String> {
    let Some(element) = view.child(name) else { return Ok(None) };
    let value = |attribute: &str| {
        let value = numbers.attribute(element, attribute)?.ok_or_else(|| format!("{name} has no {attribute}"))?;
        u64::try_from(value).map_err(|_| no_number(attribute, &value.to_string()))
    };
    Ok(Some(Blob { byte_offset: value("fileOffset")?, bytes: value("length")? }))
}

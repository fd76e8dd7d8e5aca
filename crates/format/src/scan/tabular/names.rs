//! What a column is, by its name.

use crate::AttributeType;
use crate::scan::quantities::{NORMALS, normal_axis, quantity};

/// The meaning of a named number of a row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Role {
    /// x, y or z.
    Axis(usize),
    /// Red, green or blue; part of "rgb" if all three are there.
    Colour(usize),
    /// Of the unit normal.
    Normal(usize),
    Intensity,
    Classification,
    /// Three colours (and alpha) in the bits of one 32-bit number, as PCL stores them.
    PackedColour,
    /// The constant part of red, green or blue of a splat's spherical harmonics.
    Harmonic(usize),
    /// Nothing: it is skipped.
    Padding,
    /// Anything else: the name under which it is kept.
    Other(String),
}

/// The role of a column called `name` (case does not count).
pub(crate) fn role(name: &str) -> Role {
    let lower = name.trim().to_ascii_lowercase();
    match lower.as_str() {
        "x" => Role::Axis(0),
        "y" => Role::Axis(1),
        "z" => Role::Axis(2),
        "red" | "r" | "diffuse_red" => Role::Colour(0),
        "green" | "g" | "diffuse_green" => Role::Colour(1),
        "blue" | "b" | "diffuse_blue" => Role::Colour(2),
        "rgb" | "rgba" => Role::PackedColour,
        "f_dc_0" => Role::Harmonic(0),
        "f_dc_1" => Role::Harmonic(1),
        "f_dc_2" => Role::Harmonic(2),
        _ => match (normal_axis(name), quantity(name, AttributeType::UInt16)) {
            (Some(axis), _) => Role::Normal(axis),
            (None, Some("intensity")) => Role::Intensity,
            (None, Some("classification")) => Role::Classification,
            _ => Role::Other(name.trim().to_owned()),
        },
    }
}

/// The name of an attribute without a role: that of its quantity, or its own. A part of a normal is none.
pub(crate) fn other_name(name: &str, ty: AttributeType) -> &str {
    quantity(name, ty).filter(|usual| !NORMALS.contains(usual)).unwrap_or(name)
}

/// The type that LAS has for the quantity that `name` is a name of.
pub(crate) fn las_type(name: &str) -> Option<AttributeType> {
    use AttributeType::{Float64, UInt8, UInt16};
    let ty = match quantity(name, Float64)? {
        "gps-time" | "timestamp" | "scan angle" => Float64,
        "point source id" | "nir" => UInt16,
        _ => UInt8,
    };
    Some(ty)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_names_have_roles() {
        assert_eq!(role("X"), Role::Axis(0));
        assert_eq!(role("diffuse_blue"), Role::Colour(2));
        assert_eq!(role("normal_z"), Role::Normal(2));
        assert_eq!(role("scalar_Intensity"), Role::Intensity);
        assert_eq!(role("class"), Role::Classification);
        assert_eq!(role("scalar_Quality"), Role::Other("scalar_Quality".to_owned()));
    }

    #[test]
    fn a_name_of_pdal_becomes_that_of_las_only_with_its_unit() {
        assert_eq!(other_name("GpsTime", AttributeType::Float64), "gps-time");
        assert_eq!(other_name("GpsTime", AttributeType::Float32), "GpsTime");
        assert_eq!(other_name("nx", AttributeType::Float32), "nx", "a normal of one component");
        assert_eq!((las_type("ReturnNumber"), las_type("Quality")), (Some(AttributeType::UInt8), None));
    }
}

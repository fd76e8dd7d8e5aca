//! What a column is, by its name.

use crate::AttributeType;

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

/// Names that have an attribute of LAS as their equal, if the type is the same (PDAL writes these).
const LAS_NAMES: [(&str, &str, AttributeType); 10] = [
    ("returnnumber", "return number", AttributeType::UInt8),
    ("numberofreturns", "number of returns", AttributeType::UInt8),
    ("scandirectionflag", "scan direction flag", AttributeType::UInt8),
    ("edgeofflightline", "edge of flight line", AttributeType::UInt8),
    ("userdata", "user data", AttributeType::UInt8),
    ("pointsourceid", "point source id", AttributeType::UInt16),
    ("gpstime", "gps-time", AttributeType::Float64),
    ("scanchannel", "scanner channel", AttributeType::UInt8),
    ("infrared", "nir", AttributeType::UInt16),
    ("nir", "nir", AttributeType::UInt16),
];

/// The role of a column called `name` (case does not count). CloudCompare's `scalar_*` stay what they are called.
pub(crate) fn role(name: &str) -> Role {
    let lower = name.trim().to_ascii_lowercase();
    match lower.as_str() {
        "x" => Role::Axis(0),
        "y" => Role::Axis(1),
        "z" => Role::Axis(2),
        "red" | "r" | "diffuse_red" => Role::Colour(0),
        "green" | "g" | "diffuse_green" => Role::Colour(1),
        "blue" | "b" | "diffuse_blue" => Role::Colour(2),
        "nx" | "normal_x" | "normalx" | "normals_x" => Role::Normal(0),
        "ny" | "normal_y" | "normaly" | "normals_y" => Role::Normal(1),
        "nz" | "normal_z" | "normalz" | "normals_z" => Role::Normal(2),
        "intensity" => Role::Intensity,
        "classification" => Role::Classification,
        "rgb" | "rgba" => Role::PackedColour,
        "f_dc_0" => Role::Harmonic(0),
        "f_dc_1" => Role::Harmonic(1),
        "f_dc_2" => Role::Harmonic(2),
        _ => Role::Other(name.trim().to_owned()),
    }
}

/// The name of an attribute without a role.
pub(crate) fn other_name(name: &str, ty: AttributeType) -> &str {
    let lower = name.to_ascii_lowercase();
    LAS_NAMES.iter().find(|(theirs, _, t)| *theirs == lower && *t == ty).map_or(name, |(_, ours, _)| ours)
}

/// The type of the LAS attribute that `name` is another name of.
pub(crate) fn las_type(name: &str) -> Option<AttributeType> {
    let lower = name.to_ascii_lowercase();
    LAS_NAMES.iter().find(|(theirs, ..)| *theirs == lower).map(|(.., ty)| *ty)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_names_have_roles_and_scalar_fields_keep_theirs() {
        assert_eq!(role("X"), Role::Axis(0));
        assert_eq!(role("diffuse_blue"), Role::Colour(2));
        assert_eq!(role("normal_z"), Role::Normal(2));
        assert_eq!(role("scalar_Intensity"), Role::Other("scalar_Intensity".to_owned()));
    }

    #[test]
    fn a_name_of_pdal_becomes_that_of_las_only_with_its_type() {
        assert_eq!(other_name("GpsTime", AttributeType::Float64), "gps-time");
        assert_eq!(other_name("GpsTime", AttributeType::Float32), "GpsTime");
    }
}

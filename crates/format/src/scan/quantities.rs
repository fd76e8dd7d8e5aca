//! One quantity, one attribute: the names under which kinds of scans, and the programs that write them, give the same
//! quantity (the table of docs/inputs.md).

use crate::AttributeType;

/// A quantity: the name that it gets, the names that it has in files, and the types in which it is one.
struct Quantity {
    name: &'static str,
    /// As [`plain`] makes them.
    others: &'static [&'static str],
    holds: fn(AttributeType) -> bool,
}

const fn any(_: AttributeType) -> bool {
    true
}

/// Times in seconds: integers count something else, and the single precision of CloudCompare is not the time but its
/// distance from a start that the file does not tell.
fn double(ty: AttributeType) -> bool {
    ty == AttributeType::Float64
}

/// Seconds as floats; integers count something else.
fn float(ty: AttributeType) -> bool {
    matches!(ty, AttributeType::Float32 | AttributeType::Float64)
}

/// Whole degrees.
fn degrees(ty: AttributeType) -> bool {
    ty == AttributeType::Int8
}

const QUANTITIES: [Quantity; 18] = [
    Quantity { name: "intensity", others: &["intensity", "intensities"], holds: any },
    Quantity { name: "classification", others: &["classification", "class"], holds: any },
    Quantity { name: "classification flags", others: &["classificationflags", "classflags"], holds: any },
    Quantity { name: "return number", others: &["returnnumber", "returnnum"], holds: any },
    Quantity {
        name: "number of returns",
        others: &["numberofreturns", "numreturns", "returncount", "returnscount"],
        holds: any,
    },
    Quantity { name: "scan direction flag", others: &["scandirectionflag"], holds: any },
    Quantity { name: "edge of flight line", others: &["edgeofflightline"], holds: any },
    Quantity { name: "user data", others: &["userdata"], holds: any },
    Quantity { name: "scan angle rank", others: &["scananglerank"], holds: degrees },
    Quantity { name: "scan angle", others: &["scanangle", "scananglerank"], holds: float },
    Quantity { name: "point source id", others: &["pointsourceid", "scanid", "scanindex"], holds: any },
    Quantity { name: "gps-time", others: &["gpstime"], holds: double },
    Quantity { name: "timestamp", others: &["timestamp"], holds: float },
    Quantity { name: "scanner channel", others: &["scannerchannel", "scanchannel"], holds: any },
    Quantity { name: "nir", others: &["nir", "infrared", "nearinfrared"], holds: any },
    Quantity { name: NORMALS[0], others: &["nx", "normalx", "normalsx", "xnormal"], holds: any },
    Quantity { name: NORMALS[1], others: &["ny", "normaly", "normalsy", "ynormal"], holds: any },
    Quantity { name: NORMALS[2], others: &["nz", "normalz", "normalsz", "znormal"], holds: any },
];

/// The components of a normal, as Potree viewers know them.
pub(crate) const NORMALS: [&str; 3] = ["NormalX", "NormalY", "NormalZ"];

/// The name of the quantity that a column of that name and type holds, if it is one that others have, too.
pub(crate) fn quantity(name: &str, ty: AttributeType) -> Option<&'static str> {
    let plain = plain(name);
    QUANTITIES.iter().find(|q| q.others.contains(&plain.as_str()) && (q.holds)(ty)).map(|q| q.name)
}

/// The axis of the normal that a column of that name holds.
pub(crate) fn normal_axis(name: &str) -> Option<usize> {
    let found = quantity(name, AttributeType::Float32)?;
    NORMALS.iter().position(|n| *n == found)
}

/// True for the name of a column of whole normals, three numbers each.
pub(crate) fn is_normal(name: &str) -> bool {
    matches!(plain(name).as_str(), "normal" | "normals")
}

/// In small letters, without blanks, underscores and hyphens, and without the "scalar_" that CloudCompare puts first.
pub(crate) fn plain(name: &str) -> String {
    let lower = name.trim().to_ascii_lowercase();
    let bare = lower.strip_prefix("scalar_").unwrap_or(&lower);
    bare.chars().filter(|c| !matches!(c, ' ' | '_' | '-')).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use AttributeType::{Float32, Float64, Int8, Int16, UInt8, UInt64};

    #[test]
    fn a_quantity_has_one_name_whatever_a_file_calls_it() {
        let cases = [
            ("normal x", Int8, "NormalX"),
            ("NormalX", Float64, "NormalX"),
            ("normal_x", Float32, "NormalX"),
            ("nz", Float32, "NormalZ"),
            ("scalar_Classification", Float32, "classification"),
            ("ReturnNumber", UInt8, "return number"),
            ("return_number", UInt8, "return number"),
            ("GpsTime", Float64, "gps-time"),
            ("scalar_gps_time", Float64, "gps-time"),
            ("timeStamp", Float64, "timestamp"),
            ("ScanId", UInt8, "point source id"),
            ("ScanAngleRank", Float32, "scan angle"),
            ("scan_angle_rank", Int8, "scan angle rank"),
        ];
        for (theirs, ty, ours) in cases {
            assert_eq!(quantity(theirs, ty), Some(ours), "{theirs}");
        }
        assert_eq!(normal_axis("normal y"), Some(1));
    }

    #[test]
    fn another_unit_or_another_name_is_no_quantity() {
        for (name, ty) in [
            ("GpsTime", Float32),
            ("timestamp", UInt64),
            ("ScanAngle", Int16),
            ("scalar_Quality", Float32),
            ("", UInt8),
        ] {
            assert_eq!(quantity(name, ty), None, "{name}");
        }
    }
}

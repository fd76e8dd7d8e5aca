//! What is odd about coordinate reference systems.

use std::fmt;

use pointmill_format::Unit;

/// What is odd about a coordinate reference system.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum CrsNote {
    /// The WKT describes no horizontal system.
    NoSystem,
    /// The WKT carries no EPSG code.
    NoCode {
        /// Name of the system.
        name: String,
    },
    /// The table of proj4 definitions lacks the code.
    NotInTable {
        /// EPSG code.
        code: u32,
    },
    /// Viewers cannot use the proj4 definition.
    NotForViewers {
        /// EPSG code, where the definition comes from the table.
        code: Option<u32>,
        /// Why.
        why: Proj4Fault,
    },
    /// WKT and GeoTIFF keys of one file disagree.
    Disagree {
        /// What the WKT says: code, units.
        wkt: String,
        /// What the GeoTIFF keys say.
        geotiff: String,
        /// The file says that the keys count, and they were taken.
        keys_taken: bool,
    },
    /// Coordinates are declared in another unit than the one of their system.
    Unit {
        /// EPSG code of the system.
        code: u32,
        /// The unit of the system.
        own: Unit,
        /// The unit that was declared, and taken.
        declared: Unit,
    },
    /// The given system has another unit than the one that the inputs declare.
    GivenUnit {
        /// The unit of the given system, which was taken.
        given: Unit,
        /// The unit that the inputs declare.
        declared: Unit,
    },
    /// The false easting of the WKT is not the one of the code that it carries.
    FalseEasting {
        /// EPSG code of the system.
        code: u32,
        /// False easting of the WKT, metres.
        found: f64,
        /// False easting of the code, metres.
        own: f64,
    },
    /// GeoTIFF keys define a system by parameters.
    UserDefined {
        /// Its name, or empty.
        name: String,
    },
    /// The WKT ends too early.
    CutWkt,
}

/// Why viewers cannot use a proj4 definition.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Proj4Fault {
    /// There is none.
    Missing,
    /// The text is not one.
    Malformed(String),
    /// Viewers do not know the projection.
    UnknownProjection(String),
    /// A definition cannot say that coordinates have this unit.
    Unit(Unit),
}

impl fmt::Display for CrsNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSystem => f.write_str("the WKT describes no projected or geographic coordinate system"),
            Self::NoCode { name } => write!(f, "the WKT \"{name}\" carries no EPSG code"),
            Self::NotInTable { code } => write!(f, "EPSG:{code} is not in the table of proj4 definitions"),
            Self::NotForViewers { code: Some(code), why } => write!(f, "EPSG:{code}: {why}"),
            Self::NotForViewers { code: None, why } => why.fmt(f),
            Self::Disagree { wkt, geotiff, keys_taken } => {
                let taken = if *keys_taken { "the keys were taken, as the header says" } else { "the WKT was taken" };
                write!(f, "the WKT says {wkt} but the GeoTIFF keys say {geotiff}; {taken}")
            }
            Self::Unit { code, own, declared } => write!(
                f,
                "EPSG:{code} has coordinates in units of {own}, but units of {declared} are declared; the latter were taken"
            ),
            Self::GivenUnit { given, declared } => write!(
                f,
                "the inputs declare coordinates in units of {declared}, the given coordinate reference system has \
                 units of {given}; the latter were taken"
            ),
            Self::FalseEasting { code, found, own } => write!(
                f,
                "the WKT has a false easting of {found} m, but the EPSG:{code} that it names has {own} m; the \
                 projection stays empty"
            ),
            Self::UserDefined { name } if name.is_empty() => {
                f.write_str("the GeoTIFF keys define a system of their own, which is not interpreted")
            }
            Self::UserDefined { name } => {
                write!(f, "the GeoTIFF keys define a system of their own (\"{name}\"), which is not interpreted")
            }
            Self::CutWkt => f.write_str("the WKT ends before its brackets are closed"),
        }
    }
}

impl fmt::Display for Proj4Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => f.write_str("there is no proj4 definition for it"),
            Self::Malformed(text) => write!(f, "\"{text}\" is not a proj4 definition"),
            Self::Unit(Unit::Unknown) => f.write_str("the unit of the coordinates is not known"),
            Self::Unit(unit) => write!(f, "a proj4 definition cannot have coordinates in units of {unit}"),
            Self::UnknownProjection(name) => write!(f, "viewers do not know +proj={name}"),
        }
    }
}

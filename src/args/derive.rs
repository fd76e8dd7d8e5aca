//! Options for what is computed from the points around each point.

use clap::Args as ClapArgs;
use pointmill_converter::{Derive, DeriveNormals, NEIGHBOURS, Neighbourhood, Orient};

use super::values::whole;

#[derive(Debug, ClapArgs)]
pub(crate) struct DeriveArgs {
    /// Computes attributes from the points around each: normals (NormalX, NormalY, NormalZ and curvature; points that have a normal
    /// keep it), normals=replace, radius (of a disk that covers the surface), or several, such as normals,radius
    #[arg(long, value_name = "WHAT", value_delimiter = ',', value_parser = parse_derived, help_heading = "Derived attributes")]
    pub(crate) derive: Vec<Derived>,
    #[arg(long, value_name = "K", value_parser = whole::<u32>(3..=1000), allow_negative_numbers = true, requires = "derive",
          conflicts_with = "neighbour_radius", help_heading = "Derived attributes",
          help = format!("Points of a neighbourhood: the nearest ones, the point itself among them [default: {NEIGHBOURS}]"))]
    pub(crate) neighbours: Option<u32>,
    /// Takes all points within R of a point for its neighbourhood, in units of the CRS, however many there are
    #[arg(long, value_name = "R", value_parser = parse_radius, allow_negative_numbers = true, requires = "derive",
          help_heading = "Derived attributes")]
    pub(crate) neighbour_radius: Option<f64>,
    /// To which side normals point: scanner (where the scan knows where it stood, else up), up, none, or a place in world
    /// coordinates [default: scanner]
    #[arg(long, value_name = "scanner|up|none|X,Y,Z", value_parser = parse_orient, allow_hyphen_values = true, requires = "derive",
          help_heading = "Derived attributes")]
    pub(crate) orient: Option<Orient>,
}

impl DeriveArgs {
    /// What a plan has of it.
    pub(crate) fn plan(&self) -> Derive {
        let has = |what: Derived| self.derive.contains(&what);
        let default = Derive::default();
        let normals = match (has(Derived::NewNormals), has(Derived::Normals)) {
            (true, _) => Some(DeriveNormals::Replace),
            (false, true) => Some(DeriveNormals::Keep),
            (false, false) => None,
        };
        let neighbourhood = match (self.neighbour_radius, self.neighbours) {
            (Some(radius), _) => Neighbourhood::Within(radius),
            (None, Some(count)) => Neighbourhood::Nearest(count),
            (None, None) => default.neighbourhood,
        };
        Derive { normals, radius: has(Derived::Radius), neighbourhood, orient: self.orient.unwrap_or(default.orient) }
    }
}

/// What can be computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Derived {
    Normals,
    NewNormals,
    Radius,
}

fn parse_derived(text: &str) -> Result<Derived, String> {
    match text.trim() {
        "normals" => Ok(Derived::Normals),
        "normals=replace" => Ok(Derived::NewNormals),
        "radius" => Ok(Derived::Radius),
        _ => Err("expected normals, normals=replace or radius".to_owned()),
    }
}

fn parse_radius(text: &str) -> Result<f64, String> {
    let radius = text.trim().parse::<f64>().ok().filter(|radius| radius.is_finite() && *radius > 0.0);
    radius.ok_or_else(|| "expected a length above 0, in units of the CRS".to_owned())
}

fn parse_orient(text: &str) -> Result<Orient, String> {
    match text.trim() {
        "scanner" => return Ok(Orient::Scanner),
        "up" => return Ok(Orient::Up),
        "none" => return Ok(Orient::None),
        _ => {}
    }
    let place: Option<Vec<f64>> =
        text.split(',').map(|v| v.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    match place.as_deref() {
        Some(&[x, y, z]) => Ok(Orient::Towards([x, y, z])),
        _ => Err("expected scanner, up, none or a place such as 0,0,100".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_and_others_refused() {
        assert_eq!(parse_derived("normals=replace"), Ok(Derived::NewNormals));
        assert!(parse_derived("colour").is_err());
        assert_eq!(parse_orient("1, -2.5,1e3"), Ok(Orient::Towards([1.0, -2.5, 1000.0])));
        for bad in ["1,2", "1,2,3,4", "1,2,nan", "down", ""] {
            assert!(parse_orient(bad).is_err(), "{bad}");
        }
        for bad in ["0", "-1", "inf", "x"] {
            assert!(parse_radius(bad).is_err(), "{bad}");
        }
    }
}

//! Attributes that are computed from the positions of all points.

/// Components of a normal.
pub(crate) const NORMALS: [&str; 3] = ["NormalX", "NormalY", "NormalZ"];
/// The surface variation.
pub(crate) const CURVATURE: &str = "curvature";
/// The radius of a disk that covers the surface.
pub(crate) const RADIUS: &str = "radius";

/// Points of a neighbourhood, unless the plan says otherwise.
pub const NEIGHBOURS: u32 = 16;

/// What is computed of each point from those around it (`docs/surfels.md`).
#[derive(Debug, Clone, PartialEq)]
pub struct Derive {
    /// Normals and curvature.
    pub normals: Option<DeriveNormals>,
    /// Radii.
    pub radius: bool,
    /// The points that count.
    pub neighbourhood: Neighbourhood,
    /// To which side normals point.
    pub orient: Orient,
}

impl Default for Derive {
    /// Nothing.
    fn default() -> Self {
        Self {
            normals: None,
            radius: false,
            neighbourhood: Neighbourhood::Nearest(NEIGHBOURS),
            orient: Orient::Scanner,
        }
    }
}

/// What becomes of the normals that scans have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeriveNormals {
    /// They are kept, where their length is not 0.
    Keep,
    /// They are not read.
    Replace,
}

impl DeriveNormals {
    /// The word in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Keep => "keep",
            Self::Replace => "replace",
        }
    }
}

/// The points around a point that count, itself among them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Neighbourhood {
    /// So many nearest ones, 3 to 1000.
    Nearest(u32),
    /// All within this distance, world units, > 0.
    Within(f64),
}

/// To which side normals point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Orient {
    /// To where the scanner stood; up where the scan does not know it.
    Scanner,
    /// Up.
    Up,
    /// To no side in particular.
    None,
    /// To this place, world coordinates.
    Towards([f64; 3]),
}

impl Derive {
    /// True if nothing is computed.
    pub fn is_nothing(&self) -> bool {
        self.normals.is_none() && !self.radius
    }

    /// True if an attribute of that name is computed.
    pub(crate) fn makes(&self, name: &str) -> bool {
        self.normals.is_some() && (NORMALS.contains(&name) || name == CURVATURE) || self.radius && name == RADIUS
    }

    /// True if what scans have under that name is not read.
    pub(crate) fn replaces(&self, name: &str) -> bool {
        self.makes(name) && (name == CURVATURE || self.normals == Some(DeriveNormals::Replace) && name != RADIUS)
    }

    /// Bytes of a point that it adds.
    pub(crate) fn bytes(&self) -> u64 {
        4 * self.names().count() as u64
    }

    /// The names of what is computed, in order.
    pub(crate) fn names(&self) -> impl Iterator<Item = &'static str> {
        NORMALS.into_iter().chain([CURVATURE, RADIUS]).filter(|name| self.makes(name))
    }
}

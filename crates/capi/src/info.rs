//! What a dataset says of itself, for C.

use std::ffi::c_char;
use std::mem::MaybeUninit;

use pointmill_format::{Aabb, AttributeType, DatasetKind};

use crate::border::{given, put};
use crate::dataset::{Content, PmDataset};
use crate::status::{Fault, PmStatus, guard};

/// The kinds of datasets.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PmKind {
    /// Potree 2.0, an octree.
    Potree2 = 1,
    /// Potree 1.4 to 1.8, an octree.
    Potree1 = 2,
    /// COPC 1.0, an octree.
    Copc = 3,
    /// A binary tree with all points in its leaves.
    Bintree = 4,
    /// Quantised batches.
    Batches = 5,
}

impl PmKind {
    fn of(kind: DatasetKind) -> Option<Self> {
        Some(match kind {
            DatasetKind::Potree2 => Self::Potree2,
            DatasetKind::Potree1 => Self::Potree1,
            DatasetKind::Copc => Self::Copc,
            DatasetKind::Bintree => Self::Bintree,
            DatasetKind::Batches => Self::Batches,
            _ => return None,
        })
    }
}

/// The type of an element of an attribute.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)] // the names say it
pub enum PmType {
    Int8 = 0,
    Uint8 = 1,
    Int16 = 2,
    Uint16 = 3,
    Int32 = 4,
    Uint32 = 5,
    Int64 = 6,
    Uint64 = 7,
    Float32 = 8,
    Float64 = 9,
}

impl PmType {
    fn of(ty: AttributeType) -> Self {
        match ty {
            AttributeType::Int8 => Self::Int8,
            AttributeType::UInt8 => Self::Uint8,
            AttributeType::Int16 => Self::Int16,
            AttributeType::UInt16 => Self::Uint16,
            AttributeType::Int32 => Self::Int32,
            AttributeType::UInt32 => Self::Uint32,
            AttributeType::Int64 => Self::Int64,
            AttributeType::UInt64 => Self::Uint64,
            AttributeType::Float32 => Self::Float32,
            AttributeType::Float64 => Self::Float64,
        }
    }
}

/// A box: the least and the greatest coordinates, world units, in the axes of the handle.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PmBox {
    /// x, y, z
    pub min: [f64; 3],
    /// x, y, z
    pub max: [f64; 3],
}

impl From<Aabb> for PmBox {
    fn from(bounds: Aabb) -> Self {
        Self { min: bounds.min, max: bounds.max }
    }
}

/// What is known of a dataset without reading points.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PmInfo {
    /// A value of PmKind.
    pub kind: PmKind,
    /// 1 if the dataset says how many points it has.
    pub has_points: u32,
    /// Points of the dataset; 0 if it does not say it.
    pub points: u64,
    /// Nodes that are known now: of an octree those of the chunks that were read. Of batches: slots.
    pub nodes: u32,
    /// Attributes; positions are not among them.
    pub attributes: u32,
    /// The box of the tree: of an octree its cube. All 0 of a dataset without points.
    pub bounds: PmBox,
    /// The box of the points, if the dataset says it, else `bounds`.
    pub tight: PmBox,
    /// 1 if `tight` is the box of the points.
    pub has_tight: u32,
    /// 1 if there are colours: pm_points_colours() works.
    pub has_colours: u32,
    /// Octrees: distance between points in the root, world units; halves with every level. Else 0.
    pub spacing: f64,
    /// Where the coordinates of the scans lie: whole numbers times `scale` plus `offset`. In the axes of the **file**.
    pub scale: [f64; 3],
    /// See `scale`.
    pub offset: [f64; 3],
    /// Binary trees: most points of a leaf. Batches: 10,240. Octrees: 0, there is no limit.
    pub node_capacity: u64,
    /// Batches: bits of a position on each axis that the file has, 10, 20 or 30. Else 0.
    pub bits: u32,
    /// Batches: 1 if sections are compressed, so that they cannot be mapped but are decoded batch by batch.
    pub is_compressed: u32,
    /// Batches: what records and decoded words are relative to, in the axes of the **file**. Else 0.
    pub grid_origin: [f64; 3],
    /// Batches: side of the cells of the coarsest level of detail, world units. Else 0.
    pub grid_cell: f64,
}

/// An attribute. The pointers are valid until pm_close().
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PmAttribute {
    /// UTF-8: "intensity", "rgb", "classification", "gps-time", …
    pub name: *const c_char,
    /// A value of PmType.
    pub element_type: PmType,
    /// Elements per point, at least 1.
    pub elements: u32,
    /// Bytes per point.
    pub size: u32,
    /// 0
    pub reserved: u32,
    /// Least raw value of each element, or NULL if the dataset does not say it. So is `max`.
    pub min: *const f64,
    /// Greatest raw value of each element, or NULL.
    pub max: *const f64,
    /// Factor from raw to meant values, for each element.
    pub scale: *const f64,
    /// Summand from raw to meant values, for each element.
    pub offset: *const f64,
}

impl PmDataset {
    fn info(&self) -> PmInfo {
        let about = &self.about;
        let bounds: PmBox = self.axes.bounds(&about.bounds).into();
        let mut info = PmInfo {
            kind: PmKind::of(about.kind).unwrap_or(PmKind::Potree2),
            has_points: about.points.is_some().into(),
            points: about.points.unwrap_or(0),
            nodes: self.node_count(),
            attributes: about.columns.len() as u32,
            bounds,
            tight: about.tight.map_or(bounds, |tight| self.axes.bounds(&tight).into()),
            has_tight: about.tight.is_some().into(),
            has_colours: about.colours().is_some().into(),
            spacing: about.spacing,
            scale: about.lattice.scale,
            offset: about.lattice.offset,
            node_capacity: 0,
            bits: 0,
            is_compressed: 0,
            grid_origin: [0.0; 3],
            grid_cell: 0.0,
        };
        match &self.content {
            Content::Octree(_) => {}
            Content::Bintree(leaves) => info.node_capacity = leaves.tree.header().capacity,
            Content::Batches(batches) => {
                let header = batches.header();
                info.node_capacity = pointmill_format::batches::BATCH_POINTS.into();
                info.bits = header.precision().bits();
                info.is_compressed = batches.is_compressed().into();
                info.grid_origin = header.grid.origin;
                info.grid_cell = header.grid.cell;
            }
        }
        info
    }
}

/// What is known of the dataset without reading points.
///
/// `*info` is overwritten. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_info(dataset: Option<&PmDataset>, info: Option<&mut MaybeUninit<PmInfo>>) -> PmStatus {
    guard(|| put(info, "info", given(dataset, "dataset")?.info()))
}

/// The format for people: "Potree 2.0". The text is valid until pm_close(); NULL of NULL. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_format(dataset: Option<&PmDataset>) -> *const c_char {
    dataset.map_or(std::ptr::null(), |dataset| dataset.about.format.as_ptr())
}

/// The coordinate reference system as the dataset has it: mostly a proj4 definition, empty if it names none. The text is
/// valid until pm_close(); NULL of NULL. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_projection(dataset: Option<&PmDataset>) -> *const c_char {
    dataset.map_or(std::ptr::null(), |dataset| dataset.about.projection.as_ptr())
}

/// Attribute `index` of PmInfo::attributes. Its index is what pm_points_attribute() takes.
///
/// Of batches the first is "colour": words of red, green, blue and level of detail, the lowest byte first. Of binary trees
/// it is "classification", a float.
///
/// `*attribute` is overwritten; its pointers are valid until pm_close(). Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_attribute(
    dataset: Option<&PmDataset>,
    index: u32,
    attribute: Option<&mut MaybeUninit<PmAttribute>>,
) -> PmStatus {
    guard(|| {
        let columns = &given(dataset, "dataset")?.about.columns;
        let column = columns.get(index as usize).ok_or_else(|| no_attribute(index, columns.len()))?;
        let values = |values: &[f64]| if values.is_empty() { std::ptr::null() } else { values.as_ptr() };
        let of = &column.attribute;
        let value = PmAttribute {
            name: column.name.as_ptr(),
            element_type: PmType::of(of.ty),
            elements: of.elements as u32,
            size: of.size() as u32,
            reserved: 0,
            min: values(&column.min),
            max: values(&column.max),
            scale: values(&of.scale),
            offset: values(&of.offset),
        };
        put(attribute, "attribute", value)
    })
}

pub(crate) fn no_attribute(index: u32, count: usize) -> Fault {
    Fault::argument(format!("attribute {index} was requested, there are {count}"))
}

#[cfg(test)]
mod tests {
    use std::ffi::CStr;
    use std::mem::MaybeUninit;

    use super::*;
    use crate::axes::PmAxes;
    use crate::test_help::open;

    fn attribute(dataset: &PmDataset, index: u32) -> Result<PmAttribute, PmStatus> {
        let mut out = MaybeUninit::uninit();
        match pm_attribute(Some(dataset), index, Some(&mut out)) {
            // SAFETY: written after success
            PmStatus::Ok => Ok(unsafe { out.assume_init() }),
            status => Err(status),
        }
    }

    #[test]
    fn boxes_are_in_the_axes_of_the_handle() {
        let (z_up, y_up) = (open("potree2/default", PmAxes::ZUp).info(), open("potree2/default", PmAxes::YUp).info());
        assert_eq!(z_up.has_tight, 1);
        assert_eq!(y_up.tight.min, [z_up.tight.min[0], z_up.tight.min[2], -z_up.tight.max[1]]);
        assert_eq!(y_up.scale, z_up.scale);
    }

    #[test]
    fn attributes_have_the_ranges_of_the_metadata() {
        let dataset = open("potree2/default", PmAxes::ZUp);
        let count = dataset.about.columns.len() as u32;
        let of = attribute(&dataset, 0).unwrap();
        // SAFETY: the dataset is open
        let name = unsafe { CStr::from_ptr(of.name) };
        let column = &dataset.about.columns[0];
        assert_eq!(name.to_str().unwrap(), column.attribute.name);
        // SAFETY: the dataset is open, and it has a range
        assert_eq!(unsafe { [*of.min, *of.max] }, [column.min[0], column.max[0]]);
        assert_eq!(attribute(&dataset, count).unwrap_err(), PmStatus::Argument);
    }

    #[test]
    fn null_is_refused() {
        assert_eq!(pm_info(None, Some(&mut MaybeUninit::uninit())), PmStatus::Argument);
        assert_eq!(pm_info(Some(&open("bintree/packed", PmAxes::ZUp)), None), PmStatus::Argument);
        assert_eq!(pm_attribute(None, 0, None), PmStatus::Argument);
        assert!(pm_format(None).is_null() && pm_projection(None).is_null());
    }
}

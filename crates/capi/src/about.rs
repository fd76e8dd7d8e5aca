//! What a dataset says of itself, for every kind in the same form.

use std::ffi::CString;

use pointmill_format::batches::{Batches, MappedFile};
use pointmill_format::bintree::Bintree;
use pointmill_format::octree::OctreeInfo;
use pointmill_format::{Aabb, Attribute, AttributeType, DatasetKind, Lattice, copc, potree1, potree2};

use crate::status::c_text;

/// A column, and what its values are like.
#[derive(Debug)]
pub(crate) struct ColumnAbout {
    pub(crate) attribute: Attribute,
    pub(crate) name: CString,
    /// Raw, of each element; empty if the dataset does not say it. So is `max`.
    pub(crate) min: Vec<f64>,
    pub(crate) max: Vec<f64>,
}

/// What is known without reading a point.
#[derive(Debug)]
pub(crate) struct About {
    pub(crate) kind: DatasetKind,
    pub(crate) format: CString,
    pub(crate) projection: CString,
    pub(crate) points: Option<u64>,
    /// Of the tree: an octree's cube.
    pub(crate) bounds: Aabb,
    /// Of the points, if it is known.
    pub(crate) tight: Option<Aabb>,
    /// Of the root of an octree; else 0.
    pub(crate) spacing: f64,
    /// Where the positions of the scans lie.
    pub(crate) lattice: Lattice,
    pub(crate) columns: Vec<ColumnAbout>,
}

impl About {
    fn of_octree(kind: DatasetKind, info: &OctreeInfo, lattice: Lattice) -> Self {
        Self {
            kind,
            format: c_text(info.format.as_str()),
            projection: c_text(info.projection.as_str()),
            points: info.points,
            bounds: info.cube,
            tight: None,
            spacing: info.spacing,
            lattice,
            columns: info.attributes.iter().cloned().map(ColumnAbout::new).collect(),
        }
    }

    pub(crate) fn of_potree2(info: &OctreeInfo, metadata: &potree2::Metadata) -> Self {
        let mut about = Self::of_octree(DatasetKind::Potree2, info, metadata.lattice);
        for stats in &metadata.attributes {
            if let Some(column) = about.columns.iter_mut().find(|c| c.attribute.name == stats.attribute.name) {
                column.set_range(&stats.min, &stats.max);
            }
        }
        let position = metadata.position_index().and_then(|i| metadata.attributes.get(i));
        let corner = |values: &[f64]| <[f64; 3]>::try_from(values).ok();
        let tight = position.and_then(|stats| Some(Aabb { min: corner(&stats.min)?, max: corner(&stats.max)? }));
        about.tight = tight.filter(|tight| !tight.is_empty());
        about
    }

    pub(crate) fn of_potree1(info: &OctreeInfo, metadata: &potree1::Metadata) -> Self {
        let lattice = Lattice { scale: [metadata.scale; 3], offset: metadata.cube.min };
        Self { tight: metadata.tight_box, ..Self::of_octree(DatasetKind::Potree1, info, lattice) }
    }

    pub(crate) fn of_copc(info: &OctreeInfo, dataset: &copc::Dataset) -> Self {
        let mut about = Self::of_octree(DatasetKind::Copc, info, dataset.lattice());
        about.tight = dataset.bounds_declared();
        about.points = about.points.or(Some(dataset.points_declared()));
        about
    }

    pub(crate) fn of_bintree(tree: &Bintree) -> Self {
        let header = tree.header();
        let class = Attribute::new("classification", AttributeType::Float32, 1);
        let extras = header.record.extras().iter().map(|extra| extra.attribute.clone());
        let bounds = tree.node(0).map(|root| root.bounds);
        Self {
            kind: DatasetKind::Bintree,
            format: c_text(DatasetKind::Bintree.title()),
            projection: c_text(header.projection.as_str()),
            points: Some(header.points),
            bounds: bounds.unwrap_or(NOWHERE),
            tight: bounds,
            spacing: 0.0,
            lattice: header.lattice,
            columns: std::iter::once(class).chain(extras).map(ColumnAbout::new).collect(),
        }
    }

    pub(crate) fn of_batches(batches: &Batches<MappedFile>) -> Self {
        let (header, description) = (batches.header(), batches.description());
        let mut columns = vec![ColumnAbout::new(Attribute::new(COLOUR_WORDS, AttributeType::UInt32, 1))];
        for attribute in batches.attributes() {
            let mut column = ColumnAbout::new(attribute.clone());
            if let Some(entry) = description.attributes.iter().find(|entry| entry.name == attribute.name) {
                column.set_range(&entry.min, &entry.max);
            }
            columns.push(column);
        }
        Self {
            kind: DatasetKind::Batches,
            format: c_text(DatasetKind::Batches.title()),
            projection: c_text(description.projection.as_str()),
            points: Some(header.points),
            bounds: header.tight,
            tight: (header.points > 0).then_some(header.tight),
            spacing: 0.0,
            lattice: description.lattice.into(),
            columns,
        }
    }

    /// Where the colours are, if there are any.
    pub(crate) fn colours(&self) -> Option<Colours> {
        let find = |name: &str, types: &[AttributeType], elements: usize| {
            let is = |a: &Attribute| a.name == name && types.contains(&a.ty) && a.elements >= elements;
            self.columns.iter().position(|column| is(&column.attribute))
        };
        let words = find(COLOUR_WORDS, &[AttributeType::UInt32], 1).filter(|_| self.kind == DatasetKind::Batches);
        let column = words
            .or_else(|| find("rgba", &[AttributeType::UInt8], 4)) // 8 bits that the converter chose
            .or_else(|| find("rgb", &[AttributeType::UInt8, AttributeType::UInt16], 3))?;
        let about = self.columns.get(column)?;
        let depth = match about.attribute.ty {
            AttributeType::UInt16 if about.max.is_empty() => Depth::Unknown,
            AttributeType::UInt16 if about.max.iter().any(|max| *max > 255.0) => Depth::Sixteen,
            _ => Depth::Eight,
        };
        Some(Colours { column, depth })
    }
}

/// The column of batches that has colours and levels of detail.
const COLOUR_WORDS: &str = "colour";

/// The box of nothing.
const NOWHERE: Aabb = Aabb { min: [0.0; 3], max: [0.0; 3] };

/// Where colours are, and how many bits their values use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Colours {
    pub(crate) column: usize,
    pub(crate) depth: Depth,
}

/// Bits of the values of colours, whatever type they are stored in: some programs store 8 bits in 16.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Depth {
    Eight,
    Sixteen,
    /// The dataset does not say it: points are to be looked at.
    Unknown,
}

impl ColumnAbout {
    fn new(attribute: Attribute) -> Self {
        Self { name: c_text(attribute.name.as_str()), attribute, min: Vec::new(), max: Vec::new() }
    }

    /// Ignores a range that is not there for each element.
    fn set_range(&mut self, min: &[f64], max: &[f64]) {
        if min.len() == self.attribute.elements && max.len() == self.attribute.elements {
            (self.min, self.max) = (min.to_vec(), max.to_vec());
        }
    }
}

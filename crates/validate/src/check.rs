//! The requirements of the formats.

use pointmill_format::DatasetKind;
use serde::{Serialize, Serializer};

/// A requirement of a format. [`Check::of`] has those of a format in the order of reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs)] // see `promise`
pub enum Check {
    Metadata,
    Hierarchy,
    NodeTypes,
    EmptyNodes,
    Depth,
    PointCount,
    PayloadRanges,
    Payloads,
    Order,
    Coordinates,
    Boxes,
    TightBox,
    AttributeRanges,
    Histogram,
    Spacing,
    Seams,
    Coverage,
    Index,
    LeafFiles,
    Capacity,
    Unions,
    LeafBoxes,
    Values,
    Padding,
    Positions,
    LeafOrder,
    SplitAxis,
    Split,
    Sides,
    Degenerate,
    Against,
    Accuracy,
    Header,
    Sections,
    Description,
    BatchRecords,
    Blocks,
    PlaneWords,
    Quantisation,
    BatchBoxes,
    StorageOrder,
    Levels,
    Colours,
    Originals,
    Errors,
    Cloud,
    IndexFiles,
    NodeFiles,
    NodeCounts,
    Records,
    OctreeInfo,
    Pages,
    Chunks,
    Returns,
    GpsTime,
    ColourDepth,
    Report,
    Normals,
    Curvature,
    Radii,
    Surfels,
}

impl Check {
    /// Checks of all formats together; [`Self::index`] is below it.
    pub(crate) const COUNT: usize = Self::Surfels as usize + 1;

    /// The checks of attributes that the conversion has computed (`docs/surfels.md`): of datasets of all kinds, behind those
    /// of [`Self::of`], where the report of the conversion says that there are such attributes.
    pub const DERIVED: &[Self] = &[Self::Normals, Self::Curvature, Self::Radii, Self::Surfels];

    /// The checks of every dataset of that kind, in the order of reports.
    pub const fn of(kind: DatasetKind) -> &'static [Self] {
        match kind {
            DatasetKind::Potree2 => Self::POTREE2,
            DatasetKind::Potree1 => Self::POTREE1,
            DatasetKind::Bintree => Self::BINTREE,
            DatasetKind::Batches => Self::BATCHES,
            DatasetKind::Copc => Self::COPC,
            _ => &[],
        }
    }

    /// The checks of Potree 2.0.
    pub(crate) const POTREE2: &[Self] = &[
        Self::Metadata,
        Self::Hierarchy,
        Self::NodeTypes,
        Self::EmptyNodes,
        Self::Depth,
        Self::PointCount,
        Self::PayloadRanges,
        Self::Payloads,
        Self::Order,
        Self::Coordinates,
        Self::Boxes,
        Self::TightBox,
        Self::AttributeRanges,
        Self::Histogram,
        Self::Spacing,
        Self::Seams,
        Self::Coverage,
        Self::Against,
        Self::Report,
        Self::Accuracy,
    ];

    /// The checks of Potree 1.x.
    pub(crate) const POTREE1: &[Self] = &[
        Self::Cloud,
        Self::IndexFiles,
        Self::NodeFiles,
        Self::EmptyNodes,
        Self::NodeCounts,
        Self::PointCount,
        Self::Payloads,
        Self::Coordinates,
        Self::Boxes,
        Self::TightBox,
        Self::Spacing,
        Self::Seams,
        Self::Coverage,
        Self::Against,
        Self::Report,
        Self::Accuracy,
    ];

    /// The checks of mean-split binary trees.
    pub(crate) const BINTREE: &[Self] = &[
        Self::Index,
        Self::LeafFiles,
        Self::Capacity,
        Self::Unions,
        Self::LeafBoxes,
        Self::Values,
        Self::Padding,
        Self::Positions,
        Self::LeafOrder,
        Self::SplitAxis,
        Self::Split,
        Self::Sides,
        Self::Degenerate,
        Self::Against,
        Self::Report,
        Self::Accuracy,
    ];

    /// The checks of quantised batches.
    pub(crate) const BATCHES: &[Self] = &[
        Self::Header,
        Self::Sections,
        Self::Description,
        Self::BatchRecords,
        Self::Blocks,
        Self::PlaneWords,
        Self::Quantisation,
        Self::BatchBoxes,
        Self::TightBox,
        Self::StorageOrder,
        Self::Levels,
        Self::Colours,
        Self::Originals,
        Self::Errors,
        Self::AttributeRanges,
        Self::Against,
        Self::Report,
        Self::Accuracy,
    ];

    /// The checks of COPC.
    pub(crate) const COPC: &[Self] = &[
        Self::Header,
        Self::Records,
        Self::OctreeInfo,
        Self::Pages,
        Self::PointCount,
        Self::Chunks,
        Self::Payloads,
        Self::Boxes,
        Self::TightBox,
        Self::Returns,
        Self::GpsTime,
        Self::ColourDepth,
        Self::AttributeRanges,
        Self::Spacing,
        Self::Seams,
        Self::Coverage,
        Self::Against,
        Self::Report,
        Self::Accuracy,
    ];

    /// Its place among all checks.
    pub(crate) const fn index(self) -> usize {
        self as usize
    }

    /// The word in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Metadata => "metadata",
            Self::Hierarchy => "hierarchy",
            Self::NodeTypes => "node-types",
            Self::EmptyNodes => "empty-nodes",
            Self::Depth => "depth",
            Self::PointCount => "point-count",
            Self::PayloadRanges => "payload-ranges",
            Self::Payloads => "payloads",
            Self::Order => "order",
            Self::Coordinates => "coordinates",
            Self::Boxes => "boxes",
            Self::TightBox => "tight-box",
            Self::AttributeRanges => "attribute-ranges",
            Self::Histogram => "histogram",
            Self::Spacing => "spacing",
            Self::Seams => "seams",
            Self::Coverage => "coverage",
            Self::Index => "index",
            Self::LeafFiles => "leaf-files",
            Self::Capacity => "capacity",
            Self::Unions => "unions",
            Self::LeafBoxes => "leaf-boxes",
            Self::Values => "values",
            Self::Padding => "padding",
            Self::Positions => "positions",
            Self::LeafOrder => "leaf-order",
            Self::SplitAxis => "split-axis",
            Self::Split => "split",
            Self::Sides => "sides",
            Self::Degenerate => "degenerate",
            Self::Against => "against",
            Self::Accuracy => "accuracy",
            Self::Header => "header",
            Self::Sections => "sections",
            Self::Description => "description",
            Self::BatchRecords => "batch-records",
            Self::Blocks => "blocks",
            Self::PlaneWords => "plane-words",
            Self::Quantisation => "quantisation",
            Self::BatchBoxes => "batch-boxes",
            Self::StorageOrder => "order",
            Self::Levels => "levels",
            Self::Colours => "colours",
            Self::Originals => "originals",
            Self::Errors => "errors",
            Self::Cloud => "cloud",
            Self::IndexFiles => "index-files",
            Self::NodeFiles => "node-files",
            Self::NodeCounts => "node-counts",
            Self::Records => "records",
            Self::OctreeInfo => "info",
            Self::Pages => "pages",
            Self::Chunks => "chunks",
            Self::Returns => "returns",
            Self::GpsTime => "gps-time",
            Self::ColourDepth => "colour-depth",
            Self::Report => "report",
            Self::Normals => "normals",
            Self::Curvature => "curvature",
            Self::Radii => "radii",
            Self::Surfels => "surfels",
        }
    }

    /// The requirement, in one line.
    pub const fn promise(self) -> &'static str {
        match self {
            Self::Metadata => "metadata.json is complete, in range and consistent",
            Self::Hierarchy => {
                "every hierarchy chunk holds exactly its records; chunks are disjoint and none is orphaned"
            }
            Self::NodeTypes => "a node is of type 0 exactly if it has children",
            Self::EmptyNodes => "no node is empty",
            Self::Depth => "hierarchy.depth is the deepest level that has a node",
            Self::PointCount => "the points of all nodes add up to points",
            Self::PayloadRanges => "payloads have the right size, do not overlap and cover octree.bin",
            Self::Payloads => "every payload decodes to exactly its points",
            Self::Order => "points of a BROTLI node are sorted by Morton code",
            Self::Coordinates => "stored coordinates are 0 or more and below 2^31",
            Self::Boxes => "every point lies in the box of its node",
            Self::TightBox => "min and max of position are the tight box of the points",
            Self::AttributeRanges => "min and max of every attribute bound its values and are attained",
            Self::Histogram => "histograms count the values that are there",
            Self::Spacing => "inner nodes are sampled as stated: no pair closer than the spacing of the level",
            Self::Seams => "neighbouring inner nodes keep the spacing between them, too: no doubled planes",
            Self::Coverage => "no hole: every point is within two spacings of a point drawn at each level above it",
            Self::Index => "index.json is complete, in range and consistent",
            Self::LeafFiles => "leaves have the right size, do not overlap, and no file or byte belongs to none",
            Self::Capacity => "no leaf has more points than the capacity, and every other node does",
            Self::Unions => "the box of an inner node is the union of its children's",
            Self::LeafBoxes => "the box of a leaf is exactly that of its decoded points",
            Self::Values => "classes are whole numbers, rgba is opaque and the colour of rgb",
            Self::Padding => "bytes that belong to no column are zero",
            Self::Positions => "every decoded position is as near to its lattice point as single precision gets",
            Self::LeafOrder => "points of a leaf are in Morton order, those of one place in the order of their bytes",
            Self::SplitAxis => "every node is split along its longest axis, of equal ones the lowest",
            Self::Split => "every split is the exact mean (median, midpoint) of the points below",
            Self::Sides => "the low side is at the plane or below, the high side above",
            Self::Degenerate => "points of one place, and no others, are cut by number",
            Self::Against => "every point and attribute of the sources is in the dataset exactly once",
            Self::Accuracy => "the report of the conversion states the errors of decoded positions as they are",
            Self::Header => "the header is in range and agrees with itself",
            Self::Sections => {
                "sections are in order on multiples of 256 bytes, zeros between them, nothing behind them"
            }
            Self::Description => "the description is complete and agrees with header and sections",
            Self::BatchRecords => "batches have the points, the first point and a box that their slot asks for",
            Self::Blocks => "every compressed block is one zstd frame of exactly its batches",
            Self::PlaneWords => "bits 30 and 31 of all plane words are 0",
            Self::Quantisation => "every position is that of a point of the source's lattice, encoded in its box",
            Self::BatchBoxes => "batch boxes are float32, rounded outwards, and tight on each face",
            Self::StorageOrder => "points ascend by Morton code, X, Y, Z, colour, attributes once the swap is undone",
            Self::Levels => "exactly the points nearest to the centres of cells of level 0, 1, 2 have that level",
            Self::Colours => "points below level 3 show the mean of their cell, greys follow from intensities",
            Self::Originals => "originals ascend and are those of points below level 3 that show another colour",
            Self::Cloud => "cloud.js is complete, in range and consistent",
            Self::IndexFiles => {
                "every index file holds exactly its records; nodes at a border are in both files, the same"
            }
            Self::NodeFiles => "every node has a file of whole records, and no other file is there",
            Self::NodeCounts => "the index states as many points of a node as its file holds",
            Self::Records => "records are whole, the info record is the first, and LASzip's has what the header says",
            Self::OctreeInfo => {
                "the info record has a cube that holds the bounds, a spacing, and zeros behind its fields"
            }
            Self::Pages => "hierarchy pages are disjoint, and every node is in them once, with its parent",
            Self::Chunks => "every chunk is that of one node, without gaps, and the chunk table says the same of it",
            Self::Returns => "the header counts the points of every return",
            Self::GpsTime => "the GPS times of the info record bound those of the points and are attained",
            Self::ColourDepth => "colours have 16 bits",
            Self::Report => "the report of the conversion names this dataset, with its points and nodes",
            Self::Normals => {
                "normals have length 1, or 0 where the report counts them, and point up or to a place if asked to"
            }
            Self::Curvature => "curvatures are from 0 to 1/3",
            Self::Radii => "radii are finite and 0 or more; the report counts those of 0",
            Self::Surfels => "normals, curvatures and radii of a sample are those of the points around",
            Self::Errors => "largest and rms errors are attained, none is above half a cell",
        }
    }
}

impl Serialize for Check {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn no_format_has_two_checks_of_one_name_and_every_check_serves_a_format() {
        for &format in DatasetKind::ALL {
            let all = || Check::of(format).iter().chain(Check::DERIVED);
            let names: BTreeSet<_> = all().map(|c| c.name()).collect();
            assert_eq!(names.len(), all().count(), "{format}");
        }
        let all = DatasetKind::ALL.iter().flat_map(|f| Check::of(*f)).chain(Check::DERIVED);
        let used: BTreeSet<_> = all.map(|c| c.index()).collect();
        assert!(used.into_iter().eq(0..Check::COUNT));
    }
}

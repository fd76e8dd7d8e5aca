//! What a validation found: findings by check, and figures of quality by format.

use pointmill_format::DatasetKind;
use serde::Serialize;

use crate::accuracy::Accuracy;
use crate::check::Check;
use crate::finding::{CheckResult, Finding, Findings};

/// What a validation found. Serialises to the object of `validate --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// No check found an error.
    pub ok: bool,
    /// Which format was found.
    pub format: DatasetKind,
    /// Encoding of the payloads or layout of the files, if the metadata could be read.
    pub encoding: Option<&'static str>,
    /// Points by the metadata.
    pub points: u64,
    /// Nodes that were reached from the root; batches.
    pub nodes: u64,
    /// One entry for each of [`Check::of`], in that order, then of [`Check::DERIVED`] where the conversion has computed
    /// attributes.
    pub checks: Vec<CheckResult>,
    /// Findings, by check, at most [`crate::Options::max_problems`] each; errors before warnings, coarse or early places
    /// before others.
    pub problems: Vec<Finding>,
    /// One entry per level of an octree; empty for other formats.
    pub quality: Vec<LevelQuality>,
    /// Of an octree: what a viewer loads at first.
    pub first_view: Option<FirstView>,
    /// Of a binary tree whose index could be read.
    pub leaves: Option<LeafQuality>,
    /// The comparison with the sources, if there was one.
    pub against: Option<AgainstSummary>,
    /// Of attributes that the conversion has computed, if a sample of them was computed again.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surfels: Option<SurfelSummary>,
    /// How far decoded positions are from those of the sources, as far as it could be measured.
    pub accuracy: Accuracy,
}

impl Outcome {
    /// What the checks found; nothing else is known yet.
    pub(crate) fn new(findings: Findings) -> Self {
        let format = findings.format();
        let (checks, problems) = findings.finish();
        Self {
            ok: checks.iter().all(|c| c.ok),
            format,
            encoding: None,
            points: 0,
            nodes: 0,
            checks,
            problems,
            quality: Vec::new(),
            first_view: None,
            leaves: None,
            against: None,
            surfels: None,
            accuracy: Accuracy::default(),
        }
    }

    /// The account of a check; `None` if the format does not have it.
    pub fn check(&self, check: Check) -> Option<&CheckResult> {
        self.checks.iter().find(|c| c.name == check)
    }
}

/// What the comparison with the sources found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AgainstSummary {
    /// Files compared with.
    pub sources: usize,
    /// Points that the sources hold after the filters recorded in the dataset.
    pub points_expected: u64,
    /// Points of the dataset.
    pub points_found: u64,
    /// Sum of the hashes of the expected records, hexadecimal; the set's under `duplicates: drop`.
    pub sum_expected: String,
    /// Sum of the hashes of the dataset's records, hexadecimal.
    pub sum_found: String,
    /// Attributes of the sources that the dataset does not have, so they were not compared.
    pub attributes_not_in_dataset: Vec<String>,
}

/// How normals, curvatures and radii of a sample of points differ from those that were computed again.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct SurfelSummary {
    /// Points of the sample.
    pub points: u64,
    /// Those whose neighbourhood or normal is one of several that fit: normal and curvature were not judged.
    pub ambiguous: u64,
    /// Normals that were compared.
    pub normals: u64,
    /// The largest angle between one and the right one, as lines, degrees; here and below `None`: none was compared.
    pub largest_angle: Option<f64>,
    /// The largest difference of curvatures.
    pub largest_curvature: Option<f64>,
    /// The largest difference of radii, relative to the right ones.
    pub largest_radius: Option<f64>,
}

/// Quality of one level of the octree. Distances are relative to the spacing of the level.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LevelQuality {
    /// 0 for the root.
    pub level: u8,
    /// Nodes of the level.
    pub nodes: u64,
    /// Those with children.
    pub inner_nodes: u64,
    /// Points of all its nodes.
    pub points: u64,
    /// Spacing of the level, world units.
    pub spacing: f64,
    /// Points of inner nodes.
    pub sampled: u64,
    /// Smallest distance from a point of an inner node to another point of that node, over the spacing.
    pub nearest_min: Option<f64>,
    /// Mean of the distance from each point of an inner node to the nearest other point of that node, over the
    /// spacing; points without one within 8 spacings are not counted (`isolated`).
    pub nearest_mean: Option<f64>,
    /// Median of the distance from each point of an inner node to the nearest other point of any inner node of the level,
    /// over the spacing, to 0.001; of points that have one within 8 spacings.
    pub nearest_median: Option<f64>,
    /// Points of inner nodes that have no other point of their node within 8 spacings.
    pub isolated: u64,
    /// Points of inner nodes that have another one of an inner node of the level nearer than 0.999 spacings.
    pub close: u64,
    /// Points that have one of the same node so near.
    pub close_inside: u64,
    /// Points that have one of another node so near.
    pub close_across: u64,
    /// The largest distance from any point of deeper levels to the nearest point drawn at this level and above, over
    /// the spacing; 4 stands for 4 and more.
    pub largest_hole: Option<f64>,
    /// Points of the next level, from which this one took its sample, without those that are the only ones of an inner
    /// node.
    pub offered: u64,
    /// How many of them are within the spacing of a point drawn at this level and above.
    pub offered_within_1: u64,
    /// Points of deeper levels, without those that are the only ones of an inner node.
    pub below: u64,
    /// How many of them are within the spacing of such a point.
    pub below_within_1: u64,
    /// How many of them are within one and a half spacings.
    pub below_within_1_5: u64,
    /// Smallest distance between points of different inner nodes of this level, over the spacing, where it is at
    /// most 2.
    pub seam_min: Option<f64>,
    /// Points of inner nodes that have a point of another inner node of this level within 2 spacings.
    pub seam_points: u64,
    /// Of those, how many have it closer than the spacing (less one lattice step): what shows as a dense line.
    pub seam_close: u64,
}

/// What a viewer has to load until a cloud that it looks at as a whole shows a million points, or all. Nodes are taken by
/// level, in a level those with most points first.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FirstView {
    /// Points of the root, the first picture. 10,000 to 25,000 are good: enough to see something, and soon there.
    pub root_points: u64,
    /// Side of the cube over the longest side of the box around the points: viewers frame the cube. Ideal: 1.
    pub cube_over_extent: Option<f64>,
    /// Bytes of the first hierarchy chunk.
    pub first_chunk_bytes: u64,
    /// Points that are there then.
    pub points: u64,
    /// Nodes that hold them.
    pub nodes: u64,
    /// Requests: the metadata, hierarchy chunks, nodes.
    pub requests: u64,
    /// Bytes of their answers.
    pub bytes: u64,
}

/// How large the leaves of a binary tree are, and how exact.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct LeafQuality {
    /// Leaves of the tree.
    pub leaves: u64,
    /// Points of the smallest leaf.
    pub points_min: u64,
    /// Points of a leaf on average.
    pub points_mean: f64,
    /// Points of the largest leaf.
    pub points_max: u64,
    /// Depth of the deepest leaf; the root is at 0.
    pub depth: usize,
    /// Volumes of the boxes of all leaves together, cubic world units.
    pub volume: f64,
    /// The largest distance on an axis between a decoded position and its lattice point, world units; over the leaves
    /// whose integers are certain.
    pub largest_error: f64,
    /// The largest distance that single precision allows in any of these leaves, world units.
    pub largest_bound: f64,
    /// Leaves that are too long for the integers of their points to be certain.
    pub uncertain: u64,
}

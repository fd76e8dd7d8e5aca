//! What was asked of the conversion, as the dataset's metadata records it, applied by own code.

use std::fmt;
use std::sync::Arc;

use pointmill_format::{Aabb, Attribute, AxisGrid, Lattice};
use serde_json::Value;

use super::block::Block;
use super::follows::Follows;

/// Meaning of 16-bit colours of the sources.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RgbDepth {
    /// A file whose values are all ≤ 255 has them stored times 257.
    Auto,
    /// Stored times 257.
    Eight,
    /// Stored as they are.
    Sixteen,
}

/// How many bits of a channel a dataset has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Channels {
    /// All 16.
    Wide,
    /// 8: the value v becomes (v · 255 + 32767) / 65535.
    Rounded,
    /// The upper 8.
    Upper,
}

impl Channels {
    /// What is stored of a value of 16 bits.
    pub(super) const fn of(self, v: u64) -> u64 {
        match self {
            Self::Wide => v,
            Self::Rounded => (v * 255 + 32_767) / 65_535,
            Self::Upper => v >> 8,
        }
    }
}

/// Positions that a dataset stores so coarsely that its lattice's integers do not come back: records are compared by
/// what has to be stored for an integer position then.
pub(crate) trait StoredPositions: fmt::Debug + Send + Sync {
    /// What stands for the lattice point `step`: three words, equal exactly if what is stored is.
    fn stored(&self, step: [i64; 3]) -> [i64; 3];

    /// World coordinates of what is stored.
    fn world(&self, stored: [i64; 3]) -> [f64; 3];
}

/// How values of a source's column become those of the dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Conversion {
    /// They are the same.
    AsStored,
    /// A class as a float: rounded to a whole number; 0 where there is none, it is not finite or beyond ±2²⁴.
    WholeClass,
    /// An angle in the steps of LAS formats 6 to 10, 0.006 degrees: the nearest to what is meant.
    FineAngle,
    /// Values are not those of the sources, but computed, or of a field that every record has: they are not compared.
    NotWritten,
    /// The grey of an integer among values from the first to the second number:
    /// ((v − lo) · 255 + (hi − lo) / 2) / (hi − lo), and 255 if they are the same.
    Grey([u64; 2]),
}

/// How the records of the sources become those of the dataset.
#[derive(Debug, Clone)]
pub(crate) struct Rules {
    /// The dataset's attributes beside the position, in order.
    pub(crate) attributes: Vec<Attribute>,
    /// One for each of `attributes`.
    pub(crate) conversions: Vec<Conversion>,
    /// 64-bit integers are stored as doubles, those beyond 2⁵³ rounded.
    pub(crate) has_no_wide_integers: bool,
    /// Where `rgb` (uint16 × 3) stands among them.
    pub(crate) rgb: Option<usize>,
    /// What becomes of each 16-bit value of the rules below.
    pub(crate) channels: Channels,
    /// False if the integers of a dataset are not known: every position then counts as 0.
    pub(crate) compare_positions: bool,
    /// The dataset's lattice.
    pub(crate) lattice: Lattice,
    /// Blocks have these instead of integers on the lattice.
    pub(crate) stored: Option<Arc<dyn StoredPositions>>,
    /// World coordinate of the job lattice's integer 0.
    lattice_offset: [f64; 3],
    /// The job lattice's coordinate of the dataset's integer 0.
    pub(crate) shift: [i64; 3],
    pub(crate) rgb_depth: RgbDepth,
    /// Channels of 1 to 127 are stored as 0, those of 128 to 255 as 256.
    pub(crate) rounds_dark: bool,
    /// World coordinates, closed.
    pub(crate) bounds: Option<Aabb>,
    pub(crate) classes: Option<Vec<i64>>,
    /// Indices in the file that are multiples of it; 1: all.
    pub(crate) every: u64,
    /// Points exactly at the origin of their scan are not in the dataset.
    pub(crate) skips_origin: bool,
    /// Equal records count once.
    pub(crate) drop_duplicates: bool,
    /// Not written by pointmill: known deviations of other converters are tried too.
    pub(crate) foreign: bool,
    /// Attributes that were not written because they have one value throughout: name and that value.
    pub(crate) constants: Vec<(String, Vec<f64>)>,
    /// Those that were not written because they follow from others.
    pub(crate) follows: Vec<Follows>,
    /// Attributes that the conversion has computed; see [`Self::set_apart`].
    pub(super) derived: Vec<&'static str>,
}

impl Rules {
    /// `attributes`: those to compare, beside the position. `lattice`: of the dataset's integer positions. `own`:
    /// pointmill's own key of the metadata, null if it is not there.
    pub(crate) fn new(mut attributes: Vec<Attribute>, lattice: Lattice, own: &Value) -> Self {
        rename_back(&mut attributes, &own["attributesRenamed"]);
        let rgb = attributes.iter().position(|a| a.name == "rgb" && a.elements == 3);
        let lattice_offset = vector(&own["latticeOffset"]).unwrap_or(lattice.offset);
        let shift = [0, 1, 2].map(|a| ((lattice.offset[a] - lattice_offset[a]) / lattice.scale[a]).round() as i64);
        let bounds = match numbers(&own["filter"]["bounds"]).as_deref() {
            Some(&[x0, y0, z0, x1, y1, z1]) => Some(Aabb { min: [x0, y0, z0], max: [x1, y1, z1] }),
            _ => None,
        };
        let classes = numbers(&own["filter"]["classes"]).map(|c| c.iter().map(|v| *v as i64).collect());
        Self {
            conversions: vec![Conversion::AsStored; attributes.len()],
            attributes,
            has_no_wide_integers: false,
            rgb,
            channels: Channels::Wide,
            compare_positions: true,
            lattice,
            stored: None,
            lattice_offset,
            shift,
            rgb_depth: match own["rgbDepth"].as_str() {
                Some("8") => RgbDepth::Eight,
                Some("16") => RgbDepth::Sixteen,
                _ => RgbDepth::Auto,
            },
            rounds_dark: own["darkColours"] == "round",
            bounds,
            classes,
            every: own["filter"]["every"].as_u64().unwrap_or(1).max(1),
            skips_origin: own["filter"]["originPoints"] == "skip",
            drop_duplicates: own["duplicates"] == "drop",
            foreign: own.is_null(),
            constants: constants(&own["attributesDropped"]),
            follows: Follows::list(&own["attributesOmitted"]),
            derived: Vec::new(),
        }
    }

    /// Compares none of these attributes, which the conversion has computed, with the sources.
    pub(crate) fn set_apart(&mut self, derived: Vec<&'static str>) {
        let is_derived = |name: &str| derived.contains(&name);
        for (attribute, conversion) in self.attributes.iter().zip(&mut self.conversions) {
            if is_derived(&attribute.name) {
                *conversion = Conversion::NotWritten;
            }
        }
        self.constants.retain(|(name, _)| !is_derived(name));
        self.follows.retain(|rule| !is_derived(&rule.name));
        self.derived = derived;
    }

    /// Makes words of records of the dataset 0 that are not compared, as they are of those of the sources.
    pub(super) fn mask(&self, block: &mut Block) {
        let words = block.words.iter_mut().zip(&self.conversions);
        words.filter(|(_, c)| **c == Conversion::NotWritten).for_each(|(words, _)| words.fill(0));
    }

    /// World coordinates of a record of a block.
    pub(crate) fn world(&self, position: [i64; 3]) -> [f64; 3] {
        self.stored.as_ref().map_or_else(|| self.lattice.world(position), |stored| stored.world(position))
    }

    /// World coordinate of a dataset's coordinate, as the job's lattice has it, and the offset in it.
    pub(super) fn job_point(&self, axis: usize, stored: i64) -> (f64, f64) {
        let offset = self.lattice_offset[axis];
        (stored.saturating_add(self.shift[axis]) as f64 * self.lattice.scale[axis] + offset, offset)
    }

    /// The job lattice's coordinates on an axis.
    pub(crate) fn job_grid(&self, axis: usize) -> AxisGrid {
        AxisGrid { step: self.lattice.scale[axis], offset: self.lattice_offset[axis] }
    }

    /// Steps of the job lattice to a world coordinate.
    #[inline]
    pub(crate) fn job_steps(&self, axis: usize, world: f64) -> f64 {
        (world - self.lattice_offset[axis]) / self.lattice.scale[axis]
    }

    /// The dataset's coordinate of a point of the job lattice.
    #[inline]
    pub(crate) fn stored_steps(&self, axis: usize, job: i64) -> i64 {
        if self.compare_positions { job.wrapping_sub(self.shift[axis]) } else { 0 }
    }

    /// The dataset's integer next to a decoded coordinate.
    pub(crate) fn steps(&self, axis: usize, decoded: f64) -> i64 {
        ((decoded - self.lattice.offset[axis]) / self.lattice.scale[axis]).round_ties_even() as i64
    }

    /// World coordinate of a point of the job lattice.
    #[inline]
    pub(crate) fn job_world(&self, axis: usize, steps: f64) -> f64 {
        steps * self.lattice.scale[axis] + self.lattice_offset[axis]
    }

    /// World coordinates, on the job lattice, of the dataset's integers.
    pub(crate) fn meant(&self, stored: [i64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|a| self.job_world(a, (stored[a] + self.shift[a]) as f64))
    }
}

/// The grey of `v` among values from `lo` to `hi`.
pub(crate) fn grey(v: u64, [lo, hi]: [u64; 2]) -> u64 {
    let span = hi.saturating_sub(lo);
    let scaled = (v.min(hi).saturating_sub(lo)).saturating_mul(255).saturating_add(span / 2);
    scaled.checked_div(span).unwrap_or(255)
}

/// Gives attributes that were renamed the names that they have in the sources.
fn rename_back(attributes: &mut [Attribute], renamed: &Value) {
    for attribute in attributes {
        if let Some(name) = renamed.get(&attribute.name).and_then(Value::as_str) {
            name.clone_into(&mut attribute.name);
        }
    }
}

fn constants(dropped: &Value) -> Vec<(String, Vec<f64>)> {
    let Some(map) = dropped.as_object() else { return Vec::new() };
    let values = |v: &Value| v.as_f64().map(|v| vec![v]).or_else(|| numbers(v));
    map.iter().filter_map(|(name, value)| Some((name.clone(), values(value)?))).collect()
}

fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}

fn vector(value: &Value) -> Option<[f64; 3]> {
    numbers(value)?.try_into().ok()
}

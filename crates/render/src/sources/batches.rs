//! What is drawn of quantised batches: those in sight, with as many bits and points as the picture needs.

use pointmill_format::batches::{
    BATCH_POINTS, BatchRecord, Batches, BlockScratch, Part, Precision, distance_to_box, keeps, lod_of,
    projected_diagonal, target_spacing, weight,
};
use pointmill_format::{Aabb, Attribute, AttributeType, ReadError};

use crate::projection::Projection;
use crate::vector::{length, minus};
use crate::{Bits, PointSize, Style};

use super::{Buffers, Points, Source, Take, Unit, UnitSize, surface_spacing};

/// Batches whose levels are sampled where the budget does not allow all points.
const SAMPLED: usize = 32;

/// The near plane, as a part of the extent: nearer than that no bits are added.
const NEAR: f64 = 1e-5;

/// A batch that is drawn.
struct Chosen {
    slot: u32,
    precision: Precision,
    /// Between its points, world units.
    spacing: f32,
}

/// The chosen batches of a file.
pub(crate) struct BatchesSource<'a, B> {
    batches: &'a Batches<B>,
    chosen: Vec<Chosen>,
    size: PointSize,
    clod: Option<f32>,
    /// Points whose level and weight together are below this are drawn.
    limit: f32,
    /// What is drawn of all points in sight: 0 to 1.
    part: f32,
    focal: f64,
    half: [f64; 2],
}

impl<'a, B: AsRef<[u8]> + Sync> BatchesSource<'a, B> {
    /// # Errors
    /// Levels of a compressed file that cannot be read.
    pub(crate) fn new(
        batches: &'a Batches<B>,
        projection: &Projection,
        style: &Style,
        budget: u64,
    ) -> Result<Self, ReadError> {
        let header = batches.header();
        let near = (length(header.tight.extent()) * NEAR).max(f64::MIN_POSITIVE);
        let eye = minus(projection.eye, header.grid.origin);
        let seen = (0..).zip(batches.records()).filter(|(_, r)| projection.may_see(&bounds(batches, r)));
        let chosen = seen.map(|(slot, record)| Chosen {
            slot,
            precision: precision(record, projection, eye, near, style.bits).min(header.precision()),
            spacing: surface_spacing(record.sides(), record.points.into()),
        });
        let half = [projection.size.width(), projection.size.height()].map(|side| f64::from(side) / 2.0);
        let (size, clod, focal) = (style.size, style.clod, projection.focal);
        let mut source =
            Self { batches, chosen: chosen.collect(), size, clod, limit: f32::INFINITY, part: 1.0, focal, half };
        source.even_out();
        if clod.is_none() {
            source.limit_to(budget)?;
        }
        Ok(source)
    }

    /// The box of a batch across a jump of the Morton curve is much larger than its points need.
    fn even_out(&mut self) {
        let mut all: Vec<f32> = self.chosen.iter().map(|chosen| chosen.spacing).collect();
        all.sort_unstable_by(f32::total_cmp);
        if let Some(median) = all.get(all.len() / 2) {
            self.chosen.iter_mut().for_each(|chosen| chosen.spacing = chosen.spacing.min(8.0 * median));
        }
    }

    /// Sets the limit so that about `budget` points are drawn, by the levels of some batches.
    fn limit_to(&mut self, budget: u64) -> Result<(), ReadError> {
        let seen = self.chosen.iter().map(|chosen| u64::from(self.points_of(chosen))).sum::<u64>();
        if seen <= budget {
            return Ok(());
        }
        let count = self.chosen.len().min(SAMPLED);
        let (mut levels, mut scratch) = (Vec::new(), BlockScratch::default());
        for i in 0..count {
            let Some(chosen) = self.chosen.get(i * self.chosen.len() / count) else { continue };
            let words = self.batches.batch_words(Part::Colour, chosen.slot, &mut scratch)?;
            let indices = chosen.slot * BATCH_POINTS..;
            levels.extend(words.iter().zip(indices).map(|(word, i)| f32::from(lod_of(*word)) + weight(i)));
        }
        levels.sort_unstable_by(f32::total_cmp);
        self.part = (budget as f64 / seen as f64) as f32;
        let at = (budget as f64 / seen as f64 * levels.len() as f64) as usize;
        self.limit = levels.get(at).copied().unwrap_or(f32::INFINITY);
        Ok(())
    }

    fn points_of(&self, chosen: &Chosen) -> u32 {
        self.batches.records().get(chosen.slot as usize).map_or(0, |record| record.points)
    }

    /// T of the continuous levels at a place of the picture.
    fn target(&self, clod: f32, [x, y, depth]: [f64; 3]) -> f32 {
        let ndc = [x, y].into_iter().zip(self.half).map(|(c, half)| c * self.focal / depth / half);
        let radius = ndc.map(|c| c * c).sum::<f64>().sqrt();
        target_spacing(length([x, y, depth]) as f32, clod, radius as f32)
    }
}

/// World coordinates.
fn bounds<B: AsRef<[u8]>>(batches: &Batches<B>, record: &BatchRecord) -> Aabb {
    Aabb { min: batches.world(record.min.map(f64::from)), max: batches.world(record.max.map(f64::from)) }
}

/// `eye`: relative to the origin of the grid.
fn precision(record: &BatchRecord, projection: &Projection, eye: [f64; 3], near: f64, rule: Bits) -> Precision {
    let (min, sides, max) = (record.corner(), record.sides(), record.max.map(f64::from));
    match rule {
        Bits::Always(precision) => precision,
        Bits::HalfPixel => {
            let longest = sides.into_iter().fold(0.0, f64::max);
            Precision::for_error(longest, distance_to_box(eye, min, max), near, projection.focal)
        }
        Bits::Published => {
            let centre: [f64; 3] = std::array::from_fn(|a| min[a] + sides[a] / 2.0);
            let depth = crate::vector::dot(projection.axes[2], minus(centre, eye));
            Precision::for_diagonal(projected_diagonal(length(sides), depth, projection.focal))
        }
    }
}

impl<B: AsRef<[u8]> + Sync> Source for BatchesSource<'_, B> {
    fn name(&self) -> String {
        self.batches.path().display().to_string()
    }

    fn len(&self) -> usize {
        self.chosen.len()
    }

    fn unit(&self, index: usize) -> Unit {
        let Some(chosen) = self.chosen.get(index) else { return Unit::new(0) };
        let Some(record) = self.batches.records().get(chosen.slot as usize) else { return Unit::new(0) };
        let size = match self.size {
            PointSize::Pixels(pixels) => UnitSize::Pixels(pixels),
            PointSize::World(size) => UnitSize::World(size),
            PointSize::Adaptive(_) if self.clod.is_some() => UnitSize::Each,
            PointSize::Adaptive(factor) => UnitSize::World(chosen.spacing * factor / self.part.sqrt()),
        };
        let (bits, bounds) = (Some(chosen.precision.bits()), Some(bounds(self.batches, record)));
        Unit { points: record.points.into(), level: 0, bits, bounds, size }
    }

    fn attributes(&self, _unit: usize) -> Vec<Attribute> {
        let words = Attribute::new("colour", AttributeType::UInt32, 1);
        std::iter::once(words).chain(self.batches.attributes().cloned()).collect()
    }

    fn read(&self, unit: usize, _: &[&str], buffers: &mut Buffers, take: &mut Take<'_>) -> Result<u64, ReadError> {
        let Some(chosen) = self.chosen.get(unit) else { return Ok(0) };
        self.batches.read_batch(chosen.slot, chosen.precision, &mut buffers.batch, &mut buffers.node)?;
        let _ = take(Points::of_node(&buffers.node));
        // planes and colours, uncompressed: what a renderer uploads
        Ok(u64::from(self.points_of(chosen)) * 4 * (1 + u64::from(chosen.precision.planes())))
    }

    fn keeps(&self, unit: usize, points: &Points<'_>, index: usize, view: [f64; 3]) -> bool {
        if self.clod.is_none() && self.limit == f32::INFINITY {
            return true;
        }
        let words = points.columns.first().and_then(|column| column.values::<u32>());
        let (Some(word), Some(chosen)) = (words.and_then(|words| words.get(index)), self.chosen.get(unit)) else {
            return true;
        };
        let (lod, weight) = (lod_of(*word), weight(chosen.slot * BATCH_POINTS + index as u32));
        match self.clod {
            Some(clod) => keeps(lod, weight, self.batches.header().grid.cell as f32, self.target(clod, view)),
            None => f32::from(lod) + weight < self.limit,
        }
    }

    fn size_at(&self, unit: usize, _points: &Points<'_>, _index: usize, view: [f64; 3]) -> f32 {
        let (PointSize::Adaptive(factor), Some(clod), Some(chosen)) = (self.size, self.clod, self.chosen.get(unit))
        else {
            return 0.0;
        };
        chosen.spacing.max(self.target(clod, view)) * factor
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use pointmill_format::Lattice;
    use pointmill_format::batches::{AlignedBytes, Cloud, WriteOptions, write};

    use super::*;
    use crate::{Camera, Colour, Size, render_batches};

    /// 256 × 256 points, 1 apart, on a plane; cells of 8.
    fn plane() -> Batches<AlignedBytes> {
        let lattice = Lattice { scale: [0.01; 3], offset: [500_000.0, 0.0, 0.0] };
        let x: Vec<i64> = (0..65_536).map(|i| i % 256 * 100).collect();
        let y: Vec<i64> = (0..65_536).map(|i| i / 256 * 100).collect();
        let colours: Vec<u32> = (0..65_536).collect();
        let z = vec![0; 65_536];
        let cloud = Cloud::new(lattice, [&x, &y, &z], &colours);
        let mut file = Cursor::new(Vec::new());
        let options = WriteOptions::new(lattice).cell(8.0).precision(Precision::Thirty);
        write(&mut file, &cloud, &options).unwrap();
        let bytes = AlignedBytes::from(&file.get_ref()[..]);
        Batches::from_bytes(bytes, "plane").unwrap()
    }

    /// Above the middle, looking down.
    fn above(height: f64) -> Camera {
        Camera::new([500_128.0, 128.0, height], [500_128.0, 128.0, 0.0])
    }

    fn drawn(batches: &Batches<AlignedBytes>, camera: &Camera, style: &Style, budget: u64) -> u64 {
        let size = Size::new(400, 400).unwrap();
        render_batches(batches, camera, size, style, budget, 1).unwrap().drawn.points
    }

    #[test]
    fn a_budget_is_met_by_levels() {
        let batches = plane();
        assert_eq!(drawn(&batches, &above(300.0), &Style::plain(), u64::MAX), 65_536);
        for budget in [40_000, 10_000, 1000] {
            let points = drawn(&batches, &above(300.0), &Style::plain(), budget);
            // all 7 batches are sampled: the limit is that of the points themselves, but for equal weights
            assert!(points <= budget && points + budget / 50 > budget, "{points} of {budget}");
        }
    }

    #[test]
    fn continuous_levels_draw_fewer_points_far_away() {
        let batches = plane();
        let of =
            |height, clod| drawn(&batches, &above(height), &Style { clod: Some(clod), ..Style::plain() }, u64::MAX);
        // points of the last level have 8/2^4 or more; T is at most 350 · 0.4 / (1000 · 0.3), in the corners
        assert_eq!(of(300.0, 0.4), 65_536);
        let points = [of(300.0, 4.0), of(300.0, 8.0), of(600.0, 8.0)];
        assert!(points.is_sorted_by(|a, b| a > b) && points[0] < 65_536, "{points:?}");
    }

    #[test]
    fn bits_are_those_of_the_distance() {
        let batches = plane();
        let size = Size::new(400, 400).unwrap();
        let bits = |height: f64, bits| {
            let projection = Projection::new(&above(height), size).unwrap();
            let style = Style { bits, colour: Colour::Bits, ..Style::plain() };
            let source = BatchesSource::new(&batches, &projection, &style, u64::MAX).unwrap();
            (0..source.len()).filter_map(|i| source.unit(i).bits).max()
        };
        // focal length 346: a box of about 128 is 1,024 pixels at 43
        assert_eq!([bits(300.0, Bits::HalfPixel), bits(10.0, Bits::HalfPixel)], [Some(10), Some(20)]);
        assert_eq!(bits(300.0, Bits::Always(Precision::Thirty)), Some(30));
        assert_eq!([bits(300.0, Bits::Published), bits(20.0, Bits::Published)], [Some(10), Some(20)]);
    }
}

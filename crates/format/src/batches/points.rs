//! Points one by one and batch by batch, decoded.

use crate::points::column_bytes;
use crate::{AttributeType, NodePoints, Positions, ReadError};

use super::{BATCH_POINTS, Batches, BlockScratch, Part, Precision, lod_of, rgb_of};

/// One point.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Point {
    /// Storage index.
    pub index: u32,
    /// World coordinates.
    pub world: [f64; 3],
    /// As it is drawn: the mean of a cell for points of the levels 0–2.
    pub rgb: [u8; 3],
    /// Level of detail, 0–3.
    pub lod: u8,
}

/// Memory that is reused from batch to batch: words of the planes, and blocks of compressed sections.
#[derive(Debug, Default)]
pub struct BatchScratch {
    words: [Vec<u32>; 3],
    /// Of the three planes, the colours, and then the extra attributes.
    blocks: Vec<BlockScratch>,
}

impl<B: AsRef<[u8]>> Batches<B> {
    /// Decodes one slot, with the planes of `precision` or as many of them as the file has; replaces the contents of
    /// `out`. Positions are world coordinates. The columns are `colour` (u32: colour words, [`rgb_of`] and [`lod_of`]),
    /// then [`Self::attributes`]. After an error `out` has no points.
    ///
    /// ```
    /// use pointmill_format::{NodePoints, batches::{BatchScratch, Batches, Precision, lod_of}};
    ///
    /// # fn main() -> Result<(), pointmill_format::ReadError> {
    /// let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/batches/example.qbatch");
    /// let batches = Batches::open(file)?;
    /// let (mut scratch, mut points) = (BatchScratch::default(), NodePoints::default());
    /// for slot in 0..batches.header().batches {
    ///     batches.read_batch(slot, Precision::Thirty, &mut scratch, &mut points)?;
    ///     let colours = points.column::<u32>("colour").unwrap_or(&[]);
    ///     let coarse = colours.iter().filter(|word| lod_of(**word) == 0).count();
    ///     println!("{} points, {coarse} of the coarsest level, the first at {:?}", points.len(), points.world(0));
    /// }
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`Self::batch`].
    pub fn read_batch(
        &self,
        slot: u32,
        precision: Precision,
        scratch: &mut BatchScratch,
        out: &mut NodePoints,
    ) -> Result<(), ReadError> {
        let colour = std::iter::once(("colour", AttributeType::UInt32));
        out.reset(colour.chain(self.attributes().map(|a| (a.name.as_str(), a.ty))));
        out.stored.clear();
        let mut positions = out.take_world();
        let decoded = self.decode_positions(slot, precision, scratch, &mut positions);
        out.positions = Positions::World(positions);
        if let Err(error) = decoded.and_then(|()| self.decode_columns(slot, scratch, out)) {
            out.clear();
            return Err(error);
        }
        Ok(())
    }

    fn decode_columns(&self, slot: u32, scratch: &mut BatchScratch, out: &mut NodePoints) -> Result<(), ReadError> {
        let attributes = self.attributes().enumerate().map(|(i, a)| (Part::Attribute(i), a.elements, a.size()));
        let parts = std::iter::once((Part::Colour, 1, 4)).chain(attributes);
        for ((column, (part, elements, size)), block) in out.columns.iter_mut().zip(parts).zip(&mut scratch.blocks[3..])
        {
            column_bytes::append(column, self.batch(part, slot, block)?, size, 0, elements);
        }
        Ok(())
    }

    fn decode_positions(
        &self,
        slot: u32,
        precision: Precision,
        scratch: &mut BatchScratch,
        positions: &mut [Vec<f64>; 3],
    ) -> Result<(), ReadError> {
        let precision = precision.min(self.header().precision());
        let planes = [Part::Hi10, Part::Mid10, Part::Lo10].into_iter().take(precision.planes() as usize);
        scratch.blocks.resize_with(4 + self.attributes().len(), BlockScratch::default);
        scratch.words.iter_mut().for_each(Vec::clear);
        for ((part, words), block) in planes.zip(&mut scratch.words).zip(&mut scratch.blocks) {
            words.extend_from_slice(self.batch_words(part, slot, block)?);
        }
        let points = scratch.words[0].len();
        scratch.words.iter_mut().for_each(|words| words.resize(points, 0));
        let Some(decoder) = self.decoder(slot, precision) else { return Ok(()) };
        let [hi, mid, lo] = &scratch.words;
        let [xs, ys, zs] = positions;
        for values in [&mut *xs, &mut *ys, &mut *zs] {
            values.resize(points, 0.0);
        }
        let words = hi.iter().zip(mid).zip(lo);
        for (((((hi, mid), lo), x), y), z) in words.zip(xs).zip(ys).zip(zs) {
            [*x, *y, *z] = self.world(decoder.position_of_words(*hi, *mid, *lo));
        }
        Ok(())
    }

    /// All points in Morton order: swaps undone.
    pub fn points_in_morton_order(&self, precision: Precision) -> PointsInMortonOrder<'_, B> {
        PointsInMortonOrder {
            batches: self,
            precision,
            next_batch: 0,
            next_point: 0,
            first_point: 0,
            scratch: BatchScratch::default(),
            points: NodePoints::default(),
        }
    }

    /// Reads every value of the file and checks what opening does not: originals ascend and belong to points, blocks
    /// decompress. Returns the number of points. For tests that want to know whether a file can be read to its end.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn read_everything(&self) -> Result<u64, ReadError> {
        let mut points = 0;
        for point in self.points_in_morton_order(Precision::Thirty) {
            points += u64::from(point?.world.iter().all(|v| !v.is_nan()));
        }
        let mut scratch = BlockScratch::default();
        for (i, slot) in (0..self.attributes().len()).flat_map(|i| (0..self.header().batches).map(move |s| (i, s))) {
            self.batch(Part::Attribute(i), slot, &mut scratch)?;
        }
        let originals = self.originals();
        let ascend = originals.windows(2).all(|pair| pair[0].index < pair[1].index);
        let inside = originals.last().is_none_or(|o| u64::from(o.index) < self.header().points);
        if !ascend || !inside || originals.iter().any(|o| lod_of(o.colour) != 0) {
            let at = self.header().sections.originals;
            let what = "originals do not ascend, belong to no point, or have a level";
            return Err(ReadError::broken(self.path(), at, what).advise(super::header::CORRUPT));
        }
        Ok(points)
    }
}

/// See [`Batches::points_in_morton_order`]. Ends after an error.
#[derive(Debug)]
pub struct PointsInMortonOrder<'a, B> {
    batches: &'a Batches<B>,
    precision: Precision,
    /// In Morton order; the one before is in `points`.
    next_batch: u32,
    next_point: usize,
    /// Storage index of the first of `points`.
    first_point: u32,
    scratch: BatchScratch,
    points: NodePoints,
}

impl<B: AsRef<[u8]>> Iterator for PointsInMortonOrder<'_, B> {
    type Item = Result<Point, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        let batches = self.batches;
        while self.next_point >= self.points.len() {
            if self.next_batch >= batches.header().batches {
                return None;
            }
            let slot = batches.swap(self.next_batch);
            if let Err(e) = batches.read_batch(slot, self.precision, &mut self.scratch, &mut self.points) {
                self.next_batch = u32::MAX;
                self.next_point = usize::MAX;
                return Some(Err(e));
            }
            (self.next_batch, self.next_point) = (self.next_batch + 1, 0);
            self.first_point = slot * BATCH_POINTS;
        }
        let i = self.next_point;
        self.next_point += 1;
        let word = self.points.columns().first()?.values::<u32>()?.get(i).copied()?;
        let (index, world) = (self.first_point + i as u32, self.points.world(i)?);
        Some(Ok(Point { index, world, rgb: rgb_of(word), lod: lod_of(word) }))
    }
}

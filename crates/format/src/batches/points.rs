//! Points one by one and batch by batch, decoded.

use crate::ReadError;

use super::{BATCH_POINTS, Batches, BlockScratch, Part, Precision, lod_of, rgb_of};

/// One point.
#[derive(Debug, Clone, Copy, PartialEq)]
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

/// The points of one batch, decoded; reuse one.
#[derive(Debug, Default)]
pub struct BatchPoints {
    /// Storage index of the first.
    pub first_point: u32,
    /// Positions relative to the grid's origin.
    pub relative: Vec<[f64; 3]>,
    /// Colour words.
    pub colours: Vec<u32>,
    words: [Vec<u32>; 3],
    scratch: [BlockScratch; 4],
}

impl<B: AsRef<[u8]>> Batches<B> {
    /// Decodes one slot into `out`, with the planes of `precision` or as many of them as the file has.
    ///
    /// # Errors
    /// As [`Self::batch`].
    pub fn read_batch(&self, slot: u32, precision: Precision, out: &mut BatchPoints) -> Result<(), ReadError> {
        let precision = precision.min(self.header().precision());
        let planes = [Part::Hi10, Part::Mid10, Part::Lo10].into_iter().take(precision.planes() as usize);
        let [scratch @ .., colour_scratch] = &mut out.scratch;
        out.colours.clear();
        out.colours.extend_from_slice(self.batch_words(Part::Colour, slot, colour_scratch)?);
        for words in &mut out.words {
            words.clear();
        }
        for ((part, words), scratch) in planes.zip(&mut out.words).zip(scratch) {
            words.extend_from_slice(self.batch_words(part, slot, scratch)?);
        }
        for words in &mut out.words {
            words.resize(out.colours.len(), 0);
        }
        out.first_point = slot * BATCH_POINTS;
        out.relative.clear();
        let Some(decoder) = self.decoder(slot, precision) else { return Ok(()) };
        let [hi, mid, lo] = &out.words;
        let words = hi.iter().zip(mid).zip(lo);
        out.relative.extend(words.map(|((hi, mid), lo)| decoder.position_of_words(*hi, *mid, *lo)));
        Ok(())
    }

    /// All points in Morton order: swaps undone.
    pub fn points_in_morton_order(&self, precision: Precision) -> PointsInMortonOrder<'_, B> {
        PointsInMortonOrder { batches: self, precision, next_batch: 0, next_point: 0, points: BatchPoints::default() }
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
    points: BatchPoints,
}

impl<B: AsRef<[u8]>> Iterator for PointsInMortonOrder<'_, B> {
    type Item = Result<Point, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        let batches = self.batches;
        while self.next_point >= self.points.relative.len() {
            if self.next_batch >= batches.header().batches {
                return None;
            }
            let slot = batches.swap(self.next_batch);
            if let Err(e) = batches.read_batch(slot, self.precision, &mut self.points) {
                self.next_batch = u32::MAX;
                self.points.relative.clear();
                return Some(Err(e));
            }
            (self.next_batch, self.next_point) = (self.next_batch + 1, 0);
        }
        let i = self.next_point;
        self.next_point += 1;
        let (relative, word) = (self.points.relative[i], self.points.colours[i]);
        let index = self.points.first_point + i as u32;
        Some(Ok(Point { index, world: batches.world(relative), rgb: rgb_of(word), lod: lod_of(word) }))
    }
}

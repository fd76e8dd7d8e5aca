//! Columns and positions into records, each at the place of its cell.

use std::ops::Range;

use super::columns::{Part, RowsOf};
use crate::cloud::{Checksum, DerivedFields, JobColumns, StoredOrigin, copy_record};
use crate::runtime::{TILE_POINTS, Vectors, vectorized};
use crate::sources::{MARK_BYTES, POSITION_BYTES, Schema};

/// What the records of a slice are made of.
pub(super) struct Assembly<'a> {
    pub(super) schema: &'a Schema,
    pub(super) origin: StoredOrigin,
    pub(super) q: &'a JobColumns,
    pub(super) parts: Vec<Part<'a>>,
    pub(super) rows: &'a Rows<'a>,
    /// Where in a record its mark is, and the marks.
    pub(super) marks: Option<(usize, &'a [u64])>,
    /// The directions to the scanner, and where in a record they go.
    pub(super) directions: Option<(Directed, &'a [[f32; 3]])>,
}

/// Byte offsets in a record of the normal and the curvature, whose places a direction has until they are computed.
pub(super) type Directed = ([usize; 3], usize);

/// Rows of a batch that are taken together.
pub(crate) enum Rows<'a> {
    Consecutive(Range<usize>),
    Selected(&'a [u32]),
}

impl Rows<'_> {
    /// How many.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Consecutive(range) => range.len(),
            Self::Selected(rows) => rows.len(),
        }
    }

    /// Some of these, by their numbers among them.
    pub(crate) fn slice(&self, part: Range<usize>) -> Rows<'_> {
        match self {
            Self::Consecutive(range) => Rows::Consecutive(range.start + part.start..range.start + part.end),
            Self::Selected(rows) => Rows::Selected(&rows[part]),
        }
    }

    /// The row of the batch that is the `i`th of these.
    pub(crate) fn row(&self, i: usize) -> usize {
        match self {
            Self::Consecutive(range) => range.start + i,
            Self::Selected(rows) => rows[i] as usize,
        }
    }

    /// So many of these from `first` on.
    #[inline(always)]
    pub(crate) fn part(&self, first: usize, count: usize) -> RowsOf<'_> {
        match self {
            Self::Consecutive(range) => RowsOf::From(range.start + first),
            Self::Selected(rows) => RowsOf::Named(&rows[first..first + count]),
        }
    }
}

/// Puts records together: in the order of the rows, whose columns are then read from front to back, and then moves each as a
/// whole. It does so in tiles of [`TILE_POINTS`] records, which stay in the first-level cache while one column after the
/// other is written.
#[derive(Default)]
pub(super) struct Assembler {
    vectors: Vectors,
    /// Of what a thread may take for it ([`crate::runtime::Budget`]).
    tile: Vec<u8>,
}

impl Assembler {
    /// Writes the records of a slice; `places`: where each goes among them, empty if all stay in order.
    pub(super) fn put(&mut self, assembly: &Assembly<'_>, places: &[u32], records: &mut [u8], checksum: &mut Checksum) {
        put(self.vectors, assembly, places, records, &mut self.tile, checksum);
    }
}

vectorized! {
    fn put(
        assembly: &Assembly<'_>,
        places: &[u32],
        records: &mut [u8],
        tile: &mut Vec<u8>,
        checksum: &mut Checksum,
    ) = Assembly::put;
}

impl Assembly<'_> {
    #[inline(always)]
    fn put(&self, places: &[u32], records: &mut [u8], tile: &mut Vec<u8>, checksum: &mut Checksum) {
        match places {
            [] => self.put_in_order(records, checksum),
            places => self.put_to(places, records, tile, checksum),
        }
    }

    #[inline(always)]
    fn put_in_order(&self, records: &mut [u8], checksum: &mut Checksum) {
        for (i, tile) in records.chunks_mut(TILE_POINTS * self.schema.stride).enumerate() {
            self.put_tile(i * TILE_POINTS, tile, checksum);
        }
    }

    #[inline(always)]
    fn put_to(&self, places: &[u32], records: &mut [u8], tile: &mut Vec<u8>, checksum: &mut Checksum) {
        let stride = self.schema.stride;
        // zeros are what columns hold that this source does not have, whatever the last source had
        tile.clear();
        tile.reserve_exact(TILE_POINTS.min(places.len()) * stride);
        tile.resize(TILE_POINTS.min(places.len()) * stride, 0);
        for (i, places) in places.chunks(TILE_POINTS).enumerate() {
            let tile = &mut tile[..places.len() * stride];
            self.put_tile(i * TILE_POINTS, tile, checksum);
            for (record, place) in tile.chunks_exact(stride).zip(places) {
                copy_record(record, &mut records[*place as usize * stride..][..stride]);
            }
        }
    }

    /// Puts the records from `first` on together.
    #[inline(always)]
    fn put_tile(&self, first: usize, tile: &mut [u8], checksum: &mut Checksum) {
        let stride = self.schema.stride;
        let count = tile.len() / stride;
        let [x, y, z] = self.q.0.each_ref().map(|axis| &axis[first..first + count]);
        for (i, record) in tile.chunks_exact_mut(stride).enumerate() {
            let stored = self.origin.stored(crate::cloud::JobPoint([x[i], y[i], z[i]])).0;
            if let Some(position) = record.first_chunk_mut::<POSITION_BYTES>() {
                position.as_chunks_mut::<4>().0.iter_mut().zip(stored).for_each(|(to, q)| *to = q.to_le_bytes());
            }
        }
        for part in &self.parts {
            part.put(tile, stride, self.rows.part(first, count));
        }
        if let Some((at, marks)) = self.marks {
            for (record, mark) in tile.chunks_exact_mut(stride).zip(&marks[first..]) {
                record[at..at + MARK_BYTES].copy_from_slice(&mark.to_le_bytes());
            }
        }
        if let Some((at, directions)) = self.directions {
            directed(tile, stride, at, &directions[first..]);
        }
        checksum.add_all(tile, stride);
    }
}

/// Puts directions into records.
fn directed(tile: &mut [u8], stride: usize, (normal, curvature): Directed, directions: &[[f32; 3]]) {
    for (record, direction) in tile.chunks_exact_mut(stride).zip(directions) {
        if *direction != [0.0; 3] {
            let values = normal.into_iter().zip(*direction).chain([(curvature, DerivedFields::IS_DIRECTION)]);
            values.for_each(|(at, v)| record[at..at + 4].copy_from_slice(&v.to_le_bytes()));
        }
    }
}

#[cfg(test)]
mod tests {
    use pointmill_format::{Attribute, AttributeType, Column};

    use super::*;
    use crate::cloud::JobPoint;

    #[test]
    fn records_go_to_their_places_and_what_a_source_lacks_is_zero() {
        let schema =
            Schema::new([("a", 2), ("b", 1)].map(|(name, n)| Attribute::new(name, AttributeType::UInt16, n)).to_vec());
        let points = 1300u32;
        let q = JobColumns([10, 20, 30].map(|first| (0..i64::from(points)).map(|i| first + i).collect()));
        let columns = [
            Column::UInt16((0..points).flat_map(|i| [i as u16, 7]).collect()),
            Column::UInt16((0..points).map(|i| 3 * i as u16).collect()),
        ];
        let columns: Vec<&Column> = columns.iter().collect();
        let places: Vec<u32> = (0..points).map(|i| i * 7 % points).collect();
        for vectors in Vectors::all() {
            // as a shorter slice leaves it
            let mut assembler = Assembler { vectors, tile: Vec::with_capacity(300 * schema.stride) };
            // first a source with both columns, then one without the second
            for (given, b) in [([Some(0), Some(1)], 3), ([Some(0), None], 0)] {
                for places in [&places[..], &[]] {
                    let assembly = Assembly {
                        schema: &schema,
                        origin: StoredOrigin(JobPoint([10, 20, 30])),
                        q: &q,
                        parts: Part::of(&columns, &given, &schema),
                        rows: &Rows::Consecutive(0..points as usize),
                        marks: None,
                        directions: None,
                    };
                    let mut records = vec![0; points as usize * schema.stride];
                    let mut checksum = Checksum::default();
                    assembler.put(&assembly, places, &mut records, &mut checksum);
                    for i in 0..points {
                        let place = places.get(i as usize).map_or(i, |place| *place) as usize;
                        let record = &records[place * schema.stride..][..schema.stride];
                        let mut expected: Vec<u8> = [i, i, i].iter().flat_map(|v| v.to_le_bytes()).collect();
                        expected.extend([i as u16, 7, b * i as u16].iter().flat_map(|v| v.to_le_bytes()));
                        assert_eq!(record, expected, "{vectors:?} point {i}");
                    }
                    assert_eq!(checksum.count(), u64::from(points));
                    assert!(assembler.tile.capacity() <= TILE_POINTS * schema.stride, "as much as is accounted for");
                }
            }
        }
    }
}

//! The file while tasks are written: batches go to their slots as soon as they are complete.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard};

use pointmill_format::batches::{
    BATCH_POINTS, BatchRecord, EncodedBatch, ErrorSums, Layout, Section, batch_points, encode_batch, le_bytes,
};

use serde::{Deserialize, Serialize};

use super::frame::refused;
use crate::cloud::{Segment, Store};
use crate::error::ConvertError;
use crate::outputs::recovery::{Lost, Recovery};
use crate::runtime::DiskFile;

/// Bytes of an entry of the originals: storage index and colour word.
pub(super) const ORIGINAL_BYTES: usize = 8;

/// Where tasks put what they made, in any order, from any thread.
pub(super) struct BatchFile<'a> {
    to: To<'a>,
    pub(super) layout: &'a Layout,
    recovery: Recovery,
    /// World coordinates of the grid's origin.
    origin: [f64; 3],
    state: Mutex<State>,
    /// Entries of the originals, as they came.
    pub(super) originals: Arc<Store>,
}

/// Where bytes go.
pub(super) enum To<'a> {
    File(&'a DiskFile),
    /// Into the file of a unit, to be put into the output later: an offset, and the bytes.
    Unit(&'a PutAt<'a>),
}

/// Takes bytes that belong at an offset.
pub(super) type PutAt<'a> = dyn Fn(u64, &[u8]) -> Result<(), ConvertError> + Sync + 'a;

/// What is kept until the end.
#[derive(Default)]
pub(super) struct State {
    /// By slot.
    pub(super) records: Vec<Option<BatchRecord>>,
    /// By Morton batch.
    pub(super) errors: Vec<ErrorSums>,
    /// Points that do not come back.
    pub(super) lost: Lost,
    /// Parts of batches that tasks share, by Morton batch.
    fragments: HashMap<u32, Vec<Fragment>>,
    /// First storage index, and where the entries are.
    pub(super) originals: Vec<(u32, Segment)>,
    /// Of a unit, which has few of all batches.
    found: Vec<Found>,
}

/// A batch that was encoded.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Found {
    slot: u32,
    record: BatchRecord,
    /// In Morton order.
    batch: u32,
    errors: ErrorSums,
}

impl State {
    fn take(&mut self, found: Found) -> Result<(), ConvertError> {
        let Found { slot, record, batch, errors } = found;
        let places = (self.records.get_mut(slot as usize), self.errors.get_mut(batch as usize));
        let (Some(to_record), Some(to_errors)) = places else {
            return Err(ConvertError::Internal("a batch that is none of the output".into()));
        };
        (*to_record, *to_errors) = (Some(record), errors);
        Ok(())
    }
}

/// Consecutive points of a batch.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Fragment {
    start: u32,
    relative: [Vec<f64>; 3],
}

/// What a unit came to beside bytes.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Part {
    found: Vec<Found>,
    lost: Lost,
    fragments: Vec<(u32, Vec<Fragment>)>,
    /// First storage index and number of entries.
    originals: Vec<(u32, u32)>,
}

impl Part {
    /// True if it can be of a task of so many points in these pieces.
    pub(super) fn can_be_of(&self, pieces: &[Piece], points: u64, layout: &Layout) -> bool {
        let is_found = |found: &Found| {
            let is_piece = |piece: &Piece| piece.batch == found.batch && piece.is_whole(layout);
            layout.slot(found.batch).0 == found.slot && found.errors.points <= points && pieces.iter().any(is_piece)
        };
        let is_fragment = |batch: u32, Fragment { start, relative }: &Fragment| {
            let is_piece = |piece: &Piece| {
                (piece.batch, piece.start) == (batch, *start)
                    && relative.iter().all(|axis| axis.len() == piece.range.len())
                    && !piece.is_whole(layout)
            };
            pieces.iter().any(is_piece)
        };
        let mut fragments = self.fragments.iter().flat_map(|(batch, all)| all.iter().map(|one| (*batch, one)));
        let count = self.found.len() + fragments.clone().count();
        count == pieces.len()
            && self.found.iter().all(is_found)
            && fragments.all(|(batch, one)| is_fragment(batch, one))
            && self.lost.points <= points
            && self.lost.merged <= points
    }

    /// Of the originals: of pieces, the first storage index and the number of entries.
    pub(super) fn originals(&self) -> &[(u32, u32)] {
        &self.originals
    }
}

/// Points of one task in one batch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Piece {
    /// Index of the batch in Morton order.
    pub(super) batch: u32,
    /// Index in the batch of its first point.
    pub(super) start: u32,
    /// Its points, counted from the first of the task.
    pub(super) range: std::ops::Range<usize>,
}

impl Piece {
    /// True if it has all points of its batch.
    pub(super) fn is_whole(&self, layout: &Layout) -> bool {
        self.range.len() == batch_points(self.batch, layout.points) as usize
    }
}

/// The pieces of a task.
pub(super) fn pieces(first_point: u64, points: u64) -> impl Iterator<Item = Piece> {
    let size = u64::from(BATCH_POINTS);
    let batches = first_point / size..(first_point + points).div_ceil(size);
    batches.map(move |batch| {
        let from = first_point.max(batch * size);
        let to = (first_point + points).min((batch + 1) * size);
        let range = (from - first_point) as usize..(to - first_point) as usize;
        Piece { batch: batch as u32, start: (from - batch * size) as u32, range }
    })
}

/// One thread's memory for encoding batches.
#[derive(Default)]
pub(super) struct Encoder {
    batch: EncodedBatch,
    joined: [Vec<f64>; 3],
}

impl<'a> BatchFile<'a> {
    pub(super) fn new(
        to: To<'a>,
        layout: &'a Layout,
        originals: Arc<Store>,
        recovery: Recovery,
        origin: [f64; 3],
    ) -> Self {
        let batches = if matches!(to, To::File(_)) { layout.batches as usize } else { 0 };
        let state =
            State { records: vec![None; batches], errors: vec![ErrorSums::default(); batches], ..State::default() };
        Self { to, layout, recovery, origin, state: Mutex::new(state), originals }
    }

    /// The storage index of the first point of a piece.
    pub(super) fn storage_index(&self, piece: &Piece) -> u32 {
        self.layout.slot(piece.batch).1 + piece.start
    }

    /// Takes the positions of a piece, relative to the origin; encodes the batch if it is complete now.
    pub(super) fn put(&self, piece: &Piece, relative: [&[f64]; 3], encoder: &mut Encoder) -> Result<(), ConvertError> {
        let points = batch_points(piece.batch, self.layout.points) as usize;
        if piece.range.len() == points {
            return self.encode(piece.batch, relative, &mut encoder.batch);
        }
        let mut fragments = {
            let mut state = self.lock()?;
            let fragments = state.fragments.entry(piece.batch).or_default();
            fragments.push(Fragment { start: piece.start, relative: relative.map(<[f64]>::to_vec) });
            if fragments.iter().map(|f| f.relative[0].len()).sum::<usize>() < points {
                return Ok(());
            }
            state.fragments.remove(&piece.batch).unwrap_or_default()
        };
        fragments.sort_unstable_by_key(|f| f.start);
        for (a, joined) in encoder.joined.iter_mut().enumerate() {
            joined.clear();
            fragments.iter().for_each(|f| joined.extend_from_slice(&f.relative[a]));
        }
        let [x, y, z] = &encoder.joined;
        self.encode(piece.batch, [x, y, z], &mut encoder.batch)
    }

    fn encode(&self, batch: u32, relative: [&[f64]; 3], encoded: &mut EncodedBatch) -> Result<(), ConvertError> {
        let (slot, first_point) = self.layout.slot(batch);
        encode_batch(first_point, relative, encoded).map_err(refused)?;
        self.put_values(self.layout.hi10, 4, first_point, &le_bytes(&encoded.hi10))?;
        for (section, words) in [(self.layout.mid10, &encoded.mid10), (self.layout.lo10, &encoded.lo10)] {
            if let Some(section) = section {
                self.put_values(section, 4, first_point, &le_bytes(words))?;
            }
        }
        let lost = self.lost_of(relative, encoded);
        let mut state = self.lock()?;
        state.lost.merge(lost);
        let found = Found { slot, record: encoded.record, batch, errors: encoded.errors };
        match self.to {
            To::Unit(_) => state.found.push(found),
            To::File(_) => state.take(found)?,
        }
        Ok(())
    }

    /// Points of a batch that do not come back from the planes that are written.
    fn lost_of(&self, relative: [&[f64]; 3], encoded: &EncodedBatch) -> Lost {
        let precision = self.layout.precision();
        if self.recovery.is_certain(encoded.errors.deviations(precision).max) {
            return Lost::default();
        }
        let decoder = encoded.record.decoder(precision);
        let world = |r: [f64; 3]| std::array::from_fn(|a| self.origin[a] + r[a]);
        let words = encoded.hi10.iter().zip(&encoded.mid10).zip(&encoded.lo10);
        self.recovery.count(words.enumerate().map(|(i, ((hi, mid), lo))| {
            let decoded = world(decoder.position_of_words(*hi, *mid, *lo));
            // the point of the lattice is nearest to its own coordinates
            (decoded, self.recovery.integers(world(relative.map(|r| r[i]))))
        }))
    }

    /// Writes consecutive values of a section with `size` bytes per point.
    pub(super) fn put_values(&self, section: Section, size: u64, first: u32, bytes: &[u8]) -> Result<(), ConvertError> {
        self.write(bytes, Layout::point_offset(section, size, first))
    }

    pub(super) fn write(&self, bytes: &[u8], offset: u64) -> Result<(), ConvertError> {
        match self.to {
            To::File(file) => file.write_at(bytes, offset, "writing the batches"),
            To::Unit(put) => put(offset, bytes),
        }
    }

    /// Cuts what is behind so many bytes.
    pub(super) fn cut(&self, bytes: u64) -> Result<(), ConvertError> {
        match self.to {
            To::File(file) => file.set_len(bytes, "leaving out a plane"),
            To::Unit(_) => Ok(()),
        }
    }

    /// Keeps the originals of one task: bytes of all entries, and for each piece its first storage index and the number
    /// of entries.
    pub(super) fn put_originals(&self, entries: &mut Vec<u8>, pieces: &[(u32, u32)]) -> Result<(), ConvertError> {
        if entries.is_empty() {
            return Ok(());
        }
        let block = self.originals.open(0)?;
        self.originals.fill(block, entries)?;
        let mut start = 0;
        let mut state = self.lock()?;
        for &(first, count) in pieces.iter().filter(|(_, count)| *count > 0) {
            state.originals.push((first, Segment { block, start, count }));
            start += count;
        }
        Ok(())
    }

    /// What a unit came to: all that is kept until the end, and the bytes of the entries of its originals.
    pub(super) fn take_part(&self) -> Result<(Part, Vec<u8>), ConvertError> {
        let state = std::mem::take(&mut *self.lock()?);
        let (mut pieces, mut entries) = (Vec::new(), Vec::new());
        for (first, segment) in state.originals {
            pieces.push((first, segment.count));
            self.originals.take(segment, &mut entries)?;
        }
        let mut fragments: Vec<(u32, Vec<Fragment>)> = state.fragments.into_iter().collect();
        fragments.sort_unstable_by_key(|(batch, _)| *batch);
        let part = Part { found: state.found, lost: state.lost, fragments, originals: pieces };
        Ok((part, entries))
    }

    /// Takes what a unit came to; its bytes are there.
    pub(super) fn add_part(&self, part: Part, mut entries: Vec<u8>, encoder: &mut Encoder) -> Result<(), ConvertError> {
        let mut state = self.lock()?;
        part.found.into_iter().try_for_each(|found| state.take(found))?;
        state.lost.merge(part.lost);
        drop(state);
        for (batch, fragments) in part.fragments {
            for Fragment { start, relative: [x, y, z] } in &fragments {
                let piece = Piece { batch, start: *start, range: 0..x.len() };
                self.put(&piece, [x, y, z], encoder)?;
            }
        }
        self.put_originals(&mut entries, &part.originals)
    }

    /// What was kept, once all tasks are done.
    pub(super) fn take_state(&self) -> Result<State, ConvertError> {
        let state = std::mem::take(&mut *self.lock()?);
        if state.fragments.is_empty() && state.records.iter().all(Option::is_some) {
            return Ok(state);
        }
        let missing = state.records.iter().filter(|r| r.is_none()).count();
        Err(ConvertError::Internal(format!("{missing} of {} batches were never complete", state.records.len())))
    }

    fn lock(&self) -> Result<MutexGuard<'_, State>, ConvertError> {
        self.state.lock().map_err(|_| ConvertError::Internal("a worker thread failed while it wrote batches".into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_end_at_the_borders_of_batches_and_hold_every_point() {
        let found: Vec<Piece> = pieces(10_000, 20_721).collect();
        let piece = |batch, start, range| Piece { batch, start, range };
        assert_eq!(
            found,
            [
                piece(0, 10_000, 0..240),
                piece(1, 0, 240..10_480),
                piece(2, 0, 10_480..20_720),
                piece(3, 0, 20_720..20_721)
            ]
        );
        assert_eq!(pieces(10_240, 1).collect::<Vec<_>>(), [piece(1, 0, 0..1)]);
        assert_eq!(pieces(10_240, 10_240).count(), 1);
    }
}

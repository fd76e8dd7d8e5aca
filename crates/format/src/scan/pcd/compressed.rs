//! The block of a compressed file: the values of each field of all points together, compressed in one run.
//!
//! One pass over the block finds the state of the decompressor where the values of each field begin, for the first
//! point of each piece. From there on a decompressor a field runs beside the others, so that a piece takes the memory of a
//! batch, whatever the size of the file.

use super::lzf::{self, Block, Checkpoint, Decoder, REACH, Stop};
use crate::scan::source::Source;
use crate::scan::tabular::{Plane, PlaneReader, Planes};
use crate::{Advice, Piece, ReadError};

/// Points of a piece, at least: to begin one takes a read and some steps for each field.
const PIECE_POINTS: u64 = 1 << 18;
/// Memory of all checkpoints, unless the first piece alone needs more.
const CHECKPOINT_BYTES: u64 = 4 << 20;
/// Memory of the decompressors of a piece, but for what each needs in any case.
const READER_BYTES: usize = 1 << 20;
/// Bytes that the pass over all, or one decompressor, reads and decompresses at once.
const AT_ONCE: usize = 32 << 10;

/// The planes of a file.
#[derive(Debug)]
pub(super) struct Compressed {
    block: Block,
    /// Points of the block.
    points: u64,
    properties: Vec<Plane>,
    /// Points of a piece, the last one excepted.
    step: u64,
    state: State,
}

#[derive(Debug)]
enum State {
    /// By property, then by piece.
    Checkpoints(Vec<Checkpoint>),
    /// The block is not compressed: it would not have become smaller.
    Stored,
    /// Why it cannot be decompressed.
    Damaged(String),
}

impl Compressed {
    /// `block` becomes `points` points of these properties.
    ///
    /// # Errors
    /// It cannot be read. Damage is an error of its pieces.
    pub(super) fn new(source: &Source, block: Block, points: u64, properties: Vec<Plane>) -> Result<Self, ReadError> {
        let fields = properties.len().max(1) as u64;
        let pieces = (CHECKPOINT_BYTES / (fields * REACH as u64)).max(1);
        let step = points.div_ceil(pieces).max(PIECE_POINTS);
        let firsts = || (0..points).step_by(usize::try_from(step).unwrap_or(usize::MAX));
        let place = |plane: &Plane, first: u64| points * plane.at as u64 + first * plane.width as u64;
        let places: Vec<u64> = properties.iter().flat_map(|p| firsts().map(move |first| place(p, first))).collect();
        let mut found = Vec::with_capacity(places.len());
        let pass = Decoder::new(source, block, &Checkpoint::default(), AT_ONCE).checkpoints(&places, &mut found);
        let state = match pass {
            Ok(()) => State::Checkpoints(found),
            Err(Stop::Read(error)) => return Err(error),
            Err(Stop::Damaged(_)) if block.len == block.decompressed => State::Stored,
            Err(Stop::Damaged(what)) => State::Damaged(what),
        };
        Ok(Self { block, points, properties, step, state })
    }

    /// Pieces of the first `points` points; all in one if they cannot be decompressed.
    pub(super) fn pieces(&self, points: u64) -> Vec<Piece> {
        let step = if matches!(self.state, State::Damaged(_)) { self.points.max(1) } else { self.step };
        // the bytes of a piece are strewn over the block: each is given its share
        let share = |point: u64| {
            let of_all = u128::from(self.block.len) * u128::from(point) / u128::from(self.points.max(1));
            u64::try_from(of_all).unwrap_or(self.block.len)
        };
        let firsts = (0..points).step_by(usize::try_from(step).unwrap_or(usize::MAX));
        firsts
            .map(|first_point| {
                let end = points.min(first_point + step);
                let byte_offset = self.block.at + share(first_point);
                let byte_len = self.block.at + share(end) - byte_offset;
                Piece { first_point, points: end - first_point, byte_offset, byte_len }
            })
            .collect()
    }

    /// Bytes that a decompressor handles at once, where there are so many.
    fn at_once(decoders: usize) -> usize {
        (READER_BYTES / 2 / decoders.max(1)).min(AT_ONCE)
    }

    fn damaged(&self, source: &Source, what: &str) -> ReadError {
        ReadError::broken(source.path(), self.block.at, what).advise(Advice::Damaged)
    }

    /// Where the value of a property of a point is in the decompressed block.
    fn place(&self, property: usize, point: u64) -> u64 {
        let Plane { at, width } = self.properties[property];
        self.points * at as u64 + point * width as u64
    }
}

impl Planes for Compressed {
    fn reader<'a>(
        &'a self,
        source: &'a Source,
        first_point: u64,
        needed: &[bool],
    ) -> Result<Box<dyn PlaneReader + 'a>, ReadError> {
        let checkpoints = match &self.state {
            State::Damaged(what) => return Err(self.damaged(source, what)),
            State::Stored => {
                let places = (0..needed.len()).map(|property| self.place(property, first_point)).collect();
                return Ok(Box::new(StoredReader { source, block_at: self.block.at, places }));
            }
            State::Checkpoints(checkpoints) => checkpoints,
        };
        let pieces = checkpoints.len() / self.properties.len().max(1);
        let piece = usize::try_from(first_point / self.step).unwrap_or(usize::MAX);
        let size = Self::at_once(needed.iter().filter(|needed| **needed).count());
        let decoder = |(property, needed): (usize, &bool)| {
            let checkpoint = checkpoints.get(property * pieces + piece).filter(|_| *needed)?;
            Some(Decoder::new(source, self.block, checkpoint, size))
        };
        let mut decoders: Vec<_> = needed.iter().enumerate().map(decoder).collect();
        for (property, decoder) in decoders.iter_mut().enumerate() {
            let skipped = decoder.as_mut().map_or(Ok(()), |d| d.skip_to(self.place(property, first_point)));
            skipped.map_err(|stop| self.error(source, stop))?;
        }
        Ok(Box::new(Reader { planes: self, source, decoders }))
    }

    fn reader_bytes(&self, needed: &[bool]) -> u64 {
        let State::Checkpoints(checkpoints) = &self.state else { return 8 * needed.len() as u64 };
        let decoders = needed.iter().filter(|needed| **needed).count();
        let readers =
            needed.len() * size_of::<Option<Decoder<'_>>>() + decoders * Decoder::bytes(Self::at_once(decoders));
        (checkpoints.iter().map(Checkpoint::bytes).sum::<usize>() + readers) as u64
    }
}

impl Compressed {
    fn error(&self, source: &Source, stop: Stop) -> ReadError {
        match stop {
            Stop::Read(error) => error,
            Stop::Damaged(what) => self.damaged(source, &what),
        }
    }
}

/// A decompressor for each property that is needed.
struct Reader<'a> {
    planes: &'a Compressed,
    source: &'a Source,
    decoders: Vec<Option<Decoder<'a>>>,
}

impl PlaneReader for Reader<'_> {
    fn read(&mut self, property: usize, out: &mut [u8]) -> Result<(), ReadError> {
        let Some(Some(decoder)) = self.decoders.get_mut(property) else { return Ok(()) };
        decoder.fill(out).map_err(|stop| self.planes.error(self.source, stop))
    }
}

/// Reads a block that is not compressed.
struct StoredReader<'a> {
    source: &'a Source,
    block_at: u64,
    /// By property: where the next value is in the block.
    places: Vec<u64>,
}

impl PlaneReader for StoredReader<'_> {
    fn read(&mut self, property: usize, out: &mut [u8]) -> Result<(), ReadError> {
        let Some(place) = self.places.get_mut(property) else { return Ok(()) };
        self.source.read_at(self.block_at + *place, out)?;
        *place += out.len() as u64;
        Ok(())
    }
}

/// The bytes of the block and what it becomes, from the two lengths before it.
///
/// # Errors
/// They cannot be right.
pub(super) fn block(source: &Source, lengths_at: u64, points: u64, stride: u64) -> Result<Block, ReadError> {
    let broken = |at: u64, what: String| ReadError::broken(source.path(), at, what);
    let at = lengths_at + 8;
    if source.len() < at {
        return Err(broken(source.len(), "the compressed block is missing".to_owned()).advise(Advice::CutShort));
    }
    let [c0, c1, c2, c3, d0, d1, d2, d3] = source.array_at::<8>(lengths_at)?;
    let len = u64::from(u32::from_le_bytes([c0, c1, c2, c3]));
    let decompressed = u64::from(u32::from_le_bytes([d0, d1, d2, d3]));
    let there = source.len() - at;
    if len > there {
        let what = format!("{there} of {len} compressed bytes are there");
        return Err(broken(source.len(), what).advise(Advice::CutShort));
    }
    if !decompressed.is_multiple_of(stride) || decompressed > lzf::most(len) {
        let what = format!(
            "{points} points of {stride} bytes cannot be in a block of {len} bytes that claims to become {decompressed}"
        );
        return Err(broken(lengths_at, what).advise(Advice::Damaged));
    }
    Ok(Block { at, len, decompressed })
}

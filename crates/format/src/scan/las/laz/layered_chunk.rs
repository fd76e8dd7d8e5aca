//! Chunks of layers, one alone or two in turn.

use super::channels::Meta;
use super::coder::Coder;
use super::lanes::LANES;
use super::layered::{BLOCK, Decoder, Lane, LayeredModels, Part, Parts};
use super::pointwise::Filled;
use super::stop::Stop;

/// Bytes of the count of points, and of the size of a layer.
const COUNT: usize = 4;

/// Decodes consecutive records of one chunk.
pub(in super::super) struct Layered<'m, 'a> {
    models: &'m mut LayeredModels,
    chunk: Chunk<'a>,
}

impl<'m, 'a> Layered<'m, 'a> {
    /// A decoder of the `parts` of a chunk; what else a record has is that of the first one.
    ///
    /// # Errors
    /// Layers that are longer than the chunk, or too short to begin.
    pub(in super::super) fn new(models: &'m mut LayeredModels, chunk: &'a [u8], parts: Parts) -> Result<Self, Stop> {
        let chunk = Chunk::new(models, chunk, parts)?;
        Ok(Self { models, chunk })
    }

    /// Fills `out` with whole records.
    pub(in super::super) fn fill(&mut self, out: &mut [u8]) -> Filled {
        self.chunk.fill(&mut self.models.lanes[0], out)
    }
}

/// Decodes two chunks in turn.
pub(in super::super) struct LayeredPair<'m, 'a> {
    models: &'m mut LayeredModels,
    chunks: [Chunk<'a>; LANES],
}

impl<'m, 'a> LayeredPair<'m, 'a> {
    /// As [`Layered::new`]; both chunks must be sound.
    pub(in super::super) fn new(
        models: &'m mut LayeredModels,
        [one, other]: [&'a [u8]; LANES],
        parts: Parts,
    ) -> Result<Self, Stop> {
        let chunks = [Chunk::new(models, one, parts)?, Chunk::new(models, other, parts)?];
        Ok(Self { models, chunks })
    }

    /// Fills `outs` with whole records of the one and of the other chunk, of which none has stopped before if it is to
    /// give records.
    pub(in super::super) fn fill(&mut self, mut outs: [&mut [u8]; LANES]) -> [Filled; LANES] {
        let Self { models: LayeredModels { lanes, record_len: len, .. }, chunks } = self;
        let (mut filled, len) = ([(0, Ok(())), (0, Ok(()))], *len);
        for (lane, (out, (good, _))) in outs.iter_mut().zip(&mut filled).enumerate() {
            *good = chunks[lane].first(&mut lanes[lane], out);
        }
        while let [(a, Ok(())), (b, Ok(()))] = &mut filled {
            let [one, other] = &mut outs;
            let both = (one.len() / len - *a).min(other.len() / len - *b).min(BLOCK);
            if both == 0 {
                break;
            }
            let records = [&mut one[*a * len..][..both * len], &mut other[*b * len..][..both * len]];
            let [(more_a, why_a), (more_b, why_b)] = Chunk::blocks(chunks, lanes, records);
            filled = [(*a + more_a, why_a), (*b + more_b, why_b)];
        }
        for (lane, (out, (good, result))) in outs.into_iter().zip(&mut filled).enumerate() {
            if result.is_ok() {
                let (more, why) = chunks[lane].fill(&mut lanes[lane], &mut out[*good * len..]);
                (*good, *result) = (*good + more, why);
            }
        }
        filled
    }
}

/// A place in a chunk.
struct Chunk<'a> {
    chunk: &'a [u8],
    record_len: usize,
    /// For each layer a place, if it is decoded.
    layers: Vec<Option<LayerPlace<'a>>>,
    is_started: bool,
}

/// Where the decoder of a layer stands.
struct LayerPlace<'a> {
    /// Bytes from the start of the chunk to the layer.
    start: usize,
    coder: Coder<'a>,
}

impl LayerPlace<'_> {
    /// An error if the decoder has met what no encoder writes, or the end of the layer.
    fn check(&self, layer: &'static str) -> Result<(), Stop> {
        let at = self.start + self.coder.at();
        match (self.coder.is_off(), self.coder.is_broken()) {
            (false, _) => Ok(()),
            (true, true) => Err(Stop::senseless(at as u64)),
            (true, false) => Err(Stop::LayerEnds { at, layer }),
        }
    }
}

impl<'a> Chunk<'a> {
    fn new(models: &LayeredModels, chunk: &'a [u8], parts: Parts) -> Result<Self, Stop> {
        let (record_len, decoders) = (models.record_len, &models.lanes[0].decoders);
        let head = record_len + COUNT;
        let mut start = head + COUNT * decoders.len();
        let sizes = chunk.get(head..start).unwrap_or_default().as_chunks::<COUNT>().0;
        let mut layers = Vec::with_capacity(decoders.len());
        for (i, (decoder, size)) in decoders.iter().zip(sizes).enumerate() {
            let size = u32::from_le_bytes(*size) as usize;
            let bytes = chunk.get(start..).and_then(|rest| rest.get(..size));
            let Some(bytes) = bytes else {
                let why = format!("the layer of {} has {size} bytes, more than are there", decoder.name());
                return Err(Stop::Corrupt { at: (head + COUNT * i) as u64, why });
            };
            let is_needed = size > 0 || decoder.part() == Part::Base;
            let is_decoded = is_needed && parts.has(decoder.part()) && decoder.part() != Part::WavePacket;
            layers.push(is_decoded.then(|| LayerPlace { start, coder: Coder::start(bytes, 0) }));
            start += size;
        }
        match layers.first() {
            Some(Some(_)) => Ok(Self { chunk, record_len, layers, is_started: false }),
            _ => Err(Stop::Corrupt { at: 0, why: "its head is not that of a chunk".to_owned() }),
        }
    }

    fn fill(&mut self, lane: &mut Lane, out: &mut [u8]) -> Filled {
        let len = self.record_len;
        let mut good = self.first(lane, out);
        while good * len < out.len() {
            let rest = &mut out[good * len..];
            let most = rest.len().min(BLOCK * len);
            let (more, result) = self.block(lane, &mut rest[..most]);
            good += more;
            if result.is_err() {
                return (good, result);
            }
        }
        (good, Ok(()))
    }

    fn first_record(&self) -> &'a [u8] {
        &self.chunk[..self.record_len]
    }

    /// Writes the first record, if it is due and `out` has room for it; returns the number of records written.
    fn first(&mut self, lane: &mut Lane, out: &mut [u8]) -> usize {
        let first = self.first_record();
        let Some(record) = out.get_mut(..first.len()).filter(|_| !self.is_started) else { return 0 };
        self.is_started = true;
        record.copy_from_slice(first);
        let mut channel = 0;
        for (decoder, place) in lane.decoders.iter_mut().zip(&self.layers) {
            if place.is_some() {
                decoder.start(first, &mut channel);
            }
        }
        1
    }

    /// Decodes at most [`BLOCK`] records.
    fn block(&mut self, lane: &mut Lane, records: &mut [u8]) -> Filled {
        let mut block = Block::new(self, lane, records);
        (0..block.layers.len()).for_each(|layer| block.go_on(layer, None));
        (block.good, block.result)
    }

    /// Decodes as many records of two chunks, at most [`BLOCK`] of each.
    fn blocks(
        [one, other]: &mut [Self; LANES],
        [one_lane, other_lane]: &mut [Lane; LANES],
        [one_records, other_records]: [&mut [u8]; LANES],
    ) -> [Filled; LANES] {
        let mut one = Block::new(one, one_lane, one_records);
        let mut other = Block::new(other, other_lane, other_records);
        for layer in 0..one.layers.len() {
            let done = Block::in_turn(&mut one, &mut other, layer);
            one.go_on(layer, done.map(|[done, _]| done));
            other.go_on(layer, done.map(|[_, done]| done));
        }
        [(one.good, one.result), (other.good, other.result)]
    }
}

/// Records of a chunk that are decoded layer after layer.
struct Block<'b, 'a> {
    record_len: usize,
    layers: &'b mut [Option<LayerPlace<'a>>],
    decoders: &'b mut [Decoder],
    points: &'b mut [Meta],
    records: &'b mut [u8],
    good: usize,
    result: Result<(), Stop>,
}

impl<'b, 'a> Block<'b, 'a> {
    /// Records as the first one of the chunk.
    fn new(chunk: &'b mut Chunk<'a>, lane: &'b mut Lane, records: &'b mut [u8]) -> Self {
        let (first, record_len) = (chunk.first_record(), chunk.record_len);
        records.chunks_exact_mut(record_len).for_each(|record| record.copy_from_slice(first));
        let Lane { decoders, points } = lane;
        let good = records.len() / record_len;
        Self { record_len, layers: &mut chunk.layers, decoders, points, records, good, result: Ok(()) }
    }

    /// Decodes a layer of two chunks in turn, if both have it, as far as both have points and no error shows. Returns how
    /// many points are done.
    fn in_turn(one: &mut Self, other: &mut Self, layer: usize) -> Option<[usize; LANES]> {
        let (both, len) = (one.good.min(other.good), one.record_len);
        let (Some(place), Some(other_place)) = (&mut one.layers[layer], &mut other.layers[layer]) else { return None };
        if both == 0 || place.coder.is_off() || other_place.coder.is_off() {
            return None;
        }
        Decoder::run_two(
            [&mut one.decoders[layer], &mut other.decoders[layer]],
            [&mut place.coder, &mut other_place.coder],
            [&mut one.points[..both], &mut other.points[..both]],
            [&mut one.records[..both * len], &mut other.records[..both * len]],
            len,
        )
    }

    /// Decodes a layer, or the rest if some points of it are done.
    fn go_on(&mut self, layer: usize, done: Option<usize>) {
        let Self { record_len: len, layers, decoders, points, records, good, result } = self;
        let Some(place) = &mut layers[layer] else { return };
        let decoder = &mut decoders[layer];
        let is_over = done.is_some() && place.coder.is_off();
        let mut done = done.unwrap_or(0);
        if !is_over && done < *good {
            let records = &mut records[done * *len..*good * *len];
            done += decoder.run(&mut place.coder, &mut points[done..*good], records, *len);
        }
        if place.coder.is_off() {
            (*good, *result) = (done, place.check(decoder.name()));
        }
    }
}

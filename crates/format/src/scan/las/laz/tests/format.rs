//! Point formats, points for them, and their chunks as the crate `laz` writes them.

use std::io::Cursor;

use ::laz::LazVlr;
use ::laz::record::{LayeredPointRecordCompressor, RecordCompressor, SequentialPointRecordCompressor};
use pointmill_testkit::Random;

use super::super::{
    Filled, Input, Item, ItemKind, Layered, LayeredModels, LayeredPair, Pair, Part, Parts, Pointwise, PointwiseModels,
    Stop, record_len,
};

/// A point format with extra bytes, in a version of LASzip.
#[derive(Debug, Clone, Copy)]
pub(super) struct Format {
    pub(super) number: u8,
    pub(super) extra: u16,
    pub(super) version: u16,
}

/// Every format that is written today, without extra bytes and with some.
pub(super) fn formats() -> impl Iterator<Item = Format> {
    let versions = |number: u8| if number < 6 { 2..=2 } else { 3..=4 };
    (0..=10u8).flat_map(move |number| {
        versions(number).flat_map(move |version| [0, 1, 7].map(|extra| Format { number, extra, version }))
    })
}

/// What is decoded of layered chunks: all but waveforms.
pub(super) fn all_parts() -> Parts {
    [Part::Class, Part::Flags, Part::Intensity, Part::Angle, Part::User, Part::Source, Part::Time]
        .into_iter()
        .chain([Part::Rgb, Part::Nir, Part::ExtraBytes])
        .fold(Parts::POSITIONS, Parts::with)
}

/// Fills records.
type Fill<'a> = dyn FnMut(&mut [u8]) -> (usize, Result<(), Stop>) + 'a;

/// Fills records of two chunks.
type FillTwo<'a> = dyn FnMut([&mut [u8]; 2]) -> [Filled; 2] + 'a;

/// What a decoder gave: whole records, and why there are no more.
pub(super) type Decoded = (Vec<u8>, Result<(), Stop>);

impl Format {
    pub(super) fn is_layered(self) -> bool {
        self.number >= 6
    }

    pub(super) fn items(self) -> Vec<Item> {
        use ItemKind as K;
        let kinds: &[K] = match self.number {
            0 => &[K::Point10],
            1 => &[K::Point10, K::GpsTime11],
            2 => &[K::Point10, K::Rgb12],
            3 => &[K::Point10, K::GpsTime11, K::Rgb12],
            4 => &[K::Point10, K::GpsTime11, K::WavePacket13],
            5 => &[K::Point10, K::GpsTime11, K::Rgb12, K::WavePacket13],
            6 => &[K::Point14],
            7 => &[K::Point14, K::Rgb14],
            8 => &[K::Point14, K::RgbNir14],
            9 => &[K::Point14, K::WavePacket14],
            _ => &[K::Point14, K::RgbNir14, K::WavePacket14],
        };
        let extra = if self.is_layered() { K::Byte14 } else { K::Byte };
        let kinds = kinds.iter().copied().chain((self.extra > 0).then_some(extra));
        let version = |kind| if kind == K::WavePacket13 { 1 } else { self.version };
        let item = |kind: K| Item { kind, bytes: kind.bytes().unwrap_or(self.extra), version: version(kind) };
        kinds.map(item).collect()
    }

    pub(super) fn record_len(self) -> usize {
        record_len(&self.items())
    }

    /// Lengths of the fields of a record, in order.
    fn fields(self) -> Vec<usize> {
        let mut out = vec![4, 4, 4, 2, 1, 1, 1, 1, 2];
        if self.is_layered() {
            out.extend([2, 8]);
        }
        for item in &self.items()[1..] {
            match item.kind {
                ItemKind::GpsTime11 => out.push(8),
                ItemKind::Rgb12 | ItemKind::Rgb14 => out.extend([2; 3]),
                ItemKind::RgbNir14 => out.extend([2; 4]),
                ItemKind::WavePacket13 | ItemKind::WavePacket14 => out.extend([1, 8, 4, 4, 4, 4, 4]),
                _ => out.extend(vec![1; usize::from(self.extra)]),
            }
        }
        assert_eq!(out.iter().sum::<usize>(), self.record_len());
        out
    }

    /// Points whose fields differ from those of the point before in `share` (0 to 1) of all cases: a little, much, or
    /// in a way that was there before.
    pub(super) fn points(self, points: usize, share: f64, random: &mut Random) -> Vec<u8> {
        let fields = self.fields();
        let mut out: Vec<u8> = (0..self.record_len()).map(|_| random.next_u32() as u8).collect();
        let len = out.len();
        for _ in 1..points {
            let mut record = out[out.len() - len..].to_vec();
            let mut at = 0;
            for &size in &fields {
                let field = &mut record[at..at + size];
                if random.unit() < share {
                    let mut wide = [0; 8];
                    wide[..size].copy_from_slice(field);
                    let old = u64::from_le_bytes(wide);
                    let new = match random.below(8) {
                        0 => random.next_u64(),
                        1 => old.wrapping_add(u64::from(random.next_u32())),
                        2 => old.wrapping_sub(random.below(1000)),
                        3 if out.len() > 9 * len => {
                            let before = &out[out.len() - 9 * len + at..][..size];
                            wide[..size].copy_from_slice(before);
                            u64::from_le_bytes(wide)
                        }
                        _ => old.wrapping_add(random.below(7) * 20),
                    };
                    field.copy_from_slice(&new.to_le_bytes()[..size]);
                }
                at += size;
            }
            out.extend(record);
        }
        out
    }

    /// The items as the crate `laz` has them.
    pub(super) fn laz_items(self) -> Vec<::laz::LazItem> {
        let mut record = vec![0; 34];
        record[0] = if self.is_layered() { 3 } else { 2 };
        let items = self.items();
        record[32] = items.len() as u8;
        for Item { kind, bytes, version } in items {
            record.extend([kind as u16, bytes, version].map(u16::to_le_bytes).as_flattened());
        }
        LazVlr::from_buffer(&record).unwrap().items().clone()
    }

    /// A chunk of these points.
    pub(super) fn chunk(self, points: &[u8]) -> Vec<u8> {
        let mut encoder: Box<dyn RecordCompressor<Cursor<Vec<u8>>>> = if self.is_layered() {
            Box::new(LayeredPointRecordCompressor::new(Cursor::default()))
        } else {
            Box::new(SequentialPointRecordCompressor::new(Cursor::default()))
        };
        encoder.set_fields_from(&self.laz_items()).unwrap();
        encoder.compress_many(points).unwrap();
        encoder.done().unwrap();
        encoder.box_into_inner().into_inner()
    }

    /// Decodes a chunk, in parts of `step` points.
    pub(super) fn decode(self, models: &mut Models, chunk: &[u8], points: usize, step: usize) -> Decoded {
        let len = self.record_len();
        let mut out = vec![0; points * len];
        let mut good = 0;
        let fill: &mut Fill<'_> = match models {
            Models::Layered(models) => match Layered::new(models, chunk, all_parts()) {
                Ok(mut decoder) => &mut move |out| decoder.fill(out),
                Err(stop) => return (Vec::new(), Err(stop)),
            },
            Models::Pointwise(models) => {
                let mut decoder = Pointwise::new(models, Input::Whole(chunk));
                &mut move |out| decoder.fill(out)
            }
        };
        let mut result = Ok(());
        for part in out.chunks_mut(step * len) {
            let more;
            (more, result) = fill(part);
            good += more;
            if result.is_err() {
                break;
            }
        }
        out.truncate(good * len);
        (out, result)
    }

    /// Decodes two chunks in turn, of so many points, in parts of `step` points.
    pub(super) fn decode_two(
        self,
        models: &mut Models,
        chunks: [&[u8]; 2],
        points: [usize; 2],
        step: usize,
    ) -> [Decoded; 2] {
        let len = self.record_len();
        let fill: &mut FillTwo<'_> = match models {
            Models::Layered(models) => match LayeredPair::new(models, chunks, all_parts()) {
                Ok(mut pair) => &mut move |outs| pair.fill(outs),
                // such chunks are decoded alone
                Err(_) => return [0, 1].map(|i| self.decode(&mut self.models(), chunks[i], points[i], step)),
            },
            Models::Pointwise(models) => {
                let mut pair = Pair::new(models, chunks);
                &mut move |outs| pair.fill(outs)
            }
        };
        let mut outs = points.map(|points| vec![0; points * len]);
        let (mut good, mut results) = ([0; 2], [Ok(()), Ok(())]);
        for _ in 0..=points[0].max(points[1]) / step {
            let [one, other] = &mut outs;
            let rest =
                |out: &[u8], i: usize| if results[i].is_ok() { (out.len() - good[i]).min(step * len) } else { 0 };
            let lens = [rest(one, 0), rest(other, 1)];
            let parts = [&mut one[good[0]..][..lens[0]], &mut other[good[1]..][..lens[1]]];
            for (i, (more, result)) in fill(parts).into_iter().enumerate().filter(|(i, _)| lens[*i] > 0) {
                good[i] += more * len;
                results[i] = result;
            }
        }
        let [one, other] = &mut outs;
        one.truncate(good[0]);
        other.truncate(good[1]);
        let ([one, other], [why_one, why_other]) = (outs, results);
        [(one, why_one), (other, why_other)]
    }

    pub(super) fn models(self) -> Models {
        match self.is_layered() {
            true => Models::Layered(Box::new(LayeredModels::new(&self.items()))),
            false => Models::Pointwise(Box::new(PointwiseModels::new(&self.items()))),
        }
    }

    /// Puts what is not decoded at its value in the first record: the waveforms of layered chunks.
    pub(super) fn without_waveforms(self, mut points: Vec<u8>) -> Vec<u8> {
        let mut at = 0;
        for item in self.items() {
            let end = at + usize::from(item.bytes);
            if item.kind == ItemKind::WavePacket14 && !points.is_empty() {
                let first = points[at..end].to_vec();
                points.chunks_exact_mut(self.record_len()).for_each(|record| record[at..end].copy_from_slice(&first));
            }
            at = end;
        }
        points
    }
}

/// The models of either kind.
pub(super) enum Models {
    Pointwise(Box<PointwiseModels>),
    Layered(Box<LayeredModels>),
}

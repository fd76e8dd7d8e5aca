//! LAZ points to records, a slice at a time, guarded: no input panics, aborts or allocates beyond its own size.

use std::io::{Cursor, ErrorKind, Read};

use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{DecompressionSelection, LazItem};

use super::chunk_table::{Chunk, Layout};
use super::schema::{Layer, Schema};
use crate::Wanted;
use crate::scan::catch_panic::catch_panic;
use crate::scan::source::Source;

/// Why a decode ended before its points were complete.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Stop {
    /// The bytes ended; records before are as good as the file.
    CutShort,
    /// The bytes contradict themselves.
    Corrupt(String),
}

/// Decodes consecutive records of one chunk.
pub(super) struct Decompressor<'a, R> {
    inner: Box<dyn RecordDecompressor<R> + 'a>,
    record_len: usize,
}

impl<'a, R: Read + 'a> Decompressor<'a, R> {
    /// For records compressed one after the other.
    pub(super) fn sequential(items: &Vec<LazItem>, record_len: usize, reader: R) -> Result<Self, Stop> {
        let mut inner = SequentialPointRecordDecompressor::new(reader);
        inner.set_fields_from(items).map_err(|e| Stop::Corrupt(e.to_string()))?;
        Self::checked(Box::new(inner), record_len)
    }
}

impl<'a> Decompressor<'a, Cursor<&'a [u8]>> {
    /// For a layered chunk of at least `points` points; decodes only the layers in `selection`.
    pub(super) fn layered(
        items: &Vec<LazItem>,
        layout: Layout,
        selection: DecompressionSelection,
        chunk: &'a [u8],
        points: u64,
    ) -> Result<Self, Stop> {
        // the decompressor allocates what the layer sizes say: they must lie inside the chunk
        match layout.layered_head(chunk) {
            Some(head) if head.bytes <= chunk.len() as u64 && head.points >= points => {}
            Some(Chunk { points, bytes }) => {
                return Err(Stop::Corrupt(format!("it says of itself that it has {points} points in {bytes} bytes")));
            }
            None => return Err(Stop::Corrupt("its head is not that of a chunk".to_owned())),
        }
        let mut inner = LayeredPointRecordDecompressor::new(Cursor::new(chunk));
        inner.set_fields_from(items).map_err(|e| Stop::Corrupt(e.to_string()))?;
        inner.set_selection(selection);
        Self::checked(Box::new(inner), layout.record_len)
    }
}

impl<'a, R> Decompressor<'a, R> {
    fn checked(inner: Box<dyn RecordDecompressor<R> + 'a>, record_len: usize) -> Result<Self, Stop> {
        // a decompressor that writes more than a record panics; `LaszipRecord` has seen to this already
        match inner.record_size() {
            size if size == record_len => Ok(Self { inner, record_len }),
            size => Err(Stop::Corrupt(format!("its items make {size} bytes per record, not {record_len}"))),
        }
    }

    /// Fills `out` with whole records. Returns how many are good, and why it stopped if that is not all.
    pub(super) fn fill(&mut self, out: &mut [u8]) -> (usize, Result<(), Stop>) {
        let mut good = 0;
        let result = catch_panic(|| -> std::io::Result<()> {
            for record in out.chunks_exact_mut(self.record_len) {
                self.inner.decompress_next(record)?;
                good += 1;
            }
            Ok(())
        });
        let result = match result {
            Ok(Ok(())) => Ok(()),
            Ok(Err(e)) if e.kind() == ErrorKind::UnexpectedEof => Err(Stop::CutShort),
            Ok(Err(e)) => Err(Stop::Corrupt(e.to_string())),
            Err(panic) => Err(Stop::Corrupt(format!("the decompressor failed: {panic}"))),
        };
        (good, result)
    }

    /// The reader, behind the last byte that was used.
    pub(super) fn into_inner(self) -> R {
        self.inner.box_into_inner()
    }
}

/// Counts the points of one chunk of sequential records by decoding it, at most `chunk.points`.
pub(super) fn count_points(source: &Source, items: &Vec<LazItem>, at: u64, chunk: Chunk) -> u64 {
    let record_len = items.iter().map(|item| usize::from(item.size())).sum();
    let reader = source.reader(at, at + chunk.bytes);
    let Ok(mut decompressor) = Decompressor::sequential(items, record_len, reader) else { return 0 };
    let mut record = vec![0; record_len];
    let mut count = 0;
    while count < chunk.points && decompressor.fill(&mut record).1.is_ok() {
        count += 1;
    }
    count
}

/// True if the bytes of one chunk of sequential records hold exactly its points: the last one ends with the bytes.
pub(super) fn is_exactly(source: &Source, items: &Vec<LazItem>, at: u64, chunk: Chunk) -> bool {
    let record_len = items.iter().map(|item| usize::from(item.size())).sum();
    let reader = source.reader(at, at + chunk.bytes);
    let Ok(mut decompressor) = Decompressor::sequential(items, record_len, reader) else { return false };
    let mut record = vec![0; record_len];
    let all = (0..chunk.points).all(|_| decompressor.fill(&mut record).1.is_ok());
    all && matches!(decompressor.into_inner().read(&mut [0]), Ok(0))
}

/// The layers that `wanted` needs. Waveform packets are never among them.
pub(super) fn selection(schema: &Schema, wanted: &Wanted) -> DecompressionSelection {
    use DecompressionSelection as S;
    let fields = schema.fields.iter().zip(wanted.flags()).filter(|(_, wanted)| **wanted);
    let bits = fields.fold(S::Z, |bits, (field, _)| {
        bits | match field.layer {
            Layer::Base => 0,
            Layer::Classification => S::CLASSIFICATION,
            Layer::Flags => S::FLAGS,
            Layer::Intensity => S::INTENSITY,
            Layer::ScanAngle => S::SCAN_ANGLE,
            Layer::UserData => S::USER_DATA,
            Layer::PointSource => S::POINT_SOURCE_ID,
            Layer::GpsTime => S::GPS_TIME,
            Layer::Rgb => S::RGB,
            Layer::Nir => S::NIR,
            Layer::ExtraBytes => S::ALL_EXTRA_BYTES,
        }
    });
    DecompressionSelection(bits)
}

#[cfg(test)]
mod tests {
    use laz::LazItemRecordBuilder;
    use laz::las::Point7;
    use laz::record::{LayeredPointRecordCompressor, RecordCompressor};

    use super::*;

    const RECORD_LEN: usize = 36;
    const LAYOUT: Layout = Layout { points_start: 0, record_len: RECORD_LEN, chunk_points: Some(50_000), layers: 10 };

    fn items() -> Vec<LazItem> {
        LazItemRecordBuilder::default_version_of::<Point7>(0)
    }

    /// A chunk of three points.
    fn chunk() -> Vec<u8> {
        let mut compressor = LayeredPointRecordCompressor::new(Cursor::new(Vec::new()));
        compressor.set_fields_from(&items()).unwrap();
        for i in 0..3u8 {
            compressor.compress_next(&[i; RECORD_LEN]).unwrap();
        }
        compressor.done().unwrap();
        compressor.into_inner().into_inner()
    }

    fn decode(chunk: &[u8], points: u64) -> Result<Vec<u8>, Stop> {
        let mut out = vec![0; RECORD_LEN * points as usize];
        Decompressor::layered(&items(), LAYOUT, DecompressionSelection::all(), chunk, points)?.fill(&mut out).1?;
        Ok(out)
    }

    /// The decompressor itself would allocate 4 GiB, or read a fourth point that is not there.
    #[test]
    fn a_chunk_whose_head_lies_is_refused_before_the_decompressor_sees_it() {
        let whole = chunk();
        assert_eq!(decode(&whole, 3).unwrap()[RECORD_LEN..2 * RECORD_LEN], [1; RECORD_LEN]);
        assert!(matches!(decode(&whole, 4), Err(Stop::Corrupt(_))));
        assert!(matches!(decode(&whole[..whole.len() - 1], 3), Err(Stop::Corrupt(_))));
        for layer in 0..LAYOUT.layers {
            let mut bytes = whole.clone();
            let at = RECORD_LEN + 4 + 4 * layer;
            bytes[at..at + 4].fill(0xff);
            assert!(matches!(decode(&bytes, 3), Err(Stop::Corrupt(_))), "layer {layer}");
        }
    }
}

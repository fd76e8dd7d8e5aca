//! The payload of one node, DEFAULT or BROTLI.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use pointmill_format::potree2::{BrotliScratch, encode_brotli_while};
use pointmill_format::{Attribute, AttributeType, NodeKey, WriteError};

use super::layout::OutputLayout;
use super::settings::Encoding;
use super::watch::{AllSeen, Seen, Watch};
use crate::cloud::{Checksum, copy_record};
use crate::error::ConvertError;
use crate::job::encode;
use crate::octree::NodeEncoder;
use crate::runtime::Events;

/// Records are first copied into a small tile: the copies are short and independent, so that the processor waits for
/// many scattered records at once, and what is done with them then happens in the first-level cache.
const TILE_RECORDS: usize = 128;

/// From this quality on the library may work for many seconds without asking whether to go on (11 s were seen on random
/// bytes). Up to the one below it asks several times a second, whatever the bytes: a third of a second was the longest.
const LONG_QUALITY: u8 = 10;

/// Nodes up to this size take less than half a second at any quality.
const SHORT_BYTES: usize = 64 << 10;

/// How often a run that waits for a node asks whether it is to stop.
const ASK: Duration = Duration::from_millis(100);

/// Bytes of a position in a Brotli payload.
const BROTLI_POSITION_BYTES: u64 = 16;

/// Turns stored records into payloads; one for each thread.
pub(crate) struct PayloadEncoder<'a> {
    events: &'a dyn Events,
    layout: OutputLayout,
    encoding: Encoding,
    attributes: Arc<[Attribute]>,
    watch: Option<(Watch, &'a AllSeen)>,
    seen: Seen,
    tile: Vec<u8>,
    plain: Vec<u8>,
    scratch: BrotliScratch,
}

impl<'a> PayloadEncoder<'a> {
    pub(crate) fn new(layout: OutputLayout, encoding: Encoding, events: &'a dyn Events) -> Self {
        let mut attributes = vec![Attribute::new("position", AttributeType::Int32, 3)];
        attributes.extend(layout.attributes.iter().cloned());
        let (tile, plain, scratch) = (Vec::new(), Vec::new(), BrotliScratch::default());
        Self {
            events,
            layout,
            encoding,
            attributes: attributes.into(),
            watch: None,
            seen: Seen::default(),
            tile,
            plain,
            scratch,
        }
    }

    /// Looks for values that viewers do not show as they are meant.
    pub(super) fn watching(mut self, watch: Watch, seen: &'a AllSeen) -> Self {
        self.watch = Some((watch, seen));
        self
    }

    fn interleave<'r>(
        &mut self,
        mut records: impl ExactSizeIterator<Item = &'r [u8]>,
        out: &mut Vec<u8>,
        checksum: &mut Checksum,
    ) {
        let stride = self.layout.stored_stride;
        out.reserve(records.len() * self.layout.stride);
        while records.len() > 0 {
            let (start, bytes) = (out.len(), records.len().min(TILE_RECORDS) * stride);
            if self.layout.keeps_records() {
                // put together where they stay
                out.resize(start + bytes, 0);
                gather(&mut records, &mut out[start..], stride);
                checksum.add_all(&out[start..], stride);
            } else {
                self.tile.resize(TILE_RECORDS * stride, 0);
                gather(&mut records, &mut self.tile[..bytes], stride);
                checksum.add_all(&self.tile[..bytes], stride);
                self.layout.select(&self.tile[..bytes], out);
            }
            self.layout.finish(&mut out[start..]);
            if let Some((watch, _)) = &self.watch {
                watch.look(&mut out[start..], self.layout.stride, &mut self.seen);
            }
        }
    }
}

impl Drop for PayloadEncoder<'_> {
    fn drop(&mut self) {
        if let Some((_, all)) = &self.watch {
            all.add(&self.seen);
        }
    }
}

/// Copies the next records, as many as there is room for.
#[inline(always)]
fn gather<'r>(records: &mut impl Iterator<Item = &'r [u8]>, out: &mut [u8], stride: usize) {
    for (slot, record) in out.chunks_exact_mut(stride).zip(records) {
        copy_record(record, slot);
    }
}

impl PayloadEncoder<'_> {
    fn check_stop(&self) -> Result<(), ConvertError> {
        if self.events.stop_requested() { Err(ConvertError::Interrupted) } else { Ok(()) }
    }

    /// Appends the compressed `plain` to `out`.
    fn compress(&mut self, quality: u8, out: &mut Vec<u8>) -> Result<(), ConvertError> {
        if quality >= LONG_QUALITY && self.plain.len() > SHORT_BYTES {
            return self.compress_apart(quality, out);
        }
        let goes_on = || !self.events.stop_requested();
        encode_brotli_while(&self.attributes, &self.plain, quality, &mut self.scratch, &goes_on, out).map_err(failed)
    }

    /// The same on another thread, which is left alone with its work if the run is to stop: it ends by itself at the next
    /// question.
    fn compress_apart(&mut self, quality: u8, out: &mut Vec<u8>) -> Result<(), ConvertError> {
        let is_left_alone = Arc::new(AtomicBool::new(false));
        let (send, receive) = channel();
        let (attributes, stop) = (Arc::clone(&self.attributes), Arc::clone(&is_left_alone));
        let (plain, mut scratch) = (std::mem::take(&mut self.plain), std::mem::take(&mut self.scratch));
        let work = move || {
            let mut out = Vec::new();
            let goes_on = || !stop.load(Ordering::Relaxed);
            let encoded = encode_brotli_while(&attributes, &plain, quality, &mut scratch, &goes_on, &mut out);
            let _ = send.send((encoded, out, plain, scratch)); // nobody waits for it if the run has stopped
        };
        std::thread::Builder::new()
            .name("pointmill-brotli".to_owned())
            .spawn(work)
            .map_err(|e| ConvertError::Internal(format!("starting a thread: {e}")))?;
        loop {
            match receive.recv_timeout(ASK) {
                Ok((encoded, bytes, plain, scratch)) => {
                    (self.plain, self.scratch) = (plain, scratch);
                    encoded.map_err(failed)?;
                    out.extend_from_slice(&bytes);
                    return Ok(());
                }
                Err(RecvTimeoutError::Timeout) => self.check_stop().inspect_err(|_| {
                    is_left_alone.store(true, Ordering::Relaxed);
                })?,
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(ConvertError::Internal("Brotli: its thread ended".to_owned()));
                }
            }
        }
    }
}

fn failed(error: WriteError) -> ConvertError {
    match error {
        WriteError::Stopped => ConvertError::Interrupted,
        other => ConvertError::Internal(format!("Brotli: {other}")),
    }
}

impl NodeEncoder for PayloadEncoder<'_> {
    fn encode<'r>(
        &mut self,
        _: NodeKey,
        records: impl ExactSizeIterator<Item = &'r [u8]>,
        written: &mut Checksum,
        out: &mut Vec<u8>,
    ) -> Result<(), ConvertError> {
        self.check_stop()?;
        match self.encoding {
            Encoding::Default => self.interleave(records, out, written),
            Encoding::Brotli { quality } => {
                let mut plain = std::mem::take(&mut self.plain);
                plain.clear();
                self.interleave(records, &mut plain, written);
                self.plain = plain;
                self.compress(quality, out)?;
            }
        }
        Ok(())
    }

    fn take_notes(&mut self) -> Result<Vec<u8>, ConvertError> {
        encode(&std::mem::take(&mut self.seen))
    }

    fn notice(&mut self, records: &mut [u8], but_for: &mut [u8]) {
        // stored records are those of the dataset but for their positions, which nobody watches
        let Some((watch, _)) = &self.watch else { return };
        let [mut all, mut others] = [Seen::default(); 2];
        watch.look(records, self.layout.stored_stride, &mut all);
        watch.look(but_for, self.layout.stored_stride, &mut others);
        self.seen.dark_points += all.dark_points.saturating_sub(others.dark_points);
        self.seen.many_returns += all.many_returns.saturating_sub(others.many_returns);
    }

    fn row_bytes(&self) -> Option<u64> {
        (self.encoding == Encoding::Default).then_some(self.layout.stride as u64)
    }

    fn bytes_per_point(&self) -> u64 {
        // plain and sorted records, planes and their compressed bytes; codes, keys, and the order of the points
        4 * (self.layout.stride as u64 + BROTLI_POSITION_BYTES) + 16 + 16 + 4
    }
}

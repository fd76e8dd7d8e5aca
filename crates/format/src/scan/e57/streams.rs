//! The packed values of a piece, gathered from its packets: one run of bytes per field.

use super::cuts::Cut;
use super::fields::Field;
use super::packets::Packet;
use super::pages::{PAGE, Pages, physical};
use super::unpack::PADDING;
use crate::ReadError;
use crate::scan::decode::resize;
use crate::scan::source::Source;

/// Pages that one read fetches: four packets of the largest size.
const WINDOW: u64 = 256;

/// Memory of what is counted for each field.
const FIELD_BYTES: u64 = 128;

/// Bytes of each stream of so many records; none of those that are not needed.
fn lengths(fields: &[Field], needed: &[bool], records: u64) -> impl Iterator<Item = u64> {
    let bits = fields.iter().zip(needed).map(|(field, needed)| if *needed { field.encoding.bits() } else { 0 });
    bits.map(move |bits| (records * u64::from(bits)).div_ceil(8))
}

/// The gathered bytes of each field.
pub(super) struct Streams<'a> {
    bytes: &'a [u8],
    /// By field: start and length in `bytes`, without padding.
    places: Vec<(usize, usize)>,
}

impl<'a> Streams<'a> {
    /// The packed values of a field from byte `from` on, with [`PADDING`]; none of a field that was not needed, or has
    /// no bits.
    pub(super) fn field(&self, field: usize, from: usize) -> &'a [u8] {
        let all = self.places.get(field).map_or(&[][..], |(start, len)| &self.bytes[*start..start + len + PADDING]);
        all.get(from..).unwrap_or_default()
    }

    /// Memory that gathering a piece of so many records takes.
    pub(super) fn bytes(fields: &[Field], needed: &[bool], records: u64) -> u64 {
        let streams: u64 = lengths(fields, needed, records).map(|len| len + PADDING as u64).sum();
        streams + WINDOW * PAGE + FIELD_BYTES * fields.len() as u64
    }

    /// Reads the streams of the fields that are `needed`. `raw` and `out` are memory to use.
    pub(super) fn gather(
        source: &Source,
        cut: &Cut,
        fields: &[Field],
        needed: &[bool],
        raw: &mut Vec<u8>,
        out: &'a mut Vec<u8>,
    ) -> Result<Self, ReadError> {
        let mut places = Vec::with_capacity(fields.len());
        let mut size = 0;
        for len in lengths(fields, needed, cut.records) {
            places.push((size, len as usize));
            size += len as usize + PADDING;
        }
        if out.len() < size {
            resize(out, size);
        }
        let mut skips = cut.skip.iter();
        let of_field = |field: &Field| if field.encoding.bits() > 0 { skips.next().copied().unwrap_or(0) } else { 0 };
        let mut skip: Vec<u64> = fields.iter().map(of_field).collect();
        let mut filled = vec![0; fields.len()];
        let mut missing = places.iter().filter(|(_, len)| *len > 0).count();
        let mut pages = Pages::new(source, raw, WINDOW);
        let (mut at, mut sizes) = (cut.start, Vec::new());
        while missing > 0 && at < cut.end {
            let packet = Packet::read(&mut pages, at, cut.end, fields.len(), &mut sizes)
                .map_err(|fault| ReadError::broken(source.path(), fault.byte, fault.what).advise(fault.advice))?;
            let mut stream = at + packet.streams.unwrap_or(0);
            for (f, size) in sizes.iter().enumerate() {
                let (start, len) = places[f];
                let skipped = skip[f].min(*size);
                skip[f] -= skipped;
                let n = ((size - skipped) as usize).min(len - filled[f]);
                if n > 0 {
                    let to = start + filled[f];
                    pages.read(stream + skipped, &mut out[to..to + n])?;
                    filled[f] += n;
                    missing -= usize::from(filled[f] == len);
                }
                stream += size;
            }
            at += packet.len;
        }
        if missing > 0 {
            let what = "packets are missing that were there when the file was opened";
            return Err(
                ReadError::broken(source.path(), physical(at), what).advise("convert it once nothing writes to it")
            );
        }
        Ok(Self { bytes: out, places })
    }
}

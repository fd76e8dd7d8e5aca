//! Layered chunks of a LAZ file whose places something else than the chunk table tells: the nodes of an octree.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use super::bytes::u32_at;
use super::chunk_table::{Chunk, Layout, MAX_CHUNKS};
use super::decompress::{self, LazModels};
use super::front::Front;
use super::kernels;
use super::laszip::LaszipRecord;
use super::laz::{Layered, Stop, decode_entries};
use super::schema::Schema;
use crate::bytes::ByteSource;
use crate::scan::source::Source;
use crate::{
    Aabb, Advice, Attribute, Column, Crs, Fault, Lattice, PointBatch, Positions, ReadError, ScanWarning, Wanted,
    with_column,
};

/// Points for which columns get room at a time: what a chunk says of itself takes no memory before so many of its points
/// were decoded.
const STEP_POINTS: usize = 1 << 16;

/// Where a chunk is, and what it should hold.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChunkPlace {
    pub(crate) offset: u64,
    pub(crate) bytes: u64,
    pub(crate) points: u64,
    /// More bytes than this, stored or as records, are refused.
    pub(crate) most_bytes: u64,
}

/// A compressed file of layered chunks (point formats 6–10).
#[derive(Debug)]
pub(crate) struct ChunkFile {
    source: Source,
    schema: Schema,
    laszip: LaszipRecord,
    layout: Layout,
    /// The record `copc` 1, and where its data is.
    info_record: Option<(u64, Vec<u8>)>,
    /// Models that no thread uses now.
    models: Mutex<Vec<LazModels>>,
    /// For people: "COPC, LAZ 1.4, point format 7".
    pub(crate) format: String,
    pub(crate) version: (u8, u8),
    pub(crate) point_format: u8,
    /// By the header.
    pub(crate) points: u64,
    /// By the header; `None` if it says nothing or nonsense.
    pub(crate) bounds: Option<Aabb>,
    pub(crate) lattice: Lattice,
    pub(crate) crs: Crs,
    pub(crate) warnings: Vec<ScanWarning>,
}

impl ChunkFile {
    /// Reads what stands around the points; not the chunk table.
    ///
    /// # Errors
    /// As [`super::open`]; points that are not in layered chunks.
    pub(crate) fn open(path: &Path) -> Result<Self, ReadError> {
        Self::read_front(Source::open(path)?)
    }

    /// The file `file` of any source.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub(crate) fn from_source(source: impl ByteSource + 'static, file: &str) -> Result<Self, ReadError> {
        Self::read_front(Source::elsewhere(source, file)?)
    }

    fn read_front(source: Source) -> Result<Self, ReadError> {
        let front = Front::read(&source)?;
        let format = front.format_name();
        let Front { header, records, schema, laszip, crs, warnings } = front;
        let laszip = laszip.filter(|laszip| laszip.layers() > 0).ok_or_else(|| {
            ReadError::unsupported(source.path(), format!("{format}: its points are not in layered chunks"))
        })?;
        let layout = Layout {
            points_start: header.points_start,
            record_len: header.record_len,
            chunk_points: None,
            layers: laszip.layers(),
        };
        Ok(Self {
            schema,
            laszip,
            layout,
            info_record: records.find("copc", 1).map(|record| (record.data_offset, record.data.clone())),
            models: Mutex::default(),
            format,
            version: header.version,
            point_format: header.point_format,
            points: header.point_count,
            bounds: header.bounds,
            lattice: header.lattice,
            crs,
            warnings,
            source,
        })
    }

    pub(crate) fn path(&self) -> &Path {
        self.source.path()
    }

    /// Bytes of the file.
    pub(crate) fn len(&self) -> u64 {
        self.source.len()
    }

    /// Fills `buf` with the bytes from `offset` on.
    ///
    /// # Errors
    /// Those of the operating system, and a file that ends before.
    pub(crate) fn read_at(&self, offset: u64, buf: &mut [u8]) -> Result<(), ReadError> {
        self.source.read_at(offset, buf)
    }

    /// The columns beside the position, in order.
    pub(crate) fn attributes(&self) -> &[Attribute] {
        &self.schema.attributes
    }

    /// First byte of the first chunk.
    pub(crate) fn chunks_start(&self) -> u64 {
        self.layout.chunks_start()
    }

    /// The record of the user `copc` with the number 1, and the byte at which its data stands.
    pub(crate) fn info_record(&self) -> Option<(u64, &[u8])> {
        self.info_record.as_ref().map(|(at, data)| (*at, data.as_slice()))
    }

    /// Decodes a chunk, to columns that are those of [`Self::attributes`]. `stored` is left with its bytes. What is in
    /// `positions` and `columns` before is lost.
    ///
    /// `who` names the chunk in messages.
    ///
    /// # Errors
    /// A chunk that is not in the file or of which its own head says something else; bytes that make no sense; no memory.
    pub(crate) fn decode(
        &self,
        place: ChunkPlace,
        who: &str,
        stored: &mut Vec<u8>,
        positions: &mut [Vec<i32>; 3],
        columns: &mut Vec<Column>,
    ) -> Result<(), ReadError> {
        self.read(place, who, stored)?;
        let attributes = self.schema.attributes.as_slice();
        let mut batch = PointBatch::new(0, Positions::Quantized(std::mem::take(positions)), []);
        batch.columns = std::mem::take(columns);
        let mut models = self.models.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        let wanted: Wanted = attributes.iter().map(|_| true).collect();
        kernels::resize(0, &self.schema.fields, &wanted, &mut batch);
        let decoded = self.points(place, who, stored, &mut models, &wanted, &mut batch);
        if decoded.is_err() {
            kernels::resize(0, &self.schema.fields, &wanted, &mut batch);
        }
        self.models.lock().unwrap_or_else(PoisonError::into_inner).push(models);
        *columns = batch.columns;
        if let Positions::Quantized(axes) = batch.positions {
            *positions = axes;
        }
        decoded
    }

    /// Reads the bytes of a chunk, and compares what its head says.
    fn read(&self, place: ChunkPlace, who: &str, stored: &mut Vec<u8>) -> Result<(), ReadError> {
        let ChunkPlace { offset, bytes, points, most_bytes } = place;
        let path = self.source.path();
        stored.clear();
        let head = (self.layout.record_len + 4 + 4 * self.layout.layers) as u64;
        let there = self.source.vec_at(offset, head.min(bytes))?;
        // the head first: a chunk that lies about its length is not read
        match self.layout.layered_head(&there) {
            Some(head) if (head.points, head.bytes) == (points, bytes) => {}
            Some(Chunk { points: own, bytes: own_bytes }) => {
                let what = format!(
                    "{who} should have {points} points in {bytes} bytes; its chunk says that it has {own} in {own_bytes}"
                );
                return Err(ReadError::broken(path, offset, what).advise(Advice::ExportAgain));
            }
            None => {
                let what = format!("{who} should have {points} points in {bytes} bytes, but no chunk begins there");
                return Err(ReadError::broken(path, offset, what).advise(Advice::Damaged));
            }
        }
        let most = bytes.max(points.saturating_mul(self.layout.record_len as u64));
        if most > most_bytes {
            let what = format!("{who} would take {most} bytes of memory, {most_bytes} are allowed");
            return Err(ReadError::memory(path, what));
        }
        let room = usize::try_from(bytes).ok().filter(|len| stored.try_reserve_exact(*len).is_ok());
        let Some(len) = room else {
            return Err(ReadError::memory(path, format!("{who} would take {bytes} bytes of memory")));
        };
        stored.resize(len, 0);
        self.source.read_at(offset, stored)
    }

    fn points(
        &self,
        place: ChunkPlace,
        who: &str,
        stored: &[u8],
        models: &mut LazModels,
        wanted: &Wanted,
        batch: &mut PointBatch,
    ) -> Result<(), ReadError> {
        let parts = decompress::parts(&self.schema, wanted);
        let (mut good, record_len) = (0, self.layout.record_len);
        let all = usize::try_from(place.points).unwrap_or(usize::MAX);
        let mut decoder = Layered::new(models.layered(&self.laszip.items), stored, parts)
            .map_err(|stop| self.error(place, who, good, stop))?;
        let mut records = vec![0; kernels::BLOCK.min(all) * record_len];
        while good < all {
            let end = all.min(good + STEP_POINTS);
            if !self.has_room(end, batch) {
                return Err(ReadError::memory(
                    self.source.path(),
                    format!("the {all} points of {who} do not fit memory"),
                ));
            }
            kernels::resize(end, &self.schema.fields, wanted, batch);
            while good < end {
                let block = &mut records[..kernels::BLOCK.min(end - good) * record_len];
                let (more, result) = decoder.fill(block);
                kernels::fill(&block[..more * record_len], record_len, good, &self.schema.fields, wanted, batch);
                good += more;
                result.map_err(|stop| self.error(place, who, good, stop))?;
            }
        }
        Ok(())
    }

    /// Makes room for `points` points in all; false if there is no memory.
    fn has_room(&self, points: usize, batch: &mut PointBatch) -> bool {
        let Positions::Quantized(axes) = &mut batch.positions else { return false };
        let axes = axes.iter_mut().all(|axis| axis.try_reserve(points - axis.len()).is_ok());
        axes && self.schema.fields.iter().zip(&mut batch.columns).all(|(field, column)| {
            let values = points.saturating_mul(field.elements);
            with_column!(column, v => v.try_reserve(values.saturating_sub(v.len())).is_ok())
        })
    }

    fn error(&self, place: ChunkPlace, who: &str, good: usize, stop: Stop) -> ReadError {
        let ChunkPlace { offset, bytes, points, .. } = place;
        let (at, why, advice) = match stop {
            Stop::CutShort => (bytes, "the bytes end".to_owned(), Advice::CutShort),
            Stop::LayerEnds { at, layer } => (at as u64, format!("the layer of {layer} ends early"), Advice::Damaged),
            Stop::Corrupt { at, why } => (at, why, Advice::Damaged),
            Stop::Read(error) => return error,
        };
        let what = format!("{who} ({bytes} bytes) gives {good} of its {points} points: {why}");
        ReadError::broken(self.source.path(), offset + at.min(bytes), Fault::Other(what)).advise(advice)
    }
}

/// Points and bytes of the chunks of a chunk table that gives both, its head of 8 bytes included; `None` if it is none, or
/// has more entries than bytes allow.
#[must_use]
pub fn chunk_table_entries(table: &[u8]) -> Option<Vec<(u32, u32)>> {
    let (head, coded) = table.split_first_chunk::<8>()?;
    let (version, count) = (u32_at(head, 0), u32_at(head, 4) as usize);
    (version == 0 && count <= MAX_CHUNKS as usize).then(|| decode_entries(coded, count, true)).flatten()
}

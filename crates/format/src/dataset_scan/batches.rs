//! Quantised batches.

use std::path::Path;

use crate::batches::{
    BATCH_POINTS, BatchRecord, BatchScratch, Batches, ColourSource, Flags, Header, Original, Part, Precision,
};
use crate::scan::DatasetNote;
use crate::{Attribute, AttributeType, Column, Lattice, NodePoints, ReadError, Scan, ScanWarning};

use super::columns::{Becomes, Columns};
use super::crs::crs_of;
use super::described::{Described, NodeMemory, advised, file_bytes};
use super::node_scan::{NodeScan, Nodes};
use super::own_key::OwnKey;
use super::pieces::{PIECE_POINTS, Place};
use super::placing::held;

/// The file: mapped while a piece is decoded, and no longer, or all of it would count as memory of the process; without maps
/// read once.
#[cfg(feature = "mmap")]
type Bytes = crate::batches::MappedFile;
#[cfg(not(feature = "mmap"))]
type Bytes = crate::batches::AlignedBytes;

/// Memory of a decompressor of zstd.
const ZSTD_BYTES: u64 = 4 << 20;

/// The slots of a file.
struct Slots {
    #[cfg(feature = "mmap")]
    path: std::path::PathBuf,
    header: Header,
    records: Vec<BatchRecord>,
    #[cfg(not(feature = "mmap"))]
    file: Batches<Bytes>,
}

/// What a thread has open, and the memory that it uses again.
#[derive(Default)]
struct Open {
    #[cfg(feature = "mmap")]
    file: Option<Batches<Bytes>>,
    batch: BatchScratch,
}

impl Nodes for Slots {
    type Scratch = Open;

    fn len(&self) -> usize {
        self.records.len()
    }

    fn place(&self, node: usize) -> Place {
        let BatchRecord { points, first_point, .. } = self.records[node];
        let (points, start) = (u64::from(points), self.header.sections.hi10);
        match self.header.flags.has(Flags::COMPRESSED) {
            // where the blocks are is in their table
            true => Place { points, byte_offset: start, byte_size: 0 },
            false => Place { points, byte_offset: start + 4 * u64::from(first_point), byte_size: 4 * points },
        }
    }

    fn name(&self, node: usize) -> String {
        format!("batch {node}")
    }

    fn read(&self, node: usize, scratch: &mut Open, out: &mut NodePoints) -> Result<(), ReadError> {
        #[cfg(feature = "mmap")]
        let file = match &mut scratch.file {
            Some(file) => file,
            none => none.insert(self.map()?),
        };
        #[cfg(not(feature = "mmap"))]
        let file = &self.file;
        file.read_batch(node as u32, Precision::Thirty, &mut scratch.batch, out)?;
        restore(file, node as u32 * BATCH_POINTS, out)
    }

    #[cfg(feature = "mmap")]
    fn close(&self, scratch: &mut Open) {
        scratch.file = None;
    }
}

impl Slots {
    #[cfg(feature = "mmap")]
    fn map(&self) -> Result<Batches<Bytes>, ReadError> {
        let file = Batches::map(&self.path)?;
        if *file.header() == self.header && file.records() == self.records {
            return Ok(file);
        }
        Err(ReadError::broken(&self.path, 0, "it has changed since it was opened"))
    }
}

/// Puts the colours before averaging in place of those that are shown. `first`: storage index of the first point.
fn restore(file: &Batches<Bytes>, first: u32, points: &mut NodePoints) -> Result<(), ReadError> {
    let all = file.originals();
    let end = first.saturating_add(points.len() as u32);
    let own = &all[all.partition_point(|o| o.index < first)..];
    let own: &[Original] = &own[..own.partition_point(|o| o.index < end)];
    let ascend = own.windows(2).all(|pair| pair[0].index < pair[1].index);
    let Some(Column::UInt32(words)) = points.columns.first_mut() else { return Ok(()) };
    for Original { index, colour } in own {
        match index.checked_sub(first).and_then(|i| words.get_mut(i as usize)).filter(|_| ascend) {
            Some(word) => *word = *colour,
            None => return Err(lost_originals(file)),
        }
    }
    Ok(())
}

/// Opens the file `path`.
pub(super) fn open(path: &Path) -> Result<Box<dyn Scan>, ReadError> {
    #[cfg(feature = "mmap")]
    let file = Batches::map(path).map_err(advised)?;
    #[cfg(not(feature = "mmap"))]
    let file = Batches::open(path).map_err(advised)?;
    if file.originals().last().is_some_and(|last| u64::from(last.index) >= file.header().points) {
        return Err(lost_originals(&file));
    }
    let described = described(path, &file);
    let slots = Slots {
        #[cfg(feature = "mmap")]
        path: path.to_path_buf(),
        header: file.header().clone(),
        records: file.records().to_vec(),
        #[cfg(not(feature = "mmap"))]
        file,
    };
    Ok(Box::new(NodeScan::new(slots, described)))
}

fn lost_originals(batches: &Batches<Bytes>) -> ReadError {
    let what = "originals do not ascend, or belong to no point";
    advised(ReadError::broken(batches.path(), batches.header().sections.originals, what))
}

fn described(path: &Path, batches: &Batches<Bytes>) -> Described {
    let (header, description) = (batches.header(), batches.description());
    let mut warnings = Vec::new();
    let wkt = description.extra.get("wkt").and_then(|wkt| wkt.as_str());
    let crs = crs_of(wkt, &description.projection, &mut warnings);
    let lattice = Lattice::from(description.lattice);
    let columns = columns(batches);
    let has_rgb = columns.attributes().iter().any(|a| a.name == "rgb");
    if has_rgb && header.flags.has(Flags::AVERAGED) && !header.flags.has(Flags::ORIGINALS) {
        warnings.push(ScanWarning::Dataset(DatasetNote::ColoursAveraged));
    }
    warnings.extend(inexact(batches, &lattice));
    let size: u64 = batches.attributes().map(|a| a.size() as u64).sum();
    let stored = 16 + size;
    // of a piece what is mapped; the records and the description are looked at each time
    let mapped = header.points.min(PIECE_POINTS + 2 * u64::from(BATCH_POINTS)) * stored
        + batches.records().len() as u64 * size_of::<BatchRecord>() as u64
        + 2 * header.description_bytes;
    let (blocks, zstd) = match batches.is_compressed() {
        true => (block_batches(batches) * stored, ZSTD_BYTES),
        false => (0, 0),
    };
    // three words, three doubles, a colour, and the attributes
    let (per_point, decompressor) = (2 * (40 + size) + blocks, mapped + zstd);
    Described {
        path: path.to_path_buf(),
        format: format!("quantised batches, {} bits per coordinate", header.precision().bits()),
        bounds: (header.points > 0).then_some(header.tight),
        lattice: if header.points > 0 { held(&lattice, &header.tight) } else { Some(lattice) },
        step: lattice.scale,
        columns,
        crs,
        rgb_is_16_bit: false,
        bytes: file_bytes(batches.path()),
        warnings,
        memory: NodeMemory { per_point, decompressor },
    }
}

/// Batches of a compressed block.
fn block_batches(batches: &Batches<Bytes>) -> u64 {
    let table = batches.section_bytes(Part::Hi10).ok().and_then(|bytes| bytes.first_chunk());
    table.map_or(1, |count| u32::from_le_bytes(*count).into())
}

/// The colours, unless they show nothing, or what an attribute has; and the attributes.
fn columns(batches: &Batches<Bytes>) -> Columns {
    let has_intensity = batches.attributes().any(|a| a.name == "intensity");
    let is_shown = match batches.description().colour {
        ColourSource::None => false,
        ColourSource::Intensity => !has_intensity,
        _ => true,
    };
    let rgb = (Attribute::new("rgb", AttributeType::UInt16, 3), 0, Becomes::Channels);
    let attributes = batches.attributes().enumerate().filter(|(_, a)| !(is_shown && a.name == "rgb"));
    let attributes = attributes.map(|(i, a)| (a.clone(), i + 1, Becomes::Same));
    let own = OwnKey::of_map(&batches.description().extra);
    Columns::list(is_shown.then_some(rgb).into_iter().chain(attributes)).with_restored(own)
}

/// Positions whose integers may not come back, by the file's own figures.
fn inexact(batches: &Batches<Bytes>, lattice: &Lattice) -> Option<ScanWarning> {
    let figures = batches.description().errors.get(batches.header().precision())?;
    let is_coarse = (0..3).any(|axis| figures.max[axis] >= lattice.scale[axis] / 2.0);
    is_coarse.then_some(ScanWarning::Dataset(DatasetNote::Inexact { most: figures.max }))
}

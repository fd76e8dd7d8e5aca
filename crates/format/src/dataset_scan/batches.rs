//! Quantised batches.

use std::path::Path;

use crate::batches::{BATCH_POINTS, BatchScratch, Batches, ColourSource, Flags, Original, Part, Precision};
use crate::scan::DatasetNote;
use crate::{Attribute, AttributeType, Column, Lattice, NodePoints, ReadError, Scan, ScanWarning};

use super::columns::{Becomes, Columns};
use super::crs::crs_of;
use super::described::{Described, NodeMemory, advised, file_bytes};
use super::node_scan::{NodeScan, Nodes};
use super::pieces::Place;
use super::placing::held;

#[cfg(not(feature = "mmap"))]
type Bytes = crate::batches::AlignedBytes;
#[cfg(feature = "mmap")]
type Bytes = crate::batches::MappedFile;

/// Memory of a decompressor of zstd.
const ZSTD_BYTES: u64 = 4 << 20;

/// The slots of a file.
struct Slots(Batches<Bytes>);

impl Nodes for Slots {
    type Scratch = BatchScratch;

    fn len(&self) -> usize {
        self.0.records().len()
    }

    fn place(&self, node: usize) -> Place {
        let record = self.0.records()[node];
        let points = u64::from(record.points);
        let start = self.0.header().sections.hi10;
        match self.0.is_compressed() {
            // where the blocks are is in their table
            true => Place { points, byte_offset: start, byte_size: 0 },
            false => Place { points, byte_offset: start + 4 * u64::from(record.first_point), byte_size: 4 * points },
        }
    }

    fn name(&self, node: usize) -> String {
        format!("batch {node}")
    }

    fn read(&self, node: usize, scratch: &mut BatchScratch, out: &mut NodePoints) -> Result<(), ReadError> {
        self.0.read_batch(node as u32, Precision::Thirty, scratch, out)?;
        self.restore(node as u32 * BATCH_POINTS, out)
    }
}

impl Slots {
    /// Puts the colours before averaging in place of those that are shown. `first`: storage index of the first point.
    fn restore(&self, first: u32, points: &mut NodePoints) -> Result<(), ReadError> {
        let all = self.0.originals();
        let end = first.saturating_add(points.len() as u32);
        let own = &all[all.partition_point(|o| o.index < first)..];
        let own: &[Original] = &own[..own.partition_point(|o| o.index < end)];
        let ascend = own.windows(2).all(|pair| pair[0].index < pair[1].index);
        let Some(Column::UInt32(words)) = points.columns.first_mut() else { return Ok(()) };
        for Original { index, colour } in own {
            match index.checked_sub(first).and_then(|i| words.get_mut(i as usize)).filter(|_| ascend) {
                Some(word) => *word = *colour,
                None => return Err(lost_originals(&self.0)),
            }
        }
        Ok(())
    }
}

/// Opens the file `path`.
pub(super) fn open(path: &Path) -> Result<Box<dyn Scan>, ReadError> {
    #[cfg(feature = "mmap")]
    let batches = Batches::map(path).map_err(advised)?;
    #[cfg(not(feature = "mmap"))]
    let batches = Batches::open(path).map_err(advised)?;
    if batches.originals().last().is_some_and(|last| u64::from(last.index) >= batches.header().points) {
        return Err(lost_originals(&batches));
    }
    let described = described(path, &batches);
    Ok(Box::new(NodeScan::new(Slots(batches), described)))
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
    // three planes, three words, a colour, three doubles, and the attributes twice
    let (per_point, decompressor) = match batches.is_compressed() {
        true => (2 * (52 + size) + block_batches(batches) * (16 + size), ZSTD_BYTES),
        false => (2 * (52 + size), 0),
    };
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
    Columns::list(is_shown.then_some(rgb).into_iter().chain(attributes))
}

/// Positions whose integers may not come back, by the file's own figures.
fn inexact(batches: &Batches<Bytes>, lattice: &Lattice) -> Option<ScanWarning> {
    let figures = batches.description().errors.get(batches.header().precision())?;
    let is_coarse = (0..3).any(|axis| figures.max[axis] >= lattice.scale[axis] / 2.0);
    is_coarse.then_some(ScanWarning::Dataset(DatasetNote::Inexact { most: figures.max }))
}

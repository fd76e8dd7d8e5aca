//! Sections of quantised batches, as they are in the file.

use std::ffi::c_void;
use std::mem::MaybeUninit;

use pointmill_format::batches::{BatchRecord, BlockScratch, Part};

use crate::border::{buffer, fill, given, put};
use crate::dataset::{Content, PmDataset};
use crate::status::{Fault, Outcome, PmStatus, guard};

/// A section of a file of quantised batches.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PmSection {
    /// PmBatchRecord, one per slot.
    Records = 0,
    /// Words of 32 bits, one per point: bits 29–20 of x, y, z in the box, x lowest.
    Hi10 = 1,
    /// Bits 19–10. Absent from files of 10 bits.
    Mid10 = 2,
    /// Bits 9–0. Absent from files of 10 and 20 bits.
    Lo10 = 3,
    /// Words of 32 bits, one per point: red, green, blue, level of detail, red lowest.
    Colour = 4,
    /// Values of an extra attribute: attribute 0 is number 1 of pm_attribute().
    Attribute = 5,
}

/// A batch as it is in the file and in a structured buffer of a shader: 32 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PmBatchRecord {
    /// Lower corner of the box, relative to PmInfo::grid_origin, axes of the file.
    pub min: [f32; 3],
    /// Index of its first point in the sections: 10,240 times the slot.
    pub first_point: u32,
    /// Upper corner.
    pub max: [f32; 3],
    /// Number of points.
    pub points: u32,
}

const _: () = assert!(size_of::<PmBatchRecord>() == size_of::<BatchRecord>());

/// A record as it is in the file.
fn record_bytes(record: &BatchRecord) -> [u8; 32] {
    let BatchRecord { min: [x0, y0, z0], first_point, max: [x1, y1, z1], points } = *record;
    let words =
        [x0.to_bits(), y0.to_bits(), z0.to_bits(), first_point, x1.to_bits(), y1.to_bits(), z1.to_bits(), points];
    let mut bytes = [0; 32];
    bytes.as_chunks_mut::<4>().0.iter_mut().zip(words).for_each(|(bytes, word)| *bytes = word.to_le_bytes());
    bytes
}

/// The section; `None`: records.
fn part(section: u32, attribute: u32) -> Outcome<Option<Part>> {
    Ok(match section {
        0 => None,
        1 => Some(Part::Hi10),
        2 => Some(Part::Mid10),
        3 => Some(Part::Lo10),
        4 => Some(Part::Colour),
        5 => Some(Part::Attribute(attribute as usize)),
        other => return Err(Fault::argument(format!("section {other} was requested; there are 0 to 5"))),
    })
}

/// A section of the mapped file, without a copy: `*data` and its length in `*bytes`. In the axes of the file, little-endian.
///
/// `section`: a value of PmSection. `attribute`: of PM_SECTION_ATTRIBUTE the number among the extra attributes; else it is
/// ignored. The memory belongs to the handle, may only be read, and is gone after pm_close(). PM_STATUS_UNSUPPORTED if the
/// file does not have the section, or has it compressed (pm_batch_section() decodes it then). Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_section(
    dataset: Option<&PmDataset>,
    section: u32,
    attribute: u32,
    data: Option<&mut MaybeUninit<*const c_void>>,
    bytes: Option<&mut MaybeUninit<usize>>,
) -> PmStatus {
    guard(|| {
        let dataset = given(dataset, "dataset")?;
        let Content::Batches(batches) = &dataset.content else {
            return Err(dataset.other_kind("sections are mapped of quantised batches"));
        };
        let slice: &[u8] = match part(section, attribute)? {
            None => {
                let records = batches.records();
                put(data, "data", records.as_ptr().cast())?;
                return put(bytes, "bytes", size_of_val(records));
            }
            Some(_) if batches.is_compressed() => {
                let text = "the sections are compressed: they are decoded batch by batch";
                return Err(Fault::new(PmStatus::Unsupported, text));
            }
            Some(part) => batches.section_bytes(part)?,
        };
        put(data, "data", slice.as_ptr().cast())?;
        put(bytes, "bytes", slice.len())
    })
}

/// The values of one batch, as in pm_section(), copied to `out`; of compressed files, too. `*bytes`: how many there are.
/// 4 bytes per point but for attributes.
///
/// `out` has room for `capacity` bytes; it need not be aligned. Any thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pm_batch_section(
    dataset: Option<&PmDataset>,
    slot: u32,
    section: u32,
    attribute: u32,
    out: *mut c_void,
    capacity: usize,
    bytes: Option<&mut MaybeUninit<usize>>,
) -> PmStatus {
    guard(|| {
        let dataset = given(dataset, "dataset")?;
        let Content::Batches(batches) = &dataset.content else {
            return Err(dataset.other_kind("sections are read of quantised batches"));
        };
        dataset.node_bounds(slot)?;
        let mut scratch = BlockScratch::default();
        let record = batches.records().get(slot as usize).map(record_bytes).unwrap_or_default();
        let slice: &[u8] = match part(section, attribute)? {
            None => &record,
            Some(part) => batches.batch(part, slot, &mut scratch)?,
        };
        bytes.map_or(Ok(()), |bytes| put(Some(bytes), "bytes", slice.len()))?;
        // SAFETY: the caller's promise
        let out = unsafe { buffer(out.cast::<u8>(), capacity, "out") }?;
        fill(out, slice.len(), slice.iter().copied(), "out")
    })
}

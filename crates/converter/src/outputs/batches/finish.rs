//! The end of a file: open cells, records, originals, description, header.

use std::collections::BTreeMap;

use pointmill_format::Attribute;
use pointmill_format::batches::{
    AttributeEntry, Averaging, BATCH_POINTS, BatchRecord, Description, ErrorSums, Finish, Layout, Precision,
    SECTION_ALIGNMENT, lod_of, rgb_of,
};
use serde_json::json;

use super::content::Content;
use super::frame::{Frame, refused};
use super::lod::{LEVELS, join, shown_word};
use super::output::{BatchFile, ORIGINAL_BYTES, State};
use super::planes;
use super::settings::BatchesSettings;
use super::task::TaskResults;
use crate::cloud::Cloud;
use crate::error::ConvertError;
use crate::outputs::origin::own_key;
use crate::outputs::recovery::Lost;
use crate::report::{FormatErrors, SavedBytes};

/// Bytes of originals that are written at once.
const WRITE_BYTES: usize = 4 << 20;

/// A point whose cell was finished after its task. The originals of the task do not know its colour.
#[derive(Debug, Clone, Copy)]
struct Patch {
    /// Colour word before averaging.
    word: u32,
    /// What the file holds so far, and what it must hold.
    written: u32,
    shown: u32,
}

impl Patch {
    /// True if the file showed another colour than the point's own before this, and if it does now.
    fn changes(&self) -> [bool; 2] {
        [self.written, self.shown].map(|word| rgb_of(word) != rgb_of(self.word))
    }
}

/// What the finished file is.
pub(super) struct Finished {
    pub(super) precision: Precision,
    /// Planes that a requested precision spared.
    pub(super) spared: u32,
    pub(super) records: Vec<BatchRecord>,
    /// Of all plane counts, whether they are in the file or not.
    pub(super) errors: ErrorSums,
    /// Points that do not come back.
    pub(super) lost: Lost,
    pub(super) lod_points: [u64; LEVELS + 1],
    pub(super) layout: Layout,
    pub(super) averaging: Averaging,
    /// Header and description.
    pub(super) end: Finish,
    pub(super) bytes: u64,
}

impl Finished {
    /// What a requested precision saved.
    pub(super) fn saved(&self) -> SavedBytes {
        match self.spared {
            0 => SavedBytes::NoPlane,
            planes => SavedBytes::Planes { planes, bytes: 4 * u64::from(planes) * self.layout.points },
        }
    }

    /// What the planes in the file did to positions.
    pub(super) fn format_errors(&self) -> FormatErrors {
        FormatErrors::measured(&self.errors.deviations(self.precision), self.lost.points, self.lost.merged)
    }
}

/// Writes all that can only be known when every task is done.
pub(super) fn finish(
    cloud: &Cloud<'_>,
    settings: &BatchesSettings,
    frame: &Frame,
    content: &Content,
    output: &BatchFile<'_>,
    results: &TaskResults,
) -> Result<Finished, ConvertError> {
    let state = output.take_state()?;
    let mut lod_points = results.lod_points;
    let patches = patches(output.layout, results, &mut lod_points)?;
    for (index, patch) in &patches {
        output.put_values(output.layout.colour, 4, *index, &patch.shown.to_le_bytes())?;
    }
    let records: Vec<BatchRecord> = state.records.iter().flatten().copied().collect();
    let mut errors = ErrorSums::default();
    state.errors.iter().for_each(|e| errors.merge(e));
    let mut layout = output.layout.clone();
    let planes = planes::needed(cloud, settings.planes, &records, frame.lattice.scale, &errors);
    if let Some(needed) = planes.needed.filter(|needed| *needed < layout.precision()) {
        layout = layout.with_precision(needed);
    }
    output.cut(layout.end_of_points())?; // what a run before has left there, and planes that are not needed
    clear_gaps(output, &layout)?;
    output.write(&record_bytes(&records), layout.records.offset)?;
    let changes = |when: usize| patches.values().filter(|patch| patch.changes()[when]).count() as u64;
    let changed = (results.changed + changes(1)).checked_sub(changes(0)).ok_or_else(unlike)?;
    let averaging = Averaging::of(changed, settings.originals);
    if let Averaging::Changed { originals: Some(count) } = averaging {
        put_originals(output, &layout, &state, &patches, count)?;
    }
    let mut description = describe(cloud, frame, content);
    description.errors = errors.figures();
    let end = layout.finish(&frame.grid, &frame.tight, averaging, description).map_err(refused)?;
    output.write(&end.description_bytes, end.description_offset)?;
    output.write(&end.header_bytes, 0)?;
    let bytes = end.description_offset + end.header.description_bytes;
    let (precision, lost) = (layout.precision(), state.lost);
    let spared = planes.spared;
    Ok(Finished { precision, spared, records, errors, lost, lod_points, layout, averaging, end, bytes })
}

/// Zeros between the sections: the file may be one that a run before has left.
fn clear_gaps(output: &BatchFile<'_>, layout: &Layout) -> Result<(), ConvertError> {
    let zeros = [0; SECTION_ALIGNMENT as usize];
    let ends = layout.sections().map(|s| s.section.end()).chain([layout.records.end()]);
    ends.into_iter().try_for_each(|end| {
        let gap = end.next_multiple_of(SECTION_ALIGNMENT) - end;
        output.write(&zeros[..gap as usize], end)
    })
}

/// Candidates of the cells that tasks left open, by storage index; corrects the number of points of each level.
fn patches(
    layout: &Layout,
    results: &TaskResults,
    lod_points: &mut [u64; LEVELS + 1],
) -> Result<BTreeMap<u32, Patch>, ConvertError> {
    let mut patches: BTreeMap<u32, Patch> = BTreeMap::new();
    // coarser levels come later and win
    for level in (0..LEVELS).rev() {
        join(results.edges.iter().filter_map(|(_, edges)| edges[level]), |cell| {
            let shown = shown_word(&cell, level);
            let size = u64::from(BATCH_POINTS);
            let index = layout.slot((cell.candidate / size) as u32).1 + (cell.candidate % size) as u32;
            let patch = Patch { word: cell.word, written: cell.shown, shown };
            patches.entry(index).and_modify(|p| p.shown = shown).or_insert(patch);
        });
    }
    for patch in patches.values() {
        let level = |word| usize::from(lod_of(word)).min(LEVELS);
        let written = &mut lod_points[level(patch.written)];
        *written = written.checked_sub(1).ok_or_else(unlike)?;
        lod_points[level(patch.shown)] += 1;
    }
    Ok(patches)
}

/// What units came to contradicts itself.
fn unlike() -> ConvertError {
    ConvertError::Internal("the levels of detail of the tasks do not add up".into())
}

fn record_bytes(records: &[BatchRecord]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(32 * records.len());
    for r in records {
        bytes.extend(r.min.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(r.first_point.to_le_bytes());
        bytes.extend(r.max.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(r.points.to_le_bytes());
    }
    bytes
}

/// Writes the `count` originals in storage order: those of the tasks, where no patch says otherwise, and of the patches.
fn put_originals(
    output: &BatchFile<'_>,
    layout: &Layout,
    state: &State,
    patches: &BTreeMap<u32, Patch>,
    count: u64,
) -> Result<(), ConvertError> {
    let mut parts = state.originals.clone();
    parts.sort_unstable_by_key(|(first, _)| *first);
    let changed = |(index, p): (&u32, &Patch)| p.changes()[1].then(|| u64::from(*index) | u64::from(p.word) << 32);
    let mut late = patches.iter().filter_map(changed).peekable();
    let index_of = |entry: u64| entry as u32;
    let mut writer = Sequence { output, at: layout.originals + 8, bytes: Vec::new(), count: 0 };
    let mut part = Vec::new();
    for (_, segment) in parts {
        part.clear();
        output.originals.take(segment, &mut part)?;
        let entries = part.as_chunks::<ORIGINAL_BYTES>().0;
        let [Some(first), Some(last)] = [entries.first(), entries.last()] else { continue };
        let [first, last] = [first, last].map(|entry| index_of(u64::from_le_bytes(*entry)));
        while let Some(entry) = late.next_if(|entry| index_of(*entry) < first) {
            writer.put(&entry.to_le_bytes())?;
        }
        if patches.range(first..=last).next().is_none() {
            writer.put(&part)?;
            continue;
        }
        for bytes in entries {
            let index = index_of(u64::from_le_bytes(*bytes));
            while let Some(entry) = late.next_if(|entry| index_of(*entry) < index) {
                writer.put(&entry.to_le_bytes())?;
            }
            if !patches.contains_key(&index) {
                writer.put(bytes)?;
            }
        }
    }
    for entry in late {
        writer.put(&entry.to_le_bytes())?;
    }
    writer.flush()?;
    if writer.count != count {
        return Err(ConvertError::Internal(format!("{} originals instead of {count}", writer.count)));
    }
    output.write(&count.to_le_bytes(), layout.originals)
}

/// Entries of the originals, one behind the other.
struct Sequence<'a> {
    output: &'a BatchFile<'a>,
    at: u64,
    bytes: Vec<u8>,
    count: u64,
}

impl Sequence<'_> {
    fn put(&mut self, entries: &[u8]) -> Result<(), ConvertError> {
        self.bytes.extend_from_slice(entries);
        self.count += (entries.len() / ORIGINAL_BYTES) as u64;
        if self.bytes.len() >= WRITE_BYTES { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), ConvertError> {
        self.output.write(&self.bytes, self.at)?;
        self.at += self.bytes.len() as u64;
        self.bytes.clear();
        Ok(())
    }
}

fn describe(cloud: &Cloud<'_>, frame: &Frame, content: &Content) -> Description {
    let mut description = Description::new(frame.lattice);
    description.version = env!("CARGO_PKG_VERSION").into();
    description.name = cloud.plan.cloud_name();
    description.projection.clone_from(&cloud.facts.crs.projection);
    description.colour = content.source();
    description.source_step = cloud.source_step();
    let entry = |attribute: &Attribute, index: usize| {
        let mut entry = AttributeEntry::new(attribute, 0, 0);
        let range = &cloud.facts.ranges[index];
        if range.min.iter().chain(&range.max).all(|v| v.is_finite()) {
            entry.min.clone_from(&range.min);
            entry.max.clone_from(&range.max);
        }
        entry
    };
    description.attributes = content.extras.iter().map(|e| entry(&e.attribute, e.index)).collect();
    let mut own = own_key(cloud, &content.dropped);
    if let Some(range) = content.intensity_range() {
        own.insert("intensityRange".into(), json!(range));
    }
    let keys = ["intensityRange", "filter", "duplicates", "rgbDepth", "wkt", "attributesOmitted"];
    description.extra.extend(keys.iter().filter_map(|key| Some(((*key).to_owned(), own.remove(*key)?))));
    description
}

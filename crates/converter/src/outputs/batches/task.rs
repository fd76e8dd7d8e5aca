//! One task: load, sort, choose levels of detail, encode.

use pointmill_format::batches::{le_bytes, lod_of, rgb_of};
use serde::{Deserialize, Serialize};

use super::buckets::Task;
use super::content::Content;
use super::frame::Frame;
use super::large::{WORD_BYTES, split};
use super::lod::{Edges, LEVELS, Levels, unselected};
use super::order::{Loaded, Order};
use super::output::{BatchFile, Encoder, ORIGINAL_BYTES, Piece, pieces};
use crate::cloud::{Ledger, Store, copy_record, position};
use crate::error::ConvertError;
use crate::runtime::os_hints;

/// Records are first copied into a small tile: the copies are independent, so that the processor waits for many
/// scattered records at once.
const TILE_RECORDS: usize = 128;

/// What all tasks share.
pub(super) struct Workshop<'a> {
    pub(super) frame: &'a Frame,
    pub(super) content: &'a Content,
    pub(super) store: &'a Store,
    /// Records of large tasks, with their colour words.
    pub(super) sorted: &'a Store,
    pub(super) stride: usize,
    pub(super) output: &'a BatchFile<'a>,
    pub(super) keeps_originals: bool,
    /// Buffers are made for tasks of this size at once; what is not touched costs nothing.
    pub(super) usual_points: u64,
}

/// One thread's memory, and what its tasks came to.
pub(super) struct Worker<'a> {
    shop: &'a Workshop<'a>,
    records: Vec<u8>,
    loaded_words: Vec<u32>,
    order: Order,
    tile: Vec<u8>,
    /// Of one piece, one column per axis.
    relative: [Vec<f64>; 3],
    /// Colour words of the task in order, before and after averaging.
    words: Vec<u32>,
    shown: Vec<u32>,
    /// Of one piece, one column per extra attribute.
    extras: Vec<Vec<u8>>,
    originals: Vec<u8>,
    encoder: Encoder,
    results: TaskResults,
}

/// What the tasks of a thread came to.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct TaskResults {
    pub(super) ledger: Ledger,
    /// Points by level of detail, before open cells are joined.
    pub(super) lod_points: [u64; LEVELS + 1],
    /// Points whose colour averaging changed, before open cells are joined.
    pub(super) changed: u64,
    /// By task.
    pub(super) edges: Vec<(usize, [Option<Edges>; LEVELS])>,
}

impl TaskResults {
    /// Of all tasks; edges in the order of the tasks.
    pub(super) fn of_all(each: impl Iterator<Item = Self>) -> Self {
        let mut all = Self::default();
        for mut results in each {
            all.ledger.merge(&results.ledger);
            all.lod_points.iter_mut().zip(results.lod_points).for_each(|(a, b)| *a += b);
            all.changed += results.changed;
            all.edges.append(&mut results.edges);
        }
        all.edges.sort_unstable_by_key(|(index, _)| *index);
        all
    }
}

/// Bytes of memory for a point of a task: its record, words as loaded, before and after averaging, keys twice, entry of
/// the originals.
pub(super) fn bytes_per_point(stride: usize) -> u64 {
    (stride + 3 * 4 + 2 * 8 + ORIGINAL_BYTES) as u64
}

impl<'a> Worker<'a> {
    pub(super) fn new(shop: &'a Workshop<'a>) -> Self {
        Self {
            shop,
            records: Vec::new(),
            loaded_words: Vec::new(),
            order: Order::default(),
            tile: vec![0; TILE_RECORDS * shop.stride],
            relative: Default::default(),
            words: Vec::new(),
            shown: Vec::new(),
            extras: vec![Vec::new(); shop.content.extras.len()],
            originals: Vec::new(),
            encoder: Encoder::default(),
            results: TaskResults::default(),
        }
    }

    pub(super) fn finish(self) -> TaskResults {
        self.results
    }

    pub(super) fn run(&mut self, index: usize, task: &Task) -> Result<(), ConvertError> {
        self.load(task)?;
        let loaded = Loaded { records: &self.records, stride: self.shop.stride, words: &self.loaded_words };
        let first_code = self.shop.frame.first_code(task.start);
        self.order.sort(&loaded, self.shop.frame, &self.shop.content.extras, first_code);
        for words in [&mut self.words, &mut self.shown] {
            words.clear();
            words.reserve_exact(task.points as usize);
        }
        let mut levels = Levels::default();
        for piece in pieces(task.first_point, task.points) {
            self.gather(&piece);
            let [x, y, z] = &self.relative;
            let relative: [&[f64]; 3] = [x, y, z];
            levels.add(self.shop.frame, relative, &self.words[piece.range.clone()], &mut self.shown);
            self.shop.output.put(&piece, relative, &mut self.encoder)?;
            let first = self.shop.output.storage_index(&piece);
            for ((section, extra), bytes) in
                self.shop.output.layout.attributes.iter().zip(&self.shop.content.extras).zip(&self.extras)
            {
                self.shop.output.put_values(*section, extra.attribute.size() as u64, first, bytes)?;
            }
        }
        self.results.edges.push((index, levels.finish(task.first_point, &self.words, &self.shown)));
        self.put_colours(task)
    }

    fn load(&mut self, task: &Task) -> Result<(), ConvertError> {
        let (shop, points) = (self.shop, task.points.max(self.shop.usual_points) as usize);
        self.records.clear();
        self.loaded_words.clear();
        os_hints::reserve(&mut self.records, points * shop.stride);
        self.loaded_words.reserve_exact(points);
        for segment in task.segments.iter().filter(|_| task.is_sorted) {
            let mut entries = Vec::new();
            shop.sorted.take(*segment, &mut entries)?;
            for (record, word) in entries.chunks_exact(shop.stride + WORD_BYTES).map(split) {
                self.records.extend_from_slice(record);
                self.loaded_words.push(word);
            }
        }
        for segment in task.segments.iter().filter(|_| !task.is_sorted) {
            let start = self.records.len();
            let source = shop.store.take(*segment, &mut self.records)?;
            shop.content.words(&self.records[start..], shop.stride, source, &mut self.loaded_words);
        }
        if self.loaded_words.len() as u64 == task.points {
            return Ok(());
        }
        Err(ConvertError::Internal(format!("{} points of {} were loaded", self.loaded_words.len(), task.points)))
    }

    /// Puts the points of a piece in order.
    fn gather(&mut self, piece: &Piece) {
        let (shop, stride) = (self.shop, self.shop.stride);
        self.relative.iter_mut().for_each(Vec::clear);
        self.extras.iter_mut().for_each(Vec::clear);
        let mut indices = self.order.indices(piece.range.clone());
        loop {
            let mut count = 0;
            for (slot, i) in self.tile.chunks_exact_mut(stride).zip(&mut indices) {
                copy_record(&self.records[i * stride..][..stride], slot);
                let word = self.loaded_words[i];
                self.words.push(word);
                self.shown.push(unselected(word));
                count += 1;
            }
            let tile = &self.tile[..count * stride];
            self.results.ledger.written.add_all(tile, stride);
            for record in tile.chunks_exact(stride) {
                let r = shop.frame.relative(position(record));
                self.relative.iter_mut().zip(r).for_each(|(axis, r)| axis.push(r));
            }
            for (extra, bytes) in shop.content.extras.iter().zip(&mut self.extras) {
                tile.chunks_exact(stride).for_each(|record| bytes.extend_from_slice(&record[extra.from..extra.to]));
            }
            if count < TILE_RECORDS {
                break;
            }
        }
    }

    /// Writes colour words and keeps the originals.
    fn put_colours(&mut self, task: &Task) -> Result<(), ConvertError> {
        let output = self.shop.output;
        let mut counts = Vec::new();
        self.originals.clear();
        for piece in pieces(task.first_point, task.points) {
            let first = output.storage_index(&piece);
            let shown = &self.shown[piece.range.clone()];
            output.put_values(output.layout.colour, 4, first, &le_bytes(shown))?;
            let before = self.originals.len();
            for ((index, shown), word) in (first..).zip(shown).zip(&self.words[piece.range.clone()]) {
                let level = usize::from(lod_of(*shown)).min(LEVELS);
                self.results.lod_points[level] += 1;
                if rgb_of(*shown) == rgb_of(*word) {
                    continue;
                }
                self.results.changed += 1;
                if self.shop.keeps_originals {
                    let entry = u64::from(index) | u64::from(*word) << 32;
                    self.originals.extend_from_slice(&entry.to_le_bytes());
                }
            }
            counts.push((first, ((self.originals.len() - before) / ORIGINAL_BYTES) as u32));
        }
        output.put_originals(&mut self.originals, &counts)
    }
}

//! Where records wait between being read and being built into nodes: memory first, one spill file when it must.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock};

use serde::{Deserialize, Serialize};

use super::frames::StoredPoint;
use super::record::position;
use super::segments::Segment;
use crate::error::{ConvertError, JobFault};
use crate::runtime::{Consumer, DiskFile, Evict, Pool, TempFiles, os_hints};
use crate::sources::POSITION_BYTES;

/// Blocks grow to this size: a few large pages, and one long write when they go to disk.
pub(crate) const BLOCK_BYTES: usize = 8 << 20;

/// An offset on the disk has the number of its file above these bits: 0 is the store's own, others were adopted.
const OFFSET_BITS: u32 = 44;

/// As many adopted files stay open.
const MOST_OPEN: usize = 64;

/// A page: smaller buffers are not worth being looked for. Of scans of a few points there are very many.
const LEAST_SPARE: usize = 4 << 10;

/// Blocks of records. A block holds records of one source and never changes; it is dropped once all of it was taken.
pub(crate) struct Store {
    stride: usize,
    /// How often each record is taken.
    uses: u32,
    memory: Arc<Pool>,
    in_memory: AtomicU64,
    blocks: Mutex<Vec<Block>>,
    /// By block, if the file outlives the run.
    kept: Mutex<Vec<Kept>>,
    /// Buffers of blocks that were taken to be put back in another order: they hold the next ones, so that their memory is
    /// touched once. They count as records in memory.
    spare: Mutex<Vec<Vec<u8>>>,
    temp: TempFiles,
    /// The file outlives the run, if it is ended.
    is_kept: bool,
    /// Other processes read the file, and this one does not need the records: none stays in memory.
    is_for_others: bool,
    spill: Mutex<Option<Arc<DiskFile>>>,
    spilled: AtomicU64,
    adopted: Mutex<Adopted>,
    /// Where all records lie, if others have read some of them and nobody has looked.
    limits: OnceLock<[StoredPoint; 2]>,
}

/// Files of other processes, which are only read.
#[derive(Default)]
struct Adopted {
    paths: Vec<PathBuf>,
    /// Those that are open, by index.
    open: Vec<(usize, Arc<DiskFile>)>,
}

/// A block that outlives the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct SafeBlock {
    source: u32,
    /// Where it begins in the file.
    pub(crate) offset: u64,
    bytes: u64,
    /// CRC-32C.
    sum: u32,
}

impl SafeBlock {
    /// How many records of `stride` bytes it has; `None`: it cannot be a block of such records.
    pub(crate) fn records(&self, stride: usize) -> Option<u32> {
        let is_one = self.offset.checked_add(self.bytes).is_some_and(|end| end >> OFFSET_BITS == 0)
            && self.bytes.is_multiple_of(stride as u64);
        u32::try_from(self.bytes / stride as u64).ok().filter(|_| is_one)
    }
}

struct Block {
    source: u32,
    records: u32,
    /// Records that were not taken yet, once for each use.
    remaining: u64,
    place: Place,
}

/// What is known of a block whose file outlives the run. Apart, as there may be a block for each of very many scans.
#[derive(Debug, Clone, Copy, Default)]
struct Kept {
    bytes: u64,
    /// CRC-32C.
    sum: u32,
    /// Where else it is while it is in memory.
    copy: Option<u64>,
    /// Another run has written it, and nobody has looked yet whether it is as it was.
    is_unseen: bool,
}

#[derive(Clone)]
enum Place {
    Memory(Arc<Vec<u8>>),
    Disk { offset: u64 },
    Gone,
}

/// The bytes of a block all of which was taken.
type Emptied = Option<Arc<Vec<u8>>>;

impl Store {
    /// An empty store for `uses` outputs that each take every record once. What finds no room in `memory` goes into a
    /// temporary file.
    pub(crate) fn new(temp: TempFiles, stride: usize, uses: u32, memory: &Arc<Pool>) -> Arc<Self> {
        Self::on(None, false, temp, stride, uses, memory)
    }

    /// [`Self::new`] with a file that may outlive the run. `is_for_others`: other processes read it, and this one takes nothing back.
    pub(crate) fn on(
        file: Option<DiskFile>,
        is_for_others: bool,
        temp: TempFiles,
        stride: usize,
        uses: u32,
        memory: &Arc<Pool>,
    ) -> Arc<Self> {
        Arc::new(Self {
            stride,
            uses,
            memory: Arc::clone(memory),
            in_memory: AtomicU64::new(0),
            blocks: Mutex::default(),
            kept: Mutex::default(),
            spare: Mutex::default(),
            temp,
            is_kept: file.is_some(),
            is_for_others,
            spill: Mutex::new(file.map(Arc::new)),
            spilled: AtomicU64::new(0),
            adopted: Mutex::default(),
            limits: OnceLock::new(),
        })
    }

    /// The number that the next block will have.
    pub(crate) fn next_block(&self) -> Result<u32, ConvertError> {
        Ok(self.blocks.lock().map_err(|_| poisoned())?.len() as u32)
    }

    /// Writes the blocks from `first` on that are in memory alone, and waits until all of them are safe. They stay in memory, too.
    pub(crate) fn secure(&self, first: u32) -> Result<Vec<SafeBlock>, ConvertError> {
        let safe = (first..self.next_block()?).map(|block| self.write_out(block)).collect::<Result<_, _>>()?;
        self.spill_file()?.sync("syncing the records")?;
        Ok(safe)
    }

    /// Writes a block that is in memory alone, and does not wait until it is safe: [`Self::file`] is synced for that. It stays in
    /// memory, too.
    pub(crate) fn write_out(&self, index: u32) -> Result<SafeBlock, ConvertError> {
        let place = self.blocks.lock().map_err(|_| poisoned())?[index as usize].place.clone();
        let written = match &place {
            Place::Memory(records) => Some(self.write(records)?),
            Place::Disk { .. } | Place::Gone => None,
        };
        let blocks = self.blocks.lock().map_err(|_| poisoned())?;
        let Block { source, place, .. } = &blocks[index as usize];
        let mut all = self.kept.lock().map_err(|_| poisoned())?;
        let kept = &mut all[index as usize];
        kept.copy = kept.copy.or(written);
        // it may have left memory meanwhile
        let offset = match place {
            Place::Disk { offset } => *offset,
            _ => kept.copy.unwrap_or(0),
        };
        Ok(SafeBlock { source: *source, offset, bytes: kept.bytes, sum: kept.sum })
    }

    /// The file that outlives the run.
    pub(crate) fn file(&self) -> Result<Arc<DiskFile>, ConvertError> {
        self.spill_file()
    }

    /// Takes blocks that another run has made safe in the store's own file; returns the number of the first.
    pub(crate) fn adopt(&self, safe: &[SafeBlock]) -> Result<u32, ConvertError> {
        // what is read next goes behind them, and not behind what they only claim
        let length = self.spill_file()?.len("looking at the records")?;
        safe.iter().for_each(|block| {
            self.spilled.fetch_max((block.offset + block.bytes).min(length), Ordering::Relaxed);
        });
        self.adopt_at(safe, 0)
    }

    /// Takes blocks that another process has made safe in a file of its own; returns the number of the first.
    pub(crate) fn adopt_from(&self, file: PathBuf, safe: &[SafeBlock]) -> Result<u32, ConvertError> {
        let mut adopted = self.adopted.lock().map_err(|_| poisoned())?;
        adopted.paths.push(file);
        let number = adopted.paths.len() as u64;
        drop(adopted);
        self.adopt_at(safe, number << OFFSET_BITS)
    }

    /// From now on records must lie between these: others have said where they are.
    pub(crate) fn expect_within(&self, limits: [StoredPoint; 2]) {
        let _ = self.limits.set(limits); // once, of a pass
    }

    /// True if it can be a block of such records.
    pub(crate) fn can_hold(&self, block: &SafeBlock) -> bool {
        block.records(self.stride).is_some()
    }

    fn adopt_at(&self, safe: &[SafeBlock], start: u64) -> Result<u32, ConvertError> {
        let mut blocks = self.blocks.lock().map_err(|_| poisoned())?;
        let mut kept = self.kept.lock().map_err(|_| poisoned())?;
        let first = blocks.len() as u32;
        for &SafeBlock { source, offset, bytes, sum } in safe {
            let records = (bytes / self.stride as u64) as u32; // fits: who read it has asked [`SafeBlock::records`]
            let remaining = u64::from(records) * u64::from(self.uses);
            if self.is_kept {
                kept.push(Kept { bytes, sum, copy: None, is_unseen: start == 0 });
            }
            blocks.push(Block { source, records, remaining, place: Place::Disk { offset: start + offset } });
        }
        Ok(first)
    }

    /// Reads from the file that an offset is in.
    fn read_disk(&self, out: &mut [u8], offset: u64, doing: &'static str) -> Result<(), ConvertError> {
        let (file, within) = (offset >> OFFSET_BITS, offset & ((1 << OFFSET_BITS) - 1));
        match file.checked_sub(1) {
            None => self.spill_file()?.read_at(out, within, doing),
            Some(index) => {
                let file = self.adopted_file(index as usize)?;
                let read = file.read_at(out, within, doing);
                read.map_err(|error| if is_missing(&error) { damaged(file.path(), within) } else { error })
            }
        }
    }

    fn adopted_file(&self, index: usize) -> Result<Arc<DiskFile>, ConvertError> {
        let mut adopted = self.adopted.lock().map_err(|_| poisoned())?;
        if let Some((_, file)) = adopted.open.iter().find(|(i, _)| *i == index) {
            return Ok(Arc::clone(file));
        }
        let path = adopted.paths.get(index).ok_or_else(|| ConvertError::Internal("records of no file".into()))?;
        let opened = self.temp.read(path);
        let file = opened.map_err(|error| if is_missing(&error) { damaged(path, 0) } else { error })?;
        let file = Arc::new(file);
        if adopted.open.len() >= MOST_OPEN {
            adopted.open.remove(0);
        }
        adopted.open.push((index, Arc::clone(&file)));
        Ok(file)
    }

    /// Looks whether a block that another run has written is in the file as it was, before the first of its records is used.
    fn look_at(&self, index: u32, source: u32, offset: u64) -> Result<(), ConvertError> {
        if !self.is_kept {
            return Ok(());
        }
        let kept = || self.kept.lock().map_err(|_| poisoned());
        let Some(Kept { bytes, sum, .. }) = kept()?.get(index as usize).copied().filter(|kept| kept.is_unseen) else {
            return Ok(());
        };
        if !self.is_whole(&SafeBlock { source, offset, bytes, sum })? {
            return Err(damaged(self.spill_file()?.path(), offset));
        }
        kept()?[index as usize].is_unseen = false;
        Ok(())
    }

    /// True if a block is in the file as it was written.
    fn is_whole(&self, block: &SafeBlock) -> Result<bool, ConvertError> {
        let (mut at, mut sum, mut part) = (0, 0, vec![0; os_hints::PART_BYTES.min(block.bytes as usize)]);
        while at < block.bytes {
            let part = &mut part[..os_hints::PART_BYTES.min((block.bytes - at) as usize)];
            match self.read_disk(part, block.offset + at, "reading the records") {
                Ok(()) => sum = crc32c::crc32c_append(sum, part),
                Err(error) if is_missing(&error) => return Ok(false),
                Err(other) => return Err(other),
            }
            at += part.len() as u64;
        }
        Ok(sum == block.sum)
    }

    /// Bytes that went to the spill file.
    #[cfg(test)]
    fn spilled_bytes(&self) -> u64 {
        self.spilled.load(Ordering::Relaxed)
    }

    /// The index that the next block will have; it must be added with [`Self::fill`].
    pub(crate) fn open(&self, source: u32) -> Result<u32, ConvertError> {
        let mut blocks = self.blocks.lock().map_err(|_| poisoned())?;
        if self.is_kept {
            self.kept.lock().map_err(|_| poisoned())?.push(Kept::default());
        }
        blocks.push(Block { source, records: 0, remaining: 0, place: Place::Gone });
        Ok((blocks.len() - 1) as u32)
    }

    /// Adds the records of a block. The buffer comes back empty, with or without its memory.
    pub(crate) fn fill(&self, block: u32, records: &mut Vec<u8>) -> Result<(), ConvertError> {
        self.fill_for(block, records, self.uses)
    }

    /// [`Self::fill`] with records that one output has taken and puts back in another order, for itself.
    pub(crate) fn refill(&self, block: u32, records: &mut Vec<u8>) -> Result<(), ConvertError> {
        self.fill_for(block, records, 1)
    }

    fn fill_for(&self, block: u32, records: &mut Vec<u8>, uses: u32) -> Result<(), ConvertError> {
        let bytes = records.len() as u64;
        let sum = if self.is_kept { crc32c::crc32c(records) } else { 0 };
        let keeps_buffer = records.len() * 2 > records.capacity();
        let cost = if keeps_buffer { records.capacity() as u64 } else { bytes };
        let has_room = || self.memory.try_take(Consumer::Records, cost);
        let place = if self.is_for_others {
            self.spill(records)?
        } else if has_room() || (self.drop_spare(cost)? > 0 && has_room()) {
            self.in_memory.fetch_add(cost, Ordering::Relaxed);
            let kept = if keeps_buffer { std::mem::take(records) } else { records.as_slice().to_vec() };
            Place::Memory(Arc::new(kept))
        } else {
            self.spill(records)?
        };
        records.clear();
        let count = (bytes / self.stride as u64) as u32;
        let mut blocks = self.blocks.lock().map_err(|_| poisoned())?;
        if self.is_kept {
            self.kept.lock().map_err(|_| poisoned())?[block as usize] = Kept { bytes, sum, ..Kept::default() };
        }
        let slot = &mut blocks[block as usize];
        (slot.records, slot.remaining, slot.place) = (count, u64::from(count) * u64::from(uses), place);
        Ok(())
    }

    /// Appends the records of a segment to `out` and returns its source. Each output may take each record once.
    pub(crate) fn take(&self, segment: Segment, out: &mut Vec<u8>) -> Result<u32, ConvertError> {
        let (source, emptied) = self.take_uses(segment, 1, out)?;
        emptied.inspect(|bytes| self.give(bytes.capacity() as u64));
        Ok(source)
    }

    /// [`Self::take`] of records that an output has from elsewhere: nobody looks at them.
    pub(crate) fn pass_over(&self, segment: Segment) -> Result<(), ConvertError> {
        let emptied = self.count_uses(segment, 1)?;
        emptied.inspect(|bytes| self.give(bytes.capacity() as u64));
        Ok(())
    }

    /// Also returns the bytes of a block all of which was taken; they still count.
    fn take_uses(&self, segment: Segment, uses: u32, out: &mut Vec<u8>) -> Result<(u32, Emptied), ConvertError> {
        let source = self.read(segment, out)?;
        Ok((source, self.count_uses(segment, uses)?))
    }

    fn count_uses(&self, segment: Segment, uses: u32) -> Result<Emptied, ConvertError> {
        let mut blocks = self.blocks.lock().map_err(|_| poisoned())?;
        let block = &mut blocks[segment.block as usize];
        block.remaining = block.remaining.saturating_sub(u64::from(segment.count) * u64::from(uses));
        if block.remaining == 0
            && let Place::Memory(bytes) = std::mem::replace(&mut block.place, Place::Gone)
        {
            return Ok(Some(bytes));
        }
        Ok(None)
    }

    /// [`Self::take`] of records that are put back in another order: by [`Self::fill`] if `uses` are those of all outputs, by
    /// [`Self::refill`] if it is one. Buffers that become empty are kept for [`Self::buffer`], up to
    /// [`Self::drop_spare`].
    pub(crate) fn take_to_put_back(
        &self,
        segment: Segment,
        is_for_all: bool,
        out: &mut Vec<u8>,
    ) -> Result<u32, ConvertError> {
        let (source, emptied) = self.take_uses(segment, if is_for_all { self.uses } else { 1 }, out)?;
        if let Some(bytes) = emptied {
            self.keep(bytes)?;
        }
        Ok(source)
    }

    /// An empty buffer for so many bytes of records that are put back, touched before if there is such a one.
    pub(crate) fn buffer(&self, bytes: usize) -> Result<Vec<u8>, ConvertError> {
        let mut spare = self.spare.lock().map_err(|_| poisoned())?;
        let fits = |buffer: &Vec<u8>| (bytes..bytes.saturating_mul(2)).contains(&buffer.capacity());
        let Some(at) = spare.iter().rposition(fits) else { return Ok(os_hints::buffer(bytes)) };
        let buffer = spare.swap_remove(at);
        drop(spare);
        self.give(buffer.capacity() as u64);
        Ok(buffer)
    }

    /// Keeps the buffer of a block for the next, unless it is being written to the disk.
    fn keep(&self, bytes: Arc<Vec<u8>>) -> Result<(), ConvertError> {
        let size = bytes.capacity() as u64;
        match Arc::try_unwrap(bytes) {
            Ok(mut buffer) if buffer.capacity() >= LEAST_SPARE => {
                buffer.clear();
                self.spare.lock().map_err(|_| poisoned())?.push(buffer);
            }
            _ => self.give(size),
        }
        Ok(())
    }

    /// Gives back spare buffers of at least so many bytes, as far as there are; returns how many.
    pub(crate) fn drop_spare(&self, bytes: u64) -> Result<u64, ConvertError> {
        let (mut spare, mut freed) = (self.spare.lock().map_err(|_| poisoned())?, 0);
        while freed < bytes
            && let Some(buffer) = spare.pop()
        {
            freed += buffer.capacity() as u64;
        }
        self.give(freed);
        Ok(freed)
    }

    /// Appends the positions of the records of a segment to `out`, [`POSITION_BYTES`] each; they can be taken still.
    pub(crate) fn read_positions(&self, segment: Segment, out: &mut Vec<u8>) -> Result<(), ConvertError> {
        let place = self.blocks.lock().map_err(|_| poisoned())?.get(segment.block as usize).map(|b| b.place.clone());
        let (start, len) = (segment.start as usize * self.stride, segment.count as usize * self.stride);
        let mut copied = Vec::new();
        let records = match &place {
            Some(Place::Memory(bytes)) if self.limits.get().is_none() => &bytes[start..start + len],
            _ => {
                self.read(segment, &mut copied)?;
                &copied[..]
            }
        };
        let positions = records.chunks_exact(self.stride).filter_map(|record| record.first_chunk::<POSITION_BYTES>());
        positions.for_each(|position| out.extend_from_slice(position));
        Ok(())
    }

    /// [`Self::take`], but the records can be taken still.
    pub(crate) fn read(&self, segment: Segment, out: &mut Vec<u8>) -> Result<u32, ConvertError> {
        let (place, source) = {
            let blocks = self.blocks.lock().map_err(|_| poisoned())?;
            let block = blocks.get(segment.block as usize).filter(|block| segment.end() <= u64::from(block.records));
            let beyond = || ConvertError::Internal("records that no block has".into());
            let block = block.ok_or_else(beyond)?;
            (block.place.clone(), block.source)
        };
        let (start, len, before) =
            (segment.start as usize * self.stride, segment.count as usize * self.stride, out.len());
        match place {
            Place::Memory(bytes) => out.extend_from_slice(&bytes[start..start + len]),
            Place::Disk { offset } => {
                self.look_at(segment.block, source, offset)?;
                let at = out.len();
                os_hints::reserve(out, len);
                out.resize(at + len, 0);
                self.read_disk(&mut out[at..], offset + start as u64, "reading the spill file")?;
            }
            Place::Gone => return Err(ConvertError::Internal("a record was taken twice".into())),
        }
        if let Some([min, max]) = self.limits.get() {
            let is_within = |q: StoredPoint| (0..3).all(|a| (min[a]..=max[a]).contains(&q[a]));
            if !out[before..].chunks_exact(self.stride).map(position).all(is_within) {
                return Err(ConvertError::Internal("a record outside of the bounds of all points".into()));
            }
        }
        Ok(source)
    }

    /// Puts records behind those that are in the spill file.
    fn spill(&self, records: &[u8]) -> Result<Place, ConvertError> {
        self.write(records).map(|offset| Place::Disk { offset })
    }

    fn write(&self, records: &[u8]) -> Result<u64, ConvertError> {
        let offset = self.spilled.fetch_add(records.len() as u64, Ordering::Relaxed);
        self.spill_file()?.write_at(records, offset, "writing the spill file")?;
        Ok(offset)
    }

    fn give(&self, bytes: u64) {
        self.in_memory.fetch_sub(bytes, Ordering::Relaxed);
        self.memory.give(Consumer::Records, bytes);
    }

    /// The spill file, made when first needed.
    fn spill_file(&self) -> Result<Arc<DiskFile>, ConvertError> {
        let mut spill = self.spill.lock().map_err(|_| poisoned())?;
        if let Some(file) = &*spill {
            return Ok(Arc::clone(file));
        }
        Ok(Arc::clone(spill.insert(Arc::new(self.temp.make()?))))
    }
}

/// True if a file, or the end of it, is not there.
fn is_missing(error: &ConvertError) -> bool {
    use std::io::ErrorKind;
    matches!(error, ConvertError::Io { error, .. } if matches!(error.kind(), ErrorKind::UnexpectedEof | ErrorKind::NotFound))
}

fn damaged(file: &Path, byte: u64) -> ConvertError {
    JobFault::Damaged { file: file.to_path_buf(), byte }.into()
}

impl Evict for Store {
    /// Spare buffers go first, then the last blocks: they are needed last.
    fn evict(&self, bytes: u64) -> Result<u64, ConvertError> {
        let (mut freed, mut next) = (self.drop_spare(bytes)?, usize::MAX);
        while freed < bytes {
            let found = {
                let blocks = self.blocks.lock().map_err(|_| poisoned())?;
                let in_memory = |block: &Block| matches!(block.place, Place::Memory(_));
                let last = blocks.iter().take(next).rposition(in_memory);
                last.and_then(|i| {
                    if let Place::Memory(bytes) = &blocks[i].place { Some((i, Arc::clone(bytes))) } else { None }
                })
            };
            let Some((index, records)) = found else { break };
            next = index;
            let copy = self.kept.lock().map_err(|_| poisoned())?.get(index).and_then(|kept| kept.copy);
            let place = match copy {
                Some(offset) => Place::Disk { offset },
                None => self.spill(&records)?,
            };
            let mut blocks = self.blocks.lock().map_err(|_| poisoned())?;
            let block = &mut blocks[index];
            // another thread may have been faster, or all of it was taken meanwhile
            if matches!(&block.place, Place::Memory(bytes) if Arc::ptr_eq(bytes, &records)) {
                block.place = place;
                drop(blocks);
                freed += records.capacity() as u64;
                self.give(records.capacity() as u64);
            }
        }
        Ok(freed)
    }
}

impl Drop for Store {
    fn drop(&mut self) {
        self.memory.give(Consumer::Records, self.in_memory.load(Ordering::Relaxed));
    }
}

fn poisoned() -> ConvertError {
    ConvertError::Internal("a worker thread failed while it held the store".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::SystemDisk;

    fn store(uses: u32) -> (tempfile::TempDir, Arc<Store>) {
        let dir = tempfile::tempdir().unwrap();
        let temp = TempFiles::new(dir.path().to_path_buf(), Arc::new(SystemDisk));
        (dir, Store::new(temp, 4, uses, &Arc::new(Pool::new(40, 40))))
    }

    #[test]
    fn records_that_must_leave_memory_are_found_on_the_disk() {
        let (_dir, store) = store(1);
        let blocks = [0, 1].map(|_| store.open(0).unwrap());
        let mut out = Vec::new();
        for (block, n) in blocks.into_iter().zip([0u8, 16]) {
            store.fill(block, &mut (n..n + 16).collect()).unwrap();
        }
        assert_eq!((store.memory.free(), store.spilled_bytes()), (8, 0));
        store.evict(10).unwrap();
        assert_eq!((store.memory.free(), store.spilled_bytes()), (24, 16));
        store.evict(100).unwrap();
        assert_eq!((store.memory.free(), store.spilled_bytes()), (40, 32));
        for block in blocks {
            store.take(Segment { block, start: 0, count: 4 }, &mut out).unwrap();
        }
        assert_eq!(out, (0..32).collect::<Vec<u8>>());
    }

    #[test]
    fn memory_and_disk_give_back_the_same_records() {
        let (_dir, store) = store(1);
        let a = store.open(0).unwrap();
        let b = store.open(1).unwrap();
        store.fill(a, &mut (0..40u8).collect()).unwrap();
        store.fill(b, &mut (100..140u8).collect()).unwrap();
        assert_eq!(store.spilled_bytes(), 40);
        let mut out = Vec::new();
        assert_eq!(store.take(Segment { block: b, start: 2, count: 3 }, &mut out).unwrap(), 1);
        assert_eq!(store.take(Segment { block: a, start: 9, count: 1 }, &mut out).unwrap(), 0);
        assert_eq!(out, (108..120).chain(36..40).collect::<Vec<u8>>());
    }

    #[test]
    fn a_block_leaves_memory_once_all_of_it_was_taken() {
        let (_dir, store) = store(1);
        let a = store.open(0).unwrap();
        store.fill(a, &mut vec![1; 40]).unwrap();
        let mut out = Vec::new();
        store.take(Segment { block: a, start: 0, count: 4 }, &mut out).unwrap();
        assert_eq!(store.in_memory.load(Ordering::Relaxed), 40);
        store.take(Segment { block: a, start: 4, count: 6 }, &mut out).unwrap();
        assert_eq!(store.in_memory.load(Ordering::Relaxed), 0);
        assert!(store.take(Segment { block: a, start: 0, count: 1 }, &mut out).is_err());
    }

    #[test]
    fn with_two_uses_a_block_stays_until_both_have_taken_it() {
        let (_dir, store) = store(2);
        let a = store.open(0).unwrap();
        store.fill(a, &mut vec![1; 40]).unwrap();
        let (all, mut out) = (Segment { block: a, start: 0, count: 10 }, Vec::new());
        store.take(all, &mut out).unwrap();
        store.read(all, &mut out).unwrap();
        assert_eq!(store.in_memory.load(Ordering::Relaxed), 40);
        store.take(all, &mut out).unwrap();
        assert_eq!((store.in_memory.load(Ordering::Relaxed), out.len()), (0, 120));
        assert!(store.take(all, &mut out).is_err());
    }

    #[test]
    fn emptied_blocks_hold_what_is_put_back_and_give_way_to_others() {
        const KIB: usize = 1 << 10;
        let dir = tempfile::tempdir().unwrap();
        let temp = TempFiles::new(dir.path().to_path_buf(), Arc::new(SystemDisk));
        let store = Store::new(temp, LEAST_SPARE, 1, &Arc::new(Pool::new(40 << 10, 40 << 10)));
        let free = || store.memory.free() / KIB as u64;
        let a = store.open(0).unwrap();
        store.fill(a, &mut vec![1; 20 * KIB]).unwrap();
        let mut out = Vec::new();
        store.take_to_put_back(Segment { block: a, start: 0, count: 2 }, true, &mut out).unwrap();
        assert_eq!(store.buffer(8 * KIB).unwrap().capacity(), 8 * KIB); // records of the block are still to be taken
        store.take_to_put_back(Segment { block: a, start: 2, count: 3 }, true, &mut out).unwrap();
        assert_eq!((out.len(), free()), (20 * KIB, 20));
        assert_eq!(store.buffer(9 * KIB).unwrap().capacity(), 9 * KIB); // twice as large as that: `fill` would copy
        let mut buffer = store.buffer(16 * KIB).unwrap();
        assert_eq!((buffer.len(), buffer.capacity(), free()), (0, 20 * KIB, 40));
        buffer.resize(16 * KIB, 2);
        let b = store.open(0).unwrap();
        store.fill(b, &mut buffer).unwrap();
        store.take_to_put_back(Segment { block: b, start: 0, count: 4 }, true, &mut out).unwrap();
        assert_eq!((free(), store.spilled_bytes()), (20, 0));
        let c = store.open(0).unwrap();
        store.fill(c, &mut vec![3; 40 * KIB]).unwrap(); // has the room of the spare buffer
        assert_eq!((free(), store.spilled_bytes()), (0, 0));
        store.take_to_put_back(Segment { block: c, start: 0, count: 10 }, true, &mut out).unwrap();
        store.evict(1).unwrap();
        assert_eq!((free(), store.spilled_bytes()), (40, 0));
    }

    #[test]
    fn buffers_of_a_few_records_are_not_kept() {
        let (_dir, store) = store(1);
        let a = store.open(0).unwrap();
        store.fill(a, &mut vec![1; 20]).unwrap();
        store.take_to_put_back(Segment { block: a, start: 0, count: 5 }, true, &mut Vec::new()).unwrap();
        assert_eq!(store.memory.free(), 40);
        assert_eq!(store.buffer(16).unwrap().capacity(), 16);
    }
}

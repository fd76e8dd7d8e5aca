//! Records of nodes that wait for the nodes above them: in memory as long as there is room, else in a temporary file.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock};

use super::raise::Points;
use crate::cloud::{RecordFrame, morton};
use crate::error::ConvertError;
use crate::runtime::{Consumer, DiskFile, Pool, Reservation, TempFiles};

/// Records are read and written in pieces of about this size.
const PIECE_BYTES: usize = 256 << 10;

/// Records of a node, in Morton order.
pub(super) struct List {
    count: u64,
    place: Place,
    /// All points share one place: they are never cut, a sample takes the first of them at most.
    pub(super) is_one_place: bool,
}

enum Place {
    /// `Reservation`: of the pool; none while the records are part of a chunk.
    Memory(Vec<u8>, Option<Reservation>),
    /// From a byte of the file on.
    Disk(Arc<DiskFile>, u64),
}

impl Points for List {
    fn count(&self) -> u64 {
        self.count
    }
}

impl List {
    /// Records in memory that nobody has accounted for yet.
    pub(super) fn of_chunk(records: Vec<u8>, stride: usize) -> Self {
        Self { count: (records.len() / stride) as u64, place: Place::Memory(records, None), is_one_place: false }
    }

    /// Records of points that share one place, in a file of their own.
    pub(super) fn of_place(file: DiskFile, count: u64) -> Self {
        Self { count, place: Place::Disk(Arc::new(file), 0), is_one_place: true }
    }

    /// Records that are in a file from a byte on, and stay there.
    pub(super) fn in_file(file: Arc<DiskFile>, start: u64, count: u64, is_one_place: bool) -> Self {
        Self { count, place: Place::Disk(file, start), is_one_place }
    }

    /// The records, if they are in memory.
    pub(super) fn in_memory(&self) -> Option<&[u8]> {
        match &self.place {
            Place::Memory(records, _) => Some(records),
            Place::Disk(..) => None,
        }
    }

    /// Looks at the records in memory, all of which are there, and keeps some: `thin` puts those that stay to the front and
    /// returns their bytes. The memory of the others stays with the list, since most lists are written at once: one that
    /// waits is [trimmed](Self::trim).
    pub(super) fn thin<E>(&mut self, stride: usize, thin: impl FnOnce(&mut [u8]) -> Result<usize, E>) -> Result<(), E> {
        if let Place::Memory(records, _) = &mut self.place {
            let kept = thin(records)?;
            records.truncate(kept);
            self.count = (kept / stride) as u64;
        }
        Ok(())
    }

    /// Gives back the memory of records that the list had once.
    pub(super) fn trim(&mut self) {
        if let Place::Memory(records, room) = &mut self.place {
            records.shrink_to_fit();
            if let Some(room) = room {
                room.try_resize(records.len() as u64); // less is always granted
            }
        }
    }

    /// Of nothing.
    pub(super) fn empty() -> Self {
        Self { count: 0, place: Place::Memory(Vec::new(), None), is_one_place: false }
    }
}

/// Where lists are, for all threads.
pub(super) struct Lists {
    pub(super) stride: usize,
    memory: Arc<Pool>,
    temp: TempFiles,
    file: Mutex<Option<Arc<DiskFile>>>,
    /// Where the next list that goes to the file begins.
    end: AtomicU64,
    /// Who samples a node of many points: side by side as long as there is memory.
    pub(super) large: RwLock<()>,
}

impl Lists {
    pub(super) fn new(stride: usize, memory: &Arc<Pool>, temp: &TempFiles) -> Self {
        Self {
            stride,
            memory: Arc::clone(memory),
            temp: temp.clone(),
            file: Mutex::new(None),
            end: AtomicU64::new(0),
            large: RwLock::new(()),
        }
    }

    /// Accounts for a list that is to wait: one of a chunk stays in memory if there is room.
    pub(super) fn admit(&self, list: &mut List) -> Result<(), ConvertError> {
        list.trim();
        if let Place::Memory(records, None) = &mut list.place {
            let records = std::mem::take(records);
            list.place = self.settle(records)?;
        }
        Ok(())
    }

    fn settle(&self, records: Vec<u8>) -> Result<Place, ConvertError> {
        match self.reserve(records.len()) {
            Some(reservation) => Ok(Place::Memory(records, Some(reservation))),
            None => {
                let (file, start) = (self.file()?, self.region(records.len() as u64));
                file.write_at(&records, start, "writing nodes that wait")?;
                Ok(Place::Disk(file, start))
            }
        }
    }

    /// Room in memory for that many bytes.
    fn reserve(&self, bytes: usize) -> Option<Reservation> {
        let bytes = bytes as u64;
        self.memory
            .try_take_eighth(Consumer::Waiting, bytes)
            .then(|| Reservation::of(&self.memory, Consumer::Waiting, bytes))
    }

    /// A region of the file; what of it is never written takes no room on the disk.
    fn region(&self, bytes: u64) -> u64 {
        self.end.fetch_add(bytes, Ordering::Relaxed)
    }

    fn file(&self) -> Result<Arc<DiskFile>, ConvertError> {
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        match &*file {
            Some(file) => Ok(Arc::clone(file)),
            None => Ok(Arc::clone(file.insert(Arc::new(self.temp.make()?)))),
        }
    }

    /// Reads a list from front to back, in pieces of whole records, until `see` says to stop.
    pub(super) fn each(
        &self,
        list: &List,
        mut see: impl FnMut(&[u8]) -> Result<bool, ConvertError>,
    ) -> Result<(), ConvertError> {
        let (mut at, mut buffer) = (0, Vec::new());
        while let Some(records) = self.piece(list, at, &mut buffer)? {
            at += (records.len() / self.stride) as u64;
            if !see(records)? {
                break;
            }
        }
        Ok(())
    }

    /// The records of a list from `at` on, as many as are read together; `None` at its end.
    pub(super) fn piece<'b>(
        &self,
        list: &'b List,
        at: u64,
        buffer: &'b mut Vec<u8>,
    ) -> Result<Option<&'b [u8]>, ConvertError> {
        let most = (PIECE_BYTES / self.stride).max(1) as u64;
        match most.min(list.count.saturating_sub(at)) {
            0 => Ok(None),
            count => self.read(list, at, count, buffer).map(Some),
        }
    }

    /// Some records of a list.
    fn read<'b>(&self, list: &'b List, at: u64, count: u64, buffer: &'b mut Vec<u8>) -> Result<&'b [u8], ConvertError> {
        let (start, len) = (at * self.stride as u64, count as usize * self.stride);
        match &list.place {
            Place::Memory(records, _) => Ok(&records[start as usize..][..len]),
            Place::Disk(file, offset) => {
                buffer.resize(len, 0);
                file.read_at(buffer, offset + start, "reading nodes that wait")?;
                Ok(buffer)
            }
        }
    }

    /// The first record of a list that is not empty.
    pub(super) fn first(&self, list: &List) -> Result<Vec<u8>, ConvertError> {
        Ok(self.read(list, 0, 1, &mut Vec::new())?.to_vec())
    }

    /// Leaves out the first record of a list that is not empty.
    pub(super) fn drop_first(&self, list: &mut List) {
        list.count -= 1;
        match &mut list.place {
            Place::Memory(records, _) => drop(records.drain(..self.stride)),
            Place::Disk(_, offset) => *offset += self.stride as u64,
        }
    }

    /// The records of two lists in one, in Morton order; those that share a place by their bytes. `b`: of the place of `a`, if
    /// that has one only.
    pub(super) fn merge(&self, a: &List, b: &List, frame: &RecordFrame) -> Result<List, ConvertError> {
        let (mut all, is_one_place) = (Writer::new(a.count + b.count), a.is_one_place);
        let (mut a, mut b) = (Cursor::new(a), Cursor::new(b));
        loop {
            let is_first = match (a.record(self)?, b.record(self)?) {
                (Some(a), Some(b)) => {
                    morton::compare(frame.tree(a).0, frame.tree(b).0).then_with(|| a.cmp(b)) == std::cmp::Ordering::Less
                }
                (None, None) => break,
                (a, _) => a.is_some(),
            };
            let from = if is_first { &mut a } else { &mut b };
            if let Some(record) = from.record(self)? {
                all.push(record, self)?;
            }
            from.next(self);
        }
        Ok(List { is_one_place, ..all.finish(self)? })
    }

    /// Moves one record into a list of its own.
    pub(super) fn take_one(&self, list: &mut List, index: u64) -> Result<List, ConvertError> {
        let from = std::mem::replace(list, List::empty());
        let (mut one, mut rest) = (Writer::new(1), Writer::new(from.count - 1));
        let (mut at, mut buffer) = (0, Vec::new());
        while let Some(piece) = self.piece(&from, at, &mut buffer)?.map(<[u8]>::to_vec) {
            for record in piece.chunks_exact(self.stride) {
                let writer = if at == index { &mut one } else { &mut rest };
                writer.push(record, self)?;
                at += 1;
            }
        }
        *list = rest.finish(self)?;
        list.is_one_place = from.is_one_place;
        one.finish(self)
    }
}

/// Reads a list from front to back, a record at a time.
struct Cursor<'l> {
    list: &'l List,
    /// Records before the piece, and bytes of the piece that were read.
    before: u64,
    at: usize,
    piece: Vec<u8>,
    buffer: Vec<u8>,
}

impl<'l> Cursor<'l> {
    fn new(list: &'l List) -> Self {
        Self { list, before: 0, at: 0, piece: Vec::new(), buffer: Vec::new() }
    }

    /// The record that it stands at; `None` at the end.
    fn record(&mut self, lists: &Lists) -> Result<Option<&[u8]>, ConvertError> {
        if self.at == self.piece.len() {
            self.before += (self.piece.len() / lists.stride) as u64;
            self.at = 0;
            self.piece.clear();
            if let Some(piece) = lists.piece(self.list, self.before, &mut self.buffer)? {
                self.piece.extend_from_slice(piece);
            }
        }
        Ok(self.piece.get(self.at..self.at + lists.stride))
    }

    /// Goes to the next record.
    fn next(&mut self, lists: &Lists) {
        self.at += lists.stride;
    }
}

/// A list while it is written.
pub(super) struct Writer {
    /// Records that it may come to.
    most: u64,
    count: u64,
    records: Vec<u8>,
    /// Where it begins in the file, and how many of its bytes are there.
    in_file: Option<(u64, u64)>,
    room: Option<Reservation>,
}

impl Writer {
    /// Of a list of at most `most` records.
    pub(super) fn new(most: u64) -> Self {
        Self { most, count: 0, records: Vec::new(), in_file: None, room: None }
    }

    #[inline]
    pub(super) fn push(&mut self, record: &[u8], lists: &Lists) -> Result<(), ConvertError> {
        if self.records.len() + record.len() > self.records.capacity() {
            self.grow(lists)?;
        }
        self.records.extend_from_slice(record);
        self.count += 1;
        Ok(())
    }

    /// Makes room for more records: in memory, or by writing those that are there.
    fn grow(&mut self, lists: &Lists) -> Result<(), ConvertError> {
        let stride = lists.stride;
        if self.in_file.is_none() {
            let most = usize::try_from(self.most).unwrap_or(usize::MAX).saturating_mul(stride);
            let capacity = (2 * self.records.len()).max(PIECE_BYTES).min(most).max(self.records.len() + stride);
            if self.room.is_none() {
                self.room = lists.reserve(0);
            }
            let is_reserved = match &mut self.room {
                Some(room) => room.try_resize(capacity as u64),
                None => false,
            };
            if is_reserved {
                self.records.reserve_exact(capacity - self.records.len());
                return Ok(());
            }
            self.in_file = Some((lists.region(self.most * stride as u64), 0));
        }
        self.flush(lists)?;
        self.records = Vec::with_capacity(PIECE_BYTES.max(stride));
        self.room = None;
        Ok(())
    }

    fn flush(&mut self, lists: &Lists) -> Result<(), ConvertError> {
        if let Some((start, written)) = &mut self.in_file {
            lists.file()?.write_at(&self.records, *start + *written, "writing nodes that wait")?;
            *written += self.records.len() as u64;
            self.records.clear();
        }
        Ok(())
    }

    /// The list.
    pub(super) fn finish(mut self, lists: &Lists) -> Result<List, ConvertError> {
        self.flush(lists)?;
        let place = match self.in_file {
            Some((start, _)) => Place::Disk(lists.file()?, start),
            None => Place::Memory(self.records, self.room),
        };
        let mut list = List { count: self.count, place, is_one_place: false };
        list.trim();
        Ok(list)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pointmill_format::Lattice;

    use crate::cloud::{Cube, JobBounds, JobPoint, StoredOrigin};
    use crate::runtime::SystemDisk;

    fn numbers(lists: &Lists, list: &List) -> Vec<u32> {
        let mut found = Vec::new();
        let add = |records: &[u8]| {
            found.extend(records.as_chunks::<4>().0.iter().map(|r| u32::from_le_bytes(*r)));
            Ok(true)
        };
        lists.each(list, add).unwrap();
        found
    }

    #[test]
    fn lists_give_back_what_they_hold_from_memory_and_from_the_disk() {
        for room in [1 << 30, 300_000, 0] {
            let memory = Arc::new(Pool::new(room, room));
            let lists = Lists::new(4, &memory, &TempFiles::new(std::env::temp_dir(), Arc::new(SystemDisk)));
            let (mut even, mut odd) = (Writer::new(200_000), Writer::new(200_000));
            for i in 0..400_000u32 {
                let writer = if i % 2 == 0 { &mut even } else { &mut odd };
                writer.push(&i.to_le_bytes(), &lists).unwrap();
            }
            let (mut even, mut odd) = (even.finish(&lists).unwrap(), odd.finish(&lists).unwrap());
            assert_eq!(numbers(&lists, &even), (0..400_000).step_by(2).collect::<Vec<u32>>());
            let middle = lists.take_one(&mut odd, 100_000).unwrap();
            assert_eq!(numbers(&lists, &middle), [200_001]);
            let left: Vec<u32> = (1..400_000).step_by(2).filter(|i| *i != 200_001).collect();
            assert_eq!((numbers(&lists, &odd), odd.count()), (left, 199_999));
            assert_eq!(lists.first(&even).unwrap(), [0; 4]);
            lists.drop_first(&mut even);
            assert_eq!(numbers(&lists, &even), (2..400_000).step_by(2).collect::<Vec<u32>>());
            let mut chunk = List::of_chunk(vec![7; 400], 4);
            lists.admit(&mut chunk).unwrap();
            assert_eq!(numbers(&lists, &chunk).len(), 100);
            assert_eq!(lists.end.load(Ordering::Relaxed) > 0, room < 1 << 30);
            drop((even, odd, middle, chunk));
            assert_eq!(memory.free(), room, "all was given back");
        }
    }
    /// A list in memory of the numbers below `count`, four bytes each.
    fn counted(lists: &Lists, count: u32) -> List {
        let mut writer = Writer::new(u64::from(count));
        (0..count).for_each(|i| writer.push(&i.to_le_bytes(), lists).unwrap());
        writer.finish(lists).unwrap()
    }

    /// Keeps the numbers of which `stays` is true.
    fn thin(list: &mut List, stays: impl Fn(u32) -> bool) {
        let front = |records: &mut [u8]| -> Result<usize, ()> {
            let kept: Vec<u8> = records.chunks_exact(4).filter(|r| stays(r[0].into())).flatten().copied().collect();
            records[..kept.len()].copy_from_slice(&kept);
            Ok(kept.len())
        };
        list.thin(4, front).unwrap();
    }

    #[test]
    fn a_thinned_list_is_what_stays_and_gives_the_rest_back_when_it_waits() {
        let memory = Arc::new(Pool::new(1 << 20, 1 << 20));
        let lists = Lists::new(4, &memory, &TempFiles::new(std::env::temp_dir(), Arc::new(SystemDisk)));
        for (count, step) in [(0, 1), (1, 1), (1, 2), (200, 1), (200, 3), (200, 200)] {
            let mut list = counted(&lists, count);
            thin(&mut list, |i| (i + 1) % step == 0);
            let left: Vec<u32> = (0..count).filter(|i| (i + 1) % step == 0).collect();
            assert_eq!((numbers(&lists, &list), list.count()), (left, u64::from(count / step)));
            assert_eq!(memory.taken_by(Consumer::Waiting), 4 * u64::from(count), "until it waits");
            lists.admit(&mut list).unwrap();
            assert_eq!(memory.taken_by(Consumer::Waiting), 4 * u64::from(count / step));
            assert!(matches!(&list.place, Place::Memory(records, Some(_)) if records.capacity() == records.len()));
            assert_eq!(numbers(&lists, &list).len() as u64, list.count());
        }
        assert_eq!(memory.free(), 1 << 20);
    }

    #[test]
    fn a_list_that_cannot_be_thinned_stays_as_it_was() {
        let memory = Arc::new(Pool::new(1 << 20, 1 << 20));
        let lists = Lists::new(4, &memory, &TempFiles::new(std::env::temp_dir(), Arc::new(SystemDisk)));
        let mut list = counted(&lists, 5);
        assert_eq!(list.thin(4, |_| Err("no")), Err("no"));
        assert_eq!((numbers(&lists, &list), list.count()), (vec![0, 1, 2, 3, 4], 5));
    }

    #[test]
    fn two_lists_become_one_in_morton_order() {
        let cube =
            Cube::around(&JobBounds::new([0; 3], [99; 3]), &Lattice { scale: [1.0; 3], offset: [0.0; 3] }).unwrap();
        let frame = RecordFrame { stride: 13, cube, origin: StoredOrigin(JobPoint([0; 3])) };
        let record = |[x, y, z]: [i32; 3], tag: u8| {
            [x.to_le_bytes(), y.to_le_bytes(), z.to_le_bytes()].concat().into_iter().chain([tag]).collect::<Vec<u8>>()
        };
        let memory = Arc::new(Pool::new(1 << 20, 1 << 20));
        let lists = Lists::new(13, &memory, &TempFiles::new(std::env::temp_dir(), Arc::new(SystemDisk)));
        let list = |records: &[Vec<u8>]| List::of_chunk(records.concat(), 13);
        let (a, b) =
            ([record([0; 3], 1), record([9; 3], 1)], [record([0; 3], 0), record([0; 3], 2), record([90; 3], 0)]);
        let merged = lists.merge(&list(&a), &list(&b), &frame).unwrap();
        let mut found = Vec::new();
        let add = |records: &[u8]| {
            found.extend_from_slice(records);
            Ok(true)
        };
        lists.each(&merged, add).unwrap();
        let [a, b] = [&a[..], &b[..]];
        assert_eq!(found, [&b[0], &a[0], &b[1], &a[1], &b[2]].map(|r| r.clone()).concat());
        assert_eq!(merged.count(), 5);
    }
}

//! More records in order than memory holds: runs that are sorted in memory wait in a temporary file and are merged.

use std::cmp::Ordering;
use std::sync::Arc;

use super::segments::Segment;
use crate::error::ConvertError;
use crate::runtime::{DiskFile, Runtime};

/// Runs that are merged at once.
const FAN_IN: usize = 32;

/// Bytes of a run that are read together, and of sorted records that are written together.
const PIECE_BYTES: usize = 128 << 10;

/// Records on their way into order.
pub(crate) struct BigSort<'a, C> {
    rt: &'a Runtime<'a>,
    stride: usize,
    compare: C,
    /// Records of a run.
    run_records: usize,
    records: Vec<u8>,
    file: Option<Arc<DiskFile>>,
    end: u64,
    runs: Vec<Run>,
}

/// Sorted records in the file.
#[derive(Debug, Clone, Copy)]
struct Run {
    offset: u64,
    records: u64,
}

impl<'a, C: Fn(&[u8], &[u8]) -> Ordering> BigSort<'a, C> {
    /// Of records of `stride` bytes, in `memory_bytes` of memory.
    pub(crate) fn new(rt: &'a Runtime<'a>, stride: usize, memory_bytes: u64, compare: C) -> Self {
        let run_records = (memory_bytes as usize / (stride + size_of::<u32>())).clamp(2, 1 << 30);
        Self { rt, stride, compare, run_records, records: Vec::new(), file: None, end: 0, runs: Vec::new() }
    }

    /// How many records may be appended to [`Self::records`] before [`Self::settle`].
    pub(crate) fn room(&self) -> usize {
        self.run_records - self.records.len() / self.stride
    }

    /// Where whole records are appended.
    pub(crate) fn records(&mut self) -> &mut Vec<u8> {
        if self.records.capacity() == 0 {
            self.records.reserve_exact(self.run_records * self.stride);
        }
        &mut self.records
    }

    /// Takes the records of segments; `load` appends those of one.
    pub(crate) fn fill<'s>(
        &mut self,
        segments: impl IntoIterator<Item = &'s Segment>,
        mut load: impl FnMut(Segment, &mut Vec<u8>) -> Result<(), ConvertError>,
    ) -> Result<(), ConvertError> {
        for segment in segments {
            let mut start = 0;
            while start < segment.count {
                let count = (segment.count - start).min(self.room() as u32);
                load(Segment { start: segment.start + start, count, ..*segment }, self.records())?;
                self.settle()?;
                start += count;
            }
        }
        Ok(())
    }

    /// Must follow what was appended: puts a full run aside.
    pub(crate) fn settle(&mut self) -> Result<(), ConvertError> {
        if self.room() > 0 { Ok(()) } else { self.close_run() }
    }

    fn close_run(&mut self) -> Result<(), ConvertError> {
        if self.records.is_empty() {
            return Ok(());
        }
        self.rt.check_stop()?;
        let order = order(&self.records, self.stride, &self.compare);
        let mut run = self.begin_run()?;
        for i in order {
            run.push(&self.records[i as usize * self.stride..][..self.stride])?;
        }
        self.end_run(run)?;
        self.records.clear();
        Ok(())
    }

    fn begin_run(&mut self) -> Result<RunWriter, ConvertError> {
        let file = match &self.file {
            Some(file) => Arc::clone(file),
            None => Arc::clone(self.file.insert(Arc::new(self.rt.temp.make()?))),
        };
        Ok(RunWriter { file, offset: self.end, written: 0, bytes: Vec::new() })
    }

    fn end_run(&mut self, mut run: RunWriter) -> Result<(), ConvertError> {
        run.flush()?;
        self.runs.push(Run { offset: run.offset, records: run.written / self.stride as u64 });
        self.end = run.offset + run.written;
        Ok(())
    }

    /// Hands out all records in order.
    pub(crate) fn finish(
        mut self,
        mut take: impl FnMut(&[u8]) -> Result<(), ConvertError>,
    ) -> Result<(), ConvertError> {
        if self.runs.is_empty() {
            let order = order(&self.records, self.stride, &self.compare);
            return order.into_iter().try_for_each(|i| take(&self.records[i as usize * self.stride..][..self.stride]));
        }
        self.close_run()?;
        self.records = Vec::new();
        while self.runs.len() > FAN_IN {
            let runs = std::mem::take(&mut self.runs);
            for group in runs.chunks(FAN_IN) {
                let mut merged = self.begin_run()?;
                self.merge(group, |record| merged.push(record))?;
                self.end_run(merged)?;
            }
        }
        self.merge(&self.runs, take)
    }

    fn merge(&self, runs: &[Run], mut take: impl FnMut(&[u8]) -> Result<(), ConvertError>) -> Result<(), ConvertError> {
        let Some(file) = &self.file else { return Ok(()) };
        let cursor = |run: &Run| Cursor { run: *run, stride: self.stride, piece: Vec::new(), at: 0 };
        let mut cursors: Vec<Cursor> = runs.iter().map(cursor).collect();
        for cursor in &mut cursors {
            cursor.advance(file)?;
        }
        // A heap of runs, the one with the least record first; of equals any.
        let mut heap: Vec<usize> = (0..cursors.len()).filter(|i| cursors[*i].record().is_some()).collect();
        for i in (0..heap.len() / 2).rev() {
            self.sink(&mut heap, &cursors, i);
        }
        let mut count = 0u64;
        while let Some(&least) = heap.first() {
            if let Some(record) = cursors[least].record() {
                take(record)?;
            }
            count += 1;
            if count.is_multiple_of(1 << 16) {
                self.rt.check_stop()?;
            }
            cursors[least].at += self.stride;
            cursors[least].advance(file)?;
            if cursors[least].record().is_none() {
                heap.swap_remove(0);
            }
            self.sink(&mut heap, &cursors, 0);
        }
        Ok(())
    }

    /// Moves an entry of the heap down to its place.
    fn sink(&self, heap: &mut [usize], cursors: &[Cursor], mut at: usize) {
        let is_less = |a: usize, b: usize| match (cursors[a].record(), cursors[b].record()) {
            (Some(a), Some(b)) => (self.compare)(a, b).is_lt(),
            _ => false,
        };
        loop {
            let mut least = at;
            for child in [2 * at + 1, 2 * at + 2] {
                if child < heap.len() && is_less(heap[child], heap[least]) {
                    least = child;
                }
            }
            if least == at {
                return;
            }
            heap.swap(at, least);
            at = least;
        }
    }
}

/// Indices of records in order.
fn order(records: &[u8], stride: usize, compare: impl Fn(&[u8], &[u8]) -> Ordering) -> Vec<u32> {
    let record = |i: u32| &records[i as usize * stride..][..stride];
    let mut order: Vec<u32> = (0..(records.len() / stride) as u32).collect();
    order.sort_unstable_by(|a, b| compare(record(*a), record(*b)));
    order
}

/// A run while it is written.
struct RunWriter {
    file: Arc<DiskFile>,
    offset: u64,
    written: u64,
    bytes: Vec<u8>,
}

impl RunWriter {
    fn push(&mut self, record: &[u8]) -> Result<(), ConvertError> {
        self.bytes.extend_from_slice(record);
        if self.bytes.len() >= PIECE_BYTES { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), ConvertError> {
        self.file.write_at(&self.bytes, self.offset + self.written, "writing sorted records")?;
        self.written += self.bytes.len() as u64;
        self.bytes.clear();
        Ok(())
    }
}

/// What is left of a run.
struct Cursor {
    run: Run,
    stride: usize,
    piece: Vec<u8>,
    /// Byte of the piece at which the next record begins.
    at: usize,
}

impl Cursor {
    fn record(&self) -> Option<&[u8]> {
        self.piece.get(self.at..self.at + self.stride)
    }

    /// Reads the next piece once one is used up.
    fn advance(&mut self, file: &DiskFile) -> Result<(), ConvertError> {
        if self.at < self.piece.len() {
            return Ok(());
        }
        let records = ((PIECE_BYTES / self.stride).max(1) as u64).min(self.run.records);
        self.at = 0;
        self.piece.resize(records as usize * self.stride, 0);
        file.read_at(&mut self.piece, self.run.offset, "reading sorted records")?;
        self.run.records -= records;
        self.run.offset += self.piece.len() as u64;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;
    use crate::plan::Plan;
    use crate::runtime::{Budget, Least, Silent, SystemDisk, TempFiles};

    #[test]
    fn records_come_in_order_whatever_the_memory() {
        let dir = tempfile::tempdir().unwrap();
        let mut plan = Plan::new(vec![], "out".into());
        (plan.threads, plan.memory_bytes) = (1, 1 << 30);
        let budget = Budget::new(&plan, 38, Least::of([], 0, 0)).unwrap();
        let temp = TempFiles::new(dir.path().into(), Arc::new(SystemDisk));
        let rt = Runtime::start(&plan, budget, temp, &Silent).unwrap();
        let mut random = Random::new(5);
        for (count, memory) in [(0, 100), (1, 100), (1000, 1 << 20), (1000, 800), (20_000, 2_000), (5_000, 1)] {
            let numbers: Vec<u32> = (0..count).map(|_| random.below(3000) as u32).collect();
            let mut sort = BigSort::new(&rt, 8, memory, |a: &[u8], b: &[u8]| a.cmp(b));
            let mut rest = &numbers[..];
            while !rest.is_empty() {
                let (now, later) = rest.split_at(sort.room().min(rest.len()));
                let bytes = now.iter().flat_map(|n| u64::from(*n).to_be_bytes());
                sort.records().extend(bytes);
                sort.settle().unwrap();
                rest = later;
            }
            let mut found = Vec::new();
            let take = |record: &[u8]| {
                found.push(u64::from_be_bytes(record.try_into().unwrap()) as u32);
                Ok(())
            };
            sort.finish(take).unwrap();
            let mut expected = numbers;
            expected.sort_unstable();
            assert_eq!(found, expected, "{count} records in {memory} bytes");
        }
    }
}

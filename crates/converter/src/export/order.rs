//! Puts what threads have encoded behind one another in a file, in the order of their units. Chunks are written at their places
//! by the thread that learns them.

use std::collections::HashMap;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use crate::error::ConvertError;
use crate::runtime::DiskFile;

/// Bytes that stay together: a chunk of a compressed file, a run of records of others.
pub(super) struct Part {
    pub(super) points: u32,
    pub(super) bytes: Vec<u8>,
}

/// Where threads hand in their parts. A thread may be a few units ahead of the oldest unfinished one, no more: that bounds
/// the memory.
pub(super) struct Order<'a> {
    file: &'a DiskFile,
    window: usize,
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    /// The unit whose parts come next.
    next: usize,
    /// Where its first part goes.
    at: u64,
    /// Points and bytes of all parts so far.
    parts: Vec<(u32, u32)>,
    waiting: HashMap<usize, Vec<Part>>,
    /// Units above this one are not needed any more.
    last: usize,
}

impl<'a> Order<'a> {
    /// Parts go to `file` from byte `start` on.
    pub(super) fn new(file: &'a DiskFile, start: u64, window: usize) -> Self {
        let state = State { next: 0, at: start, parts: Vec::new(), waiting: HashMap::new(), last: usize::MAX };
        Self { file, window: window.max(1), state: Mutex::new(state), changed: Condvar::new() }
    }

    /// Waits until a unit may be begun; false if it is not needed any more, because one below it failed.
    pub(super) fn admit(&self, unit: usize) -> bool {
        self.wait(unit, (unit + 1).saturating_sub(self.window)).is_some()
    }

    fn wait(&self, unit: usize, first: usize) -> Option<MutexGuard<'_, State>> {
        let mut state = self.lock();
        while unit <= state.last && state.next < first {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        (unit <= state.last).then_some(state)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A unit has failed: those above it that wait are let go.
    pub(super) fn stop_above(&self, unit: usize) {
        let mut state = self.lock();
        state.last = state.last.min(unit);
        drop(state);
        self.changed.notify_all();
    }

    /// Writes parts of a unit that has more than it may keep: once it is the next one.
    pub(super) fn write(&self, unit: usize, parts: Vec<Part>) -> Result<(), ConvertError> {
        let Some(mut state) = self.wait(unit, unit) else { return Ok(()) };
        let at = state.place(&parts)?;
        drop(state);
        self.put(parts, at)
    }

    /// Takes the last parts of a unit; whatever has become next is written.
    pub(super) fn finish(&self, unit: usize, parts: Vec<Part>) -> Result<(), ConvertError> {
        let mut state = self.lock();
        state.waiting.insert(unit, parts);
        let mut placed = Vec::new();
        loop {
            let next = state.next;
            let Some(parts) = state.waiting.remove(&next) else { break };
            placed.push((state.place(&parts)?, parts));
            state.next += 1;
        }
        drop(state);
        self.changed.notify_all();
        placed.into_iter().try_for_each(|(at, parts)| self.put(parts, at))
    }

    fn put(&self, parts: Vec<Part>, mut at: u64) -> Result<(), ConvertError> {
        for part in parts {
            self.file.write_at(&part.bytes, at, "writing points")?;
            self.file.start_write_back(at, part.bytes.len());
            at += part.bytes.len() as u64;
        }
        Ok(())
    }

    /// Where the parts end, and points and bytes of each of them in their order.
    pub(super) fn end(self) -> (u64, Vec<(u32, u32)>) {
        let state = self.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        (state.at, state.parts)
    }
}

impl State {
    /// Gives parts their places behind the others; where the first one goes.
    fn place(&mut self, parts: &[Part]) -> Result<u64, ConvertError> {
        let first = self.at;
        for part in parts {
            let bytes = u32::try_from(part.bytes.len())
                .map_err(|_| ConvertError::Internal("a part of more than 4 GiB".into()))?;
            self.parts.push((part.points, bytes));
            self.at += u64::from(bytes);
        }
        Ok(first)
    }
}

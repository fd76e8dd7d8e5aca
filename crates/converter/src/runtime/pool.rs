//! Memory that is not known beforehand, shared out while a run goes on: who takes it, and who makes room.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Duration;

use crate::error::{ConvertError, MemoryNeed};

/// What takes memory from the pool.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Consumer {
    /// Records that wait in the store.
    Records,
    /// What threads have while they read or build.
    Threads,
    /// Lists of records by cell, and counts of cells.
    Cells,
    /// Records of nodes that wait for the nodes above them.
    Waiting,
    /// What is known of finished nodes and leaves.
    Nodes,
    /// A unit of work that is larger than others.
    Work,
}

const CONSUMERS: usize = 6;

impl Consumer {
    /// For errors: "… need more memory".
    const fn name(self) -> &'static str {
        match self {
            Self::Records => "records that wait",
            Self::Threads => "worker threads",
            Self::Cells => "the lists of where points are",
            Self::Waiting => "nodes that wait for those above them",
            Self::Nodes => "the lists of nodes",
            Self::Work => "the largest nodes",
        }
    }
}

/// Something that can put memory on the disk.
pub(crate) trait Evict: Send + Sync {
    /// Gives back at least `bytes` to the pool, if it has as many; returns how many it gave.
    ///
    /// # Errors
    /// Writing fails.
    fn evict(&self, bytes: u64) -> Result<u64, ConvertError>;
}

/// Records may be counted already and not be there to be evicted yet, or be counted still: for moments, while another thread adds or
/// takes them.
const MOST_MOMENTS: u32 = 100;

/// How long such a moment is.
const MOMENT: Duration = Duration::from_millis(1);

/// The shared part of the memory below the ceiling.
pub(crate) struct Pool {
    capacity: u64,
    /// Of the whole process, for errors.
    ceiling: u64,
    /// For records alone.
    most_records: u64,
    used: AtomicU64,
    by: [AtomicU64; CONSUMERS],
    evict: Mutex<Option<Weak<dyn Evict>>>,
    /// One thread makes room at a time; others wait for what it frees.
    evicting: Mutex<()>,
}

impl Pool {
    /// A pool of `capacity` bytes below a ceiling of `ceiling` bytes.
    pub(crate) fn new(capacity: u64, ceiling: u64) -> Self {
        Self {
            capacity,
            ceiling,
            most_records: u64::MAX,
            used: AtomicU64::new(0),
            by: Default::default(),
            evict: Mutex::new(None),
            evicting: Mutex::new(()),
        }
    }

    /// The same with at most so many bytes of records.
    pub(crate) fn with_records(self, most_records: Option<u64>) -> Self {
        Self { most_records: most_records.unwrap_or(u64::MAX), ..self }
    }

    /// Names what makes room when the pool is empty.
    pub(crate) fn evict_from(&self, evict: Weak<dyn Evict>) {
        if let Ok(mut slot) = self.evict.lock() {
            *slot = Some(evict);
        }
    }

    /// Bytes that a consumer has now.
    pub(crate) fn taken_by(&self, who: Consumer) -> u64 {
        self.by[who as usize].load(Ordering::Relaxed)
    }

    /// Bytes that nobody has now.
    pub(crate) fn free(&self) -> u64 {
        self.capacity.saturating_sub(self.used.load(Ordering::Relaxed))
    }

    /// Takes `bytes` if they are free: for what can go to the disk instead.
    pub(crate) fn try_take(&self, who: Consumer, bytes: u64) -> bool {
        if who == Consumer::Records && self.taken_by(who).saturating_add(bytes) > self.most_records {
            return false;
        }
        let add = |used: u64| used.checked_add(bytes).filter(|sum| *sum <= self.capacity);
        let is_taken = self.used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, add).is_ok();
        if is_taken {
            self.by[who as usize].fetch_add(bytes, Ordering::Relaxed);
        }
        is_taken
    }

    /// [`Self::try_take`] for what goes to the disk easily and must leave room for others: at most an eighth of all is for
    /// it.
    pub(crate) fn try_take_eighth(&self, who: Consumer, bytes: u64) -> bool {
        self.taken_by(who) + bytes <= self.capacity / 8 && self.try_take(who, bytes)
    }

    /// Takes `bytes`; records go to the disk to make room.
    ///
    /// # Errors
    /// There is no room; the error says what ceiling would have had it.
    pub(crate) fn take(&self, who: Consumer, bytes: u64) -> Result<(), ConvertError> {
        let mut moments = 0;
        while !self.try_take(who, bytes) {
            let records = self.taken_by(Consumer::Records);
            // what would be missing if there were none
            let others = self.used.load(Ordering::Relaxed).saturating_sub(records);
            let missing = others.saturating_add(bytes).saturating_sub(self.capacity);
            if missing == 0 && (self.make_room(bytes)? || self.free() >= bytes) {
                continue; // another thread may take it first, and has records to be put on the disk then
            }
            if records == 0 || moments == MOST_MOMENTS {
                // half of what is added goes to the chunks of the threads
                let missing = missing.max(bytes.saturating_sub(self.free().saturating_add(records)));
                let needed = self.ceiling + missing.saturating_mul(2).div_ceil(9) * 10 + (1 << 20);
                return Err(ConvertError::Memory { ceiling: self.ceiling, needed, why: MemoryNeed::Part(who.name()) });
            }
            moments += 1;
            std::thread::sleep(MOMENT);
        }
        Ok(())
    }

    /// Puts records on the disk until `bytes` are free; false: there were none to be put there.
    fn make_room(&self, bytes: u64) -> Result<bool, ConvertError> {
        let evict = self.evict.lock().ok().and_then(|slot| slot.as_ref().and_then(Weak::upgrade));
        let Some(evict) = evict.filter(|_| self.taken_by(Consumer::Records) > 0) else { return Ok(false) };
        let _alone = self.evicting.lock().unwrap_or_else(PoisonError::into_inner);
        let missing = bytes.saturating_sub(self.free());
        Ok(missing == 0 || evict.evict(missing)? > 0)
    }

    /// Gives `bytes` back.
    pub(crate) fn give(&self, who: Consumer, bytes: u64) {
        self.used.fetch_sub(bytes, Ordering::Relaxed);
        self.by[who as usize].fetch_sub(bytes, Ordering::Relaxed);
    }
}

/// Memory that one owner has taken; it is given back when the owner goes.
pub(crate) struct Reservation {
    pool: Arc<Pool>,
    who: Consumer,
    bytes: u64,
}

impl Reservation {
    /// Of nothing yet.
    pub(crate) fn new(pool: &Arc<Pool>, who: Consumer) -> Self {
        Self { pool: Arc::clone(pool), who, bytes: 0 }
    }

    /// Of what was taken already.
    pub(crate) fn of(pool: &Arc<Pool>, who: Consumer, bytes: u64) -> Self {
        Self { pool: Arc::clone(pool), who, bytes }
    }

    /// What the owner has.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// [`Self::resize`] if there is room without anything making way, and the consumer has no more than an eighth of all then.
    pub(crate) fn try_resize(&mut self, bytes: u64) -> bool {
        let fits = match bytes.checked_sub(self.bytes) {
            Some(more) => self.pool.try_take_eighth(self.who, more),
            None => {
                self.pool.give(self.who, self.bytes - bytes);
                true
            }
        };
        if fits {
            self.bytes = bytes;
        }
        fits
    }

    /// Takes more, or gives some back, until it has `bytes`.
    ///
    /// # Errors
    /// There is no room.
    pub(crate) fn resize(&mut self, bytes: u64) -> Result<(), ConvertError> {
        match bytes.checked_sub(self.bytes) {
            Some(more) => self.pool.take(self.who, more)?,
            None => self.pool.give(self.who, self.bytes - bytes),
        }
        self.bytes = bytes;
        Ok(())
    }

    /// [`Self::resize`], but nothing is given back.
    ///
    /// # Errors
    /// There is no room.
    pub(crate) fn grow_to(&mut self, bytes: u64) -> Result<(), ConvertError> {
        self.resize(bytes.max(self.bytes))
    }

    /// Adds what another owner has taken.
    pub(crate) fn merge(&mut self, mut other: Self) {
        self.bytes += std::mem::take(&mut other.bytes);
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        self.pool.give(self.who, self.bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Records(Weak<Pool>);

    impl Evict for Records {
        fn evict(&self, bytes: u64) -> Result<u64, ConvertError> {
            let pool = self.0.upgrade().unwrap();
            let given = bytes.min(pool.taken_by(Consumer::Records));
            pool.give(Consumer::Records, given);
            Ok(given)
        }
    }

    /// As long as there are some, another thread takes what was freed for records of its own, or has them in hand.
    struct Contended(Weak<Pool>, AtomicU64);

    impl Evict for Contended {
        fn evict(&self, bytes: u64) -> Result<u64, ConvertError> {
            let pool = self.0.upgrade().unwrap();
            match self.1.fetch_add(1, Ordering::Relaxed) {
                0 => Ok(bytes), // given, and taken again
                1 => Ok(0),     // in the hands of another
                _ => {
                    pool.give(Consumer::Records, bytes);
                    Ok(bytes)
                }
            }
        }
    }

    #[test]
    fn room_that_others_take_first_is_made_again() {
        let pool = Arc::new(Pool::new(100, 1000));
        let evict: Arc<dyn Evict> = Arc::new(Contended(Arc::downgrade(&pool), AtomicU64::new(0)));
        pool.evict_from(Arc::downgrade(&evict));
        assert!(pool.try_take(Consumer::Records, 100));
        let mut cells = Reservation::new(&pool, Consumer::Cells);
        cells.resize(30).unwrap();
        assert_eq!((pool.taken_by(Consumer::Records), pool.free()), (70, 0));
    }

    #[test]
    fn records_make_room_until_there_are_none_and_then_the_error_says_how_much_is_enough() {
        let pool = Arc::new(Pool::new(100, 1000));
        let evict: Arc<dyn Evict> = Arc::new(Records(Arc::downgrade(&pool)));
        pool.evict_from(Arc::downgrade(&evict));
        assert!(pool.try_take(Consumer::Records, 90) && !pool.try_take(Consumer::Records, 20));
        let mut nodes = Reservation::new(&pool, Consumer::Nodes);
        nodes.resize(60).unwrap();
        assert_eq!((pool.taken_by(Consumer::Records), pool.free()), (40, 0));
        nodes.resize(100).unwrap();
        let error = nodes.resize(190).unwrap_err();
        assert!(matches!(error, ConvertError::Memory { ceiling: 1000, needed, .. } if needed >= 1100), "{error}");
        nodes.resize(30).unwrap();
        let mut more = Reservation::new(&pool, Consumer::Nodes);
        more.resize(5).unwrap();
        nodes.merge(more);
        assert_eq!(pool.free(), 65);
        drop(nodes);
        assert_eq!((pool.free(), pool.taken_by(Consumer::Nodes)), (100, 0));
    }
}

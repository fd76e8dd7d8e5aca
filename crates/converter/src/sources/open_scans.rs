//! Scans are opened when they are read. Some stay open: a run of a few never opens one twice.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard};

use pointmill_format::{ErrorKind, Piece, ReadError, Scan};

use super::opener::Opener;
use super::same;
use super::source::Source;
use crate::error::{ConvertError, InputFault};
use crate::runtime::most_open_files;

/// Scans that stay open. Units of work are handed out in ascending order, so more than one for each thread gain nothing
/// unless all scans are among them.
const MOST: usize = 256;

/// Files that a run has open beside scans: those of the datasets, the spill file, the report, pipes.
const OTHER_FILES: usize = 32;

/// What the descriptions of scans that stay open may take.
const MOST_BYTES: usize = 16 << 20;

/// A scan without pieces and attributes, bytes.
const SCAN_BYTES: usize = 4 << 10;

/// An attribute, bytes.
const ATTRIBUTE_BYTES: usize = 256;

/// The scans that are open, by index of their source.
pub(super) struct OpenScans {
    opener: Opener,
    most: usize,
    kept: Mutex<Kept>,
}

#[derive(Default)]
struct Kept {
    scans: HashMap<usize, Place>,
    /// Counts uses.
    now: u64,
    /// Of all.
    bytes: usize,
}

/// Whoever opens a scan holds the lock, so that nobody else does.
type Slot = Arc<Mutex<Option<Arc<dyn Scan>>>>;

struct Place {
    slot: Slot,
    used: u64,
    bytes: usize,
}

impl OpenScans {
    /// None yet. `threads`: as many threads will read.
    pub(super) fn new(opener: Opener, threads: usize) -> Self {
        // a thread holds the scan that it reads, and opens the next one
        let free = most_open_files().saturating_sub(OTHER_FILES + 2 * threads);
        Self::with_room_for(opener, free.clamp(1, MOST))
    }

    fn with_room_for(opener: Opener, most: usize) -> Self {
        Self { opener, most, kept: Mutex::default() }
    }

    /// How many stay open.
    pub(super) fn most(&self) -> usize {
        self.most
    }

    pub(super) fn opener(&self) -> &Opener {
        &self.opener
    }

    /// Keeps a scan that is open.
    pub(super) fn keep(&self, index: usize, scan: Arc<dyn Scan>) -> Result<(), ConvertError> {
        let bytes = bytes_of(&*scan);
        *lock(&*self.slot(index)?)? = Some(scan);
        self.weigh(index, bytes)
    }

    /// The scan of a source.
    ///
    /// # Errors
    /// The file cannot be opened again, or is another one by now.
    pub(super) fn get(&self, index: usize, source: &Source) -> Result<Arc<dyn Scan>, ConvertError> {
        let slot = self.slot(index)?;
        let mut place = lock(&slot)?;
        if let Some(scan) = &*place {
            return Ok(Arc::clone(scan));
        }
        let scan = self.open_again(source)?;
        *place = Some(Arc::clone(&scan));
        drop(place);
        self.weigh(index, bytes_of(&*scan))?;
        Ok(scan)
    }

    fn open_again(&self, source: &Source) -> Result<Arc<dyn Scan>, ConvertError> {
        let opened = match self.opener.open(&source.path) {
            Err(error) if is_too_many_files(&error) => {
                *lock(&self.kept)? = Kept::default();
                self.opener.open(&source.path)
            }
            opened => opened,
        };
        let scan: Arc<dyn Scan> = opened?.into();
        if same::mark(&*scan) == source.mark {
            return Ok(scan);
        }
        Err(InputFault::Changed { path: source.path.to_path_buf() }.into())
    }

    /// The place of a scan, the last one that will be given up.
    fn slot(&self, index: usize) -> Result<Slot, ConvertError> {
        let mut kept = lock(&self.kept)?;
        kept.now += 1;
        let used = kept.now;
        let place = kept.scans.entry(index).or_insert_with(|| Place { slot: Slot::default(), used, bytes: 0 });
        place.used = used;
        let slot = Arc::clone(&place.slot);
        kept.give_up(self.most);
        Ok(slot)
    }

    fn weigh(&self, index: usize, bytes: usize) -> Result<(), ConvertError> {
        let mut kept = lock(&self.kept)?;
        if let Some(place) = kept.scans.get_mut(&index) {
            let before = std::mem::replace(&mut place.bytes, bytes);
            kept.bytes = kept.bytes + bytes - before;
        }
        kept.give_up(self.most);
        Ok(())
    }
}

impl Kept {
    /// Closes what was not used for longest until there are `most` and they are small enough; those that are being read
    /// stay open as long as they are.
    fn give_up(&mut self, most: usize) {
        while self.scans.len() > most || (self.scans.len() > 1 && self.bytes > MOST_BYTES) {
            let oldest = self.scans.iter().min_by_key(|(_, place)| place.used).map(|(index, _)| *index);
            let Some(closed) = oldest.and_then(|index| self.scans.remove(&index)) else { break };
            self.bytes -= closed.bytes;
        }
    }
}

/// About what an open scan takes of memory.
fn bytes_of(scan: &dyn Scan) -> usize {
    let attributes = scan.info().attributes.len() * ATTRIBUTE_BYTES;
    SCAN_BYTES + attributes + (scan.pieces().len() + scan.info().parts.len()) * 2 * size_of::<Piece>()
}

fn is_too_many_files(error: &ReadError) -> bool {
    // ENFILE and EMFILE, on every Unix
    matches!(error.kind(), ErrorKind::Io(e) if cfg!(unix) && matches!(e.raw_os_error(), Some(23 | 24)))
}

fn lock<T>(mutex: &Mutex<T>) -> Result<MutexGuard<'_, T>, ConvertError> {
    mutex.lock().map_err(|_| ConvertError::Internal("a thread failed while it opened a scan".into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Plan;
    use crate::sources::Sources;

    #[test]
    fn the_scans_used_last_stay_open_and_all_can_be_opened_again() {
        let file = |name: &str| concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/las/").to_owned() + name;
        let inputs = ["format0.las", "format1.las", "format2.las", "format3.las"].map(|name| file(name).into());
        let plan = Plan::new(inputs.to_vec(), "out".into());
        let sources = Sources::open(&plan, &crate::runtime::Silent).unwrap().all;
        let open = OpenScans::with_room_for(Opener::new(&plan, 1), 2);
        let get = |i: usize| open.get(i, &sources[i]).unwrap();
        let (first, second) = (get(0), get(1));
        assert!(Arc::ptr_eq(&first, &get(0)));
        get(2);
        assert!(Arc::ptr_eq(&first, &get(0)), "used after the second one");
        assert!(!Arc::ptr_eq(&second, &get(1)), "it was closed for the third");
        for i in (0..4).rev() {
            assert_eq!(get(i).info().path, *sources[i].path);
            let kept = open.kept.lock().unwrap();
            assert!(kept.scans.len() <= 2);
            assert_eq!(kept.bytes, kept.scans.values().map(|place| place.bytes).sum::<usize>());
        }
    }
}

//! Bytes of large files on their way to the disk, past the cache of the system.
//!
//! An output is written once and not read by the run. Through the cache it takes the place of what others have there, each of its
//! pages has to be found and filled (on a virtual machine that gives free memory back to its host, that took longer than
//! the rest of a conversion), and the disk begins late. So whole blocks go to the disk from buffers of our own, by a thread of the
//! file, while the others go on. What is no whole block at the ends of a write goes through the cache, as does all of it where the
//! file system has no such way. The system keeps both views of a file the same as long as they are not of one block at one time;
//! who writes or reads bytes that are still on their way waits for them.

use std::collections::VecDeque;
use std::fs::File;
use std::io;
use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::JoinHandle;

use pointmill_format::bytes::write_all_at;

use super::os_files::is_same_file;
use super::os_hints;

/// Places, lengths and buffers are multiples of this: of the pages of all systems, and of the sectors of all disks.
const BLOCK: usize = 64 << 10;

/// Bytes that are written together.
const BUFFER_BYTES: usize = 1 << 20;

/// Buffers of a file: [`WRITER_BYTES`] in all.
const BUFFERS: usize = 4;

/// Most memory that a file takes.
pub(crate) const WRITER_BYTES: u64 = (BUFFERS * (BUFFER_BYTES + BLOCK)) as u64;

/// Shorter writes have few whole blocks.
const LEAST_BYTES: usize = 8 * BLOCK;

/// The way past the cache to a file. What was given to it is written when it is dropped; whether that went well only
/// [`Self::wait`] tells.
#[derive(Debug)]
pub(crate) struct DirectWriter {
    shared: Arc<Shared>,
    thread: OnceLock<Option<JoinHandle<()>>>,
}

#[derive(Debug)]
struct Shared {
    direct: File,
    /// The same through the cache, for file systems that have changed their mind.
    cached: File,
    state: Mutex<State>,
    /// A buffer is free, something is to be written, or was.
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    free: Vec<Buffer>,
    made: usize,
    waiting: VecDeque<Filled>,
    being_written: Option<Range<u64>>,
    fault: Option<Fault>,
    is_over: bool,
}

#[derive(Debug)]
struct Filled {
    buffer: Buffer,
    offset: u64,
    len: usize,
}

/// Bytes, of which those from `start` on lie as the system wants them.
#[derive(Debug)]
struct Buffer {
    bytes: Vec<u8>,
    start: usize,
}

/// What an error of the file system was, for all who write after it.
#[derive(Debug, Clone, Copy)]
enum Fault {
    Os(i32),
    Other(io::ErrorKind),
}

impl DirectWriter {
    /// `None`: the system or the file system has no such way. `path` leads to `file`.
    pub(crate) fn open(file: &File, path: &Path) -> Option<Self> {
        let direct = open_direct(path)?;
        is_same_file(file, path).then(|| Some(Self::of(direct, file.try_clone().ok()?)))?
    }

    fn of(direct: File, cached: File) -> Self {
        let shared = Shared { direct, cached, state: Mutex::default(), changed: Condvar::new() };
        Self { shared: Arc::new(shared), thread: OnceLock::new() }
    }

    /// The whole blocks of a write that is large enough, as a range of its bytes.
    pub(crate) fn blocks(offset: u64, len: usize) -> Option<Range<usize>> {
        if len < LEAST_BYTES {
            return None;
        }
        let start = (offset.checked_next_multiple_of(BLOCK as u64)? - offset) as usize;
        Some(start..start + (len - start) / BLOCK * BLOCK)
    }

    /// Takes whole blocks to be written at `offset`; waits only if all buffers are full. False: there is no thread for it.
    ///
    /// # Errors
    /// What earlier bytes failed with.
    pub(crate) fn write(&self, blocks: &[u8], offset: u64) -> io::Result<bool> {
        if self.thread().is_none() {
            return Ok(false);
        }
        for (i, part) in blocks.chunks(BUFFER_BYTES).enumerate() {
            let mut buffer = self.buffer()?;
            buffer.bytes[buffer.start..][..part.len()].copy_from_slice(part);
            let filled = Filled { buffer, offset: offset + (i * BUFFER_BYTES) as u64, len: part.len() };
            self.shared.lock().waiting.push_back(filled);
            self.shared.changed.notify_all();
        }
        Ok(true)
    }

    /// Waits until nothing of the file is on its way.
    ///
    /// # Errors
    /// Some bytes, of whatever place, could not be written.
    pub(crate) fn wait(&self) -> io::Result<()> {
        self.wait_for(&(0..u64::MAX))
    }

    /// Waits until nothing of `range` is on its way.
    ///
    /// # Errors
    /// As [`Self::wait`].
    pub(crate) fn wait_for(&self, range: &Range<u64>) -> io::Result<()> {
        let touches = |other: &Range<u64>| range.start < other.end && other.start < range.end;
        let state = self.shared.wait_while(|state| {
            state.being_written.as_ref().is_some_and(touches) || state.waiting.iter().any(|f| touches(&f.range()))
        });
        state.fault.map_or(Ok(()), |fault| Err(fault.error()))
    }

    fn buffer(&self) -> io::Result<Buffer> {
        let mut state =
            self.shared.wait_while(|state| state.fault.is_none() && state.free.is_empty() && state.made == BUFFERS);
        if let Some(fault) = state.fault {
            return Err(fault.error());
        }
        if let Some(buffer) = state.free.pop() {
            return Ok(buffer);
        }
        state.made += 1;
        drop(state);
        Ok(Buffer::new())
    }

    fn thread(&self) -> Option<&JoinHandle<()>> {
        let start = || {
            let shared = Arc::clone(&self.shared);
            std::thread::Builder::new().name("pointmill-disk".to_owned()).spawn(move || shared.work()).ok()
        };
        self.thread.get_or_init(start).as_ref()
    }
}

impl Drop for DirectWriter {
    fn drop(&mut self) {
        self.shared.lock().is_over = true;
        self.shared.changed.notify_all();
        if let Some(Some(thread)) = self.thread.take() {
            let _ = thread.join(); // it does not panic
        }
    }
}

impl Shared {
    /// What the thread does: it ends when all is written and the file is no longer needed.
    fn work(&self) {
        loop {
            let mut state = self.wait_while(|state| state.waiting.is_empty() && !state.is_over);
            let Some(filled) = state.waiting.pop_front() else { return };
            let is_lost = state.fault.is_some();
            state.being_written = Some(filled.range());
            drop(state);
            let Filled { buffer, offset, len } = filled;
            let bytes = &buffer.bytes[buffer.start..][..len];
            let written = if is_lost { Ok(()) } else { self.write(bytes, offset) };
            let mut state = self.lock();
            if let Err(e) = written {
                state.fault.get_or_insert(Fault::of(&e));
            }
            state.being_written = None;
            state.free.push(buffer);
            drop(state);
            self.changed.notify_all();
        }
    }

    fn write(&self, bytes: &[u8], offset: u64) -> io::Result<()> {
        match write_all_at(&self.direct, bytes, offset) {
            Ok(()) => Ok(()),
            // a file system has many words for "not this way"; what fails for another reason fails here, too
            Err(_) => write_all_at(&self.cached, bytes, offset),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait_while(&self, mut is_so: impl FnMut(&State) -> bool) -> MutexGuard<'_, State> {
        self.changed.wait_while(self.lock(), |state| is_so(state)).unwrap_or_else(PoisonError::into_inner)
    }
}

impl Filled {
    fn range(&self) -> Range<u64> {
        self.offset..self.offset + self.len as u64
    }
}

impl Buffer {
    fn new() -> Self {
        let mut bytes = os_hints::buffer(BUFFER_BYTES + BLOCK);
        bytes.resize(BUFFER_BYTES + BLOCK, 0);
        let start = bytes.as_ptr().align_offset(BLOCK).min(BLOCK);
        Self { bytes, start }
    }
}

impl Fault {
    fn of(error: &io::Error) -> Self {
        error.raw_os_error().map_or(Self::Other(error.kind()), Self::Os)
    }

    fn error(self) -> io::Error {
        match self {
            Self::Os(code) => io::Error::from_raw_os_error(code),
            Self::Other(kind) => kind.into(),
        }
    }
}

#[cfg(target_os = "linux")]
fn open_direct(path: &Path) -> Option<File> {
    use std::os::unix::fs::OpenOptionsExt as _;
    File::options().write(true).custom_flags(libc::O_DIRECT).open(path).ok()
}

#[cfg(not(target_os = "linux"))]
fn open_direct(_: &Path) -> Option<File> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(dir: &tempfile::TempDir) -> (File, std::path::PathBuf) {
        let path = dir.path().join("file");
        (File::options().read(true).write(true).create(true).truncate(true).open(&path).unwrap(), path)
    }

    #[test]
    fn whole_blocks_lie_within_a_write_and_short_ones_have_none() {
        const B: u64 = BLOCK as u64;
        assert_eq!(DirectWriter::blocks(0, LEAST_BYTES - 1), None);
        assert_eq!(DirectWriter::blocks(0, LEAST_BYTES), Some(0..LEAST_BYTES));
        assert_eq!(DirectWriter::blocks(3 * B + 1, LEAST_BYTES), Some(BLOCK - 1..LEAST_BYTES - 1));
        assert_eq!(DirectWriter::blocks(B - 1, LEAST_BYTES + 2), Some(1..LEAST_BYTES + 1));
        assert_eq!(DirectWriter::blocks(u64::MAX - 9, LEAST_BYTES), None);
    }

    #[test]
    fn buffers_lie_as_the_system_wants_them() {
        let buffer = Buffer::new();
        assert_eq!(buffer.bytes[buffer.start..].as_ptr() as usize % BLOCK, 0);
        assert!(buffer.bytes.len() - buffer.start >= BUFFER_BYTES);
    }

    #[test]
    fn more_than_the_buffers_hold_is_written_and_waited_for() {
        let dir = tempfile::tempdir().unwrap();
        let (file, path) = file(&dir);
        let Some(direct) = DirectWriter::open(&file, &path) else {
            eprintln!("skipped: this file system has no way past the cache");
            return;
        };
        let bytes: Vec<u8> = (0..BUFFERS * BUFFER_BYTES * 2 + BLOCK).map(|i| (i / 7 % 251) as u8).collect();
        assert!(direct.write(&bytes, 5 * BLOCK as u64).unwrap());
        direct.wait_for(&(0..5 * BLOCK as u64)).unwrap();
        direct.wait().unwrap();
        let written = std::fs::read(&path).unwrap();
        assert!(written[..5 * BLOCK].iter().all(|b| *b == 0) && written[5 * BLOCK..] == bytes);
        assert!(direct.write(&bytes, 0).unwrap());
        drop(direct);
        assert!(std::fs::read(&path).unwrap()[..bytes.len()] == bytes, "dropped, and yet written");
    }

    /// What cannot be written is told to who writes next, and to who waits, again and again.
    #[test]
    fn a_fault_is_told_to_all_who_come_after_it() {
        let dir = tempfile::tempdir().unwrap();
        let (_, path) = file(&dir);
        let read_only = || File::open(&path).unwrap();
        let direct = DirectWriter::of(read_only(), read_only());
        let bytes = vec![1; 2 * BUFFERS * BUFFER_BYTES];
        let code = |result: io::Result<()>| result.unwrap_err().raw_os_error();
        let written = direct.write(&bytes, 0).map(|_| ());
        let waited = code(direct.wait());
        assert!(waited.is_some() && waited == code(direct.wait()));
        assert_eq!(waited, code(direct.write(&bytes, 0).map(|_| ())));
        assert!(written.is_ok() || code(written) == waited);
    }

    /// Stands for a file system that takes the file and then refuses the bytes.
    #[test]
    fn bytes_that_are_refused_go_through_the_cache() {
        let dir = tempfile::tempdir().unwrap();
        let (file, path) = file(&dir);
        let Some(refusing) = open_direct(&path) else { return };
        let direct = DirectWriter::of(refusing, file);
        // a place that is no multiple of what any disk has
        assert!(direct.write(&[7; BLOCK], 1).unwrap());
        direct.wait().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), [&[0][..], &[7; BLOCK]].concat());
    }
}

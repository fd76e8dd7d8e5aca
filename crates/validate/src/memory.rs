//! The ceiling of the resident set, and what is taken of it.
//!
//! Everything that grows with a dataset or its sources is counted before it is taken. What can be smaller (caches, threads,
//! parts that are looked at one after the other) shares what is left; what cannot ends in an error that says how much it
//! takes.

use std::path::{Path, PathBuf};

use pointmill_format::{Advice, ReadError};

/// What the program itself takes, with its libraries and the stacks of its threads.
const PROGRAM: u64 = 24 << 20;

/// What a byte of JSON becomes in memory, at most: brackets are the shortest values.
pub(crate) const JSON: u64 = 24;

/// A mebibyte.
const MIB: u64 = 1 << 20;

/// What is left of the ceiling.
#[derive(Debug, Clone)]
pub(crate) struct Budget {
    path: PathBuf,
    ceiling: u64,
    taken: u64,
}

impl Budget {
    /// All but what the program takes, for the dataset at `path`.
    ///
    /// # Errors
    /// The ceiling is below that.
    pub(crate) fn new(path: &Path, ceiling: u64) -> Result<Self, ReadError> {
        let mut budget = Self { path: path.to_path_buf(), ceiling, taken: 0 };
        budget.take(PROGRAM)?;
        Ok(budget)
    }

    /// The dataset that is looked at.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes that are left.
    pub(crate) fn left(&self) -> u64 {
        self.ceiling.saturating_sub(self.taken)
    }

    /// Takes `bytes`, for good.
    ///
    /// # Errors
    /// They are not left: says what would be enough, so far.
    pub(crate) fn take(&mut self, bytes: u64) -> Result<(), ReadError> {
        self.require(bytes)?;
        self.taken += bytes;
        Ok(())
    }

    /// Makes sure that `bytes` are left, and leaves them.
    ///
    /// # Errors
    /// As [`Self::take`].
    pub(crate) fn require(&self, bytes: u64) -> Result<(), ReadError> {
        let needed = self.taken.saturating_add(bytes);
        if needed <= self.ceiling {
            return Ok(());
        }
        let (needed, ceiling) = (needed.div_ceil(MIB), self.ceiling / MIB);
        let what = format!("to be validated it takes {needed} MiB of memory at least, the ceiling is {ceiling} MiB");
        Err(ReadError::unsupported(&self.path, what).advise(Advice::MoreMemory))
    }

    /// How many of the current threads may work at once, if each takes so much, and takes it for them.
    ///
    /// # Errors
    /// Not even one.
    pub(crate) fn threads(&mut self, bytes_each: u64) -> Result<usize, ReadError> {
        self.require(bytes_each)?;
        // what threads hand to each other is kept within half of what is left
        let share = (self.left() / 2).max(bytes_each) / bytes_each.max(1);
        let threads = (rayon::current_num_threads() as u64).min(share).max(1);
        self.take(threads * bytes_each)?;
        Ok(threads as usize)
    }

    /// Gives back what [`Self::threads`] has taken.
    pub(crate) fn give_back(&mut self, bytes: u64) {
        self.taken = self.taken.saturating_sub(bytes);
    }
}

/// Runs `work` on `threads` of the current threads.
pub(crate) fn on_threads<T: Send>(
    threads: usize,
    path: &Path,
    work: impl FnOnce() -> Result<T, ReadError> + Send,
) -> Result<T, ReadError> {
    if threads >= rayon::current_num_threads() {
        return work();
    }
    pool(threads, path)?.install(work)
}

/// Threads; 0: one per core.
///
/// # Errors
/// The operating system has none.
pub(crate) fn pool(threads: usize, path: &Path) -> Result<rayon::ThreadPool, ReadError> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|i| format!("validate-{i}"))
        .build()
        .map_err(|e| ReadError::io(path, "starting threads", std::io::Error::other(e)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_left_is_refused_with_what_would_be_enough() {
        let mut budget = Budget::new("a".as_ref(), 100 << 20).unwrap();
        budget.take(50 << 20).unwrap();
        assert_eq!(budget.left(), 26 << 20);
        let error = budget.take(27 << 20).unwrap_err();
        assert_eq!(error.advice(), Some(&Advice::MoreMemory));
        assert!(error.to_string().contains("takes 101 MiB of memory at least, the ceiling is 100 MiB"), "{error}");
        assert!(Budget::new("a".as_ref(), 10 << 20).is_err());
        assert!(budget.take(u64::MAX).is_err() && budget.left() == 26 << 20);
    }

    #[test]
    fn fewer_threads_work_where_all_do_not_fit() {
        let threads = |bytes| {
            let pool = pool(8, "a".as_ref()).unwrap();
            pool.install(|| Budget::new("a".as_ref(), 100 << 20).unwrap().threads(bytes).ok())
        };
        assert_eq!([1 << 20, 10 << 20, 40 << 20, 77 << 20].map(threads), [Some(8), Some(3), Some(1), None]);
    }
}

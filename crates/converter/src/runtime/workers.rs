//! Numbered units of work for all threads: the one loop that hands them out.

use std::any::Any;
use std::panic::AssertUnwindSafe;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::events::Events;
use crate::error::ConvertError;
use crate::warning::Warning;

/// The threads of a run, what they report, and the request that they stop.
pub(crate) struct Workers<'a> {
    /// Worker threads, ≥ 1.
    pub(crate) threads: usize,
    events: &'a dyn Events,
    pool: rayon::ThreadPool,
}

impl<'a> Workers<'a> {
    /// Starts the threads, at least one.
    pub(crate) fn start(threads: usize, events: &'a dyn Events) -> Result<Self, ConvertError> {
        let threads = threads.max(1);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("pointmill-{i}"))
            .build()
            .map_err(|e| ConvertError::Internal(format!("starting threads: {e}")))?;
        Ok(Self { threads, events, pool })
    }

    /// Fails if the run was asked to stop.
    pub(crate) fn check_stop(&self) -> Result<(), ConvertError> {
        if self.events.stop_requested() { Err(ConvertError::Interrupted) } else { Ok(()) }
    }

    /// Where the request to stop comes from, for what outlives a borrow of this.
    pub(crate) fn events(&self) -> &'a dyn Events {
        self.events
    }

    /// Reports that `steps` more are done in the current phase.
    pub(crate) fn advance(&self, steps: u64) {
        self.events.advance(steps);
    }

    /// Reports something that the user should know at once.
    pub(crate) fn warn(&self, warning: &Warning) {
        self.events.warning(warning);
    }

    /// Does units `0..count` in ascending order on all threads, each thread with a state; returns what became of the
    /// states.
    ///
    /// # Errors
    /// That of the lowest unit that failed, whatever the timing; a panic in `work` is an error and frees the other
    /// threads.
    pub(crate) fn in_parallel<S, T: Send>(
        &self,
        count: usize,
        state: impl Fn() -> S + Sync,
        work: impl Fn(&mut S, usize) -> Result<(), ConvertError> + Sync,
        finish: impl Fn(S) -> T + Sync,
    ) -> Result<Vec<T>, ConvertError> {
        self.in_parallel_or(count, state, work, finish, |_| ())
    }

    /// [`Self::in_parallel`] for units that wait for one another: `failed` is called with the number of each unit that
    /// failed, and must free those above it that wait. Units below it are still done, so that the lowest error wins.
    pub(crate) fn in_parallel_or<S, T: Send>(
        &self,
        count: usize,
        state: impl Fn() -> S + Sync,
        work: impl Fn(&mut S, usize) -> Result<(), ConvertError> + Sync,
        finish: impl Fn(S) -> T + Sync,
        failed: impl Fn(usize) + Sync,
    ) -> Result<Vec<T>, ConvertError> {
        let next = AtomicUsize::new(0);
        let first: Mutex<Option<(usize, ConvertError)>> = Mutex::new(None);
        let done = self.pool.broadcast(|_| {
            let mut state = state();
            loop {
                let unit = next.fetch_add(1, Ordering::Relaxed);
                if unit >= count || first.lock().is_ok_and(|f| f.as_ref().is_some_and(|(u, _)| *u < unit)) {
                    break;
                }
                let result = self.check_stop().and_then(|()| {
                    std::panic::catch_unwind(AssertUnwindSafe(|| work(&mut state, unit)))
                        .unwrap_or_else(|panic| Err(panicked(unit, count, &*panic)))
                });
                if let Err(error) = result {
                    failed(unit);
                    if let Ok(mut first) = first.lock()
                        && first.as_ref().is_none_or(|(u, _)| unit < *u)
                    {
                        *first = Some((unit, error));
                    }
                    break;
                }
            }
            finish(state)
        });
        match first.into_inner() {
            Ok(Some((_, error))) => Err(error),
            _ => Ok(done),
        }
    }
}

/// The error for a panic, with its message.
fn panicked(unit: usize, count: usize, panic: &(dyn Any + Send)) -> ConvertError {
    let message = panic.downcast_ref::<&str>().copied();
    let message = message.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message");
    ConvertError::Internal(format!("unit {unit} of {count} panicked: {message}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::Silent;

    fn workers(threads: usize) -> Workers<'static> {
        Workers::start(threads, &Silent).unwrap()
    }

    #[test]
    fn every_unit_is_done_once() {
        let sums = workers(3)
            .in_parallel(
                1000,
                || 0,
                |sum, unit| {
                    *sum += unit;
                    Ok(())
                },
                |sum| sum,
            )
            .unwrap();
        assert_eq!(sums.iter().sum::<usize>(), 499_500);
    }

    #[test]
    fn the_lowest_error_wins_whatever_the_timing_and_a_panic_is_one() {
        for _ in 0..50 {
            let work = |_: &mut (), unit: usize| match unit {
                3 => {
                    std::thread::sleep(std::time::Duration::from_millis(2));
                    Err(ConvertError::Internal("three".into()))
                }
                4..8 => panic!("four"),
                _ => Ok(()),
            };
            let error = workers(4).in_parallel(100, || (), work, |()| ()).unwrap_err();
            assert!(error.to_string().contains("three"), "{error}");
        }
        let error =
            workers(2).in_parallel(9, || (), |(), unit| if unit == 5 { panic!("five") } else { Ok(()) }, |()| ());
        assert!(error.unwrap_err().to_string().contains("unit 5 of 9 panicked: five"));
    }
}

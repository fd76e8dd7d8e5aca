//! Numbered units of work for all threads: the one loop that hands them out.

use std::any::Any;
use std::panic::AssertUnwindSafe;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::Runtime;
use crate::error::ConvertError;

impl Runtime<'_> {
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
    use crate::plan::Plan;
    use crate::runtime::{Budget, Least, Silent, SystemDisk, TempFiles};
    use std::sync::Arc;

    fn runtime(threads: usize) -> Runtime<'static> {
        let mut plan = Plan::new(vec![], "out".into());
        plan.threads = threads;
        plan.memory_bytes = 1 << 30;
        let budget = Budget::new(&plan, 38, Least::of([], 0, 0)).unwrap();
        Runtime::start(&plan, budget, TempFiles::new(".".into(), Arc::new(SystemDisk)), &Silent).unwrap()
    }

    #[test]
    fn every_unit_is_done_once() {
        let sums = runtime(3)
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
            let error = runtime(4).in_parallel(100, || (), work, |()| ()).unwrap_err();
            assert!(error.to_string().contains("three"), "{error}");
        }
        let error =
            runtime(2).in_parallel(9, || (), |(), unit| if unit == 5 { panic!("five") } else { Ok(()) }, |()| ());
        assert!(error.unwrap_err().to_string().contains("unit 5 of 9 panicked: five"));
    }
}

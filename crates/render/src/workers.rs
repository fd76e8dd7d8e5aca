//! Numbered units of work on several threads.

use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// How many threads `requested` means: 0 is one per core.
pub(crate) fn thread_count(requested: usize) -> usize {
    match requested {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        n => n,
    }
}

/// Does the work of every unit, on that many threads (0: all cores), each with a state of its own. Of several errors that of
/// the lowest unit is given; units above it may not have been done.
///
/// # Errors
/// Those of the work.
pub(crate) fn for_each<S: Default, E: Send>(
    units: usize,
    threads: usize,
    work: impl Fn(usize, &mut S) -> Result<(), E> + Sync,
) -> Result<(), E> {
    let next = AtomicUsize::new(0);
    let failed: Mutex<Option<(usize, E)>> = Mutex::new(None);
    let lock = || failed.lock().unwrap_or_else(PoisonError::into_inner);
    let run = || {
        let mut state = S::default();
        loop {
            let unit = next.fetch_add(1, Relaxed);
            if unit >= units {
                return;
            }
            if let Err(error) = work(unit, &mut state) {
                next.store(units, Relaxed); // units below this one are being done already
                let mut first = lock();
                if first.as_ref().is_none_or(|(lowest, _)| unit < *lowest) {
                    *first = Some((unit, error));
                }
            }
        }
    };
    let threads = thread_count(threads).min(units);
    if threads <= 1 {
        run();
    } else {
        std::thread::scope(|scope| (0..threads).for_each(|_| drop(scope.spawn(run))));
    }
    match lock().take() {
        Some((_, error)) => Err(error),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_is_done_once() {
        for threads in [0, 1, 3, 100] {
            let sum = AtomicUsize::new(0);
            let result: Result<(), ()> = for_each(100, threads, |unit, done: &mut usize| {
                *done += 1;
                sum.fetch_add(unit, Relaxed);
                Ok(())
            });
            assert_eq!((result, sum.into_inner()), (Ok(()), 4950));
        }
    }

    #[test]
    fn of_errors_at_the_same_time_the_lowest_is_given() {
        let all_are_there = std::sync::Barrier::new(4);
        let result = for_each(4, 4, |unit, (): &mut ()| {
            all_are_there.wait();
            Err::<(), _>(unit)
        });
        assert_eq!(result, Err(0));
    }

    #[test]
    fn the_lowest_error_is_given_whatever_the_threads_do() {
        for _ in 0..20 {
            let result = for_each(50, 4, |unit, (): &mut ()| if unit % 10 == 7 { Err(unit) } else { Ok(()) });
            assert_eq!(result, Err(7));
        }
    }
}

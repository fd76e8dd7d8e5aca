//! Numbered pieces of work for all threads.

use std::panic::AssertUnwindSafe;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::convert::Run;
use crate::error::ConvertError;

/// Does pieces `0..count` in ascending order on all threads of the run, each with a state of its own; returns what
/// became of the states. Of errors that of the lowest piece wins; a panic is an error and frees the other threads.
pub(super) fn in_parallel<S, T: Send>(
    run: &Run<'_>,
    count: usize,
    state: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, usize) -> Result<(), ConvertError> + Sync,
    finish: impl Fn(S) -> T + Sync,
) -> Result<Vec<T>, ConvertError> {
    let next = AtomicUsize::new(0);
    let failed: Mutex<Option<(usize, ConvertError)>> = Mutex::new(None);
    let done = run.pool.broadcast(|_| {
        let mut state = state();
        loop {
            let piece = next.fetch_add(1, Ordering::Relaxed);
            if piece >= count || failed.lock().is_ok_and(|f| f.as_ref().is_some_and(|(p, _)| *p < piece)) {
                break;
            }
            let result = if run.events.stop_requested() {
                Err(ConvertError::Interrupted)
            } else {
                std::panic::catch_unwind(AssertUnwindSafe(|| work(&mut state, piece)))
                    .unwrap_or_else(|_| Err(ConvertError::Internal(format!("piece {piece} of the batches failed"))))
            };
            if let Err(error) = result {
                if let Ok(mut failed) = failed.lock()
                    && failed.as_ref().is_none_or(|(p, _)| piece < *p)
                {
                    *failed = Some((piece, error));
                }
                break;
            }
        }
        finish(state)
    });
    match failed.into_inner() {
        Ok(Some((_, error))) => Err(error),
        _ => Ok(done),
    }
}

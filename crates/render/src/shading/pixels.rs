//! The pixels of a picture, and work on all of them.

use std::convert::Infallible;
use std::sync::{Mutex, PoisonError};

use crate::workers;

/// Colours and depths of a picture; infinite depths where there is no point.
pub(super) struct Pixels<'a> {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) rgb: &'a mut [[u8; 3]],
    pub(super) depth: &'a mut [f32],
}

/// Makes a value for each pixel, row by row on all threads.
pub(super) fn for_rows<T: Send + Default + Clone>(
    width: usize,
    height: usize,
    threads: usize,
    row: impl Fn(usize, &mut [T]) + Sync,
) -> Vec<T> {
    let mut all = vec![T::default(); width * height];
    // bands of rows, as many for each thread that none waits long for another
    let threads = workers::thread_count(threads);
    let band = height.div_ceil(threads * 4).max(1);
    let bands: Vec<_> = all.chunks_mut(width * band).map(Mutex::new).collect();
    let done = workers::for_each(bands.len(), threads, |number, (): &mut ()| {
        let mut pixels = bands[number].lock().unwrap_or_else(PoisonError::into_inner);
        for (offset, pixels) in pixels.chunks_mut(width).enumerate() {
            row(number * band + offset, pixels);
        }
        Ok::<(), Infallible>(())
    });
    match done {
        Ok(()) => drop(bands),
        Err(never) => match never {},
    }
    all
}

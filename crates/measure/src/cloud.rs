//! A cloud in memory: of the scans in whole, or what a dataset decodes to.

use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use pointmill_format::batches::eight_bit;
use pointmill_format::{Aabb, Lattice, OpenOptions, PointBatch, Positions, ReadError, Scan, Scratch, Wanted};
use rayon::prelude::*;

use crate::MeasureError;

/// Positions and colours of points, and the level of each.
#[derive(Debug, Default)]
pub(crate) struct Cloud {
    /// World coordinates, by axis.
    pub(crate) xyz: [Vec<f64>; 3],
    /// Red, green, blue of 8 bits; empty if the scene has no colours.
    pub(crate) rgb: Vec<[u8; 3]>,
    /// Level of detail, 0 the coarsest; empty if there are none.
    pub(crate) level: Vec<u8>,
}

impl Cloud {
    pub(crate) fn len(&self) -> usize {
        self.xyz[0].len()
    }

    pub(crate) fn bounds(&self) -> Aabb {
        let range = |axis: &Vec<f64>| {
            let of =
                |part: &[f64]| part.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
            let parts = axis.par_chunks(1 << 20).map(of);
            parts.reduce(|| (f64::INFINITY, f64::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)))
        };
        let ranges = self.xyz.each_ref().map(range);
        Aabb { min: ranges.map(|r| r.0), max: ranges.map(|r| r.1) }
    }

    /// Puts the points of `other` behind these.
    pub(crate) fn append(&mut self, mut other: Self) {
        for (all, more) in self.xyz.iter_mut().zip(&mut other.xyz) {
            all.append(more);
        }
        self.rgb.append(&mut other.rgb);
        self.level.append(&mut other.level);
    }
}

/// Runs `work` for the numbers below `count` on all threads of the pool, each with its own state, and gives the states.
pub(crate) fn in_parallel<S: Send, E: Send>(
    count: usize,
    new: impl Fn() -> S + Sync,
    work: impl Fn(usize, &mut S) -> Result<(), E> + Sync,
) -> Result<Vec<S>, E> {
    let next = AtomicUsize::new(0);
    let states = Mutex::new(Vec::new());
    let first_error = Mutex::new(None);
    rayon::broadcast(|_| {
        let mut state = new();
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            if i >= count {
                break;
            }
            if let Err(error) = work(i, &mut state) {
                next.store(count, Ordering::Relaxed);
                locked(&first_error).get_or_insert(error);
            }
        }
        locked(&states).push(state);
    });
    match first_error.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
        Some(error) => Err(error),
        None => Ok(states.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)),
    }
}

pub(crate) fn locked<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Reads all points of the scans with positions that are numbers, in no particular order.
///
/// Colours are there if a scan has some; points of scans without are black then. Whether a scan's 16-bit channels hold
/// 8 bits is seen from all of them together, as conversions do.
pub(crate) fn read(scans: &[Box<dyn Scan>], should_stop: &(dyn Fn() -> bool + Sync)) -> Result<Cloud, MeasureError> {
    let has_colours = scans.iter().any(|scan| scan.info().attribute("rgb").is_some());
    let mut all = Cloud::default();
    for scan in scans {
        let info = scan.info();
        let column = info.attribute("rgb").map(|(i, _)| i);
        let mut wanted = Wanted::positions(info);
        if let Some(column) = column {
            wanted.set(column, true);
        }
        let parts = in_parallel(
            scan.pieces().len(),
            || (Part::default(), Scratch::default()),
            |piece, (part, scratch)| {
                if should_stop() {
                    return Err(MeasureError::Interrupted);
                }
                scan.decode(piece, &wanted, scratch, &mut |batch| {
                    part.take(batch, info.lattice.as_ref(), has_colours);
                    ControlFlow::Continue(())
                })?;
                Ok(())
            },
        )?;
        let is_deep = parts.iter().any(|(part, _)| part.greatest > 255);
        for (part, _) in parts {
            all.append(part.finish(is_deep));
        }
    }
    Ok(all)
}

/// What one thread has read of a scan.
#[derive(Default)]
struct Part {
    cloud: Cloud,
    channels: Vec<[u16; 3]>,
    greatest: u16,
}

impl Part {
    fn take(&mut self, batch: &PointBatch, lattice: Option<&Lattice>, has_colours: bool) {
        let is_number = |i: usize| match &batch.positions {
            Positions::Quantized(_) => true,
            Positions::World(axes) => axes.iter().all(|axis| axis[i].is_finite()),
        };
        let colours = has_colours.then(|| channels(batch)).flatten();
        // what has integers has a lattice
        let lattice = lattice.copied().unwrap_or(Lattice { scale: [1.0; 3], offset: [0.0; 3] });
        for i in (0..batch.len()).filter(|i| is_number(*i)) {
            let world = match &batch.positions {
                Positions::Quantized(axes) => lattice.world(axes.each_ref().map(|axis| i64::from(axis[i]))),
                Positions::World(axes) => axes.each_ref().map(|axis| axis[i]),
            };
            for (all, value) in self.cloud.xyz.iter_mut().zip(world) {
                all.push(value);
            }
            if has_colours {
                let rgb = colours.as_ref().map_or([0; 3], |c| [c[3 * i], c[3 * i + 1], c[3 * i + 2]]);
                self.greatest = rgb.into_iter().fold(self.greatest, u16::max);
                self.channels.push(rgb);
            }
        }
    }

    fn finish(mut self, is_deep: bool) -> Cloud {
        self.cloud.rgb = narrowed(&self.channels, is_deep);
        self.cloud
    }
}

/// Channels as 8 bits; of 16 bits, rounded.
pub(crate) fn narrowed(channels: &[[u16; 3]], is_deep: bool) -> Vec<[u8; 3]> {
    let narrow = |channel: u16| if is_deep { eight_bit(channel) } else { channel as u8 };
    channels.iter().map(|rgb| rgb.map(narrow)).collect()
}

/// The colours of a batch, widened.
fn channels(batch: &PointBatch) -> Option<std::borrow::Cow<'_, [u16]>> {
    if let Some(deep) = batch.column::<u16>("rgb") {
        return Some(deep.into());
    }
    batch.column::<u8>("rgb").map(|c| c.iter().map(|v| u16::from(*v)).collect::<Vec<_>>().into())
}

/// Opens what can be read; the error is that of the first that cannot.
pub(crate) fn open(inputs: &[std::path::PathBuf]) -> Result<Vec<Box<dyn Scan>>, ReadError> {
    inputs.iter().map(|path| pointmill_format::open_scan(path, &OpenOptions::default())).collect()
}

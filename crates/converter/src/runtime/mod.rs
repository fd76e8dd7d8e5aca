//! What a run works with, beside the data: threads, memory budget, files, events and the request to stop.

mod budget;
mod clock;
mod direct;
pub(crate) mod disk;
mod events;
mod lanes;
mod open_files;
pub(crate) mod os_files;
pub(crate) mod os_hints;
mod pool;
mod vectors;
mod workers;

pub(crate) use budget::{Budget, Least, TILE_POINTS};
pub(crate) use clock::{Clock, PhaseTime};
pub(crate) use direct::WRITER_BYTES;
pub use disk::{Disk, DiskOperation, Replacing, SystemDisk};
pub(crate) use disk::{DiskFile, Sequential, TempFiles};
pub use events::{Events, Phase, Silent};
#[cfg(target_arch = "x86_64")]
pub(crate) use lanes::Avx2;
pub(crate) use lanes::{Compare, LANES, Portable};
pub(crate) use open_files::most_open_files;
pub(crate) use pool::{Consumer, Evict, Pool, Reservation};
pub(crate) use vectors::{Vectors, vectorized};
pub(crate) use workers::Workers;

use std::ops::Deref;
use std::sync::Arc;

use crate::error::ConvertError;
use crate::plan::Plan;

/// Threads, memory, files and events of one run.
pub(crate) struct Runtime<'a> {
    pub(crate) budget: Budget,
    /// Memory that is shared out as it is needed.
    pub(crate) memory: Arc<Pool>,
    pub(crate) temp: TempFiles,
    workers: Workers<'a>,
}

impl<'a> Runtime<'a> {
    /// Starts the threads.
    pub(crate) fn start(
        plan: &Plan,
        budget: Budget,
        temp: TempFiles,
        events: &'a dyn Events,
    ) -> Result<Self, ConvertError> {
        let memory = Pool::new(budget.pool_bytes, plan.memory_bytes).with_records(plan.waiting_bytes);
        Ok(Self { budget, memory: Arc::new(memory), temp, workers: Workers::start(plan.threads, events)? })
    }
}

impl<'a> Deref for Runtime<'a> {
    type Target = Workers<'a>;

    fn deref(&self) -> &Workers<'a> {
        &self.workers
    }
}

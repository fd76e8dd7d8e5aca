//! What a run works with, beside the data: threads, memory budget, files, events and the request to stop.

mod budget;
mod clock;
pub(crate) mod disk;
mod events;
pub(crate) mod os_hints;
mod pool;
mod workers;

pub(crate) use budget::{Budget, Least};
pub(crate) use clock::{Clock, PhaseTime};
pub use disk::{Disk, DiskOperation, SystemDisk};
pub(crate) use disk::{DiskFile, Sequential, TempFiles};
pub use events::{Events, Phase, Silent};
pub(crate) use pool::{Consumer, Evict, Pool, Reservation};

use std::sync::Arc;

use crate::error::ConvertError;
use crate::plan::Plan;
use crate::warning::Warning;

/// Threads, memory, files and events of one run.
pub(crate) struct Runtime<'a> {
    pub(crate) budget: Budget,
    /// Memory that is shared out as it is needed.
    pub(crate) memory: Arc<Pool>,
    pub(crate) temp: TempFiles,
    /// Worker threads, ≥ 1.
    pub(crate) threads: usize,
    events: &'a dyn Events,
    pool: rayon::ThreadPool,
}

impl<'a> Runtime<'a> {
    /// Starts the threads.
    pub(crate) fn start(
        plan: &Plan,
        budget: Budget,
        temp: TempFiles,
        events: &'a dyn Events,
    ) -> Result<Self, ConvertError> {
        let threads = plan.threads.max(1);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("pointmill-{i}"))
            .build()
            .map_err(|e| ConvertError::Internal(format!("starting threads: {e}")))?;
        let memory = Pool::new(budget.pool_bytes, plan.memory_bytes).with_records(plan.waiting_bytes);
        Ok(Self { budget, memory: Arc::new(memory), temp, threads, events, pool })
    }

    /// Fails if the run was asked to stop.
    pub(crate) fn check_stop(&self) -> Result<(), ConvertError> {
        if self.events.stop_requested() { Err(ConvertError::Interrupted) } else { Ok(()) }
    }

    /// Reports that `points` more are done in the current phase.
    pub(crate) fn advance(&self, points: u64) {
        self.events.advance(points);
    }

    /// Reports something that the user should know at once.
    pub(crate) fn warn(&self, warning: &Warning) {
        self.events.warning(warning);
    }
}

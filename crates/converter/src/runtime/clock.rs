//! Wall time by phase.

use std::time::Instant;

use super::events::{Events, Phase};

/// Reports phases as they begin and measures them.
pub(crate) struct Clock<'a> {
    events: &'a dyn Events,
    start: Instant,
    phase_start: Instant,
    phase: Option<Phase>,
    done: Vec<PhaseTime>,
}

/// A phase that has ended.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PhaseTime {
    pub(crate) phase: Phase,
    /// Wall seconds.
    pub(crate) seconds: f64,
}

impl<'a> Clock<'a> {
    pub(crate) fn start(events: &'a dyn Events) -> Self {
        let now = Instant::now();
        Self { events, start: now, phase_start: now, phase: None, done: Vec::new() }
    }

    /// Ends the current phase and begins another; `total` is its size in its unit (0: unknown).
    pub(crate) fn begin(&mut self, phase: Phase, total: u64) {
        self.close();
        self.phase = Some(phase);
        self.events.phase(phase, total);
    }

    fn close(&mut self) {
        if let Some(phase) = self.phase.take() {
            self.done.push(PhaseTime { phase, seconds: self.phase_start.elapsed().as_secs_f64() });
        }
        self.phase_start = Instant::now();
    }

    /// Ends the current phase; returns all phases in order.
    pub(crate) fn finish(&mut self) -> Vec<PhaseTime> {
        self.close();
        std::mem::take(&mut self.done)
    }

    /// Wall seconds since the start.
    pub(crate) fn seconds(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }
}

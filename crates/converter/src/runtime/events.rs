//! How a run reports what it is doing, and how it is asked to stop.

use std::path::Path;

use crate::warning::Warning;

/// The phases of a run, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Headers of all inputs; the unit is inputs.
    Probe,
    /// Decoding every point once; the unit is points.
    Read,
    /// Computing attributes from the points around each; the unit is points.
    Derive,
    /// Building and writing nodes; the unit is points.
    Build,
    /// Hierarchy, metadata, syncing and renaming; no unit.
    Finish,
    /// Removing what a run that failed or was stopped has made so far; no unit.
    CleanUp,
}

impl Phase {
    /// The word shown to people and written to reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Probe => "probe",
            Self::Read => "read",
            Self::Derive => "derive",
            Self::Build => "build",
            Self::Finish => "finish",
            Self::CleanUp => "clean up",
        }
    }
}

/// Receives what happens; called from worker threads, so implementations are quick and thread-safe.
pub trait Events: Sync {
    /// A phase begins; `total` is its size in its unit (0: unknown).
    fn phase(&self, _phase: Phase, _total: u64) {}
    /// `steps` more, in the unit of the current phase, are done.
    fn advance(&self, _steps: u64) {}
    /// Something the user should know.
    fn warning(&self, _warning: &Warning) {}
    /// All that the run has made so far is in this folder, but for temporary files without a name. It is removed if the
    /// run fails.
    fn works_in(&self, _folder: &Path) {}
    /// What was read so far is safe in this folder, and another run can go on from there; `None`: nothing is any more.
    fn checkpoint(&self, _folder: Option<&Path>) {}
    /// From now on a request to stop changes nothing: the output gets its name, or what was made is removed.
    fn settling(&self) {}
    /// True if the run must end; asked often.
    fn stop_requested(&self) -> bool {
        false
    }
}

/// Says nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Events for Silent {}

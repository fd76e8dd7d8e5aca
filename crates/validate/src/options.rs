//! What to check and how, and how far a validation is.

use std::path::PathBuf;

use pointmill_format::OpenOptions;

/// What to check, and with what means.
#[derive(Debug, Clone)]
pub struct Options {
    /// The scans that the dataset was made from, files only; empty: no comparison.
    pub against: Vec<PathBuf>,
    /// Facts that text and E57 files do not state; as given to the conversion.
    pub open: OpenOptions,
    /// Worker threads; 0: one per core.
    pub threads: usize,
    /// Ceiling of the resident set of the process, bytes. What does not fit is shared out, looked at in parts, or refused
    /// with [`pointmill_format::Advice::MoreMemory`].
    pub memory_bytes: u64,
    /// Maximum problems listed per check; all are counted.
    pub max_problems: usize,
    /// Check spacing and coverage and measure quality: the slowest part of a validation.
    pub neighbourhoods: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            against: Vec::new(),
            open: OpenOptions::default(),
            threads: 0,
            memory_bytes: 512 << 20,
            max_problems: 20,
            neighbourhoods: true,
        }
    }
}

/// How far a validation is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// `points` (of the dataset), `sources` (decoding the scans), `differences` (looking for what differs),
    /// `surfels` (of the dataset, to compute normals and radii again).
    pub phase: &'static str,
    /// Points done in this phase. Calls from several threads may overtake each other.
    pub done: u64,
    /// Points of the phase, as far as is known.
    pub total: u64,
}

/// Receives progress, from worker threads.
pub type ProgressFn<'a> = dyn Fn(Progress) + Sync + 'a;

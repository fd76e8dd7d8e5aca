//! Why a measurement did not begin, or ended early.

use std::io;
use std::path::PathBuf;

use pointmill_format::ReadError;

/// Why a scene cannot be measured. A setting that fails is no error: it is a row of the result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeasureError {
    /// The request to stop; what was measured until then is written.
    #[error("interrupted")]
    Interrupted,
    /// An input cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A picture of the scene cannot be drawn.
    #[error(transparent)]
    Render(#[from] pointmill_render::RenderError),
    /// There is nothing to measure.
    #[error("no point in the inputs ({0} of them): there is nothing to measure")]
    Empty(usize),
    /// More points than memory; a sample of the scene has fewer.
    #[error("{points} points with a sample of {sample} need {needed} of memory, of {available} that there are")]
    TooMany {
        /// Points of the scene.
        points: u64,
        /// Points that were to be measured.
        sample: u64,
        /// Bytes, for people.
        needed: String,
        /// Bytes, for people.
        available: String,
    },
    /// The program that is measured cannot be started.
    #[error("{}: cannot be run: {error}", path.display())]
    Program {
        /// The program.
        path: PathBuf,
        /// What the system says.
        error: io::Error,
    },
    /// The sample of the scene cannot be written.
    #[error("the sample of the scene: {0}")]
    Sample(String),
    /// The results cannot be written.
    #[error("{}: {error}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        error: io::Error,
    },
}

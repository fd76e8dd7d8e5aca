//! Why a decode ended before its points were complete.

use crate::ReadError;

/// Why a decode ended before its points were complete.
#[derive(Debug)]
pub(in super::super) enum Stop {
    /// The bytes ended; records before are as good as the file.
    CutShort,
    /// A layer ended before its points; those before are as good as the file.
    LayerEnds {
        /// Bytes from the start of the chunk to the end of the layer.
        at: usize,
        layer: &'static str,
    },
    /// The bytes contradict themselves.
    Corrupt {
        /// Bytes from the start of the piece to where it showed.
        at: u64,
        why: String,
    },
    /// The bytes could not be read.
    Read(ReadError),
}

impl Stop {
    /// Symbols that no encoder writes.
    pub(super) fn senseless(at: u64) -> Self {
        Self::Corrupt { at, why: "the compressed bytes make no sense".to_owned() }
    }

    /// Whether points that were decoded just before are to be believed.
    pub(in super::super) fn is_honest(&self) -> bool {
        !matches!(self, Self::Corrupt { .. })
    }
}

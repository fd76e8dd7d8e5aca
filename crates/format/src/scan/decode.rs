//! What every reader of scans offers: pieces that decode alone, in batches of points.

use std::ops::ControlFlow;

use super::{Piece, ScanInfo};
use crate::{PointBatch, ReadError};

/// No batch handed to a sink is larger than this.
pub const MAX_BATCH_POINTS: usize = 65_536;

/// Takes the batches of a decode, one after the other; [`ControlFlow::Break`] ends the decode early.
pub type Sink<'a> = dyn FnMut(&PointBatch) -> ControlFlow<()> + 'a;

/// Which columns a decode shall fill: one flag for each of [`ScanInfo::attributes`]. Positions always come.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wanted(pub Vec<bool>);

impl Wanted {
    /// Everything.
    pub fn all(info: &ScanInfo) -> Self {
        Self(vec![true; info.attributes.len()])
    }

    /// Positions alone.
    pub fn positions(info: &ScanInfo) -> Self {
        Self(vec![false; info.attributes.len()])
    }
}

/// Memory that a thread reuses from piece to piece, of any scan.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Bytes as read from the file.
    pub raw: Vec<u8>,
    /// Bytes after decompression.
    pub decoded: Vec<u8>,
    /// The batch that is handed to the sink; its columns fit the scan that was decoded last.
    pub batch: Option<PointBatch>,
}

/// A scan that is open for reading; any number of threads may decode different pieces at once.
pub trait Scan: Send + Sync {
    /// What is known without decoding.
    fn info(&self) -> &ScanInfo;

    /// The parts, in file order; their points are consecutive from 0.
    fn pieces(&self) -> &[Piece];

    /// Decodes one piece and hands its points to `sink`, in file order, in batches of at most [`MAX_BATCH_POINTS`].
    ///
    /// A sink that breaks ends the decode early, without an error.
    ///
    /// # Errors
    /// A piece that cannot be decoded to its end; batches handed over before stay valid. A panic inside a
    /// decompressor comes out as an error too.
    fn decode(
        &self,
        piece: usize,
        wanted: &Wanted,
        scratch: &mut Scratch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError>;
}

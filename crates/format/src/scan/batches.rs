//! A whole scan as an iterator of batches, on one thread.

use std::collections::VecDeque;
use std::ops::ControlFlow;

use super::{Scan, Scratch, Wanted};
use crate::{PointBatch, ReadError};

impl dyn Scan + '_ {
    /// All points of the scan, in file order: the simple way, on the calling thread.
    ///
    /// The iterator decodes a piece at a time and holds its points: some 50,000 as a rule, 260,000 or more of PCD
    /// `binary_compressed`, everything where the file allows but one piece (LAZ without a chunk table). For less memory,
    /// or more threads, there is [`Scan::decode`]. An error ends its piece; the next item is of the next piece.
    ///
    /// ```
    /// # #[cfg(feature = "text")] {
    /// use pointmill_format::{OpenOptions, Wanted, open_scan};
    ///
    /// let file = std::env::temp_dir().join(format!("pointmill-batches-{}.csv", std::process::id()));
    /// std::fs::write(&file, "x,y,z,intensity\n1,2,3,40\n4,5,6,70\n")?;
    /// let scan = open_scan(&file, &OpenOptions::default())?;
    /// let mut sum = 0;
    /// for batch in scan.batches(Wanted::named(scan.info(), ["intensity"])?) {
    ///     let batch = batch?;
    ///     let intensity = batch.column::<u16>("intensity").ok_or("no 16-bit intensity")?;
    ///     sum += intensity.iter().map(|v| u32::from(*v)).sum::<u32>();
    /// }
    /// assert_eq!(sum, 110);
    /// # std::fs::remove_file(file)?;
    /// # }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn batches(&self, wanted: Wanted) -> Batches<'_> {
        Batches { scan: self, wanted, scratch: Scratch::default(), piece: 0, decoded: VecDeque::new() }
    }
}

/// The batches of a scan, in file order ([`Scan::batches`](trait.Scan.html#method.batches)).
#[must_use = "an iterator does nothing unless it is asked"]
pub struct Batches<'a> {
    scan: &'a dyn Scan,
    wanted: Wanted,
    scratch: Scratch,
    /// The next one to decode.
    piece: usize,
    decoded: VecDeque<Result<PointBatch, ReadError>>,
}

impl Iterator for Batches<'_> {
    type Item = Result<PointBatch, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.decoded.is_empty() && self.piece < self.scan.pieces().len() {
            let Self { scan, wanted, scratch, piece, decoded } = self;
            scratch.next_piece = Some(*piece + 1);
            let result = scan.decode(*piece, wanted, scratch, &mut |batch| {
                decoded.push_back(Ok(batch.clone()));
                ControlFlow::Continue(())
            });
            decoded.extend(result.err().map(Err));
            *piece += 1;
        }
        self.decoded.pop_front()
    }
}

impl std::fmt::Debug for Batches<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Batches").field("path", &self.scan.info().path).field("piece", &self.piece).finish()
    }
}

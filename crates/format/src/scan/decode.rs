//! What every reader of scans offers: pieces that decode alone, in batches of points.

use std::any::Any;
use std::ops::ControlFlow;

use super::{Piece, ScanInfo, Wanted};
use crate::{PointBatch, ReadError};

/// No batch handed to a sink is larger than this.
pub const MAX_BATCH_POINTS: usize = 65_536;

/// The positions and columns of a batch take no more bytes than this together, unless a single point does: wide points
/// come in smaller batches.
pub const MAX_BATCH_BYTES: usize = 4 << 20;

/// Points of a full batch, where each takes `point_bytes` (> 0) bytes.
pub(crate) fn batch_points(point_bytes: usize) -> usize {
    MAX_BATCH_BYTES.checked_div(point_bytes).unwrap_or(MAX_BATCH_POINTS).clamp(1, MAX_BATCH_POINTS)
}

/// Bytes that a point takes in a batch: its position and all attributes, whether they are wanted or not, so that
/// batches are the same whatever is wanted.
pub(crate) fn point_bytes(attributes: &[crate::Attribute], is_quantized: bool) -> usize {
    let axis = if is_quantized { size_of::<i32>() } else { size_of::<f64>() };
    attributes.iter().fold(3 * axis, |sum, attribute| sum.saturating_add(attribute.size()))
}

/// Takes the batches of a decode, one after the other; [`ControlFlow::Break`] ends the decode early.
pub type Sink<'a> = dyn FnMut(&PointBatch) -> ControlFlow<()> + 'a;

/// Memory that a thread reuses from piece to piece, of any scan.
#[derive(Debug, Default)]
#[non_exhaustive]
pub struct Scratch {
    /// Bytes as read from the file.
    pub raw: Vec<u8>,
    /// Bytes after decompression.
    pub decoded: Vec<u8>,
    /// The batch that is handed to the sink; its columns fit the scan that was decoded last.
    pub batch: Option<PointBatch>,
    /// The piece that will be decoded with this scratch memory after the next one, if the caller knows it: some readers
    /// take less time for two consecutive pieces that they decode in turn. Forgotten by each decode.
    pub next_piece: Option<usize>,
    /// What else the reader that decoded last wants to find again.
    pub(crate) kept: Option<Box<dyn Any + Send + Sync>>,
}

/// The batch of the scratch memory with these columns and, if `is_quantized`, integer positions; its memory is kept
/// where the types agree.
pub(crate) fn fitting_batch<'a>(
    batch: &'a mut Option<PointBatch>,
    attributes: &std::sync::Arc<[crate::Attribute]>,
    is_quantized: bool,
) -> &'a mut PointBatch {
    use crate::Positions;

    let fits = |b: &PointBatch| matches!(b.positions, Positions::Quantized(_)) == is_quantized && b.fits(attributes);
    match batch {
        Some(b) if fits(b) => b.set_attributes(attributes),
        _ => *batch = None,
    }
    let batch = batch.get_or_insert_with(|| {
        let quantized = || Positions::Quantized(Default::default());
        let positions = if is_quantized { quantized() } else { Positions::World(Default::default()) };
        PointBatch::new(0, positions, attributes.clone())
    });
    batch.clear_changes();
    batch
}

/// Memory of a column beside its values, and of small things for each of them in a decode.
const COLUMN_BYTES: u64 = 256;

/// Memory of a batch of at most `points` points with the wanted columns: [`resize`] gives them no more room than they need.
pub(crate) fn batch_bytes(attributes: &[crate::Attribute], is_quantized: bool, wanted: &Wanted, points: u64) -> u64 {
    let sizes = attributes.iter().enumerate().filter(|(i, _)| wanted.is_wanted(*i)).map(|(_, a)| a.size() as u64);
    let each = point_bytes(&[], is_quantized) as u64 + sizes.sum::<u64>();
    points * each + COLUMN_BYTES * (attributes.len() as u64 + 4)
}

/// Makes a column `len` values long, without room for more. Values that it had stay, so that a column that was as long
/// before is not written twice.
pub(crate) fn resize<T: Clone + Default>(column: &mut Vec<T>, len: usize) {
    column.reserve_exact(len.saturating_sub(column.len()));
    column.resize(len, T::default());
}

/// A scan that is open for reading; any number of threads may decode different pieces at once.
///
/// [`crate::open_scan`] opens one. Where one thread is enough, [`Scan::batches`](trait.Scan.html#method.batches) is
/// simpler than [`Self::decode`]:
///
/// ```
/// # #[cfg(feature = "text")] {
/// use pointmill_format::{OpenOptions, Scratch, Wanted, open_scan};
/// use std::ops::ControlFlow;
///
/// let file = std::env::temp_dir().join(format!("pointmill-decode-{}.xyz", std::process::id()));
/// std::fs::write(&file, "1 2 3\n4 5 6\n")?;
/// let scan = open_scan(&file, &OpenOptions::default())?;
/// let (wanted, mut scratch, mut points) = (Wanted::all(scan.info()), Scratch::default(), 0);
/// for piece in 0..scan.pieces().len() {
///     scan.decode(piece, &wanted, &mut scratch, &mut |batch| {
///         points += batch.len();
///         ControlFlow::Continue(())
///     })?;
/// }
/// assert_eq!(points, 2);
/// # std::fs::remove_file(file)?;
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Scan: Send + Sync {
    /// What is known without decoding.
    fn info(&self) -> &ScanInfo;

    /// The parts, in file order; their points are consecutive from 0.
    fn pieces(&self) -> &[Piece];

    /// The most memory that decoding any one piece with [`Self::decode`] takes on one thread, in bytes: the batch, what is
    /// read and decompressed at once, and the state of a decompressor. It is an upper bound, as a rule less than twice
    /// what is taken. [`Scratch`] keeps its memory: one that serves several scans needs no more than the sum of what each
    /// kind of scan needs at most. What the scan itself holds while it is open is not part of it.
    fn decode_bytes(&self, wanted: &Wanted) -> u64;

    /// Decodes one piece and hands its points to `sink`, in file order, in batches of at most [`MAX_BATCH_POINTS`]
    /// points and [`MAX_BATCH_BYTES`] bytes.
    ///
    /// A sink that breaks ends the decode early, without an error.
    ///
    /// # Errors
    /// A piece that cannot be decoded to its end; batches handed over before stay valid.
    fn decode(
        &self,
        piece: usize,
        wanted: &Wanted,
        scratch: &mut Scratch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError>;
}

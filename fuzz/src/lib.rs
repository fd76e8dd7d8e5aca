//! What every reader promises, whatever the bytes say.

use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use pointmill_format::{
    MAX_BATCH_POINTS, PointBatch, Positions, ReadError, Scan, ScanInfo, ScanKind, Scratch, Wanted, with_column,
};

/// Points that are decoded of one input: a few bytes may honestly stand for many points.
const MAX_POINTS: u64 = 1 << 20;

/// How a file is opened.
pub type Open = fn(&Path) -> Result<Box<dyn Scan>, ReadError>;

/// Opens `bytes` as a file and decodes all of it.
///
/// # Panics
/// If a promise of [`Scan`] is broken: pieces are consecutive, batches have the size they should, columns fit, the
/// pieces' points come or an error does, the positions do not depend on which columns are wanted, and an error is one
/// line.
pub fn read(bytes: &[u8], open: Open) {
    read_some(bytes, open, |info| Wanted::all(info));
}

/// [`read`], where `wanted` chooses the columns.
///
/// # Panics
/// As [`read`].
pub fn read_some(bytes: &[u8], open: Open, wanted: fn(&ScanInfo) -> Wanted) {
    let path = write(bytes);
    let _ = ScanKind::of(&bytes[..bytes.len().min(4096)]);
    match open(path) {
        Ok(scan) => check(&*scan, &wanted(scan.info())),
        Err(error) => check_error(&error),
    }
}

fn check(scan: &dyn Scan, wanted: &Wanted) {
    let info = scan.info();
    let (mut next, mut total) = (0, 0);
    for piece in scan.pieces() {
        assert_eq!(piece.first_point, next, "pieces are consecutive");
        assert!(piece.points > 0, "no piece is empty");
        next = piece.first_point.checked_add(piece.points).expect("points can be counted");
    }
    info.warnings.iter().for_each(|w| assert!(!w.contains(['\n', '\r']), "{w:?}"));
    let mut scratch = Scratch::default();
    for (i, piece) in scan.pieces().iter().enumerate() {
        if total > MAX_POINTS {
            break;
        }
        total += piece.points;
        let all = decode(scan, i, wanted, &mut scratch);
        let positions = decode(scan, i, &Wanted::positions(info), &mut scratch);
        if let (Ok(all), Ok(positions)) = (&all, &positions) {
            assert_eq!(all, positions, "positions depend on what else is wanted");
        }
        [all.err(), positions.err()].iter().flatten().for_each(check_error);
    }
}

/// A sum over the bits of the positions.
fn decode(scan: &dyn Scan, index: usize, wanted: &Wanted, scratch: &mut Scratch) -> Result<u64, ReadError> {
    let piece = &scan.pieces()[index];
    let (mut next, mut sum) = (piece.first_point, 0u64);
    let end = piece.first_point + piece.points;
    let result = scan.decode(index, wanted, scratch, &mut |batch| {
        assert_eq!(batch.first_point, next);
        assert!((1..=MAX_BATCH_POINTS).contains(&batch.len()), "{} points", batch.len());
        next += batch.len() as u64;
        assert!(next <= end, "no point is invented");
        check_columns(scan, wanted, batch);
        match &batch.positions {
            Positions::Quantized(axes) => {
                assert!(scan.info().lattice.is_some());
                axes.iter().flatten().for_each(|v| sum = mix(sum, *v as u64));
            }
            Positions::World(axes) => {
                assert!(scan.info().lattice.is_none());
                // which NaN it is does not matter
                axes.iter().flatten().for_each(|v| sum = mix(sum, if v.is_nan() { 1 } else { v.to_bits() }));
            }
        }
        ControlFlow::Continue(())
    });
    if result.is_ok() {
        assert_eq!(next, end, "all points of the piece, or an error");
    }
    result.map(|()| sum)
}

fn mix(sum: u64, v: u64) -> u64 {
    (sum ^ v).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
}

fn check_columns(scan: &dyn Scan, wanted: &Wanted, batch: &PointBatch) {
    let attributes = &scan.info().attributes;
    assert_eq!(batch.columns.len(), attributes.len());
    for ((column, attribute), wanted) in batch.columns.iter().zip(attributes.iter()).zip(wanted.flags()) {
        assert_eq!(column.ty(), attribute.ty, "{}", attribute.name);
        let len = with_column!(column, v => v.len());
        assert!(!wanted || len == batch.len() * attribute.elements, "{}: {len} values", attribute.name);
    }
}

/// Asserts that an error is a line for people.
///
/// # Panics
/// If it is not.
pub fn check_error(error: &ReadError) {
    let line = error.to_string();
    assert!(!line.contains(['\n', '\r']), "{line:?}");
    assert!(!error.what().is_empty());
}

/// The bytes as a file: readers open paths. One file for the process, in memory where the system has a place for that.
fn write(bytes: &[u8]) -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    let path = PATH.get_or_init(|| {
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
        folder.join(format!("pointmill-fuzz-{}", std::process::id()))
    });
    fs::write(path, bytes).expect("the input can be written");
    path
}

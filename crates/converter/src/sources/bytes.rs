//! What inputs take of the memory, beside their points.

use std::path::{Path, PathBuf};

use super::schema::POSITION_BYTES;
use super::source::Source;
use super::union::Layout;
use crate::error::ConvertError;
use crate::plan::Plan;
use crate::runtime::{Budget, Least};

/// What an input takes after its header was read: counts and ranges of its points, a block of records that nothing else
/// is in, its entry in the report. Measured by a run over many scans of one point (tests/cli/many.rs).
const LATER_BYTES: u64 = 640;

/// Memory of its own costs this much more.
const ALLOCATION_BYTES: u64 = 16;

/// The path of an input is in the plan, among the sources, and in the report.
const PATHS: u64 = 3;

/// A warning without its path.
const WARNING_BYTES: u64 = 512;

/// Inputs that take less are never the reason that a ceiling is too small.
const FEW_BYTES: u64 = 8 << 20;

/// Bytes of a record, where nothing is known of them yet: position, colour and the attributes of LAS.
const USUAL_RECORD: usize = 46;

/// Bytes that decoding takes, where nothing is known of the scans yet.
const USUAL_DECODING: u64 = 12 << 20;

/// Fails where inputs of these paths leave no room for the run itself, before one of them is opened. The ceiling that is
/// named is enough for usual scans.
pub(super) fn check(plan: &Plan, paths: &[&Path]) -> Result<(), ConvertError> {
    let bytes = least_bytes(paths);
    let budget = |record, decoding| Budget::new(plan, record, Least::of([], decoding, bytes)).map(|_| ());
    if bytes <= FEW_BYTES || budget(POSITION_BYTES, 0).is_ok() { Ok(()) } else { budget(USUAL_RECORD, USUAL_DECODING) }
}

/// What inputs of these paths take in all, at least: before their headers were read.
fn least_bytes(paths: &[&Path]) -> u64 {
    let each = (size_of::<Source>() + size_of::<PathBuf>()) as u64 + LATER_BYTES;
    paths.iter().map(|path| each + path_bytes(path.as_os_str().len())).sum()
}

/// What inputs take until the end of the run, open scans aside: of these there are few.
pub(super) fn of(sources: &[Source], layouts: &[Layout], warnings: usize) -> u64 {
    let of_source = |s: &Source| path_bytes(s.path.as_os_str().len()) + size_of_val(&*s.origins) as u64;
    let own: u64 = sources.iter().map(of_source).sum();
    let each = (size_of::<Source>() + size_of::<PathBuf>()) as u64 + LATER_BYTES;
    let placed: usize = layouts.iter().map(|layout| size_of_val(&*layout.columns)).sum();
    own + each * sources.len() as u64 + placed as u64 + warnings as u64 * WARNING_BYTES
}

fn path_bytes(len: usize) -> u64 {
    PATHS * (len as u64 + ALLOCATION_BYTES)
}

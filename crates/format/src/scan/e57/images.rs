//! The images of a file: what is known of each, and its bytes.

use std::ops::ControlFlow;
use std::path::Path;

use super::pages::{Pages, logical, logical_len};
use super::pose::Pose;
use super::xml::{Document, Image, View};
use crate::scan::source::Source;
use crate::{Advice, Blob, Fault, ImagePose, ReadError, ScanImage, ScanWarning};

/// Bytes of the head of a binary section.
const SECTION_HEAD: u64 = 16;
/// Bytes that are handed over at once.
const CHUNK: usize = 1 << 20;
/// Images whose description is not understood that are named.
const MAX_NAMED: usize = 3;

/// All images that can be described; the others become warnings.
pub(super) fn describe(document: &Document, warnings: &mut Vec<ScanWarning>) -> Vec<ScanImage> {
    let mut images = Vec::new();
    let mut unknown = 0;
    for (index, image) in document.images.iter().enumerate() {
        match image {
            Ok(image) => images.extend(views(index + 1, image, document)),
            Err(why) => {
                unknown += 1;
                if unknown <= MAX_NAMED {
                    warnings.push(ScanWarning::ImageUnknown { number: index + 1, why: why.clone() });
                }
            }
        }
    }
    if unknown > MAX_NAMED {
        warnings.push(ScanWarning::More);
    }
    let count = document.images.len() - unknown;
    if count > 0 {
        warnings.push(ScanWarning::Images { count });
    }
    images
}

/// The forms of an image.
fn views(number: usize, image: &Image, document: &Document) -> Vec<ScanImage> {
    let mut clouds = document.clouds.iter();
    let scan = clouds.find(|cloud| !image.scan_guid.is_empty() && cloud.guid == image.scan_guid);
    let pose = image.pose.map(|placement| {
        let (rotation, translation) = Pose::new(Some(placement)).0.parts();
        ImagePose { rotation, translation }
    });
    let of = |view: &View| ScanImage {
        number,
        name: image.name.clone(),
        kind: view.kind,
        encoding: view.encoding,
        pixels: view.pixels,
        data: view.data,
        mask: view.mask,
        scan: scan.map(|cloud| cloud.index + 1),
        pose,
        geometry: view.geometry,
    };
    image.views.iter().map(of).collect()
}

/// Hands the bytes of an image or a mask of the E57 file at `path` to `sink`, in order, in runs of at most 1 MiB. A sink
/// that breaks ends the reading, without an error.
///
/// # Errors
/// The file cannot be opened, has no such bytes there, or a page of them does not match its checksum.
pub fn read_blob(
    path: impl AsRef<Path>,
    blob: &Blob,
    sink: &mut dyn FnMut(&[u8]) -> ControlFlow<()>,
) -> Result<(), ReadError> {
    let source = Source::open(path.as_ref())?;
    let (at, there) = (logical(blob.byte_offset), logical_len(&source));
    let broken = |fault: Fault, advice| ReadError::broken(source.path(), blob.byte_offset, fault).advise(advice);
    let end = at.checked_add(SECTION_HEAD).and_then(|at| at.checked_add(blob.bytes));
    if end.is_none_or(|end| end > there) {
        let (offset, bytes, file_bytes) = (blob.byte_offset, Some(blob.bytes), source.len());
        return Err(broken(Fault::OutsideFile { part: "an image", offset, bytes, file_bytes }, Advice::CutShort));
    }
    let mut window = Vec::new();
    let mut pages = Pages::new(&source, &mut window, 256);
    let mut kind = [0];
    pages.read(at, &mut kind)?;
    if kind[0] != 0 {
        let what = format!("no image here: the section is of type {}, not 0", kind[0]);
        return Err(broken(what.into(), Advice::ExportAgain));
    }
    let mut chunk = vec![0; CHUNK.min(blob.bytes as usize)];
    let (mut at, mut left) = (at + SECTION_HEAD, blob.bytes);
    while left > 0 {
        let bytes = &mut chunk[..left.min(CHUNK as u64) as usize];
        pages.read(at, bytes)?;
        if sink(bytes).is_break() {
            break;
        }
        (at, left) = (at + bytes.len() as u64, left - bytes.len() as u64);
    }
    Ok(())
}

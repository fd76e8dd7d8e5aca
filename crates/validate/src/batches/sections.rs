//! Where the sections are (§1.1): in order, on multiples of 256 bytes, zeros between them, nothing behind them.

use std::borrow::Cow;

use pointmill_format::ReadError;

use super::blocks::{self, Column};
use super::bytes::{Bytes, u64_at};
use super::description::Description;
use super::extents::beyond;
use super::header::{HEADER_BYTES, Header};
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// Columns of one entry per point, in file order.
#[derive(Debug)]
pub(crate) struct Sections {
    /// hi10, and mid10, lo10 if they are there.
    pub(crate) planes: Vec<Column>,
    pub(crate) colour: Column,
    pub(crate) extras: Vec<Column>,
    /// Entries of the originals section.
    pub(crate) originals: u64,
}

/// A section as the file places it.
struct Place {
    name: Cow<'static, str>,
    offset: u64,
    bytes: u64,
}

/// Finds all sections and checks their places; `None` if one of them is not wholly inside the file.
///
/// # Errors
/// The operating system cannot read the file.
pub(crate) fn read(
    bytes: &Bytes,
    header: &Header,
    description: &Description,
    findings: &Findings,
) -> Result<Option<Sections>, ReadError> {
    let mut places = vec![Place { name: "batches".into(), offset: header.batches_at, bytes: 32 * header.batches }];
    let mut column = |name: Cow<'static, str>, offset: u64, stride: usize| {
        let column = blocks::open(bytes, header, &name, offset, stride as u64, findings)?;
        if let Some(column) = &column {
            places.push(Place { name, offset, bytes: column.bytes });
        }
        Ok::<_, ReadError>(column)
    };
    let mut planes = vec![column("hi10".into(), header.planes_at[0], 4)?];
    let colour = column("colour".into(), header.colour_at, 4)?;
    let mut extras = Vec::new();
    for extra in &description.attributes {
        let name = extra.attribute.name.clone();
        extras.push(column(name.into(), extra.offset, extra.attribute.size())?);
    }
    for (plane, name) in [(1, "mid10"), (2, "lo10")] {
        if plane < header.planes() {
            planes.push(column(name.into(), header.planes_at[plane], 4)?);
        }
    }
    let planes: Option<Vec<Column>> = planes.into_iter().collect();
    let extras: Option<Vec<Column>> = extras.into_iter().collect();
    let (Some(planes), Some(colour), Some(extras)) = (planes, colour, extras) else { return Ok(None) };
    for (extra, column) in description.attributes.iter().zip(&extras) {
        if extra.bytes != column.bytes {
            let subject = format!("bytes of {}", extra.attribute.name);
            findings.push(Finding::new(Check::Description, subject, column.bytes, extra.bytes));
        }
    }
    let originals = match header.originals_at {
        0 => 0,
        at => match originals(bytes, at, header.points, findings)? {
            Some(count) => {
                places.push(Place { name: "originals".into(), offset: at, bytes: 8 + 8 * count });
                count
            }
            None => return Ok(None),
        },
    };
    let (offset, len) = (header.description_at, header.description_bytes);
    places.push(Place { name: "description".into(), offset, bytes: len });
    let inside = layout(bytes, &places, findings)?;
    Ok(inside.then_some(Sections { planes, colour, extras, originals }))
}

/// Entries of the originals, if the section can be read.
fn originals(bytes: &Bytes, at: u64, points: u64, findings: &Findings) -> Result<Option<u64>, ReadError> {
    if at.checked_add(8).is_none_or(|end| end > bytes.len) {
        beyond(findings, "originals", at, 8, bytes.len);
        return Ok(None);
    }
    let mut raw = Vec::new();
    bytes.read(at, 8, &mut raw)?;
    let count = u64_at(&raw, 0);
    if count > points || 8 * count > bytes.len - at - 8 {
        let most = points.min((bytes.len - at - 8) / 8);
        findings.push(Finding::new(Check::Sections, "count of originals", format!("at most {most}"), count));
        return Ok(None);
    }
    if count == 0 {
        findings.push(Finding::new(Check::Sections, "count of originals", "at least 1, or no section", count));
    }
    Ok(Some(count))
}

/// Order, alignment, gaps and the end. False if something lies beyond the end.
fn layout(bytes: &Bytes, places: &[Place], findings: &Findings) -> Result<bool, ReadError> {
    findings.checked(Check::Sections, places.len() as u64);
    let fault = |subject: String, expected: String, found: String| {
        findings.push(Finding::new(Check::Sections, subject, expected, found));
    };
    let (mut end, mut before) = (HEADER_BYTES, Cow::Borrowed("header"));
    let mut inside = true;
    for place in places {
        let Place { name, offset, bytes: len } = place;
        if offset.checked_add(*len).is_none_or(|end| end > bytes.len) {
            beyond(findings, name, *offset, *len, bytes.len);
            inside = false;
            continue;
        }
        if offset % 256 != 0 {
            fault(format!("offset of {name}"), "a multiple of 256".into(), offset.to_string());
        }
        if *offset < end {
            fault(format!("offset of {name}"), format!("{end} or more, behind {before}"), offset.to_string());
        } else if let Some(at) = first_byte_not_zero(bytes, end, *offset)? {
            fault(format!("gap before {name}"), "zeros".into(), format!("another byte at {at}"));
        }
        end = end.max(offset + len);
        before = name.clone();
    }
    if inside && end != bytes.len {
        fault("end of the file".into(), format!("{end}, the end of {before}"), bytes.len.to_string());
    }
    Ok(inside)
}

fn first_byte_not_zero(bytes: &Bytes, from: u64, to: u64) -> Result<Option<u64>, ReadError> {
    const STEP: u64 = 1 << 20;
    let mut raw = Vec::new();
    let mut at = from;
    while at < to {
        let len = (to - at).min(STEP);
        bytes.read(at, len, &mut raw)?;
        if let Some(i) = raw.iter().position(|b| *b != 0) {
            return Ok(Some(at + i as u64));
        }
        at += len;
    }
    Ok(None)
}

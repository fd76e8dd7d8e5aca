//! The first 48 bytes, and the XML that they point to (ASTM E2807 §8.3).

use super::pages::{PAGE, Pages, logical, logical_len};
use crate::scan::source::Source;
use crate::{Advice, Fault, ReadError, ScanWarning};

/// What every E57 file starts with.
pub(super) const SIGNATURE: &[u8; 8] = b"ASTM-E57";
/// Bytes of the header.
const LEN: usize = 48;
/// What ends the XML section, but for the prefix of the name.
const ROOT_END: &[u8] = b"e57Root>";
/// What starts it.
const ROOT_STARTS: [&[u8]; 2] = [b"<?xml", b"<e57Root"];
/// So far from its declared ends the XML section is looked for: some writers count its bytes wrong.
const SLACK: u64 = 4096;
/// The share of its length by which it may be too long: some writers count the checksums (4 bytes in 1,020).
const SLACK_SHARE: u64 = 200;

/// Reads the header and the XML section it points to. `max_xml`: more bytes than that are not read.
///
/// # Errors
/// Not E57, another version or page size, a checksum that does not match, no XML section where it should be.
pub(super) fn read_xml(source: &Source, max_xml: u64, warnings: &mut Vec<ScanWarning>) -> Result<Vec<u8>, ReadError> {
    let mut window = Vec::new();
    let head: [u8; LEN] = source.array_at(0)?;
    let field = |at: usize| head[at..].first_chunk::<8>().map_or(0, |b| u64::from_le_bytes(*b));
    check(source, &head, field(8), field(40))?;
    let mut pages = Pages::new(source, &mut window, 64);
    // the header stands in a page with a checksum, too
    pages.read(0, &mut [0; LEN])?;
    let (declared, found) = (field(16), source.len());
    if !found.is_multiple_of(PAGE) && declared >= found {
        warnings.push(ScanWarning::LastPage { missing: PAGE - found % PAGE });
    }
    // a last page that is not whole explains the difference
    if declared != found && declared != found.next_multiple_of(PAGE) {
        warnings.push(ScanWarning::FileSize { declared, found });
    }
    let section = Declared { offset: field(24), len: field(32) };
    let xml = section.read(source, &mut pages, max_xml)?;
    if xml.len() as u64 != section.len {
        warnings.push(ScanWarning::XmlLength { declared: section.len, found: xml.len() as u64 });
    }
    Ok(xml)
}

/// Signature, version and size of the pages.
fn check(source: &Source, head: &[u8], version: u64, page: u64) -> Result<(), ReadError> {
    let broken = |at: u64, what: String| ReadError::broken(source.path(), at, Fault::Header(what));
    if !head.starts_with(SIGNATURE) {
        return Err(broken(0, "this is not an E57 file".to_owned()).advise(Advice::WrongFile));
    }
    let (major, minor) = (version as u32, version >> 32);
    if (major, minor) != (1, 0) {
        let fault = Fault::UnknownVersion { format: "E57", found: (major, minor as u32), known: "1.0 is" };
        return Err(ReadError::unsupported(source.path(), fault));
    }
    if page != PAGE {
        return Err(
            broken(40, format!("pages of {page} bytes; E57 1.0 has pages of {PAGE}")).advise(Advice::ExportAgain)
        );
    }
    Ok(())
}

/// The XML section as the header has it: a physical offset, a logical length.
struct Declared {
    offset: u64,
    len: u64,
}

impl Declared {
    /// The section, from its first tag to its last. Where the declared ends are those, nothing is looked for.
    fn read(&self, source: &Source, pages: &mut Pages<'_>, max_xml: u64) -> Result<Vec<u8>, ReadError> {
        let (start, there) = (logical(self.offset), logical_len(source));
        let most = there.saturating_sub(start).saturating_add(SLACK).saturating_add(self.len / SLACK_SHARE);
        if start >= there || self.len > most {
            return Err(self.outside(source));
        }
        if self.len > max_xml {
            let what = format!("an XML section of {} bytes, more than the {max_xml} that may be held", self.len);
            return Err(ReadError::unsupported(source.path(), what).advise(Advice::MoreMemory));
        }
        let xml = read(pages, start, self.len.min(there - start))?;
        if starts(&xml) == Some(0) && ends(&xml).is_some_and(|end| is_blank(&xml[end..])) {
            return Ok(xml);
        }
        match self.look_around(pages, start, there) {
            Some(found) => Ok(found),
            None if start + self.len > there => Err(self.outside(source)),
            // the parser says what is wrong with it
            None => Ok(xml),
        }
    }

    /// XML that starts and ends near the declared ends.
    fn look_around(&self, pages: &mut Pages<'_>, start: u64, there: u64) -> Option<Vec<u8>> {
        let from = start.saturating_sub(SLACK);
        let to = start.saturating_add(self.len).saturating_add(SLACK).min(there);
        let mut bytes = read(pages, from, to - from).ok()?;
        let declared = (start - from) as usize;
        // the nearest start at or before the declared one, else the first behind it
        let longest = ROOT_STARTS.iter().map(|tag| tag.len()).max().unwrap_or(0);
        let before = last_tag(&bytes[..bytes.len().min(declared + longest)]);
        let first = before.or_else(|| first_tag(&bytes[declared..]).map(|at| declared + at))?;
        bytes.truncate(ends(&bytes)?);
        (first < bytes.len()).then(|| bytes.split_off(first))
    }

    fn outside(&self, source: &Source) -> ReadError {
        let (bytes, file_bytes) = (Some(self.len), source.len());
        let fault = Fault::OutsideFile { part: "the XML section", offset: self.offset, bytes, file_bytes };
        ReadError::broken(source.path(), 24, fault).advise(Advice::CutShort)
    }
}

fn read(pages: &mut Pages<'_>, at: u64, len: u64) -> Result<Vec<u8>, ReadError> {
    let mut bytes = vec![0; len as usize];
    pages.read(at, &mut bytes)?;
    Ok(bytes)
}

/// Where the first tag is; 0 also if only blanks or a byte order mark stand before it.
fn starts(bytes: &[u8]) -> Option<usize> {
    let first = bytes.iter().position(|b| *b == b'<')?;
    let before = bytes[..first].strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes[..first]);
    Some(if is_blank(before) { 0 } else { first })
}

/// The first start of XML in the bytes.
fn first_tag(bytes: &[u8]) -> Option<usize> {
    ROOT_STARTS.iter().filter_map(|tag| bytes.windows(tag.len()).position(|w| w == *tag)).min()
}

/// The last start of XML in the bytes.
fn last_tag(bytes: &[u8]) -> Option<usize> {
    ROOT_STARTS.iter().filter_map(|tag| bytes.windows(tag.len()).rposition(|w| w == *tag)).min()
}

/// Behind the last tag of the XML.
fn ends(bytes: &[u8]) -> Option<usize> {
    bytes.windows(ROOT_END.len()).rposition(|w| w == ROOT_END).map(|at| at + ROOT_END.len())
}

/// Blanks, or the zeros that fill a page.
fn is_blank(bytes: &[u8]) -> bool {
    bytes.iter().all(|b| b.is_ascii_whitespace() || *b == 0)
}

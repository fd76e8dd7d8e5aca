//! The first 48 bytes: where the XML is (ASTM E2807 §8.3).

use super::pages::{PAGE, Pages, logical, logical_len};
use crate::scan::source::Source;
use crate::{Advice, Fault, ReadError, ScanWarning};

/// What every E57 file starts with.
pub(super) const SIGNATURE: &[u8; 8] = b"ASTM-E57";
/// Bytes of the header.
pub(super) const LEN: usize = 48;
/// The largest XML section that is read: one scan needs 3 to 5 kB.
const MAX_XML: u64 = 50 << 20;

/// Reads the header and the XML section it points to.
///
/// # Errors
/// Not E57, another version or page size, a checksum that does not match, an XML section outside the file.
pub(super) fn read_xml(source: &Source, warnings: &mut Vec<ScanWarning>) -> Result<Vec<u8>, ReadError> {
    let mut window = Vec::new();
    let head: [u8; LEN] = source.array_at(0)?;
    let field = |at: usize| head[at..].first_chunk::<8>().map_or(0, |b| u64::from_le_bytes(*b));
    let broken = |at: u64, what: String| ReadError::broken(source.path(), at, Fault::Header(what));
    if !head.starts_with(SIGNATURE) {
        return Err(broken(0, "this is not an E57 file".to_owned()).advise(Advice::WrongFile));
    }
    let (version, page) = (field(8), field(40));
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
    let mut pages = Pages::new(source, &mut window, 64);
    // the header stands in a page with a checksum, too
    pages.read(0, &mut [0; LEN])?;
    if field(16) != source.len() {
        warnings.push(ScanWarning::FileSize { declared: field(16), found: source.len() });
    }
    let (offset, len) = (field(24), field(32));
    let start = logical(offset);
    if start.checked_add(len).is_none_or(|end| end > logical_len(source)) {
        let (bytes, file_bytes) = (Some(len), source.len());
        let fault = Fault::OutsideFile { part: "the XML section", offset, bytes, file_bytes };
        return Err(ReadError::broken(source.path(), 24, fault).advise(Advice::CutShort));
    }
    if len > MAX_XML {
        return Err(ReadError::unsupported(source.path(), format!("an XML section of {len} bytes")));
    }
    let mut xml = vec![0; len as usize];
    pages.read(start, &mut xml)?;
    Ok(xml)
}

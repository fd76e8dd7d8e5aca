//! The XML section, as the `e57` crate understands it.
//!
//! The crate `e57` reads a separate file in memory, header and XML alone: what it need not or cannot read is taken out
//! first. Text fields (which it refuses) become constants of a value that marks them; images are omitted if they are
//! what it stumbles over.

use std::io::Cursor;

use ::e57::{E57Reader, PointCloud};

use super::header::{LEN, SIGNATURE};
use super::pages::{DATA, PAGE};
use crate::scan::catch_panic::catch_panic;

/// Stands for a text field: minimum and maximum of a constant integer ("string" in ASCII).
pub(super) const TEXT_MARK: i64 = 0x7374_7269_6e67;
/// The parser's time grows with the square of both: attributes of an element, and namespace declarations.
const MAX_ATTRIBUTES: usize = 100;
const MAX_NAMESPACES: usize = 256;

/// What the XML section says.
pub(super) struct Document {
    pub(super) clouds: Vec<PointCloud>,
    /// How many images there are; `None` if their description cannot be read.
    pub(super) images: Option<usize>,
    /// The coordinate reference system, as text.
    pub(super) coordinate_metadata: Option<String>,
}

/// Parses the XML section.
///
/// # Errors
/// Why it cannot be understood, as text.
pub(super) fn parse(xml: &[u8]) -> Result<Document, String> {
    let text = std::str::from_utf8(xml).map_err(|e| format!("not UTF-8 from its byte {} on", e.valid_up_to()))?;
    check_size(text)?;
    let text = mark_text_fields(text);
    let read = |text: &str| {
        let reader = catch_panic(|| E57Reader::new(Cursor::new(file_of(text.as_bytes()))))?;
        reader.map_err(|e| with_causes(&e))
    };
    let (reader, images) = match read(&text) {
        Ok(reader) => {
            let images = reader.images().len();
            (reader, Some(images))
        }
        Err(why) => (read(without_images(&text).ok_or(&why)?.as_str()).map_err(|_| why)?, None),
    };
    Ok(Document {
        clouds: reader.pointclouds(),
        images,
        coordinate_metadata: reader.coordinate_metadata().map(|s| s.trim().to_owned()).filter(|s| !s.is_empty()),
    })
}

/// A file that consists of a header and that XML section.
fn file_of(xml: &[u8]) -> Vec<u8> {
    let pages = ((LEN + xml.len()) as u64).div_ceil(DATA);
    let mut logical = Vec::with_capacity((pages * DATA) as usize);
    logical.extend_from_slice(SIGNATURE);
    for field in [1, pages * PAGE, LEN as u64, xml.len() as u64, PAGE] {
        logical.extend_from_slice(&field.to_le_bytes());
    }
    logical.extend_from_slice(xml);
    logical.resize((pages * DATA) as usize, b' ');
    let with_checksum = |page: &[u8]| [page, &crc32c::crc32c(page).to_be_bytes()].concat();
    logical.chunks_exact(DATA as usize).flat_map(with_checksum).collect()
}

/// Refuses what would keep the parser busy without end. Whether the text is well-formed is the parser's business.
fn check_size(text: &str) -> Result<(), String> {
    let (mut rest, mut namespaces) = (text, 0);
    while let Some(at) = rest.find('<') {
        rest = &rest[at..];
        let skips = [("<![CDATA[", "]]>"), ("<!--", "-->"), ("<?", "?>"), ("<!", ">"), ("</", ">")];
        if let Some((_, end)) = skips.into_iter().find(|(start, _)| rest.starts_with(start)) {
            let Some(len) = rest.find(end) else { return Ok(()) };
            rest = &rest[len..];
            continue;
        }
        let (mut quote, mut attributes, mut len) = (None, 0, rest.len());
        for (i, byte) in rest.bytes().enumerate() {
            match (quote, byte) {
                (None, b'>') => {
                    len = i;
                    break;
                }
                (None, b'\'' | b'"') => (quote, attributes) = (Some(byte), attributes + 1),
                (Some(open), byte) if byte == open => quote = None,
                _ => {}
            }
        }
        namespaces += rest[..len].matches("xmlns").count();
        if attributes > MAX_ATTRIBUTES || namespaces > MAX_NAMESPACES {
            return Err(format!("{attributes} attributes of an element, {namespaces} namespaces"));
        }
        rest = &rest[len..];
    }
    Ok(())
}

/// Replaces the type `String` of prototype fields.
fn mark_text_fields(text: &str) -> String {
    let mark = format!("=\"Integer\" minimum=\"{TEXT_MARK}\" maximum=\"{TEXT_MARK}\"");
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find("<prototype") {
        let end = rest[start..].find("</prototype").map_or(rest.len(), |len| start + len);
        out.push_str(&rest[..start]);
        out.push_str(&rest[start..end].replace("=\"String\"", &mark).replace("='String'", &mark));
        rest = &rest[end..];
    }
    out.push_str(rest);
    out
}

fn without_images(text: &str) -> Option<String> {
    let start = text.find("<images2D")?;
    let end = start + text[start..].find("</images2D")?;
    let close = end + text[end..].find('>')? + 1;
    Some([&text[..start], &text[close..]].concat())
}

fn with_causes(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(e) = cause {
        text = format!("{text}: {e}");
        cause = e.source();
    }
    text.replace(['\n', '\r'], " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const XML: &str = r#"<e57Root type="Structure"><formatName type="String">f</formatName><guid type="String">g</guid>
        <versionMajor type="Integer">1</versionMajor><data3D type="Vector"><vectorChild type="Structure">
        <points type="CompressedVector" fileOffset="48" recordCount="3"><prototype type="Structure">
        <cartesianX type="Float"/><note type="String"/></prototype></points></vectorChild></data3D>
        <images2D type="Vector"><vectorChild type="Structure"><guid type="Integer"/></vectorChild></images2D></e57Root>"#;

    #[test]
    fn text_fields_are_marked_and_unreadable_images_left_out() {
        let document = parse(XML.as_bytes()).unwrap();
        assert_eq!(document.images, None, "an image whose GUID is a number");
        let cloud = &document.clouds[0];
        assert_eq!((cloud.records, cloud.prototype.len()), (3, 2));
        let ::e57::RecordDataType::Integer { min, max } = cloud.prototype[1].data_type else { panic!() };
        assert_eq!((min, max), (TEXT_MARK, TEXT_MARK));
    }

    #[test]
    fn what_cannot_be_understood_is_told() {
        let why = |xml: &[u8]| parse(xml).err().unwrap();
        assert!(why(b"<e57Root>\xff").contains("not UTF-8 from its byte 9 on"));
        assert!(why(b"<e57Root>").contains("XML"));
        assert!(why(XML.replace("\"48\"", "\"x\"").as_bytes()).contains("fileOffset"));
        // neither overflows the stack nor takes the square of its length
        assert!(why("<a>".repeat(1_000_000).as_bytes()).contains("XML"));
        let attributes: String = (0..100_000).map(|i| format!(" a{i}=\"'>\"")).collect();
        assert!(why(format!("<![CDATA[>]]><a{attributes}/>").as_bytes()).contains("100000 attributes"));
        let namespaces: String = (0..60_000).map(|i| format!("<a xmlns:a{i}='u'>")).collect();
        assert!(why(namespaces.as_bytes()).contains("257 namespaces"));
    }
}

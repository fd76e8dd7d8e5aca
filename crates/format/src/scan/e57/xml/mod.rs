//! The XML section: what a file says of its scans and images (ASTM E2807 §8.4).
//!
//! It is read from front to back; of each scan and image only what the reader knows is kept. Writers deviate from the
//! standard in many ways, and what does not change the meaning of a point is read all the same: elements that should be
//! there and are not, namespaces that are declared twice or not at all, numbers in unusual spellings.

mod cloud;
pub(super) mod element;
mod image;
mod markup;
pub(super) mod numbers;

use std::borrow::Cow;

pub(super) use cloud::{Cloud, Limit, Placement};
pub(super) use image::{Image, View};

use crate::ScanWarning;
use element::{Element, split};
use markup::{Event, Markup, Tag};
use numbers::Numbers;

/// What the XML section says.
#[derive(Debug, Default)]
pub(super) struct Document {
    pub(super) clouds: Vec<Cloud>,
    /// By number; `Err` says why one cannot be understood.
    pub(super) images: Vec<Result<Image, String>>,
    /// The coordinate reference system, as text.
    pub(super) coordinate_metadata: Option<String>,
}

/// Parses the XML section.
///
/// # Errors
/// Why it cannot be understood, as text.
pub(super) fn parse(xml: &[u8], warnings: &mut Vec<ScanWarning>) -> Result<Document, String> {
    let text = match std::str::from_utf8(xml) {
        Ok(text) => Cow::Borrowed(text),
        Err(e) => {
            warnings.push(ScanWarning::XmlEncoding { at: e.valid_up_to() as u64 });
            // all that is not a name is ASCII
            Cow::Owned(xml.iter().map(|b| char::from(*b)).collect())
        }
    };
    let mut reader = Reader { markup: Markup::new(&text), numbers: Numbers::default(), document: Document::default() };
    reader.root(warnings)?;
    if reader.numbers.commas.get() {
        warnings.push(ScanWarning::XmlCommas);
    }
    Ok(reader.document)
}

struct Reader<'a> {
    markup: Markup<'a>,
    numbers: Numbers,
    document: Document,
}

impl<'a> Reader<'a> {
    fn root(&mut self, warnings: &mut Vec<ScanWarning>) -> Result<(), String> {
        let Some(Event::Start(root)) = self.markup.next()? else { return Err("it has no element".to_owned()) };
        let (core, name) = root.name.split_once(':').unwrap_or(("", root.name));
        if name != "e57Root" {
            let name: String = name.chars().take(40).collect();
            return Err(format!("its root is <{name}>, not <e57Root>"));
        }
        warnings.extend(repeated(&root));
        self.children(core, |reader, tag, name| match name {
            "data3D" => reader.children(core, |reader, tag, name| reader.scan(tag, name, core)),
            "images2D" => reader.children(core, |reader, tag, name| reader.image(tag, name, core)),
            "coordinateMetadata" => {
                let element = Element::read(&mut reader.markup, tag, core)?;
                let text = Some(element.text()).filter(|text| !text.is_empty());
                reader.document.coordinate_metadata = text.map(str::to_owned);
                Ok(())
            }
            _ => reader.pass(),
        })
    }

    /// Hands each child of the element that was last started, with its name (none, if it has a prefix), to `each`, which
    /// reads it to its end.
    fn children(
        &mut self,
        core: &str,
        mut each: impl FnMut(&mut Self, &Tag<'a>, &str) -> Result<(), String>,
    ) -> Result<(), String> {
        while let Some(event) = self.markup.next()? {
            match event {
                Event::Start(tag) => {
                    let (prefix, name) = split(tag.name, core);
                    each(self, &tag, if prefix.is_empty() { name } else { "" })?;
                }
                Event::End => break,
                Event::Text(_) => {}
            }
        }
        Ok(())
    }

    /// Goes behind the end of the element that was last started.
    fn pass(&mut self) -> Result<(), String> {
        let mut depth = 1;
        while depth > 0 {
            match self.markup.next()? {
                Some(Event::Start(_)) => depth += 1,
                Some(Event::End) => depth -= 1,
                Some(Event::Text(_)) => {}
                None => break,
            }
        }
        Ok(())
    }

    fn scan(&mut self, tag: &Tag<'a>, name: &str, core: &str) -> Result<(), String> {
        if name != "vectorChild" {
            return self.pass();
        }
        let element = Element::read(&mut self.markup, tag, core)?;
        let index = self.document.clouds.len();
        let cloud = Cloud::read(index, &element, &self.numbers).map_err(|why| format!("scan {}: {why}", index + 1))?;
        self.document.clouds.push(cloud);
        Ok(())
    }

    fn image(&mut self, tag: &Tag<'a>, name: &str, core: &str) -> Result<(), String> {
        if name != "vectorChild" {
            return self.pass();
        }
        let element = Element::read(&mut self.markup, tag, core)?;
        self.document.images.push(Image::read(&element, &self.numbers));
        Ok(())
    }
}

/// An attribute that a tag has twice.
fn repeated(tag: &Tag<'_>) -> Option<ScanWarning> {
    let mut names = std::collections::HashSet::new();
    let name = tag.attributes().map(|(name, _)| name).find(|name| !names.insert(*name))?;
    Some(ScanWarning::XmlRepeated { name: name.chars().take(40).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::e57::fields::{Encoding, Name};

    const XML: &str = r#"<?xml version="1.0"?><e57Root type="Structure" xmlns="u"><guid type="String">g</guid>
        <data3D type="Vector"><vectorChild type="Structure"><name>A</name>
        <points type="CompressedVector" fileOffset="48" recordCount="3"><prototype type="Structure">
        <cartesianX type="Float"/><note type="String"/></prototype></points></vectorChild></data3D>
        <images2D type="Vector"><vectorChild type="Structure"><name>Q</name></vectorChild></images2D></e57Root>"#;

    fn read(xml: &str) -> Result<(Document, Vec<ScanWarning>), String> {
        let mut warnings = Vec::new();
        parse(xml.as_bytes(), &mut warnings).map(|document| (document, warnings))
    }

    #[test]
    fn scans_and_images_are_described_and_nonsense_costs_an_image_alone() {
        let (document, warnings) = read(XML).unwrap();
        let cloud = &document.clouds[0];
        assert_eq!((cloud.name.as_str(), cloud.records, cloud.file_offset), ("A", 3, 48));
        assert_eq!((&cloud.fields[0].name, cloud.fields[0].encoding), (&Name::CartesianX, Encoding::Double));
        assert_eq!((cloud.fields[1].tag(), cloud.fields[1].encoding), ("note", Encoding::Text));
        assert!(document.images[0].as_ref().unwrap_err().contains("no representation"));
        assert!(warnings.is_empty());
    }

    #[test]
    fn deviations_of_writers_do_not_matter() {
        let spelled = [
            (r#"xmlns="u""#, r#"xmlns="u" xmlns:n="a" xmlns:n="a""#, 1),
            ("<guid type=\"String\">g</guid>", "", 0),
            ("type=\"Structure\"", "", 0),
            ("recordCount=\"3\"", "recordCount=\" 3.0 \"", 0),
            ("<cartesianX ", "<cartesianX minimum=\"-1,5\" ", 1),
            ("<name>A", "<pose><translation><x>1,5</x></translation></pose><name>A", 1),
            ("<note ", "<nor:note ", 0),
        ];
        for (old, new, told) in spelled {
            let (document, warnings) = read(&XML.replacen(old, new, 1)).unwrap_or_else(|why| panic!("{new}: {why}"));
            assert_eq!((document.clouds[0].records, document.clouds[0].fields.len()), (3, 2), "{new}");
            assert_eq!(warnings.len(), told, "{new}: {warnings:?}");
        }
        let prefixed = XML.replace("</", "</e:").replace("<", "<e:").replace("<e:/", "</").replace("<e:?", "<?");
        assert_eq!(read(&prefixed).unwrap().0.clouds[0].fields[0].name, Name::CartesianX);
        let mut latin = XML.replace(">A<", ">H?he<").into_bytes();
        let at = latin.iter().rposition(|b| *b == b'?').unwrap();
        latin[at] = 0xf6;
        let mut warnings = Vec::new();
        assert_eq!(parse(&latin, &mut warnings).unwrap().clouds[0].name, "Höhe");
        assert_eq!(warnings, [ScanWarning::XmlEncoding { at: at as u64 }]);
    }

    #[test]
    fn what_cannot_be_understood_is_told() {
        let why = |xml: &str| read(xml).unwrap_err();
        assert!(why("<e57Root>").contains("ends within <e57Root>"));
        assert!(why("<html/>").contains("its root is <html>"));
        assert!(why(&XML.replace("\"48\"", "\"x\"")).contains("scan 1: fileOffset of points is \"x\""));
        assert!(why(&XML.replace("fileOffset=\"48\"", "")).contains("scan 1: its points have no fileOffset"));
        assert!(why(&XML.replace("Float", "Flout")).contains("scan 1: cartesianX is of type \"Flout\""));
        assert!(why(&XML.replace("/></", "/><x></")).contains("closes <x>"));
    }
}

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

/// Why the XML section is not read, as text.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Refusal {
    /// It cannot be understood.
    Broken(String),
    /// It describes more than may be held.
    TooMuch(String),
}

/// What may be held of a description, so that it takes no more memory than a few times the XML that is allowed: a scan or an
/// image needs some 5,000 bytes of XML, a field 60.
#[derive(Debug, Clone, Copy)]
struct Limits {
    scans: usize,
    images: usize,
    fields: usize,
}

impl Limits {
    /// For sections of at most `max_xml` bytes.
    fn of(max_xml: u64) -> Self {
        let most =
            |bytes: u64, always: usize| usize::try_from(max_xml / bytes).unwrap_or(usize::MAX).saturating_add(always);
        Self { scans: most(1024, 1000), images: most(1024, 1000), fields: most(128, 20_000) }
    }
}

/// Parses the XML section. `max_xml`: as many bytes as it might have.
///
/// # Errors
/// Why it is not read.
pub(super) fn parse(xml: &[u8], max_xml: u64, warnings: &mut Vec<ScanWarning>) -> Result<Document, Refusal> {
    let text = match std::str::from_utf8(xml) {
        Ok(text) => Cow::Borrowed(text),
        Err(e) => {
            warnings.push(ScanWarning::XmlEncoding { at: e.valid_up_to() as u64 });
            // all that is not a name is ASCII
            Cow::Owned(xml.iter().map(|b| char::from(*b)).collect())
        }
    };
    let mut reader = Reader {
        markup: Markup::new(&text),
        numbers: Numbers::default(),
        document: Document::default(),
        limits: Limits::of(max_xml),
        fields: 0,
        is_too_much: false,
    };
    let refusal = |why: String, is_too_much| if is_too_much { Refusal::TooMuch(why) } else { Refusal::Broken(why) };
    reader.root(warnings).map_err(|why| refusal(why, reader.is_too_much))?;
    if reader.numbers.commas.get() {
        warnings.push(ScanWarning::XmlCommas);
    }
    Ok(reader.document)
}

struct Reader<'a> {
    markup: Markup<'a>,
    numbers: Numbers,
    document: Document,
    limits: Limits,
    /// Fields of all scans so far.
    fields: usize,
    /// The error is that it describes more than may be held.
    is_too_much: bool,
}

impl<'a> Reader<'a> {
    /// # Errors
    /// There is one more of `what` than `most`.
    fn within(&mut self, count: usize, most: usize, what: &str) -> Result<(), String> {
        self.is_too_much = count > most;
        if self.is_too_much { Err(format!("more than {most} {what}, which is more than may be held")) } else { Ok(()) }
    }

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
        self.within(index + 1, self.limits.scans, "scans")?;
        let cloud = Cloud::read(index, &element, &self.numbers).map_err(|why| format!("scan {}: {why}", index + 1))?;
        self.fields += cloud.fields.len();
        self.within(self.fields, self.limits.fields, "fields of scans")?;
        self.document.clouds.push(cloud);
        Ok(())
    }

    fn image(&mut self, tag: &Tag<'a>, name: &str, core: &str) -> Result<(), String> {
        if name != "vectorChild" {
            return self.pass();
        }
        self.within(self.document.images.len() + 1, self.limits.images, "images")?;
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
        let document = parse(xml.as_bytes(), 1 << 30, &mut warnings).map_err(|refusal| match refusal {
            Refusal::Broken(why) => why,
            Refusal::TooMuch(why) => panic!("{why}"),
        })?;
        Ok((document, warnings))
    }

    #[test]
    fn more_than_may_be_held_is_refused() {
        let many = |of: &str, count: usize| format!("<e57Root>{}</e57Root>", of.repeat(count));
        let fields = "<vectorChild><points recordCount='0' fileOffset='0'><prototype>".to_owned()
            + &"<a type='Float'/>".repeat(5000)
            + "</prototype></points></vectorChild>";
        let cases = [
            (many("<data3D><vectorChild/></data3D>", 1001), "more than 1000 scans"),
            (many("<images2D><vectorChild/></images2D>", 1001), "more than 1000 images"),
            (many(&format!("<data3D>{fields}</data3D>"), 5), "more than 20000 fields of scans"),
        ];
        for (xml, why) in cases {
            let refusal = parse(xml.as_bytes(), 100, &mut Vec::new()).unwrap_err();
            assert!(matches!(&refusal, Refusal::TooMuch(text) if text.starts_with(why)), "{refusal:?}");
            assert!(parse(xml.as_bytes(), 1 << 20, &mut Vec::new()).is_ok(), "{why}");
        }
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
        assert_eq!(parse(&latin, 1 << 30, &mut warnings).unwrap().clouds[0].name, "Höhe");
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

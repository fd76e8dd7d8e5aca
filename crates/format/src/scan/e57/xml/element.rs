//! An element with what the reader knows below it; all else is passed over, so that memory does not grow with it.

use std::borrow::Cow;

use super::markup::{Event, Markup, Tag};

/// Text of an element that is kept at most: bytes.
const MAX_TEXT: usize = 1 << 20;
/// Fields of a prototype that are kept at most; a scan with more is refused.
pub(super) const MAX_FIELDS: usize = 10_000;
/// The element whose children all count.
const PROTOTYPE: &str = "prototype";

/// The names that mean something to the reader.
const KNOWN: &[&str] = &[
    "guid",
    "name",
    "pose",
    "rotation",
    "translation",
    "w",
    "x",
    "y",
    "z",
    "cartesianBounds",
    "xMinimum",
    "xMaximum",
    "yMinimum",
    "yMaximum",
    "zMinimum",
    "zMaximum",
    "sphericalBounds",
    "rangeMaximum",
    "colorLimits",
    "colorRedMinimum",
    "colorRedMaximum",
    "colorGreenMinimum",
    "colorGreenMaximum",
    "colorBlueMinimum",
    "colorBlueMaximum",
    "intensityLimits",
    "intensityMinimum",
    "intensityMaximum",
    "points",
    PROTOTYPE,
    "associatedData3DGuid",
    "visualReferenceRepresentation",
    "pinholeRepresentation",
    "sphericalRepresentation",
    "cylindricalRepresentation",
    "jpegImage",
    "pngImage",
    "imageMask",
    "imageWidth",
    "imageHeight",
    "focalLength",
    "pixelWidth",
    "pixelHeight",
    "principalPointX",
    "principalPointY",
    "radius",
];

/// An element.
#[derive(Debug)]
pub(in crate::scan::e57) struct Element<'a> {
    /// Empty for those of E57 itself.
    pub(in crate::scan::e57) prefix: &'a str,
    /// Without its prefix.
    pub(in crate::scan::e57) name: &'a str,
    attributes: Vec<(&'a str, Cow<'a, str>)>,
    pub(super) children: Vec<Element<'a>>,
    text: String,
}

/// A name as prefix and rest; the prefix that the root has is none.
pub(super) fn split<'a>(name: &'a str, core: &str) -> (&'a str, &'a str) {
    match name.split_once(':') {
        Some((prefix, name)) if prefix == core => ("", name),
        Some((prefix, name)) => (prefix, name),
        None => ("", name),
    }
}

impl<'a> Element<'a> {
    fn new(tag: &Tag<'a>, core: &str) -> Self {
        let (prefix, name) = split(tag.name, core);
        Self { prefix, name, attributes: tag.attributes().collect(), children: Vec::new(), text: String::new() }
    }

    /// Reads the element whose start tag was the last event. `core`: the prefix of the root.
    pub(super) fn read(markup: &mut Markup<'a>, tag: &Tag<'a>, core: &str) -> Result<Self, String> {
        let mut done = Self::new(tag, core);
        let (mut above, mut passed) = (Vec::new(), 0u32);
        while let Some(event) = markup.next()? {
            match event {
                Event::Start(tag) if passed == 0 && done.keeps(&tag, core) => {
                    above.push(std::mem::replace(&mut done, Self::new(&tag, core)));
                }
                Event::Start(_) => passed += 1,
                Event::End if passed > 0 => passed -= 1,
                Event::End => match above.pop() {
                    None => return Ok(done),
                    Some(parent) => {
                        let child = std::mem::replace(&mut done, parent);
                        done.children.push(child);
                    }
                },
                Event::Text(text) if passed == 0 && done.children.is_empty() => {
                    if done.text.len() + text.len() <= MAX_TEXT {
                        done.text.push_str(&text);
                    }
                }
                Event::Text(_) => {}
            }
        }
        Ok(done)
    }

    /// True for a child that means something: known, and the first of its name; or any field of a prototype.
    fn keeps(&self, tag: &Tag<'_>, core: &str) -> bool {
        if self.name == PROTOTYPE {
            return self.children.len() <= MAX_FIELDS;
        }
        let (prefix, name) = split(tag.name, core);
        prefix.is_empty() && KNOWN.contains(&name) && self.child(name).is_none()
    }

    /// The first child of that name.
    pub(in crate::scan::e57) fn child(&self, name: &str) -> Option<&Self> {
        self.children.iter().find(|child| child.prefix.is_empty() && child.name == name)
    }

    /// The value of an attribute, the first of its name, without blanks around it.
    pub(in crate::scan::e57) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(n, _)| *n == name).map(|(_, value)| value.trim())
    }

    /// Its text, without blanks around it.
    pub(in crate::scan::e57) fn text(&self) -> &str {
        self.text.trim()
    }

    /// The text of a child, if there is some.
    pub(in crate::scan::e57) fn child_text(&self, name: &str) -> Option<&str> {
        self.child(name).map(Self::text).filter(|text| !text.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Element<'_>, String> {
        let mut markup = Markup::new(text);
        let Some(Event::Start(tag)) = markup.next()? else { panic!() };
        Element::read(&mut markup, &tag, "e57")
    }

    #[test]
    fn what_is_known_is_kept_and_the_rest_passed_over() {
        let scan = read(
            "<e57:scan><other><name>no</name></other><e57:name> Hall <!-- 7 --> 2 </e57:name><x:name>no</x:name>\
             <name>second</name><points a=' 1 ' a='2'><prototype><x:q/><z/></prototype></points></e57:scan>",
        )
        .unwrap();
        assert_eq!((scan.name, scan.child_text("name")), ("scan", Some("Hall  2")));
        assert_eq!(scan.children.len(), 2);
        let points = scan.child("points").unwrap();
        assert_eq!((points.attribute("a"), points.attribute("b")), (Some("1"), None));
        let fields = &points.child("prototype").unwrap().children;
        assert_eq!(fields.iter().map(|f| (f.prefix, f.name)).collect::<Vec<_>>(), [("x", "q"), ("", "z")]);
    }
}

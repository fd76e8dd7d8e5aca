//! What is compared with each other and with the file's size before anything is handed out
//! (`docs/formats/batches.md`, §11).

use std::path::Path;

use crate::{Attribute, ReadError};

use super::describe::{AttributeEntry, Description};
use super::header::CORRUPT;
use super::{BATCH_POINTS, BatchRecord, Flags, HEADER_BYTES, Header, SECTION_ALIGNMENT, Section, batch_points};

/// More JSON than this is no description.
const MAX_DESCRIPTION_BYTES: u64 = 16 << 20;

/// What to do about a file that ends too early.
const CUT_SHORT: &str = "the file was cut short; copy or convert it again";

/// The places of everything, within the file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Places {
    pub(crate) records: Section,
    pub(crate) hi10: Section,
    pub(crate) mid10: Option<Section>,
    pub(crate) lo10: Option<Section>,
    pub(crate) colour: Section,
    pub(crate) originals: Option<Section>,
    pub(crate) attributes: Vec<(Attribute, Section)>,
}

/// Reads and checks one file.
pub(crate) struct Check<'a> {
    pub(crate) bytes: &'a [u8],
    pub(crate) header: &'a Header,
    pub(crate) path: &'a Path,
}

impl Check<'_> {
    /// The description, within its bounds.
    pub(crate) fn description(&self) -> Result<Description, ReadError> {
        let Header { sections, description_bytes, .. } = self.header;
        if *description_bytes > MAX_DESCRIPTION_BYTES {
            let what = format!("{description_bytes} bytes are too many for a description");
            return Err(self.broken(176, what).advise(CORRUPT));
        }
        let section = Section { offset: sections.description, bytes: *description_bytes };
        let text = self.section(section, "description", 168)?;
        Description::from_json(text, self.path, section.offset)
    }

    /// Every section lies in the file, on its own.
    pub(crate) fn places(&self, description: &Description) -> Result<Places, ReadError> {
        let Header { points, batches, sections, .. } = self.header;
        let fixed = |offset, bytes, name, field| {
            let section = Section { offset, bytes };
            self.section(section, name, field).map(|_| section)
        };
        let points = |offset: u64, size: u64, name: &str, field: u64| {
            let section = Section { offset, bytes: self.point_section_bytes(offset, points * size, name)? };
            self.section(section, name, field).map(|_| section)
        };
        let places = Places {
            records: fixed(sections.batches, 32 * u64::from(*batches), "batches", 120)?,
            hi10: points(sections.hi10, 4, "hi10", 128)?,
            mid10: sections.mid10.map(|o| points(o, 4, "mid10", 136)).transpose()?,
            lo10: sections.lo10.map(|o| points(o, 4, "lo10", 144)).transpose()?,
            colour: points(sections.colour, 4, "colour", 152)?,
            originals: sections.originals.map(|o| self.originals(o)).transpose()?,
            attributes: self.attributes(description)?,
        };
        self.no_overlap(&places)?;
        Ok(places)
    }

    /// First points, counts and boxes of the records.
    pub(crate) fn records(&self, records: &[BatchRecord]) -> Result<(), ReadError> {
        for (slot, record) in (0..).zip(records) {
            let first = u64::from(slot) * u64::from(BATCH_POINTS);
            let points = batch_points(slot, self.header.points);
            let at = self.header.sections.batches + 32 * u64::from(slot);
            let fault = if u64::from(record.first_point) != first || record.points != points {
                let (found_first, found) = (record.first_point, record.points);
                Some(format!("has {found} points from {found_first}, not {points} from {first}"))
            } else if !(0..3)
                .all(|a| record.min[a] <= record.max[a] && record.min[a] >= 0.0 && record.max[a].is_finite())
            {
                Some(format!(
                    "has the box {:?} to {:?}: inverted, below the origin or not finite",
                    record.min, record.max
                ))
            } else {
                None
            };
            if let Some(fault) = fault {
                return Err(self.broken(at, format!("batch {slot} {fault}")).advise(CORRUPT));
            }
        }
        Ok(())
    }

    /// Bytes of a section with `raw` bytes of values: those, or what the block table says.
    fn point_section_bytes(&self, offset: u64, raw: u64, name: &str) -> Result<u64, ReadError> {
        if !self.header.flags.has(Flags::COMPRESSED) {
            return Ok(raw);
        }
        let table = usize::try_from(offset).ok().and_then(|o| self.bytes.get(o..)).unwrap_or(&[]);
        super::blocks::check_table(table, self.header.batches)
            .map_err(|what| self.broken(offset, format!("the block table of {name} {what}")).advise(CORRUPT))
    }

    fn originals(&self, offset: u64) -> Result<Section, ReadError> {
        let count = self.section(Section { offset, bytes: 8 }, "originals", 160)?;
        let count = count.first_chunk().map_or(0, |c| u64::from_le_bytes(*c));
        if count > self.header.points {
            let what = format!("{count} originals of {} points", self.header.points);
            return Err(self.broken(offset, what).advise(CORRUPT));
        }
        let section = Section { offset, bytes: 8 + 8 * count };
        self.section(section, "originals", 160).map(|_| section)
    }

    fn attributes(&self, description: &Description) -> Result<Vec<(Attribute, Section)>, ReadError> {
        let at = self.header.sections.description;
        let broken = |what: String| self.broken(at, format!("description: {what}")).advise(CORRUPT);
        if description.attributes.len() > AttributeEntry::MAX_ATTRIBUTES {
            return Err(broken(format!("{} attributes are too many", description.attributes.len())));
        }
        let mut attributes: Vec<(Attribute, Section)> = Vec::new();
        for entry in &description.attributes {
            let name = &entry.name;
            let attribute = entry.attribute().ok_or_else(|| {
                broken(format!("attribute \"{name}\" has the type \"{}\" x {}", entry.type_name, entry.elements))
            })?;
            if attributes.iter().any(|(a, _)| a.name == *name) {
                return Err(broken(format!("two attributes are named \"{name}\"")));
            }
            let raw = self.header.points * attribute.size() as u64;
            let section = Section { offset: entry.offset, bytes: entry.bytes };
            self.section(section, name, at)?;
            let expected = self.point_section_bytes(section.offset, raw, name)?;
            if section.bytes != expected {
                return Err(broken(format!("attribute \"{name}\" has {} bytes, not {expected}", section.bytes)));
            }
            attributes.push((attribute, section));
        }
        Ok(attributes)
    }

    fn no_overlap(&self, places: &Places) -> Result<(), ReadError> {
        let description = Section { offset: self.header.sections.description, bytes: self.header.description_bytes };
        let mut all = vec![
            ("batches", places.records),
            ("hi10", places.hi10),
            ("colour", places.colour),
            ("description", description),
        ];
        all.extend(places.mid10.map(|s| ("mid10", s)));
        all.extend(places.lo10.map(|s| ("lo10", s)));
        all.extend(places.originals.map(|s| ("originals", s)));
        all.extend(places.attributes.iter().map(|(a, s)| (a.name.as_str(), *s)));
        all.retain(|(_, s)| s.bytes > 0); // of an empty one any place will do
        all.sort_by_key(|(_, s)| s.offset);
        for pair in all.windows(2) {
            if let [(first, a), (second, b)] = pair
                && a.end() > b.offset
            {
                let what = format!("section {first} ends at byte {}, but {second} begins at {}", a.end(), b.offset);
                return Err(self.broken(b.offset, what).advise(CORRUPT));
            }
        }
        Ok(())
    }

    /// The bytes of a section; `field`: where its offset stands.
    fn section(&self, section: Section, name: &str, field: u64) -> Result<&[u8], ReadError> {
        let Section { offset, bytes } = section;
        if offset < HEADER_BYTES || !offset.is_multiple_of(SECTION_ALIGNMENT) {
            let what = format!("section {name} begins at {offset}, which is no multiple of 256 behind the header");
            return Err(self.broken(field, what).advise(CORRUPT));
        }
        let range = usize::try_from(offset).ok().zip(usize::try_from(section.end()).ok());
        range.and_then(|(start, end)| self.bytes.get(start..end)).ok_or_else(|| {
            let size = self.bytes.len();
            let what = format!("section {name} needs {bytes} bytes from byte {offset} on, but the file has {size}");
            self.broken(field, what).advise(CUT_SHORT)
        })
    }

    fn broken(&self, at: u64, what: String) -> ReadError {
        ReadError::broken(self.path, at, what)
    }
}

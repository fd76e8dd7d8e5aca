//! Where everything of a file will lie, before anything is written (`docs/formats/batches.md`, §1.1).

use crate::{Aabb, Attribute, WriteError};

use super::describe::{AttributeEntry, Description};
use super::{
    BATCH_POINTS, Flags, Grid, HEADER_BYTES, Header, MAX_POINTS, Part, Precision, Sections, align, batch_count,
    swap_slot,
};

/// A range of the file, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)] // the names say it
pub struct Section {
    pub offset: u64,
    pub bytes: u64,
}

impl Section {
    /// The first byte behind it.
    pub const fn end(&self) -> u64 {
        self.offset.saturating_add(self.bytes)
    }
}

/// A section with one entry per point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct PointSection {
    /// What it holds.
    pub part: Part,
    /// Where it is.
    pub section: Section,
    /// Bytes of an entry.
    pub bytes_per_point: u64,
}

/// Places of all sections of a file that is not compressed.
///
/// Planes lie behind colours and attributes: a writer that needs no lo10 (or mid10) in the end
/// takes [`Self::with_precision`], **cuts the file at [`Self::end_of_points`]** (what it wrote behind must not
/// stay in the gaps), and goes on with the originals.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Layout {
    /// N.
    pub points: u64,
    /// B.
    pub batches: u32,
    /// Records, 32 bytes per slot.
    pub records: Section,
    /// 4 bytes per point, as mid10, lo10 and colour.
    pub hi10: Section,
    /// Colour words.
    pub colour: Section,
    /// Extra attributes, in the order in which they were given.
    pub attributes: Vec<Section>,
    /// `None` if omitted.
    pub mid10: Option<Section>,
    /// `None` if omitted.
    pub lo10: Option<Section>,
    /// Where the originals begin; their number is known at the end.
    pub originals: u64,
    described: Vec<Attribute>,
}

/// The end of a file: what there is to write when all points are.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Finish {
    /// The fields of the header.
    pub header: Header,
    /// The header's 256 bytes, for the start of the file.
    pub header_bytes: [u8; HEADER_BYTES as usize],
    /// The description, complete.
    pub description: Description,
    /// Its text, for [`Self::description_offset`]; the file ends with it.
    pub description_bytes: Vec<u8>,
    /// Where the text belongs.
    pub description_offset: u64,
}

/// What averaging did to the colours (§4.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Averaging {
    /// Every point shows its own colour.
    ChangedNothing,
    /// Some points show another than their own.
    Changed {
        /// How many, one entry each in the originals section; `None`: their colours are not kept.
        originals: Option<u64>,
    },
}

impl Averaging {
    /// What averaging that replaced the colours of `changed` points did, all of them kept or none.
    #[must_use]
    pub fn of(changed: u64, keeps_originals: bool) -> Self {
        match changed {
            0 => Self::ChangedNothing,
            n => Self::Changed { originals: keeps_originals.then_some(n) },
        }
    }

    /// Bytes of the originals section, if there is one.
    #[must_use]
    pub fn originals_bytes(self) -> Option<u64> {
        match self {
            Self::Changed { originals: Some(count) } => Some(8 + 8 * count),
            _ => None,
        }
    }

    fn flags(self) -> u32 {
        match self {
            Self::ChangedNothing => 0,
            Self::Changed { originals: None } => Flags::AVERAGED,
            Self::Changed { originals: Some(_) } => Flags::AVERAGED | Flags::ORIGINALS,
        }
    }
}

impl Layout {
    /// The layout of `points` points with these extra attributes and planes.
    ///
    /// # Errors
    /// [`WriteError::TooManyPoints`]; [`WriteError::Input`] for more than 256 attributes, two of the same name, or one with
    /// 0 or more than 256 elements.
    pub fn new(points: u64, attributes: &[Attribute], precision: Precision) -> Result<Self, WriteError> {
        if points > MAX_POINTS {
            return Err(WriteError::TooManyPoints(points));
        }
        if attributes.len() > AttributeEntry::MAX_ATTRIBUTES {
            return Err(WriteError::input(format!("{} attributes are too many; 256 are allowed", attributes.len())));
        }
        for (i, a) in attributes.iter().enumerate() {
            if a.elements == 0 || a.elements as u64 > AttributeEntry::MAX_ELEMENTS {
                return Err(WriteError::input(format!("attribute \"{}\" has {} elements", a.name, a.elements)));
            }
            if attributes[..i].iter().any(|b| b.name == a.name) {
                return Err(WriteError::input(format!("two attributes are named \"{}\"", a.name)));
            }
        }
        Ok(Self::place(points, attributes.to_vec(), precision))
    }

    fn place(points: u64, described: Vec<Attribute>, precision: Precision) -> Self {
        let mut end = HEADER_BYTES;
        let mut section = |bytes: u64| {
            let section = Section { offset: align(end), bytes };
            end = section.end();
            section
        };
        let (batches, count) = (batch_count(points), described.len());
        let (records, unplaced) = (section(32 * u64::from(batches)), Section { offset: 0, bytes: 0 });
        let (hi10, colour, attributes) = (unplaced, unplaced, vec![unplaced; count]);
        let mut layout = Self {
            points,
            batches,
            records,
            hi10,
            colour,
            attributes,
            mid10: None,
            lo10: None,
            originals: 0,
            described,
        };
        for part in Part::in_file_order(count, precision) {
            let placed = section(points * layout.bytes_per_point(part));
            match part {
                Part::Hi10 => layout.hi10 = placed,
                Part::Mid10 => layout.mid10 = Some(placed),
                Part::Lo10 => layout.lo10 = Some(placed),
                Part::Colour => layout.colour = placed,
                Part::Attribute(i) => layout.attributes[i] = placed,
            }
        }
        layout.originals = section(0).offset;
        layout
    }

    /// The sections with one entry per point, in the order of the file.
    ///
    /// ```
    /// use pointmill_format::batches::{Layout, Part, Precision};
    /// use pointmill_format::{Attribute, AttributeType};
    ///
    /// # fn main() -> Result<(), pointmill_format::WriteError> {
    /// let attributes = [Attribute::new("intensity", AttributeType::UInt16, 1)];
    /// let layout = Layout::new(1000, &attributes, Precision::Ten)?;
    /// let sections: Vec<_> = layout.sections().map(|s| (s.part, s.bytes_per_point, s.section.offset)).collect();
    /// assert_eq!(sections, [(Part::Hi10, 4, 512), (Part::Colour, 4, 4608), (Part::Attribute(0), 2, 8704)]);
    /// # Ok(())
    /// # }
    /// ```
    pub fn sections(&self) -> impl Iterator<Item = PointSection> + '_ {
        Part::in_file_order(self.described.len(), self.precision()).filter_map(|part| {
            let section = match part {
                Part::Hi10 => Some(self.hi10),
                Part::Mid10 => self.mid10,
                Part::Lo10 => self.lo10,
                Part::Colour => Some(self.colour),
                Part::Attribute(i) => self.attributes.get(i).copied(),
            };
            Some(PointSection { part, section: section?, bytes_per_point: self.bytes_per_point(part) })
        })
    }

    fn bytes_per_point(&self, part: Part) -> u64 {
        match part {
            Part::Attribute(i) => self.described.get(i).map_or(0, |a| a.size() as u64),
            _ => 4,
        }
    }

    /// The same file with other planes: what lies before mid10 stays where it is.
    #[must_use]
    pub fn with_precision(self, precision: Precision) -> Self {
        Self::place(self.points, self.described, precision)
    }

    /// The planes that have a place.
    pub fn precision(&self) -> Precision {
        match (self.mid10, self.lo10) {
            (None, _) => Precision::Ten,
            (_, None) => Precision::Twenty,
            _ => Precision::Thirty,
        }
    }

    /// The first byte behind the last section that has one entry per point.
    #[must_use]
    pub fn end_of_points(&self) -> u64 {
        self.sections().last().map_or(self.records, |last| last.section).end()
    }

    /// The slot of Morton batch `batch`, and the storage index of its first point.
    pub fn slot(&self, batch: u32) -> (u32, u32) {
        let slot = swap_slot(batch, self.batches);
        // N < 2^32: no slot begins behind it
        (slot, slot.saturating_mul(BATCH_POINTS))
    }

    /// Where the record of `slot` belongs.
    pub fn record_offset(&self, slot: u32) -> u64 {
        self.records.offset + 32 * u64::from(slot)
    }

    /// Where the entry of storage index `first_point` belongs, in a section with `size` bytes per point.
    pub fn point_offset(section: Section, size: u64, first_point: u32) -> u64 {
        section.offset + size * u64::from(first_point)
    }

    /// Header and description of the finished file, with batches swapped, levels and averaged colours.
    ///
    /// `tight`: the box of all points, world (empty for none). Of `description` this sets `attributes` (type, place; `min` and `max` of entries with the same name are kept) and
    /// leaves out `errors` of planes that are not there.
    ///
    /// # Errors
    /// [`WriteError::Input`] for a lattice that is not finite or not > 0, and numbers that JSON cannot hold.
    pub fn finish(
        &self,
        grid: &Grid,
        tight: &Aabb,
        averaging: Averaging,
        mut description: Description,
    ) -> Result<Finish, WriteError> {
        let given = std::mem::take(&mut description.attributes);
        description.attributes = self.entries(&given);
        description.errors = description.errors.up_to(self.precision());
        let text = description.to_json();
        if let Err(e) = Description::from_json(text.as_bytes(), "description".as_ref(), 0) {
            return Err(WriteError::input(format!("{}: not a number, infinite, or a scale that is not > 0", e.what())));
        }
        let originals = averaging.originals_bytes();
        let description_offset = align(originals.map_or(self.end_of_points(), |bytes| self.originals + bytes));
        let header = Header {
            points: self.points,
            batches: self.batches,
            grid: *grid,
            tight: if tight.is_empty() { Aabb { min: [0.0; 3], max: [0.0; 3] } } else { *tight },
            flags: Flags(Flags::SWAPPED | Flags::LOD | averaging.flags()),
            sections: Sections {
                batches: self.records.offset,
                hi10: self.hi10.offset,
                mid10: self.mid10.map(|s| s.offset),
                lo10: self.lo10.map(|s| s.offset),
                colour: self.colour.offset,
                originals: originals.map(|_| self.originals),
                description: description_offset,
            },
            description_bytes: text.len() as u64,
        };
        let header_bytes = header.encode();
        Ok(Finish { header, header_bytes, description, description_bytes: text.into_bytes(), description_offset })
    }

    fn entries(&self, given: &[AttributeEntry]) -> Vec<AttributeEntry> {
        let placed = self.described.iter().zip(&self.attributes);
        placed
            .map(|(attribute, section)| {
                let mut entry = AttributeEntry::new(attribute, section.offset, section.bytes);
                if let Some(given) = given.iter().find(|t| t.name == entry.name) {
                    entry.min.clone_from(&given.min);
                    entry.max.clone_from(&given.max);
                }
                entry
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AttributeType, Lattice};

    fn attributes() -> Vec<Attribute> {
        vec![Attribute::new("intensity", AttributeType::UInt16, 1), Attribute::new("normal", AttributeType::Float32, 3)]
    }

    #[test]
    fn sections_follow_each_other_at_multiples_of_256() {
        let layout = Layout::new(10_241, &attributes(), Precision::Thirty).unwrap();
        let (mid10, lo10) = (layout.mid10.unwrap(), layout.lo10.unwrap());
        let order =
            [layout.records, layout.hi10, layout.colour, layout.attributes[0], layout.attributes[1], mid10, lo10];
        assert_eq!(order.map(|s| s.bytes), [64, 40_964, 40_964, 20_482, 122_892, 40_964, 40_964]);
        let mut end = 256;
        for section in order {
            assert_eq!(section.offset, align(end));
            end = section.end();
        }
        assert_eq!((layout.end_of_points(), layout.originals), (end, align(end)));
    }

    #[test]
    fn planes_dropped_at_the_end_leave_everything_else_in_place() {
        let all = Layout::new(99, &attributes(), Precision::Thirty).unwrap();
        let one = all.clone().with_precision(Precision::Ten);
        assert_eq!(one, Layout::new(99, &attributes(), Precision::Ten).unwrap());
        assert_eq!((&one.attributes, one.hi10, one.colour), (&all.attributes, all.hi10, all.colour));
        assert_eq!(one.originals, all.mid10.unwrap().offset);
    }

    #[test]
    fn the_description_takes_the_place_of_originals_that_are_not_there() {
        let layout = Layout::new(99, &[], Precision::Ten).unwrap();
        let grid = Grid::new(&Aabb::EMPTY, 1.0).unwrap();
        let description = Description::new(Lattice { scale: [1.0; 3], offset: [0.0; 3] });
        let end = |averaging| layout.finish(&grid, &Aabb::EMPTY, averaging, description.clone()).unwrap().header;
        for (changed, keeps, flags, bytes) in
            [(0, true, 3, None), (0, false, 3, None), (5, false, 7, None), (5, true, 15, Some(48))]
        {
            let header = end(Averaging::of(changed, keeps));
            assert_eq!((header.flags.0, header.sections.originals), (flags, bytes.map(|_| layout.originals)));
            assert_eq!(header.sections.description, align(layout.originals + bytes.unwrap_or(0)));
        }
    }

    #[test]
    fn requests_that_do_not_fit_are_refused() {
        assert!(matches!(Layout::new(1 << 32, &[], Precision::Ten), Err(WriteError::TooManyPoints(_))));
        assert!(Layout::new((1 << 32) - 1, &attributes(), Precision::Thirty).is_ok());
        let twice = [attributes(), attributes()].concat();
        assert!(matches!(Layout::new(1, &twice, Precision::Ten), Err(WriteError::Input(_))));
        let mut none = attributes();
        none[0].elements = 0;
        assert!(matches!(Layout::new(1, &none, Precision::Ten), Err(WriteError::Input(_))));
    }

    #[test]
    fn numbers_that_json_cannot_hold_are_refused() {
        let layout = Layout::new(0, &[], Precision::Ten).unwrap();
        let grid = Grid::new(&Aabb::EMPTY, 1.0).unwrap();
        let mut description = Description::new(Lattice { scale: [1.0; 3], offset: [0.0; 3] });
        let unchanged = Averaging::ChangedNothing;
        assert!(layout.finish(&grid, &Aabb::EMPTY, unchanged, description.clone()).is_ok());
        description.source_step[1] = f64::NAN;
        assert!(matches!(layout.finish(&grid, &Aabb::EMPTY, unchanged, description), Err(WriteError::Input(_))));
    }
}

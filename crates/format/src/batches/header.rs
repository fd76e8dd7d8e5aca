//! The header: 256 bytes (`docs/formats/batches.md`, §1.2).

use std::path::Path;

use crate::{Aabb, ReadError};

use super::{BATCH_POINTS, Grid, HEADER_BYTES, MAGIC, MAX_POINTS, Precision, VERSION, batch_count};

/// What the file promises of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Flags(pub u32);

impl Flags {
    /// Every second batch has changed places with its mirror.
    pub const SWAPPED: u32 = 1;
    /// Colour words carry levels of detail.
    pub const LOD: u32 = 2;
    /// Points of the levels 0–2 show the mean colour of their cells.
    pub const AVERAGED: u32 = 4;
    /// There is a section with the colours before averaging.
    pub const ORIGINALS: u32 = 8;
    /// Sections are blocks of zstd.
    pub const COMPRESSED: u32 = 16;
    const ALL: u32 = 31;

    /// True if all bits of `flag` are set.
    pub const fn has(self, flag: u32) -> bool {
        self.0 & flag == flag
    }
}

/// Where sections begin, in bytes from the start of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)] // the names say it
#[non_exhaustive]
pub struct Sections {
    pub batches: u64,
    pub hi10: u64,
    pub mid10: Option<u64>,
    pub lo10: Option<u64>,
    pub colour: u64,
    pub originals: Option<u64>,
    pub description: u64,
}

/// The contents of the header.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Header {
    /// N, at most [`MAX_POINTS`].
    pub points: u64,
    /// B = ceil(N / 10240).
    pub batches: u32,
    /// Origin, cell, Morton bits.
    pub grid: Grid,
    /// The box of all points, world coordinates; 0 to 0 without points.
    pub tight: Aabb,
    /// What the file promises of itself.
    pub flags: Flags,
    /// Where sections begin.
    pub sections: Sections,
    /// Length of the description, in bytes.
    pub description_bytes: u64,
}

impl Header {
    /// The planes that are in the file.
    pub fn precision(&self) -> Precision {
        match (self.sections.mid10, self.sections.lo10) {
            (None, _) => Precision::Ten,
            (_, None) => Precision::Twenty,
            _ => Precision::Thirty,
        }
    }

    /// The 256 bytes.
    #[must_use]
    pub fn encode(&self) -> [u8; HEADER_BYTES as usize] {
        let mut bytes = [0; HEADER_BYTES as usize];
        let mut at = 0;
        let mut put = |field: &[u8]| {
            bytes[at..at + field.len()].copy_from_slice(field);
            at += field.len();
        };
        put(&MAGIC);
        put(&VERSION.to_le_bytes());
        put(&(HEADER_BYTES as u32).to_le_bytes());
        put(&self.points.to_le_bytes());
        put(&BATCH_POINTS.to_le_bytes());
        put(&self.batches.to_le_bytes());
        let doubles = [self.grid.origin, self.tight.min, self.tight.max];
        doubles.as_flattened().iter().for_each(|v| put(&v.to_le_bytes()));
        put(&self.grid.cell.to_le_bytes());
        put(&self.flags.0.to_le_bytes());
        put(&self.grid.morton_bits.to_le_bytes());
        let s = &self.sections;
        let absent = |offset: Option<u64>| offset.unwrap_or(0);
        for offset in [s.batches, s.hi10, absent(s.mid10), absent(s.lo10), s.colour, absent(s.originals)] {
            put(&offset.to_le_bytes());
        }
        put(&s.description.to_le_bytes());
        put(&self.description_bytes.to_le_bytes());
        put(&self.grid.exponent.to_le_bytes());
        bytes
    }

    /// Reads the header at the start of `bytes`; `path` is for messages. Section offsets are not compared with the file
    /// here: [`super::Batches`] does that.
    ///
    /// # Errors
    /// Another magic, fields that are out of range or contradict each other; [`crate::ErrorKind::Unsupported`] for
    /// another version, batch size or unknown flags.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, ReadError> {
        let broken = |at: usize, what: String| ReadError::broken(path, at as u64, what);
        if !bytes.starts_with(&MAGIC) {
            let what = format!("does not begin with \"{}\"", String::from_utf8_lossy(&MAGIC));
            return Err(broken(0, what).advise("a file of quantised batches is named points.qbatch"));
        }
        let Some(bytes) = bytes.first_chunk::<{ HEADER_BYTES as usize }>() else {
            let what = format!("has {} bytes, the header alone takes {HEADER_BYTES}", bytes.len());
            return Err(broken(bytes.len(), what).advise("the file was cut short; copy or convert it again"));
        };
        let fields = Fields(bytes);
        for (at, name, supported) in
            [(8, "version", VERSION), (12, "header size", HEADER_BYTES as u32), (24, "batch size", BATCH_POINTS)]
        {
            let found = fields.u32(at);
            if found != supported {
                let what = format!("{name} {found} (byte {at}); this version of pointmill reads {supported}");
                return Err(ReadError::unsupported(path, what).advise("use a newer version of pointmill"));
            }
        }
        let header = fields.header();
        if header.flags.0 & !Flags::ALL != 0 {
            let what = format!("flags {:#x} (byte 112) are not all known", header.flags.0);
            return Err(ReadError::unsupported(path, what).advise("use a newer version of pointmill"));
        }
        header.contradiction().map_or(Ok(()), |(at, what)| Err(broken(at, what).advise(CORRUPT)))?;
        Ok(header)
    }

    /// The first field that breaks a promise: where, and what.
    fn contradiction(&self) -> Option<(usize, String)> {
        let Self { points, batches, grid, tight, flags, sections, .. } = self;
        if *points > MAX_POINTS {
            return Some((16, format!("{points} points are more than the {MAX_POINTS} that the format allows")));
        }
        if *batches != batch_count(*points) {
            return Some((28, format!("{batches} batches, but {points} points make {}", batch_count(*points))));
        }
        if !grid.origin.iter().all(|v| v.is_finite()) {
            return Some((32, format!("origin {:?} is not finite", grid.origin)));
        }
        let finite = tight.min.iter().chain(&tight.max).all(|v| v.is_finite());
        if !finite || tight.is_empty() {
            return Some((56, format!("the box {:?} to {:?} is not finite or inverted", tight.min, tight.max)));
        }
        if (0..3).any(|a| tight.min[a] < grid.origin[a]) {
            return Some((32, format!("origin {:?} lies above the box's min {:?}", grid.origin, tight.min)));
        }
        if !(grid.cell.is_finite() && grid.cell > 0.0) {
            return Some((104, format!("the cell of level 0 is {}; it has to be greater than 0", grid.cell)));
        }
        if !grid.is_valid() {
            let (bits, e) = (grid.morton_bits, grid.exponent);
            return Some((116, format!("{bits} Morton bits do not go with a cube of 2^{e} cells (byte 184)")));
        }
        if sections.lo10.is_some() && sections.mid10.is_none() {
            return Some((144, "there is a plane lo10 but no mid10".into()));
        }
        if flags.has(Flags::ORIGINALS) != sections.originals.is_some() {
            return Some((160, "flag 8 and the offset of the originals contradict each other".into()));
        }
        let needs = |flag, needed| flags.has(flag) && !flags.has(needed);
        if needs(Flags::AVERAGED, Flags::LOD) || needs(Flags::ORIGINALS, Flags::AVERAGED) {
            return Some((112, format!("flags {:#x} contradict each other: 8 needs 4, and 4 needs 2", flags.0)));
        }
        None
    }
}

/// What to do about a file that contradicts itself.
pub(crate) const CORRUPT: &str = "the file is damaged; copy or convert it again";

/// The fields at their places; the places are constants within 256 bytes.
struct Fields<'a>(&'a [u8; HEADER_BYTES as usize]);

impl Fields<'_> {
    fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        self.0[at..].first_chunk().copied().unwrap_or([0; N])
    }

    fn u32(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.bytes(at))
    }

    fn u64(&self, at: usize) -> u64 {
        u64::from_le_bytes(self.bytes(at))
    }

    fn vector(&self, at: usize) -> [f64; 3] {
        std::array::from_fn(|a| f64::from_le_bytes(self.bytes(at + 8 * a)))
    }

    fn section(&self, at: usize) -> Option<u64> {
        Some(self.u64(at)).filter(|offset| *offset != 0)
    }

    fn header(&self) -> Header {
        Header {
            points: self.u64(16),
            batches: self.u32(28),
            grid: Grid {
                origin: self.vector(32),
                cell: f64::from_le_bytes(self.bytes(104)),
                exponent: self.u32(184),
                morton_bits: self.u32(116),
            },
            tight: Aabb { min: self.vector(56), max: self.vector(80) },
            flags: Flags(self.u32(112)),
            sections: Sections {
                batches: self.u64(120),
                hi10: self.u64(128),
                mid10: self.section(136),
                lo10: self.section(144),
                colour: self.u64(152),
                originals: self.section(160),
                description: self.u64(168),
            },
            description_bytes: self.u64(176),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        Header {
            points: 10_241,
            batches: 2,
            grid: Grid { origin: [1.0, -2.0, 3.0], cell: 0.5, exponent: 20, morton_bits: 32 },
            tight: Aabb { min: [1.5, -1.5, 3.5], max: [9.0; 3] },
            flags: Flags(15),
            sections: Sections {
                batches: 256,
                hi10: 512,
                mid10: Some(1024),
                lo10: Some(2048),
                colour: 4096,
                originals: Some(8192),
                description: 16_384,
            },
            description_bytes: 99,
        }
    }

    #[test]
    fn parsing_undoes_encoding() {
        assert_eq!(Header::parse(&header().encode(), Path::new("a")).unwrap(), header());
    }

    #[test]
    fn every_contradiction_is_refused_with_the_byte_that_holds_it() {
        type Change = (fn(&mut Header), &'static str);
        let changes: [Change; 12] = [
            (|h| h.points = 1 << 32, "(byte 16)"),
            (|h| h.batches = 3, "(byte 28)"),
            (|h| h.grid.origin[1] = f64::NAN, "(byte 32)"),
            (|h| h.grid.origin[2] = 4.0, "(byte 32)"),
            (|h| h.tight.min[0] = 9.5, "(byte 56)"),
            (|h| h.tight.max[2] = f64::INFINITY, "(byte 56)"),
            (|h| h.grid.cell = 0.0, "(byte 104)"),
            (|h| h.grid.morton_bits = 21, "(byte 116)"),
            (|h| h.grid.exponent = 31, "(byte 116)"),
            (|h| h.sections.mid10 = None, "(byte 144)"),
            (|h| h.flags = Flags(7), "(byte 160)"),
            (|h| h.flags = Flags(9), "(byte 112)"),
        ];
        for (change, place) in changes {
            let mut changed = header();
            change(&mut changed);
            let error = Header::parse(&changed.encode(), Path::new("a")).unwrap_err().to_string();
            assert!(error.contains(place) && error.contains("; "), "{error}");
        }
    }

    #[test]
    fn other_versions_and_flags_are_not_taken_for_damage() {
        for (at, value) in [(8, 2), (12, 255), (24, 1), (113, 1)] {
            let mut bytes = header().encode();
            bytes[at] = value;
            let error = Header::parse(&bytes, Path::new("a")).unwrap_err();
            assert!(matches!(error.kind(), crate::ErrorKind::Unsupported), "{error}");
        }
    }

    #[test]
    fn files_that_are_none_or_too_short_say_so() {
        let bytes = header().encode();
        for (bytes, part) in [(&bytes[..0], "QBATCHES"), (&bytes[..255], "255 bytes"), (b"LASF", "QBATCHES")] {
            let error = Header::parse(bytes, Path::new("a")).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}

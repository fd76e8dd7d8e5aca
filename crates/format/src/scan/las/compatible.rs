//! LASzip's compatibility mode (record `lascompatible` 22204): points of formats 6–10 for programs that know 0–5.
//!
//! The points are stored in format 1, 3, 4 or 5. What these cannot hold stands in five (with near infrared: seven) extra
//! bytes under reserved names, as what is to be added to the old fields: LASzip clamps a class above 31 to 0 and keeps
//! the class itself in the extra bytes, and keeps for a return above 7 how many are missing. The record holds the part
//! of a LAS 1.4 header that older headers lack.

use super::bytes::{u16_at, u64_at};
use super::extra_bytes::ExtraBytes;
use super::header::Header;
use super::records::Records;
use crate::{Attribute, AttributeType, ScanWarning};

/// The reserved names, with the types under which LASzip stores them.
const SCAN_ANGLE: (&str, AttributeType) = ("LAS 1.4 scan angle", AttributeType::Int16);
const RETURNS: (&str, AttributeType) = ("LAS 1.4 extended returns", AttributeType::UInt8);
const CLASS: (&str, AttributeType) = ("LAS 1.4 classification", AttributeType::UInt8);
const FLAGS: (&str, AttributeType) = ("LAS 1.4 flags and channel", AttributeType::UInt8);
const NIR: (&str, AttributeType) = ("LAS 1.4 NIR band", AttributeType::UInt16);

/// Versions of the record: for LAS 1.4 and 1.5.
const VERSIONS: std::ops::RangeInclusive<u16> = 3..=4;
/// Where the record holds the number of points: behind the version, the place of waveforms, and the place and number of
/// EVLRs.
const POINT_COUNT_AT: usize = 28;

/// Where the fields of formats 6–10 are in a record of format 1, 3, 4 or 5; bytes from its start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Compatible {
    /// To be added to the scan angle rank in steps of 0.006°.
    pub(super) scan_angle: usize,
    /// To be added to the number of the return (upper four bits) and to the number of returns (lower four).
    pub(super) returns: usize,
    /// To be added to the class.
    pub(super) class: usize,
    /// Bit 0: the fourth classification flag; bits 1 and 2: the scanner channel.
    pub(super) flags: usize,
    /// Near infrared.
    pub(super) nir: Option<usize>,
}

impl Compatible {
    /// Takes the reserved attributes out of `extra`, if the file is in compatibility mode and has them all.
    pub(super) fn take(
        header: &Header,
        records: &Records,
        extra: &mut Vec<ExtraBytes>,
        warnings: &mut Vec<ScanWarning>,
    ) -> Option<Self> {
        let record = records.find(USER_ID, RECORD_ID)?;
        let version = u16_at(&record.data, 2);
        let place = |(name, ty): (&str, AttributeType)| {
            let is_it = |a: &Attribute| a.name == name && a.ty == ty && a.elements == 1;
            extra.iter().find(|e| is_it(&e.attribute)).map(|e| e.at)
        };
        let places = [SCAN_ANGLE, RETURNS, CLASS, FLAGS].map(place);
        let nir = place(NIR);
        let knows = VERSIONS.contains(&version) && matches!(header.point_format, 1 | 3 | 4 | 5);
        let (true, [Some(scan_angle), Some(returns), Some(class), Some(flags)]) = (knows, places) else {
            warnings.push(ScanWarning::CompatibilityIgnored { version, point_format: header.point_format });
            return None;
        };
        let out = Self { scan_angle, returns, class, flags, nir };
        extra.retain(|e| ![Some(scan_angle), Some(returns), Some(class), Some(flags), nir].contains(&Some(e.at)));
        Some(out)
    }

    /// The point format that is stored in `stored`.
    pub(super) fn point_format(&self, stored: u8) -> u8 {
        match (stored, self.nir) {
            (1, _) => 6,
            (3, None) => 7,
            (3, Some(_)) => 8,
            (4, _) => 9,
            _ => 10,
        }
    }
}

/// Identity of the record.
pub(super) const USER_ID: &str = "lascompatible";
pub(super) const RECORD_ID: u16 = 22204;

/// The number of points of the LAS 1.4 header that the record holds; 0 if it has none.
pub(super) fn point_count(records: &Records) -> u64 {
    records.find(USER_ID, RECORD_ID).map_or(0, |record| u64_at(&record.data, POINT_COUNT_AT))
}

/// A field of formats 6–10 that is the sum of an old one and an extra byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Recovered {
    ReturnNumber,
    NumberOfReturns,
    ClassificationFlags,
    Classification,
    ScanAngle,
}

impl Recovered {
    /// The byte of the old field, in formats 0–5.
    const fn old(self) -> usize {
        match self {
            Self::ReturnNumber | Self::NumberOfReturns => 14,
            Self::ClassificationFlags | Self::Classification => 15,
            Self::ScanAngle => 16,
        }
    }

    /// The value of a `uint8` field; `extra`: the byte that belongs to it. Sums beyond the field wrap, as LASzip's do.
    fn byte(self, record: &[u8], extra: usize) -> u8 {
        let (old, extra) = (record[self.old()], record[extra]);
        match self {
            Self::ReturnNumber => ((old & 7) + (extra >> 4)) & 15,
            Self::NumberOfReturns => ((old >> 3 & 7) + (extra & 15)) & 15,
            Self::ClassificationFlags => old >> 5 | (extra & 1) << 3,
            Self::Classification => (old & 31).wrapping_add(extra),
            Self::ScanAngle => 0,
        }
    }

    /// Fills `out` from whole records of `len` bytes.
    pub(super) fn fill_bytes(self, block: &[u8], len: usize, extra: usize, out: &mut [u8]) {
        for (value, record) in out.iter_mut().zip(block.chunks_exact(len)) {
            *value = self.byte(record, extra);
        }
    }

    /// Fills `out` with scan angles from whole records of `len` bytes.
    pub(super) fn fill_angles(block: &[u8], len: usize, extra: usize, out: &mut [i16]) {
        for (value, record) in out.iter_mut().zip(block.chunks_exact(len)) {
            let rank = record[Self::ScanAngle.old()].cast_signed();
            *value = angle_of_rank(rank).wrapping_add(u16_at(record, extra).cast_signed());
        }
    }
}

/// Whole degrees in steps of 0.006°, rounded as LASzip does, in single precision: what was left of this was stored.
pub(super) fn angle_of_rank(rank: i8) -> i16 {
    let steps = f32::from(rank) / 0.006;
    (if steps >= 0.0 { steps + 0.5 } else { steps - 0.5 }) as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A record of format 1 with return byte, class byte, rank, and extra bytes from 28 on: angle, returns, class, flags.
    fn record(returns: u8, class: u8, rank: i8, angle: i16, extra: [u8; 3]) -> Vec<u8> {
        let mut out = vec![0; 33];
        (out[14], out[15], out[16]) = (returns, class, rank.cast_unsigned());
        out[28..30].copy_from_slice(&angle.to_le_bytes());
        out[30..].copy_from_slice(&extra);
        out
    }

    fn read(record: &[u8]) -> (u8, u8, u8, u8, i16) {
        let byte = |what: Recovered, extra| what.byte(record, extra);
        let mut angle = [0];
        Recovered::fill_angles(record, record.len(), 28, &mut angle);
        let (number, of) = (byte(Recovered::ReturnNumber, 30), byte(Recovered::NumberOfReturns, 30));
        (number, of, byte(Recovered::Classification, 31), byte(Recovered::ClassificationFlags, 32), angle[0])
    }

    #[test]
    fn fields_are_sums_of_the_old_ones_and_what_was_left() {
        // 9 of 12 is stored as 4 of 7 with 5 and 5 to add; class 64 as 0 with 64
        let sums = record(4 | 7 << 3, 0, 127, 30_000 - 21_167, [5 << 4 | 5, 64, 0b111]);
        assert_eq!(read(&sums), (9, 12, 64, 8, 30_000));
        let old = record(3 | 5 << 3, 31 | 0b101 << 5, 15, 1, [0, 0, 0]);
        assert_eq!(read(&old), (3, 5, 31, 0b101, 2501));
        assert_eq!(read(&record(7 | 7 << 3, 1, -128, -8667, [0x88, 0xff, 1])), (15, 15, 0, 8, -30_000));
    }

    #[test]
    fn ranks_are_rounded_in_single_precision() {
        assert_eq!([0, 1, -1, 3, 90, -90].map(angle_of_rank), [0, 167, -167, 500, 15_000, -15_000]);
    }
}

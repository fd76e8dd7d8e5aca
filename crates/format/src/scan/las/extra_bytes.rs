//! The Extra Bytes record: LASF_Spec 4, one descriptor of 192 bytes per attribute (LAS 1.4 R15 §2.6, table 24).

use super::bytes::{f64_at, i64_at, text, u64_at};
use super::header::Header;
use super::records::Records;
use crate::{Attribute, AttributeType, ScanWarning};

const DESCRIPTOR: usize = 192;

/// A documented attribute behind the standard fields.
#[derive(Debug)]
pub(super) struct ExtraBytes {
    /// Named as the file names it: perhaps empty, perhaps not unique.
    pub(super) attribute: Attribute,
    /// Bytes from the start of the record.
    pub(super) at: usize,
}

impl ExtraBytes {
    /// The attributes that fit the record; whatever remains undocumented becomes a line in `warnings`.
    pub(super) fn read_all(header: &Header, records: &Records, warnings: &mut Vec<ScanWarning>) -> Vec<Self> {
        let mut at = header.format_len();
        let mut found = Vec::new();
        if records.kept.iter().filter(|r| r.is("LASF_Spec", 4)).count() > 1 {
            warnings.push(ScanWarning::ExtraBytesRecords);
        }
        let data = records.find("LASF_Spec", 4).map_or(&[][..], |r| &r.data);
        if !data.len().is_multiple_of(DESCRIPTOR) {
            warnings.push(ScanWarning::ExtraBytesLength { bytes: data.len(), descriptor: DESCRIPTOR });
        }
        for descriptor in data.chunks_exact(DESCRIPTOR) {
            let name = text(&descriptor[4..36]);
            let Some(len) = byte_len(descriptor).filter(|len| at + len <= header.record_len) else {
                let (data_type, record_len) = (descriptor[2], header.record_len);
                warnings.push(ScanWarning::ExtraBytesOutside { name, data_type, record_len });
                break;
            };
            match attribute(name, descriptor, warnings) {
                Some(attribute) => found.push(Self { attribute, at }),
                None => warnings.push(ScanWarning::ExtraBytesUntyped { bytes: len, at }),
            }
            at += len;
        }
        if at < header.record_len {
            warnings.push(ScanWarning::ExtraBytesUndocumented { bytes: header.record_len - at });
        }
        found
    }
}

/// Bytes a point: `None` for a type that does not exist.
fn byte_len(descriptor: &[u8]) -> Option<usize> {
    match descriptor[2] {
        // no type: the options byte holds the length
        0 => Some(usize::from(descriptor[3])),
        data_type => scalar_type(data_type).map(|(ty, elements)| ty.size() * elements),
    }
}

/// Types 1–10 are scalars; 11–20 and 21–30, deprecated since LAS 1.4 R14, are pairs and triples of the same.
fn scalar_type(data_type: u8) -> Option<(AttributeType, usize)> {
    let ty = match data_type.checked_sub(1)? % 10 {
        0 => AttributeType::UInt8,
        1 => AttributeType::Int8,
        2 => AttributeType::UInt16,
        3 => AttributeType::Int16,
        4 => AttributeType::UInt32,
        5 => AttributeType::Int32,
        6 => AttributeType::UInt64,
        7 => AttributeType::Int64,
        8 => AttributeType::Float32,
        _ => AttributeType::Float64,
    };
    (data_type <= 30).then_some((ty, usize::from((data_type - 1) / 10) + 1))
}

fn attribute(name: String, descriptor: &[u8], warnings: &mut Vec<ScanWarning>) -> Option<Attribute> {
    let (ty, elements) = scalar_type(descriptor[2])?;
    let has = |bit: u8| descriptor[3] >> bit & 1 == 1;
    let doubles = |at: usize| (0..elements).map(|e| f64_at(descriptor, at + 8 * e)).collect::<Vec<_>>();
    let mut out = Attribute::new(name, ty, elements);
    out.description = text(&descriptor[160..192]);
    if has(0) {
        out.no_data = Some((0..elements).map(|e| any_type(ty, descriptor, 40 + 8 * e)).collect());
    }
    if has(3) {
        let scale = doubles(112);
        if scale.iter().all(|s| s.is_finite() && *s != 0.0) {
            out.scale = scale;
        } else {
            warnings.push(ScanWarning::ExtraBytesScale { name: out.name.clone(), scale });
        }
    }
    if has(4) {
        let offset = doubles(136);
        if offset.iter().all(|o| o.is_finite()) {
            out.offset = offset;
        } else {
            warnings.push(ScanWarning::ExtraBytesOffset { name: out.name.clone(), offset });
        }
    }
    Some(out)
}

/// An 8-byte field that holds a value of `ty`'s family: unsigned, signed or double.
fn any_type(ty: AttributeType, bytes: &[u8], at: usize) -> f64 {
    use AttributeType as T;
    match ty {
        T::UInt8 | T::UInt16 | T::UInt32 | T::UInt64 => u64_at(bytes, at) as f64,
        T::Int8 | T::Int16 | T::Int32 | T::Int64 => i64_at(bytes, at) as f64,
        T::Float32 | T::Float64 => f64_at(bytes, at),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn descriptor(data_type: u8, options: u8, name: &[u8]) -> Vec<u8> {
        let mut d = vec![0; DESCRIPTOR];
        d[2] = data_type;
        d[3] = options;
        d[4..4 + name.len()].copy_from_slice(name);
        d
    }

    #[test]
    fn array_types_have_two_and_three_elements() {
        assert_eq!(scalar_type(1), Some((AttributeType::UInt8, 1)));
        assert_eq!(scalar_type(14), Some((AttributeType::Int16, 2)));
        assert_eq!(scalar_type(30), Some((AttributeType::Float64, 3)));
        assert_eq!(scalar_type(31), None);
        assert_eq!(byte_len(&descriptor(23, 0, b"")), Some(6));
        assert_eq!(byte_len(&descriptor(0, 7, b"")), Some(7));
    }

    #[test]
    fn no_data_is_read_in_the_family_of_the_type() {
        let mut d = descriptor(4, 1, b"depth");
        d[40..48].copy_from_slice(&(-9999i64).to_le_bytes());
        let a = attribute("depth".to_owned(), &d, &mut Vec::new()).unwrap();
        assert_eq!(a.no_data, Some(vec![-9999.0]));
    }

    #[test]
    fn a_scale_of_zero_is_replaced_and_told() {
        let mut warnings = Vec::new();
        let a = attribute("a".to_owned(), &descriptor(5, 1 << 3, b"a"), &mut warnings).unwrap();
        assert_eq!((a.scale, warnings.len()), (vec![1.0], 1));
    }
}

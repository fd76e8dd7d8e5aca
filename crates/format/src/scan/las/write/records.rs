//! Variable length records.

use crate::{Attribute, AttributeType, WriteError};

/// Bytes of a description of extra bytes.
const DESCRIPTION: usize = 192;

/// Bytes of the name of extra bytes.
pub(super) const MAX_NAME: usize = 32;

/// Bytes of the header of an extended record.
pub(crate) const EXTENDED_HEADER: u64 = 60;

/// Appends a record with its header of 54 bytes.
pub(crate) fn append(out: &mut Vec<u8>, user: &str, number: u16, data: &[u8]) -> Result<(), WriteError> {
    let Ok(len) = u16::try_from(data.len()) else {
        return Err(WriteError::input(format!(
            "a record of {} bytes ({user} {number}); it can have 65535",
            data.len()
        )));
    };
    out.extend([0; 2]);
    out.extend(fixed::<16>(user));
    out.extend(number.to_le_bytes());
    out.extend(len.to_le_bytes());
    out.extend([0; 32]);
    out.extend(data);
    Ok(())
}

/// Appends the header, of 60 bytes, of an extended record with `len` bytes of data.
pub(crate) fn append_extended(out: &mut Vec<u8>, user: &str, number: u16, len: u64) {
    out.extend([0; 2]);
    out.extend(fixed::<16>(user));
    out.extend(number.to_le_bytes());
    out.extend(len.to_le_bytes());
    out.extend([0; 32]);
}

/// The data of the LASzip record: chunks that each have their own number of points; of layers in the formats 6 and above.
pub(crate) fn laszip(point_format: u8, extra_bytes: u16) -> Vec<u8> {
    const TIME: (u16, u16) = (7, 8);
    const COLOUR: (u16, u16) = (8, 6);
    let mut items: Vec<(u16, u16)> = match point_format {
        0 => vec![(6, 20)],
        1 => vec![(6, 20), TIME],
        2 => vec![(6, 20), COLOUR],
        3 => vec![(6, 20), TIME, COLOUR],
        7 => vec![(10, 30), (11, 6)],
        8 => vec![(10, 30), (12, 8)],
        _ => vec![(10, 30)],
    };
    // compressor, version of the items, number of the item of extra bytes
    let (compressor, version, bytes) = if point_format < 6 { (2u16, 2u16, 0) } else { (3, 3, 14) };
    if extra_bytes > 0 {
        items.push((bytes, extra_bytes));
    }
    let mut out = Vec::new();
    out.extend([compressor, 0].map(u16::to_le_bytes).concat()); // compressor, coder
    out.extend([3, 4, 0, 0]); // version 3.4, revision
    out.extend([0, u32::MAX].map(u32::to_le_bytes).concat()); // options, points of a chunk
    out.extend([-1i64; 2].map(i64::to_le_bytes).concat()); // special records: none
    out.extend((items.len() as u16).to_le_bytes());
    for (kind, size) in items {
        out.extend([kind, size, version].map(u16::to_le_bytes).concat());
    }
    out
}

/// The data of the record that describes extra bytes.
///
/// # Errors
/// An attribute of more than three elements; a name of more than 32 bytes.
pub(crate) fn extra_bytes(attributes: &[Attribute]) -> Result<Vec<u8>, WriteError> {
    let mut out = Vec::with_capacity(DESCRIPTION * attributes.len());
    for attribute in attributes {
        out.extend(description(attribute)?);
    }
    Ok(out)
}

fn description(attribute: &Attribute) -> Result<[u8; DESCRIPTION], WriteError> {
    let Attribute { name, description, ty, elements, scale, offset, no_data, .. } = attribute;
    if !(1..=3).contains(elements) || name.len() > MAX_NAME {
        let what =
            format!("the attribute {name:?} of {elements} elements; extra bytes have three, and names of 32 bytes");
        return Err(WriteError::input(what));
    }
    let mut out = [0; DESCRIPTION];
    out[2] = type_number(*ty) + 10 * (*elements as u8 - 1);
    out[4..36].copy_from_slice(&fixed::<32>(name));
    let is_scaled = scale.iter().any(|s| *s != 1.0) || offset.iter().any(|o| *o != 0.0);
    if is_scaled {
        out[3] |= 1 << 3 | 1 << 4;
        put_doubles(&mut out, 112, scale);
        put_doubles(&mut out, 136, offset);
    }
    if let Some(no_data) = no_data {
        out[3] |= 1;
        for (element, value) in no_data.iter().enumerate().take(3) {
            let at = 40 + 8 * element;
            out[at..at + 8].copy_from_slice(&any_type(*ty, *value));
        }
    }
    out[160..].copy_from_slice(&fixed::<32>(description));
    Ok(out)
}

/// The number of a type with one element.
const fn type_number(ty: AttributeType) -> u8 {
    match ty {
        AttributeType::UInt8 => 1,
        AttributeType::Int8 => 2,
        AttributeType::UInt16 => 3,
        AttributeType::Int16 => 4,
        AttributeType::UInt32 => 5,
        AttributeType::Int32 => 6,
        AttributeType::UInt64 => 7,
        AttributeType::Int64 => 8,
        AttributeType::Float32 => 9,
        AttributeType::Float64 => 10,
    }
}

fn put_doubles(out: &mut [u8], at: usize, values: &[f64]) {
    for (element, value) in values.iter().enumerate().take(3) {
        out[at + 8 * element..at + 8 * element + 8].copy_from_slice(&value.to_le_bytes());
    }
}

/// A field of 8 bytes that holds a value of the type's family: unsigned, signed or double.
fn any_type(ty: AttributeType, value: f64) -> [u8; 8] {
    use AttributeType as T;
    match ty {
        T::UInt8 | T::UInt16 | T::UInt32 | T::UInt64 => (value as u64).to_le_bytes(),
        T::Int8 | T::Int16 | T::Int32 | T::Int64 => (value as i64).to_le_bytes(),
        T::Float32 | T::Float64 => value.to_le_bytes(),
    }
}

/// Text in a field of that many bytes: cut at a character if it is longer.
pub(crate) fn fixed<const N: usize>(text: &str) -> [u8; N] {
    let mut out = [0; N];
    let cut = cut_name(text, N).as_bytes();
    out[..cut.len()].copy_from_slice(cut);
    out
}

/// So much of a text as fits `most` bytes.
pub(super) fn cut_name(text: &str, most: usize) -> &str {
    let end = (0..=text.len().min(most)).rev().find(|end| text.is_char_boundary(*end)).unwrap_or(0);
    &text[..end]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_laszip_record_is_that_of_the_crate_laz() {
        for (format, extra) in [(0, 0), (1, 0), (2, 4), (3, 7), (6, 0), (7, 0), (8, 0), (7, 5)] {
            let builder = laz::LazVlrBuilder::default().with_point_format(format, extra).unwrap();
            let mut theirs = Vec::new();
            builder.with_variable_chunk_size().build().write_to(&mut theirs).unwrap();
            let ours = laszip(format, extra);
            assert_eq!(ours[..4], theirs[..4]);
            // they call themselves another version
            assert_eq!(ours[8..], theirs[8..], "{format}, {extra}");
        }
    }

    #[test]
    fn text_is_cut_at_a_character() {
        assert_eq!(&fixed::<4>("abäc"), b"ab\xc3\xa4");
        assert_eq!(&fixed::<3>("abäc"), b"ab\0");
        assert_eq!(&fixed::<2>(""), b"\0\0");
    }
}

//! Numbers in stored records.

use pointmill_format::AttributeType;

/// A little-endian number of any type.
pub(super) fn number(bytes: &[u8], ty: AttributeType) -> f64 {
    fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
        bytes.first_chunk().copied().unwrap_or([0; N])
    }
    match ty {
        AttributeType::Int8 => f64::from(i8::from_le_bytes(array(bytes))),
        AttributeType::UInt8 => f64::from(u8::from_le_bytes(array(bytes))),
        AttributeType::Int16 => f64::from(i16::from_le_bytes(array(bytes))),
        AttributeType::UInt16 => f64::from(u16::from_le_bytes(array(bytes))),
        AttributeType::Int32 => f64::from(i32::from_le_bytes(array(bytes))),
        AttributeType::UInt32 => f64::from(u32::from_le_bytes(array(bytes))),
        AttributeType::Int64 => i64::from_le_bytes(array(bytes)) as f64,
        AttributeType::UInt64 => u64::from_le_bytes(array(bytes)) as f64,
        AttributeType::Float32 => f64::from(f32::from_le_bytes(array(bytes))),
        AttributeType::Float64 => f64::from_le_bytes(array(bytes)),
    }
}

//! Records back from the store, with colours of the depth that the output has.

use super::{Segment, Store};
use crate::build::chunk::Accounts;
use crate::error::ConvertError;

/// Appends the records of a segment to `records`. `widen_rgb`: for each source the byte offset of a colour that is 8 bits
/// deep and becomes 16.
pub(crate) fn load(
    store: &Store,
    stride: usize,
    widen_rgb: &[Option<usize>],
    segment: Segment,
    records: &mut Vec<u8>,
    accounts: &mut Accounts,
) -> Result<(), ConvertError> {
    let start = records.len();
    let source = store.take(segment, records)?;
    if let Some(rgb) = widen_rgb[source as usize] {
        let fresh = &mut records[start..];
        accounts.narrow.add_all(fresh, stride);
        for record in fresh.chunks_exact_mut(stride) {
            for channel in record[rgb..rgb + 6].as_chunks_mut::<2>().0 {
                *channel = u16::from_le_bytes(*channel).wrapping_mul(257).to_le_bytes();
            }
        }
        accounts.wide.add_all(fresh, stride);
    }
    Ok(())
}

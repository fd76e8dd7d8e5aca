//! What stands before the points of a unit: 64 bytes.

/// Bytes of a header.
pub(crate) const UNIT_HEADER_BYTES: usize = 64;

/// What follows a header, as bits of its second word.
pub(crate) struct Flag;

impl Flag {
    /// Positions have 32 bits per axis.
    pub(crate) const WIDE: u32 = 1;
    pub(crate) const COLOURS: u32 = 2;
    /// Floats of an attribute follow.
    pub(crate) const ATTRIBUTE: u32 = 4;
    pub(crate) const CLASSES: u32 = 8;
    pub(crate) const INTENSITIES: u32 = 16;
}

/// Of a node, a leaf or a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct UnitHeader {
    /// Points that follow.
    pub(crate) count: u32,
    pub(crate) flags: u32,
    /// World coordinates of the integers 0; of a batch the lower corner of its box.
    pub(crate) origin: [f64; 3],
    /// World units per integer; of a batch the sides of its box.
    pub(crate) step: [f64; 3],
    /// Points of the unit in the dataset.
    pub(crate) total: u32,
}

impl UnitHeader {
    /// Puts a header and room for its body's length at the end of `out`; returns where it begins.
    pub(crate) fn begin(&self, out: &mut Vec<u8>) -> usize {
        let at = out.len();
        out.extend_from_slice(&self.count.to_le_bytes());
        out.extend_from_slice(&self.flags.to_le_bytes());
        self.origin.iter().chain(&self.step).for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
        out.extend_from_slice(&0u32.to_le_bytes());
        out.extend_from_slice(&self.total.to_le_bytes());
        at
    }

    /// The body is complete: pads it to a multiple of 8 and writes its length into the header at `at`.
    pub(crate) fn end(at: usize, out: &mut Vec<u8>) {
        out.resize(out.len().next_multiple_of(8), 0);
        let body = out.len().saturating_sub(at + UNIT_HEADER_BYTES);
        if let Some(length) = out.get_mut(at + 56..at + 60) {
            length.copy_from_slice(&u32::try_from(body).unwrap_or(u32::MAX).to_le_bytes());
        }
    }
}

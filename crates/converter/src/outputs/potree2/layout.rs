//! From stored records to the records of the dataset: positions relative to the cube, columns that are not kept left
//! out.

use pointmill_format::{Attribute, AttributeType};

use crate::cloud::RecordFrame;
use crate::sources::{POSITION_BYTES, Schema};

/// Which bytes of a stored record go where.
#[derive(Debug, Clone)]
pub(crate) struct OutputLayout {
    /// Attributes of the output beside the position, in order.
    pub(crate) attributes: Vec<Attribute>,
    /// Bytes of an output record.
    pub(crate) stride: usize,
    /// Bytes of a stored record.
    pub(crate) stored_stride: usize,
    /// Runs of bytes to copy: (from, to) of the stored record, in output order.
    runs: Vec<(usize, usize)>,
    /// 64-bit integers that become doubles.
    doubled: Vec<Doubled>,
    /// Added to a stored coordinate (modulo 2^32) it gives the output integer.
    shift: [u32; 3],
}

/// The bytes of an output record that are 64-bit integers before they become doubles.
#[derive(Debug, Clone, Copy)]
struct Doubled {
    from: usize,
    to: usize,
    is_signed: bool,
}

/// The type that Potree viewers can read: they fail on every node that has a 64-bit integer.
pub(in crate::outputs) const fn viewable(ty: AttributeType) -> AttributeType {
    match ty {
        AttributeType::Int64 | AttributeType::UInt64 => AttributeType::Float64,
        other => other,
    }
}

impl OutputLayout {
    pub(crate) fn new(schema: &Schema, kept: &[usize], frame: &RecordFrame) -> Self {
        let mut runs: Vec<(usize, usize)> = Vec::new();
        let mut doubled = Vec::new();
        let mut stride = POSITION_BYTES;
        for &i in kept {
            let attribute = &schema.attributes[i];
            let (from, to) = (schema.offsets[i], schema.offsets[i] + attribute.size());
            if viewable(attribute.ty) != attribute.ty {
                let is_signed = attribute.ty == AttributeType::Int64;
                doubled.push(Doubled { from: stride, to: stride + attribute.size(), is_signed });
            }
            stride += to - from;
            match runs.last_mut() {
                Some(last) if last.1 == from => last.1 = to,
                _ => runs.push((from, to)),
            }
        }
        let attribute = |i: &usize| {
            let mut attribute = schema.attributes[*i].clone();
            attribute.ty = viewable(attribute.ty);
            attribute
        };
        let attributes = kept.iter().map(attribute).collect();
        let shift = std::array::from_fn(|a| (frame.origin.0[a] - frame.cube.min[a]) as u32);
        Self { attributes, stride, stored_stride: schema.stride, runs, doubled, shift }
    }

    /// True if an output record has the bytes of a stored one, in the same places, before [`Self::finish`].
    pub(crate) fn keeps_records(&self) -> bool {
        self.stride == self.stored_stride && self.runs.len() <= 1
    }

    /// True if stored records come back from those of the dataset: [`Self::unfinish`].
    pub(crate) fn gives_back_records(&self) -> bool {
        self.keeps_records() && self.doubled.is_empty()
    }

    /// Turns records of the dataset into stored ones.
    pub(crate) fn unfinish(&self, records: &mut [u8]) {
        self.shift(records, self.shift.map(u32::wrapping_neg));
    }

    /// Appends what is kept of stored records that lie back to back.
    pub(crate) fn select(&self, records: &[u8], out: &mut Vec<u8>) {
        for record in records.chunks_exact(self.stored_stride) {
            out.extend_from_slice(&record[..POSITION_BYTES]);
            for &(from, to) in &self.runs {
                out.extend_from_slice(&record[from..to]);
            }
        }
    }

    /// Adds to the coordinates of records of the dataset.
    fn shift(&self, records: &mut [u8], by: [u32; 3]) {
        for record in records.chunks_exact_mut(self.stride) {
            for (axis, shift) in record[..POSITION_BYTES].as_chunks_mut::<4>().0.iter_mut().zip(by) {
                *axis = u32::from_le_bytes(*axis).wrapping_add(shift).to_le_bytes();
            }
        }
    }

    /// Turns what was kept of stored records into the records of the dataset.
    pub(crate) fn finish(&self, records: &mut [u8]) {
        self.shift(records, self.shift);
        for Doubled { from, to, is_signed } in &self.doubled {
            for record in records.chunks_exact_mut(self.stride) {
                for bytes in record[*from..*to].as_chunks_mut::<8>().0 {
                    let double =
                        if *is_signed { i64::from_le_bytes(*bytes) as f64 } else { u64::from_le_bytes(*bytes) as f64 };
                    *bytes = double.to_le_bytes();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cube, JobBounds, JobPoint, StoredOrigin};
    use pointmill_format::Lattice;

    #[test]
    fn wide_integers_become_doubles_wherever_they_stand() {
        let schema = Schema::new(vec![
            Attribute::new("a", AttributeType::UInt8, 1),
            Attribute::new("id", AttributeType::UInt64, 1),
            Attribute::new("pair", AttributeType::Int64, 2),
        ]);
        let lattice = Lattice { scale: [0.01; 3], offset: [0.0; 3] };
        let bounds = JobBounds { min: JobPoint([0; 3]), max: JobPoint([9; 3]) };
        let cube = Cube::around(&bounds, &lattice).unwrap();
        let frame = RecordFrame { stride: schema.stride, cube, origin: StoredOrigin(JobPoint([0; 3])) };
        let mut record = vec![0; 12];
        record.push(7);
        record.extend(u64::MAX.to_le_bytes());
        record.extend([-5i64, 1 << 40].iter().flat_map(|v| v.to_le_bytes()));
        let layout = OutputLayout::new(&schema, &[2, 1], &frame);
        let mut out = Vec::new();
        layout.select(&record, &mut out);
        layout.finish(&mut out);
        let doubles: Vec<f64> = out[12..].as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
        assert_eq!(doubles, [-5.0, (1u64 << 40) as f64, u64::MAX as f64]);
        assert!(layout.attributes.iter().all(|a| a.ty == AttributeType::Float64));
    }
}

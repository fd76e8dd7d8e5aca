//! Records to typed columns.

use crate::points::column_bytes;
use crate::{Column, Lattice, NodeKey, NodePoints, Positions, ReadError, with_column};

use super::normals::{from_oct16, from_spheremap};
use super::{Dataset, Field, NodeFiles, PointAttribute};

/// Records that are taken apart at a time: all their bytes stay in the first-level cache from column to column.
const BLOCK_POINTS: usize = 512;

impl Dataset {
    /// Reads the points of a node; replaces the contents of `out`. Positions are integers on the lattice of the node, whose
    /// offset is the lower corner of its box; world coordinates where one of them has 32 bits.
    ///
    /// # Errors
    /// As [`Self::read_payload`]; a LAS file that cannot be read.
    pub fn read_points(&self, key: NodeKey, out: &mut NodePoints) -> Result<(), ReadError> {
        out.reset(self.info.attributes.iter().map(|a| (a.name.as_str(), a.ty)));
        if self.metadata.files != NodeFiles::Bin {
            return self.read_las(key, out);
        }
        let mut positions = out.take_quantized();
        let filled = self.count(key).and_then(|points| self.fill(key, points, &mut positions, out));
        let lattice = Lattice { scale: [self.metadata.scale; 3], offset: self.metadata.node_cube(key).min };
        let is_32_bit = positions.iter().flatten().any(|v| *v < 0);
        out.positions = if is_32_bit { world(&positions, &lattice) } else { Positions::Quantized(positions) };
        out.lattice = lattice;
        filled
    }

    fn fill(
        &self,
        key: NodeKey,
        points: u64,
        positions: &mut [Vec<i32>; 3],
        out: &mut NodePoints,
    ) -> Result<(), ReadError> {
        self.read_payload(key, &mut out.stored)?;
        let points = usize::try_from(points).unwrap_or(usize::MAX);
        let mut room = positions.iter_mut().try_for_each(|axis| axis.try_reserve(points));
        for (column, attribute) in out.columns.iter_mut().zip(&self.info.attributes) {
            let values = points.saturating_mul(attribute.elements);
            room = room.and_then(|()| with_column!(column, column => column.try_reserve(values)));
        }
        room.map_err(|_| self.no_room(key, out.stored.len() as u64))?;
        fill_from_records(&out.stored, &self.metadata.attributes, positions, &mut out.columns);
        Ok(())
    }
}

/// Takes whole records apart.
fn fill_from_records(
    stored: &[u8],
    attributes: &[PointAttribute],
    positions: &mut [Vec<i32>; 3],
    columns: &mut [Column],
) {
    let record_len: usize = attributes.iter().map(PointAttribute::size).sum();
    for block in stored.chunks(record_len.saturating_mul(BLOCK_POINTS)) {
        let (mut columns, mut at) = (columns.iter_mut(), 0);
        for attribute in attributes {
            let part = Part { block, record_len, at };
            match attribute.field {
                Field::Position => {
                    for (axis, values) in positions.iter_mut().enumerate() {
                        column_bytes::append_i32(values, block, record_len, at + 4 * axis);
                    }
                }
                Field::Rgba | Field::Rgb => part.colours(&mut columns),
                Field::NormalOct16 => part.normals(&mut columns, |bytes: [u8; 2]| from_oct16(bytes)),
                Field::NormalSpheremapped => part.normals(&mut columns, |bytes: [u8; 2]| from_spheremap(bytes)),
                Field::Normal => {
                    for (axis, column) in columns.by_ref().take(3).enumerate() {
                        column_bytes::append(column, block, record_len, at + 4 * axis, 1);
                    }
                }
                Field::Filler => {}
                _ => {
                    if let Some(column) = columns.next() {
                        column_bytes::append(column, block, record_len, at, attribute.elements);
                    }
                }
            }
            at += attribute.size();
        }
    }
}

/// One attribute of a block of records.
#[derive(Clone, Copy)]
struct Part<'a> {
    block: &'a [u8],
    record_len: usize,
    at: usize,
}

impl Part<'_> {
    fn each<const N: usize>(&self) -> impl Iterator<Item = [u8; N]> {
        let part = |record: &[u8]| {
            let mut bytes = [0; N];
            bytes.copy_from_slice(&record[self.at..self.at + N]);
            bytes
        };
        self.block.chunks_exact(self.record_len).map(part)
    }

    /// The next column: bytes become 16 bits of the same brightness.
    fn colours<'c>(&self, columns: &mut impl Iterator<Item = &'c mut Column>) {
        if let Some(Column::UInt16(values)) = columns.next() {
            values.extend(self.each::<3>().flatten().map(|channel| u16::from(channel) * 257));
        }
    }

    /// The three next columns.
    fn normals<'c>(&self, columns: &mut impl Iterator<Item = &'c mut Column>, decode: impl Fn([u8; 2]) -> [f32; 3]) {
        if let (Some(Column::Float32(xs)), Some(Column::Float32(ys)), Some(Column::Float32(zs))) =
            (columns.next(), columns.next(), columns.next())
        {
            for [x, y, z] in self.each().map(decode) {
                xs.push(x);
                ys.push(y);
                zs.push(z);
            }
        }
    }
}

/// World coordinates of integers of 32 bits without a sign.
fn world(positions: &[Vec<i32>; 3], lattice: &Lattice) -> Positions {
    let axis = |axis: usize| {
        let place = |v: &i32| f64::from(*v as u32) * lattice.scale[axis] + lattice.offset[axis];
        positions[axis].iter().map(place).collect()
    };
    Positions::World([axis(0), axis(1), axis(2)])
}

//! Compressed splats, as SuperSplat writes them: four numbers of 32 bits each, and 256 splats share a row of the element
//! `chunk`, which holds the bounds between which their bits count.
//!
//! `packed_position` has 11, 10 and 11 bits for x, y and z, from the highest; `packed_scale` the same for the logarithms
//! of the half axes. `packed_color` has 8 bits each for red, green, blue and alpha; the first three count between `min_r`
//! … `max_b` where chunks have these, else between 0 and 1. `packed_rotation` has in its upper 2 bits which part of the
//! quaternion (w, x, y, z) is the largest, and 10 bits for each other one, between −√½ and √½. The element `sh` has the
//! further harmonics as bytes of 1/32 around 128.
//!
//! They are unpacked to what uncompressed splats have. Only alpha stays a byte: as a logarithm (`opacity`) it would be
//! infinite at both ends.

use super::header::{Element, Encoding, Header, Kind};
use crate::scan::source::Source;
use crate::scan::tabular::number::{Endian, Number};
use crate::scan::tabular::{Property, Unpack, binary::BAND_0};
use crate::{Advice, AttributeType, ReadError};

/// Splats of a chunk.
const CHUNK: u64 = 256;
/// Properties of a chunk at most; there are 18 known ones.
const MAX_CHUNK: usize = 256;
/// What a vertex has, each of 32 bits without sign.
const PACKED: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];
/// Least and greatest values of positions, scales and colours; chunks of older files lack the last three.
const BOUNDS: [(&str, &str); 9] = [
    ("min_x", "max_x"),
    ("min_y", "max_y"),
    ("min_z", "max_z"),
    ("min_scale_x", "max_scale_x"),
    ("min_scale_y", "max_scale_y"),
    ("min_scale_z", "max_scale_z"),
    ("min_r", "max_r"),
    ("min_g", "max_g"),
    ("min_b", "max_b"),
];
/// Bounds before those of colours.
const COLOURS_FROM: usize = 6;
/// Properties of an unpacked splat before its further harmonics.
const UNPACKED: [(&str, AttributeType); 14] = [
    ("x", AttributeType::Float64),
    ("y", AttributeType::Float64),
    ("z", AttributeType::Float64),
    ("f_dc_0", AttributeType::Float32),
    ("f_dc_1", AttributeType::Float32),
    ("f_dc_2", AttributeType::Float32),
    ("alpha", AttributeType::UInt8),
    ("scale_0", AttributeType::Float32),
    ("scale_1", AttributeType::Float32),
    ("scale_2", AttributeType::Float32),
    ("rot_0", AttributeType::Float32),
    ("rot_1", AttributeType::Float32),
    ("rot_2", AttributeType::Float32),
    ("rot_3", AttributeType::Float32),
];

/// Where the packed splats of a file lie.
#[derive(Debug)]
pub(super) struct Splats {
    endian: Endian,
    vertices: Table,
    /// Where the four numbers stand in a vertex.
    packed: [usize; 4],
    chunks: Table,
    /// Where the bounds stand in a chunk: six, or nine with those of colours.
    bounds: Vec<(usize, usize)>,
    /// The element `sh`: a byte for each of its properties.
    harmonics: Option<Table>,
}

/// An element whose rows have `stride` bytes each.
#[derive(Debug, Clone, Copy)]
struct Table {
    at: u64,
    stride: u64,
    rows: u64,
}

/// True if the vertices are compressed splats.
pub(super) fn are_compressed(vertex: &Element) -> bool {
    vertex.properties.iter().any(|p| p.name.eq_ignore_ascii_case(PACKED[0]))
}

impl Splats {
    pub(super) fn find(source: &Source, header: &Header, vertices: usize) -> Result<Self, ReadError> {
        let splats = Self::layout(header, vertices).map_err(|why| {
            ReadError::unsupported(source.path(), format!("its points are compressed splats {why}"))
                .advise("export it as an uncompressed PLY")
        })?;
        let (rows, chunks) = (splats.vertices.rows, splats.chunks.rows);
        if chunks < rows.div_ceil(CHUNK) {
            let what = format!("{rows} splats need {} chunks, {chunks} are declared", rows.div_ceil(CHUNK));
            return Err(ReadError::broken(source.path(), splats.chunks.at, what).advise(Advice::ExportAgain));
        }
        Ok(splats)
    }

    /// `Err`: what is not known of the layout.
    fn layout(header: &Header, vertices: usize) -> Result<Self, String> {
        let endian = match header.encoding {
            Encoding::Ascii => return Err("as text, which is not known".to_owned()),
            Encoding::BinaryLittle => Endian::Little,
            Encoding::BinaryBig => Endian::Big,
        };
        let vertex = &header.elements[vertices];
        let mut packed = [0; 4];
        for (place, name) in packed.iter_mut().zip(PACKED) {
            let found = offset(vertex, name, AttributeType::UInt32);
            *place = found.ok_or_else(|| format!("whose {name} is missing or has no 32 bits"))?;
        }
        if vertex.properties.len() > PACKED.len() {
            return Err("with properties that are not known".to_owned());
        }
        let find = |name: &str| header.elements.iter().position(|e| e.name.eq_ignore_ascii_case(name));
        let chunk = find("chunk").ok_or("without the element chunk")?;
        if header.elements[chunk].properties.len() > MAX_CHUNK {
            return Err(format!("whose chunks have more than {MAX_CHUNK} properties"));
        }
        let bound = |name| offset(&header.elements[chunk], name, AttributeType::Float32);
        let bounds: Vec<_> = BOUNDS.iter().map_while(|(low, high)| bound(low).zip(bound(high))).collect();
        if bounds.len() < COLOURS_FROM {
            let (low, high) = BOUNDS[bounds.len()];
            return Err(format!("whose chunks have no {low} or {high}"));
        }
        let lists = "with lists before them, which are not known";
        let is_byte = |p: &super::header::Property| p.kind == Kind::Scalar(AttributeType::UInt8);
        let harmonics = match find("sh") {
            Some(i) if header.elements[i].properties.iter().all(is_byte) => Some(table(header, i).ok_or(lists)?),
            Some(_) => return Err("whose harmonics (sh) are no bytes".to_owned()),
            None => None,
        };
        let (vertices, chunks) = (table(header, vertices).ok_or(lists)?, table(header, chunk).ok_or(lists)?);
        Ok(Self { endian, vertices, packed, chunks, bounds, harmonics })
    }

    /// Splats that are there whole.
    pub(super) fn there(&self, source: &Source) -> u64 {
        let harmonics = self.harmonics.map_or(u64::MAX, |t| t.there(source));
        let chunks = self.chunks.there(source).saturating_mul(CHUNK);
        self.vertices.there(source).min(harmonics).min(chunks)
    }

    /// First byte of the vertices, and bytes of one.
    pub(super) fn rows(&self) -> (u64, u64) {
        (self.vertices.at, self.vertices.stride)
    }

    /// The properties of an unpacked splat, with their places.
    pub(super) fn properties(&self) -> Vec<Property> {
        let rest = self.harmonics.map_or(0, |t| t.stride);
        let rest = (0..rest).map(|i| (format!("f_rest_{i}"), AttributeType::Float32));
        let mut at = 0;
        let all = UNPACKED.iter().map(|(name, ty)| ((*name).to_owned(), *ty)).chain(rest);
        all.map(|(name, ty)| {
            let property = Property { at, ..Property::new(&name, ty) };
            at += ty.size();
            property
        })
        .collect()
    }

    fn read<N: Number, const BYTES: usize>(&self, row: &[u8], at: usize) -> N {
        N::read(row.get(at..at + BYTES).unwrap_or_default(), self.endian)
    }

    /// The value at `t` (0–1) between bound `index` of a chunk.
    fn between(&self, chunk: &[u8], index: usize, t: f64) -> f64 {
        let (low, high) = self.bounds[index];
        let value = |at| f64::from(self.read::<f32, 4>(chunk, at));
        value(low) * (1.0 - t) + value(high) * t
    }

    /// Appends a splat.
    fn splat(&self, row: &[u8], chunk: &[u8], out: &mut Vec<u8>) {
        let [position, rotation, scale, colour] = self.packed.map(|at| self.read::<u32, 4>(row, at));
        for (axis, t) in thirds(position).into_iter().enumerate() {
            out.extend(self.between(chunk, axis, t).to_le_bytes());
        }
        let [rgb @ .., alpha] = colour.to_be_bytes();
        for (i, byte) in rgb.into_iter().enumerate() {
            let mut v = f64::from(byte) / 255.0;
            if self.bounds.len() == BOUNDS.len() {
                v = self.between(chunk, COLOURS_FROM + i, v);
            }
            out.extend((((v - 0.5) / BAND_0) as f32).to_le_bytes());
        }
        out.push(alpha);
        for (axis, t) in thirds(scale).into_iter().enumerate() {
            out.extend((self.between(chunk, 3 + axis, t) as f32).to_le_bytes());
        }
        quaternion(rotation).iter().for_each(|v| out.extend((*v as f32).to_le_bytes()));
    }
}

impl Unpack for Splats {
    fn unpack(
        &self,
        source: &Source,
        first_point: u64,
        points: usize,
        raw: &mut Vec<u8>,
        out: &mut Vec<u8>,
    ) -> Result<usize, ReadError> {
        let (first_chunk, end) = (first_point / CHUNK, first_point + points as u64);
        let chunks = self.chunks.bytes(source, first_chunk, end.div_ceil(CHUNK) - first_chunk)?;
        let harmonics = match self.harmonics {
            Some(table) => table.bytes(source, first_point, points as u64)?,
            None => Vec::new(),
        };
        let Table { at, stride, .. } = self.vertices;
        let rows = source.slice_at(at + first_point * stride, points as u64 * stride, raw)?;
        let (stride, chunk_stride) = (stride as usize, self.chunks.stride as usize);
        let rest = self.harmonics.map_or(0, |t| t.stride as usize);
        out.clear();
        let unpacked = UNPACKED.iter().map(|(_, ty)| ty.size()).sum::<usize>() + 4 * rest;
        out.reserve_exact(points * unpacked);
        for (i, row) in rows.chunks_exact(stride).enumerate() {
            let chunk = ((first_point + i as u64) / CHUNK - first_chunk) as usize * chunk_stride;
            self.splat(row, chunks.get(chunk..chunk + chunk_stride).unwrap_or_default(), out);
            let bytes = harmonics.get(i * rest..(i + 1) * rest).unwrap_or_default();
            bytes.iter().for_each(|byte| out.extend(harmonic(*byte).to_le_bytes()));
        }
        Ok(out.len() / points.max(1))
    }

    fn bytes(&self, points: u64) -> u64 {
        let harmonics = self.harmonics.map_or(0, |table| table.stride);
        let unpacked = UNPACKED.iter().map(|(_, ty)| ty.size() as u64).sum::<u64>() + 4 * harmonics;
        // the first and the last chunk may be shared with other batches
        let chunks = points / CHUNK + 2;
        points * (self.vertices.stride + harmonics + unpacked) + chunks * self.chunks.stride
    }
}

impl Table {
    /// Rows that are there whole, at most those that are declared.
    fn there(&self, source: &Source) -> u64 {
        source.len().saturating_sub(self.at).checked_div(self.stride).unwrap_or(self.rows).min(self.rows)
    }

    fn bytes(&self, source: &Source, first: u64, rows: u64) -> Result<Vec<u8>, ReadError> {
        source.vec_at(self.at + first * self.stride, rows * self.stride)
    }
}

/// Where the rows of an element lie; `None` behind rows of unequal length.
fn table(header: &Header, index: usize) -> Option<Table> {
    let mut at = header.end;
    for before in &header.elements[..index] {
        at = before.count.checked_mul(before.stride()?)?.checked_add(at)?;
    }
    let element = &header.elements[index];
    let stride = element.stride()?;
    // so that no place in it overflows
    element.count.checked_mul(stride)?.checked_add(at)?;
    Some(Table { at, stride, rows: element.count })
}

/// Where a property of that type stands in a row.
fn offset(element: &Element, name: &str, ty: AttributeType) -> Option<usize> {
    let mut at = 0;
    for property in &element.properties {
        let Kind::Scalar(found) = property.kind else { return None };
        if property.name.eq_ignore_ascii_case(name) {
            return (found == ty).then_some(at);
        }
        at += found.size();
    }
    None
}

/// 11, 10 and 11 bits as 0–1.
fn thirds(bits: u32) -> [f64; 3] {
    let part = |bits: u32, most: u32| f64::from(bits & most) / f64::from(most);
    [part(bits >> 21, 2047), part(bits >> 11, 1023), part(bits, 2047)]
}

/// w, x, y, z: the largest part makes the length 1.
fn quaternion(bits: u32) -> [f64; 4] {
    let part = |shift: u32| (f64::from(bits >> shift & 1023) / 1023.0 - 0.5) * std::f64::consts::SQRT_2;
    let others = [part(20), part(10), part(0)];
    let largest = (1.0 - others.iter().map(|v| v * v).sum::<f64>()).max(0.0).sqrt();
    let mut parts = others.into_iter();
    let place = (bits >> 30) as usize;
    std::array::from_fn(|i| if i == place { largest } else { parts.next().unwrap_or_default() })
}

/// A further harmonic: bytes are the middles of their steps, but for the ends.
fn harmonic(byte: u8) -> f32 {
    match byte {
        0 => -4.0,
        255 => 4.0,
        byte => (f32::from(byte) + 0.5) / 32.0 - 4.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_become_parts() {
        assert_eq!(thirds(0), [0.0; 3]);
        assert_eq!(thirds(u32::MAX), [1.0; 3]);
        assert_eq!(thirds(1024 << 21 | 512 << 11 | 1), [1024.0 / 2047.0, 512.0 / 1023.0, 1.0 / 2047.0]);
        assert_eq!((harmonic(0), harmonic(255), harmonic(128)), (-4.0, 4.0, 0.015625));
    }

    #[test]
    fn a_quaternion_has_length_1_and_its_largest_part_where_the_bits_say() {
        let half = 1.0 / 2046.0 * std::f64::consts::SQRT_2;
        for place in 0..4u32 {
            let q = quaternion(place << 30 | 512 << 20 | 511 << 10 | 512);
            let mut expected = vec![half, -half, half];
            expected.insert(place as usize, (1.0 - 3.0 * half * half).sqrt());
            assert!(q.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12), "{q:?} {expected:?}");
        }
    }
}

//! What the tests share.

use std::io::Cursor;
use std::path::PathBuf;

use pointmill_format::batches::{AlignedBytes, Batches, Cloud, WriteOptions, Written, colour_word, write};
use pointmill_format::{Attribute, AttributeType, Lattice, ReadError};
use pointmill_testkit::Random;
use pointmill_testkit::files::fixture;

/// A golden file.
pub(crate) fn golden(name: &str) -> PathBuf {
    fixture("batches").join(name)
}

/// Opens a file in memory.
pub(crate) fn open(bytes: &[u8]) -> Result<Batches<AlignedBytes>, ReadError> {
    Batches::from_bytes(AlignedBytes::from(bytes), "points.qbatch")
}

/// A cloud that owns its columns.
#[derive(Debug, Clone)]
pub(crate) struct Points {
    pub(crate) lattice: Lattice,
    pub(crate) positions: [Vec<i64>; 3],
    pub(crate) colours: Vec<u32>,
    pub(crate) attributes: Vec<(Attribute, Vec<u8>)>,
}

impl Points {
    /// The cloud of the same name in `fixtures/generators/batches.py`: positions below `sides`.
    pub(crate) fn random(seed: u64, points: usize, sides: [u64; 3], with_attributes: bool, lattice: Lattice) -> Self {
        let mut cloud = Self::empty(lattice, with_attributes);
        let mut random = Random::new(seed);
        for _ in 0..points {
            let p = sides.map(|s| random.below(s) as i64);
            let rgb = [(); 3].map(|()| random.below(256) as u8);
            let extra = with_attributes.then(|| (random.below(65_536) as u16, random.below(32) as u8));
            cloud.push(p, rgb, extra);
        }
        cloud
    }

    pub(crate) fn empty(lattice: Lattice, with_attributes: bool) -> Self {
        let attributes = [("intensity", AttributeType::UInt16), ("classification", AttributeType::UInt8)];
        let attributes = attributes.map(|(name, ty)| (Attribute::new(name, ty, 1), Vec::new())).to_vec();
        let attributes = if with_attributes { attributes } else { Vec::new() };
        Self { lattice, positions: Default::default(), colours: Vec::new(), attributes }
    }

    pub(crate) fn push(&mut self, position: [i64; 3], rgb: [u8; 3], extra: Option<(u16, u8)>) {
        self.positions.iter_mut().zip(position).for_each(|(column, v)| column.push(v));
        self.colours.push(colour_word(rgb, 0));
        if let Some((intensity, class)) = extra {
            self.attributes[0].1.extend(intensity.to_le_bytes());
            self.attributes[1].1.push(class);
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.colours.len()
    }

    pub(crate) fn options(&self, cell: f64) -> WriteOptions {
        WriteOptions::new(self.lattice).cell(cell)
    }

    pub(crate) fn write(&self, options: &WriteOptions) -> (Vec<u8>, Written) {
        let attributes: Vec<_> = self.attributes.iter().map(|(a, v)| (a.clone(), v.as_slice())).collect();
        let [x, y, z] = &self.positions;
        let mut cloud = Cloud::new(self.lattice, [x, y, z], &self.colours);
        cloud.attributes = &attributes;
        let mut file = Cursor::new(Vec::new());
        let written = write(&mut file, &cloud, options).unwrap();
        assert_eq!(written.bytes, file.get_ref().len() as u64);
        (file.into_inner(), written)
    }
}

//! Everything of a scan in memory.

use pointmill_format::{Column, Positions, ReadError, Scan, ScanInfo, Scratch, Wanted, with_column};

use super::decode::{check_description, decode};

/// Everything that a scan gave.
#[derive(Debug)]
pub struct Cloud {
    /// What the scan says of itself.
    pub info: ScanInfo,
    /// Sum of the pieces' points; [`Self::len`] is less if pieces failed.
    pub promised: u64,
    /// Coordinates: lattice steps where [`ScanInfo::lattice`] is some, else world units.
    pub xyz: [Vec<f64>; 3],
    /// One for each of [`ScanInfo::attributes`].
    pub columns: Vec<Column>,
    /// Of pieces that failed.
    pub errors: Vec<ReadError>,
    /// Memory taken by [`pointmill_format::Scratch::decoded`].
    pub decoded_bytes: u64,
}

impl Cloud {
    /// Points that were decoded.
    pub fn len(&self) -> usize {
        self.xyz[0].len()
    }

    /// True without points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The column with that name.
    ///
    /// # Panics
    /// If there is none.
    pub fn column(&self, name: &str) -> &Column {
        let index = self.info.attributes.iter().position(|a| a.name == name);
        &self.columns[index.unwrap_or_else(|| panic!("no attribute {name}"))]
    }

    /// The values of the attribute with that name.
    ///
    /// # Panics
    /// If there is none.
    pub fn values(&self, name: &str) -> Vec<f64> {
        doubles(self.column(name))
    }

    /// True if a warning contains these words.
    pub fn warned(&self, words: &str) -> bool {
        self.info.warnings.iter().any(|w| w.to_string().contains(words))
    }

    /// "name typexelements" of every attribute.
    pub fn attributes(&self) -> String {
        let shown = |a: &pointmill_format::Attribute| format!("{} {}x{}", a.name, a.ty.potree_name(), a.elements);
        self.info.attributes.iter().map(shown).collect::<Vec<_>>().join(", ")
    }
}

/// The values of a column as doubles; integers beyond 2^53 are rounded.
#[allow(clippy::unnecessary_cast)] // one of the ten types is the target
pub fn doubles(column: &Column) -> Vec<f64> {
    with_column!(column, v => v.iter().map(|n| *n as f64).collect())
}

/// The values of a column as integers; those of floats are their bit patterns.
pub fn integers(column: &Column) -> Vec<i128> {
    match column {
        Column::Float32(v) => v.iter().map(|f| i128::from(f.to_bits())).collect(),
        Column::Float64(v) => v.iter().map(|f| i128::from(f.to_bits())).collect(),
        column => with_column!(column, v => v.iter().map(|n| *n as i128).collect()),
    }
}

/// Decodes all pieces in order, and checks the description, the pieces and every batch.
pub fn read(scan: &dyn Scan, wanted: &Wanted) -> Cloud {
    let info = scan.info().clone();
    let promised = check_description(scan);
    let columns = info.attributes.iter().map(|a| Column::new(a.ty)).collect();
    let mut cloud = Cloud { info, promised, xyz: Default::default(), columns, errors: Vec::new(), decoded_bytes: 0 };
    let mut scratch = Scratch::default();
    for i in 0..scan.pieces().len() {
        scratch.next_piece = Some(i + 1);
        let result = decode(scan, i, wanted, &mut scratch, &mut |batch| {
            match &batch.positions {
                Positions::Quantized(xyz) => {
                    cloud
                        .xyz
                        .iter_mut()
                        .zip(xyz)
                        .for_each(|(all, some)| all.extend(some.iter().map(|v| f64::from(*v))));
                }
                Positions::World(xyz) => cloud.xyz.iter_mut().zip(xyz).for_each(|(all, some)| all.extend(some)),
            }
            cloud.columns.iter_mut().zip(&batch.columns).for_each(|(all, some)| append(all, some));
        });
        cloud.errors.extend(result.err());
        cloud.decoded_bytes = cloud.decoded_bytes.max(scratch.decoded.capacity() as u64);
    }
    cloud
}

fn append(all: &mut Column, some: &Column) {
    macro_rules! same {
        ($($kind:ident)*) => {
            match (all, some) {
                $((Column::$kind(all), Column::$kind(some)) => all.extend(some),)*
                (all, some) => panic!("{:?} is not {:?}", all.ty(), some.ty()),
            }
        };
    }
    same!(Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64 Float32 Float64);
}

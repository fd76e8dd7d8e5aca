//! Reading whole files, and fixtures with some bytes changed.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use pointmill_format::scan::las;
use pointmill_format::{Column, MAX_BATCH_POINTS, Positions, ReadError, Scan, ScanInfo, Scratch, Wanted, with_column};

/// Everything that a file gave.
#[derive(Debug)]
pub(crate) struct Cloud {
    pub(crate) info: ScanInfo,
    /// Sum of the pieces' points.
    pub(crate) promised: u64,
    pub(crate) xyz: [Vec<i32>; 3],
    /// By attribute.
    pub(crate) columns: Vec<Column>,
    /// Of pieces that failed.
    pub(crate) errors: Vec<ReadError>,
}

impl Cloud {
    pub(crate) fn len(&self) -> usize {
        self.xyz[0].len()
    }

    /// The column with that name.
    pub(crate) fn column(&self, name: &str) -> &Column {
        let index = self.info.attributes.iter().position(|a| a.name == name);
        &self.columns[index.unwrap_or_else(|| panic!("no attribute {name}"))]
    }

    pub(crate) fn warned(&self, words: &str) -> bool {
        self.info.warnings.iter().any(|w| w.to_string().contains(words))
    }
}

/// Decodes all pieces and checks what every decode promises: consecutive points, batches within bounds, columns that
/// fit, memory that the file justifies.
pub(crate) fn read(path: &Path) -> Result<Cloud, ReadError> {
    let scan = las::open(path)?;
    Ok(read_scan(scan.as_ref(), &Wanted::all(scan.info())))
}

pub(crate) fn read_scan(scan: &dyn Scan, wanted: &Wanted) -> Cloud {
    let info = scan.info().clone();
    let columns = info.attributes.iter().map(|a| Column::new(a.ty)).collect();
    let mut cloud = Cloud { info, promised: 0, xyz: Default::default(), columns, errors: Vec::new() };
    let mut scratch = Scratch::default();
    for (i, piece) in scan.pieces().iter().enumerate() {
        assert_eq!(piece.first_point, cloud.promised, "pieces are consecutive");
        assert!(piece.points > 0 && piece.byte_offset + piece.byte_len <= cloud.info.file_bytes);
        cloud.promised += piece.points;
        let mut next = piece.first_point;
        let result = scan.decode(i, wanted, &mut scratch, &mut |batch| {
            assert_eq!(batch.first_point, next);
            assert!((1..=MAX_BATCH_POINTS).contains(&batch.len()));
            next += batch.len() as u64;
            let Positions::Quantized(xyz) = &batch.positions else { panic!("LAS has a lattice") };
            cloud.xyz.iter_mut().zip(xyz).for_each(|(all, some)| all.extend(some));
            for ((all, some), attribute) in
                cloud.columns.iter_mut().zip(&batch.columns).zip(cloud.info.attributes.iter())
            {
                assert!(some.is_empty() || some.len() == batch.len() * attribute.elements);
                append(all, some);
            }
            ControlFlow::Continue(())
        });
        assert!(next <= cloud.promised, "no point is invented");
        match result {
            Ok(()) => assert_eq!(next, cloud.promised),
            Err(e) => cloud.errors.push(e),
        }
        assert!(scratch.raw.len() as u64 <= cloud.info.file_bytes);
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

/// The values as integers; those of floats are their bit patterns.
pub(crate) fn integers(column: &Column) -> Vec<i128> {
    match column {
        Column::Float32(v) => v.iter().map(|f| i128::from(f.to_bits())).collect(),
        Column::Float64(v) => v.iter().map(|f| i128::from(f.to_bits())).collect(),
        column => with_column!(column, v => v.iter().map(|n| *n as i128).collect()),
    }
}

pub(crate) fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/las")
}

pub(crate) fn fixture(name: &str) -> Vec<u8> {
    std::fs::read(fixtures().join(name)).unwrap()
}

/// All fixtures but the large real scan, sorted.
pub(crate) fn small_fixtures() -> Vec<PathBuf> {
    let files = std::fs::read_dir(fixtures()).unwrap().map(|e| e.unwrap().path());
    let is_scan = |p: &PathBuf| p.extension().is_some_and(|e| e == "las" || e == "laz");
    let mut files: Vec<_> = files.filter(|p| is_scan(p) && !p.ends_with("autzen_trim.laz")).collect();
    files.sort();
    files
}

/// A file with these bytes, gone when dropped.
pub(crate) fn file(bytes: &[u8]) -> tempfile::TempPath {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    file.into_temp_path()
}

/// Reads a file with these bytes.
pub(crate) fn read_bytes(bytes: &[u8]) -> Result<Cloud, ReadError> {
    read(&file(bytes))
}

/// Overwrites bytes.
pub(crate) fn put(bytes: &mut [u8], at: usize, new: &[u8]) {
    bytes[at..at + new.len()].copy_from_slice(new);
}

pub(crate) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

/// First byte of the point data.
pub(crate) fn points_start(bytes: &[u8]) -> usize {
    u32_at(bytes, 96) as usize
}

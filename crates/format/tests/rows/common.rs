//! Reading whole files.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use pointmill_format::scan::{pcd, ply, text};
use pointmill_format::{Column, MAX_BATCH_POINTS, Positions, ReadError, Scan, ScanInfo, Scratch, Wanted, with_column};

/// Everything that a file gave.
#[derive(Debug)]
pub(crate) struct Cloud {
    pub(crate) info: ScanInfo,
    pub(crate) xyz: [Vec<f64>; 3],
    /// By attribute, as doubles.
    pub(crate) columns: Vec<Vec<f64>>,
    /// Of pieces that failed.
    pub(crate) errors: Vec<ReadError>,
}

impl Cloud {
    pub(crate) fn len(&self) -> usize {
        self.xyz[0].len()
    }

    /// The values of the attribute with that name.
    pub(crate) fn column(&self, name: &str) -> &[f64] {
        let index = self.info.attributes.iter().position(|a| a.name == name);
        &self.columns[index.unwrap_or_else(|| panic!("no attribute {name}"))]
    }

    pub(crate) fn warned(&self, words: &str) -> bool {
        self.info.warnings.iter().any(|w| w.to_string().contains(words))
    }

    /// "name typexelements" of every attribute.
    pub(crate) fn attributes(&self) -> String {
        let shown = |a: &pointmill_format::Attribute| format!("{} {}x{}", a.name, a.ty.potree_name(), a.elements);
        self.info.attributes.iter().map(shown).collect::<Vec<_>>().join(", ")
    }
}

/// By content, as a converter does it.
pub(crate) fn open(path: &Path) -> Result<Box<dyn Scan>, ReadError> {
    let bytes = std::fs::read(path).unwrap();
    let first = &bytes[..bytes.len().min(4096)];
    if ply::is_ply(first) {
        ply::open(path)
    } else if pcd::is_pcd(first) {
        pcd::open(path)
    } else {
        text::open(path, &text::TextOptions::default())
    }
}

pub(crate) fn read(path: &Path) -> Result<Cloud, ReadError> {
    let scan = open(path)?;
    Ok(read_scan(scan.as_ref(), &Wanted::all(scan.info())))
}

/// Decodes all pieces and checks what every decode promises: consecutive points, batches within bounds, columns that
/// fit, memory that the file justifies.
pub(crate) fn read_scan(scan: &dyn Scan, wanted: &Wanted) -> Cloud {
    let info = scan.info().clone();
    let columns = vec![Vec::new(); info.attributes.len()];
    let mut cloud = Cloud { info, xyz: Default::default(), columns, errors: Vec::new() };
    let (mut scratch, mut promised) = (Scratch::default(), 0);
    for (i, piece) in scan.pieces().iter().enumerate() {
        assert_eq!(piece.first_point, promised, "pieces are consecutive");
        assert!(piece.points > 0 && piece.byte_offset + piece.byte_len <= cloud.info.file_bytes);
        promised += piece.points;
        let mut next = piece.first_point;
        let result = scan.decode(i, wanted, &mut scratch, &mut |batch| {
            assert_eq!(batch.first_point, next);
            assert!((1..=MAX_BATCH_POINTS).contains(&batch.len()));
            next += batch.len() as u64;
            let Positions::World(xyz) = &batch.positions else { panic!("no lattice here") };
            cloud.xyz.iter_mut().zip(xyz).for_each(|(all, some)| all.extend(some));
            for ((all, some), attribute) in
                cloud.columns.iter_mut().zip(&batch.columns).zip(cloud.info.attributes.iter())
            {
                assert_eq!(some.ty(), attribute.ty);
                assert!(some.is_empty() || some.len() == batch.len() * attribute.elements);
                all.extend(doubles(some));
            }
            ControlFlow::Continue(())
        });
        assert!(next <= promised, "no point is invented");
        match result {
            Ok(()) => assert_eq!(next, promised),
            Err(e) => cloud.errors.push(e),
        }
        assert!(scratch.raw.len() as u64 <= cloud.info.file_bytes);
        assert!(scratch.decoded.capacity() as u64 <= 128 * cloud.info.file_bytes + 4096);
    }
    cloud
}

#[allow(clippy::unnecessary_cast)] // one of the ten types is the target
fn doubles(column: &Column) -> Vec<f64> {
    with_column!(column, v => v.iter().map(|n| *n as f64).collect())
}

pub(crate) fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/rows")
}

/// All fixtures, sorted.
pub(crate) fn all_fixtures() -> Vec<PathBuf> {
    let files = std::fs::read_dir(fixtures()).unwrap().map(|e| e.unwrap().path());
    let mut files: Vec<_> = files.filter(|p| p.extension().is_some_and(|e| e != "tsv")).collect();
    files.sort();
    assert!(files.len() > 25);
    files
}

/// A file with these bytes, gone when dropped.
pub(crate) fn file(bytes: &[u8]) -> tempfile::TempPath {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    file.into_temp_path()
}

/// Reads a file with these bytes.
pub(crate) fn read_bytes(bytes: impl AsRef<[u8]>) -> Result<Cloud, ReadError> {
    read(&file(bytes.as_ref()))
}

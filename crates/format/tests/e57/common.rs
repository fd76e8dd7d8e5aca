//! Reading whole files, and fixtures with some bytes changed.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use pointmill_format::scan::e57::{self, E57Options};
use pointmill_format::{Column, MAX_BATCH_POINTS, Positions, ReadError, Scan, ScanInfo, Scratch, Wanted, with_column};

/// Everything that a file gave.
#[derive(Debug)]
pub(crate) struct Cloud {
    pub(crate) info: ScanInfo,
    /// Sum of the pieces' points.
    pub(crate) promised: u64,
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

    /// The column with that name.
    pub(crate) fn column(&self, name: &str) -> &[f64] {
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
    let scan = e57::open_with(path, E57Options::default().keep_row_column(true))?;
    Ok(read_scan(scan.as_ref(), &Wanted::all(scan.info())))
}

pub(crate) fn read_scan(scan: &dyn Scan, wanted: &Wanted) -> Cloud {
    let info = scan.info().clone();
    let columns = vec![Vec::new(); info.attributes.len()];
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
            let Positions::World(xyz) = &batch.positions else { panic!("E57 has no lattice") };
            cloud.xyz.iter_mut().zip(xyz).for_each(|(all, some)| all.extend(some));
            for ((all, some), attribute) in
                cloud.columns.iter_mut().zip(&batch.columns).zip(cloud.info.attributes.iter())
            {
                assert!(some.is_empty() || some.len() == batch.len() * attribute.elements);
                assert_eq!(some.ty(), attribute.ty);
                all.extend(doubles(some));
            }
            ControlFlow::Continue(())
        });
        match result {
            Ok(()) => assert_eq!(next, cloud.promised),
            Err(e) => cloud.errors.push(e),
        }
        assert!(scratch.raw.len() as u64 <= cloud.info.file_bytes);
        // text and padding aside, streams are copies of the file's bytes
        assert!(scratch.decoded.len() as u64 <= cloud.info.file_bytes + 64 * 1024);
    }
    cloud
}

#[allow(clippy::unnecessary_cast)] // not for all types
fn doubles(column: &Column) -> Vec<f64> {
    with_column!(column, v => v.iter().map(|n| *n as f64).collect())
}

pub(crate) fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/e57")
}

pub(crate) fn fixture(name: &str) -> Vec<u8> {
    std::fs::read(fixtures().join(name)).unwrap()
}

/// All fixtures, sorted.
pub(crate) fn all_fixtures() -> Vec<PathBuf> {
    let files = std::fs::read_dir(fixtures()).unwrap().map(|e| e.unwrap().path());
    let mut files: Vec<_> = files.filter(|p| p.extension().is_some_and(|e| e == "e57")).collect();
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

/// Makes the checksums of all pages right.
pub(crate) fn repair(bytes: &mut [u8]) {
    for page in bytes.chunks_exact_mut(1024) {
        let crc = crc32c::crc32c(&page[..1020]).to_be_bytes();
        page[1020..].copy_from_slice(&crc);
    }
}

/// Replaces text of the XML section, which must end the file, once; header and checksums follow.
pub(crate) fn replace(bytes: &mut Vec<u8>, old: &str, new: &str) {
    let field = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    let (offset, len) = (field(24), field(32));
    let start = offset - offset / 1024 * 4;
    let mut logical: Vec<u8> = bytes.chunks_exact(1024).flat_map(|page| &page[..1020]).copied().collect();
    let xml = String::from_utf8(logical[start..start + len].to_vec()).unwrap();
    assert!(xml.contains(old), "no {old}");
    let xml = xml.replacen(old, new, 1);
    logical.truncate(start);
    logical.extend_from_slice(xml.as_bytes());
    logical.resize(logical.len().div_ceil(1020) * 1020, b' ');
    let file_len = logical.len() as u64 / 1020 * 1024;
    logical[16..24].copy_from_slice(&file_len.to_le_bytes());
    logical[32..40].copy_from_slice(&(xml.len() as u64).to_le_bytes());
    *bytes = logical.chunks_exact(1020).flat_map(|page| [page, &[0; 4]].concat()).collect();
    repair(bytes);
}

pub(crate) fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * (1.0 + a.abs().max(b.abs())) || a.is_nan() && b.is_nan()
}

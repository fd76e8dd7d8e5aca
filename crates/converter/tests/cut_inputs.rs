//! Every fixture, cut at 64 places: one error that names file and byte, or all points; nothing left at the output.
//!
//! Lines of numbers without a count (XYZ, CSV) are whole after each of them: a cut there gives fewer points, and
//! nobody can know. Nor can anybody if the last number of any text loses digits.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use pointmill_converter::{ConvertError, Plan, Report, Silent, convert};
use pointmill_format::ErrorKind;

const CUTS: usize = 64;

/// Kinds without a count of their points.
const UNCOUNTED: [&str; 4] = ["xyz", "txt", "csv", "asc"];

/// The fixtures of a folder that hold points.
fn fixtures(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(folder);
    let files = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let mut files: Vec<_> = files.filter(|p| p.extension().is_some_and(|e| e != "tsv")).collect();
    files.retain(|p| {
        !["LICENSE-autzen_trim.txt", "no_scans.e57", "autzen_trim.laz"].iter().any(|name| p.ends_with(name))
    });
    files.sort();
    files
}

fn run(input: &Path, output: &Path) -> Result<Report, ConvertError> {
    let mut plan = Plan::new(vec![input.to_path_buf()], output.to_path_buf());
    (plan.threads, plan.overwrite) = (1, true);
    convert(&plan, &Silent)
}

fn check(folder: &str) {
    let dir = tempfile::tempdir().unwrap();
    let output = dir.path().join("out");
    for path in fixtures(folder) {
        let whole = run(&path, &output).unwrap();
        fs::remove_dir_all(&output).unwrap();
        let bytes = fs::read(&path).unwrap();
        let name = path.file_name().unwrap().to_str().unwrap();
        let is_counted = !UNCOUNTED.contains(&path.extension().unwrap().to_str().unwrap());
        let (input, is_rows) = (dir.path().join(name), folder == "rows");
        for k in 0..CUTS {
            let cut = bytes.len() * k / CUTS;
            fs::write(&input, &bytes[..cut]).unwrap();
            let start = Instant::now();
            let result = run(&input, &output);
            assert!(start.elapsed() < Duration::from_secs(20), "{name} cut to {cut}");
            match result {
                Ok(report) => {
                    assert!(cut > 0, "{name}: points of nothing");
                    let same = report.checksum_in == whole.checksum_in;
                    let fewer = report.points.read < whole.points.read;
                    // the last number of a text may have lost digits
                    let in_last_line = is_rows && !bytes[cut..].trim_ascii_end().contains(&b'\n');
                    let points = report.points.read;
                    assert!(
                        same || !is_counted && fewer || !fewer && in_last_line,
                        "{name} cut to {cut}: {points} points"
                    );
                    fs::remove_dir_all(&output).unwrap();
                }
                Err(ConvertError::Read(e)) => {
                    let line = e.to_string();
                    assert!(matches!(e.kind(), ErrorKind::Broken) && e.path() == input, "{line}");
                    assert!(e.offset().is_some_and(|at| at <= cut as u64), "cut to {cut}: {line}");
                    assert!(e.advice().is_some() && !line.contains('\n'), "{line}");
                }
                Err(e) => panic!("{name} cut to {cut}: {e}"),
            }
            fs::remove_file(&input).unwrap();
            let left: Vec<_> = fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
            assert!(left.is_empty(), "{name} cut to {cut} left {left:?}");
        }
    }
}

#[test]
fn las_and_laz() {
    check("las");
}

#[test]
fn e57() {
    check("e57");
}

#[test]
fn ply_pcd_and_text() {
    check("rows");
}

//! Every fixture, cut at 64 places: one error that names file and byte, or all points; nothing left at the output.
//!
//! Lines of numbers without a count (XYZ, CSV) are whole after each of them: a cut there gives fewer points, and
//! nobody can know. Nor can anybody if the last number of any text loses digits.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use pointmill_converter::{ConvertError, Plan, Potree2Settings, Report, Silent, convert};
use pointmill_format::ErrorKind;
use pointmill_testkit::{damage, files, scans};

fn run(input: &Path, output: &Path) -> Result<Report, ConvertError> {
    let mut plan = Plan::new(vec![input.to_path_buf()], output.to_path_buf());
    (plan.threads, plan.overwrite) = (1, true);
    convert(&plan, &[Potree2Settings::default().into()], &Silent)
}

fn check(folder: &str) {
    let dir = tempfile::tempdir().unwrap();
    let output = dir.path().join("out");
    for fixture in scans::scan_fixtures(folder).into_iter().filter(|f| f.is_small() && f.points > 0) {
        let whole = run(&fixture.path, &output).unwrap();
        assert_eq!(whole.points.read, fixture.points, "{}", fixture.name);
        fs::remove_dir_all(&output).unwrap();
        let (bytes, name) = (fixture.bytes(), files::file_name(&fixture.path));
        let (input, is_rows) = (dir.path().join(&name), folder == "rows");
        for part in damage::cuts(&bytes) {
            let cut = part.len();
            fs::write(&input, part).unwrap();
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
                        same || !fixture.is_counted() && fewer || !fewer && in_last_line,
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

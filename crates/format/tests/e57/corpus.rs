//! Real files of public projects, if the corpus lies beside the repository.

use std::time::{Duration, Instant};

use pointmill_testkit::files;

use crate::common::E57;

/// File, points, of these with a position, sum of their x (by libE57Format, within 1e-6), number of warnings.
type Row = (&'static str, usize, usize, f64, usize);

const EXPECTED: &[Row] = &[
    ("broken/empty.e57", 0, 0, 0.0, 1),
    ("broken/read_error.e57", 2651, 2651, 0.0, 1),
    ("e57/A4_moved.e57", 4, 4, -174.87684631347656, 1),
    ("e57/A_B.e57", 6, 6, -263.4897003173828, 0),
    ("e57/A_B_different_dims.e57", 2, 2, 167.3718719482422, 1),
    ("e57/A_moved_B.e57", 6, 6, -260.1586456298828, 0),
    ("e57/ColouredCubeFloat.e57", 7680, 7680, -49.7208476960659, 0),
    ("e57/bunnyInt19.e57", 30571, 30571, -841.093298, 0),
    ("e57/bunnyInt32.e57", 30571, 30571, -841.093298, 0),
    ("e57/cartesian_invalid_state_single.e57", 3, 1, -1.0, 0),
    ("e57/empty_pc.e57", 0, 0, 0.0, 0),
    ("e57/float_intensity_without_min_max.e57", 1, 1, 1.0, 1),
    ("e57/integer_intensity.e57", 2, 2, 5.5, 0),
    ("e57/no_ext_namespace.e57", 1, 1, 1.0, 0),
    ("e57/scaled_integer_intensity.e57", 2, 2, 5.5, 0),
    ("e57/test filename äöü.e57", 0, 0, 0.0, 1),
    ("e57/tinyCartesianFloatRgb.e57", 2090, 2090, -16812.262330532074, 0),
    ("e57/tiny_pc_with_extension.e57", 1, 1, 1.0, 0),
    ("e57/tiny_spherical.e57", 360, 180, 89.95435666933113, 0),
];

#[test]
fn each_file_of_the_corpus_has_its_known_outcome() {
    let Some(corpus) = files::corpus("") else { return };
    for (file, points, valid, sum_x, warnings) in EXPECTED {
        let start = Instant::now();
        let cloud = E57.read(&corpus.join(file)).unwrap_or_else(|e| panic!("{e}"));
        assert!(cloud.errors.is_empty(), "{file}: {:?}", cloud.errors);
        let x: Vec<f64> = cloud.xyz[0].iter().copied().filter(|v| !v.is_nan()).collect();
        assert_eq!((cloud.len(), x.len()), (*points, *valid), "{file}");
        let sum: f64 = x.iter().sum();
        assert!((sum - sum_x).abs() < 1e-6, "{file}: {sum}");
        assert_eq!(cloud.info.warnings.len(), *warnings, "{file}: {:?}", cloud.info.warnings);
        assert!(start.elapsed() < Duration::from_secs(20), "{file} took {:?}", start.elapsed());
    }
}

#[test]
fn files_with_bad_checksums_are_refused_or_read_around_them() {
    let Some(corpus) = files::corpus("") else { return };
    let error = E57.read(&corpus.join("broken/bad-crc.e57")).unwrap_err().to_string();
    assert!(error.contains("page 0 does not match its checksum (byte 0)"), "{error}");
    match E57.read(&corpus.join("broken/corrupt_crc.e57")) {
        Ok(cloud) => assert!(cloud.errors[0].to_string().contains("checksum"), "{:?}", cloud.errors),
        Err(e) => assert!(e.to_string().contains("does not match its checksum (byte"), "{e}"),
    }
}

#[test]
fn no_scan_of_the_corpus_is_left_out_of_the_table() {
    let Some(corpus) = files::corpus("") else { return };
    for folder in ["e57", "broken"] {
        for entry in std::fs::read_dir(corpus.join(folder)).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            if name.ends_with(".e57") && !name.ends_with("crc.e57") {
                let file = format!("{folder}/{name}");
                assert!(EXPECTED.iter().any(|row| row.0 == file), "{file}");
            }
        }
    }
}

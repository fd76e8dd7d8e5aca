//! Real files of public projects, if the corpus lies beside the repository.

use std::time::{Duration, Instant};

use pointmill_testkit::files;
use pointmill_testkit::reader::Cloud;

use crate::common::LAS;

/// File, points, sum of the quantized x, what warnings must and may say (by a part of the line).
type Row = (&'static str, usize, i64, &'static [&'static str]);

const EXPECTED: &[Row] = &[
    ("las/1.2-with-color.copc.laz", 1065, -475_503, &[]),
    ("las/1.2-with-color.las", 1065, 67_872_102_297, &[]),
    ("las/autzen-bmx-2023.las", 687, 33_562_163, &[]),
    ("las/autzen_trim.laz", 110_000, 7_002_010_454_461, &[]),
    ("las/epsg_4326.las", 5380, -5_093_378_612_809, &[]),
    ("las/extrabytes.las", 1065, 67_872_102_297, &["7 extra bytes at byte 40 of each record have no type"]),
    ("las/extrabytes_lasrs.laz", 1065, 67_872_102_297, &["7 extra bytes at byte 40 of each record have no type"]),
    ("las/faceraster_numerical_imprecision.laz", 18_074, 1_241_701_910_378, &[]),
    ("las/gps-time-nan.las", 1, 0, &[]),
    ("las/interesting.las", 1065, 67_872_102_297, &[]),
    ("las/laszip-generated.laz", 1065, 67_872_102_297, &[]),
    ("las/liblas-generated.laz", 1065, 67_872_102_297, &[]),
    ("las/lots_of_vlr.las", 1, 715_001_346, &[]),
    ("las/no-points.las", 0, 0, &[]),
    ("las/test1_4.las", 1000, 1_613_657_196_599, &[]),
    ("las/wontcompress3.las", 1000, 1_217_868_370, &[]),
    ("las/permutations/1.0_0.las", 1, 47_069_244, &[]),
    ("las/permutations/1.0_1.las", 1, 47_069_244, &[]),
    ("las/permutations/1.1_0.las", 1, 47_069_244, &[]),
    ("las/permutations/1.1_1.las", 1, 47_069_244, &[]),
    ("las/permutations/1.2_0.las", 1, 47_069_244, &[]),
    ("las/permutations/1.2_1.las", 1, 47_069_244, &[]),
    ("las/permutations/1.2_2.las", 1, 47_069_244, &[]),
    ("las/permutations/1.2_3.las", 1, 47_069_244, &[]),
    ("broken/1.2-no-points.las", 0, 0, &["1065 points, 0 whole records are there"]),
    ("broken/bad-geotiff-keys.las", 10, 289_816_322, &[]),
    ("broken/bad_vlr_count.las", 10, 289_816_322, &["VLR 2 of 3"]),
    (
        "broken/garbage_nVariableLength.las",
        718,
        -359,
        &["VLR 0 of 1069128089", "719 points, 718 whole records are there: 1 are missing"],
    ),
    // point-wise LAZ of LASzip 1.2: other readers panic on it or refuse it
    ("broken/simple-laszip-compressor-version-1.2r0.laz", 1065, 67_872_102_297, &[]),
    ("broken/spurious.las", 1065, -1_310_691_991_447, &[]),
];

#[test]
fn each_file_of_the_corpus_has_its_known_outcome() {
    let Some(corpus) = files::corpus("") else { return };
    for (file, points, sum_x, warnings) in EXPECTED {
        let start = Instant::now();
        let cloud = LAS.read(&corpus.join(file)).unwrap_or_else(|e| panic!("{e}"));
        assert!(cloud.errors.is_empty(), "{file}: {:?}", cloud.errors);
        assert_eq!(cloud.len(), *points, "{file}");
        assert_eq!(cloud.xyz[0].iter().map(|v| *v as i64).sum::<i64>(), *sum_x, "{file}");
        assert_eq!(cloud.info.warnings.len(), warnings.len(), "{file}: {:?}", cloud.info.warnings);
        assert!(warnings.iter().all(|w| cloud.warned(w)), "{file}: {:?}", cloud.info.warnings);
        assert!(start.elapsed() < Duration::from_secs(20), "{file} took {:?}", start.elapsed());
    }
}

#[test]
fn no_scan_of_the_corpus_is_left_out_of_the_table() {
    let Some(corpus) = files::corpus("") else { return };
    for folder in ["las", "las/permutations", "broken"] {
        for entry in std::fs::read_dir(corpus.join(folder)).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            if name.ends_with(".las") || name.ends_with(".laz") {
                let file = format!("{folder}/{name}");
                assert!(EXPECTED.iter().any(|row| row.0 == file), "{file}");
            }
        }
    }
}

#[test]
fn three_encodings_of_one_scan_give_the_same_points() {
    let Some(corpus) = files::corpus("") else { return };
    let read = |file: &str| -> Cloud { LAS.read(&corpus.join(file)).unwrap() };
    let plain = read("las/1.2-with-color.las");
    for file in ["las/laszip-generated.laz", "broken/simple-laszip-compressor-version-1.2r0.laz"] {
        let other = read(file);
        assert_eq!(plain.xyz, other.xyz, "{file}");
        assert_eq!(plain.columns, other.columns, "{file}");
    }
}

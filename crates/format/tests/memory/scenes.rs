//! Scans of every format, written here: of usual points, and of points of hundreds of bytes.

use std::path::Path;

use e57::{E57Writer, Record, RecordDataType, RecordName, RecordValue};
use pointmill_format::{OpenOptions, Scan, open_scan};
use pointmill_testkit::las::Las;
use pointmill_testkit::las_records::{descriptor, with_extra, with_vlrs};
use tempfile::TempPath;

/// A file and what is in it.
pub(crate) struct Scene {
    pub(crate) name: &'static str,
    pub(crate) path: TempPath,
    pub(crate) points: usize,
    /// Bytes of a point in a batch.
    pub(crate) point_bytes: usize,
}

impl Scene {
    fn new(name: &'static str, ending: &str, bytes: &[u8], (points, point_bytes): (usize, usize)) -> Self {
        let path = temporary(ending);
        std::fs::write(&path, bytes).unwrap();
        Self { name, path, points, point_bytes }
    }

    pub(crate) fn open(&self) -> Box<dyn Scan> {
        open_scan(&self.path, &OpenOptions::default()).unwrap()
    }
}

fn temporary(ending: &str) -> TempPath {
    tempfile::Builder::new().suffix(ending).tempfile().unwrap().into_temp_path()
}

/// Extra doubles of a wide point, beside its position.
const DOUBLES: usize = 40;
/// Points of a wide scan: more than a batch takes.
const WIDE_POINTS: usize = 30_000;
/// Points of a usual scan: more than a batch takes.
const POINTS: usize = 150_000;

/// The value of double `k` of point `i`.
fn double(i: usize, k: usize) -> f64 {
    (i * 31 + k * 7) as f64 / 8.0
}

/// Points of some 40 doubles.
pub(crate) fn wide() -> Vec<Scene> {
    let size = (WIDE_POINTS, 24 + 8 * DOUBLES);
    let binary = doubles(WIDE_POINTS, 3 + DOUBLES);
    vec![
        Scene::new("wide LAS", ".las", &wide_las(WIDE_POINTS), (WIDE_POINTS, 38 + 8 * DOUBLES)),
        Scene::new("wide PLY", ".ply", &[ply_header(WIDE_POINTS, DOUBLES, ""), binary.clone()].concat(), size),
        Scene::new("wide PCD", ".pcd", &[pcd_header(WIDE_POINTS, DOUBLES, "binary"), binary].concat(), size),
        Scene::new("wide text", ".xyz", text(WIDE_POINTS, DOUBLES).as_bytes(), size),
        wide_e57(WIDE_POINTS),
    ]
}

/// Points of a position and a few values.
pub(crate) fn usual() -> Vec<Scene> {
    vec![Scene::new("LAS", ".las", &Las::terrain(POINTS, 1).bytes(), (POINTS, 38))]
}

fn doubles(points: usize, each: usize) -> Vec<u8> {
    (0..points).flat_map(|i| (0..each).flat_map(move |k| double(i, k).to_le_bytes())).collect()
}

fn wide_las(points: usize) -> Vec<u8> {
    let records = (0..DOUBLES).flat_map(|k| descriptor(10, &format!("extra {k}"), None)).collect();
    let las = with_vlrs(&Las::terrain(points, 1).bytes(), &[("LASF_Spec", 4, records)]);
    with_extra(&las, |i| doubles(1, DOUBLES + i % 2)[..8 * DOUBLES].to_vec())
}

fn ply_header(points: usize, extra: usize, more: &str) -> Vec<u8> {
    let extra: String = (0..extra).map(|k| format!("property double extra{k}\n")).collect();
    let axes = "property double x\nproperty double y\nproperty double z\n";
    format!("ply\nformat binary_little_endian 1.0\nelement vertex {points}\n{axes}{extra}{more}end_header\n").into()
}

fn pcd_header(points: usize, extra: usize, data: &str) -> Vec<u8> {
    let names: String = (0..extra).map(|k| format!(" extra{k}")).collect();
    let [sizes, types, counts] = [" 8", " F", " 1"].map(|word| word.repeat(3 + extra));
    format!(
        "VERSION .7\nFIELDS x y z{names}\nSIZE{sizes}\nTYPE{types}\nCOUNT{counts}\nWIDTH {points}\nHEIGHT 1\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA {data}\n"
    )
    .into()
}

fn text(points: usize, extra: usize) -> String {
    let row = |i: usize| (0..3 + extra).map(|k| double(i, k).to_string()).collect::<Vec<_>>().join(" ") + "\n";
    (0..points).map(row).collect()
}

fn wide_e57(points: usize) -> Scene {
    let path = temporary(".e57");
    let double_of = |name| Record { name, data_type: RecordDataType::F64 };
    let extra = |k: usize| RecordName::Unknown { namespace: "more".to_owned(), name: format!("extra{k}") };
    let axes = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
    let prototype = axes.into_iter().chain((0..DOUBLES).map(extra)).map(double_of).collect();
    write_e57(&path, prototype, points, |i| (0..3 + DOUBLES).map(|k| RecordValue::Double(double(i, k))).collect());
    // the number of the scan is a column
    Scene { name: "wide E57", path, points, point_bytes: 24 + 8 * DOUBLES + 2 }
}

fn write_e57(path: &Path, prototype: Vec<Record>, points: usize, values: impl Fn(usize) -> Vec<RecordValue>) {
    let mut writer = E57Writer::from_file(path, "file").unwrap();
    writer.register_extension(e57::Extension::new("more", "http://example.com/more")).unwrap();
    let mut cloud = writer.add_pointcloud("scan", prototype).unwrap();
    (0..points).for_each(|i| cloud.add_point(values(i)).unwrap());
    cloud.finalize().unwrap();
    writer.finalize().unwrap();
}

//! Scans of every format, written here: of usual points, and of points of hundreds of bytes.

use std::io::Cursor;
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
const POINTS: usize = 80_000;

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

/// Points of a position and a few values, in every way to store them.
pub(crate) fn usual() -> Vec<Scene> {
    let size = (POINTS, 24 + 8 * 2);
    let scene = |name, ending, bytes: &[u8]| Scene::new(name, ending, bytes, size);
    let binary = doubles(POINTS, 5);
    let rows = text(POINTS, 2);
    let laz = |format| Scene::new("LAZ", ".laz", &laz(format), (POINTS, 38));
    vec![
        Scene::new("LAS", ".las", &Las::terrain(POINTS, 1).bytes(), (POINTS, 38)),
        laz(3),
        laz(7),
        scene("PLY", ".ply", &[ply_header(POINTS, 2, ""), binary.clone()].concat()),
        scene("PLY with lists", ".ply", &[ply_header(POINTS, 2, "property list uchar int l\n"), with_lists()].concat()),
        scene("PLY as text", ".ply", &[ascii(&ply_header(POINTS, 2, "")), rows.clone().into()].concat()),
        scene("PLY as a stream", ".ply", &[ascii(&ply_header(POINTS, 2, "")), rows.replace(' ', "\n").into()].concat()),
        scene("PCD", ".pcd", &[pcd_header(POINTS, 2, "binary"), binary].concat()),
        scene("PCD as text", ".pcd", &[pcd_header(POINTS, 2, "ascii"), rows.clone().into()].concat()),
        compressed_pcd(3 * POINTS),
        scene("text", ".xyz", rows.as_bytes()),
        scene("OFF", ".off", format!("OFF\n{POINTS} 0 0\n{}", text(POINTS, 0)).as_bytes()),
        scene("PTS", ".pts", format!("{POINTS}\n{}", text(POINTS, 1)).as_bytes()),
        scene("PTX", ".ptx", format!("{}{}", ptx_header(POINTS), text(POINTS, 1)).as_bytes()),
        splats(),
        e57(POINTS),
    ]
}

fn ascii(header: &[u8]) -> Vec<u8> {
    String::from_utf8_lossy(header).replace("binary_little_endian", "ascii").into()
}

/// The values of [`doubles`] with a list of 0 to 2 items behind each point.
fn with_lists() -> Vec<u8> {
    let items = |i: usize| [&[(i % 3) as u8], [7; 8].split_at(4 * (i % 3)).0].concat();
    doubles(POINTS, 5).chunks(40).enumerate().flat_map(|(i, row)| [row, &items(i)].concat()).collect()
}

fn ptx_header(points: usize) -> String {
    format!("{points}\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n5 0 0 1\n")
}

/// Written by the `las` crate, in the compressed form of a point format.
fn laz(format: u8) -> Vec<u8> {
    let mut reader = las::Reader::new(Cursor::new(Las::terrain(POINTS, 1).bytes())).unwrap();
    let mut builder = las::Builder::from((1, 4));
    builder.point_format = las::point::Format::new(format).unwrap();
    builder.point_format.is_compressed = true;
    let path = temporary(".laz");
    let mut writer = las::Writer::from_path(&path, builder.into_header().unwrap()).unwrap();
    for point in reader.read_all().unwrap().points() {
        let mut point = point.unwrap();
        (point.x, point.y) = (point.x - 500_000.0, point.y - 5_400_000.0);
        point.gps_time = Some(1.0);
        point.color = Some(las::Color::new(1, 2, 3));
        writer.write_point(point).unwrap();
    }
    writer.close().unwrap();
    std::fs::read(&path).unwrap()
}

/// The block of a compressed PCD file: runs of eight bytes that repeat those before, and bytes as they are.
pub(crate) fn lzf(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    for (i, eight) in bytes.chunks(8).enumerate() {
        let before = &bytes[(8 * i).saturating_sub(8)..8 * i];
        match eight == before {
            true => out.extend([6 << 5, 7]),
            false => {
                out.push(eight.len() as u8 - 1);
                out.extend(eight);
            }
        }
    }
    out
}

/// Planes of doubles that change every 16 points.
pub(crate) fn compressed_pcd(points: usize) -> Scene {
    let value = |k: usize, i: usize| double(i / 16, k).to_le_bytes();
    let planes: Vec<u8> = (0..5).flat_map(|k| (0..points).flat_map(move |i| value(k, i))).collect();
    let block = lzf(&planes);
    let lengths = [block.len(), planes.len()].map(|len| (len as u32).to_le_bytes()).concat();
    let bytes = [pcd_header(points, 2, "binary_compressed"), lengths, block].concat();
    Scene::new("PCD, compressed", ".pcd", &bytes, (points, 24 + 8 * 2))
}

/// Compressed splats with all harmonics.
fn splats() -> Scene {
    let axes = |name: &str| ["x", "y", "z"].map(|axis| format!("property float {name}_{axis}\n")).concat();
    let chunks = POINTS.div_ceil(256);
    let chunk = ["min", "max", "min_scale", "max_scale"].map(axes).concat();
    let packed =
        ["position", "rotation", "scale", "color"].map(|name| format!("property uint packed_{name}\n")).concat();
    let harmonics: String = (0..45).map(|i| format!("property uchar f_rest_{i}\n")).collect();
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement chunk {chunks}\n{chunk}element vertex {POINTS}\n{packed}\
         element sh {POINTS}\n{harmonics}end_header\n"
    );
    let bytes = [header.into_bytes(), vec![0x3f; chunks * 48], vec![7; POINTS * 16], vec![9; POINTS * 45]].concat();
    // doubles of the position, colours, alpha, and floats
    Scene::new("PLY, compressed splats", ".ply", &bytes, (POINTS, 24 + 6 + 1 + 4 * (3 + 3 + 4 + 45)))
}

fn e57(points: usize) -> Scene {
    let path = temporary(".e57");
    let axis = |name| Record { name, data_type: RecordDataType::F32 };
    let colours = [Record::COLOR_RED_U8, Record::COLOR_GREEN_U8, Record::COLOR_BLUE_U8];
    let axes = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ].map(axis);
    let value = |i: usize, k: usize| match k {
        0..3 => RecordValue::Single(double(i, k) as f32),
        _ => RecordValue::Integer((i % 256) as i64),
    };
    write_e57(&path, axes.into_iter().chain(colours).collect(), points, |i| (0..6).map(|k| value(i, k)).collect());
    Scene { name: "E57", path, points, point_bytes: 24 + 6 + 2 }
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

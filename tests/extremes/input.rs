//! Scans of the cases: their bytes, and where each point is without any rounding.

use std::io::Cursor;

use e57::{E57Writer, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform, Translation};
use pointmill_testkit::las::{Las, Point};

use crate::exact::Exact;

/// The points of a scan as its file has them. The intensity of each is its number.
#[derive(Debug, Clone)]
pub(crate) enum Input {
    /// LAS: integers on a lattice.
    Las { scale: [f64; 3], offset: [f64; 3], points: Vec<[i32; 3]> },
    /// Text: whole numbers of `10^-decimals`.
    Text { decimals: u32, points: Vec<[i64; 3]> },
    /// PLY in single precision.
    Single(Vec<[f32; 3]>),
    /// PLY in double precision.
    Double(Vec<[f64; 3]>),
    /// E57: scaled integers, then turned by a quaternion w, x, y, z of any length (whole numbers, so that the rotation is rational:
    /// its matrix of whole numbers over the square of the length), then moved.
    Posed { step: f64, quaternion: [i32; 4], translation: [f64; 3], points: Vec<[i32; 3]> },
}

/// A coordinate as a fraction: `numerator / denominator`.
#[derive(Debug, Clone)]
pub(crate) struct Coordinate {
    numerator: Exact,
    denominator: f64,
}

impl Coordinate {
    /// How far `decoded` is from here.
    pub(crate) fn error_of(&self, decoded: f64) -> f64 {
        Exact::of(decoded).times(self.denominator).minus(&self.numerator).value() / self.denominator
    }

    pub(crate) fn value(&self) -> f64 {
        self.numerator.value() / self.denominator
    }
}

impl Input {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Las { points, .. } | Self::Posed { points, .. } => points.len(),
            Self::Text { points, .. } => points.len(),
            Self::Single(points) => points.len(),
            Self::Double(points) => points.len(),
        }
    }

    /// Where 0 of the lattice of the run is, which is that of the scan if it has one.
    pub(crate) fn offset(&self) -> [f64; 3] {
        match self {
            Self::Las { offset, .. } => *offset,
            Self::Posed { translation, .. } => *translation,
            _ => [0.0; 3],
        }
    }

    pub(crate) fn file_name(&self) -> &'static str {
        match self {
            Self::Las { .. } => "a.las",
            Self::Text { .. } => "a.csv",
            Self::Single(_) | Self::Double(_) => "a.ply",
            Self::Posed { .. } => "a.e57",
        }
    }

    /// Where point `i` is; `None` if it is nowhere.
    pub(crate) fn point(&self, i: usize) -> Option<[Coordinate; 3]> {
        let is_somewhere = match self {
            Self::Single(points) => points[i].iter().all(|v| v.is_finite()),
            Self::Double(points) => points[i].iter().all(|v| v.is_finite()),
            _ => true,
        };
        let plain = |numerator| Coordinate { numerator, denominator: 1.0 };
        let coordinate = |a: usize| match self {
            Self::Las { scale, offset, points } => {
                plain(Exact::of(offset[a]).plus_product(f64::from(points[i][a]), scale[a]))
            }
            Self::Text { decimals, points } => Coordinate {
                numerator: Exact::integer(i128::from(points[i][a])),
                denominator: 10f64.powi(*decimals as i32),
            },
            Self::Single(points) => plain(Exact::of(f64::from(points[i][a]))),
            Self::Double(points) => plain(Exact::of(points[i][a])),
            Self::Posed { step, quaternion, translation, points } => {
                let (matrix, denominator) = rotation(*quaternion);
                let moved = Exact::default().plus_product(translation[a], denominator);
                let turned = matrix[a].iter().zip(points[i]).fold(moved, |sum, (factor, q)| {
                    sum.plus_all(&Exact::default().plus_product(f64::from(q), *step).times(*factor))
                });
                Coordinate { numerator: turned, denominator }
            }
        };
        is_somewhere.then(|| [0, 1, 2].map(coordinate))
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        match self {
            Self::Las { scale, offset, points } => {
                let point = |(i, xyz): (usize, &[i32; 3])| Point { intensity: i as u16, ..Point::at(*xyz) };
                let points = points.iter().enumerate().map(point).collect();
                Las { point_format: 6, scale: *scale, offset: *offset, ..Las::new(points) }.bytes()
            }
            Self::Text { decimals, points } => {
                let mut out = "x;y;z;intensity\n".to_owned();
                for (i, p) in points.iter().enumerate() {
                    let [x, y, z] = p.map(|v| decimal(v, *decimals as usize));
                    out += &format!("{x};{y};{z};{i}\n");
                }
                out.into_bytes()
            }
            Self::Single(points) => ply("float", points.iter().map(|p| p.map(f32::to_le_bytes).concat())),
            Self::Double(points) => ply("double", points.iter().map(|p| p.map(f64::to_le_bytes).concat())),
            Self::Posed { step, quaternion, translation, points } => e57(*step, *quaternion, *translation, points),
        }
    }
}

/// The rotation of a quaternion of any length: whole numbers, and what they are to be divided by.
pub(crate) fn rotation(quaternion: [i32; 4]) -> ([[f64; 3]; 3], f64) {
    let [w, x, y, z] = quaternion.map(f64::from);
    let rows = [
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w + y * y - x * x - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w + z * z - x * x - y * y],
    ];
    (rows, w * w + x * x + y * y + z * z)
}

/// `value · 10^-decimals`, digit by digit.
fn decimal(value: i64, decimals: usize) -> String {
    let digits = format!("{:0width$}", value.unsigned_abs(), width = decimals + 1);
    let (whole, part) = digits.split_at(digits.len() - decimals);
    let sign = if value < 0 { "-" } else { "" };
    if decimals == 0 { format!("{sign}{whole}") } else { format!("{sign}{whole}.{part}") }
}

fn ply(ty: &str, points: impl ExactSizeIterator<Item = Vec<u8>>) -> Vec<u8> {
    let mut out = format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", points.len());
    ["x", "y", "z"].iter().for_each(|axis| out += &format!("property {ty} {axis}\n"));
    let mut out = (out + "property ushort intensity\nend_header\n").into_bytes();
    for (i, point) in points.enumerate() {
        out.extend(point);
        out.extend((i as u16).to_le_bytes());
    }
    out
}

fn e57(step: f64, [w, x, y, z]: [i32; 4], translation: [f64; 3], points: &[[i32; 3]]) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut file, "extremes").unwrap();
    let (min, max) = (i64::from(i32::MIN), i64::from(i32::MAX));
    let scaled = || RecordDataType::ScaledInteger { min, max, scale: step, offset: 0.0 };
    let intensity = RecordDataType::Integer { min: 0, max: 65_535 };
    let mut prototype = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ]
        .map(|name| Record { name, data_type: scaled() })
        .to_vec();
    prototype.push(Record { name: RecordName::Intensity, data_type: intensity });
    let mut cloud = writer.add_pointcloud("scan", prototype).unwrap();
    let [w, x, y, z] = [w, x, y, z].map(f64::from);
    let [tx, ty, tz] = translation;
    cloud.set_transform(Some(Transform {
        rotation: Quaternion { w, x, y, z },
        translation: Translation { x: tx, y: ty, z: tz },
    }));
    for (i, p) in points.iter().enumerate() {
        let mut values = p.map(|q| RecordValue::ScaledInteger(q.into())).to_vec();
        values.push(RecordValue::Integer(i as i64));
        cloud.add_point(values).unwrap();
    }
    cloud.finalize().unwrap();
    writer.finalize().unwrap();
    drop(writer);
    file.into_inner()
}

#[test]
fn decimals_are_written_digit_by_digit() {
    assert_eq!([5, -5, 12_345].map(|v| decimal(v, 3)), ["0.005", "-0.005", "12.345"]);
    assert_eq!(decimal(-7, 0), "-7");
}

//! `poses.csv`: a row for each scan and each image.

use std::fmt::Write as _;

use pointmill_format::{ImageGeometry, ImageKind, ScanImage, ScanPart};

/// The first line. Lengths are in units of the file (metres), angles in radians; what is not known is empty.
const TITLES: &str = "kind,number,name,file,mask,scan,x,y,z,qw,qx,qy,qz,width,height,focal_length,pixel_width,\
                      pixel_height,principal_x,principal_y,radius,points";

/// A row.
#[derive(Debug, Default)]
pub(super) struct Row {
    kind: &'static str,
    number: usize,
    name: String,
    /// The image's file, in the folder of the table.
    pub(super) file: String,
    /// That of its mask.
    pub(super) mask: String,
    scan: Option<usize>,
    place: Option<[f64; 3]>,
    turn: Option<[f64; 4]>,
    pixels: Option<[u64; 2]>,
    geometry: ImageGeometry,
    points: Option<u64>,
}

impl Row {
    /// A scanner's place.
    pub(super) fn of_scan(part: &ScanPart) -> Self {
        Self {
            kind: "scan",
            number: part.number,
            name: part.name.clone(),
            scan: Some(part.number),
            place: Some(part.translation),
            turn: quaternion(&part.rotation),
            points: Some(part.range.end - part.range.start),
            ..Self::default()
        }
    }

    /// A camera's place, without the names of files.
    pub(super) fn of_image(image: &ScanImage) -> Self {
        let kind = match image.kind {
            ImageKind::VisualReference => "visual_reference",
            kind => kind.name(),
        };
        Self {
            kind,
            number: image.number,
            name: image.name.clone(),
            scan: image.scan,
            place: image.pose.map(|pose| pose.translation),
            turn: image.pose.and_then(|pose| quaternion(&pose.rotation)),
            pixels: Some(image.pixels),
            geometry: image.geometry,
            ..Self::default()
        }
    }

    fn line(&self) -> String {
        fn all<T: ToString + Copy, const N: usize>(values: Option<[T; N]>) -> String {
            let values = values.map(|v| v.map(|v| v.to_string()));
            values.map_or_else(|| vec![""; N].join(","), |values| values.join(","))
        }
        let one = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
        let geometry = &self.geometry;
        let fields = [
            self.kind.to_owned(),
            self.number.to_string(),
            quoted(&self.name),
            quoted(&self.file),
            quoted(&self.mask),
            self.scan.map_or_else(String::new, |n| n.to_string()),
            all(self.place),
            all(self.turn),
            all(self.pixels),
            one(geometry.focal_length),
            all(geometry.pixel_size),
            all(geometry.principal_point),
            one(geometry.radius),
            self.points.map_or_else(String::new, |n| n.to_string()),
        ];
        fields.join(",")
    }
}

/// The whole table.
pub(super) fn table(rows: &[Row]) -> String {
    let mut out = format!("{TITLES}\n");
    rows.iter().for_each(|row| {
        let _ = writeln!(out, "{}", row.line());
    });
    out
}

/// A field of text: in quotes if it needs them, on one line.
fn quoted(text: &str) -> String {
    let text: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.contains([',', '"', ';']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text }
}

/// The unit quaternion w, x, y, z of a rotation, w ≥ 0; `None` for another matrix (a scale, a mirror).
fn quaternion(m: &[[f64; 3]; 3]) -> Option<[f64; 4]> {
    // the four squares, each times four: the largest is the divisor, so that nothing is lost
    let [[a, ..], [_, b, _], [.., c]] = *m;
    let squares = [1.0 + a + b + c, 1.0 + a - b - c, 1.0 - a + b - c, 1.0 - a - b + c];
    let largest = (1..4).fold(0, |best, i| if squares[i] > squares[best] { i } else { best });
    let (wx, wy, wz) = (m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]);
    let (xy, xz, yz) = (m[0][1] + m[1][0], m[0][2] + m[2][0], m[1][2] + m[2][1]);
    let rows = [[squares[0], wx, wy, wz], [wx, squares[1], xy, xz], [wy, xy, squares[2], yz], [wz, xz, yz, squares[3]]];
    let row = rows[largest];
    let length = row.iter().map(|v| v * v).sum::<f64>().sqrt();
    let sign = if row[0] < 0.0 { -1.0 } else { 1.0 };
    // adding 0 makes -0 0
    let q = row.map(|v| sign * v / length + 0.0);
    is_rotation(m, q).then_some(q)
}

/// True if the quaternion turns as the matrix does.
fn is_rotation(m: &[[f64; 3]; 3], [w, x, y, z]: [f64; 4]) -> bool {
    let turned = [
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w + y * y - x * x - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w + z * z - x * x - y * y],
    ];
    m.iter().flatten().zip(turned.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-4)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix([w, x, y, z]: [f64; 4]) -> [[f64; 3]; 3] {
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    }

    #[test]
    fn quaternions_come_back_from_their_matrices() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let table = [
            [1.0, 0.0, 0.0, 0.0],
            [0.8, 0.0, 0.36, 0.48],
            [half, 0.0, 0.0, -half],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.6, -0.8],
            [0.1, 0.1, 0.7, 0.7],
        ];
        for q in table {
            let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
            let q = q.map(|v| v / length);
            let seen = quaternion(&matrix(q)).unwrap();
            let near = |sign: f64| q.iter().zip(seen).all(|(a, b)| (sign * a - b).abs() < 1e-12);
            assert!(near(1.0) || q[0].abs() < 1e-12 && near(-1.0), "{q:?} {seen:?}");
        }
        assert_eq!(quaternion(&[[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]]), None);
        assert_eq!(quaternion(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]), None);
        assert_eq!(quaternion(&[[f64::NAN; 3]; 3]), None);
    }

    #[test]
    fn rows_have_as_many_fields_as_there_are_titles() {
        let geometry = ImageGeometry::default();
        let row = Row { kind: "scan", name: "a,\"b\"\nc".to_owned(), geometry, ..Row::default() };
        assert_eq!(row.line(), "scan,0,\"a,\"\"b\"\" c\",,,,,,,,,,,,,,,,,,,");
        let commas = |text: &str| text.matches(',').count();
        assert_eq!(commas(&Row::default().line()), commas(TITLES));
    }
}

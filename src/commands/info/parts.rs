//! The scans and images within a file, as text and as JSON.

use pointmill_format::{ScanImage, ScanPart};
use serde_json::{Value, json};

use super::description::corners;
use crate::human::quantities::{bytes, number, numbers, plural};
use crate::human::text;

/// "2: Hall, 1,200 points, at 3 4 5, turned by 30° about 0 0 1, in 0 0 0 … 9 9 9".
pub(super) fn part_line(part: &ScanPart) -> String {
    let name = if part.name.is_empty() { String::new() } else { format!("{}, ", part.name) };
    let (at, turned) = (numbers(&part.translation), turn(&part.rotation));
    let bounds = part.bounds.map_or_else(String::new, |b| format!(", in {}", text::corners(&b.min, &b.max)));
    format!("{}: {name}{}, at {at}{turned}{bounds}", part.number, plural(part.points, "point"))
}

pub(super) fn part_json(part: &ScanPart) -> Value {
    json!({
        "number": part.number,
        "name": part.name,
        "points": part.points,
        "points_there": part.range.end - part.range.start,
        "rotation": part.rotation,
        "translation": part.translation,
        "bounds_declared": part.bounds.map(|b| corners(&b)),
    })
}

/// "1: Hall pano, spherical, JPEG, 8192 × 4096 pixels, 1.25 MiB, of scan 2, at 3 4 5".
pub(super) fn image_line(image: &ScanImage) -> String {
    let name = if image.name.is_empty() { String::new() } else { format!("{}, ", image.name) };
    let [width, height] = image.pixels;
    let scan = image.scan.map_or_else(String::new, |number| format!(", of scan {number}"));
    let pose = image
        .pose
        .map_or_else(String::new, |pose| format!(", at {}{}", numbers(&pose.translation), turn(&pose.rotation)));
    let mask = if image.mask.is_some() { ", with a mask" } else { "" };
    let (number, kind, encoding, size) = (image.number, image.kind, image.encoding.name(), bytes(image.data.bytes));
    format!("{number}: {name}{kind}, {encoding}, {width} × {height} pixels, {size}{mask}{scan}{pose}")
}

pub(super) fn image_json(image: &ScanImage) -> Value {
    let geometry = &image.geometry;
    json!({
        "number": image.number,
        "name": image.name,
        "kind": image.kind.name(),
        "encoding": image.encoding.name(),
        "width": image.pixels[0],
        "height": image.pixels[1],
        "bytes": image.data.bytes,
        "mask_bytes": image.mask.map(|mask| mask.bytes),
        "scan": image.scan,
        "rotation": image.pose.map(|pose| pose.rotation),
        "translation": image.pose.map(|pose| pose.translation),
        "focal_length": geometry.focal_length,
        "pixel_size": geometry.pixel_size,
        "principal_point": geometry.principal_point,
        "radius": geometry.radius,
    })
}

/// A rotation as its angle and axis; another matrix as its rows.
fn turn(m: &[[f64; 3]; 3]) -> String {
    let dot = |a: usize, b: usize| (0..3).map(|i| m[a][i] * m[b][i]).sum::<f64>();
    let is_rotation = (0..3).all(|a| (0..=a).all(|b| (dot(a, b) - f64::from(u8::from(a == b))).abs() < 1e-4));
    let minors = [[1, 2], [2, 0], [0, 1]].map(|[i, j]| m[1][i] * m[2][j] - m[1][j] * m[2][i]);
    let determinant: f64 = (0..3).map(|i| m[0][i] * minors[i]).sum();
    if !is_rotation || determinant < 0.0 {
        return format!(", times the matrix {}", m.each_ref().map(|row| numbers(row)).join("; "));
    }
    // twice the sine times the axis, and one more than twice the cosine
    let axis = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]];
    let length = axis.iter().map(|v| v * v).sum::<f64>().sqrt();
    let degrees = length.atan2(m[0][0] + m[1][1] + m[2][2] - 1.0).to_degrees();
    if degrees < 1e-4 {
        return String::new();
    }
    // at 180° the axis is that of the symmetric part instead
    let axis = if length > 1e-4 { axis.map(|v| v / length) } else { half_turn_axis(m) };
    let short = |v: f64| number((v * 1e4).round() / 1e4);
    format!(", turned by {}° about {}", short(degrees), axis.map(short).join(" "))
}

/// The axis of a rotation by 180°: `m + 1` is twice its outer product.
fn half_turn_axis(m: &[[f64; 3]; 3]) -> [f64; 3] {
    let largest = (1..3).fold(0, |best, a| if m[a][a] > m[best][best] { a } else { best });
    let column: [f64; 3] = std::array::from_fn(|i| m[i][largest] + f64::from(u8::from(i == largest)));
    let length = column.iter().map(|v| v * v).sum::<f64>().sqrt();
    column.map(|v| v / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_are_described_by_angle_and_axis() {
        assert_eq!(turn(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), "");
        assert_eq!(turn(&[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), ", turned by 90° about 0 0 1");
        assert_eq!(turn(&[[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]), ", turned by 180° about 0 0 1");
        let (c, s) = (30f64.to_radians().cos(), 30f64.to_radians().sin());
        assert_eq!(turn(&[[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]), ", turned by 30° about 1 0 0");
        assert_eq!(
            turn(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0]]),
            ", times the matrix 1 0 0; 0 1 0; 0 0 2"
        );
        assert!(turn(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]).contains("matrix"), "a mirror");
    }
}

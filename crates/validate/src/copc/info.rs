//! The info record: the cube, the spacing, and what it says of GPS times.

use pointmill_format::Aabb;
use pointmill_format::copc::Info;
use serde_json::{Value, json};

use super::front::Front;
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// The fields of the record; what is wrong with them is a finding. `None` if there is no such record at its place.
pub(super) fn check(front: &Front, findings: &Findings) -> Option<Info> {
    let judge = |is_so: bool, subject: &'static str, expected: Value, found: Value| {
        findings.checked(Check::OctreeInfo, 1);
        if !is_so {
            findings.push(Finding::new(Check::OctreeInfo, subject, expected, found));
        }
        is_so
    };
    let record = front.all("copc", 1).next();
    let bytes = record.map_or(0, |record| record.data.len());
    judge(bytes == Info::LEN, "bytes of the record", json!(Info::LEN), json!(bytes));
    let data = record?.data.first_chunk::<{ Info::LEN }>()?;
    let info = Info::from_bytes(data);
    let reserved = data[72..].iter().filter(|b| **b != 0).count();
    judge(reserved == 0, "reserved bytes that are not 0", json!(0), json!(reserved));
    let is_middle = info.center.iter().all(|c| c.is_finite());
    judge(is_middle, "middle of the cube", json!("three numbers"), json!(format!("{:?}", info.center)));
    let is_half = info.half_size > 0.0 && info.half_size.is_finite();
    judge(is_half, "half size of the cube", json!("above 0"), json!(format!("{}", info.half_size)));
    let is_spacing = info.spacing > 0.0 && info.spacing.is_finite();
    judge(is_spacing, "spacing", json!("above 0"), json!(format!("{}", info.spacing)));
    let [first, last] = info.gps_time;
    let is_range = first <= last && first.is_finite() && last.is_finite();
    judge(is_range || front.points() == 0, "GPS times", json!("the least, then the greatest"), json!(info.gps_time));
    if is_middle && is_half {
        outside(front, &info.cube(), findings);
        if is_spacing {
            usual(&info, findings);
        }
    }
    Some(info)
}

/// Bounds of the header that are not in the cube, by more than the rounding of doubles.
fn outside(front: &Front, cube: &Aabb, findings: &Findings) {
    findings.checked(Check::OctreeInfo, 1);
    let is_inside = |(axis, [min, max]): (usize, [f64; 2])| {
        let largest = cube.min[axis].abs().max(cube.max[axis].abs());
        let tolerance = 4.0 * (largest.next_up() - largest);
        min >= cube.min[axis] - tolerance && max <= cube.max[axis] + tolerance
    };
    let bounds = front.bounds();
    if front.points() > 0 && !bounds.into_iter().enumerate().all(is_inside) {
        let expected = json!([0, 1, 2].map(|a| [cube.min[a], cube.max[a]]));
        findings.push(Finding::new(Check::OctreeInfo, "bounds of the header in the cube", expected, json!(bounds)));
    }
}

fn usual(info: &Info, findings: &Findings) {
    let side = 2.0 * info.half_size;
    let (least, most) = (side / 1024.0, side / 16.0);
    if !(least..=most).contains(&info.spacing) {
        let usual = format!("side / 1024 to side / 16, which are {least} to {most}");
        findings.push(Finding::new(Check::OctreeInfo, "spacing", usual, info.spacing).warning());
    }
}

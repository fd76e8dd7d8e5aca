//! With the sources at hand.

use pointmill_validate::{Check, Outcome};

use super::cloud::{Cloud, assert_only, broken, check_with, terrain};

/// The points as a PLY file.
pub(crate) fn ply(cloud: &Cloud, with_colour: bool) -> Vec<u8> {
    let colour = ["red", "green", "blue"].map(|c| format!("property uchar {c}\n")).concat();
    let mut out = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         {}property ushort intensity\nproperty uchar classification\nend_header\n",
        cloud.points.len(),
        if with_colour { colour.as_str() } else { "" },
    )
    .into_bytes();
    for p in &cloud.points {
        cloud.world(p).iter().for_each(|v| out.extend(v.to_le_bytes()));
        if with_colour {
            out.extend(p.rgb);
        }
        out.extend(p.intensity.to_le_bytes());
        out.push(p.class);
    }
    out
}

fn compare(stored: &Cloud, source: &Cloud) -> Outcome {
    check_with(&stored.parts().bytes().0, &[("source.ply", ply(source, stored.colour == "rgb"))])
}

#[test]
fn every_point_of_the_sources_is_found_whatever_colours_come_from() {
    for colour in ["rgb", "intensity", "none"] {
        let cloud = Cloud { colour, ..terrain() };
        let outcome = compare(&cloud, &cloud);
        assert!(outcome.ok && outcome.problems.is_empty(), "{colour}: {:#?}", outcome.problems);
        assert!(outcome.check(Check::Against).unwrap().skipped.is_none());
        let summary = outcome.against.unwrap();
        assert_eq!((summary.points_expected, summary.points_found), (31_720, 31_720));
    }
}

#[test]
fn sources_of_16_bits_are_compared_at_8() {
    let mut cloud = terrain();
    let mut las: Vec<[u16; 3]> = Vec::new();
    for (i, p) in cloud.points.iter_mut().enumerate() {
        let wide = p.rgb.map(|v| (u32::from(v) * 257).saturating_sub(i as u32 % 300) as u16);
        p.rgb = wide.map(|v| ((u32::from(v) * 255 + 32_767) / 65_535) as u8);
        las.push(wide);
    }
    let mut text = String::from("x,y,z,red,green,blue,intensity,classification\n");
    for (p, rgb) in cloud.points.iter().zip(&las) {
        let [x, y, z] = cloud.world(p);
        let [r, g, b] = rgb;
        text += &format!("{x},{y},{z},{r},{g},{b},{},{}\n", p.intensity, p.class);
    }
    let mut parts = cloud.parts();
    // numbers of text are read as other types than those of the file
    parts.description["attributes"].as_array_mut().unwrap().truncate(2);
    let outcome = check_with(&parts.bytes().0, &[("source.csv", text.into_bytes())]);
    let colours = outcome.problems.iter().filter(|p| p.subject.contains("rgb")).count();
    assert_eq!(colours, 0, "{:#?}", outcome.problems);
}

#[test]
fn a_missing_a_moved_and_a_recoloured_point_are_named() {
    let cloud = terrain();
    let mut source = cloud.clone();
    source.points[10].rgb[1] ^= 1;
    let outcome = compare(&cloud, &source);
    assert_only(&outcome, Check::Against, 1);
    assert_eq!(outcome.problems[0].subject, "rgb of a point");

    let mut source = cloud.clone();
    source.points[11].x[2] += 1;
    assert_only(&compare(&cloud, &source), Check::Against, 2); // one missing, one surplus

    let mut source = cloud.clone();
    source.points.truncate(31_719);
    assert_only(&compare(&cloud, &source), Check::Against, 1);

    let mut source = cloud.clone();
    source.points[12].class ^= 1;
    assert_only(&compare(&cloud, &source), Check::Against, 1);
}

#[test]
fn what_coarse_planes_do_not_tell_comes_from_the_sources() {
    let cloud = Cloud { planes: 1, ..terrain() };
    let outcome = compare(&cloud, &cloud);
    assert!(outcome.ok, "{:#?}", outcome.problems);
    for check in &outcome.checks {
        assert_eq!(
            check.skipped.is_some(),
            [Check::Blocks, Check::Report, Check::Accuracy].contains(&check.name),
            "{check}"
        );
    }

    let mut source = cloud.clone();
    source.points[11].x[0] += 200;
    assert!(broken(&compare(&cloud, &source)).contains(&Check::Quantisation));
    let mut source = cloud.clone();
    source.points[12].class ^= 1;
    assert!(broken(&compare(&cloud, &source)).contains(&Check::Against));

    let mut parts = cloud.parts();
    let at = (0..parts.points).find(|at| parts.level(*at) == 1).unwrap();
    parts.colours[at] ^= 4;
    let outcome = check_with(&parts.bytes().0, &[("source.ply", ply(&cloud, true))]);
    assert_only_errors(&outcome, Check::Colours);
}

#[test]
fn positions_that_cannot_be_had_are_not_compared_and_it_is_said() {
    let cloud = Cloud { planes: 1, ..terrain() };
    let mut source = cloud.clone();
    source.points.pop();
    let outcome = compare(&cloud, &source);
    let against = outcome.check(Check::Against).unwrap();
    assert!(!against.ok && against.skipped.as_ref().unwrap().contains("another number of points"), "{against}");
}

/// All errors are of one check; warnings are not looked at.
fn assert_only_errors(outcome: &Outcome, check: Check) {
    assert_eq!(broken(outcome), [check], "{:#?}", outcome.problems);
}

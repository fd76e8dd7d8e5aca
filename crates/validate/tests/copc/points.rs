//! Faults of points: where they are, how they were sampled, what header and info record say of them.

use pointmill_format::NodeKey;
use pointmill_validate::{Check, Severity};

use crate::file::{INFO, Writer, foreign, good};
use crate::support::{Cloud, SCALE, SIDE, Sampler, assert_only, broken, distance_squared, floor};

/// The good octree with a point of a leaf moved out of its box to the east, by that many steps.
fn moved(steps: i32) -> Cloud {
    let mut cloud = Cloud::new(Sampler::Poisson);
    // in the west, so that the cube has room
    let is_leaf = |cloud: &Cloud, key: &NodeKey| !cloud.is_inner(*key) && cloud.nodes[key].len() > 1;
    let leaf = cloud.nodes.keys().copied().find(|key| key.x + 1 < 1 << key.level && is_leaf(&cloud, key)).unwrap();
    let upper = (leaf.x as i32 + 1) * (SIDE >> leaf.level);
    cloud.nodes.get_mut(&leaf).unwrap()[0].position[0] = upper + steps;
    cloud
}

#[test]
fn a_point_outside_of_its_node() {
    let of = |steps, writer: Writer| writer.encode(&moved(steps)).validate().check(Check::Boxes).unwrap().clone();
    let other = || Writer { software: "another", own: None, ..Writer::default() };
    for (steps, ours, theirs) in [(0, (0, 0), (0, 0)), (1, (1, 0), (0, 1)), (2, (1, 0), (1, 0))] {
        let (own, foreign) = (of(steps, Writer::default()), of(steps, other()));
        assert_eq!((own.found, own.warnings), ours, "{steps} steps");
        assert_eq!((foreign.found, foreign.warnings), theirs, "{steps} steps, another program");
    }
}

#[test]
fn bounds_of_the_header_are_those_of_the_points() {
    let file = good();
    let [max, min] = [211, 219].map(|at| file.f64(at));
    for (at, value) in [(211, max + 2.0 * SCALE), (219, min - 2.0 * SCALE), (219, min + 2.0 * SCALE)] {
        let mut file = file.clone();
        file.put(at, &value.to_le_bytes());
        assert_only(&file.validate(), Check::TightBox, 1);
    }
    let mut near = file;
    near.put(211, &(max + 0.4 * SCALE).to_le_bytes());
    assert_only(&near.validate(), Check::TightBox, 1);
    let mut theirs = foreign();
    theirs.put(211, &(max + 0.4 * SCALE).to_le_bytes());
    assert!(theirs.validate().ok, "less than a step, of another program");
}

#[test]
fn points_by_return() {
    let mut file = good();
    file.put(255, &5999u64.to_le_bytes());
    assert_only(&file.validate(), Check::Returns, 1);
    file.put(263, &1u64.to_le_bytes());
    assert_only(&file.validate(), Check::Returns, 1);
}

#[test]
fn the_range_of_gps_times() {
    let file = good();
    let [first, last] = [56, 64].map(|at| file.f64(INFO + at));
    let mut narrow = file.clone();
    narrow.put(INFO + 64, &(last - 0.01).to_le_bytes());
    let outcome = narrow.validate();
    assert_eq!(broken(&outcome), [Check::GpsTime]);
    assert!(outcome.problems.iter().any(|p| p.node.is_some() && p.points == Some(1)), "{:#?}", outcome.problems);
    let mut wide = file.clone();
    wide.put(INFO + 56, &(first - 0.01).to_le_bytes());
    assert_only(&wide.validate(), Check::GpsTime, 1);
    let mut theirs = foreign();
    theirs.put(INFO + 56, &(first - 0.01).to_le_bytes());
    assert!(theirs.validate().ok, "nothing is outside");
    let mut turned = file;
    turned.put(INFO + 56, &(last + 1.0).to_le_bytes());
    assert!(broken(&turned.validate()).contains(&Check::OctreeInfo));
}

#[test]
fn points_of_a_node_are_in_the_order_of_time() {
    let mut cloud = Cloud::new(Sampler::Poisson);
    for points in cloud.nodes.values_mut() {
        points.sort_by(|a, b| b.gps_time.total_cmp(&a.gps_time));
    }
    let ours = Writer { is_unsorted: true, ..Writer::default() };
    assert_only(&ours.encode(&cloud).validate(), Check::GpsTime, 1);
    let theirs = Writer { software: "another", own: None, ..ours };
    let outcome = theirs.encode(&cloud).validate();
    assert!(outcome.ok && outcome.problems.iter().any(|p| p.check == Check::GpsTime), "{:#?}", outcome.problems);
}

#[test]
fn gps_times_that_are_no_numbers_are_a_warning() {
    let mut cloud = Cloud::new(Sampler::Poisson);
    let mut times = cloud.nodes.values_mut().flatten().map(|p| &mut p.gps_time);
    *times.nth(3).unwrap() = f64::NAN;
    *times.nth(3).unwrap() = f64::NEG_INFINITY;
    let outcome = Writer::default().encode(&cloud).validate();
    assert!(outcome.ok, "{:#?}", outcome.problems);
    let found: Vec<_> = outcome.problems.iter().map(|p| (p.check, p.severity, p.points)).collect();
    assert_eq!(found, [(Check::GpsTime, Severity::Warning, Some(2))]);
}

#[test]
fn colours_of_8_bits_are_a_warning() {
    let mut cloud = Cloud::new(Sampler::Poisson);
    cloud.nodes.values_mut().flatten().for_each(|p| p.rgb = p.rgb.map(|v| v >> 8));
    let outcome = Writer::default().encode(&cloud).validate();
    assert!(outcome.ok);
    let found: Vec<_> = outcome.problems.iter().map(|p| (p.check, p.severity)).collect();
    assert_eq!(found, [(Check::ColourDepth, Severity::Warning)]);
}

#[test]
fn a_pair_closer_than_the_spacing() {
    let mut cloud = Cloud::new(Sampler::Poisson);
    cloud.raise(|p, root| root.iter().any(|q| distance_squared(p, q) < 120 * 120));
    let outcome = Writer::default().encode(&cloud).validate();
    assert_only(&outcome, Check::Spacing, 1);
    assert_eq!(outcome.problems[0].node, Some(NodeKey::ROOT.into()));
    let theirs = Writer { software: "another", own: None, ..Writer::default() }.encode(&cloud).validate();
    assert!(theirs.ok && theirs.check(Check::Spacing).unwrap().skipped.is_some(), "{:#?}", theirs.problems);
    assert_eq!(theirs.quality[0].close, outcome.quality[0].close, "measured all the same");
}

#[test]
fn a_hole_at_the_coarsest_level() {
    let mut cloud = Cloud::new(Sampler::Poisson);
    cloud.make_hole();
    let outcome = Writer::default().encode(&cloud).validate();
    assert_eq!(broken(&outcome), [Check::Coverage], "{:#?}", outcome.problems);
}

#[test]
fn a_plane_between_nodes_that_was_sampled_on_both_sides() {
    let of = |alone| Writer::default().encode(&Cloud::sampled(floor(), Sampler::Poisson, alone)).validate();
    let honest = of(false);
    assert!(honest.ok && honest.problems.is_empty(), "{:#?}", honest.problems);
    let doubled = of(true);
    assert_eq!(broken(&doubled), [Check::Seams], "{:#?}", doubled.problems);
}

#[test]
fn nodes_without_points() {
    let mut cloud = Cloud::new(Sampler::Poisson);
    let leaf = cloud.nodes.keys().copied().rfind(|key| !cloud.is_inner(*key)).unwrap();
    let points = std::mem::take(cloud.nodes.get_mut(&leaf).unwrap());
    let outcome = Writer::default().encode(&cloud).validate();
    assert!(outcome.ok && !points.is_empty(), "{:#?}", outcome.problems);
    let found: Vec<_> = outcome.problems.iter().map(|p| (p.check, p.severity)).collect();
    assert_eq!(found, [(Check::Pages, Severity::Warning)], "a leaf");
}

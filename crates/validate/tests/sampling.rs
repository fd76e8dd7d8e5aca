//! Seams between nodes, and the figures of quality.

mod support;

use pointmill_format::NodeKey;
use pointmill_format::potree2::Encoding;
use pointmill_validate::Check;
use support::{Cloud, Point, SCALE, Sampler, distance_squared, floor};

#[test]
fn a_plane_between_nodes_that_was_sampled_on_both_sides() {
    for sampler in [Sampler::Poisson, Sampler::Grid] {
        let honest = Cloud::sampled(floor(), sampler, false).encode(Encoding::Default).validate();
        assert!(honest.ok && honest.problems.is_empty(), "{sampler:?}: {:#?}", honest.problems);
        assert!(honest.quality[..5].iter().all(|l| l.close_across == 0 && l.sampled > 0), "{:#?}", honest.quality);

        let doubled = Cloud::sampled(floor(), sampler, true).encode(Encoding::Default).validate();
        assert_eq!(support::broken(&doubled), [Check::Seams], "{sampler:?}: {:#?}", doubled.problems);
        let named = |level| doubled.problems.iter().any(|p| p.subject.contains(&format!("points of level {level} ")));
        assert!([2, 3, 4].into_iter().all(named), "{sampler:?}: {:#?}", doubled.problems);
        for level in &doubled.quality[2..5] {
            let share = level.close_across as f64 / level.sampled as f64;
            assert!(share > 0.1, "{sampler:?}: {share} of level {}", level.level);
        }
    }
}

#[test]
fn seams_of_datasets_that_state_no_sampling_are_measured_only() {
    let mut files = Cloud::sampled(floor(), Sampler::Poisson, true).encode(Encoding::Default);
    files.metadata.extra.clear();
    let outcome = files.validate();
    assert!(outcome.ok && outcome.problems.is_empty(), "{:#?}", outcome.problems);
    assert!(outcome.check(Check::Seams).unwrap().skipped.is_some());
    assert!(outcome.quality[3].close_across > 100);
}

#[test]
fn figures_of_a_level_count_what_is_near_and_what_is_covered() {
    let cloud = Cloud::new(Sampler::Poisson);
    let outcome = cloud.encode(Encoding::Brotli).validate();
    let below: Vec<&Point> = cloud.nodes.iter().filter(|(k, _)| k.level > 0).flat_map(|(_, p)| p).collect();
    let root = &cloud.nodes[&NodeKey::ROOT];
    let nearest = |p: &Point, others: &[Point]| {
        let distances = others.iter().filter(|q| !std::ptr::eq(*q, p)).map(|q| distance_squared(p, q));
        (distances.min().unwrap() as f64).sqrt() / 128.0
    };
    let level = &outcome.quality[0];
    assert_eq!((level.sampled, level.close), (root.len() as u64, 0));
    let exempt = cloud.nodes.iter().filter(|(k, p)| k.level > 0 && p.len() == 1 && cloud.is_inner(**k)).count();
    assert_eq!(level.below, (below.len() - exempt) as u64);
    let counted = |reach: f64| below.iter().filter(|p| nearest(p, root) <= reach).count() as u64;
    assert!(level.below_within_1.abs_diff(counted(1.0)) <= exempt as u64, "{level:?}, {}", counted(1.0));
    assert!(level.below_within_1_5.abs_diff(counted(1.5)) <= exempt as u64);
    assert!(level.below_within_1 < level.below, "nothing tells the shares apart");
    let next: u64 = cloud.nodes.iter().filter(|(k, _)| k.level == 1).map(|(_, p)| p.len() as u64).sum();
    assert!(next.abs_diff(level.offered) <= exempt as u64, "{next}, {level:?}");
    assert_eq!(level.offered_within_1, level.offered, "the sample is maximal");
    let mut distances: Vec<f64> = root.iter().map(|p| nearest(p, root)).filter(|d| *d <= 8.0).collect();
    distances.sort_unstable_by(f64::total_cmp);
    let median = distances[distances.len().div_ceil(2) - 1];
    assert!((level.nearest_median.unwrap() - median).abs() <= 0.001, "{median}, {level:?}");

    let twice = Cloud::sampled(floor(), Sampler::Poisson, true).encode(Encoding::Default).validate();
    assert!(twice.quality.iter().all(|l| l.close_inside == 0 && l.close == l.close_across), "{:#?}", twice.quality);
}

#[test]
fn the_first_view_counts_requests_until_the_budget_is_there() {
    let files = Cloud::new(Sampler::Poisson).encode(Encoding::Default);
    let view = files.validate().first_view.unwrap();
    let chunks = 1 + files.hierarchy.chunks_exact(22).filter(|r| r[0] == 2).count() as u64;
    assert!(chunks > 1);
    // fewer points than the budget: all of it is loaded
    assert_eq!((view.points, view.nodes), (6000, files.entries.len() as u64));
    assert_eq!(view.requests, 1 + chunks + view.nodes);
    let json = files.metadata.to_json().len();
    assert_eq!(view.bytes, (json + files.hierarchy.len() + files.octree.len()) as u64);
    assert_eq!(view.root_points, u64::from(files.entry(NodeKey::ROOT).points));
    assert_eq!(view.first_chunk_bytes, files.metadata.first_chunk_size);
    let extent = files.metadata.attributes[0].max[0] - files.metadata.attributes[0].min[0];
    let ratio = f64::from(support::SIDE) * SCALE / extent;
    assert!((view.cube_over_extent.unwrap() - ratio).abs() < 1e-9 && ratio < 1.01, "{view:?}");
}

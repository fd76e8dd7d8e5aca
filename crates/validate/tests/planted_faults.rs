//! Every check has seen its own fault: a good dataset, one planted break, exactly that finding and no other.

mod support;

use pointmill_format::NodeKey;
use pointmill_format::potree2::{Encoding, NodeRecord};
use pointmill_validate::{Check, Severity};
use support::{Cloud, Files, Point, SCALE, STRIDE, Sampler, assert_only, distance_squared};

const BOTH: [Encoding; 2] = [Encoding::Default, Encoding::Brotli];

fn good(encoding: Encoding) -> Files {
    Cloud::new(Sampler::Poisson).encode(encoding)
}

#[test]
fn a_good_dataset_has_no_findings() {
    for sampler in [Sampler::Poisson, Sampler::Grid] {
        for encoding in BOTH {
            let outcome = Cloud::new(sampler).encode(encoding).validate();
            assert!(outcome.ok && outcome.problems.is_empty(), "{:#?}", outcome.problems);
            assert_eq!(outcome.points, 6000);
            assert!(outcome.quality.len() >= 4, "{} levels", outcome.quality.len());
            assert!(outcome.quality.iter().all(|l| l.largest_hole.is_none_or(|h| h <= 2.0)));
            for check in outcome.checks.iter().filter(|c| c.skipped.is_none()) {
                assert!(check.checked > 0, "{} looked at nothing", check.name.name());
            }
        }
    }
}

#[test]
fn metadata_out_of_range() {
    let mut files = good(Encoding::Default);
    files.metadata.step_size = 0;
    assert_only(&files.validate(), Check::Metadata, 1);
}

#[test]
fn metadata_that_readers_refuse() {
    let mut files = good(Encoding::Default);
    let text = files.metadata.to_json().replacen("\"uint16\"", "\"undefined\"", 1);
    files.text = Some(text);
    let outcome = files.validate();
    assert_only(&outcome, Check::Metadata, 1);
    assert!(outcome.checks.iter().skip(1).all(|c| c.skipped.is_some()));
    files.text = Some("{ \"version\": \"2.0\", ".into());
    assert!(!files.validate().ok);
}

#[test]
fn an_unusual_spacing_or_projection_is_a_warning() {
    let mut files = good(Encoding::Default);
    files.metadata.projection = "EPSG:25832".into();
    let outcome = files.validate();
    assert!(outcome.ok);
    assert_eq!(outcome.problems.iter().map(|p| p.severity).collect::<Vec<_>>(), [Severity::Warning]);
}

#[test]
fn an_orphaned_hierarchy_chunk() {
    let mut files = good(Encoding::Default);
    files.hierarchy.extend([0; NodeRecord::LEN]);
    assert_only(&files.validate(), Check::Hierarchy, 1);
}

#[test]
fn a_proxy_that_lies_about_its_points() {
    let mut files = good(Encoding::Default);
    let at = files.proxy_at();
    files.hierarchy[at + 2] ^= 1;
    assert_only(&files.validate(), Check::Hierarchy, 1);
}

#[test]
fn a_chunk_with_a_record_too_many() {
    let mut files = good(Encoding::Default);
    let at = files.proxy_at();
    let mut record = NodeRecord::from_bytes(files.hierarchy[at..at + 22].try_into().unwrap());
    // the last chunk, so that nothing moves
    let last = (0..files.hierarchy.len() / 22).map(|i| i * 22).filter(|at| files.hierarchy[*at] == 2);
    let at = last.max_by_key(|at| u64::from_le_bytes(files.hierarchy[at + 6..at + 14].try_into().unwrap())).unwrap();
    record.byte_size = u64::from_le_bytes(files.hierarchy[at + 14..at + 22].try_into().unwrap()) + 22;
    files.hierarchy[at + 14..at + 22].copy_from_slice(&record.byte_size.to_le_bytes());
    files.hierarchy.extend([0; NodeRecord::LEN]);
    assert_only(&files.validate(), Check::Hierarchy, 1);
}

#[test]
fn a_wrong_node_type() {
    for encoding in BOTH {
        let mut files = good(encoding);
        let at = files.record_at(NodeKey::ROOT);
        files.hierarchy[at] = 1;
        assert_only(&files.validate(), Check::NodeTypes, 1);
    }
}

#[test]
fn an_empty_node() {
    for encoding in BOTH {
        let mut cloud = Cloud::new(Sampler::Poisson);
        let inner = *cloud.nodes.keys().rfind(|k| cloud.is_inner(**k)).unwrap();
        let free = (0..8).filter_map(|c| inner.child(c)).find(|k| !cloud.nodes.contains_key(k)).unwrap();
        cloud.nodes.insert(free, Vec::new());
        let outcome = cloud.encode(encoding).validate();
        assert_only(&outcome, Check::EmptyNodes, 1);
        assert_eq!(outcome.problems[0].node, Some(free.into()));
    }
}

#[test]
fn a_wrong_depth() {
    let mut files = good(Encoding::Default);
    files.metadata.depth = 0;
    assert_only(&files.validate(), Check::Depth, 1);
}

#[test]
fn a_wrong_number_of_points() {
    let mut files = good(Encoding::Brotli);
    files.metadata.points += 1;
    assert_only(&files.validate(), Check::PointCount, 1);
}

#[test]
fn bytes_of_the_octree_that_belong_to_nobody() {
    for encoding in BOTH {
        let mut files = good(encoding);
        files.octree.extend([0; STRIDE]);
        assert_only(&files.validate(), Check::PayloadRanges, 1);
    }
}

#[test]
fn an_octree_that_was_cut_short() {
    let mut files = good(Encoding::Default);
    files.octree.truncate(files.octree.len() - 1);
    let outcome = files.validate();
    assert_only(&outcome, Check::PayloadRanges, 1);
    assert!(outcome.check(Check::Coverage).unwrap().skipped.is_some());
}

#[test]
fn a_damaged_brotli_stream() {
    let mut files = good(Encoding::Brotli);
    let last = *files.entries.iter().max_by_key(|e| e.byte_offset).unwrap();
    files.octree[last.byte_offset as usize..].fill(0xff);
    let outcome = files.validate();
    assert_only(&outcome, Check::Payloads, 1);
    assert_eq!(outcome.problems[0].node, Some(last.key.into()));
}

#[test]
fn a_brotli_node_out_of_order() {
    let mut cloud = Cloud::new(Sampler::Poisson);
    // the payload as the format page describes it, with two points exchanged
    let mut points = cloud.nodes[&NodeKey::ROOT].clone();
    points.sort_by_key(|p| morton(p.position));
    cloud.payload = Some((NodeKey::ROOT, brotli(&planar(&points))));
    assert!(cloud.encode(Encoding::Brotli).validate().ok);
    points.swap(40, 41);
    cloud.payload = Some((NodeKey::ROOT, brotli(&planar(&points))));
    let outcome = cloud.encode(Encoding::Brotli).validate();
    assert_only(&outcome, Check::Order, 1);
    assert_eq!(outcome.problems[0].node, Some(NodeKey::ROOT.into()));
}

#[test]
fn a_negative_coordinate() {
    for encoding in BOTH {
        let mut cloud = Cloud::new(Sampler::Poisson);
        // the leaf point nearest to x = 0, so that it stays near everything it was near to
        let leaves = cloud.nodes.keys().copied().filter(|k| !cloud.is_inner(*k)).collect::<Vec<_>>();
        let nearest = |k: &NodeKey| cloud.nodes[k].iter().map(|p| p.position[0]).min().unwrap();
        let leaf = *leaves.iter().min_by_key(|k| nearest(k)).unwrap();
        let points = cloud.nodes.get_mut(&leaf).unwrap();
        points.iter_mut().min_by_key(|p| p.position[0]).unwrap().position[0] = -1;
        assert_only(&cloud.encode(encoding).validate(), Check::Coordinates, 1);
    }
}

#[test]
fn a_point_in_a_node_that_is_not_its_own() {
    for encoding in BOTH {
        let mut cloud = Cloud::new(Sampler::Poisson);
        let leaves: Vec<NodeKey> =
            cloud.nodes.keys().copied().filter(|k| !cloud.is_inner(*k) && cloud.nodes[k].len() > 1).collect();
        let stray = cloud.nodes.get_mut(&leaves[0]).unwrap().pop().unwrap();
        cloud.nodes.get_mut(leaves.last().unwrap()).unwrap().push(stray);
        let outcome = cloud.encode(encoding).validate();
        assert_only(&outcome, Check::Boxes, 1);
        assert_eq!(outcome.problems[0].points, Some(1));
    }
}

#[test]
fn a_tight_box_one_step_too_large() {
    let mut files = good(Encoding::Default);
    files.metadata.attributes[0].max[1] += SCALE;
    assert_only(&files.validate(), Check::TightBox, 1);
}

#[test]
fn attribute_bounds_that_are_too_narrow_or_that_nothing_attains() {
    for (attribute, change) in [(2, 1.0), (2, -1.0), (4, 1.0), (5, -0.125)] {
        let mut files = good(Encoding::Brotli);
        files.metadata.attributes[attribute].min[0] += change;
        assert_only(&files.validate(), Check::AttributeRanges, 1);
    }
}

#[test]
fn a_histogram_that_miscounts() {
    let mut files = good(Encoding::Default);
    files.metadata.attributes[3].histogram.as_mut().unwrap()[2] -= 1;
    assert_only(&files.validate(), Check::Histogram, 1);
}

#[test]
fn a_pair_closer_than_the_spacing() {
    for encoding in BOTH {
        let mut cloud = Cloud::new(Sampler::Poisson);
        cloud.raise(|p, root| root.iter().any(|q| distance_squared(p, q) < 120 * 120));
        let outcome = cloud.encode(encoding).validate();
        assert_only(&outcome, Check::Spacing, 1);
        assert_eq!(outcome.problems[0].node, Some(NodeKey::ROOT.into()));
    }
}

#[test]
fn two_points_in_a_cell_of_grid_sampling() {
    let mut cloud = Cloud::new(Sampler::Grid);
    let cell = |p: &Point| p.position.map(|v| v / 128);
    cloud.raise(|p, root| root.iter().any(|q| cell(q) == cell(p)));
    assert_only(&cloud.encode(Encoding::Default).validate(), Check::Spacing, 1);
}

#[test]
fn a_hole_at_the_coarsest_level() {
    for encoding in BOTH {
        let mut cloud = Cloud::new(Sampler::Poisson);
        cloud.make_hole();
        let outcome = cloud.encode(encoding).validate();
        assert_eq!(support::broken(&outcome), [Check::Coverage], "{:#?}", outcome.problems);
        let hole = outcome.quality[0].largest_hole.unwrap();
        assert!(hole > 2.0 && hole <= 4.0, "{hole}");
        assert!(outcome.problems.iter().any(|p| p.subject.ends_with("up to 0")));
    }
}

fn morton(p: [i32; 3]) -> u128 {
    (0..32).fold(0, |c, k| (0..3).fold(c, |c, a| c | u128::from(p[a] as u32 >> k & 1) << (3 * k + a)))
}

/// The planar layout of BROTLI payloads.
fn planar(points: &[Point]) -> Vec<u8> {
    let mut out = Vec::new();
    for p in points {
        let code = morton(p.position);
        out.extend(((code >> 48) as u64).to_le_bytes());
        out.extend((code as u64 & ((1 << 48) - 1)).to_le_bytes());
    }
    for p in points {
        out.extend((morton(p.rgb.map(i32::from)) as u64).to_le_bytes());
    }
    points.iter().for_each(|p| out.extend(p.intensity.to_le_bytes()));
    points.iter().for_each(|p| out.push(p.classification));
    points.iter().for_each(|p| out.push(p.scan_angle as u8));
    points.iter().for_each(|p| out.extend(p.gps_time.to_le_bytes()));
    out
}

/// A Brotli stream of uncompressed meta-blocks (RFC 7932 §9): window bits, then for each 65,536 bytes a length and
/// the bytes, then an empty last block.
fn brotli(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let (mut pending, mut count) = (0u64, 0u32);
    let mut bits = |out: &mut Vec<u8>, value: u64, n: u32, align: bool| {
        pending |= value << count;
        count += n;
        while count >= 8 || (align && count > 0) {
            out.push(pending as u8);
            pending >>= 8;
            count = count.saturating_sub(8);
        }
    };
    bits(&mut out, 0b1011, 4, false); // WBITS 22
    for chunk in bytes.chunks(1 << 16) {
        // ISLAST 0, MNIBBLES 4, MLEN − 1, ISUNCOMPRESSED 1
        bits(&mut out, (chunk.len() as u64 - 1) << 3 | 1 << 19, 20, true);
        out.extend(chunk);
    }
    bits(&mut out, 0b11, 2, true); // ISLAST, ISLASTEMPTY
    out
}

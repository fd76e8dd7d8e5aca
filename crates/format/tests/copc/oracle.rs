//! The `las` crate reads the same nodes.

use las::CopcReader;
use pointmill_format::copc::{Dataset, Entry};
use pointmill_format::{NodeKey, NodePoints};

use crate::util::{FIXTURES, golden};

/// Points that the `las` crate reads of every node of the file at `path`, which must be ours.
pub(crate) fn assert_same(path: &std::path::Path) -> usize {
    let dataset = Dataset::open(path).unwrap();
    let mut reader = CopcReader::from_path(path).unwrap();
    let entries: Vec<las::copc::Entry> = reader.hierarchy_entries().collect();
    let (mut points, mut count, nodes) = (NodePoints::default(), 0, dataset.read_hierarchy().unwrap());
    assert_eq!(entries.len(), nodes.len());
    for node in &nodes {
        let is_it = |entry: &&las::copc::Entry| {
            let las::copc::VoxelKey { l, x, y, z } = entry.key;
            Entry { key: [l, x, y, z], offset: 0, byte_size: 0, points: 0 }.node_key() == Some(node.key)
        };
        let entry = entries.iter().find(is_it).unwrap();
        assert_eq!(u64::try_from(entry.point_count).unwrap(), node.points);
        if node.points == 0 {
            continue;
        }
        dataset.read_points(node, &mut points).unwrap();
        let theirs = reader.read_entry(entry).unwrap();
        let intensity = points.column::<u16>("intensity").unwrap();
        let times = points.column::<f64>("gps-time").unwrap();
        for (i, point) in theirs.points().enumerate() {
            let point = point.unwrap();
            assert_eq!(points.world(i).unwrap(), [point.x, point.y, point.z], "{}", node.key);
            assert_eq!((intensity[i], times[i]), (point.intensity, point.gps_time.unwrap()), "{}", node.key);
            count += 1;
        }
        let (voxel, ours) = (entry.key.bounds(&reader_info(path)), dataset.copc_info().cube().octant(node.key));
        assert_eq!([voxel.min.x, voxel.min.y, voxel.max.z], [ours.min[0], ours.min[1], ours.max[2]], "{}", node.key);
    }
    assert!(nodes.iter().any(|node| node.key == NodeKey::ROOT));
    count
}

fn reader_info(path: &std::path::Path) -> las::copc::CopcInfoVlr {
    las::Reader::from_path(path).unwrap().header().copc_info_vlr().unwrap()
}

#[test]
fn the_las_crate_reads_the_same_points_of_the_same_nodes() {
    for name in FIXTURES {
        assert_eq!(assert_same(&golden(name)), 22, "{name}");
    }
}

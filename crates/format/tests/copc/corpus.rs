//! Files of others.

use pointmill_format::copc::Dataset;
use pointmill_format::octree::Octree;
use pointmill_format::{OpenOptions, open_scan};
use pointmill_testkit::files::corpus;

use crate::util::{read_all, walk};

/// A file of PDAL.
#[test]
fn a_file_of_another_writer_is_read_whole() {
    let Some(file) = corpus("las/1.2-with-color.copc.laz") else { return };
    let dataset = Dataset::open(&file).unwrap();
    let nodes = read_all(&dataset).unwrap();
    assert_eq!((nodes.len(), walk(&dataset).unwrap().len()), (65, 65));
    assert_eq!(nodes.iter().map(|(_, points)| points.len()).sum::<usize>(), 1065);
    assert_eq!((dataset.info().points, dataset.info().spacing), (Some(1065), 36.216640624999854));
    for (node, (_, points)) in dataset.read_hierarchy().unwrap().iter().zip(&nodes) {
        let node_box = dataset.info().node_box(node.key);
        let is_inside = |p: [f64; 3]| (0..3).all(|a| node_box.min[a] - 1e-9 <= p[a] && p[a] <= node_box.max[a] + 1e-9);
        assert!((0..points.len()).all(|i| is_inside(points.world(i).unwrap())), "{}", node.key);
    }
    let scan = open_scan(&file, &OpenOptions::default()).unwrap();
    assert_eq!(scan.pieces().len(), 65);
}

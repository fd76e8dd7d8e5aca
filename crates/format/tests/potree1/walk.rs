//! One traversal for all octrees.

use std::collections::BTreeMap;

use pointmill_format::octree::{Octree, OctreeNodes};
use pointmill_format::{DatasetKind, NodeKey, NodePoints, open_octree};
use pointmill_testkit::files::fixture;

use crate::util::golden;

/// Points of each node by the one walk that knows no format.
fn walk(octree: &dyn Octree) -> BTreeMap<String, u64> {
    let mut nodes = OctreeNodes::new(octree).unwrap();
    let (mut stack, mut found, mut points) = (vec![NodeKey::ROOT], BTreeMap::new(), NodePoints::default());
    while let Some(key) = stack.pop() {
        nodes.load(octree, key).unwrap();
        stack.extend(nodes.children(key).map(|child| child.key));
        let node = nodes.get(key).unwrap();
        assert!(!node.is_proxy && octree.info().cube.contains(octree.info().node_box(key).center()));
        octree.points(node, &mut points).unwrap();
        assert_eq!(points.len() as u64, octree.count(node).unwrap());
        assert!(points.names().eq(octree.info().attributes.iter().map(|a| a.name.as_str())));
        assert_eq!(points.column::<u16>("rgb").unwrap().len(), 3 * points.len());
        found.insert(key.to_string(), points.len() as u64);
    }
    assert_eq!(found.len(), nodes.len());
    found
}

#[test]
fn a_renderer_walks_potree_1_and_2_in_the_same_way() {
    let counts = [("r", 3), ("r0", 1), ("r7", 2), ("r00", 1), ("r000", 1), ("r0000", 1), ("r00007", 4)];
    let expected: BTreeMap<String, u64> = counts.map(|(name, points)| (name.to_owned(), points)).into();
    for folder in
        [golden("words"), golden("objects"), golden("flat"), fixture("potree2/default"), fixture("potree2/brotli")]
    {
        let octree = open_octree(&folder).unwrap();
        assert_eq!(walk(&*octree), expected, "{}", folder.display());
        assert_eq!((octree.info().points, octree.info().spacing_at(2)), (Some(13), 0.032), "{}", folder.display());
    }
}

#[test]
fn what_is_no_octree_is_refused() {
    let error = open_octree(fixture("bintree/files")).err().unwrap();
    assert!(error.to_string().ends_with("a binary tree, no octree"), "{error}");
    assert_eq!(DatasetKind::detect(golden("words")), Some(DatasetKind::Potree1));
}

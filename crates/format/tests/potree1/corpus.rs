//! Datasets of others.

use std::collections::BTreeMap;

use pointmill_format::Aabb;
use pointmill_format::potree1::Dataset;
use pointmill_testkit::files::corpus;

use crate::util::read_all;

/// The lion of the Potree repository: three attributes, a step of 6.
#[test]
fn the_lion_is_read_whole() {
    let Some(folder) = corpus("potree1/lion_takanawa") else { return };
    let dataset = Dataset::open(&folder).unwrap();
    let (metadata, mut seen) = (dataset.metadata(), Aabb::EMPTY);
    assert_eq!((metadata.record_len(), metadata.step, metadata.points), (18, 6, None));
    let nodes = read_all(&dataset).unwrap();
    let mut levels = BTreeMap::new();
    for (name, points) in &nodes {
        *levels.entry(name.len() - 1).or_insert(0) += points.len();
        let node = metadata.node_cube(name.parse().unwrap());
        for i in 0..points.len() {
            let p = points.world(i).unwrap();
            seen.grow(p);
            assert!((0..3).all(|a| node.min[a] <= p[a] && p[a] <= node.max[a] + 0.001), "{name}: {p:?}");
        }
        let normal = |axis| points.column::<f32>(axis).unwrap();
        let (x, y, z) = (normal("NormalX"), normal("NormalY"), normal("NormalZ"));
        let is_unit = |i: usize| ((x[i].powi(2) + y[i].powi(2) + z[i].powi(2)) - 1.0).abs() < 0.01;
        assert!((0..points.len()).all(is_unit), "{name}");
    }
    assert_eq!((nodes.len(), levels.values().sum::<usize>()), (167, 272_768));
    let tight = metadata.tight_box.unwrap();
    let off = |a: usize| (seen.min[a] - tight.min[a]).abs().max((seen.max[a] - tight.max[a]).abs());
    // positions are truncated to steps of a millimetre
    assert!((0..3).all(|a| off(a) <= 0.0011), "{seen:?}, {tight:?}");
    assert!(dataset.read_hierarchy().unwrap().iter().all(|n| n.declared == dataset.count(n.key).unwrap()));
}

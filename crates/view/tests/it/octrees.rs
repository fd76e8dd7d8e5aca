//! Octrees: every node of every fixture, and all its points.

use std::collections::VecDeque;

use pointmill_format::batches::eight_bit;
use pointmill_format::octree::{Octree, OctreeNode, OctreeNodes};
use pointmill_format::{Column, NodeKey, NodePoints, open_octree};
use pointmill_testkit::files::fixture;

use super::client::{Served, serve};
use super::decode::{Node, nodes, points, units};

const OCTREES: [&str; 8] = [
    "potree2/default",
    "potree2/brotli",
    "potree1/words",
    "potree1/objects",
    "potree1/flat",
    "copc/format6.copc.laz",
    "copc/format8.copc.laz",
    "copc/pages.copc.laz",
];

/// All nodes, proxies followed.
fn all_nodes(served: &Served) -> Vec<Node> {
    let (mut proxies, mut all) = (VecDeque::from(["r".to_owned()]), Vec::new());
    while let Some(name) = proxies.pop_front() {
        let chunk = nodes(&served.bytes(&format!("/api/0/nodes?of={name}")), &name);
        assert!(!chunk[0].is_proxy);
        proxies.extend(chunk.iter().filter(|node| node.is_proxy).map(|node| node.name.clone()));
        all.extend(chunk.into_iter().filter(|node| !node.is_proxy));
    }
    all.sort_by_key(|node| (node.name.len(), node.name.clone()));
    all
}

/// What the format crate reads.
fn expected_nodes(octree: &dyn Octree) -> Vec<OctreeNode> {
    let (mut tree, mut stack, mut all) = (OctreeNodes::new(octree).unwrap(), vec![NodeKey::ROOT], Vec::new());
    while let Some(key) = stack.pop() {
        tree.load(octree, key).unwrap();
        stack.extend(tree.children(key).map(|child| child.key));
        all.push(*tree.get(key).unwrap());
    }
    all.sort_by_key(|node| (node.key.level, node.key.to_string()));
    all
}

#[test]
fn every_node_is_listed_with_its_points() {
    for name in OCTREES {
        let (served, octree) = (serve(&[&fixture(name)]), open_octree(fixture(name)).unwrap());
        let expected = expected_nodes(&*octree).into_iter().map(|node| {
            let points = octree.count(&node).unwrap() as u32;
            Node { name: node.key.to_string(), points, mask: node.child_mask, is_proxy: false }
        });
        let first = served.bytes("/api/0/nodes?of=r");
        assert_eq!(all_nodes(&served), expected.collect::<Vec<_>>(), "{name}");
        assert_eq!(served.bytes("/api/0/nodes?of=r"), first, "{name}: the same, though all chunks are known now");
    }
}

#[test]
fn decoded_points_are_those_of_the_dataset() {
    for name in OCTREES {
        let (served, octree) = (serve(&[&fixture(name)]), open_octree(fixture(name)).unwrap());
        for node in expected_nodes(&*octree) {
            let mut stored = NodePoints::default();
            octree.points(&node, &mut stored).unwrap();
            for every in [1, 3] {
                let target = format!("/api/0/points?units={}&every={every}", node.key);
                check(&served.bytes(&target), &stored, every, &format!("{name} {target}"));
            }
        }
    }
}

fn check(bytes: &[u8], stored: &NodePoints, every: usize, what: &str) {
    let unit = units(bytes);
    assert_eq!(unit.len(), 1);
    let (header, body) = &unit[0];
    assert_eq!((header.count, header.total), (stored.len().div_ceil(every), stored.len()), "{what}");
    let rgb = stored.column::<u16>("rgb");
    let class = stored.column::<u8>("classification");
    let intensity = stored.column::<u16>("intensity");
    let flags = [(2, rgb.is_some()), (8, class.is_some()), (16, intensity.is_some())];
    assert!(flags.iter().all(|(flag, is)| (header.flags & flag != 0) == *is), "{what}: {}", header.flags);
    for (i, point) in points(header, body).iter().enumerate() {
        let at = i * every;
        let world = stored.world(at).unwrap();
        for a in 0..3 {
            // 0.5 steps where positions were rounded, and of the sum and the product half a unit in the last place each
            let exact = stored.quantized().is_some() && header.step[a] == stored.lattice().scale[a];
            let rounding = 4.0 * f64::EPSILON * (world[a].abs() + header.step[a] * 65_536.0);
            let bound = if exact { rounding } else { 0.5 * header.step[a] * (1.0 + 1e-9) + rounding };
            assert!(
                (point.world[a] - world[a]).abs() <= bound,
                "{what}: point {at} is at {:?}, not {world:?}",
                point.world
            );
        }
        let expected = rgb.map_or([0; 3], |v| [v[3 * at], v[3 * at + 1], v[3 * at + 2]].map(eight_bit));
        assert_eq!(point.rgb, expected, "{what}");
        assert_eq!(point.class, class.map_or(0, |v| v[at]), "{what}");
        assert_eq!(point.intensity, intensity.map_or(0, |v| v[at].into()), "{what}");
    }
}

#[test]
fn values_of_an_attribute_are_relative_to_the_least() {
    let served = serve(&[&fixture("potree2/default")]);
    let scene = served.json("/api/0/scene");
    let octree = open_octree(fixture("potree2/default")).unwrap();
    let mut stored = NodePoints::default();
    let root = OctreeNodes::new(&*octree).unwrap().get(NodeKey::ROOT).copied().unwrap();
    octree.points(&root, &mut stored).unwrap();
    for (attribute, column) in octree.info().attributes.iter().zip(stored.columns()) {
        let described = scene["attributes"].as_array().unwrap().iter().find(|a| a["name"] == *attribute.name).unwrap();
        let least = described["min"][0].as_f64().unwrap();
        let name = attribute.name.replace(' ', "%20");
        let bytes = served.bytes(&format!("/api/0/points?units=r&attribute={name}"));
        let unit = units(&bytes);
        for (i, point) in points(&unit[0].0, unit[0].1).iter().enumerate() {
            let raw = raw(column, i * attribute.elements);
            let expected = (raw * attribute.scale[0] + attribute.offset[0] - least) as f32;
            assert_eq!(point.value, Some(expected), "{}", attribute.name);
        }
    }
    let (status, line) = served.refused("/api/0/points?units=r&attribute=nonsense");
    assert!(status == 400 && line.contains("rgb, intensity"), "{line}");
}

fn raw(column: &Column, at: usize) -> f64 {
    match column {
        Column::UInt8(values) => values[at].into(),
        Column::Int16(values) => values[at].into(),
        Column::UInt16(values) => values[at].into(),
        Column::Float64(values) => values[at],
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_point_under_the_cursor_has_all_attributes_exactly() {
    for name in OCTREES {
        let (served, octree) = (serve(&[&fixture(name)]), open_octree(fixture(name)).unwrap());
        let node = expected_nodes(&*octree).into_iter().rfind(|node| octree.count(node).unwrap() > 0).unwrap();
        let mut stored = NodePoints::default();
        octree.points(&node, &mut stored).unwrap();
        let last = stored.len() - 1;
        let point = served.json(&format!("/api/0/point?unit={}&index={last}", node.key));
        let world = stored.world(last).unwrap();
        assert_eq!(point["position"], serde_json::json!(world), "{name}");
        let names: Vec<&str> =
            point["attributes"].as_array().unwrap().iter().map(|a| a["name"].as_str().unwrap()).collect();
        assert_eq!(names, octree.info().attributes.iter().map(|a| a.name.as_str()).collect::<Vec<_>>(), "{name}");
        let (status, line) = served.refused(&format!("/api/0/point?unit={}&index={}", node.key, stored.len()));
        assert!(status == 404 && line.contains("points, no point"), "{line}");
    }
}

#[test]
fn several_nodes_come_in_the_order_of_the_request() {
    let served = serve(&[&fixture("potree2/default")]);
    let names: Vec<String> = all_nodes(&served).into_iter().map(|node| node.name).rev().collect();
    let all = served.bytes(&format!("/api/0/points?units={}", names.join(",")));
    let alone: Vec<u8> = names.iter().flat_map(|name| served.bytes(&format!("/api/0/points?units={name}"))).collect();
    assert_eq!(all, alone);
}

#[test]
fn what_is_no_node_is_named() {
    let served = serve(&[&fixture("potree2/default")]);
    for (target, expected) in [
        ("/api/0/nodes", 400),
        ("/api/0/nodes?of=x", 400),
        ("/api/0/nodes?of=r8", 400),
        ("/api/0/nodes?of=r111", 404),
        ("/api/0/nodes?of=r7", 404), // a node, but no chunk begins with it
        ("/api/0/points", 400),
        ("/api/0/points?units=", 400),
        ("/api/0/points?units=r111", 404),
        ("/api/0/points?units=r,r,,r", 400),
        ("/api/0/batches?units=0", 400),
        ("/api/0/point?unit=r", 400),
        ("/api/1/scene", 404),
        ("/api/00000000000000000000000000/nope", 404),
        ("/api/x/scene", 404),
        ("/api/0/scene/more", 404),
    ] {
        assert_eq!(served.refused(target).0, expected, "{target}");
    }
    let (_, line) = served.refused("/api/0/points?units=r111");
    assert_eq!(line, "there is no node r111");
}

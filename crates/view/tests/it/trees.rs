//! Binary trees: every leaf and all its points.

use pointmill_format::NodePoints;
use pointmill_format::batches::eight_bit;
use pointmill_format::bintree::Bintree;
use pointmill_testkit::files::fixture;

use super::client::serve;
use super::decode::{points, rows, units};

const TREES: [&str; 2] = ["bintree/files", "bintree/packed"];

#[test]
fn every_leaf_is_listed_with_its_box() {
    for name in TREES {
        let (served, tree) = (serve(&[&fixture(name)]), Bintree::open(fixture(name)).unwrap());
        let found = rows(&served.bytes("/api/0/nodes"));
        let leaves: Vec<u32> = tree.leaves().collect();
        assert_eq!(found.iter().map(|row| row.unit).collect::<Vec<_>>(), leaves, "{name}");
        for row in &found {
            let node = tree.node(row.unit).unwrap();
            assert_eq!((row.min, row.max, u64::from(row.points)), (node.bounds.min, node.bounds.max, node.count));
            assert_eq!(row.by_level, [0; 4]);
        }
        let scene = served.json("/api/0/scene");
        assert_eq!(scene["leaves"], leaves.len());
        assert_eq!(scene["points"], tree.header().points);
        assert_eq!(scene["bounds"]["min"], serde_json::json!(tree.nodes()[0].bounds.min));
    }
}

#[test]
fn decoded_points_are_those_of_the_leaf() {
    for name in TREES {
        let (served, tree) = (serve(&[&fixture(name)]), Bintree::open(fixture(name)).unwrap());
        let mut stored = NodePoints::default();
        for leaf in tree.leaves() {
            tree.read_leaf(leaf, &mut stored).unwrap();
            for every in [1, 2] {
                let bytes = served.bytes(&format!("/api/0/points?units={leaf}&every={every}"));
                let unit = units(&bytes);
                let (header, body) = &unit[0];
                assert_eq!((header.count, header.total), (stored.len().div_ceil(every), stored.len()));
                assert_eq!(header.flags & 1, 1, "32 bits");
                let (class, rgb) = (stored.column::<f32>("classification").unwrap(), stored.column::<u16>("rgb"));
                for (i, point) in points(header, body).iter().enumerate() {
                    let world = stored.world(i * every).unwrap();
                    for a in 0..3 {
                        // half a step, and the rounding of double precision at these coordinates
                        let bound = 0.5 * header.step[a] * (1.0 + 1e-9) + 4.0 * f64::EPSILON * world[a].abs();
                        assert!(
                            (point.world[a] - world[a]).abs() <= bound,
                            "{name}, leaf {leaf}: {point:?}, not {world:?}"
                        );
                    }
                    assert_eq!(f32::from(point.class), class[i * every]);
                    let expected = rgb.map_or([0; 3], |v| std::array::from_fn(|c| eight_bit(v[3 * i * every + c])));
                    assert_eq!(point.rgb, expected, "{name}");
                }
            }
            let point = served.json(&format!("/api/0/point?unit={leaf}&index=0"));
            assert_eq!(point["position"], serde_json::json!(stored.world(0).unwrap()));
        }
    }
}

#[test]
fn what_is_no_leaf_is_named() {
    let served = serve(&[&fixture("bintree/packed")]);
    for (target, expected) in [
        ("/api/0/nodes?of=r", 400),
        ("/api/0/points?units=0", 404), // the root
        ("/api/0/points?units=4294967295", 404),
        ("/api/0/points?units=4294967296", 400),
        ("/api/0/points?units=r", 400),
        ("/api/0/point?unit=0&index=0", 404),
        ("/api/0/batches?units=0", 400),
    ] {
        assert_eq!(served.refused(target).0, expected, "{target}");
    }
}

//! Colours at the ends of 8 and 16 bits, and means of them.

use pointmill_format::NodePoints;
use pointmill_format::batches::{BatchScratch, Batches, Precision, lod_of, rgb_of};
use pointmill_format::bintree::Bintree;
use pointmill_format::octree::OctreeNodes;
use pointmill_format::{NodeKey, open_octree};
use pointmill_testkit::las::{Las, Point};

use crate::support::Dir;

/// A red for each point; green is the next one, blue the one after it.
fn scan(reds: &[u16]) -> Las {
    let at = |i: usize| reds[i % reds.len()];
    let point = |i: usize| Point { rgb: [at(i), at(i + 1), at(i + 2)], ..Point::at([i as i32 * 40, 7, 3]) };
    Las { point_format: 7, offset: [0.0; 3], ..Las::new((0..reds.len()).map(point).collect()) }
}

/// The colours of all points, sorted.
fn sorted(mut colours: Vec<[u16; 3]>) -> Vec<[u16; 3]> {
    colours.sort_unstable();
    colours
}

fn colours_of(points: &NodePoints) -> Vec<[u16; 3]> {
    points.column::<u16>("rgb").unwrap().as_chunks::<3>().0.to_vec()
}

fn octree(dir: &Dir, dataset: &str) -> Vec<[u16; 3]> {
    let octree = open_octree(dir.path(dataset)).unwrap();
    let mut nodes = OctreeNodes::new(&*octree).unwrap();
    nodes.load(&*octree, NodeKey::ROOT).unwrap();
    let mut points = NodePoints::default();
    octree.points(nodes.get(NodeKey::ROOT).unwrap(), &mut points).unwrap();
    colours_of(&points)
}

fn bintree(dir: &Dir) -> Vec<[u16; 3]> {
    let (tree, mut points) = (Bintree::open(dir.path("out/bintree")).unwrap(), NodePoints::default());
    tree.read_leaf(tree.leaves().next().unwrap(), &mut points).unwrap();
    colours_of(&points)
}

/// As they were before averaging, in 16 bits.
fn batches(dir: &Dir) -> Vec<[u16; 3]> {
    let batches = Batches::open(dir.path("out/batches")).unwrap();
    let points = batches.points_in_morton_order(Precision::Thirty).map(Result::unwrap);
    points.map(|p| batches.original_colour(p.index).unwrap_or(p.rgb).map(|v| u16::from(v) * 257)).collect()
}

#[test]
fn ends_of_eight_and_sixteen_bits() {
    // §4: the nearest of 8 bits is that of v / 257, without halves: 257 is odd
    let eight = |v: u16| (f64::from(v) / 257.0).round() as u16 * 257;
    for (name, reds, factor) in [
        ("16 bits", &[0, 1, 255, 256, 65_535, 128, 129, 385, 386][..], 1),
        ("one value above 8 bits", &[0, 1, 255, 256], 1),
        ("8 bits", &[0, 1, 254, 255], 257),
        ("black", &[0, 0, 0], 257),
        ("white", &[65_535; 3], 1),
    ] {
        let (dir, las) = (Dir::new(), scan(reds));
        dir.write("a.las", &las.bytes());
        let formats = ["potree2", "potree1", "copc", "bintree", "batches"];
        dir.succeed(
            ["convert", "a.las", "-o", "out", "--attributes", "rgb", "-q"]
                .into_iter()
                .chain(formats.iter().flat_map(|f| ["--to", f])),
        );
        formats.iter().for_each(|format| dir.validate(&format!("out/{format}"), &["a.las"]));
        let meant: Vec<_> = las.points.iter().map(|p| p.rgb.map(|v| v * factor)).collect();
        let narrow = sorted(meant.iter().map(|rgb| rgb.map(eight)).collect());
        let meant = sorted(meant);
        for dataset in ["out/potree2", "out/copc"] {
            assert_eq!(sorted(octree(&dir, dataset)), meant, "{name}: {dataset}");
        }
        assert_eq!(sorted(bintree(&dir)), meant, "{name}: binary tree");
        assert_eq!(sorted(octree(&dir, "out/potree1")), narrow, "{name}: Potree 1.7");
        assert_eq!(sorted(batches(&dir)), narrow, "{name}: batches");
    }
}

#[test]
fn means_of_a_cell_are_those_of_whole_numbers_with_halves_up() {
    for reds in [&[0u16, 255, 255, 255][..], &[0, 255], &[1, 2], &[0, 0, 1], &[254, 255, 255, 255, 255, 255, 255], &[9]]
    {
        let dir = Dir::new();
        let mut las = scan(reds);
        las.points.iter_mut().enumerate().for_each(|(i, p)| p.xyz = [i as i32, 7, 3]); // within one cell
        las.points.iter_mut().for_each(|p| p.rgb[1] = 65_535); // 16 bits
        las.points.iter_mut().for_each(|p| p.rgb[0] *= 257);
        dir.write("a.las", &las.bytes());
        dir.succeed(["convert", "a.las", "-o", "out", "--to", "batches", "--lod-cell", "1", "-q"]);
        dir.validate("out", &["a.las"]);
        let batches = Batches::open(dir.path("out")).unwrap();
        let (mut scratch, mut points) = (BatchScratch::default(), NodePoints::default());
        batches.read_batch(0, Precision::Thirty, &mut scratch, &mut points).unwrap();
        let words = points.column::<u32>("colour").unwrap();
        let coarse: Vec<u8> = words.iter().filter(|w| lod_of(**w) == 0).map(|w| rgb_of(*w)[0]).collect();
        let (sum, count) = (reds.iter().map(|v| u128::from(*v)).sum::<u128>(), reds.len() as u128);
        assert_eq!(coarse, [((2 * sum + count) / (2 * count)) as u8], "{reds:?}");
    }
}

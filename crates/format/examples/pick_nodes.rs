//! A renderer's work without the drawing: flies towards a Potree 2.0 cloud and picks, frame by frame, the nodes that are
//! worth their points.
//!
//!     cargo run --release -p pointmill-format --example pick_nodes -- FOLDER [BUDGET]
//!
//! Sizes and priorities are those of Schütz, "Potree: Rendering Large Point Clouds in Web Browsers", 2016.

use std::collections::{BTreeMap, BinaryHeap, HashMap};

use pointmill_format::potree2::{Dataset, Hierarchy, Node, NodePoints};
use pointmill_format::{Aabb, NodeKey};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

const MIN_PIXELS: f64 = 50.0;

struct Camera {
    position: [f64; 3],
    direction: [f64; 3], // of length 1, not vertical
    slope: f64,          // tan(half the vertical field of view)
    screen: [f64; 2],    // width, height in pixels
}

impl Camera {
    /// Projected size in pixels over angle; nothing for what is out of sight or too small.
    fn priority(&self, cube: Aabb) -> Option<f64> {
        let radius = length(cube.extent()) / 2.0;
        let [dx, dy, _] = self.direction;
        let right = [dy, -dx, 0.0].map(|v| v / dx.hypot(dy));
        let up = cross(right, self.direction);
        let to_node = sub(cube.center(), self.position);
        let (distance, ahead) = (length(to_node).max(1e-9), dot(to_node, self.direction));
        // The sphere around the node against a pair of planes of the frustum.
        let outside = |axis, slope: f64| dot(to_node, axis).abs() > ahead * slope + radius * slope.hypot(1.0);
        let [width, height] = self.screen;
        if ahead < -radius || outside(up, self.slope) || outside(right, self.slope * width / height) {
            return None;
        }
        let pixels = height / 2.0 * radius / (self.slope * distance);
        let angle = (ahead / distance).clamp(-1.0, 1.0).acos();
        (pixels > MIN_PIXELS).then_some(pixels / (angle + 1.0))
    }
}

/// Nodes in memory; the least recently used leave when there are too many points.
#[derive(Default)]
struct Cache {
    nodes: HashMap<NodeKey, (u64, NodePoints)>,
    by_use: BTreeMap<u64, NodeKey>,
    clock: u64,
    points: usize,
}

impl Cache {
    /// Makes sure that the node is in memory; returns the bytes read for it.
    fn fetch(&mut self, dataset: &Dataset, node: &Node, capacity: usize) -> Result<u64> {
        self.clock += 1;
        self.by_use.insert(self.clock, node.key);
        if let Some((used, _)) = self.nodes.get_mut(&node.key) {
            self.by_use.remove(&std::mem::replace(used, self.clock));
            return Ok(0);
        }
        let mut points = NodePoints::default();
        dataset.read_points(node, &mut points)?;
        self.points += points.len();
        self.nodes.insert(node.key, (self.clock, points));
        while self.points > capacity && self.nodes.len() > 1 {
            let Some((_, oldest)) = self.by_use.pop_first() else { break };
            self.points -= self.nodes.remove(&oldest).map_or(0, |(_, points)| points.len());
        }
        Ok(node.record.byte_size)
    }
}

fn main() -> Result<()> {
    let mut args = std::env::args().skip(1);
    let folder = args.next().ok_or("usage: pick_nodes FOLDER [BUDGET]")?;
    let budget: u64 = args.next().map_or(Ok(1_000_000), |text| text.parse())?;
    let dataset = Dataset::open(folder.as_ref())?;
    let (mut tree, mut cache) = (Hierarchy::new(&dataset)?, Cache::default());
    let cube = dataset.metadata().cube;
    let direction = [0.48, 0.64, -0.6];
    for frame in 0..10 {
        let back = cube.extent()[0] * (1.5 - 0.15 * f64::from(frame));
        let position = sub(cube.center(), direction.map(|d| d * back));
        let camera = Camera { position, direction, slope: 30f64.to_radians().tan(), screen: [1920.0, 1080.0] };
        let (mut nodes, mut points, mut bytes) = (0, 0, 0);
        let mut queue = BinaryHeap::from([(u64::MAX, NodeKey::ROOT)]);
        while let Some((_, key)) = queue.pop() {
            tree.load(&dataset, key)?; // reads a chunk of the hierarchy if this is a proxy
            let Some(node) = tree.get(key).filter(|n| points + u64::from(n.record.points) <= budget) else { break };
            bytes += cache.fetch(&dataset, &node, 2 * budget as usize)?;
            (nodes, points) = (nodes + 1, points + u64::from(node.record.points));
            let priority = |child: Node| Some((camera.priority(dataset.metadata().node_cube(child.key))?, child.key));
            // Bits of positive doubles are ordered like the doubles.
            queue.extend(tree.children(key).filter_map(priority).map(|(p, key)| (p.to_bits(), key)));
        }
        println!("frame {frame}: {nodes} nodes, {points} points, {bytes} bytes read, {} points kept", cache.points);
    }
    Ok(())
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn length(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

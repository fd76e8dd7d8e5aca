//! A renderer's work without the drawing: flies towards a Potree 2.0 cloud and picks, frame by frame, the nodes that are
//! worth their points.
//!
//!     cargo run --release -p pointmill-format --example pick_nodes -- FOLDER [BUDGET]
//!
//! Sizes and priorities are those of Schütz, "Potree: Rendering Large Point Clouds in Web Browsers", 2016.

use std::collections::{BinaryHeap, HashMap};
use std::error::Error;

use pointmill_format::potree2::{Dataset, Hierarchy, Node};
use pointmill_format::{Aabb, NodeKey, NodePoints};

struct Camera {
    position: [f64; 3],
    direction: [f64; 3], // of length 1, not vertical
    slope: f64,          // tan(half the vertical field of view)
    screen_height: f64,  // in pixels
}

impl Camera {
    /// Projected size in pixels over angle; nothing for what is out of sight or smaller than 50 pixels.
    fn priority(&self, cube: Aabb) -> Option<f64> {
        let [dx, dy, dz] = self.direction;
        let right = [dy, -dx, 0.0].map(|v| v / dx.hypot(dy));
        let up = [right[1] * dz, -right[0] * dz, right[0] * dy - right[1] * dx];
        let length = |a| dot(a, a).sqrt();
        let radius = length(cube.extent()) / 2.0;
        let to_node = sub(cube.center(), self.position);
        let (distance, ahead) = (length(to_node).max(1e-9), dot(to_node, self.direction));
        // The sphere around the node against a pair of planes of the frustum.
        let outside = |axis, slope: f64| dot(to_node, axis).abs() > ahead * slope + radius * slope.hypot(1.0);
        if ahead < -radius || outside(up, self.slope) || outside(right, self.slope * 16.0 / 9.0) {
            return None;
        }
        let pixels = self.screen_height / 2.0 * radius / (self.slope * distance);
        let angle = (ahead / distance).clamp(-1.0, 1.0).acos();
        (pixels > 50.0).then_some(pixels / (angle + 1.0))
    }
}

/// Nodes in memory and when they were last used; the oldest leave when there are too many points.
#[derive(Default)]
struct Cache {
    nodes: HashMap<NodeKey, (u64, NodePoints)>,
    clock: u64,
    points: usize,
}

impl Cache {
    /// Makes sure that the node is in memory; returns the bytes read for it.
    fn fetch(&mut self, dataset: &Dataset, node: &Node, capacity: usize) -> Result<u64, Box<dyn Error>> {
        self.clock += 1;
        if let Some((used, _)) = self.nodes.get_mut(&node.key) {
            *used = self.clock;
            return Ok(0);
        }
        let mut points = NodePoints::default();
        dataset.read_points(node, &mut points)?;
        self.points += points.len();
        self.nodes.insert(node.key, (self.clock, points));
        while self.points > capacity {
            let Some((&oldest, _)) = self.nodes.iter().min_by_key(|(_, (used, _))| used) else { break };
            self.points -= self.nodes.remove(&oldest).map_or(0, |(_, points)| points.len());
        }
        Ok(node.record.byte_size)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let dataset = Dataset::open(args.next().ok_or("usage: pick_nodes FOLDER [BUDGET]")?)?;
    let budget: u64 = args.next().map_or(Ok(1_000_000), |text| text.parse())?;
    let (mut tree, mut cache) = (Hierarchy::new(&dataset)?, Cache::default());
    let (cube, direction) = (dataset.metadata().cube, [0.48, 0.64, -0.6]);
    for frame in 0..10 {
        let back = cube.extent()[0] * (1.5 - 0.15 * f64::from(frame));
        let position = sub(cube.center(), direction.map(|d| d * back));
        let camera = Camera { position, direction, slope: 30f64.to_radians().tan(), screen_height: 1080.0 };
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

#[rustfmt::skip]
fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] { std::array::from_fn(|i| a[i] - b[i]) }
#[rustfmt::skip]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 { a[0] * b[0] + a[1] * b[1] + a[2] * b[2] }

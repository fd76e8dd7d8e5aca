//! How long picks take: builds a tree of generated points (or opens one), then shoots rays from above and along it.
//!
//!     cargo run --release -p pointmill-format --example bintree_pick_speed -- [MILLIONS | FOLDER] [RAYS]
//!
//! Printed are the median and the 99th percentile of rays whose leaves are in memory ("warm": every ray is shot twice,
//! the second time is measured) and of the first time. Not measured: what a slow disk adds to the first time.

#[path = "../tests/bintree/build.rs"]
#[allow(dead_code, unreachable_pub)] // it serves the tests too
mod build;

use std::error::Error;
use std::sync::Arc;
use std::time::{Duration, Instant};

use build::{Builder, Point, header};
use pointmill_format::bintree::{Bintree, Layout, Picker, Ray};
use pointmill_format::{Aabb, Lattice};

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let what = args.next().unwrap_or_else(|| "20".into());
    let rays: usize = args.next().map_or(Ok(2000), |n| n.parse())?;
    let folder = tempfile::tempdir()?;
    let tree = match what.parse::<f64>() {
        Ok(millions) => {
            generate((millions * 1e6) as u32, folder.path())?;
            Bintree::open(folder.path())?
        }
        Err(_) => Bintree::open(what)?,
    };
    let bounds = tree.node(0).ok_or("the cloud is empty")?.bounds;
    println!("{} points in {} leaves", tree.header().points, tree.leaves().count());
    let mut picker = Picker::new(Arc::new(tree), 2 << 30);
    for (name, slope) in [("from above", 5.0), ("slanting", 0.5), ("along the ground", 0.02)] {
        let random = &mut Random(1);
        let shots: Vec<Ray> = (0..rays).filter_map(|_| shot(&bounds, slope, random)).collect();
        let (mut cold, mut warm, mut hits) = (Vec::new(), Vec::new(), 0);
        for ray in &shots {
            let (time, hit) = timed(&mut picker, ray)?;
            cold.push(time);
            hits += usize::from(hit);
            warm.push(timed(&mut picker, ray)?.0);
        }
        println!(
            "{name}: {hits} of {} rays hit; warm {}; first time {}",
            shots.len(),
            percentiles(warm),
            percentiles(cold)
        );
    }
    println!("{} MB of leaves in memory", picker.cached_bytes() / 1_000_000);
    Ok(())
}

fn timed(picker: &mut Picker, ray: &Ray) -> Result<(Duration, bool), Box<dyn Error>> {
    let start = Instant::now();
    let hit = picker.pick(ray)?;
    Ok((start.elapsed(), hit.is_some()))
}

fn percentiles(mut times: Vec<Duration>) -> String {
    times.sort();
    let at = |part: f64| times.get((times.len() as f64 * part) as usize).copied().unwrap_or_default();
    format!("{:.1?} median, {:.1?} at 99 %", at(0.5), at(0.99))
}

/// A ray, 2 cm wide and a pixel a distance, that comes down with `slope` somewhere on the cloud.
fn shot(bounds: &Aabb, slope: f64, random: &mut Random) -> Option<Ray> {
    let target = [0, 1].map(|a| bounds.min[a] + random.unit() * (bounds.max[a] - bounds.min[a]));
    let angle = random.unit() * std::f64::consts::TAU;
    let way = [angle.cos(), angle.sin(), -slope];
    let back = 300.0;
    let origin = [target[0] - back * way[0], target[1] - back * way[1], bounds.min[2] + back * slope];
    Ray::new(origin, way, 0.02).map(|ray| ray.with_spread(0.001))
}

/// A corridor of 50 points a square metre, 100 m wide: ground, trees, three wires.
fn generate(n: u32, folder: &std::path::Path) -> Result<(), Box<dyn Error>> {
    let start = Instant::now();
    let random = &mut Random(7);
    let length = f64::from(n) / 50.0 / 100.0 * 1000.0; // mm: 50 points a square metre, 100 m wide
    let point = |id| {
        let (along, across) = (random.unit() * length, random.unit() * 100_000.0);
        let ground = (along / 40_000.0).sin() * 3000.0 + (across / 15_000.0).cos() * 1500.0;
        let height = match id % 20 {
            0 => 12_000.0 + (along % 60_000.0 / 30_000.0 - 1.0).powi(2) * 4000.0,
            1..=5 => random.unit().powi(2) * 8000.0,
            _ => random.unit() * 40.0,
        };
        let across = if id % 20 == 0 { 50_000.0 + f64::from(id / 20 % 3) * 3000.0 } else { across };
        Point { q: [along, across, ground + height].map(|v| v as i32), id }
    };
    let mut points: Vec<Point> = (0..n).map(point).collect();
    let lattice = Lattice { scale: [0.001; 3], offset: [432_000.0, 5_200_000.0, 100.0] };
    let header = header(u64::from(n), 65_000, Layout::Packed, lattice);
    let files = Builder { header, class: &|id| f64::from(id % 20), extras: &|_, _| {} }.files(&mut points);
    for (name, bytes) in &files {
        std::fs::write(folder.join(name), bytes)?;
    }
    println!("built in {:.1?}", start.elapsed());
    Ok(())
}

/// SplitMix64.
struct Random(u64);

impl Random {
    /// From 0 to below 1.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 11) as f64 / (1u64 << 53) as f64
    }
}

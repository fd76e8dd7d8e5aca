//! A renderer's decisions without the drawing: moves a camera through a mean-split binary tree and prints, step by step,
//! how many nodes and points are drawn with the far material, the near one, or both.
//!
//!     cargo run --release -p pointmill-format --example bintree_path -- FOLDER [OPTIONS]
//!
//!     --path along|across|orbit|FILE  default along: the longest axis of the cloud; FILE: a line "x y z [tx ty tz]" a
//!                                     step, the place of the camera and what it looks at
//!     --steps N      steps of a path that is built in (50)
//!     --height H     world units above the cloud's middle (30)
//!     --radius S     radius of a point, world units (0.05)
//!     --fov DEGREES  vertical field of view (60)
//!     --lines W      vertical resolution, pixels (1080)
//!     --aspect A     width over height (1.7778)
//!     --all          no frustum: everything around the camera counts

use std::error::Error;

use pointmill_format::Aabb;
use pointmill_format::bintree::{Bintree, Frustum, Material, switch_distance};

const USAGE: &str = "usage: bintree_path FOLDER [--path along|across|orbit|FILE] [--steps N] [--height H] [--radius S] \
                     [--fov DEGREES] [--lines W] [--aspect A] [--all]";

struct Options {
    folder: String,
    path: String,
    steps: usize,
    height: f64,
    radius: f64,
    fov_v: f64,
    lines: f64,
    aspect: f64,
    all: bool,
}

impl Options {
    fn parse() -> Result<Self, Box<dyn Error>> {
        let mut args = std::env::args().skip(1);
        let folder = args.next().ok_or(USAGE)?;
        let mut o = Self {
            folder,
            path: "along".into(),
            steps: 50,
            height: 30.0,
            radius: 0.05,
            fov_v: 60f64.to_radians(),
            lines: 1080.0,
            aspect: 16.0 / 9.0,
            all: false,
        };
        while let Some(name) = args.next() {
            if name == "--all" {
                o.all = true;
                continue;
            }
            let value = args.next().ok_or_else(|| format!("{name} needs a value\n{USAGE}"))?;
            match name.as_str() {
                "--path" => o.path = value,
                "--steps" => o.steps = value.parse()?,
                "--height" => o.height = value.parse()?,
                "--radius" => o.radius = value.parse()?,
                "--fov" => o.fov_v = value.parse::<f64>()?.to_radians(),
                "--lines" => o.lines = value.parse()?,
                "--aspect" => o.aspect = value.parse()?,
                _ => return Err(format!("{name} is no option\n{USAGE}").into()),
            }
        }
        Ok(o)
    }
}

/// Where the camera is, and what it looks at.
type Step = [[f64; 3]; 2];

fn built_in(options: &Options, bounds: &Aabb) -> Result<Vec<Step>, Box<dyn Error>> {
    let (center, extent) = (bounds.center(), bounds.extent());
    let long = if extent[0] >= extent[1] { 0 } else { 1 };
    let axis = if options.path == "across" { 1 - long } else { long };
    let at = |along: f64| {
        let mut p = center;
        p[axis] = bounds.min[axis] + along * extent[axis];
        p[2] = center[2] + options.height;
        p
    };
    let step = |i: usize| {
        let t = i as f64 / options.steps.max(2).saturating_sub(1) as f64;
        match options.path.as_str() {
            "along" | "across" => {
                let (mut ahead, place) = (at(t), at(t));
                ahead[axis] += 100.0;
                ahead[2] -= options.height / 2.0;
                Some([place, ahead])
            }
            "orbit" => {
                let (radius, angle) = (extent[0].hypot(extent[1]) * 0.6, t * std::f64::consts::TAU);
                let height = options.height + radius / 2.0;
                Some([[center[0] + radius * angle.cos(), center[1] + radius * angle.sin(), center[2] + height], center])
            }
            _ => None,
        }
    };
    (0..options.steps).map(|i| step(i).ok_or_else(|| USAGE.into())).collect()
}

fn from_file(text: &str) -> Result<Vec<Step>, Box<dyn Error>> {
    let mut steps: Vec<Step> = Vec::new();
    for line in text.lines().filter(|l| !l.trim().is_empty() && !l.starts_with('#')) {
        let numbers = line.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        match numbers[..] {
            [x, y, z, tx, ty, tz] => steps.push([[x, y, z], [tx, ty, tz]]),
            // Ahead as the step before, or east.
            [x, y, z] => {
                let before = steps.last().map_or([x - 1.0, y, z], |s| s[0]);
                steps.push([[x, y, z], [2.0 * x - before[0], 2.0 * y - before[1], 2.0 * z - before[2]]]);
            }
            _ => return Err(format!("\"{line}\" is not x y z [tx ty tz]").into()),
        }
    }
    Ok(steps)
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = Options::parse()?;
    let tree = Bintree::open(&options.folder)?;
    let root = tree.node(0).ok_or("the cloud is empty")?;
    let steps = match std::fs::read_to_string(&options.path) {
        Ok(text) => from_file(&text)?,
        Err(_) => built_in(&options, &root.bounds)?,
    };
    let distance = switch_distance(options.radius, options.fov_v, options.lines);
    let leaves = tree.leaves().count();
    println!("{} points, {leaves} leaves; discs of {} become pixels at {distance:.2}", root.count, options.radius);
    println!(
        "{:>5} {:>8} {:>8} {:>8} {:>12} {:>12} {:>12}",
        "step", "far", "near", "both", "far pts", "near pts", "both pts"
    );
    let mut total = [[0u64; 2]; 3];
    for (i, [place, target]) in steps.iter().enumerate() {
        let forward: [f64; 3] = std::array::from_fn(|a| target[a] - place[a]);
        let up = if forward[0] == 0.0 && forward[1] == 0.0 { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] };
        let frustum = Frustum::perspective(*place, forward, up, options.fov_v, options.aspect, [0.1, 1e6]);
        let mut drawn = [[0u64; 2]; 3];
        for (leaf, material) in tree.draw_list(*place, distance, (!options.all).then_some(&frustum)) {
            let [nodes, points] = &mut drawn[slot(material)];
            *nodes += 1;
            *points += tree.node(leaf).map_or(0, |n| n.count);
        }
        print_row(&i.to_string(), &drawn);
        total.as_flattened_mut().iter_mut().zip(drawn.as_flattened()).for_each(|(t, d)| *t += d);
    }
    print_row("all", &total);
    let (nodes, both) = (total.iter().map(|t| t[0]).sum::<u64>(), total[2][0]);
    println!("double passes: {both} of {nodes} nodes drawn, {:.2} %", 100.0 * both as f64 / nodes.max(1) as f64);
    let volume = |b: &Aabb| b.extent().iter().product::<f64>();
    let sum: f64 = tree.leaves().filter_map(|l| tree.node(l)).map(|n| volume(&n.bounds)).sum();
    println!("leaf boxes: {sum:.3} cubic units, {:.2} % of the root's", 100.0 * sum / volume(&root.bounds));
    Ok(())
}

fn slot(material: Material) -> usize {
    match material {
        Material::Far => 0,
        Material::Near => 1,
        Material::Both => 2,
    }
}

fn print_row(step: &str, [far, near, both]: &[[u64; 2]; 3]) {
    let nodes = format!("{:>8} {:>8} {:>8}", far[0], near[0], both[0]);
    println!("{step:>5} {nodes} {:>12} {:>12} {:>12}", far[1], near[1], both[1]);
}

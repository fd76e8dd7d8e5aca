//! What the choices cost, as Markdown: bytes and errors of batches by planes, boxes and double passes of binary trees by
//! splitting rule, on three scenes made up here.
//!
//! ```sh
//! cargo run --release -p pointmill-bench --bin trade_offs -- --points 20000000 >> docs/benchmarks.md
//! ```

use std::path::{Path, PathBuf};
use std::{fs, io};

use clap::Parser;
use pointmill_bench::las_file;
use pointmill_bench::las_layout::LasLayout;
use pointmill_bench::scene::Scene;
use pointmill_converter::{BatchesSettings, BintreeSettings, OutputReport, Plan, Silent, Target, convert};
use pointmill_format::batches::{Batches, ErrorFigures};
use pointmill_format::bintree::{Bintree, Material, SplitRule, switch_distance};

/// Places along the longest axis from which nodes are judged.
const STEPS: usize = 50;

/// The cloud's longest side over the radius of a drawn point, and over the height of the camera above its middle.
const RADII: f64 = 20_000.0;
const HEIGHTS: f64 = 30.0;

/// Vertical resolution in pixels, and vertical field of view.
const LINES: f64 = 1080.0;
const FOV: f64 = std::f64::consts::FRAC_PI_3;

#[derive(Parser)]
struct Args {
    /// Points of each scene
    #[arg(long, default_value = "5000000")]
    points: u64,
    /// Where scenes and datasets go [default: a folder for temporary files]
    #[arg(long)]
    dir: Option<PathBuf>,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args = Args::parse();
    let dir = args.dir.clone().unwrap_or_else(|| std::env::temp_dir().join("pointmill-bench"));
    fs::create_dir_all(&dir)?;
    let mut batches = String::new();
    let mut trees = String::new();
    for scene in [Scene::Aerial, Scene::Terrestrial, Scene::Object] {
        let file = scene_file(&dir, scene, args.points)?;
        batches += &batch_rows(scene, &file, &dir)?;
        trees += &tree_rows(scene, &file, &dir)?;
    }
    println!("## Batches: bytes and errors by planes, {} points per scene\n", args.points);
    println!(
        "Errors of decoded positions on the worst axis, in units of the scene; `--planes auto` chooses the planes in bold.\n"
    );
    println!("| scene, step | cell of level 0 | bits | bytes/point | without originals | largest error | RMS error |");
    println!("|---|---|---|---|---|---|---|\n{batches}");
    println!("## Binary trees: boxes and double passes by splitting rule, {} points per scene\n", args.points);
    println!(
        "Double passes: nodes that straddle the switching distance, of all drawn nodes, from {STEPS} camera positions along \
         the\nlongest axis. Camera height above the middle: 1/{HEIGHTS} of that axis; radius of points: 1/{RADII}; \
         {LINES} lines, 60°.\n"
    );
    println!(
        "| scene | split | leaves | points per leaf, least–most | leaf volume / root's | double passes | build s |"
    );
    println!("|---|---|---|---|---|---|---|\n{trees}");
    println!("```sh\ncargo run --release -p pointmill-bench --bin trade_offs -- --points {}\n```", args.points);
    Ok(())
}

fn scene_file(dir: &Path, scene: Scene, points: u64) -> io::Result<PathBuf> {
    let path = dir.join(format!("{}-{points}.las", scene.name()));
    if !path.exists() {
        eprintln!("generating {}", path.display());
        let part = path.with_extension("part.las");
        las_file::write(scene, LasLayout::COLOUR, points, 7, &part)?;
        fs::rename(part, &path)?;
    }
    Ok(path)
}

/// Converts to one format; the dataset is at `dir/out`.
fn make(file: &Path, dir: &Path, target: Target) -> Result<(OutputReport, PathBuf), Box<dyn std::error::Error>> {
    let out = dir.join("out");
    if out.exists() {
        fs::remove_dir_all(&out)?;
    }
    let plan = Plan::new(vec![file.to_path_buf()], out.clone());
    let report = convert(&plan, &[target], &Silent)?;
    let output = report.outputs.into_iter().next().ok_or("no output")?;
    Ok((output, out))
}

fn batch_rows(scene: Scene, file: &Path, dir: &Path) -> Result<String, Box<dyn std::error::Error>> {
    let mut rows = String::new();
    let settings = |planes, originals| BatchesSettings { lod_cell: None, planes, originals, ..Default::default() };
    let (_, out) = make(file, dir, settings(None, true).into())?;
    let auto = Batches::open(out.join("points.qbatch"))?.header().precision().planes();
    for planes in 1..=3u8 {
        eprintln!("{}: {planes} planes", scene.name());
        let (bare, _) = make(file, dir, settings(Some(planes), false).into())?;
        let (full, out) = make(file, dir, settings(Some(planes), true).into())?;
        let batches = Batches::open(out.join("points.qbatch"))?;
        let errors = batches.description().errors;
        let figures = [errors.ten, errors.twenty, errors.thirty][usize::from(planes) - 1].unwrap_or_default();
        let worst = |pick: fn(&ErrorFigures) -> [f64; 3]| pick(&figures).into_iter().fold(0.0, f64::max);
        let bold = if u32::from(planes) == auto { "**" } else { "" };
        let per_point = |output: &OutputReport| output.bytes as f64 / output.points as f64;
        rows += &format!(
            "| {}, {} | {} | {bold}{}{bold} | {:.2} | {:.2} | {:.2e} | {:.2e} |\n",
            scene.name(),
            scene.scale(),
            batches.header().grid.cell,
            10 * planes,
            per_point(&full),
            per_point(&bare),
            worst(|f| f.max),
            worst(|f| f.rms),
        );
    }
    Ok(rows)
}

fn tree_rows(scene: Scene, file: &Path, dir: &Path) -> Result<String, Box<dyn std::error::Error>> {
    let mut rows = String::new();
    for split in [SplitRule::Mean, SplitRule::Median, SplitRule::Midpoint] {
        eprintln!("{}: {}", scene.name(), split.name());
        let (output, out) = make(file, dir, BintreeSettings { split, ..Default::default() }.into())?;
        let tree = Bintree::open(&out)?;
        let root = tree.node(0).ok_or("no root")?.bounds;
        let volume = |b: &pointmill_format::Aabb| b.extent().iter().product::<f64>();
        let leaves: Vec<_> = tree.leaves().filter_map(|l| tree.node(l)).collect();
        let boxes: f64 = leaves.iter().map(|n| volume(&n.bounds)).sum();
        let counts = || leaves.iter().map(|n| n.count);
        let (both, drawn) = double_passes(&tree, &root);
        rows += &format!(
            "| {} | {} | {} | {}–{} | {:.5} | {both} of {drawn}, {:.2} % | {:.2} |\n",
            scene.name(),
            split.name(),
            leaves.len(),
            counts().min().unwrap_or(0),
            counts().max().unwrap_or(0),
            boxes / volume(&root),
            100.0 * both as f64 / drawn.max(1) as f64,
            output.seconds,
        );
    }
    Ok(rows)
}

/// Nodes drawn with both materials, and all nodes drawn, from everywhere along the way.
fn double_passes(tree: &Bintree, root: &pointmill_format::Aabb) -> (usize, usize) {
    let extent = root.extent();
    let axis = (1..3).fold(0, |best, a| if extent[a] > extent[best] { a } else { best });
    let distance = switch_distance(extent[axis] / RADII, FOV, LINES);
    let (mut both, mut drawn) = (0, 0);
    for step in 0..STEPS {
        let mut camera = root.center();
        camera[axis] = root.min[axis] + extent[axis] * (step as f64 + 0.5) / STEPS as f64;
        camera[2] += extent[axis] / HEIGHTS;
        let list = tree.draw_list(camera, distance, None);
        drawn += list.len();
        both += list.iter().filter(|(_, material)| *material == Material::Both).count();
    }
    (both, drawn)
}

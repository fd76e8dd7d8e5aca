//! How fast points become pixels: points per second of one thread and of all, for each way to draw them.
//!
//!     cargo run --profile quick -p pointmill-render --example render_speed -- [MILLIONS OF POINTS | DATASET]
//!
//! Of a dataset: seconds to open it, to find a view, to render it with a budget of 2 million points, and to encode the PNG; the
//! best of five. Otherwise the points are a terrain of hills, 1 km wide, in the order of a space-filling curve as in nodes, and are in memory: no
//! decoding is measured. The picture has 1920 × 1080 pixels.

use std::time::Instant;

use pointmill_render::{Camera, Canvas, PointSize, Scene, Shape, Size, Style};

/// Points of a block, as many as a node has.
const BLOCK: usize = 10_000;

struct Block {
    positions: Vec<[f64; 3]>,
    colours: Vec<[u8; 3]>,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let given = std::env::args().nth(1).unwrap_or_else(|| "10".to_owned());
    let Ok(millions) = given.parse::<u32>() else { return dataset(&given) };
    let blocks = terrain(millions as usize * 1_000_000);
    let camera = Camera::new([5e5 + 500.0, 5e6 - 700.0, 500.0], [5e5 + 500.0, 5e6 + 450.0, 0.0]);
    let threads = std::thread::available_parallelism()?.get();
    let splats = |shape, pixels| Style { shape, size: PointSize::Pixels(pixels), is_filled: false, ..Style::default() };
    for (name, style) in [
        ("one pixel", Style::plain()),
        ("one pixel, averaged", Style::averaged()),
        ("squares of 3 pixels", splats(Shape::Square, 3.0)),
        ("paraboloids of 3 pixels", splats(Shape::Paraboloid, 3.0)),
    ] {
        for threads in [1, threads] {
            let best = (0..3).map(|_| seconds(&blocks, &camera, &style, threads)).collect::<Result<Vec<_>, _>>()?;
            let best = best.into_iter().fold(f64::INFINITY, f64::min);
            let rate = f64::from(millions) / best;
            println!("{name}, {threads} threads: {rate:.1} M points/s");
        }
    }
    Ok(())
}

fn dataset(path: &str) -> Result<(), Box<dyn std::error::Error>> {
    for style in [Style::plain(), Style::averaged(), Style::default()] {
        let mut best = [f64::INFINITY; 4];
        let mut drawn = String::new();
        for _ in 0..5 {
            let mut begin = Instant::now();
            let mut lap = |best: &mut f64| {
                *best = best.min(begin.elapsed().as_secs_f64());
                begin = Instant::now();
            };
            let scene = Scene::open(path)?;
            lap(&mut best[0]);
            let camera = scene.best_view(Size::default());
            lap(&mut best[1]);
            let picture = scene.render(&camera, Size::default(), &style, 2_000_000, 0)?;
            lap(&mut best[2]);
            let bytes = picture.png()?.len();
            lap(&mut best[3]);
            drawn = format!("{} points, {bytes} bytes", picture.drawn.points);
        }
        let [open, view, render, encode] = best;
        println!("{drawn}: open {open:.3} s, view {view:.3} s, render {render:.3} s, encode {encode:.3} s");
    }
    Ok(())
}

/// Seconds to draw all blocks, without what is done to the pixels at the end.
fn seconds(
    blocks: &[Block],
    camera: &Camera,
    style: &Style,
    threads: usize,
) -> Result<f64, Box<dyn std::error::Error>> {
    let mut canvas = Canvas::new(Size::default(), camera, style)?;
    let begin = Instant::now();
    loop {
        std::thread::scope(|scope| {
            for thread in 0..threads {
                let canvas = &canvas;
                scope.spawn(move || {
                    for block in blocks.iter().skip(thread).step_by(threads) {
                        canvas.add(&block.positions, &block.colours);
                    }
                });
            }
        });
        if !canvas.next_pass() {
            break;
        }
    }
    let seconds = begin.elapsed().as_secs_f64();
    assert!(canvas.finish().covered() > 100_000);
    Ok(seconds)
}

/// Hills in UTM coordinates, in Morton order.
fn terrain(count: usize) -> Vec<Block> {
    let side = (count as f64).sqrt().ceil();
    // every second bit of a place on the curve is one of a coordinate
    let bits = |n: u64| (0..32).fold(0u64, |coordinate, bit| coordinate | (n >> (2 * bit) & 1) << bit) as f64;
    let curve = 4u64.pow((side.log2().ceil()) as u32);
    let places = (0..curve).map(|n| [bits(n), bits(n >> 1)]).filter(|[x, y]| *x < side && *y < side).take(count);
    let points: Vec<([f64; 3], [u8; 3])> = places
        .map(|[x, y]| {
            let [x, y] = [x, y].map(|c| c * 1000.0 / side);
            let z = 40.0 * (x / 90.0).sin() * (y / 70.0).cos() + 3.0 * (x / 4.0).sin();
            ([5e5 + x, 5e6 + y, z], [(x / 4.0) as u8, (y / 4.0) as u8, (z + 60.0) as u8])
        })
        .collect();
    points
        .chunks(BLOCK)
        .map(|chunk| {
            let (positions, colours) = chunk.iter().copied().unzip();
            Block { positions, colours }
        })
        .collect()
}

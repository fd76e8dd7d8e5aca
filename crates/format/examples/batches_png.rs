//! A picture of quantised batches, drawn on the processor as the compute-shader renderers draw it.
//!
//!     cargo run --release -p pointmill-format --features mmap,zstd --example batches_png -- points.qbatch out.png
//!
//! Three passes (Magnopus, "How We Render Extremely Large Point Clouds"): the nearest depth of each pixel, the sum of the
//! colours within 1 % of it, their mean. Batches outside the frustum are skipped; how many bits of the others are
//! decoded, the size of their boxes on the screen decides. Prints how many batches were drawn with 10, 20 and 30 bits.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

#[cfg(not(feature = "mmap"))]
use pointmill_format::batches::AlignedBytes;
use pointmill_format::batches::{
    BATCH_POINTS, BatchRecord, BatchScratch, Batches, Precision, distance_to_box, focal_pixels, keeps, lod_of,
    projected_diagonal, rgb_of, target_spacing, weight,
};
use pointmill_format::{NodePoints, ReadError};

const USAGE: &str = "usage: batches_png FILE OUT.png [options]
  --size WxH             picture in pixels (1280x720)
  --eye X,Y,Z            camera, world coordinates (in front of the tight box, above, so that all of it is seen)
  --look X,Y,Z           what it looks at (the middle of the tight box); up is +z
  --fov DEGREES          vertical field of view (60)
  --bits RULE            half-pixel, published, 10, 20 or 30 (half-pixel)
  --lod LEVEL            draw points up to this level of detail (3: all)
  --clod FACTOR          continuous levels of detail: 1 is fine, more is fewer points (off)";

/// Points this much farther than the nearest of their pixel still count for its colour.
const DEPTH_TOLERANCE: f32 = 1.01;

fn main() {
    if let Err(message) = run() {
        eprintln!("{message}");
        std::process::exit(2);
    }
}

fn run() -> Result<(), Box<dyn std::error::Error>> {
    let options = Options::parse(std::env::args().skip(1))?;
    let batches = open(options.file.as_ref())?;
    let camera = Camera::new(&options, &batches);
    let (chosen, picture) = draw(&batches, &camera, &options)?;
    write_png(options.out.as_ref(), camera.size, &picture)?;
    let [ten, twenty, thirty] = chosen;
    let skipped = batches.header().batches - chosen.iter().sum::<u32>();
    println!("batches drawn with 10 bits {ten}, with 20 {twenty}, with 30 {thirty}; outside the picture {skipped}");
    Ok(())
}

#[cfg(feature = "mmap")]
fn open(path: &Path) -> Result<Batches<impl AsRef<[u8]> + use<>>, ReadError> {
    Batches::map(path)
}

#[cfg(not(feature = "mmap"))]
fn open(path: &Path) -> Result<Batches<AlignedBytes>, ReadError> {
    Batches::open(path)
}

/// The three passes. Batches by precision, and the picture: r, g, b, row by row from the top.
fn draw<B: AsRef<[u8]>>(
    batches: &Batches<B>,
    camera: &Camera,
    options: &Options,
) -> Result<([u32; 3], Vec<u8>), ReadError> {
    let [width, height] = camera.size;
    let mut nearest = vec![f32::INFINITY; width * height];
    let mut sums = vec![[0u32; 4]; width * height];
    let grid = &batches.header().grid;
    let cell = grid.cell as f32;
    let mut chosen = [0; 3];
    let (mut scratch, mut points) = (BatchScratch::default(), NodePoints::default());
    for colour_pass in [false, true] {
        for (slot, record) in (0..).zip(batches.records()).filter(|(_, r)| camera.sees(r)) {
            let precision = camera.precision(record, options.bits).min(batches.header().precision());
            if !colour_pass {
                chosen[precision.planes() as usize - 1] += 1;
            }
            batches.read_batch(slot, precision, &mut scratch, &mut points)?;
            let colours = points.column::<u32>("colour").unwrap_or_default();
            for ((k, i), word) in (0..points.len()).zip(slot * BATCH_POINTS..).zip(colours) {
                let relative = points.world(k).map(|world| grid.relative(world));
                let Some(at) = relative.and_then(|relative| camera.project(relative)) else { continue };
                let lod = lod_of(*word);
                let fine_enough = options
                    .clod
                    .is_none_or(|clod| keeps(lod, weight(i), cell, target_spacing(at.distance, clod, at.ndc_radius)));
                if lod > options.lod || !fine_enough {
                    continue;
                }
                let depth = &mut nearest[at.pixel];
                if !colour_pass {
                    *depth = depth.min(at.depth);
                } else if at.depth <= *depth * DEPTH_TOLERANCE {
                    let [r, g, b] = rgb_of(*word).map(u32::from);
                    let sum = &mut sums[at.pixel];
                    *sum = [sum[0] + r, sum[1] + g, sum[2] + b, sum[3] + 1];
                }
            }
        }
    }
    let resolve = |[r, g, b, points]: [u32; 4]| match points {
        0 => [24; 3],
        _ => [r, g, b].map(|sum| ((sum + points / 2) / points) as u8),
    };
    Ok((chosen, sums.into_iter().flat_map(resolve).collect()))
}

/// The rule for the number of bits.
#[derive(Debug, Clone, Copy)]
enum Bits {
    HalfPixel,
    Published,
    Always(Precision),
}

/// Where a point falls.
struct Projected {
    pixel: usize,
    /// Along the view direction.
    depth: f32,
    /// From the camera.
    distance: f32,
    /// From the middle of the picture, in normalised device coordinates.
    ndc_radius: f32,
}

/// A perspective camera; positions are relative to the grid's origin, so that singles would do on a GPU.
struct Camera {
    eye: [f64; 3],
    right: [f64; 3],
    up: [f64; 3],
    forward: [f64; 3],
    size: [usize; 2],
    focal: f64,
    near: f64,
}

impl Camera {
    fn new<B: AsRef<[u8]>>(options: &Options, batches: &Batches<B>) -> Self {
        let grid = &batches.header().grid;
        let (middle, extent) = (batches.header().tight.center(), batches.header().tight.extent());
        let radius = (length(extent) / 2.0).max(1e-3);
        let look = options.look.unwrap_or(middle);
        let away = radius / (options.fov / 2.0).sin();
        let eye = options.eye.unwrap_or_else(|| {
            let direction = normalised([-0.5, -1.0, 0.8]);
            std::array::from_fn(|a| look[a] + direction[a] * away)
        });
        let forward = normalised(std::array::from_fn(|a| look[a] - eye[a]));
        let side = cross(forward, [0.0, 0.0, 1.0]);
        let right = if length(side) < 1e-9 { [1.0, 0.0, 0.0] } else { normalised(side) };
        let size = options.size;
        Self {
            eye: grid.relative(eye),
            right,
            up: cross(right, forward),
            forward,
            size,
            focal: focal_pixels(size[1] as f64, options.fov),
            near: radius * 1e-4,
        }
    }

    /// Right, up and forward of a position relative to the origin, seen from the camera.
    fn view(&self, relative: [f64; 3]) -> [f64; 3] {
        let from_eye = std::array::from_fn(|a| relative[a] - self.eye[a]);
        [self.right, self.up, self.forward].map(|axis| dot(axis, from_eye))
    }

    fn project(&self, relative: [f64; 3]) -> Option<Projected> {
        let [x, y, depth] = self.view(relative);
        if depth < self.near {
            return None;
        }
        let [width, height] = self.size.map(|s| s as f64);
        let (px, py) = (width / 2.0 + x * self.focal / depth, height / 2.0 - y * self.focal / depth);
        let inside = (0.0..width).contains(&px) && (0.0..height).contains(&py);
        let ndc = [2.0 * px / width - 1.0, 2.0 * py / height - 1.0];
        inside.then(|| Projected {
            pixel: py as usize * self.size[0] + px as usize,
            depth: depth as f32,
            distance: length([x, y, depth]) as f32,
            ndc_radius: ndc[0].hypot(ndc[1]) as f32,
        })
    }

    /// False if the box lies wholly outside one of the five planes of the frustum.
    fn sees(&self, record: &BatchRecord) -> bool {
        let corners = (0..8)
            .map(|i| std::array::from_fn(|a| f64::from(if i >> a & 1 == 0 { record.min[a] } else { record.max[a] })));
        let corners: Vec<[f64; 3]> = corners.map(|c| self.view(c)).collect();
        let [half_width, half_height] = self.size.map(|s| s as f64 / 2.0 / self.focal);
        let beyond = |outside: &dyn Fn([f64; 3]) -> bool| corners.iter().all(|c| outside(*c));
        !(beyond(&|[_, _, z]| z < self.near)
            || beyond(&|[x, _, z]| x > z * half_width)
            || beyond(&|[x, _, z]| -x > z * half_width)
            || beyond(&|[_, y, z]| y > z * half_height)
            || beyond(&|[_, y, z]| -y > z * half_height))
    }

    fn precision(&self, record: &BatchRecord, rule: Bits) -> Precision {
        let (sides, min) = (record.sides(), record.corner());
        let max = record.max.map(f64::from);
        match rule {
            Bits::Always(precision) => precision,
            Bits::HalfPixel => {
                let longest = sides.into_iter().fold(0.0, f64::max);
                Precision::for_error(longest, distance_to_box(self.eye, min, max), self.near, self.focal)
            }
            Bits::Published => {
                let centre = std::array::from_fn(|a| min[a] + sides[a] / 2.0);
                Precision::for_diagonal(projected_diagonal(length(sides), self.view(centre)[2], self.focal))
            }
        }
    }
}

struct Options {
    file: String,
    out: String,
    size: [usize; 2],
    eye: Option<[f64; 3]>,
    look: Option<[f64; 3]>,
    /// Radians.
    fov: f64,
    bits: Bits,
    lod: u8,
    clod: Option<f32>,
}

impl Options {
    fn parse(mut args: impl Iterator<Item = String>) -> Result<Self, String> {
        let mut options = Self {
            file: String::new(),
            out: String::new(),
            size: [1280, 720],
            eye: None,
            look: None,
            fov: 60f64.to_radians(),
            bits: Bits::HalfPixel,
            lod: 3,
            clod: None,
        };
        let mut paths = Vec::new();
        while let Some(arg) = args.next() {
            if !arg.starts_with("--") {
                paths.push(arg);
                continue;
            }
            let value = args.next().ok_or_else(|| format!("{arg} wants a value\n{USAGE}"))?;
            options.set(&arg, &value).ok_or_else(|| format!("{arg} {value} makes no sense\n{USAGE}"))?;
        }
        [options.file, options.out] = paths.try_into().map_err(|_| USAGE.to_owned())?;
        Ok(options)
    }

    fn set(&mut self, name: &str, value: &str) -> Option<()> {
        match name {
            "--size" => {
                let (w, h) = value.split_once('x')?;
                let side = |s: &str| s.parse().ok().filter(|s| (1..=16_384).contains(s));
                self.size = [side(w)?, side(h)?];
            }
            "--eye" => self.eye = Some(vector(value)?),
            "--look" => self.look = Some(vector(value)?),
            "--fov" => self.fov = value.parse().ok().filter(|f| (1.0..170.0).contains(f)).map(f64::to_radians)?,
            "--bits" => {
                self.bits = match value {
                    "half-pixel" => Bits::HalfPixel,
                    "published" => Bits::Published,
                    bits => Bits::Always(Precision::from_bits(bits.parse().ok()?)?),
                }
            }
            "--lod" => self.lod = value.parse().ok()?,
            "--clod" => self.clod = Some(value.parse().ok()?),
            _ => return None,
        }
        Some(())
    }
}

fn vector(text: &str) -> Option<[f64; 3]> {
    let numbers: Vec<f64> = text.split(',').map(|v| v.trim().parse().ok()).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

fn write_png(path: &Path, [width, height]: [usize; 2], rgb: &[u8]) -> Result<(), Box<dyn std::error::Error>> {
    let file = File::create(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let mut encoder = png::Encoder::new(BufWriter::new(file), width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(rgb)?;
    Ok(())
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn length(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

fn normalised(a: [f64; 3]) -> [f64; 3] {
    let length = length(a);
    if length > 0.0 { a.map(|v| v / length) } else { [0.0, 1.0, 0.0] }
}

//! Scans made up from a formula: as large as one likes, the same each time.

use std::f64::consts::TAU;

/// What is scanned, and how.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scene {
    /// Terrain, buildings and trees from the air: 500 m swaths flown in turn, 20 points/m², UTM metres on a 0.01 m
    /// lattice.
    Aerial,
    /// A street from four scanner positions 18 m apart: density falls with 1/r², scan lines in column order, local
    /// metres on a 0.001 m lattice.
    Terrestrial,
    /// A knobbly ball of 20 cm, points all over it in no order, local metres on a lattice of 10 µm.
    Object,
    /// The land of [`Self::Aerial`], its points in random order.
    Shuffled,
    /// A cube of 500 m filled evenly, points in no order, local metres on a lattice of 1 mm.
    Volume,
}

/// One point, world coordinates in metres.
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs)] // the names say it
pub struct ScenePoint {
    pub position: [f64; 3],
    pub rgb: [u16; 3],
    pub class: u8,
    pub returns: u8,
}

impl Scene {
    /// Its name in file names and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Aerial => "aerial",
            Self::Terrestrial => "terrestrial",
            Self::Object => "object",
            Self::Shuffled => "shuffled",
            Self::Volume => "volume",
        }
    }

    /// LAS offset, metres.
    pub const fn offset(self) -> [f64; 3] {
        match self {
            Self::Aerial | Self::Shuffled => [476_000.0, 4_428_000.0, 400.0],
            Self::Terrestrial | Self::Object | Self::Volume => [0.0; 3],
        }
    }

    /// LAS scale, metres, of all axes.
    pub const fn scale(self) -> f64 {
        match self {
            Self::Aerial | Self::Shuffled => 0.01,
            Self::Terrestrial | Self::Volume => 0.001,
            Self::Object => 0.000_01,
        }
    }

    /// Point `index` of `total` (below 2^62), in the order of acquisition. The points of a scene are drawn from one `random`, in order.
    pub fn point(self, index: u64, total: u64, random: &mut Random) -> ScenePoint {
        match self {
            Self::Aerial => aerial(index as f64, total as f64, random),
            Self::Terrestrial => terrestrial(index, total, random),
            Self::Object => object(random),
            Self::Shuffled => aerial(shuffled(index, total) as f64, total as f64, random),
            Self::Volume => volume(random),
        }
    }
}

fn terrain(x: f64, y: f64) -> f64 {
    30.0 * (x / 310.0).sin() * (y / 270.0).cos()
        + 8.0 * (x / 47.0 + 1.0).sin() * (y / 39.0).sin()
        + 0.4 * (x / 3.1).sin() * (y / 2.7).cos()
}

fn colour(z: f64, noise: f64) -> [u16; 3] {
    let t = ((z + 40.0) / 110.0).clamp(0.0, 1.0);
    [60.0 + 150.0 * t, 110.0 + 60.0 * (1.0 - t), 60.0 + 120.0 * t * t]
        .map(|c| ((c + 25.0 * noise).clamp(0.0, 255.0) as u16) * 257)
}

fn aerial(index: f64, total: f64, random: &mut Random) -> ScenePoint {
    const SWATH: f64 = 500.0;
    let side = (total / 20.0).sqrt();
    let lanes = (side / SWATH).ceil().max(1.0);
    let per_lane = total / lanes;
    let lane = (index / per_lane).floor();
    let flown = (index - lane * per_lane) / per_lane * side;
    let along = if lane % 2.0 == 0.0 { flown } else { side - flown };
    let width = SWATH.min(side);
    let phase = (index * 0.0137) % 2.0; // the mirror swings to and fro
    let across = if phase < 1.0 { phase } else { 2.0 - phase };
    let x = (lane * SWATH).min(side - width) + across * width * 1.02 + 0.05 * random.normal();
    let y = along + 0.4 * random.normal();

    let (block_x, block_y) = ((x / 60.0).floor(), (y / 45.0).floor());
    let height = (block_x * 7919.0 + block_y * 104_729.0).rem_euclid(23.0);
    let (in_x, in_y) = (x - block_x * 60.0, y - block_y * 45.0);
    let building = height > 9.0 && in_x > 15.0 && in_x < 42.0 && in_y > 10.0 && in_y < 33.0;
    let tree = !building && (x / 11.0).sin() * (y / 13.0).sin() > 0.45;
    let mut z = if building { terrain(block_x * 60.0 + 28.0, block_y * 45.0 + 21.0) + height } else { terrain(x, y) };
    if tree {
        z += random.unit().sqrt() * 14.0;
    }
    z += 0.03 * random.normal();
    let returns = if tree { 1 + (random.unit() * 3.0) as u8 } else { 1 };
    let class = if building { 6 } else { 2 + 3 * u8::from(tree) };
    let offset = Scene::Aerial.offset();
    let position = [x + offset[0], y + offset[1], z + offset[2]];
    ScenePoint { position, rgb: colour(z, random.normal()), class, returns }
}

fn terrestrial(index: u64, total: u64, random: &mut Random) -> ScenePoint {
    const STATIONS: f64 = 4.0;
    const FAR: f64 = 120.0;
    let per_station = total as f64 / STATIONS;
    let station = (index as f64 / per_station).floor();
    let azimuth = (index as f64 - station * per_station) / per_station * TAU;
    let rows = ((per_station / 2.0).sqrt() as u64).max(64);
    let elevation = ((index % rows) as f64 / rows as f64 - 0.42) * 2.2;
    let origin = [station * 18.0, (station % 2.0) * 2.0 - 1.0, 1.7];
    let ray = [elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin()];

    let ground = if ray[2] < 0.0 { -origin[2] / ray[2] } else { f64::INFINITY };
    // House fronts 11 m high on both sides, 9 m from the middle of the street.
    let wall = ((9.0 * ray[1].signum()) - origin[1]) / ray[1];
    let hit = origin[2] + wall * ray[2];
    let wall = if wall.is_finite() && (0.0..=11.0).contains(&hit) { wall } else { f64::INFINITY };
    let range = ground.min(wall).min(FAR) + 0.002 * random.normal();
    let position: [f64; 3] = std::array::from_fn(|a| origin[a] + range * ray[a]);
    let class = if position[2] < 0.1 { 2 } else { 6 };
    ScenePoint { position, rgb: colour(position[2] * 8.0 - 30.0, random.normal()), class, returns: 1 }
}

fn object(random: &mut Random) -> ScenePoint {
    let (azimuth, z) = (random.unit() * TAU, 2.0 * random.unit() - 1.0);
    let (around, polar) = ((1.0 - z * z).sqrt(), z.acos());
    let knobs =
        0.2 * (5.0 * azimuth).sin() * (3.0 * polar).sin() + 0.03 * (31.0 * azimuth).cos() * (29.0 * polar).sin();
    let radius = 0.08 * (1.0 + knobs) + 0.000_02 * random.normal();
    let position = [around * azimuth.cos(), around * azimuth.sin(), z].map(|v| v * radius);
    ScenePoint { position, rgb: colour(knobs * 250.0 + 15.0, random.normal()), class: 0, returns: 1 }
}

/// Where `index` goes when the numbers below `total` are shuffled: a Feistel network over a power of four, walked until
/// the number is below `total`.
fn shuffled(index: u64, total: u64) -> u64 {
    let half = (u64::BITS - total.leading_zeros()).div_ceil(2);
    let mask = (1 << half) - 1;
    let mut number = index;
    loop {
        let (mut left, mut right) = (number >> half, number & mask);
        for round in 1..=4 {
            (left, right) = (right, left ^ (mixed(right + (round << 40)) & mask));
        }
        number = left << half | right;
        if number < total {
            return number;
        }
    }
}

fn volume(random: &mut Random) -> ScenePoint {
    let position = [(); 3].map(|()| random.unit() * 500.0);
    ScenePoint { position, rgb: colour(position[2] / 5.0 - 40.0, random.normal()), class: 1, returns: 1 }
}

/// SplitMix64 (Steele, Lea, Flood: "Fast splittable pseudorandom number generators", 2014), and normal deviates of it.
#[derive(Debug, Clone)]
pub struct Random {
    state: u64,
    spare: Option<f64>,
}

impl Random {
    /// The same numbers for the same seed.
    pub fn new(seed: u64) -> Self {
        Self { state: seed, spare: None }
    }

    /// Uniform in 0 ≤ u < 1.
    pub fn unit(&mut self) -> f64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        (mixed(self.state) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Normal with mean 0 and deviation 1 (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        let (sin, cos) = (TAU * self.unit()).sin_cos();
        self.spare = Some(radius * sin);
        radius * cos
    }
}

/// What SplitMix64 makes of its state.
const fn mixed(state: u64) -> u64 {
    let z = (state ^ state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ z >> 31
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shuffled_numbers_are_each_there_once_and_in_no_order() {
        for total in [1, 2, 5, 1000, 4096, 4097] {
            let order: Vec<u64> = (0..total).map(|i| shuffled(i, total)).collect();
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq(0..total), "{total}");
            let rising = order.windows(2).filter(|pair| pair[0] < pair[1]).count() as f64;
            assert!(total < 1000 || (0.45..0.55).contains(&(rising / total as f64)), "{rising} of {total}");
        }
    }

    #[test]
    fn the_street_is_denser_near_a_scanner_and_the_land_is_even() {
        let points = |scene: Scene| {
            let mut random = Random::new(7);
            (0..40_000).map(|i| scene.point(i, 40_000, &mut random).position).collect::<Vec<_>>()
        };
        let street = points(Scene::Terrestrial);
        let within = |r: f64| street.iter().filter(|p| p[2] < 0.1 && p[0].hypot(p[1] + 1.0) < r).count();
        // Of evenly spread points, a disc of half the radius holds a quarter.
        assert!(within(4.0) * 2 > within(8.0), "{} of {}", within(4.0), within(8.0));

        let side = (40_000.0f64 / 20.0).sqrt();
        let west = points(Scene::Aerial).iter().filter(|p| p[0] - 476_000.0 < side / 2.0).count();
        assert!((18_000..22_000).contains(&west), "{west}");
    }
}

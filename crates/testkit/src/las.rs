//! LAS files of any points, written field by field from the specification, so that each of them can be wrong.

use crate::Random;
use crate::damage::put;

/// The attributes that LAS stores of a point; those that a point format has no room for are not written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Lattice steps.
    pub xyz: [i32; 3],
    /// As stored.
    pub intensity: u16,
    /// The class: at most 31 in the formats below 6.
    pub class: u8,
    /// Degrees.
    pub scan_angle: i8,
    /// As stored.
    pub user_data: u8,
    /// The point source id.
    pub source: u16,
    /// Seconds.
    pub gps_time: f64,
    /// As stored: 8 or 16 bits.
    pub rgb: [u16; 3],
}

impl Point {
    /// A point with class 2 and zeros for everything else.
    pub const fn at(xyz: [i32; 3]) -> Self {
        let rgb = [0; 3];
        Self { xyz, intensity: 0, class: 2, scan_angle: 0, user_data: 0, source: 0, gps_time: 0.0, rgb }
    }

    /// A point whose attributes differ from those of its neighbours: the `i`th of a scan.
    pub fn numbered(i: usize, xyz: [i32; 3]) -> Self {
        Self {
            intensity: i as u16,
            class: [2u8, 5, 6][i % 3],
            scan_angle: (i % 40) as i8,
            user_data: 7,
            source: 11,
            gps_time: i as f64 * 0.001,
            rgb: [i as u16, (i >> 8) as u16, 0xFFFF],
            ..Self::at(xyz)
        }
    }
}

/// A LAS file: version 1.2 with point format 2 or 3, version 1.4 with point format 6 or 7.
#[derive(Debug, Clone)]
pub struct Las {
    /// 2, 3, 6 or 7.
    pub point_format: u8,
    /// Units of a lattice step.
    pub scale: [f64; 3],
    /// The place of step 0.
    pub offset: [f64; 3],
    /// In file order.
    pub points: Vec<Point>,
    /// Instead of the number of points.
    pub points_declared: Option<u64>,
    /// Instead of the bounds of the points: minimum and maximum.
    pub bounds_declared: Option<[[f64; 3]; 2]>,
}

impl Las {
    /// Points of format 3 in steps of a centimetre.
    pub const fn new(points: Vec<Point>) -> Self {
        let (scale, offset) = ([0.01; 3], [500_000.0, 5_400_000.0, 0.0]);
        Self { point_format: 3, scale, offset, points, points_declared: None, bounds_declared: None }
    }

    /// [`Self::new`] with points that are [`Point::numbered`].
    pub fn numbered(positions: impl IntoIterator<Item = [i32; 3]>) -> Self {
        Self::new(positions.into_iter().enumerate().map(|(i, xyz)| Point::numbered(i, xyz)).collect())
    }

    /// A hilly square of `n` points with ten points per square metre, the same for the same `n` and `seed`.
    pub fn terrain(n: usize, seed: u64) -> Self {
        let mut random = Random::new(seed.wrapping_mul(2).wrapping_add(1));
        let side = ((n as f64 * 1000.0).sqrt() as u64).max(1);
        Self::numbered((0..n).map(|_| {
            let (x, y) = (random.below(side), random.below(side));
            let z = (x as f64 / 900.0).sin() * 800.0 + (y as f64 / 700.0).cos() * 500.0;
            [x as i32, y as i32, z as i32 + random.below(10) as i32]
        }))
    }

    /// Bytes of the header.
    pub const fn header_len(&self) -> usize {
        if self.point_format < 6 { 227 } else { 375 }
    }

    /// Bytes of a point.
    ///
    /// # Panics
    /// For point formats that this writer does not know.
    pub const fn record_len(&self) -> usize {
        match self.point_format {
            2 => 26,
            3 => 34,
            6 => 30,
            7 => 36,
            _ => panic!("the point format is 2, 3, 6 or 7"),
        }
    }

    /// The file.
    ///
    /// # Panics
    /// For point formats that this writer does not know.
    pub fn bytes(&self) -> Vec<u8> {
        let mut out = self.header();
        out.reserve(self.points.len() * self.record_len());
        for point in &self.points {
            self.write_point(point, &mut out);
        }
        out
    }

    fn header(&self) -> Vec<u8> {
        let header_len = self.header_len();
        let declared = self.points_declared.unwrap_or(self.points.len() as u64);
        let mut out = vec![0; header_len];
        put(&mut out, 0, b"LASF");
        put(&mut out, 24, if self.point_format < 6 { &[1, 2] } else { &[1, 4] });
        put(&mut out, 94, &(header_len as u16).to_le_bytes());
        put(&mut out, 96, &(header_len as u32).to_le_bytes()); // where the points start
        put(&mut out, 104, &[self.point_format]);
        put(&mut out, 105, &(self.record_len() as u16).to_le_bytes());
        if self.point_format < 6 {
            put(&mut out, 107, &(declared as u32).to_le_bytes());
            put(&mut out, 111, &(declared as u32).to_le_bytes()); // of the first return
        } else {
            put(&mut out, 247, &declared.to_le_bytes());
            put(&mut out, 255, &declared.to_le_bytes()); // of the first return
        }
        let [min, max] = self.bounds_declared.unwrap_or_else(|| self.bounds());
        for axis in 0..3 {
            put(&mut out, 131 + 8 * axis, &self.scale[axis].to_le_bytes());
            put(&mut out, 155 + 8 * axis, &self.offset[axis].to_le_bytes());
            put(&mut out, 179 + 16 * axis, &max[axis].to_le_bytes());
            put(&mut out, 187 + 16 * axis, &min[axis].to_le_bytes());
        }
        out
    }

    /// The bounds of the points, as an honest header declares them: minimum and maximum.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let axis = |a: usize| self.points.iter().map(move |p| p.xyz[a]);
        let world = |a: usize, q: Option<i32>| f64::from(q.unwrap_or(0)) * self.scale[a] + self.offset[a];
        [[0, 1, 2].map(|a| world(a, axis(a).min())), [0, 1, 2].map(|a| world(a, axis(a).max()))]
    }

    fn write_point(&self, p: &Point, out: &mut Vec<u8>) {
        p.xyz.iter().for_each(|v| out.extend(v.to_le_bytes()));
        out.extend(p.intensity.to_le_bytes());
        if self.point_format < 6 {
            out.extend([0b0000_1001, p.class, p.scan_angle as u8, p.user_data]); // the first of one return
        } else {
            out.extend([0x11, 0, p.class, p.user_data]);
            out.extend(((f64::from(p.scan_angle) / 0.006).round() as i16).to_le_bytes());
        }
        out.extend(p.source.to_le_bytes());
        if self.point_format != 2 {
            out.extend(p.gps_time.to_le_bytes());
        }
        if self.point_format != 6 {
            p.rgb.iter().for_each(|v| out.extend(v.to_le_bytes()));
        }
    }
}

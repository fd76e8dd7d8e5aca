//! LAS records of scene points: which fields they have, and their bytes.

use laz::laszip::LazItem;
use laz::{LazItemRecordBuilder, LazVlr};
use std::io;

use crate::scene::{Scene, ScenePoint};

/// Bytes of a record of point format 3.
pub const RECORD_LEN: usize = 34;

/// Names of the two values, 16 bits each, that records with extra bytes end in.
const EXTRA_NAMES: [&str; 2] = ["echo width", "deviation"];

/// The fields of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LasLayout {
    /// Point format: 0, 1 (GPS time), 3 (and colour), 6 or 7 (the same with the fields of LAS 1.4).
    format: u8,
    extra_bytes: bool,
}

impl LasLayout {
    /// Point format 0: 20 bytes.
    pub const PLAIN: Self = Self { format: 0, extra_bytes: false };
    /// Point format 3, with GPS time and colour: 34 bytes.
    pub const COLOUR: Self = Self { format: 3, extra_bytes: false };
    /// Point format 3 and two described values of 16 bits: 38 bytes.
    pub const EXTRA: Self = Self { format: 3, extra_bytes: true };
    /// Point format 6, with GPS time: 30 bytes.
    pub const MODERN: Self = Self { format: 6, extra_bytes: false };
    /// Point format 7, with GPS time and colour: 36 bytes.
    pub const MODERN_COLOUR: Self = Self { format: 7, extra_bytes: false };

    /// The point format.
    pub const fn format(self) -> u8 {
        self.format
    }

    /// True if the layout is one of LAS 1.4.
    pub(crate) const fn is_modern(self) -> bool {
        self.format >= 6
    }

    /// "3", or "3 with extra bytes".
    pub fn name(self) -> String {
        format!("{}{}", self.format, if self.extra_bytes { " with extra bytes" } else { "" })
    }

    /// Bytes of a record.
    pub const fn record_len(self) -> usize {
        let extra = if self.extra_bytes { 2 * EXTRA_NAMES.len() } else { 0 };
        extra
            + match self.format {
                0 => 20,
                6 => 30,
                7 => 36,
                _ => RECORD_LEN,
            }
    }

    /// The record of one point, into [`Self::record_len`] bytes: quantized, `index` as GPS time at 100 kHz.
    pub(crate) fn put_record(self, scene: Scene, index: u64, point: &ScenePoint, out: &mut [u8]) {
        for (a, q) in quantize(scene, point).iter().enumerate() {
            out[4 * a..4 * a + 4].copy_from_slice(&q.to_le_bytes());
        }
        out[12..14].copy_from_slice(&(point.rgb[1] >> 2).to_le_bytes()); // intensity
        let shift = if self.is_modern() { 4 } else { 3 };
        out[14] = point.returns | point.returns << shift; // the last of its returns
        out[if self.is_modern() { 16 } else { 15 }] = point.class;
        let (time_at, rgb_at) = if self.is_modern() { (22, 30) } else { (20, 28) };
        if self.format != 0 {
            out[time_at..time_at + 8].copy_from_slice(&(index as f64 * 1e-5 + 2e5).to_le_bytes());
        }
        if matches!(self.format, 3 | 7) {
            out[rgb_at..rgb_at + 6].copy_from_slice(point.rgb.map(u16::to_le_bytes).as_flattened());
        }
        if self.extra_bytes {
            let values = [40 + (point.rgb[0] >> 12), point.rgb[2] % 97];
            let at = out.len() - 2 * values.len();
            out[at..].copy_from_slice(values.map(u16::to_le_bytes).as_flattened());
        }
    }

    /// What describes the extra bytes, by LAS 1.4: 192 bytes for each value; empty without extra bytes.
    pub(crate) fn extra_bytes_record(self) -> Vec<u8> {
        let mut out = Vec::new();
        for name in EXTRA_NAMES.iter().filter(|_| self.extra_bytes) {
            let start = out.len();
            out.extend([0, 0, 3, 0]); // reserved, unsigned 16 bits, no options
            out.extend(name.as_bytes());
            out.resize(start + 192, 0);
        }
        out
    }

    /// How these records are compressed: chunks of 50,000 points.
    ///
    /// # Errors
    /// None for the layouts that there are.
    pub(crate) fn laz(self) -> io::Result<LazVlr> {
        let extra = 2 * EXTRA_NAMES.len() as u16 * u16::from(self.extra_bytes);
        let items: Vec<LazItem> =
            LazItemRecordBuilder::default_for_point_format_id(self.format, extra).map_err(io::Error::other)?;
        Ok(LazVlr::from_laz_items(items))
    }
}

/// The record of one point in format 3.
pub fn record(scene: Scene, index: u64, point: &ScenePoint) -> [u8; RECORD_LEN] {
    let mut out = [0; RECORD_LEN];
    LasLayout::COLOUR.put_record(scene, index, point, &mut out);
    out
}

/// The position on the scene's lattice.
pub(crate) fn quantize(scene: Scene, point: &ScenePoint) -> [i32; 3] {
    std::array::from_fn(|a| ((point.position[a] - scene.offset()[a]) / scene.scale()).round() as i32)
}

//! Writes a scene as LAS 1.2 or LAZ, point format 3 (34 bytes: GPS time and colour), in one pass and little memory.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use laz::{LasZipCompressor, LazItemRecordBuilder, LazVlr};

use crate::scene::{Random, Scene, ScenePoint};

/// Bytes of a record of point format 3.
pub const RECORD_LEN: usize = 34;

const HEADER_LEN: usize = 227;
const VLR_HEADER_LEN: usize = 54;

/// Writes `points` points of `scene` to `path`; compressed if its ending is `laz`. Same arguments, same bytes.
///
/// # Errors
/// Of the operating system, and a `points` above 2^32 − 1, the most that LAS 1.2 can hold.
pub fn write(scene: Scene, points: u64, seed: u64, path: &Path) -> io::Result<()> {
    let count = u32::try_from(points).map_err(|_| io::Error::other("LAS 1.2 holds at most 4,294,967,295 points"))?;
    let vlr = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("laz")).then(laz_vlr).transpose()?;
    let mut file = BufWriter::with_capacity(1 << 20, File::create(path)?);
    file.write_all(&[0; HEADER_LEN])?;
    let mut header =
        Header { scene, count, compressed: vlr.is_some(), offset_to_points: HEADER_LEN as u32, ..Header::default() };
    if let Some(vlr) = vlr {
        let mut bytes = Vec::new();
        vlr.write_to(&mut &mut bytes)?;
        header.offset_to_points += (VLR_HEADER_LEN + bytes.len()) as u32;
        file.write_all(&vlr_header(bytes.len() as u16))?;
        file.write_all(&bytes)?;
        let mut compressor = LasZipCompressor::new(file, vlr).map_err(io::Error::other)?;
        header.write_points(seed, |record| compressor.compress_one(record))?;
        compressor.done()?;
        file = compressor.into_inner();
    } else {
        header.write_points(seed, |record| file.write_all(record))?;
    }
    file.seek(SeekFrom::Start(0))?;
    file.write_all(&header.bytes())?;
    file.flush()
}

/// The LAS record of one point: quantized, `index` as GPS time at 100 kHz.
pub fn record(scene: Scene, index: u64, point: &ScenePoint) -> [u8; RECORD_LEN] {
    let mut out = [0; RECORD_LEN];
    let quantized = quantize(scene, point);
    for (a, q) in quantized.iter().enumerate() {
        out[4 * a..4 * a + 4].copy_from_slice(&q.to_le_bytes());
    }
    out[12..14].copy_from_slice(&(point.rgb[1] >> 2).to_le_bytes()); // intensity
    out[14] = point.returns | point.returns << 3; // the last of its returns
    out[15] = point.class;
    out[20..28].copy_from_slice(&(index as f64 * 1e-5 + 2e5).to_le_bytes());
    for (c, v) in point.rgb.iter().enumerate() {
        out[28 + 2 * c..30 + 2 * c].copy_from_slice(&v.to_le_bytes());
    }
    out
}

fn quantize(scene: Scene, point: &ScenePoint) -> [i32; 3] {
    std::array::from_fn(|a| ((point.position[a] - scene.offset()[a]) / scene.scale()).round() as i32)
}

struct Header {
    scene: Scene,
    count: u32,
    compressed: bool,
    offset_to_points: u32,
    by_return: [u32; 5],
    min: [i32; 3],
    max: [i32; 3],
}

impl Default for Header {
    fn default() -> Self {
        Self {
            scene: Scene::Aerial,
            count: 0,
            compressed: false,
            offset_to_points: 0,
            by_return: [0; 5],
            min: [i32::MAX; 3],
            max: [i32::MIN; 3],
        }
    }
}

impl Header {
    fn write_points(&mut self, seed: u64, mut write: impl FnMut(&[u8]) -> io::Result<()>) -> io::Result<()> {
        let mut random = Random::new(seed);
        for index in 0..u64::from(self.count) {
            let point = self.scene.point(index, u64::from(self.count), &mut random);
            let quantized = quantize(self.scene, &point);
            for (a, &q) in quantized.iter().enumerate() {
                self.min[a] = self.min[a].min(q);
                self.max[a] = self.max[a].max(q);
            }
            self.by_return[usize::from(point.returns) - 1] += 1;
            write(&record(self.scene, index, &point))?;
        }
        Ok(())
    }

    /// LAS 1.2, table 3 of the specification.
    fn bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(HEADER_LEN);
        out.extend(b"LASF");
        out.extend([0; 20]); // source id, encoding (GPS week time), GUID
        out.extend([1, 2]);
        out.extend(padded::<32>("generated"));
        out.extend(padded::<32>("pointmill-bench"));
        out.extend([1, 0, 0xEA, 0x07]); // 1 January 2026
        out.extend((HEADER_LEN as u16).to_le_bytes());
        out.extend(self.offset_to_points.to_le_bytes());
        out.extend(u32::from(self.compressed).to_le_bytes()); // variable-length records
        out.push(3 | u8::from(self.compressed) << 7);
        out.extend((RECORD_LEN as u16).to_le_bytes());
        out.extend(self.count.to_le_bytes());
        out.extend(self.by_return.iter().flat_map(|n| n.to_le_bytes()));
        out.extend([self.scene.scale(); 3].iter().flat_map(|s| s.to_le_bytes()));
        out.extend(self.scene.offset().iter().flat_map(|o| o.to_le_bytes()));
        for a in 0..3 {
            let world = |q: i32| f64::from(q) * self.scene.scale() + self.scene.offset()[a];
            out.extend(world(self.max[a]).to_le_bytes());
            out.extend(world(self.min[a]).to_le_bytes());
        }
        out
    }
}

fn laz_vlr() -> io::Result<LazVlr> {
    let items = LazItemRecordBuilder::default_for_point_format_id(3, 0).map_err(io::Error::other)?;
    Ok(LazVlr::from_laz_items(items))
}

fn vlr_header(len: u16) -> Vec<u8> {
    let mut out = vec![0; 2];
    out.extend(padded::<16>(LazVlr::USER_ID));
    out.extend(LazVlr::RECORD_ID.to_le_bytes());
    out.extend(len.to_le_bytes());
    out.extend(padded::<32>(LazVlr::DESCRIPTION));
    out
}

fn padded<const N: usize>(text: &str) -> [u8; N] {
    let mut out = [0; N];
    let len = text.len().min(N);
    out[..len].copy_from_slice(&text.as_bytes()[..len]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINTS: u64 = 120_000; // more than two LAZ chunks

    #[test]
    fn another_reader_finds_every_point_inside_the_header_bounds_in_las_and_laz_alike() {
        let dir = tempfile::tempdir().unwrap();
        for scene in [Scene::Aerial, Scene::Terrestrial] {
            let read = |ending: &str| {
                let path = dir.path().join(format!("{}.{ending}", scene.name()));
                write(scene, POINTS, 7, &path).unwrap();
                let mut reader = las::Reader::from_path(&path).unwrap();
                let bounds = reader.header().bounds();
                let all = reader.read_all().unwrap();
                let points: Vec<las::Point> = all.points().map(Result::unwrap).collect();
                assert!(points.iter().all(|p| {
                    bounds.min.x <= p.x && p.x <= bounds.max.x && bounds.min.z <= p.z && p.z <= bounds.max.z
                }));
                points
            };
            let (las, laz) = (read("las"), read("laz"));
            assert_eq!(las.len() as u64, POINTS);
            assert!(las == laz);
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
        let dir = tempfile::tempdir().unwrap();
        let bytes = |seed| {
            let path = dir.path().join("s.las");
            write(Scene::Aerial, 1000, seed, &path).unwrap();
            std::fs::read(path).unwrap()
        };
        assert!(bytes(7) == bytes(7));
        assert!(bytes(7) != bytes(8));
    }
}

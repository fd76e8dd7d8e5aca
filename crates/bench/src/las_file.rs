//! Writes a scene as LAS or LAZ, in one pass and little memory, however many points there are.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use laz::{LasZipCompressor, LazVlr};

use crate::las_layout::{LasLayout, quantize};
use crate::scene::{Random, Scene};

const VLR_HEADER_LEN: usize = 54;

/// Writes `points` points of `scene` to `path`, LAS 1.2 (formats 6 and 7: 1.4); compressed if its ending is `laz`. Same
/// arguments, same bytes.
///
/// # Errors
/// Of the operating system, and a `points` above 2^32 − 1, the most that LAS 1.2 can hold.
pub fn write(scene: Scene, layout: LasLayout, points: u64, seed: u64, path: &Path) -> io::Result<()> {
    let count = u32::try_from(points).map_err(|_| io::Error::other("LAS 1.2 holds at most 4,294,967,295 points"))?;
    let laz = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("laz")).then(|| layout.laz()).transpose()?;
    let mut header = Header::new(scene, layout, count, laz.as_ref())?;
    let mut file = BufWriter::with_capacity(1 << 20, File::create(path)?);
    file.write_all(&header.bytes())?; // to be written again
    file.write_all(&header.vlrs)?;
    if let Some(laz) = laz {
        let mut compressor = LasZipCompressor::new(file, laz).map_err(io::Error::other)?;
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

struct Header {
    scene: Scene,
    layout: LasLayout,
    count: u32,
    compressed: bool,
    /// Variable-length records, and how many.
    vlrs: Vec<u8>,
    vlr_count: u32,
    by_return: [u32; 5],
    min: [i32; 3],
    max: [i32; 3],
}

impl Header {
    fn new(scene: Scene, layout: LasLayout, count: u32, laz: Option<&LazVlr>) -> io::Result<Self> {
        let (min, max, by_return) = ([i32::MAX; 3], [i32::MIN; 3], [0; 5]);
        let (compressed, vlrs, vlr_count) = (laz.is_some(), Vec::new(), 0);
        let mut header = Self { scene, layout, count, compressed, vlrs, vlr_count, by_return, min, max };
        if let Some(laz) = laz {
            let mut record = Vec::new();
            laz.write_to(&mut &mut record)?;
            header.add_vlr(LazVlr::USER_ID, LazVlr::RECORD_ID, LazVlr::DESCRIPTION, &record);
        }
        let extra_bytes = layout.extra_bytes_record();
        if !extra_bytes.is_empty() {
            header.add_vlr("LASF_Spec", 4, "extra bytes", &extra_bytes);
        }
        Ok(header)
    }

    fn add_vlr(&mut self, user: &str, id: u16, description: &str, record: &[u8]) {
        self.vlrs.reserve(VLR_HEADER_LEN + record.len());
        self.vlrs.extend([0; 2]);
        self.vlrs.extend(padded::<16>(user));
        self.vlrs.extend(id.to_le_bytes());
        self.vlrs.extend((record.len() as u16).to_le_bytes());
        self.vlrs.extend(padded::<32>(description));
        self.vlrs.extend(record);
        self.vlr_count += 1;
    }

    fn write_points(&mut self, seed: u64, mut write: impl FnMut(&[u8]) -> io::Result<()>) -> io::Result<()> {
        let (mut random, mut record) = (Random::new(seed), vec![0; self.layout.record_len()]);
        for index in 0..u64::from(self.count) {
            let point = self.scene.point(index, u64::from(self.count), &mut random);
            for (a, q) in quantize(self.scene, &point).into_iter().enumerate() {
                self.min[a] = self.min[a].min(q);
                self.max[a] = self.max[a].max(q);
            }
            self.by_return[usize::from(point.returns) - 1] += 1;
            self.layout.put_record(self.scene, index, &point, &mut record);
            write(&record)?;
        }
        Ok(())
    }

    /// LAS 1.2, table 3 of the specification; what LAS 1.4 adds.
    fn bytes(&self) -> Vec<u8> {
        let is_modern = self.layout.is_modern();
        let len: u16 = if is_modern { 375 } else { 227 };
        let mut out = Vec::with_capacity(len.into());
        out.extend(b"LASF");
        out.extend([0, 0, if is_modern { 16 } else { 0 }, 0]); // source, encoding (GPS week time; WKT in LAS 1.4)
        out.extend([0; 16]); // GUID
        out.extend([1, if is_modern { 4 } else { 2 }]);
        out.extend(padded::<32>("generated"));
        out.extend(padded::<32>("pointmill-bench"));
        out.extend([1, 0, 0xEA, 0x07]); // 1 January 2026
        out.extend(len.to_le_bytes());
        out.extend((u32::from(len) + self.vlrs.len() as u32).to_le_bytes());
        out.extend(self.vlr_count.to_le_bytes());
        out.push(self.layout.format() | u8::from(self.compressed) << 7);
        out.extend((self.layout.record_len() as u16).to_le_bytes());
        let legacy = |count: u32| if is_modern { 0 } else { count }.to_le_bytes();
        out.extend(legacy(self.count));
        out.extend(self.by_return.iter().flat_map(|n| legacy(*n)));
        out.extend([self.scene.scale(); 3].iter().flat_map(|s| s.to_le_bytes()));
        out.extend(self.scene.offset().iter().flat_map(|o| o.to_le_bytes()));
        for a in 0..3 {
            let world = |q: i32| f64::from(q) * self.scene.scale() + self.scene.offset()[a];
            out.extend(world(self.max[a]).to_le_bytes());
            out.extend(world(self.min[a]).to_le_bytes());
        }
        if is_modern {
            out.extend([0; 20]); // waveforms, extended records
            out.extend(u64::from(self.count).to_le_bytes());
            out.extend(self.by_return.iter().flat_map(|n| u64::from(*n).to_le_bytes()));
            out.resize(len.into(), 0); // returns 6 to 15
        }
        out
    }
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

    /// What another library finds: all points inside the bounds of the header.
    fn read(path: &Path) -> Vec<las::Point> {
        let mut reader = las::Reader::from_path(path).unwrap();
        let bounds = reader.header().bounds();
        let all = reader.read_all().unwrap();
        let points: Vec<las::Point> = all.points().map(Result::unwrap).collect();
        let is_inside =
            |p: &las::Point| bounds.min.x <= p.x && p.x <= bounds.max.x && bounds.min.z <= p.z && p.z <= bounds.max.z;
        assert!(points.iter().all(is_inside));
        points
    }

    #[test]
    fn another_reader_finds_every_point_inside_the_header_bounds_in_las_and_laz_alike() {
        let dir = tempfile::tempdir().unwrap();
        for scene in [Scene::Aerial, Scene::Terrestrial, Scene::Shuffled, Scene::Volume] {
            let [las, laz] = ["las", "laz"].map(|ending| {
                let path = dir.path().join(format!("{}.{ending}", scene.name()));
                write(scene, LasLayout::COLOUR, POINTS, 7, &path).unwrap();
                read(&path)
            });
            assert_eq!(las.len() as u64, POINTS);
            assert!(las == laz);
        }
    }

    #[test]
    fn every_layout_has_its_fields_of_the_same_points() {
        let dir = tempfile::tempdir().unwrap();
        let read = |layout: LasLayout, ending: &str| {
            let path = dir.path().join(format!("s.{ending}"));
            write(Scene::Aerial, layout, 60_000, 7, &path).unwrap();
            read(&path)
        };
        let colour = read(LasLayout::COLOUR, "las");
        let other = [LasLayout::PLAIN, LasLayout::EXTRA, LasLayout::MODERN, LasLayout::MODERN_COLOUR];
        for layout in other {
            let points = read(layout, "las");
            assert!(read(layout, "laz") == points, "{}", layout.name());
            let expected = colour.iter().cloned().map(|mut p| {
                p.gps_time = p.gps_time.filter(|_| layout.format() != 0);
                p.color = p.color.filter(|_| matches!(layout.format(), 3 | 7));
                p
            });
            let bare = points.iter().cloned().map(|mut p| {
                p.extra_bytes.clear();
                p
            });
            assert!(bare.eq(expected), "{}", layout.name());
            let extra = if layout == LasLayout::EXTRA { 4 } else { 0 };
            assert!(points.iter().all(|p| p.extra_bytes.len() == extra), "{}", layout.name());
        }
    }

    #[test]
    fn extra_bytes_are_described() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.las");
        write(Scene::Aerial, LasLayout::EXTRA, 100, 7, &path).unwrap();
        let scan = pointmill_format::scan::las::open(&path).unwrap();
        let names: Vec<_> = scan.info().attributes.iter().rev().take(2).map(|a| (a.name.as_str(), a.size())).collect();
        assert_eq!(names, [("deviation", 2), ("echo width", 2)]);
        assert!(scan.info().warnings.is_empty());
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
        let dir = tempfile::tempdir().unwrap();
        let bytes = |seed| {
            let path = dir.path().join("s.las");
            write(Scene::Aerial, LasLayout::COLOUR, 1000, seed, &path).unwrap();
            std::fs::read(path).unwrap()
        };
        assert!(bytes(7) == bytes(7));
        assert!(bytes(7) != bytes(8));
    }
}

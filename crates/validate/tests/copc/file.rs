//! The tiny octree of all octree tests as a COPC file, written from the format page by the plainest means; chunks by the
//! crate `laz`.

use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::PathBuf;

use laz::{LasZipCompressor, LazVlr, LazVlrBuilder};
use pointmill_format::NodeKey;
use pointmill_testkit::damage::put;
use pointmill_validate::{Options, Outcome, validate};
use serde_json::{Value, json};

use crate::support::{Cloud, OFFSET, Point, SCALE, SIDE, Sampler, surfels};

pub(crate) const WKT: &str = "PROJCS[\"test\",UNIT[\"metre\",1]]";

/// Where the data of the info record stands.
pub(crate) const INFO: usize = 429;

/// Pages begin at this level.
pub(crate) const PAGE_LEVEL: u8 = 4;

/// A file in memory, and where things stand in it.
#[derive(Debug, Clone)]
pub(crate) struct Copc {
    pub(crate) bytes: Vec<u8>,
    /// The entry of each node that has its count.
    pub(crate) entries: BTreeMap<NodeKey, usize>,
    /// Entries that lead on to pages.
    pub(crate) proxies: BTreeMap<NodeKey, usize>,
    /// The chunk table.
    pub(crate) table: usize,
    /// The extended record of the hierarchy.
    pub(crate) hierarchy: usize,
    /// The data of the records of LASzip, the reference system and extra bytes.
    pub(crate) laszip: usize,
    pub(crate) wkt: usize,
    pub(crate) extra: usize,
}

/// How a file is written.
#[derive(Debug, Clone)]
pub(crate) struct Writer {
    /// What the header names.
    pub(crate) software: &'static str,
    /// pointmill's own record.
    pub(crate) own: Option<Value>,
    /// Points have a byte more, which is described with its range: 3 to 202.
    pub(crate) has_extra: bool,
    /// Planted: the chunk table has the first two chunks the other way round.
    pub(crate) turns_table: bool,
    /// Planted: points of a node stay in the order of the cloud, whatever their times are.
    pub(crate) is_unsorted: bool,
}

impl Default for Writer {
    fn default() -> Self {
        let own = json!({ "version": "0.1.0", "sampling": "poisson", "rgbDepth": "auto", "duplicates": "keep" });
        Self { software: "pointmill 0.1.0", own: Some(own), has_extra: false, turns_table: false, is_unsorted: false }
    }
}

/// A good file that names pointmill.
pub(crate) fn good() -> Copc {
    Writer::default().encode(&Cloud::new(Sampler::Poisson))
}

/// A good file of another program.
pub(crate) fn foreign() -> Copc {
    let writer = Writer { software: "another", own: None, ..Writer::default() };
    writer.encode(&Cloud::new(Sampler::Poisson))
}

/// A record of point format 7.
fn record(point: &Point, has_extra: bool) -> Vec<u8> {
    let mut out = Vec::new();
    point.position.iter().for_each(|v| out.extend(v.to_le_bytes()));
    out.extend(point.intensity.to_le_bytes());
    out.extend([0x11, 0, point.classification & 31, 0]);
    let angle = (f64::from(point.scan_angle) / 0.006).round() as i16;
    out.extend(angle.to_le_bytes());
    out.extend([0, 0]);
    out.extend(point.gps_time.to_le_bytes());
    point.rgb.iter().for_each(|v| out.extend(v.to_le_bytes()));
    out.extend(has_extra.then_some(3 + (point.position[0] % 200) as u8));
    point.surfel.iter().flatten().for_each(|v| out.extend(v.to_le_bytes()));
    out
}

fn compress(vlr: &LazVlr, chunks: &[Vec<u8>]) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let mut compressor = LasZipCompressor::new(&mut out, vlr.clone()).unwrap();
    for (i, chunk) in chunks.iter().enumerate() {
        if i > 0 {
            compressor.finish_current_chunk().unwrap();
        }
        compressor.compress_many(chunk).unwrap();
    }
    compressor.done().unwrap();
    drop(compressor);
    out.into_inner()
}

/// Where the table stands in compressed points that begin at byte 0.
fn table_of(compressed: &[u8]) -> usize {
    i64::from_le_bytes(compressed[..8].try_into().unwrap()) as usize
}

fn head(user: &str, number: u16, length: u64, is_extended: bool) -> Vec<u8> {
    let mut out = vec![0; 2];
    out.extend(user.as_bytes());
    out.resize(18, 0);
    out.extend(number.to_le_bytes());
    out.extend(&length.to_le_bytes()[..if is_extended { 8 } else { 2 }]);
    out.resize(if is_extended { 60 } else { 54 }, 0);
    out
}

fn entry(key: NodeKey, offset: u64, bytes: u64, points: i32) -> Vec<u8> {
    let mut out = Vec::new();
    [i32::from(key.level), key.x as i32, key.y as i32, key.z as i32].iter().for_each(|v| out.extend(v.to_le_bytes()));
    out.extend(offset.to_le_bytes());
    out.extend((bytes as i32).to_le_bytes());
    out.extend(points.to_le_bytes());
    out
}

/// Pages: keys, each with its page's first node if that is another.
fn pages(cloud: &Cloud) -> Vec<(NodeKey, Vec<NodeKey>)> {
    let is_page = |key: &NodeKey| key.level == PAGE_LEVEL && cloud.is_inner(*key);
    let mut pages = vec![(NodeKey::ROOT, Vec::new())];
    pages.extend(cloud.nodes.keys().copied().filter(is_page).map(|key| (key, Vec::new())));
    for key in cloud.nodes.keys() {
        let above = key.ancestor(PAGE_LEVEL).filter(is_page);
        pages.iter_mut().find(|(root, _)| *root == above.unwrap_or(NodeKey::ROOT)).unwrap().1.push(*key);
    }
    pages
}

impl Writer {
    /// Bytes of a point behind the fields of its format.
    fn extra_bytes(&self, cloud: &Cloud) -> u16 {
        u16::from(self.has_extra) + if cloud.has_surfels() { 20 } else { 0 }
    }

    fn descriptors(&self, cloud: &Cloud) -> Vec<u8> {
        let mut out = if self.has_extra { descriptor() } else { Vec::new() };
        for name in surfels::NAMES.iter().filter(|_| cloud.has_surfels()) {
            let mut descriptor = vec![0; 192];
            put(&mut descriptor, 2, &[9]);
            put(&mut descriptor, 4, name.as_bytes());
            out.extend(descriptor);
        }
        out
    }

    pub(crate) fn encode(&self, cloud: &Cloud) -> Copc {
        let extra = self.extra_bytes(cloud);
        let builder = LazVlrBuilder::default().with_point_format(7, extra).unwrap();
        let vlr = builder.with_variable_chunk_size().build();
        let nodes: Vec<(NodeKey, i32, Vec<u8>)> = cloud
            .nodes
            .iter()
            .filter(|(_, points)| !points.is_empty())
            .map(|(k, p)| {
                let mut points = p.clone();
                if !self.is_unsorted {
                    points.sort_by(|a, b| a.gps_time.total_cmp(&b.gps_time));
                }
                (*k, p.len() as i32, points.iter().flat_map(|p| record(p, self.has_extra)).collect())
            })
            .collect();
        let mut bytes = vec![0; 375];
        let mut records = head("copc", 1, 160, false);
        records.resize(records.len() + 160, 0);
        let mut at = [0; 3];
        let mut laszip = Vec::new();
        vlr.write_to(&mut laszip).unwrap();
        let wkt = [WKT.as_bytes(), &[0]].concat();
        let others = [
            ("laszip encoded", 22204, laszip),
            ("LASF_Projection", 2112, wkt),
            ("LASF_Spec", 4, self.descriptors(cloud)),
        ];
        let count = 3 + u32::from(extra > 0);
        for ((user, number, data), at) in others.into_iter().zip(&mut at).take(count as usize - 1) {
            records.extend(head(user, number, data.len() as u64, false));
            *at = 375 + records.len();
            records.extend(data);
        }
        bytes.extend(records);
        let start = bytes.len();
        bytes.extend([0; 8]);
        let (mut places, mut all) = (BTreeMap::new(), Vec::new());
        for (key, points, chunk) in &nodes {
            let alone = compress(&vlr, std::slice::from_ref(chunk));
            let alone = &alone[8..table_of(&alone)];
            places.insert(*key, (bytes.len() as u64, alone.len() as u64, *points));
            bytes.extend(alone);
            all.push(chunk.clone());
        }
        let table = bytes.len();
        put(&mut bytes, start, &(table as u64).to_le_bytes());
        if self.turns_table {
            all.swap(0, 1);
        }
        let together = compress(&vlr, &all);
        bytes.extend(&together[table_of(&together)..]);
        let mut copc = Copc {
            entries: BTreeMap::new(),
            proxies: BTreeMap::new(),
            table,
            hierarchy: bytes.len(),
            laszip: at[0],
            wkt: at[1],
            extra: at[2],
            bytes,
        };
        let extended = self.extended(cloud, &places, &mut copc);
        self.header(cloud, &mut copc, [start as u32, count, extended]);
        copc
    }

    /// The extended records; how many there are.
    fn extended(&self, cloud: &Cloud, places: &BTreeMap<NodeKey, (u64, u64, i32)>, copc: &mut Copc) -> u32 {
        let pages = pages(cloud);
        let lens: Vec<usize> = pages.iter().map(|(_, keys)| 32 * keys.len()).collect();
        let proxies = 32 * (pages.len() - 1);
        let all = lens.iter().sum::<usize>() + proxies;
        let data = copc.hierarchy + 60;
        copc.bytes.extend(head("copc", 1000, all as u64, true));
        put(&mut copc.bytes, INFO + 40, &(data as u64).to_le_bytes());
        put(&mut copc.bytes, INFO + 48, &((lens[0] + proxies) as u64).to_le_bytes());
        let mut page_at = data + lens[0] + proxies;
        for ((root, _), len) in pages.iter().zip(&lens).skip(1) {
            copc.proxies.insert(*root, copc.bytes.len());
            copc.bytes.extend(entry(*root, page_at as u64, *len as u64, -1));
            page_at += len;
        }
        for key in pages.iter().flat_map(|(_, keys)| keys) {
            copc.entries.insert(*key, copc.bytes.len());
            let (offset, bytes, points) = places.get(key).copied().unwrap_or_default();
            copc.bytes.extend(entry(*key, offset, bytes, points));
        }
        let Some(own) = &self.own else { return 1 };
        let text = own.to_string();
        copc.bytes.extend(head("pointmill", 1, text.len() as u64, true));
        copc.bytes.extend(text.as_bytes());
        2
    }

    fn header(&self, cloud: &Cloud, copc: &mut Copc, [start, records, extended]: [u32; 3]) {
        let hierarchy = copc.hierarchy as u64;
        let out = &mut copc.bytes;
        put(out, 0, b"LASF");
        put(out, 6, &16u16.to_le_bytes());
        put(out, 24, &[1, 4]);
        put(out, 58, self.software.as_bytes());
        put(out, 94, &375u16.to_le_bytes());
        put(out, 96, &start.to_le_bytes());
        put(out, 100, &records.to_le_bytes());
        put(out, 104, &[7 | 0x80]);
        put(out, 105, &(36 + self.extra_bytes(cloud)).to_le_bytes());
        let range = |values: &mut dyn Iterator<Item = f64>| {
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[min, max], v| [min.min(v), max.max(v)])
        };
        let mut center = OFFSET;
        let half = f64::from(SIDE) * SCALE / 2.0;
        for axis in 0..3 {
            center[axis] += half;
            put(out, 131 + 8 * axis, &SCALE.to_le_bytes());
            put(out, 155 + 8 * axis, &OFFSET[axis].to_le_bytes());
            let world = |p: &Point| f64::from(p.position[axis]) * SCALE + OFFSET[axis];
            let [min, max] = range(&mut cloud.points().map(world));
            put(out, 179 + 16 * axis, &max.to_le_bytes());
            put(out, 187 + 16 * axis, &min.to_le_bytes());
            put(out, INFO + 8 * axis, &center[axis].to_le_bytes());
        }
        put(out, 235, &hierarchy.to_le_bytes());
        put(out, 243, &extended.to_le_bytes());
        let count = cloud.points().count() as u64;
        put(out, 247, &count.to_le_bytes());
        put(out, 255, &count.to_le_bytes());
        let [first, last] = range(&mut cloud.points().map(|p| p.gps_time).filter(|t| t.is_finite()));
        for (at, value) in [(24, half), (32, 2.0 * half / 128.0), (56, first), (64, last)] {
            put(out, INFO + at, &value.to_le_bytes());
        }
    }
}

/// Describes a byte of the name "shade".
fn descriptor() -> Vec<u8> {
    let mut out = vec![0; 192];
    put(&mut out, 2, &[1, 0b110]);
    put(&mut out, 4, b"shade");
    put(&mut out, 64, &3u64.to_le_bytes());
    put(&mut out, 88, &202u64.to_le_bytes());
    out
}

impl Copc {
    /// Writes `new` over bytes of the file.
    pub(crate) fn put(&mut self, at: usize, new: &[u8]) {
        put(&mut self.bytes, at, new);
    }

    pub(crate) fn u32(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.bytes[at..at + 4].try_into().unwrap())
    }

    pub(crate) fn u64(&self, at: usize) -> u64 {
        u64::from_le_bytes(self.bytes[at..at + 8].try_into().unwrap())
    }

    pub(crate) fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.bytes[at..at + 8].try_into().unwrap())
    }

    /// The first leaf of the deepest level, and its entry.
    pub(crate) fn leaf(&self) -> (NodeKey, usize) {
        let (key, at) = self.entries.last_key_value().unwrap();
        (*key, *at)
    }

    pub(crate) fn validate(&self) -> Outcome {
        self.validate_with(|_| Options::default())
    }

    /// Validates against a LAS file.
    pub(crate) fn validate_against(&self, las: &[u8]) -> Outcome {
        self.validate_with(|path| {
            let source = path.with_file_name("source.las");
            fs::write(&source, las).unwrap();
            Options { against: vec![source], ..Options::default() }
        })
    }

    pub(crate) fn validate_with(&self, options: impl FnOnce(&PathBuf) -> Options) -> Outcome {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("points.copc.laz");
        fs::write(&path, &self.bytes).unwrap();
        let options = Options { threads: 2, ..options(&path) };
        validate(&path, &options, &|_| {}).unwrap()
    }
}

//! The protocol, read as the page reads it.

/// A field at its place.
pub(crate) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(bytes[at..at + 2].try_into().unwrap())
}

fn f32_at(bytes: &[u8], at: usize) -> f32 {
    f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

fn vector(bytes: &[u8], at: usize) -> [f64; 3] {
    std::array::from_fn(|a| f64::from_le_bytes(bytes[at + 8 * a..at + 8 * a + 8].try_into().unwrap()))
}

/// A node of an octree.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Node {
    pub(crate) name: String,
    pub(crate) points: u32,
    pub(crate) mask: u8,
    pub(crate) is_proxy: bool,
}

/// A chunk that begins with the node `name`: the names follow from the masks.
pub(crate) fn nodes(bytes: &[u8], name: &str) -> Vec<Node> {
    assert_eq!(&bytes[..4], b"PMN1");
    let count = u32_at(bytes, 4) as usize;
    assert_eq!(bytes.len(), 8 + 8 * count);
    let mut names = std::collections::VecDeque::from([name.to_owned()]);
    let mut found = Vec::new();
    for row in bytes[8..].as_chunks::<8>().0 {
        let node =
            Node { name: names.pop_front().unwrap(), points: u32_at(row, 0), mask: row[4], is_proxy: row[5] == 1 };
        assert_eq!((row[6], row[7]), (0, 0));
        if !node.is_proxy {
            names.extend(
                (0..8).filter(|child| node.mask >> child & 1 == 1).map(|child| format!("{}{child}", node.name)),
            );
        }
        found.push(node);
    }
    assert!(names.is_empty(), "{names:?}");
    found
}

/// A leaf or a batch.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Row {
    pub(crate) min: [f64; 3],
    pub(crate) max: [f64; 3],
    pub(crate) points: u32,
    pub(crate) unit: u32,
    pub(crate) by_level: [u16; 4],
}

pub(crate) fn rows(bytes: &[u8]) -> Vec<Row> {
    assert_eq!(&bytes[..4], b"PMN1");
    let rows = bytes[8..].as_chunks::<64>();
    assert_eq!((rows.0.len(), rows.1.len()), (u32_at(bytes, 4) as usize, 0));
    let row = |row: &[u8; 64]| Row {
        min: vector(row, 0),
        max: vector(row, 24),
        points: u32_at(row, 48),
        unit: u32_at(row, 52),
        by_level: std::array::from_fn(|i| u16_at(row, 56 + 2 * i)),
    };
    rows.0.iter().map(row).collect()
}

/// The 64 bytes before a body.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Header {
    pub(crate) count: usize,
    pub(crate) flags: u32,
    pub(crate) origin: [f64; 3],
    pub(crate) step: [f64; 3],
    pub(crate) total: usize,
}

/// Headers with their bodies.
pub(crate) fn units(bytes: &[u8]) -> Vec<(Header, &[u8])> {
    let (mut at, mut found) = (0, Vec::new());
    while at < bytes.len() {
        let body = u32_at(bytes, at + 56) as usize;
        assert_eq!(body % 8, 0);
        let header = Header {
            count: u32_at(bytes, at) as usize,
            flags: u32_at(bytes, at + 4),
            origin: vector(bytes, at + 8),
            step: vector(bytes, at + 32),
            total: u32_at(bytes, at + 60) as usize,
        };
        found.push((header, &bytes[at + 64..at + 64 + body]));
        at += 64 + body;
    }
    found
}

/// A point of a node or a leaf.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Point {
    pub(crate) world: [f64; 3],
    pub(crate) intensity: u32,
    pub(crate) rgb: [u8; 3],
    pub(crate) class: u8,
    pub(crate) value: Option<f32>,
}

pub(crate) fn points(header: &Header, body: &[u8]) -> Vec<Point> {
    let is_wide = header.flags & 1 == 1;
    let (n, size) = (header.count, if is_wide { 4 } else { 2 });
    let has_value = header.flags & 4 != 0;
    let used = n * (4 * size + 4 + if has_value { 4 } else { 0 });
    assert_eq!(body.len(), used.next_multiple_of(8));
    let integer = |at: usize| if is_wide { u32_at(body, at) } else { u16_at(body, at).into() };
    let point = |i: usize| {
        let word = |axis: usize| integer((4 * i + axis) * size);
        // a shader takes them as numbers with a sign
        assert!((0..3).all(|axis| word(axis) < 1 << 31), "{header:?}: point {i}");
        let colour = 4 * n * size + 4 * i;
        Point {
            world: std::array::from_fn(|a| header.origin[a] + f64::from(word(a)) * header.step[a]),
            intensity: word(3),
            rgb: [body[colour], body[colour + 1], body[colour + 2]],
            class: body[colour + 3],
            value: has_value.then(|| f32_at(body, 4 * n * (size + 1) + 4 * i)),
        }
    };
    (0..n).map(point).collect()
}

/// A point of a batch: words of the planes that are there, the colour word, its index in the batch, a value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BatchPoint {
    pub(crate) planes: Vec<u32>,
    pub(crate) colour: u32,
    pub(crate) index: u16,
    pub(crate) value: Option<f32>,
}

pub(crate) fn batch_points(header: &Header, body: &[u8]) -> Vec<BatchPoint> {
    let (n, planes, has_value) = (header.count, (header.flags & 3) as usize, header.flags & 4 != 0);
    let indices = 4 * n * (planes + 1);
    let values = indices + (2 * n).next_multiple_of(4);
    let used = values + if has_value { 4 * n } else { 0 };
    assert_eq!(body.len(), used.next_multiple_of(8));
    let point = |i: usize| BatchPoint {
        planes: (0..planes).map(|plane| u32_at(body, 4 * (plane * n + i))).collect(),
        colour: u32_at(body, 4 * (planes * n + i)),
        index: u16_at(body, indices + 2 * i),
        value: has_value.then(|| f32_at(body, values + 4 * i)),
    };
    (0..n).map(point).collect()
}

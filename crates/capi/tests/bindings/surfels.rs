//! An octree with normals and radii, all of it in its root.

use std::path::Path;

/// Writes `count` points as a Potree 2.0 dataset of one node: position, NormalX to NormalZ, radius, rgb.
pub(crate) fn write_surfels(folder: &Path, count: u32) {
    let mut points = Vec::new();
    for i in 0..count {
        for place in [i % 1000, i / 1000, 5] {
            points.extend_from_slice(&(place as i32).to_le_bytes());
        }
        for value in [0.0, 1.2, 1.6, i as f32 / 1024.0] {
            points.extend_from_slice(&f32::to_le_bytes(value));
        }
        // 16 bits that become these 8
        for channel in [i % 256, i / 256 % 256, 7] {
            points.extend_from_slice(&(channel as u16 * 257).to_le_bytes());
        }
    }
    // a leaf without children: kind, mask, points, first byte, bytes
    let mut hierarchy = vec![1, 0];
    hierarchy.extend_from_slice(&count.to_le_bytes());
    hierarchy.extend_from_slice(&0u64.to_le_bytes());
    hierarchy.extend_from_slice(&(points.len() as u64).to_le_bytes());
    let attribute = |name: &str, ty: &str, size: usize, elements: usize, max: &str| {
        let list = |value: &str| vec![value; elements].join(", ");
        format!(
            r#"{{"name": "{name}", "description": "", "size": {}, "numElements": {elements}, "elementSize": {size}, "type": "{ty}",
            "min": [{}], "max": [{}], "scale": [{}], "offset": [{}]}}"#,
            size * elements,
            list("0"),
            list(max),
            list("1"),
            list("0")
        )
    };
    let attributes = [
        attribute("position", "int32", 4, 3, "1"),
        attribute("NormalX", "float", 4, 1, "2"),
        attribute("NormalY", "float", 4, 1, "2"),
        attribute("NormalZ", "float", 4, 1, "2"),
        attribute("radius", "float", 4, 1, "128"),
        attribute("rgb", "uint16", 2, 3, "65535"),
    ];
    let metadata = format!(
        r#"{{"version": "2.0", "name": "surfels", "description": "", "points": {count}, "projection": "",
        "hierarchy": {{"firstChunkSize": 22, "stepSize": 4, "depth": 0}}, "offset": [0, 0, 0], "scale": [0.001, 0.001, 0.001],
        "spacing": 0.01, "boundingBox": {{"min": [0, 0, 0], "max": [1.024, 1.024, 1.024]}}, "encoding": "DEFAULT",
        "attributes": [{}]}}"#,
        attributes.join(", ")
    );
    std::fs::write(folder.join("metadata.json"), metadata).unwrap();
    std::fs::write(folder.join("hierarchy.bin"), hierarchy).unwrap();
    std::fs::write(folder.join("octree.bin"), points).unwrap();
}

//! What `walk.c` should print, computed with the Rust crates.

use std::path::Path;

use pointmill_format::batches::{Batches, BlockScratch, MappedFile, Part, Precision, distance_to_box, eight_bit};
use pointmill_format::bintree::{Material, distance_range, switch_distance};
use pointmill_format::octree::{OctreeNodes, Order, Selection, Viewpoint, VisibleNode, visible_nodes};
use pointmill_format::{Aabb, AttributeType, Column, Frustum, Lattice, NodeKey, NodePoints, with_column};

use crate::dataset::{Corner, DRAWABLE, Dataset, Facts, NO_NODE, Node, open};

/// From the file to the caller.
fn turned(axes: u32, [x, y, z]: Corner) -> Corner {
    [[x, y, z], [x, z, -y], [x, z, y]][axes as usize]
}

/// The box of the turned corners.
fn turned_box(axes: u32, bounds: &Aabb) -> String {
    let mut found = Aabb::EMPTY;
    found.grow(turned(axes, bounds.min));
    found.grow(turned(axes, bounds.max));
    let sides = (0..3).map(|a| format!(" {:?} {:?}", found.min[a], found.max[a]));
    sides.collect()
}

/// A sum in which the order of bytes counts.
fn sum_bytes(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().enumerate().map(|(i, b)| u64::from(b) * (i as u64 % 251 + 1)).sum()
}

fn raw(column: &Column) -> Vec<u8> {
    with_column!(column, v => v.iter().flat_map(|v| v.to_le_bytes()).collect())
}

/// The colours of all points; `is_deep`: of 16 bits.
fn colours(facts: &Facts, points: &NodePoints, is_deep: bool) -> Option<Vec<u8>> {
    let column = |name: &str| {
        let at = facts.attributes.iter().position(|a| a.name == name)?;
        points.columns().get(at)
    };
    if facts.kind == 5 {
        let words = column("colour")?.values::<u32>()?;
        return Some(words.iter().flat_map(|w| [*w as u8, (*w >> 8) as u8, (*w >> 16) as u8, 255]).collect());
    }
    let rgba = column("rgba").and_then(Column::values::<u8>);
    if let Some(values) = rgba {
        return Some(values.chunks(4).flat_map(|c| [c[0], c[1], c[2], 255]).collect());
    }
    match column("rgb")? {
        Column::UInt8(values) => Some(values.chunks(3).flat_map(|c| [c[0], c[1], c[2], 255]).collect()),
        Column::UInt16(values) => {
            let eight = |v: u16| if is_deep { eight_bit(v) } else { v as u8 };
            Some(values.chunks(3).flat_map(|c| [eight(c[0]), eight(c[1]), eight(c[2]), 255]).collect())
        }
        _ => None,
    }
}

#[allow(clippy::unnecessary_cast)] // of doubles
fn points_lines(facts: &Facts, id: usize, node: &Node, points: &NodePoints, is_deep: bool, axes: u32) -> Vec<String> {
    let (mut relative, mut world) = ([0.0; 3], [0.0; 3]);
    let center = turned(axes, node.center);
    for i in 0..points.len() {
        let p = turned(axes, points.world(i).unwrap());
        for a in 0..3 {
            relative[a] += f64::from((p[a] - center[a]) as f32);
            world[a] += p[a];
        }
    }
    let [[a, b, c], [x, y, z]] = [relative, world];
    let mut line = format!("points {id} {} {a:?} {b:?} {c:?} {x:?} {y:?} {z:?}", points.len());
    if let Some(colours) = colours(facts, points, is_deep) {
        line += &format!(" {}", sum_bytes(colours));
    }
    let mut lines = vec![line];
    for (i, (column, attribute)) in points.columns().iter().zip(&facts.attributes).enumerate() {
        let values: Vec<f64> = with_column!(column, v => v.iter().map(|v| *v as f64).collect());
        let meant = |(i, v): (usize, &f64)| {
            let element = i % attribute.elements;
            v * attribute.scale[element] + attribute.offset[element]
        };
        let sum = values.iter().enumerate().map(meant).fold(0.0, |sum, v| sum + v);
        lines.push(format!("values {i} {} {sum:?}", sum_bytes(raw(column))));
    }
    lines
}

fn info_lines(facts: &Facts, nodes: usize, has_colours: bool, axes: u32) -> Vec<String> {
    let Facts { kind, points, bounds, tight, spacing, lattice, capacity, bits, .. } = facts;
    let (bounds, tight) = (turned_box(axes, bounds), turned_box(axes, &tight.unwrap_or(*bounds)));
    let (scale, offset) = (lattice.scale[0], lattice.offset[0]);
    let count = facts.attributes.len();
    let mut lines = vec![
        format!(
            "info {kind} {points} {nodes} {count} {}{bounds}{tight} {spacing:?} {scale:?} {offset:?} {capacity} {bits}",
            u8::from(has_colours)
        ),
        format!("projection [{}]", facts.projection),
    ];
    for (attribute, ranges) in facts.attributes.iter().zip(&facts.ranges) {
        let ty = AttributeType::ALL.iter().position(|ty| *ty == attribute.ty).unwrap();
        let (name, elements, size) = (&attribute.name, attribute.elements, attribute.size());
        let ranges: String = ranges.iter().map(|[min, max]| format!(" {min:?} {max:?}")).collect();
        lines.push(format!("attribute [{name}] {ty} {elements} {size}{ranges}"));
    }
    lines
}

fn section_lines(batches: &Batches<MappedFile>) -> Vec<String> {
    let parts =
        [None, Some(Part::Hi10), Some(Part::Mid10), Some(Part::Lo10), Some(Part::Colour), Some(Part::Attribute(0))];
    let mut scratch = BlockScratch::default();
    let line = |(section, part): (usize, Option<Part>)| {
        let slots = 0..batches.header().batches;
        let Some(part) = part else {
            let records = batches.records().iter().flat_map(|r| {
                let floats = |v: [f32; 3]| v.map(f32::to_le_bytes).concat();
                [floats(r.min), r.first_point.to_le_bytes().to_vec(), floats(r.max), r.points.to_le_bytes().to_vec()]
                    .concat()
            });
            let bytes = 32 * batches.records().len();
            return format!("section 0 0 {bytes} {} {bytes}", sum_bytes(records));
        };
        let total: usize = slots.filter_map(|slot| batches.batch(part, slot, &mut scratch).ok().map(<[u8]>::len)).sum();
        match batches.section_bytes(part) {
            Ok(bytes) if !batches.is_compressed() => {
                format!("section {section} 0 {} {} {total}", bytes.len(), sum_bytes(bytes.iter().copied()))
            }
            _ => format!("section {section} 4 {total}"),
        }
    };
    parts.into_iter().enumerate().map(line).collect()
}

fn draw_lines(dataset: &Dataset, facts: &Facts, nodes: &[Node]) -> Vec<String> {
    let tight = facts.tight.unwrap_or(facts.bounds);
    let size = tight.extent().into_iter().fold(0.0, f64::max);
    let middle = [0, 1, 2].map(|a| (tight.min[a] + tight.max[a]) / 2.0);
    let eye = [middle[0], middle[1] - 1.5 * size, middle[2]];
    let (forward, focal) = ([0.0, 1.0, 0.0], 900.0 / (2.0 * 0.5f64.tan()));
    let frustum = Frustum::perspective(eye, forward, [0.0, 0.0, 1.0], 1.0, 16.0 / 9.0, [0.0, 4.0 * Lattice::FARTHEST]);
    let range = |id: usize| distance_range(&nodes[id].bounds, eye);
    let line = |id: usize, parent: u32, material: u32, bits: u32, points: u64, pixels: f64| {
        let [d_min, d_max] = range(id);
        format!("draw {id} {parent} {material} {bits} {points} {d_min:?} {d_max:?} {pixels:?}")
    };
    let budget = facts.points / 2;
    // the nearest first, within the budget
    let nearest = |mut ids: Vec<usize>| {
        ids.sort_by(|a, b| range(*a)[0].total_cmp(&range(*b)[0]).then(a.cmp(b)));
        let mut total = 0;
        ids.into_iter().enumerate().take_while(move |(i, id)| {
            total += nodes[*id].points;
            *i == 0 || total <= budget
        })
    };
    match dataset {
        Dataset::Octree(octree, all) => {
            let view = Viewpoint::new(eye, forward, focal, frustum);
            let wanted = Selection { budget, order: Order::RadiusAndAngle, min_node_pixels: 0.0 };
            let mut known = OctreeNodes::new(&**octree).unwrap();
            let node = |key| known.load(&**octree, key).map(|_| known.get(key).copied());
            let shown = visible_nodes(&**octree, &view, &wanted, node).unwrap();
            let id = |key: NodeKey| all.iter().position(|n| n.key == key).unwrap();
            let draw = |n: &VisibleNode| {
                let parent = n.node.key.parent().map_or(NO_NODE, |key| id(key) as u32);
                line(id(n.node.key), parent, 0, 0, n.points, n.pixels)
            };
            shown.iter().map(draw).collect()
        }
        Dataset::Bintree(tree) => {
            let list = tree.draw_list(eye, switch_distance(0.05, 1.0, 900.0), Some(&frustum));
            let material = |id: usize| match list.iter().find(|(leaf, _)| *leaf as usize == id).unwrap().1 {
                Material::Far => 1,
                Material::Near => 2,
                Material::Both => 3,
            };
            let leaves = list.iter().map(|(leaf, _)| *leaf as usize).collect();
            nearest(leaves).map(|(_, id)| line(id, NO_NODE, material(id), 0, nodes[id].points, 0.0)).collect()
        }
        Dataset::Batches(batches) => {
            let bits = |id: usize| {
                let longest = batches.records()[id].sides().into_iter().fold(0.0, f64::max);
                let distance = distance_to_box(eye, nodes[id].bounds.min, nodes[id].bounds.max);
                Precision::for_error(longest, distance, size * 1e-5, focal).min(batches.header().precision()).bits()
            };
            let seen = (0..nodes.len()).filter(|id| frustum.may_see(&nodes[*id].bounds)).collect();
            nearest(seen).map(|(_, id)| line(id, NO_NODE, 0, bits(id), nodes[id].points, 0.0)).collect()
        }
    }
}

/// The first point within 0.01 of a line from above the first point of the first drawable node, along all points.
fn hit_line(dataset: &Dataset, nodes: &[Node], axes: u32) -> Option<String> {
    let drawable = || (0..nodes.len()).filter(|id| nodes[*id].flags & DRAWABLE != 0);
    let first = drawable().find_map(|id| dataset.points(id).world(0))?;
    let origin = [first[0], first[1], first[2] + 1000.0];
    let mut best: Option<(f64, f64, usize, usize, Corner)> = None;
    for id in drawable() {
        let points = dataset.points(id);
        for (i, p) in (0..points.len()).filter_map(|i| Some((i, points.world(i)?))) {
            let (distance, off) = (origin[2] - p[2], (p[0] - origin[0]).hypot(p[1] - origin[1]));
            let found = (distance, off, id, i, p);
            if distance >= 0.0
                && off <= 0.01
                && best.is_none_or(|best| (found.0, found.1, id, i) < (best.0, best.1, best.2, best.3))
            {
                best = Some(found);
            }
        }
    }
    let (distance, off, id, i, p) = best?;
    let [x, y, z] = turned(axes, p);
    Some(format!("hit 1 {id} {i} {x:?} {y:?} {z:?} {distance:?} {off:?}"))
}

/// All lines.
pub(crate) fn expected(path: &Path, axes: u32) -> Vec<String> {
    let (dataset, facts) = open(path);
    let nodes = dataset.nodes();
    let drawable = |id: &usize| nodes[*id].flags & DRAWABLE != 0;
    let all: Vec<NodePoints> = (0..nodes.len()).filter(drawable).map(|id| dataset.points(id)).collect();
    let deep = |points: &NodePoints| points.column::<u16>("rgb").is_some_and(|rgb| rgb.iter().any(|v| *v > 255));
    let is_deep = all.iter().any(deep);
    let has_colours = all.first().is_some_and(|points| colours(&facts, points, false).is_some());
    let mut lines = info_lines(&facts, nodes.len(), has_colours, axes);
    let mut points = all.iter();
    for (id, node) in nodes.iter().enumerate() {
        let Node { name, parent, level, flags, points: count, bounds, children, .. } = node;
        let children: String = children.iter().map(|child| format!(" {child}")).collect();
        let bounds = turned_box(axes, bounds);
        lines.push(format!("node {id} [{name}] {parent} {level} {flags} {count}{bounds}{children}"));
        if drawable(&id) {
            lines.extend(points_lines(&facts, id, node, points.next().unwrap(), is_deep, axes));
        }
    }
    if let Dataset::Batches(batches) = &dataset {
        lines.extend(section_lines(batches));
    }
    lines.extend(draw_lines(&dataset, &facts, &nodes));
    lines.extend(hit_line(&dataset, &nodes, axes));
    lines
}

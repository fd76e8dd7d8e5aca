//! What nodes have taken near their borders, for neighbours of the same level that are sampled after them.
//!
//! Which of two neighbours is first does not depend on threads or memory: units come in a fixed order
//! ([`super::units`]), nodes of a unit in Morton order.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError, RwLock};

use pointmill_format::NodeKey;

use super::sample::Spacing;
use crate::cloud::{TREE_BITS, TreePoint};
use crate::error::ConvertError;
use crate::runtime::{Consumer, DiskFile, Pool, Reservation, TempFiles};

/// Points of finished units near the borders of these, by node: in memory as long as there is room, else in a temporary
/// file.
pub(super) struct Borders {
    spacing: Spacing,
    nodes: RwLock<HashMap<NodeKey, Kept>>,
    memory: Arc<Pool>,
    room: Mutex<Reservation>,
    file: Mutex<Option<(Arc<DiskFile>, u64)>>,
    temp: TempFiles,
}

enum Kept {
    Memory(Box<[TreePoint]>, #[expect(dead_code, reason = "gives back its memory")] Reservation),
    /// From a byte of the file on.
    Disk(Arc<DiskFile>, u64, u32),
}

const POINT_BYTES: usize = size_of::<TreePoint>();

/// What is known of a node beside its points.
const ENTRY_BYTES: usize = 2 * size_of::<(NodeKey, Kept)>();

impl Borders {
    pub(super) fn new(spacing: Spacing, memory: &Arc<Pool>, temp: &TempFiles) -> Self {
        Self {
            spacing,
            nodes: RwLock::default(),
            memory: Arc::clone(memory),
            room: Mutex::new(Reservation::new(memory, Consumer::Nodes)),
            file: Mutex::new(None),
            temp: temp.clone(),
        }
    }

    /// Between points of a sample.
    pub(super) fn spacing(&self) -> Spacing {
        self.spacing
    }

    /// Hands the points of a node to `add`.
    pub(super) fn get(&self, key: NodeKey, mut add: impl FnMut(TreePoint)) -> Result<(), ConvertError> {
        let nodes = self.nodes.read().unwrap_or_else(PoisonError::into_inner);
        match nodes.get(&key) {
            None => Ok(()),
            Some(Kept::Memory(points, _)) => {
                points.iter().copied().for_each(add);
                Ok(())
            }
            Some(Kept::Disk(file, offset, count)) => {
                let (file, offset, count) = (Arc::clone(file), *offset, *count as usize);
                drop(nodes);
                let mut bytes = vec![0; count * POINT_BYTES];
                file.read_at(&mut bytes, offset, "reading the borders of nodes")?;
                let axis = |b: &[u8; 4]| u32::from_le_bytes(*b);
                for point in bytes.as_chunks::<POINT_BYTES>().0 {
                    let [x, y, z] = [0, 1, 2].map(|a| axis(&point.as_chunks::<4>().0[a]));
                    add(TreePoint([x, y, z]));
                }
                Ok(())
            }
        }
    }

    /// Lets later units see what lies near the border of one.
    pub(super) fn publish(&self, outer: Vec<(NodeKey, Vec<TreePoint>)>) -> Result<(), ConvertError> {
        outer.into_iter().try_for_each(|(node, points)| self.put(node, points))
    }

    fn put(&self, key: NodeKey, points: Vec<TreePoint>) -> Result<(), ConvertError> {
        let bytes = points.len() * POINT_BYTES;
        let kept = if self.memory.try_take_eighth(Consumer::Waiting, bytes as u64) {
            Kept::Memory(points.into_boxed_slice(), Reservation::of(&self.memory, Consumer::Waiting, bytes as u64))
        } else {
            let encoded: Vec<u8> = points.iter().flat_map(|p| p.0).flat_map(u32::to_le_bytes).collect();
            let (file, offset) = self.region(bytes as u64)?;
            file.write_at(&encoded, offset, "writing the borders of nodes")?;
            Kept::Disk(file, offset, points.len() as u32)
        };
        let mut nodes = self.nodes.write().unwrap_or_else(PoisonError::into_inner);
        nodes.insert(key, kept);
        let known = nodes.len() * ENTRY_BYTES;
        drop(nodes);
        self.room.lock().unwrap_or_else(PoisonError::into_inner).grow_to(known as u64)
    }

    /// The file, and where `bytes` go.
    fn region(&self, bytes: u64) -> Result<(Arc<DiskFile>, u64), ConvertError> {
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let (file, end) = match &mut *file {
            Some(known) => known,
            empty => empty.insert((Arc::new(self.temp.make()?), 0)),
        };
        let start = *end;
        *end += bytes;
        Ok((Arc::clone(file), start))
    }
}

/// The borders that a unit sees: of units before it, and of its own nodes.
pub(super) struct UnitBorders<'a> {
    others: &'a Borders,
    unit: NodeKey,
    own: HashMap<NodeKey, Vec<TreePoint>>,
    around: Vec<TreePoint>,
}

impl<'a> UnitBorders<'a> {
    pub(super) fn new(others: &'a Borders, unit: NodeKey) -> Self {
        Self { others, unit, own: HashMap::new(), around: Vec::new() }
    }

    /// What neighbours of a node of the unit have taken closer to it than the spacing, along each axis.
    pub(super) fn around(&mut self, node: NodeKey) -> Result<&[TreePoint], ConvertError> {
        let Self { others, unit, own, around } = self;
        around.clear();
        let Some(reach) = others.spacing.reach(node.level) else { return Ok(around) };
        let near = Surroundings::of(node, reach);
        for neighbour in neighbours(node) {
            let mut add = |t: TreePoint| {
                if near.hold(t) {
                    around.push(t);
                }
            };
            if is_in(neighbour, *unit) {
                own.get(&neighbour).into_iter().flatten().copied().for_each(add);
            } else {
                others.get(neighbour, &mut add)?;
            }
        }
        Ok(around)
    }

    /// Notes what a node of the unit has taken near its border.
    pub(super) fn note(&mut self, node: NodeKey, border: &[TreePoint]) {
        if !border.is_empty() {
            self.own.insert(node, border.to_vec());
        }
    }

    /// What lies near the border of the unit, for later ones: [`Borders::publish`].
    pub(super) fn into_outer(self) -> Vec<(NodeKey, Vec<TreePoint>)> {
        let mut outer = Vec::new();
        for (node, mut points) in self.own {
            let Some(reach) = self.others.spacing.reach(node.level) else { continue };
            let inside = Inside::of(self.unit, reach);
            points.retain(|t| !inside.holds(*t));
            if !points.is_empty() {
                points.shrink_to_fit();
                outer.push((node, points));
            }
        }
        outer
    }
}

/// The nodes of the same level that touch one.
fn neighbours(node: NodeKey) -> impl Iterator<Item = NodeKey> {
    let end = 1u64 << node.level;
    let at = move |c: u32, step: u32| (u64::from(c) + u64::from(step)).checked_sub(1).filter(|c| *c < end);
    (0..27).filter(|i| *i != 13).filter_map(move |i| {
        let (x, y, z) = (at(node.x, i / 9)?, at(node.y, i / 3 % 3)?, at(node.z, i % 3)?);
        Some(NodeKey { level: node.level, x: x as u32, y: y as u32, z: z as u32 })
    })
}

fn is_in(node: NodeKey, unit: NodeKey) -> bool {
    node.ancestor(unit.level) == Some(unit)
}

/// The lower corner of a node, and its side.
fn cube_of(node: NodeKey) -> ([i64; 3], i64) {
    let bits = TREE_BITS - u32::from(node.level);
    ([node.x, node.y, node.z].map(|c| i64::from(c) << bits), 1 << bits)
}

/// A node and what is closer to it than a distance, along each axis.
pub(super) struct Surroundings {
    low: [i64; 3],
    width: u64,
}

impl Surroundings {
    pub(super) fn of(node: NodeKey, reach: u32) -> Self {
        let (corner, side) = cube_of(node);
        Self { low: corner.map(|c| c - i64::from(reach)), width: side as u64 + 2 * u64::from(reach) }
    }

    #[inline]
    pub(super) fn hold(&self, t: TreePoint) -> bool {
        (0..3).all(|a| ((i64::from(t[a]) - self.low[a]) as u64) < self.width)
    }
}

/// What is farther from the border of a node than a distance, inside; of the faces of the root nobody is on the other side.
pub(super) struct Inside {
    low: [i64; 3],
    high: [i64; 3],
}

impl Inside {
    pub(super) fn of(node: NodeKey, reach: u32) -> Self {
        let (corner, side) = cube_of(node);
        let (reach, end) = (i64::from(reach), 1i64 << TREE_BITS);
        let low = corner.map(|c| if c == 0 { 0 } else { c + reach });
        Self { low, high: corner.map(|c| if c + side == end { end } else { c + side - reach }) }
    }

    #[inline]
    pub(super) fn holds(&self, t: TreePoint) -> bool {
        (0..3).all(|a| (self.low[a]..self.high[a]).contains(&i64::from(t[a])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::SystemDisk;

    fn key(level: u8, x: u32, y: u32, z: u32) -> NodeKey {
        NodeKey { level, x, y, z }
    }

    #[test]
    fn a_node_sees_what_is_near_it_of_its_own_unit_and_of_those_before() {
        let side = 1u32 << 27; // of level 4; spacing 2^20
        for room in [1 << 20, 0] {
            let memory = Arc::new(Pool::new(room + (64 << 10), room));
            let borders =
                Borders::new(Spacing::default(), &memory, &TempFiles::new(std::env::temp_dir(), Arc::new(SystemDisk)));
            let mut first = UnitBorders::new(&borders, key(3, 0, 0, 0));
            let near = TreePoint([2 * side - 9, 5, side + 7]);
            let far = TreePoint([2 * side - (1 << 20) - 1, 5, side + 7]);
            let own_only = TreePoint([side - 3, 5, side + 7]);
            first.note(key(4, 1, 0, 1), &[near, far]);
            first.note(key(4, 0, 0, 1), &[own_only]);
            assert_eq!(first.around(key(4, 1, 0, 1)).unwrap(), [own_only]);
            assert_eq!(first.around(key(4, 1, 1, 1)).unwrap(), []);
            borders.publish(first.into_outer()).unwrap();
            let mut second = UnitBorders::new(&borders, key(3, 1, 0, 0));
            assert_eq!(second.around(key(4, 2, 0, 1)).unwrap(), [near]);
            assert_eq!(second.around(key(4, 2, 0, 2)).unwrap(), []);
            assert_eq!(second.around(key(4, 3, 0, 1)).unwrap(), []);
            assert_eq!(second.around(key(31, 0, 0, 0)).unwrap(), []);
        }
    }

    #[test]
    fn a_node_has_as_many_neighbours_as_fit_into_the_root() {
        assert_eq!(neighbours(NodeKey::ROOT).count(), 0);
        assert_eq!(neighbours(key(1, 1, 0, 1)).count(), 7);
        assert_eq!(neighbours(key(5, 0, 3, 31)).count(), 11);
        assert_eq!(neighbours(key(5, 9, 9, 9)).count(), 26);
        assert_eq!(neighbours(key(31, u32::MAX >> 1, 9, 9)).count(), 17);
    }
}

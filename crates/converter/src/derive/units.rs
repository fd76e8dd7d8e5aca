//! The parts of a cloud that are worked on one by one, and the cells that they are put back into.

use pointmill_format::NodeKey;

use crate::cloud::{Cell, Cloud, Regrouper, Segment, Segments, divided, highest_nodes};
use crate::error::ConvertError;
use crate::runtime::{Consumer, Reservation, Runtime};

/// Cells that are worked on together: all of a node of the octree.
#[derive(Debug)]
pub(super) struct Unit {
    pub(super) key: NodeKey,
    /// In Morton order.
    pub(super) cells: Vec<Cell>,
}

impl Unit {
    pub(super) fn points(&self) -> u64 {
        self.cells.iter().map(|cell| cell.points).sum()
    }

    /// True if it is one place that more points share than are worked on together.
    pub(super) fn is_large_place(&self, unit_points: u64) -> bool {
        self.points() > unit_points
    }
}

/// By cell of a unit: where its records are now.
pub(super) type Placed = Vec<Vec<Segment>>;

/// Units of at most `unit_points`, unless all of their points share one place, in Morton order; and what these lists take.
pub(super) fn cut(
    cloud: &Cloud<'_>,
    unit_points: u64,
    rt: &Runtime<'_>,
) -> Result<(Vec<Unit>, Reservation), ConvertError> {
    let mut room = Reservation::new(&rt.memory, Consumer::Cells);
    let mut regrouper = Regrouper::for_all(&cloud.store, cloud.frame.stride, cloud.points());
    let mut cells = divided(&cloud.cells, &cloud.frame, &mut regrouper, unit_points, rt, &mut room)?;
    cloud.store.drop_spare(u64::MAX)?;
    let mut units = Vec::new();
    highest_nodes(NodeKey::ROOT, &mut cells, unit_points, &mut |key, cells| {
        units.push(Unit { key, cells: cells.to_vec() });
    });
    let bytes = |unit: &Unit| unit.cells.iter().map(|c| c.segments.bytes() + size_of::<Cell>() as u64).sum::<u64>();
    room.resize(2 * units.iter().map(bytes).sum::<u64>())?;
    Ok((units, room))
}

/// Says where the records of cells are now. Cells that were divided are whole again.
pub(super) fn put_together(cells: &mut [Cell], units: &[Unit], placed: impl Iterator<Item = Placed>) {
    let parts = units.iter().zip(placed).flat_map(|(unit, placed)| unit.cells.iter().zip(placed));
    let mut parts = parts.peekable();
    for cell in cells {
        let mut segments = Segments::default();
        while let Some((_, found)) = parts.next_if(|(part, _)| part.key.ancestor(cell.key.level) == Some(cell.key)) {
            segments.extend(found);
        }
        segments.sort();
        cell.segments = segments;
    }
}

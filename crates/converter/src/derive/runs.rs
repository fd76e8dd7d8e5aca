//! The positions of all points, in Morton order: runs of some hundred points with a box each, so that a unit reads of its neighbours
//! what lies near its border, once more.

use std::ops::Range;
use std::sync::Arc;

use super::boxes::{Box3, Boxes};
use crate::cloud::{Segment, Store, position};
use crate::error::ConvertError;
use crate::runtime::{Consumer, Reservation, Runtime};
use crate::sources::POSITION_BYTES;

/// Points of a run: few, so that little is read that is not near; many, so that the list of them is short.
const RUN_POINTS: usize = 256;

/// Runs that a thread keeps, 3 KiB each.
const KEPT_RUNS: usize = 2048;

/// Runs of a unit while they are listed.
#[derive(Debug, Default)]
pub(super) struct UnitRuns(Vec<(Box3, Segment)>);

/// All runs.
pub(super) struct Runs {
    store: Arc<Store>,
    places: Vec<Segment>,
    pub(super) boxes: Boxes,
    /// By unit.
    units: Vec<Range<u32>>,
    _room: Reservation,
}

impl Runs {
    /// Where runs go.
    pub(super) fn store(rt: &Runtime<'_>) -> Arc<Store> {
        Store::new(rt.temp.clone(), POSITION_BYTES, 1, &rt.memory)
    }

    /// Those of all units, in order.
    pub(super) fn new(store: Arc<Store>, all: Vec<UnitRuns>, rt: &Runtime<'_>) -> Result<Self, ConvertError> {
        let count: usize = all.iter().map(|unit| unit.0.len()).sum();
        let mut room = Reservation::new(&rt.memory, Consumer::Cells);
        room.resize(2 * (count * size_of::<(Box3, Segment)>()) as u64)?;
        let (mut places, mut units) = (Vec::with_capacity(count), Vec::with_capacity(all.len()));
        let mut boxes = Boxes::default();
        for unit in &all {
            let first = places.len() as u32;
            places.extend(unit.0.iter().map(|(_, segment)| *segment));
            units.push(first..places.len() as u32);
        }
        boxes.build(all.iter().flat_map(|unit| &unit.0).map(|(of, _)| *of));
        drop(all);
        room.resize(boxes.bytes() + (count * size_of::<Segment>()) as u64)?;
        Ok(Self { store, places, boxes, units, _room: room })
    }

    /// The runs of a unit.
    pub(super) fn of(&self, unit: usize) -> Range<u32> {
        self.units.get(unit).cloned().unwrap_or_default()
    }
}

impl UnitRuns {
    /// Adds the points of records that have a position alone, in that order.
    pub(super) fn add(
        &mut self,
        records: &[u8],
        order: impl ExactSizeIterator<Item = usize>,
        store: &Store,
    ) -> Result<(), ConvertError> {
        let mut sorted = Vec::with_capacity(order.len() * POSITION_BYTES);
        for record in order {
            sorted.extend_from_slice(&records[record * POSITION_BYTES..][..POSITION_BYTES]);
        }
        let block = store.open(0)?;
        let mut start = 0;
        for run in sorted.chunks(RUN_POINTS * POSITION_BYTES) {
            let places = run.chunks_exact(POSITION_BYTES).map(|record| position(record).0);
            let count = (run.len() / POSITION_BYTES) as u32;
            self.0.push((Box3::around(places), Segment { block, start, count }));
            start += count;
        }
        store.fill(block, &mut sorted)
    }
}

/// What is known of the points outside of a unit.
#[derive(Clone, Copy)]
pub(super) struct Others<'a> {
    pub(super) runs: &'a Runs,
    pub(super) unit: usize,
}

/// Positions of a run, by axis.
#[derive(Debug, Default)]
struct Kept {
    run: Option<u32>,
    columns: [Vec<i32>; 3],
}

/// What a thread has read of runs.
pub(super) struct Lookup {
    kept: Vec<Kept>,
    records: Vec<u8>,
}

impl Lookup {
    pub(super) fn new() -> Self {
        Self { kept: (0..KEPT_RUNS).map(|_| Kept::default()).collect(), records: Vec::new() }
    }

    /// The coordinates of the points of a run.
    #[inline]
    pub(super) fn columns(&mut self, runs: &Runs, run: u32) -> Result<[&[i32]; 3], ConvertError> {
        let slot = run as usize % KEPT_RUNS;
        if self.kept[slot].run != Some(run) {
            self.read(runs, run, slot)?;
        }
        Ok(self.kept[slot].columns.each_ref().map(Vec::as_slice))
    }

    #[cold]
    fn read(&mut self, runs: &Runs, run: u32, slot: usize) -> Result<(), ConvertError> {
        let kept = &mut self.kept[slot];
        kept.run = None;
        self.records.clear();
        let place = runs.places.get(run as usize).ok_or_else(|| ConvertError::Internal("no such run".into()))?;
        runs.store.read(*place, &mut self.records)?;
        kept.columns.iter_mut().for_each(Vec::clear);
        for record in self.records.chunks_exact(POSITION_BYTES) {
            let place = position(record).0;
            kept.columns.iter_mut().zip(place).for_each(|(axis, v)| axis.push(v));
        }
        kept.run = Some(run);
        Ok(())
    }
}

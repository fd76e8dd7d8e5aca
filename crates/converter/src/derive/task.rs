//! What a thread does with a unit: its points in order, the surfaces through them, its records back.

use super::collect::{Collect, Collector};
use super::fields::{Fields, Written};
use super::filling::Filling;
use super::finder::Finder;
use super::runs::{Others, Runs, UnitRuns};
use super::space::Space;
use super::surface::Surface;
use super::units::{Placed, Unit};
use crate::cloud::{Checksum, Cloud, OrderScratch, Point, RecordFrame, Segment, Store, order, position};
use crate::error::ConvertError;
#[cfg(target_arch = "x86_64")]
use crate::runtime::Avx2;
use crate::runtime::{Portable, Runtime, Vectors, Workers};
use crate::sources::POSITION_BYTES;

/// Points of a place that very many share that are taken at a time.
const PLACE_POINTS: u32 = 65_536;

/// What a unit takes: records, and those that go back; columns, boxes, tree coordinates, keys twice, points, surfaces.
pub(super) fn bytes_per_point(stride: usize) -> u64 {
    2 * stride as u64 + 12 + 4 + 12 + 16 + 16 + size_of::<Surface>() as u64
}

/// What all threads share.
pub(super) struct Task<'a> {
    pub(super) rt: &'a Runtime<'a>,
    cloud: &'a Cloud<'a>,
    fields: Fields,
    space: Space,
    unit_points: u64,
}

impl<'a> Task<'a> {
    pub(super) fn new(
        cloud: &'a Cloud<'a>,
        rt: &'a Runtime<'a>,
        fields: Fields,
        space: Space,
        unit_points: u64,
    ) -> Self {
        Self { rt, cloud, fields, space, unit_points }
    }

    pub(super) fn worker(&self) -> Worker<'_> {
        let collector = Collector::new(self.cloud.plan.derive.neighbourhood, &self.space);
        Worker {
            task: self,
            vectors: Vectors::default(),
            records: Vec::new(),
            sources: Vec::new(),
            of_record: Vec::new(),
            points: Vec::new(),
            scratch: OrderScratch::default(),
            finder: Finder::new(collector.neighbours()),
            collector,
            written: Written::default(),
            taken: Checksum::default(),
            put: Checksum::default(),
        }
    }
}

/// A thread and its memory.
pub(super) struct Worker<'a> {
    task: &'a Task<'a>,
    vectors: Vectors,
    records: Vec<u8>,
    /// Of the records, ascending.
    sources: Vec<u32>,
    /// By record: index in `sources`.
    of_record: Vec<u32>,
    points: Vec<Point>,
    scratch: OrderScratch,
    finder: Finder,
    collector: Collector,
    written: Written,
    /// Of records as they were, and as they are.
    taken: Checksum,
    put: Checksum,
}

impl Worker<'_> {
    /// What it has done.
    pub(super) fn finish(self) -> (Written, Checksum, Checksum) {
        (self.written, self.taken, self.put)
    }

    /// Keeps the positions of a unit in `store`.
    pub(super) fn list(&mut self, unit: &Unit, store: &Store) -> Result<UnitRuns, ConvertError> {
        let cloud = self.task.cloud;
        let mut runs = UnitRuns::default();
        let segments = unit.cells.iter().flat_map(|cell| &cell.segments);
        self.records.clear();
        if !unit.is_large_place(self.task.unit_points) {
            for segment in segments {
                cloud.store.read_positions(*segment, &mut self.records)?;
            }
            // a record of nothing but its position
            let frame = RecordFrame { stride: POSITION_BYTES, ..cloud.frame.clone() };
            order(&self.records, &frame, unit.key.level, &mut self.scratch, &mut self.points);
            runs.add(&self.records, self.points.iter().map(|point| point.record as usize), store)?;
            return Ok(runs);
        }
        for part in segments.flat_map(|segment| segment.split(PLACE_POINTS)) {
            self.task.rt.check_stop()?;
            self.records.clear();
            cloud.store.read_positions(part, &mut self.records)?;
            runs.add(&self.records, 0..part.count as usize, store)?;
        }
        Ok(runs)
    }

    /// Takes a unit, and puts it back with what is computed.
    pub(super) fn unit(&mut self, unit: &Unit, number: usize, runs: Option<&Runs>) -> Result<Placed, ConvertError> {
        let others = runs.map(|runs| Others { runs, unit: number });
        if unit.is_large_place(self.task.unit_points) {
            return self.large_place(unit, others);
        }
        self.load(unit)?;
        let Task { rt, space, .. } = self.task;
        find(self.vectors, &mut self.finder, space, others, rt, &mut self.collector)?;
        self.put_back(unit)
    }

    /// Takes the records of a unit, and puts its points in order.
    fn load(&mut self, unit: &Unit) -> Result<(), ConvertError> {
        let Cloud { store, frame, .. } = self.task.cloud;
        self.records.clear();
        self.records.reserve_exact(unit.points() as usize * frame.stride);
        self.sources.clear();
        self.of_record.clear();
        for segment in unit.cells.iter().flat_map(|cell| &cell.segments) {
            let source = store.take_to_put_back(*segment, true, &mut self.records)?;
            self.of_record.resize(self.records.len() / frame.stride, source);
        }
        self.taken.add_all(&self.records, frame.stride);
        self.sources.extend(&self.of_record);
        self.sources.dedup();
        self.sources.sort_unstable();
        self.sources.dedup();
        let index = |source: &u32| self.sources.binary_search(source).unwrap_or(0) as u32;
        self.of_record.iter_mut().for_each(|source| *source = index(source));
        order(&self.records, frame, unit.key.level, &mut self.scratch, &mut self.points);
        for (a, axis) in self.finder.columns.iter_mut().enumerate() {
            let place = |point: &Point| position(&self.records[point.record as usize * frame.stride..]).0[a];
            axis.clear();
            axis.extend(self.points.iter().map(place));
        }
        Ok(())
    }

    /// Puts the records back, those of each source into blocks of their own.
    fn put_back(&mut self, unit: &Unit) -> Result<Placed, ConvertError> {
        let Cloud { store, frame, .. } = self.task.cloud;
        let mut counts = vec![0usize; self.sources.len()];
        self.of_record.iter().for_each(|source| counts[*source as usize] += 1);
        let filling = |(source, count): (&u32, usize)| Filling::new(*source, count, store, frame.stride);
        let mut all: Vec<Filling<'_>> = self.sources.iter().zip(counts).map(filling).collect();
        let columns = &self.finder.columns;
        let (mut placed, mut next) = (Vec::with_capacity(unit.cells.len()), 0);
        for cell in &unit.cells {
            let mut segments = Vec::new();
            let own = next..next + cell.points as usize;
            next = own.end;
            let surfaces = self.finder.surfaces[own.clone()].iter();
            for ((i, point), surface) in own.clone().zip(&self.points[own]).zip(surfaces) {
                let record = point.record as usize;
                let of = &mut all[self.of_record[record] as usize];
                let record = &self.records[record * frame.stride..][..frame.stride];
                let own = of.add(record, &mut segments, &mut self.put)?;
                let place = columns.each_ref().map(|axis| axis[i]);
                self.task.fields.put(own, place, surface, &mut self.written);
            }
            all.iter_mut().for_each(|of| of.end_cell(&mut segments));
            placed.push(segments);
        }
        all.iter_mut().try_for_each(|of| of.end_block(&mut self.put))?;
        Ok(placed)
    }

    /// A place that more points share than are worked on together: one neighbourhood for all.
    fn large_place(&mut self, unit: &Unit, others: Option<Others<'_>>) -> Result<Placed, ConvertError> {
        let Cloud { store, frame, .. } = self.task.cloud;
        let mut surface = None;
        let mut placed = Vec::with_capacity(unit.cells.len());
        for cell in &unit.cells {
            let mut segments = Vec::new();
            for part in cell.segments.iter().flat_map(|segment| segment.split(PLACE_POINTS)) {
                self.task.rt.check_stop()?;
                let mut records = store.buffer(part.count as usize * frame.stride)?;
                let source = store.take_to_put_back(part, true, &mut records)?;
                self.taken.add_all(&records, frame.stride);
                let place = position(&records).0;
                let surface = match surface {
                    Some(surface) => surface,
                    None => *surface.insert(self.surface_of_place(place, unit.points(), others)?),
                };
                for record in records.chunks_exact_mut(frame.stride) {
                    self.task.fields.put(record, place, &surface, &mut self.written);
                }
                self.put.add_all(&records, frame.stride);
                let block = store.open(source)?;
                store.fill(block, &mut records)?;
                segments.push(Segment { block, start: 0, count: part.count });
                self.task.rt.advance(part.count.into());
            }
            placed.push(segments);
        }
        Ok(placed)
    }

    /// The surface through a place that so many points share.
    fn surface_of_place(
        &mut self,
        place: [i32; 3],
        points: u64,
        others: Option<Others<'_>>,
    ) -> Result<Surface, ConvertError> {
        let space = &self.task.space;
        // more points than any number of neighbours: all of them are here
        let Collector::AllWithin(collect) = &mut self.collector else { return Ok(Surface::default()) };
        collect.begin(place, None);
        collect.add_middle(points);
        if let Some(others) = others {
            self.finder.look_beyond(place, space, others, collect)?;
        }
        Ok(collect.surface(space))
    }
}

/// Finds the surfaces with the instructions that the processor has.
fn find(
    vectors: Vectors,
    finder: &mut Finder,
    space: &Space,
    others: Option<Others<'_>>,
    workers: &Workers<'_>,
    collector: &mut Collector,
) -> Result<(), ConvertError> {
    match (vectors, collector) {
        (Vectors::Portable, Collector::SoMany(collect)) => finder.find(Portable, space, others, workers, collect),
        (Vectors::Portable, Collector::AllWithin(collect)) => finder.find(Portable, space, others, workers, collect),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the processor has these instructions, or there were no `detected`.
        (Vectors::Avx2(detected), Collector::SoMany(collect)) => unsafe {
            find_avx2(finder, Avx2::new(detected), space, others, workers, collect)
        },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        (Vectors::Avx2(detected), Collector::AllWithin(collect)) => unsafe {
            find_avx2(finder, Avx2::new(detected), space, others, workers, collect)
        },
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn find_avx2(
    finder: &mut Finder,
    lanes: Avx2,
    space: &Space,
    others: Option<Others<'_>>,
    workers: &Workers<'_>,
    collect: &mut impl Collect,
) -> Result<(), ConvertError> {
    finder.find(lanes, space, others, workers, collect)
}

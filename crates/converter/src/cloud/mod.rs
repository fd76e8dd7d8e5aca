//! All points, once they are read: records grouped by cell in the store, and everything that an output may ask about
//! them. Made by `gather`; afterwards facts do not change, and each output takes every record out of the store once.

mod big_sort;
mod cell;
mod checksum;
mod colour_range;
mod cube;
mod divide;
mod facts;
mod frames;
mod grouping;
mod intake;
mod lattice;
mod ledger;
mod moments;
pub(crate) mod morton;
mod morton_sort;
mod order;
mod range;
mod record;
mod regroup;
mod relations;
mod segments;
mod shortfall;
mod stats;
mod store;
mod widening;

pub(crate) use big_sort::BigSort;
pub(crate) use cell::{Cell, Census, CensusCell, SharedPlace, add_up, are_in_order, lies_in, node, xyz};
pub(crate) use checksum::Checksum;
pub(crate) use cube::{Cube, MOST_STEPS, TREE_BITS, high, tidy_world};
pub(crate) use divide::{divided, highest_nodes};
pub(crate) use facts::Facts;
pub(crate) use frames::{JobBounds, JobColumns, JobPoint, StoredOrigin, StoredPoint, TreePoint};
pub(crate) use grouping::{CellHash, Grouping};
pub(crate) use intake::{DerivedFields, Intake, LayoutIntake};
pub(crate) use lattice::JobLattice;
pub(crate) use ledger::Ledger;
pub(crate) use moments::Moments;
pub(crate) use morton_sort::MortonSorter;
pub(crate) use order::{OrderScratch, Point, order};
pub(crate) use range::Range;
pub(crate) use record::{RecordFrame, copy_record, position};
pub(crate) use regroup::{Regrouper, Sifted};
pub(crate) use relations::{Relation, Relations};
pub(crate) use segments::{Segment, Segments};
pub(crate) use shortfall::Shortfall;
pub(crate) use stats::{Change, SourceStats, Stats};
pub(crate) use store::{BLOCK_BYTES, SafeBlock, Store};
pub(crate) use widening::{Group, Widening};

use std::sync::Arc;

use pointmill_format::Aabb;

use crate::error::ConvertError;
use crate::plan::{Filter, Plan};
use crate::runtime::Reservation;
use crate::sources::{Fineness, Schema, Sources, intersection};
use crate::warning::Warning;

/// All points of a run, and what every output is made from.
pub(crate) struct Cloud<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) sources: &'a Sources,
    pub(crate) intake: &'a Intake,
    pub(crate) lattice: JobLattice,
    /// Every position is a point of the lattice as it was read.
    pub(crate) is_lossless: bool,
    /// How stored records are read; the root cube.
    pub(crate) frame: RecordFrame,
    pub(crate) store: Arc<Store>,
    /// Where the records are: cells of the octree that do not overlap, in Morton order.
    pub(crate) cells: Vec<Cell>,
    /// How many points there are where.
    pub(crate) census: Census,
    /// What the cells take of the run's memory.
    _room: Reservation,
    pub(crate) stats: Stats,
    pub(crate) facts: Facts,
    /// Points outside were dropped as outliers.
    pub(crate) far_cut: Option<Aabb>,
    /// What came of attributes that are computed from the points.
    pub(crate) derived: Option<Derived>,
    /// Places that very many points share, the fullest first.
    pub(crate) shared_places: Vec<SharedPlace>,
    /// Of headers and points, in order of discovery.
    pub(crate) warnings: Vec<Warning>,
}

/// What came of attributes that are computed from the points around each.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Derived {
    pub(crate) points: u64,
    /// Normals of the scans.
    pub(crate) kept_normals: u64,
    /// Points through which there is no plane.
    pub(crate) without_normal: u64,
    /// Radii of the scans.
    pub(crate) kept_radii: u64,
    pub(crate) without_radius: u64,
}

/// What a pass over the sources has gathered.
pub(crate) struct Gathered {
    pub(crate) lattice: JobLattice,
    pub(crate) is_lossless: bool,
    pub(crate) frame: RecordFrame,
    pub(crate) store: Arc<Store>,
    pub(crate) cells: Vec<Cell>,
    pub(crate) census: Census,
    /// What the cells take.
    pub(crate) room: Reservation,
    pub(crate) stats: Stats,
    pub(crate) shared_places: Vec<SharedPlace>,
}

impl<'a> Cloud<'a> {
    /// Works out the facts. `warnings`: those so far.
    ///
    /// # Errors
    /// Colours that contradict the plan.
    pub(crate) fn new(
        plan: &'a Plan,
        sources: &'a Sources,
        intake: &'a Intake,
        gathered: Gathered,
        far_cut: Option<Aabb>,
        mut warnings: Vec<Warning>,
    ) -> Result<Self, ConvertError> {
        let Gathered { lattice, is_lossless, frame, store, cells, census, room, stats, shared_places } = gathered;
        warnings.extend(stats.skipped.iter().cloned().map(Warning::from));
        let facts = Facts::new(plan, sources, intake, &stats, &mut warnings)?;
        Ok(Self {
            plan,
            sources,
            intake,
            lattice,
            is_lossless,
            frame,
            store,
            cells,
            census,
            _room: room,
            stats,
            facts,
            far_cut,
            derived: None,
            shared_places,
            warnings,
        })
    }

    /// The filter with its box as it was applied: without outliers, if they were dropped.
    pub(crate) fn filter(&self) -> Filter {
        let cuts = self.plan.filter.bounds.iter().chain(&self.far_cut).copied();
        Filter { bounds: cuts.reduce(|a, b| intersection(&a, &b)), ..self.plan.filter.clone() }
    }

    /// The layout of stored records.
    pub(crate) fn schema(&self) -> &Schema {
        &self.intake.schema
    }

    /// Points that passed the filter.
    pub(crate) fn points(&self) -> u64 {
        self.stats.points
    }

    /// "position" and the names of attributes of the schema.
    pub(crate) fn names(&self, attributes: impl Iterator<Item = usize>) -> Vec<String> {
        let names = attributes.map(|i| self.schema().attributes[i].name.clone());
        std::iter::once("position".to_owned()).chain(names).collect()
    }

    /// Least step of the coordinates of the sources, world units; that of the lattice where a source states none.
    pub(crate) fn source_step(&self) -> [f64; 3] {
        let step = |source: &crate::sources::Source, a: usize| match source.stored.fineness[a] {
            Fineness::Grid { grid, .. } => grid.step,
            Fineness::Step(step) => step,
            Fineness::Single | Fineness::Double => self.lattice.lattice.scale[a],
        };
        std::array::from_fn(|a| self.sources.all.iter().map(|s| step(s, a)).fold(f64::INFINITY, f64::min))
    }
}

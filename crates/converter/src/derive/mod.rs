//! Normals, curvature and radii from the points around each point (`docs/surfels.md`), between reading and building.
//!
//! 1. [`units`] puts cells together to nodes of the octree of some hundred thousand points.
//! 2. The positions of each unit are put in Morton order and kept as [`runs`] of some hundred points, with a box each.
//! 3. Each unit is taken from the store; a [`finder`] looks for the neighbours of each point among the points of the unit,
//!    and, where those outside may be nearer, among the runs whose boxes are near enough. What it [`collect`]s gives a [`surface`].
//! 4. The records of the unit go back into the store, in Morton order, with the [`fields`] that were computed.
//!
//! The neighbourhood of a point depends on the points alone, sums over it are exact, and all other arithmetic is the same on every
//! processor: so no byte depends on units, threads or memory.

mod around;
mod boxes;
mod collect;
mod eigen;
mod fields;
mod filling;
mod finder;
mod nearest;
mod runs;
mod space;
mod sums;
mod surface;
mod task;
mod units;

use std::sync::Mutex;

use fields::{Fields, Side, Written};
use runs::{Runs, UnitRuns};
use space::Space;
use task::Task;
use units::{Unit, cut, put_together};

use crate::cloud::{Checksum, Cloud, Derived};
use crate::error::ConvertError;
use crate::runtime::{Clock, Phase, Runtime};

/// Larger units gain nothing: few of their points are near the border.
const MAX_UNIT_POINTS: u64 = 400_000;

/// Computes what the plan asks for, of all points.
pub(crate) fn derive_attributes(
    cloud: &mut Cloud<'_>,
    rt: &Runtime<'_>,
    clock: &mut Clock<'_>,
) -> Result<(), ConvertError> {
    if cloud.plan.derive.is_nothing() {
        return Ok(());
    }
    clock.begin(Phase::Derive, cloud.points());
    let _working = rt.budget.building(&rt.memory, cloud.points())?;
    let unit_points = rt.budget.task_points(task::bytes_per_point(cloud.frame.stride), MAX_UNIT_POINTS);
    let (units, _room) = cut(cloud, unit_points, rt)?;
    let task = Task::new(cloud, rt, fields(cloud), space(cloud), unit_points);
    let runs = if units.len() > 1 { Some(list_runs(&task, &units)?) } else { None };
    let done: Mutex<Vec<(usize, units::Placed)>> = Mutex::default();
    let work = |worker: &mut task::Worker<'_>, i: usize| {
        let placed = worker.unit(&units[i], i, runs.as_ref())?;
        done.lock().map_err(|_| ConvertError::Internal("a worker thread failed".into()))?.push((i, placed));
        Ok(())
    };
    let all = rt.in_parallel(units.len(), || task.worker(), work, task::Worker::finish)?;
    let (mut written, mut checksums) = (Written::default(), [Checksum::default(); 2]);
    for (own, taken, put) in all {
        written.merge(&own);
        checksums[0].merge(&taken);
        checksums[1].merge(&put);
    }
    drop((runs, task));
    if checksums[0] != cloud.stats.checksum {
        return Err(ConvertError::Internal("records that were derived from are not those that were read".into()));
    }
    let mut done = done.into_inner().map_err(|_| ConvertError::Internal("a worker thread failed".into()))?;
    done.sort_unstable_by_key(|(i, _)| *i);
    put_together(&mut cloud.cells, &units, done.into_iter().map(|(_, placed)| placed));
    cloud.store.drop_spare(u64::MAX)?;
    cloud.stats.checksum = checksums[1];
    settle(cloud, &written);
    Ok(())
}

/// The runs of all units.
fn list_runs(task: &Task<'_>, units: &[Unit]) -> Result<Runs, ConvertError> {
    let store = Runs::store(task.rt);
    let listed: Mutex<Vec<UnitRuns>> = Mutex::new(units.iter().map(|_| UnitRuns::default()).collect());
    let work = |worker: &mut task::Worker<'_>, i: usize| {
        let runs = worker.list(&units[i], &store)?;
        listed.lock().map_err(|_| ConvertError::Internal("a worker thread failed".into()))?[i] = runs;
        Ok(())
    };
    task.rt.in_parallel(units.len(), || task.worker(), work, |_| ())?;
    let listed = listed.into_inner().map_err(|_| ConvertError::Internal("a worker thread failed".into()))?;
    Runs::new(store, listed, task.rt)
}

fn fields(cloud: &Cloud<'_>) -> Fields {
    let (lattice, origin) = (&cloud.lattice.lattice, cloud.frame.origin.0);
    let at = |place: [f64; 3]| [0, 1, 2].map(|a| (place[a] - lattice.offset[a]) / lattice.scale[a] - origin[a] as f64);
    let side = Side::of(cloud.plan.derive.orient, at, lattice.scale);
    Fields::new(cloud.schema(), &cloud.intake.derived, side)
}

fn space(cloud: &Cloud<'_>) -> Space {
    Space::new(cloud.lattice.lattice.scale)
}

/// What is known of the new values, as of those that were read.
fn settle(cloud: &mut Cloud<'_>, written: &Written) {
    let fields = cloud.intake.derived;
    let normal = fields.normal.map(|([x, y, z], curvature)| [x, y, z, curvature]);
    let of_normal = normal.into_iter().flatten().enumerate();
    for (which, attribute) in of_normal.chain(fields.radius.map(|radius| (4, radius))) {
        let range = &written.ranges[which];
        cloud.stats.ranges[attribute].clone_from(range);
        cloud.facts.ranges[attribute].clone_from(range);
    }
    cloud.derived = Some(Derived {
        points: cloud.points(),
        kept_normals: written.kept_normals,
        without_normal: written.without_normal,
        kept_radii: written.kept_radii,
        without_radius: written.without_radius,
    });
}

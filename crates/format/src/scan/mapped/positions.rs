//! Positions of a batch to where they belong.

use std::sync::Arc;

use super::map::{PointMap, ScanMap};
use crate::{Affine, Lattice, Positions, ScanInfo};

/// How the positions of a scan are mapped.
#[derive(Debug)]
pub(super) enum PositionMap {
    /// Integers stay integers: on each axis those of one axis of the file, negated or not.
    Lattice {
        /// For x, y and z: the axis of the file.
        from: [usize; 3],
        /// For x, y and z: whether it points the other way.
        is_negated: [bool; 3],
        /// What the integers are on now.
        lattice: Lattice,
    },
    /// World coordinates.
    World {
        /// What integers of the file are on; `None`: the file has world coordinates.
        lattice: Option<Lattice>,
        affine: Affine,
        projection: Option<Arc<dyn PointMap>>,
    },
}

impl PositionMap {
    pub(super) fn new(info: &ScanInfo, map: &ScanMap) -> Self {
        let world = Self::World { lattice: info.lattice, affine: map.affine, projection: map.projection.clone() };
        let (Some(own), None, Some(axes)) = (info.lattice, &map.projection, map.affine.axes()) else { return world };
        let (from, factors) = (axes.map(|(axis, _)| axis), axes.map(|(_, factor)| factor));
        let along = |i: usize, of: [f64; 3]| factors[i] * of[from[i]];
        let lattice = Lattice {
            scale: [0, 1, 2].map(|i| along(i, own.scale).abs()),
            offset: [0, 1, 2].map(|i| along(i, own.offset) + map.affine.translation()[i]),
        };
        if !lattice.is_valid() {
            return world;
        }
        Self::Lattice { from, is_negated: factors.map(|factor| factor < 0.0), lattice }
    }

    /// Maps the positions of a batch.
    ///
    /// # Errors
    /// The index of a point with an integer that has no negative.
    pub(super) fn apply(&self, positions: &mut Positions) -> Result<(), usize> {
        match self {
            Self::Lattice { from, is_negated, .. } => match positions {
                Positions::Quantized(q) => permute(q, *from, *is_negated),
                Positions::World(_) => Ok(()), // a scan that has a lattice gives integers
            },
            Self::World { lattice, affine, projection } => {
                let mut world = std::mem::replace(positions, Positions::World(Default::default())).into_world(lattice);
                match projection {
                    Some(projection) => project(affine, &**projection, &mut world),
                    None => move_all(affine, &mut world),
                }
                *positions = Positions::World(world);
                Ok(())
            }
        }
    }
}

impl Positions {
    /// World coordinates; integers are on `lattice`.
    fn into_world(self, lattice: &Option<Lattice>) -> [Vec<f64>; 3] {
        match self {
            Self::World(world) => world,
            Self::Quantized(q) => std::array::from_fn(|a| {
                let (scale, offset) = lattice.map_or((1.0, 0.0), |l| (l.scale[a], l.offset[a]));
                q[a].iter().map(|v| f64::from(*v) * scale + offset).collect()
            }),
        }
    }
}

fn permute(q: &mut [Vec<i32>; 3], from: [usize; 3], is_negated: [bool; 3]) -> Result<(), usize> {
    // a matrix that can be undone takes each axis once
    let mut columns = std::mem::take(q);
    *q = from.map(|axis| std::mem::take(&mut columns[axis]));
    for (column, _) in q.iter_mut().zip(is_negated).filter(|(_, is_negated)| *is_negated) {
        if let Some(point) = column.iter().position(|v| *v == i32::MIN) {
            return Err(point);
        }
        column.iter_mut().for_each(|v| *v = -*v);
    }
    Ok(())
}

/// Each point's image, one axis after the other.
pub(super) fn move_all(affine: &Affine, points: &mut [Vec<f64>; 3]) {
    if *affine == Affine::IDENTITY {
        return;
    }
    let [x, y, z] = points;
    for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
        [*x, *y, *z] = affine.apply([*x, *y, *z]);
    }
}

/// The affine map, then the projection.
pub(super) fn project(affine: &Affine, projection: &dyn PointMap, points: &mut [Vec<f64>; 3]) {
    move_all(affine, points);
    projection.map(points.each_mut().map(Vec::as_mut_slice));
}

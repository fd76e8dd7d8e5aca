//! A hash grid of stored positions for neighbour searches.

use std::ops::ControlFlow;

use pointmill_format::Lattice;

/// Where a site of the grid comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum Origin {
    /// The node itself.
    Own,
    /// An inner node of the same level that touches it.
    Neighbour,
    /// Such a node's only point, which it may hold for no other reason than not to be empty.
    Lone,
    /// Coarser levels, and leaves of the same level.
    Other,
}

/// A point of the grid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Site {
    pub(crate) position: [i32; 3],
    pub(crate) origin: Origin,
}

/// Sites by hashed cell. Cells that share a hash share a bucket; distances decide, so that does no harm.
#[derive(Debug)]
pub(crate) struct Grid {
    sites: Vec<Site>,
    /// First site of each bucket, and the end.
    starts: Vec<u32>,
    shift: u32,
    cell: f64,
    cells_per_step: [f64; 3],
    scale: [f64; 3],
}

/// Squares of distances, world units; infinite where nothing was found.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Nearest {
    /// To the nearest other [`Origin::Own`] site.
    pub(crate) own: f64,
    /// To the nearest [`Origin::Neighbour`].
    pub(crate) neighbour: f64,
    /// To the nearest [`Origin::Lone`].
    pub(crate) lone: f64,
}

/// Odd, with well-spread bits (from the golden ratio and the primes of xxHash).
const FACTORS: [u32; 3] = [0x9E37_79B1, 0x85EB_CA77, 0xC2B2_AE3D];

impl Grid {
    /// Sorts `sites` into cells of side `cell`, world units, > 0.
    pub(crate) fn new(sites: &[Site], cell: f64, lattice: &Lattice) -> Self {
        let bits = (sites.len().max(16) as u32).next_power_of_two().ilog2().min(28);
        let mut grid = Self {
            sites: Vec::new(),
            starts: vec![0; (1 << bits) + 1],
            shift: 32 - bits,
            cell,
            cells_per_step: lattice.scale.map(|s| s / cell),
            scale: lattice.scale,
        };
        let buckets: Vec<u32> = sites.iter().map(|s| grid.bucket(grid.cell_of(s.position)) as u32).collect();
        for bucket in &buckets {
            grid.starts[*bucket as usize + 1] += 1;
        }
        for i in 1..grid.starts.len() {
            grid.starts[i] += grid.starts[i - 1];
        }
        let mut next = grid.starts.clone();
        let mut sorted = sites.to_vec();
        for (site, bucket) in sites.iter().zip(&buckets) {
            let at = &mut next[*bucket as usize];
            sorted[*at as usize] = *site;
            *at += 1;
        }
        grid.sites = sorted;
        grid
    }

    /// All sites, in an order of the grid's own.
    pub(crate) fn sites(&self) -> &[Site] {
        &self.sites
    }

    /// True if a site lies within the distance whose square is `within_squared` ≤ cell².
    #[inline]
    pub(crate) fn any_within(&self, position: [i32; 3], within_squared: f64) -> bool {
        let mut hit = |_: usize, _: &Site, d: f64| {
            if d <= within_squared { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let cell = self.cell_of(position);
        self.look(position, cell, &mut hit).is_break() || self.ring(position, cell, 1, &mut hit).is_break()
    }

    /// The square of the distance to the nearest site, looking `rings` ≥ 1 cells far; infinite if none is found.
    /// Exact up to `rings` cell sides.
    pub(crate) fn nearest_squared(&self, position: [i32; 3], rings: i32) -> f64 {
        let mut best = f64::INFINITY;
        let cell = self.cell_of(position);
        for ring in 0..=rings {
            let _ = self.ring(position, cell, ring, &mut |_, _, d| {
                best = best.min(d);
                ControlFlow::Continue(())
            });
            if best <= square(f64::from(ring) * self.cell) {
                break;
            }
        }
        best
    }

    /// What is nearest to site `of`, an [`Origin::Own`] one: exact for others of its node up to `rings` ≥ 1 cell sides,
    /// for those of other nodes up to one.
    pub(crate) fn nearest_by_origin(&self, of: usize, rings: i32) -> Nearest {
        let mut nearest = Nearest { own: f64::INFINITY, neighbour: f64::INFINITY, lone: f64::INFINITY };
        let position = self.sites[of].position;
        let cell = self.cell_of(position);
        for ring in 0..=rings {
            let _ = self.ring(position, cell, ring, &mut |i, site, d| {
                match site.origin {
                    Origin::Own if i != of => nearest.own = nearest.own.min(d),
                    Origin::Neighbour => nearest.neighbour = nearest.neighbour.min(d),
                    Origin::Lone => nearest.lone = nearest.lone.min(d),
                    _ => {}
                }
                // a twin: nothing is nearer, and where points repeat by the thousand this ends the search at once
                if nearest.own == 0.0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            if nearest.own == 0.0 || ring >= 1 && nearest.own <= square(f64::from(ring) * self.cell) {
                break;
            }
        }
        nearest
    }

    fn cell_of(&self, position: [i32; 3]) -> [i32; 3] {
        // Truncation makes the cell at 0 twice as wide for negative coordinates: neighbours stay neighbours.
        std::array::from_fn(|axis| (f64::from(position[axis]) * self.cells_per_step[axis]) as i32)
    }

    fn bucket(&self, cell: [i32; 3]) -> usize {
        let [x, y, z] = std::array::from_fn(|axis| (cell[axis] as u32).wrapping_mul(FACTORS[axis]));
        ((x ^ y.rotate_left(11) ^ z.rotate_left(22)).wrapping_mul(0x27D4_EB2F) >> self.shift) as usize
    }

    /// Visits the sites of the cells `ring` cells away (0: the cell itself), and maybe others, some perhaps twice.
    fn ring(
        &self,
        position: [i32; 3],
        cell: [i32; 3],
        ring: i32,
        visit: &mut impl FnMut(usize, &Site, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        for dx in -ring..=ring {
            for dy in -ring..=ring {
                let step = if dx.abs() == ring || dy.abs() == ring { 1 } else { 2 * ring };
                for dz in (-ring..=ring).step_by(step as usize) {
                    let at = [cell[0].wrapping_add(dx), cell[1].wrapping_add(dy), cell[2].wrapping_add(dz)];
                    self.look(position, at, visit)?;
                }
            }
        }
        ControlFlow::Continue(())
    }

    #[inline]
    fn look(
        &self,
        position: [i32; 3],
        cell: [i32; 3],
        visit: &mut impl FnMut(usize, &Site, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let bucket = self.bucket(cell);
        let (start, end) = (self.starts[bucket] as usize, self.starts[bucket + 1] as usize);
        for (i, site) in self.sites[start..end].iter().enumerate() {
            visit(start + i, site, self.distance_squared(position, site.position))?;
        }
        ControlFlow::Continue(())
    }

    /// World units squared. Differences are exact integers; the rest rounds by less than 1e-15 of the result.
    fn distance_squared(&self, a: [i32; 3], b: [i32; 3]) -> f64 {
        (0..3).map(|axis| square((f64::from(a[axis]) - f64::from(b[axis])) * self.scale[axis])).sum()
    }
}

pub(crate) fn square(x: f64) -> f64 {
    x * x
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;

    /// A cheap sequence without pattern.
    fn scatter(n: usize, side: u64) -> Vec<[i32; 3]> {
        let mut random = Random::new(1);
        let mut next = || random.below(side) as i32;
        (0..n).map(|_| [next(), next(), next()]).collect()
    }

    #[test]
    fn searches_agree_with_looking_at_every_site() {
        let lattice = Lattice { scale: [0.5, 0.25, 1.0], offset: [0.0; 3] };
        let origins = [Origin::Own, Origin::Neighbour, Origin::Lone, Origin::Other];
        let sites: Vec<Site> = scatter(400, 100)
            .into_iter()
            .enumerate()
            .map(|(i, position)| Site { position, origin: origins[i % 4] })
            .collect();
        let grid = Grid::new(&sites, 8.0, &lattice);
        for p in scatter(300, 110) {
            let best = grid.sites().iter().map(|s| grid.distance_squared(p, s.position)).fold(f64::INFINITY, f64::min);
            assert_eq!(grid.nearest_squared(p, 20), best);
            assert_eq!(grid.any_within(p, 64.0), best <= 64.0);
        }
        for (i, site) in grid.sites().iter().enumerate().filter(|(_, s)| s.origin == Origin::Own) {
            let nearest = |origin| {
                let others = grid.sites().iter().enumerate().filter(|(j, s)| *j != i && s.origin == origin);
                others.map(|(_, s)| grid.distance_squared(site.position, s.position)).fold(f64::INFINITY, f64::min)
            };
            let found = grid.nearest_by_origin(i, 20);
            assert_eq!(found.own, nearest(Origin::Own));
            for (found, origin) in [(found.neighbour, Origin::Neighbour), (found.lone, Origin::Lone)] {
                let exact = nearest(origin);
                assert!(found == exact || exact > 64.0);
            }
        }
    }
}

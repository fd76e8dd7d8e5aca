//! From where points were seen: the direction to the scanner, kept where the normal will be until that is computed.

use pointmill_format::{Aabb, Lattice, PointBatch, ScanInfo, ScanPart};

use super::assemble::Rows;
use crate::cloud::JobColumns;

/// Where the scanners of a file stood.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Scanners {
    /// Index in the file of the first point of each scan, ascending, and its scanner; `None`: not known.
    parts: Vec<(u64, Option<[f64; 3]>)>,
}

impl Scanners {
    /// Those that the file knows; nothing if it knows none.
    pub(super) fn of(info: &ScanInfo) -> Option<Self> {
        let present = info.parts.iter().filter(|part| !part.range.is_empty());
        let parts: Vec<_> = present.map(|part| (part.range.start, scanner(part, info))).collect();
        parts.iter().any(|(_, scanner)| scanner.is_some()).then_some(Self { parts })
    }

    /// The direction to the scanner from each of some rows of a batch, whose integers on `lattice` are `q`; zeros where it is not
    /// known.
    pub(super) fn directions(
        &self,
        batch: &PointBatch,
        rows: &Rows<'_>,
        q: &JobColumns,
        lattice: &Lattice,
        out: &mut Vec<[f32; 3]>,
    ) {
        out.clear();
        let [x, y, z] = &q.0;
        for (i, ((x, y), z)) in x.iter().zip(y).zip(z).enumerate() {
            let point = batch.first_point + rows.row(i) as u64;
            let next = self.parts.partition_point(|(start, _)| *start <= point);
            let scanner = next.checked_sub(1).and_then(|part| self.parts[part].1);
            let place = lattice.world([*x, *y, *z]);
            out.push(scanner.map_or([0.0; 3], |scanner| [0, 1, 2].map(|a| (scanner[a] - place[a]) as f32)));
        }
    }
}

/// Where the scanner of a scan stood. A file that was made without poses has scans whose pose says nothing, and whose points may lie
/// anywhere: then it is not known.
fn scanner(part: &ScanPart, info: &ScanInfo) -> Option<[f64; 3]> {
    let is_identity = part.translation == [0.0; 3]
        && (0..3).all(|a| (0..3).all(|b| part.rotation[a][b] == f64::from(u8::from(a == b))));
    let is_near = |bounds: Aabb| {
        let (extent, mut squared) = (bounds.extent(), 0.0);
        for a in 0..3 {
            squared += (bounds.min[a] - 0.0).max(0.0 - bounds.max[a]).max(0.0).powi(2);
        }
        squared <= extent.iter().map(|e| e * e).sum()
    };
    let is_known = !is_identity || part.bounds.or(info.bounds_declared).is_none_or(is_near);
    (is_known && part.translation.iter().all(|v| v.is_finite())).then_some(part.translation)
}

#[cfg(test)]
mod tests {
    use pointmill_format::{Attribute, Positions};

    use super::*;

    #[test]
    fn directions_lead_to_the_scanner_of_each_scan() {
        let scanners = Scanners { parts: vec![(0, Some([10.0, 0.0, 0.0])), (2, None), (3, Some([0.0, 0.0, -1.0]))] };
        let positions = Positions::World(Default::default());
        let batch = PointBatch::new(1, positions, Vec::<Attribute>::new());
        let q = JobColumns([vec![0, 4, 6], vec![2, 2, 2], vec![0, 0, 0]]);
        let lattice = Lattice { scale: [0.5; 3], offset: [0.0, 0.0, 1.0] };
        let mut out = vec![[7.0; 3]];
        scanners.directions(&batch, &Rows::Consecutive(0..3), &q, &lattice, &mut out);
        assert_eq!(out, [[10.0, -1.0, -1.0], [0.0; 3], [-3.0, -1.0, -2.0]]);
        scanners.directions(&batch, &Rows::Selected(&[2, 2, 0]), &q, &lattice, &mut out);
        assert_eq!(out[2], [7.0, -1.0, -1.0]);
    }
}

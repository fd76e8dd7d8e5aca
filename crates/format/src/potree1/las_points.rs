//! Nodes that are LAS or LAZ files.

#[cfg(feature = "las")]
mod read {
    use std::ops::ControlFlow;

    use super::super::Dataset;
    use crate::scan::{Scan, ScanInfo, Scratch, Wanted, las};
    use crate::{Attribute, Column, Lattice, NodeKey, NodePoints, PointBatch, Positions, ReadError, with_column};

    impl Dataset {
        /// The columns of the root's file, which all others have, too.
        pub(in super::super) fn las_attributes(&self) -> Result<Vec<Attribute>, ReadError> {
            Ok(self.las(NodeKey::ROOT)?.info().attributes.to_vec())
        }

        pub(in super::super) fn las_count(&self, key: NodeKey) -> Result<u64, ReadError> {
            Ok(self.las(key)?.pieces().iter().map(|piece| piece.points).sum())
        }

        fn las(&self, key: NodeKey) -> Result<Box<dyn Scan>, ReadError> {
            las::open(self.locate(&self.metadata.node_file(key)))
        }

        /// Points of a file, whose columns have to be those of the root's.
        pub(in super::super) fn read_las(&self, key: NodeKey, out: &mut NodePoints) -> Result<(), ReadError> {
            let mut positions = out.take_quantized();
            let scan = self.las(key)?;
            let info = scan.info();
            let same = |(a, b): (&Attribute, &Attribute)| (&a.name, a.ty, a.elements) == (&b.name, b.ty, b.elements);
            let expected = &self.info.attributes;
            if info.attributes.len() != expected.len() || !info.attributes.iter().zip(expected).all(same) {
                let what = format!("node {key} has other attributes than the root");
                return Err(ReadError::broken(&info.path, None, what));
            }
            let read = self.take_pieces(&*scan, key, &mut positions, &mut out.columns);
            out.positions = Positions::Quantized(positions);
            out.lattice = lattice(info);
            out.stored.clear();
            read
        }

        fn take_pieces(
            &self,
            scan: &dyn Scan,
            key: NodeKey,
            positions: &mut [Vec<i32>; 3],
            columns: &mut [Column],
        ) -> Result<(), ReadError> {
            let (wanted, mut scratch) = (Wanted::all(scan.info()), Scratch::default());
            let point_bytes = 12 + scan.info().attributes.iter().map(|a| a.size() as u64).sum::<u64>();
            let (mut bytes, mut has_room) = (0u64, true);
            for piece in 0..scan.pieces().len() {
                scan.decode(piece, &wanted, &mut scratch, &mut |batch| {
                    bytes += batch.len() as u64 * point_bytes;
                    has_room = bytes <= self.max_node_bytes && append(batch, positions, columns).is_some();
                    if has_room { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
                })?;
                if !has_room {
                    return Err(self.no_room(key, bytes));
                }
            }
            Ok(())
        }
    }

    /// LAS files have a lattice.
    fn lattice(info: &ScanInfo) -> Lattice {
        info.lattice.unwrap_or(Lattice { scale: [1.0; 3], offset: [0.0; 3] })
    }

    /// `None` if there is no memory for the points.
    fn append(batch: &PointBatch, positions: &mut [Vec<i32>; 3], columns: &mut [Column]) -> Option<()> {
        let Positions::Quantized(axes) = &batch.positions else { return None };
        for (values, more) in positions.iter_mut().zip(axes) {
            values.try_reserve(more.len()).ok()?;
            values.extend_from_slice(more);
        }
        for (column, more) in columns.iter_mut().zip(&batch.columns) {
            with_column!(column, values => {
                let more = more.values().unwrap_or_default();
                values.try_reserve(more.len()).ok()?;
                values.extend_from_slice(more);
            });
        }
        Some(())
    }
}

#[cfg(not(feature = "las"))]
mod refuse {
    use super::super::{Dataset, METADATA_FILE};
    use crate::{Attribute, NodeKey, NodePoints, ReadError};

    impl Dataset {
        pub(in super::super) fn las_attributes(&self) -> Result<Vec<Attribute>, ReadError> {
            Err(self.no_las())
        }

        pub(in super::super) fn las_count(&self, _: NodeKey) -> Result<u64, ReadError> {
            Err(self.no_las())
        }

        pub(in super::super) fn read_las(&self, _: NodeKey, _: &mut NodePoints) -> Result<(), ReadError> {
            Err(self.no_las())
        }

        fn no_las(&self) -> ReadError {
            let what = "its nodes are LAS or LAZ files, which this build does not read";
            ReadError::unsupported(self.locate(METADATA_FILE), what).advise("enable the feature las")
        }
    }
}

//! One call that does everything a program may do with a dataset: for the tests of damage here, and for the fuzz target,
//! which includes this file.

use std::path::PathBuf;
use std::sync::Arc;
use std::{io, path::Path};

use pointmill_format::bintree::{Bintree, Frustum, INDEX_FILE, Picker, Ray};
use pointmill_format::bytes::ByteSource;
use pointmill_format::{Aabb, NodePoints, ReadError};

/// Opens an index from bytes, with `leaves` as the bytes of every other file, and asks everything: all leaves, boxes,
/// frustums, draw lists, picks. Returns the number of points that could be read.
///
/// # Errors
/// The first thing that was refused. Nothing else may happen: no panic, and no memory beyond a small multiple of the
/// bytes given.
pub(crate) fn exercise(index: &[u8], leaves: &[u8]) -> Result<usize, ReadError> {
    let source = Bytes { index: index.to_vec(), leaves: leaves.to_vec() };
    let tree = Arc::new(Bintree::from_source(source)?);
    let (mut points, mut scratch, mut fault) = (0, NodePoints::default(), Ok(()));
    for leaf in tree.leaves() {
        match tree.read_leaf(leaf, &mut scratch) {
            Ok(()) => points += scratch.len(),
            Err(e) => fault = fault.and(Err(e)),
        }
    }
    let Some(root) = tree.node(0) else { return fault.map(|()| points) };
    let Aabb { min, max } = root.bounds;
    let frustum = Frustum::perspective(min, [1.0, 1.0, 0.5], [0.0, 0.0, 1.0], 1.0, 1.5, [0.1, 1e4]);
    let seen = tree.leaves_in_frustum(&frustum).len() + tree.draw_list(max, 10.0, Some(&frustum)).len();
    debug_assert!(seen <= 2 * tree.nodes().len());
    let mut inside = 0;
    let half = Aabb { min, max: root.bounds.center() };
    fault = fault.and(tree.points_in_box(&half, &mut scratch, |_, _, _| inside += 1));
    let mut picker = Picker::new(Arc::clone(&tree), 1 << 16);
    let ways = [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [max[0] - min[0], max[1] - min[1], max[2] - min[2]]];
    for ray in ways.into_iter().filter_map(|way| Ray::new(min, way, 0.5)) {
        fault = fault.and(picker.pick(&ray).map(|_| ()));
    }
    fault.map(|()| points)
}

/// An index, and one run of bytes under every other name.
struct Bytes {
    index: Vec<u8>,
    leaves: Vec<u8>,
}

impl Bytes {
    fn file(&self, name: &str) -> &[u8] {
        if name == INDEX_FILE { &self.index } else { &self.leaves }
    }
}

impl ByteSource for Bytes {
    fn read_at(&self, file: &str, offset: u64, buf: &mut [u8]) -> io::Result<()> {
        let start = usize::try_from(offset).ok();
        let range = start.and_then(|start| Some(start..start.checked_add(buf.len())?));
        buf.copy_from_slice(range.and_then(|r| self.file(file).get(r)).ok_or(io::ErrorKind::UnexpectedEof)?);
        Ok(())
    }

    fn size(&self, file: &str) -> io::Result<u64> {
        Ok(self.file(file).len() as u64)
    }

    fn locate(&self, file: &str) -> PathBuf {
        Path::new("memory").join(file)
    }
}

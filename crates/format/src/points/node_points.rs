//! Points of a dataset in memory: of an octree node, of a leaf, of a batch.

use crate::Lattice;

use super::{AttributeType, Column, Element, Positions};

/// The decoded points of one octree node, leaf or batch. Reuse one from node to node: its memory is reused.
///
/// Filled by [`crate::potree2::Dataset::read_points`], [`crate::bintree::Bintree::read_leaf`] and
/// [`crate::batches::Batches::read_batch`]. Positions are as they decode ([`Self::positions`]); [`Self::world`] gives
/// world coordinates whatever they are.
///
/// ```
/// use pointmill_format::NodePoints;
/// use pointmill_format::potree2::Dataset;
///
/// # fn main() -> Result<(), pointmill_format::ReadError> {
/// let dataset = Dataset::open(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/potree2/default"))?;
/// let mut points = NodePoints::default();
/// for node in dataset.read_hierarchy()? {
///     dataset.read_points(&node, &mut points)?;
///     let rgb = points.column::<u16>("rgb").unwrap_or(&[]); // red, green, blue of the first point, of the second …
///     assert_eq!(rgb.len(), 3 * points.len());
///     let x = (0..points.len()).filter_map(|i| points.world(i)).map(|[x, _, _]| x).fold(0.0, f64::max);
///     println!("{}: {} points, x up to {x}", node.key, points.len());
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone)]
pub struct NodePoints {
    pub(crate) positions: Positions,
    /// What integer positions are on.
    pub(crate) lattice: Lattice,
    names: Vec<String>,
    pub(crate) columns: Vec<Column>,
    /// Bytes as stored.
    pub(crate) stored: Vec<u8>,
    /// Bytes after decompression, where there is any.
    pub(crate) unpacked: Vec<u8>,
}

impl Default for NodePoints {
    fn default() -> Self {
        Self {
            positions: Positions::Quantized(Default::default()),
            lattice: Lattice { scale: [1.0; 3], offset: [0.0; 3] },
            names: Vec::new(),
            columns: Vec::new(),
            stored: Vec::new(),
            unpacked: Vec::new(),
        }
    }
}

impl NodePoints {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// True without points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The positions as they decode: of an octree integers on [`Self::lattice`], else world coordinates.
    pub fn positions(&self) -> &Positions {
        &self.positions
    }

    /// x, y, z on [`Self::lattice`], equally long; `None` if positions are world coordinates.
    pub fn quantized(&self) -> Option<[&[i32]; 3]> {
        match &self.positions {
            Positions::Quantized(axes) => Some(axes.each_ref().map(Vec::as_slice)),
            Positions::World(_) => None,
        }
    }

    /// Where integer positions are in the world. Without meaning if positions are world coordinates.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// World coordinates of point `index`, or `None` past the last.
    #[inline]
    pub fn world(&self, index: usize) -> Option<[f64; 3]> {
        match &self.positions {
            Positions::Quantized([x, y, z]) => {
                let quantized = [*x.get(index)?, *y.get(index)?, *z.get(index)?];
                Some(self.lattice.world(quantized.map(i64::from)))
            }
            Positions::World([x, y, z]) => Some([*x.get(index)?, *y.get(index)?, *z.get(index)?]),
        }
    }

    /// All columns, in the order of the dataset's attributes; positions are not among them.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The names of the columns, in their order.
    pub fn names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.names.iter().map(String::as_str)
    }

    /// The values of the column of that name: points · elements, those of a point side by side. `None` if there is no
    /// such column, or its type is not `T`.
    pub fn column<T: Element>(&self, name: &str) -> Option<&[T]> {
        self.names.iter().position(|n| n == name).and_then(|i| self.columns.get(i)?.values())
    }

    /// The bytes that the points were decoded from, as stored: of a binary tree's leaf its records, which a vertex
    /// buffer can take as they are. Empty for batches, which are not read but mapped.
    pub fn stored_bytes(&self) -> &[u8] {
        &self.stored
    }

    /// Empties the columns and gives them these names and types.
    pub(crate) fn reset<'a>(&mut self, columns: impl Iterator<Item = (&'a str, AttributeType)> + Clone) {
        self.columns.iter_mut().for_each(Column::clear);
        let mut now = self.names.iter().zip(&self.columns);
        let fits = |(name, ty)| now.next().is_some_and(|(n, column)| n == name && column.ty() == ty);
        if !(columns.clone().all(fits) && now.next().is_none()) {
            self.names = columns.clone().map(|(name, _)| name.to_owned()).collect();
            self.columns = columns.map(|(_, ty)| Column::new(ty)).collect();
        }
    }

    /// Leaves no points.
    pub(crate) fn clear(&mut self) {
        self.columns.iter_mut().for_each(Column::clear);
        self.stored.clear();
        self.positions = Positions::World(Default::default());
    }

    /// The memory of integer positions, emptied, to be filled and put back.
    pub(crate) fn take_quantized(&mut self) -> [Vec<i32>; 3] {
        match std::mem::replace(&mut self.positions, Positions::Quantized(Default::default())) {
            Positions::Quantized(mut axes) => {
                axes.iter_mut().for_each(Vec::clear);
                axes
            }
            Positions::World(_) => Default::default(),
        }
    }

    /// The memory of world coordinates, emptied, to be filled and put back.
    pub(crate) fn take_world(&mut self) -> [Vec<f64>; 3] {
        match std::mem::replace(&mut self.positions, Positions::World(Default::default())) {
            Positions::World(mut axes) => {
                axes.iter_mut().for_each(Vec::clear);
                axes
            }
            Positions::Quantized(_) => Default::default(),
        }
    }
}

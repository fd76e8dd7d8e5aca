//! A run of points in memory: positions, and one column per attribute.

use std::sync::Arc;

use super::{Attribute, Changes, Column, Element};

/// Positions of a batch, x, y, z of equal length.
#[derive(Debug, Clone, PartialEq)]
pub enum Positions {
    /// Integers on the scan's own lattice ([`crate::ScanInfo::lattice`]).
    Quantized([Vec<i32>; 3]),
    /// World coordinates, for scans that have no lattice.
    World([Vec<f64>; 3]),
}

impl Positions {
    /// Number of points.
    pub fn len(&self) -> usize {
        match self {
            Self::Quantized(p) => p[0].len(),
            Self::World(p) => p[0].len(),
        }
    }

    /// True without points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A run of points of one scan, in file order.
///
/// ```
/// use pointmill_format::{Attribute, AttributeType, Column, PointBatch, Positions};
///
/// let mut batch = PointBatch::new(
///     0,
///     Positions::World([vec![1.0, 2.0], vec![0.0, 0.0], vec![5.0, 6.0]]),
///     [Attribute::new("rgb", AttributeType::UInt8, 3)],
/// );
/// batch.columns[0] = Column::UInt8(vec![255, 0, 0, 0, 0, 255]);
/// let colours = batch.column::<u8>("rgb").ok_or("no colours")?;
/// assert_eq!(colours.chunks_exact(3).last(), Some(&[0, 0, 255][..]));
/// assert_eq!(batch.column::<u16>("rgb"), None);
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PointBatch {
    /// Index in the scan of the first point.
    pub first_point: u64,
    /// Where the points are.
    pub positions: Positions,
    /// One column for each of [`crate::ScanInfo::attributes`], in that order; columns that were not wanted are empty.
    pub columns: Vec<Column>,
    /// What the columns are.
    attributes: Arc<[Attribute]>,
    /// By column; shorter than the columns, or empty, where nothing changed.
    changes: Vec<Changes>,
}

impl PointBatch {
    /// A batch with an empty column per attribute.
    #[must_use]
    pub fn new(first_point: u64, positions: Positions, attributes: impl Into<Arc<[Attribute]>>) -> Self {
        let attributes = attributes.into();
        let columns = attributes.iter().map(|a| Column::new(a.ty)).collect();
        Self { first_point, positions, columns, attributes, changes: Vec::new() }
    }

    /// What the columns are: [`crate::ScanInfo::attributes`] of their scan.
    pub fn attributes(&self) -> &[Attribute] {
        &self.attributes
    }

    /// What the reader could not keep of the values of these points: (index of the column, counts), where there is
    /// something.
    pub fn changes(&self) -> impl Iterator<Item = (usize, &Changes)> {
        self.changes.iter().enumerate().filter(|(_, changes)| !changes.is_empty())
    }

    /// Counts changed values of a column, beside those of [`Self::changes`].
    pub fn count_changes(&mut self, column: usize, changes: &Changes) {
        if changes.is_empty() {
            return;
        }
        if self.changes.len() <= column {
            self.changes.resize(column + 1, Changes::default());
        }
        self.changes[column].merge(changes);
    }

    /// Starts counting anew, for other points.
    pub fn clear_changes(&mut self) {
        self.changes.clear();
    }

    /// The values of the attribute of that name, if its elements have the type `T`: [`Attribute::elements`] values per
    /// point. `None` also if the attribute was not wanted.
    pub fn column<T: Element>(&self, name: &str) -> Option<&[T]> {
        let column = self.attributes.iter().position(|a| a.name == name)?;
        let values = self.columns.get(column)?.values::<T>()?;
        (!values.is_empty() || self.is_empty()).then_some(values)
    }

    /// True if the columns have the types of these attributes.
    pub(crate) fn fits(&self, attributes: &[Attribute]) -> bool {
        self.columns.iter().map(Column::ty).eq(attributes.iter().map(|a| a.ty))
    }

    /// Renames the columns; their types fit.
    pub(crate) fn set_attributes(&mut self, attributes: &Arc<[Attribute]>) {
        if !Arc::ptr_eq(&self.attributes, attributes) {
            self.attributes = Arc::clone(attributes);
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// True without points.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }
}

//! The sections that have one entry per point, and their order in the file (`docs/formats/batches.md`, §1.1).

use super::Precision;

/// A section with one entry per point. Version 1 of the format has these five.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs)] // the names say it
pub enum Part {
    Hi10,
    Mid10,
    Lo10,
    Colour,
    /// By its place among the extra attributes ([`super::Batches::attributes`]).
    Attribute(usize),
}

impl Part {
    /// The parts of a file with that many extra attributes and the planes of `precision`, in the order of the file.
    ///
    /// ```
    /// use pointmill_format::batches::{Part, Precision};
    ///
    /// let parts: Vec<Part> = Part::in_file_order(1, Precision::Twenty).collect();
    /// assert_eq!(parts, [Part::Hi10, Part::Colour, Part::Attribute(0), Part::Mid10]);
    /// ```
    pub fn in_file_order(attributes: usize, precision: Precision) -> impl Iterator<Item = Self> {
        // planes that may turn out not to be needed stand last, so that the file can be cut before them
        let optional = [Self::Mid10, Self::Lo10].into_iter().take(precision.planes() as usize - 1);
        [Self::Hi10, Self::Colour].into_iter().chain((0..attributes).map(Self::Attribute)).chain(optional)
    }
}

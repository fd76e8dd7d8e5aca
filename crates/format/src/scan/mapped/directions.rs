//! Normals turn with the points.

use super::map::ScanMap;
use crate::{Affine, Attribute, Column, PointBatch, ScanInfo, Wanted, with_column};

/// Names of normals, in lower case and without anything but letters and digits, but for the axis at their end.
const NAMES: [&str; 3] = ["normal", "normals", "n"];

/// The columns that hold directions, and how they turn.
#[derive(Debug, Default)]
pub(super) struct Directions {
    /// The columns of x, y and z, each of one element.
    triples: Vec<[Component; 3]>,
    turn: [[f64; 3]; 3],
    /// The turn changes no length.
    is_exact: bool,
}

/// A column of one component.
#[derive(Debug, Clone, Copy)]
struct Component {
    column: usize,
    /// `meant = stored · scale + offset`
    scale: f64,
    offset: f64,
}

impl Directions {
    pub(super) fn new(info: &ScanInfo, map: &ScanMap) -> Self {
        let (turn, is_exact) = of_unit_vectors(&map.affine);
        let triples = if turn == *Affine::IDENTITY.linear() { Vec::new() } else { find(info) };
        Self { triples, turn, is_exact }
    }

    /// The columns that must be decoded so that those which are wanted can be turned.
    pub(super) fn needed_for(&self, wanted: &Wanted) -> Wanted {
        let mut needed = wanted.clone();
        for triple in &self.triples {
            let is_wanted = triple.iter().any(|c| wanted.is_wanted(c.column));
            triple.iter().for_each(|c| needed.set(c.column, is_wanted));
        }
        needed
    }

    /// Turns the directions of a batch, and empties columns that are not wanted.
    pub(super) fn apply(&self, batch: &mut PointBatch, wanted: &Wanted) {
        for triple in &self.triples {
            if triple.iter().any(|c| wanted.is_wanted(c.column)) {
                self.turn(batch, triple);
            }
            for component in triple.iter().filter(|c| !wanted.is_wanted(c.column)) {
                batch.columns[component.column].clear();
            }
        }
    }

    fn turn(&self, batch: &mut PointBatch, triple: &[Component; 3]) {
        let mut meant = triple.map(|c| c.read(&batch.columns[c.column]));
        let [x, y, z] = &mut meant;
        for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
            [*x, *y, *z] = self.turned([*x, *y, *z]);
        }
        for (component, values) in triple.iter().zip(&meant) {
            component.write(&mut batch.columns[component.column], values);
        }
    }

    /// As long as before: no normal (0 0 0) stays none.
    fn turned(&self, v: [f64; 3]) -> [f64; 3] {
        let turned = self.turn.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
        let ratio = if self.is_exact { 1.0 } else { length(v) / length(turned) };
        if ratio.is_finite() { turned.map(|c| c * ratio) } else { turned }
    }
}

impl Component {
    #[allow(clippy::unnecessary_cast)] // one body for every type of column
    fn read(self, column: &Column) -> Vec<f64> {
        with_column!(column, v => v.iter().map(|v| *v as f64 * self.scale + self.offset).collect())
    }

    fn write(self, column: &mut Column, meant: &[f64]) {
        let stored = meant.iter().map(|v| (v - self.offset) / self.scale);
        match column {
            Column::Float32(to) => to.iter_mut().zip(stored).for_each(|(to, v)| *to = v as f32),
            Column::Float64(to) => to.iter_mut().zip(stored).for_each(|(to, v)| *to = v),
            Column::Int8(to) => to.iter_mut().zip(stored).for_each(|(to, v)| *to = v.round() as i8),
            Column::Int16(to) => to.iter_mut().zip(stored).for_each(|(to, v)| *to = v.round() as i16),
            Column::Int32(to) => to.iter_mut().zip(stored).for_each(|(to, v)| *to = v.round() as i32),
            Column::Int64(to) => to.iter_mut().zip(stored).for_each(|(to, v)| *to = v.round() as i64),
            Column::UInt8(to) => to.iter_mut().zip(stored).for_each(|(to, v)| *to = v.round() as u8),
            Column::UInt16(to) => to.iter_mut().zip(stored).for_each(|(to, v)| *to = v.round() as u16),
            Column::UInt32(to) => to.iter_mut().zip(stored).for_each(|(to, v)| *to = v.round() as u32),
            Column::UInt64(to) => to.iter_mut().zip(stored).for_each(|(to, v)| *to = v.round() as u64),
        }
    }
}

/// How unit normals turn, and whether it keeps their lengths exactly.
fn of_unit_vectors(affine: &Affine) -> ([[f64; 3]; 3], bool) {
    let normals = affine.of_normals();
    if let Some(axes) = affine.axes().filter(|axes| axes.iter().all(|(_, f)| f.abs() == axes[0].1.abs())) {
        let unit = |i: usize, j: usize| if axes[i].0 == j { axes[i].1.signum() } else { 0.0 };
        return (std::array::from_fn(|i| std::array::from_fn(|j| unit(i, j))), true);
    }
    (normals, false)
}

/// The normals of a scan, under any of their usual names.
fn find(info: &ScanInfo) -> Vec<[Component; 3]> {
    let component = |name: &str, axis: &str| {
        let is_it = |a: &Attribute| a.elements == 1 && plain(&a.name) == format!("{name}{axis}");
        let column = info.attributes.iter().position(is_it)?;
        let attribute = &info.attributes[column];
        let only = |values: &[f64], other: f64| values.first().copied().unwrap_or(other);
        Some(Component { column, scale: only(&attribute.scale, 1.0), offset: only(&attribute.offset, 0.0) })
    };
    NAMES.iter().filter_map(|n| Some([component(n, "x")?, component(n, "y")?, component(n, "z")?])).collect()
}

/// True if the scan has normals.
pub(super) fn has_normals(info: &ScanInfo) -> bool {
    !find(info).is_empty()
}

fn plain(name: &str) -> String {
    name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect()
}

fn length(v: [f64; 3]) -> f64 {
    v[0].hypot(v[1]).hypot(v[2])
}

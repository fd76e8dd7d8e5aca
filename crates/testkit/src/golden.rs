//! What other programs read from the fixtures: `fixtures/*/expected.tsv`, written by `fixtures/generators/`.

use std::collections::BTreeMap;
use std::fs;
use std::str::FromStr;

use pointmill_format::{Attribute, Column};

use crate::files::fixture;
use crate::reader::Cloud;

/// The name of a table.
pub const FILE: &str = "expected.tsv";

/// Column → `N` numbers: how many values there are, their sum, and so on, as the head of the table says.
pub type Columns<T, const N: usize> = BTreeMap<String, [T; N]>;

/// The table of a folder of scans: file → [`Columns`].
///
/// # Panics
/// If a line does not hold file, column and `N` numbers.
pub fn expected<T: FromStr, const N: usize>(folder: &str) -> BTreeMap<String, Columns<T, N>> {
    let mut files = BTreeMap::<String, Columns<T, N>>::new();
    for (file, column, numbers) in lines(folder) {
        let numbers: Vec<T> = numbers.iter().map(|f| f.parse().ok().unwrap()).collect();
        let numbers =
            numbers.try_into().unwrap_or_else(|_| panic!("{folder}/{FILE}: not {N} numbers: {file} {column}"));
        files.entry(file).or_default().insert(column, numbers);
    }
    files
}

/// File → points.
pub(crate) fn point_counts(folder: &str) -> BTreeMap<String, u64> {
    let lines = lines(folder).into_iter().filter(|(_, column, _)| column == "x");
    lines.map(|(file, _, numbers)| (file, numbers[0].parse::<f64>().unwrap() as u64)).collect()
}

fn lines(folder: &str) -> Vec<(String, String, Vec<String>)> {
    let path = fixture(folder).join(FILE);
    let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let line = |line: &str| {
        let mut fields = line.split('\t').map(str::to_owned);
        (fields.next().unwrap(), fields.next().unwrap(), fields.collect())
    };
    text.lines().filter(|l| !l.starts_with('#')).map(line).collect()
}

/// The values of a cloud under the names of the tables (`x`, `intensity`, `rgb[0]`), as whatever the test compares.
pub fn columns<T: Copy>(
    cloud: &Cloud,
    coordinate: fn(f64) -> T,
    values: fn(&Column) -> Vec<T>,
) -> BTreeMap<String, Vec<T>> {
    let axes = ["x", "y", "z"].into_iter().zip(&cloud.xyz);
    let mut named: BTreeMap<_, _> =
        axes.map(|(name, axis)| (name.to_owned(), axis.iter().map(|v| coordinate(*v)).collect())).collect();
    for (Attribute { name, elements, .. }, column) in cloud.info.attributes.iter().zip(&cloud.columns) {
        let all = values(column);
        for element in 0..*elements {
            let name = if *elements == 1 { name.clone() } else { format!("{name}[{element}]") };
            named.insert(name, all.iter().skip(element).step_by(*elements).copied().collect());
        }
    }
    named
}

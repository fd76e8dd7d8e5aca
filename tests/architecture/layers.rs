//! The order of the modules of a crate: lower ones must not need higher ones.

use std::collections::BTreeSet;

use crate::imports::Imports;

/// Layers from the lowest to the highest, each the names of modules at the root of the crate. The root file itself is
/// above all.
pub(crate) type Layers<'a> = &'a [&'a [&'a str]];

/// What is wrong: an arrow upwards, or a module without a layer.
pub(crate) fn faults(imports: &Imports, layers: Layers<'_>) -> Vec<String> {
    let unknown = imports.files.iter().filter(|file| layer(file, layers).is_none()).map(|file| module(file));
    let unknown: BTreeSet<&str> = unknown.collect();
    let mut out: Vec<String> = unknown.iter().map(|name| format!("  module {name} is in none of the layers")).collect();
    for edge in imports.edges.keys() {
        let [from, to] = [edge.0, edge.1].map(|file| layer(&imports.files[file], layers));
        if from.is_some() && from < to {
            out.push(imports.describe(*edge) + ", which is in a higher layer");
        }
    }
    out
}

/// The layer of a file, whose path is relative to the root file.
fn layer(file: &str, layers: Layers<'_>) -> Option<usize> {
    match module(file) {
        "lib" | "main" => Some(layers.len()),
        name => layers.iter().position(|layer| layer.contains(&name)),
    }
}

fn module(file: &str) -> &str {
    file.split('/').next().unwrap_or(file).trim_end_matches(".rs")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planted::planted;

    const LAYERS: Layers<'static> = &[&["low"], &["left", "right"]];

    #[test]
    fn an_arrow_upwards_is_found() {
        let crate_ = planted(&[
            ("lib.rs", "mod low; mod left; mod right; fn all() { right::run() }"),
            ("low/mod.rs", "mod deep;"),
            ("low/deep.rs", "use crate::right::Right;"),
            ("left.rs", "use crate::right::Right;"),
            ("right.rs", "pub struct Right; pub fn run() {}"),
        ]);
        let found = faults(&crate_.imports(), LAYERS);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].contains("low/deep.rs needs right.rs (line 1: use crate::right::Right)"), "{found:?}");
    }

    #[test]
    fn a_module_without_a_layer_and_the_root_used_from_below_are_found() {
        let crate_ = planted(&[
            ("lib.rs", "mod low; mod new; pub struct Root;"),
            ("low.rs", "use crate::Root;"),
            ("new.rs", ""),
        ]);
        let found = faults(&crate_.imports(), LAYERS).join("\n");
        assert!(found.contains("module new is in none") && found.contains("low.rs needs lib.rs"), "{found}");
    }
}

//! What keeps the layout from decaying: arrows between the crates, circles and layers inside of each, and names and
//! defaults in the documents.

mod circles;
mod crates;
mod documents;
mod imports;
mod layers;
mod modules;
mod planted;
mod promises;
mod tokens;

use std::path::{Path, PathBuf};

use imports::Imports;
use layers::Layers;

/// The modules of each crate, from the lowest to the highest layer. Modules of one layer may need each other, as long as
/// there is no circle of files.
const LAYERS: [(&str, Layers<'static>); 9] = [
    (
        "pointmill",
        &[
            &["fitting", "printable"],
            &["flags"],
            &["exit", "datasets"],
            &["args", "allocator", "crs_choice", "interrupt", "profiles"],
            &["depth_choice", "human", "scan_choice", "text_choice"],
            &["inputs"],
            &["commands"],
        ],
    ),
    (
        "pointmill-capi",
        &[
            &["status"],
            &["border", "axes"],
            &["about", "octree"],
            &["dataset", "camera", "check"],
            &["info"],
            &["nodes"],
            &["decode", "detail", "sections", "select"],
            &["colours", "pick"],
            &["points"],
        ],
    ),
    ("pointmill-crs", &[&["units", "system"], &["heights", "projection"], &["operation"], &["placing"]]),
    (
        "pointmill-format",
        &[
            &["error", "write_error", "bytes", "geometry", "names"],
            &["json", "points"],
            &["scan", "octree"],
            &["copc", "potree1", "potree2", "bintree", "batches"],
            &["dataset_kind"],
            &["dataset_scan"],
            &["open_octree", "open_scan"],
        ],
    ),
    (
        "pointmill-measure",
        &[
            &["axis", "error", "image", "position"],
            &["cloud", "program"],
            &["colour", "decoded", "sample", "views"],
            &["result"],
            &["choice", "trades"],
            &["measurement"],
            &["report"],
        ],
    ),
    (
        "pointmill-render",
        &[
            &["vector", "error", "style", "workers"],
            &["camera"],
            &["flight"],
            &["picture", "projection"],
            &["raster", "sources"],
            &["colours", "shading"],
            &["canvas", "boxes"],
            &["draw", "overview"],
            &["render"],
            &["scene"],
        ],
    ),
    (
        "pointmill-validate",
        &[
            &["check", "place", "memory"],
            &["finding"],
            &["report"],
            &["options", "accuracy", "outcome"],
            &["against"],
            &["surfels"],
            &["octree"],
            &["copc", "potree1", "potree2", "bintree", "batches"],
        ],
    ),
    ("pointmill-view", &[&["error", "page", "refusal", "values"], &["encode"], &["dataset"], &["http"]]),
    (
        "pointmill-converter",
        &[
            &["memory", "advice", "reason"],
            &["plan", "unit_name"],
            &["error", "warning"],
            &["runtime"],
            &["sources"],
            &["cloud"],
            &["job"],
            &["gather", "derive"],
            &["report"],
            &["octree"],
            &["outputs"],
            &["convert", "estimate", "export"],
            &["shared_job"],
            &["bench_api"],
        ],
    ),
];

/// Root files of the libraries and programs of the workspace, each with the name of its package.
fn roots() -> Vec<(String, PathBuf)> {
    let mut roots = Vec::new();
    for package in crates::packages() {
        let name = package["name"].as_str().unwrap();
        for target in package["targets"].as_array().unwrap() {
            let kinds = target["kind"].as_array().unwrap();
            if kinds.iter().any(|kind| kind == "lib" || kind == "rlib" || kind == "bin") {
                roots.push((name.to_owned(), PathBuf::from(target["src_path"].as_str().unwrap())));
            }
        }
    }
    assert!(roots.len() >= 6, "{roots:?}");
    roots
}

fn imports(root: &Path) -> Imports {
    Imports::read(root, root.parent().unwrap())
}

#[test]
fn no_files_of_a_crate_need_each_other_in_a_circle() {
    let mut found = Vec::new();
    for (package, root) in &roots() {
        found.extend(circles::circles(&imports(root)).into_iter().map(|circle| format!("{package}: {circle}")));
    }
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
}

#[test]
fn no_module_needs_a_higher_layer() {
    let roots = roots();
    let mut found = Vec::new();
    for (package, layers) in &LAYERS {
        let (_, root) = roots.iter().find(|(name, _)| name == package).unwrap();
        let faults = layers::faults(&imports(root), layers);
        found.extend(faults.into_iter().map(|fault| format!("{package}:{fault}")));
    }
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
}

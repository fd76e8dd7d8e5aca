//! Which file of a crate needs which: imports and paths, followed through re-exports to the file that defines the name.

use std::collections::BTreeMap;
use std::path::Path;

use crate::modules::{Import, Named, Tree};

/// What a path leads to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Target {
    Module(usize),
    /// An item, or something of an item, in this file.
    Item(usize),
}

/// Files of a crate by their paths from `base`, and what each needs of another, with the lines that say so.
#[derive(Debug, Default)]
pub(crate) struct Imports {
    pub(crate) files: Vec<String>,
    pub(crate) edges: BTreeMap<(usize, usize), Vec<String>>,
}

/// Re-exports lead on; more steps than this are a circle of names.
const MAX_STEPS: usize = 32;

impl Imports {
    /// Those of the crate whose root file is `root`.
    pub(crate) fn read(root: &Path, base: &Path) -> Self {
        let tree = Tree::read(root);
        let name = |path: &Path| path.strip_prefix(base).unwrap_or(path).to_string_lossy().replace('\\', "/");
        let files = tree.files.iter().map(|file| name(&file.path)).collect();
        let mut imports = Self { files, ..Self::default() };
        for (number, module) in tree.modules.iter().enumerate() {
            for import in &module.imports {
                let path = &import.path;
                if is_needed(&tree, number, import)
                    && let Some(target) = resolve(&tree, number, &path.segments, MAX_STEPS)
                {
                    imports.add(&tree, number, path, "use ", target, import.alias == "*");
                }
            }
            for path in &module.paths {
                // a name that an import brought here was counted there
                if leads_through_a_module(&tree, number, &path.segments[..1])
                    && let Some(target) = resolve(&tree, number, &path.segments, MAX_STEPS)
                {
                    imports.add(&tree, number, path, "", target, false);
                }
            }
        }
        imports
    }

    /// A module that is merely named needs nothing of its file: what is named through it does.
    fn add(&mut self, tree: &Tree, module: usize, path: &Named, keyword: &str, target: Target, glob: bool) {
        let from = tree.modules[module].file;
        let to = match target {
            Target::Item(file) => file,
            Target::Module(module) if glob => tree.modules[module].file,
            Target::Module(_) => return,
        };
        if from != to {
            let all = if glob { "::*" } else { "" };
            let line = format!("{}: {keyword}{}{all}", path.line, path.segments.join("::"));
            self.edges.entry((from, to)).or_default().push(line);
        }
    }

    /// The edge with its first lines, for a message.
    pub(crate) fn describe(&self, edge: (usize, usize)) -> String {
        let lines = self.edges.get(&edge).map_or(&[][..], |lines| lines);
        let more = if lines.len() > 3 { ", …" } else { "" };
        let some = lines.iter().take(3).map(|l| format!("line {l}")).collect::<Vec<_>>().join(", ");
        format!("  {} needs {} ({some}{more})", self.files[edge.0], self.files[edge.1])
    }
}

/// A module and a function may share a name; in front of `::` it is the module.
fn leads_through_a_module(tree: &Tree, module: usize, first: &[String]) -> bool {
    tree.modules[module].children.contains_key(&first[0])
        || matches!(resolve(tree, module, first, MAX_STEPS), Some(Target::Module(_)))
}

/// A re-export is a signboard; its file needs the name if its code uses it.
fn is_needed(tree: &Tree, module: usize, import: &Import) -> bool {
    !import.public || tree.files[tree.modules[module].file].words.contains(&import.alias)
}

fn resolve(tree: &Tree, module: usize, segments: &[String], steps: usize) -> Option<Target> {
    let Some((first, rest)) = segments.split_first() else { return Some(Target::Module(module)) };
    let this = &tree.modules[module];
    match first.as_str() {
        "crate" => return below(tree, 0, rest, steps),
        "self" => return below(tree, module, rest, steps),
        "super" => return resolve_super(tree, this.parent?, rest, steps),
        _ => {}
    }
    below(tree, module, segments, steps).filter(|target| {
        // without a module in front of it, a name is one of this module or of another crate
        *target != Target::Item(this.file) || this.items.contains(first) || leads_here(tree, module, first)
    })
}

fn leads_here(tree: &Tree, module: usize, name: &str) -> bool {
    let this = &tree.modules[module];
    this.children.contains_key(name) || this.imports.iter().any(|import| import.alias == name)
}

fn resolve_super(tree: &Tree, module: usize, segments: &[String], steps: usize) -> Option<Target> {
    match segments.split_first() {
        Some((first, rest)) if first == "super" => resolve_super(tree, tree.modules[module].parent?, rest, steps),
        _ => below(tree, module, segments, steps),
    }
}

/// What `segments` names inside of `module`.
fn below(tree: &Tree, module: usize, segments: &[String], steps: usize) -> Option<Target> {
    let Some((first, rest)) = segments.split_first() else { return Some(Target::Module(module)) };
    let this = &tree.modules[module];
    let steps = steps.checked_sub(1)?;
    let child = this.children.get(first).copied();
    if let (Some(child), false) = (child, rest.is_empty()) {
        return below(tree, child, rest, steps);
    }
    if this.items.contains(first) {
        return Some(Target::Item(this.file));
    }
    for import in this.imports.iter().filter(|import| import.alias == *first) {
        let is_itself =
            import.path.segments.first() == Some(first) && child.is_none() && import.path.segments.len() == 1;
        match if is_itself { None } else { resolve(tree, module, &import.path.segments, steps) } {
            Some(Target::Module(next)) => return below(tree, next, rest, steps),
            Some(item) => return Some(item),
            None => {}
        }
    }
    if let Some(child) = child {
        return Some(Target::Module(child));
    }
    // what a glob is of is not sought in it
    let is_other = |glob: &&Import| glob.path.segments.first() != Some(first);
    for glob in this.imports.iter().filter(|import| import.alias == "*").filter(is_other) {
        if let Some(Target::Module(next)) = resolve(tree, module, &glob.path.segments, steps)
            && next != module
            && defines(tree, next, first)
        {
            return below(tree, next, segments, steps);
        }
    }
    if module == 0 && tree.macros.contains_key(first) {
        return tree.macros.get(first).map(|file| Target::Item(*file));
    }
    // imported from another crate, or made by a macro of this module
    let is_foreign = this.imports.iter().any(|import| import.alias == *first);
    (!is_foreign).then_some(Target::Item(this.file))
}

fn defines(tree: &Tree, module: usize, name: &str) -> bool {
    tree.modules[module].items.contains(name) || leads_here(tree, module, name)
}

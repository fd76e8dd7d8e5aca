//! Circles of files that need each other.

use std::collections::BTreeSet;

use crate::imports::Imports;

/// A text for each circle: its files, and the imports that tie them. Empty: there is none.
pub(crate) fn circles(imports: &Imports) -> Vec<String> {
    let reachable: Vec<BTreeSet<usize>> = (0..imports.files.len()).map(|file| reachable(imports, file)).collect();
    let mut listed = BTreeSet::new();
    let mut out = Vec::new();
    for file in 0..imports.files.len() {
        let circle: Vec<usize> = reachable[file].iter().copied().filter(|f| reachable[*f].contains(&file)).collect();
        if circle.len() < 2 || !listed.insert(circle[0]) {
            continue;
        }
        let inside = |edge: &&(usize, usize)| circle.contains(&edge.0) && circle.contains(&edge.1);
        let edges: Vec<String> = imports.edges.keys().filter(inside).map(|edge| imports.describe(*edge)).collect();
        out.push(format!("a circle of {} files\n{}", circle.len(), edges.join("\n")));
    }
    out
}

/// What `file` needs, directly or through others.
fn reachable(imports: &Imports, file: usize) -> BTreeSet<usize> {
    let (mut seen, mut open) = (BTreeSet::new(), vec![file]);
    while let Some(from) = open.pop() {
        for (_, to) in imports.edges.range((from, 0)..(from + 1, 0)).map(|(edge, _)| *edge) {
            if seen.insert(to) {
                open.push(to);
            }
        }
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planted::planted;

    #[test]
    fn a_circle_is_found_with_the_imports_that_tie_it() {
        let crate_ = planted(&[
            ("lib.rs", "mod a; mod b; mod c;"),
            ("a.rs", "use crate::b::B;\npub struct A(B);"),
            ("b.rs", "use super::c;\npub struct B(c::C);"),
            ("c.rs", "pub struct C(Box<crate::a::A>);"),
        ]);
        let found = circles(&crate_.imports());
        assert_eq!(found.len(), 1, "{found:?}");
        for text in ["3 files", "a.rs needs b.rs (line 1: use crate::b::B)", "(line 2: c::C)", "crate::a::A"] {
            assert!(found[0].contains(text), "{text}: {}", found[0]);
        }
    }

    #[test]
    fn a_circle_through_re_exports_and_folders_is_found() {
        let crate_ = planted(&[
            ("lib.rs", "mod gather; mod cloud;"),
            ("gather/mod.rs", "mod store; mod load; pub(crate) use store::{Store, Other};"),
            ("gather/store.rs", "use crate::cloud::Cell; pub(crate) struct Store(Cell); pub(crate) struct Other;"),
            ("gather/load.rs", "use super::Store;"),
            ("cloud.rs", "use crate::{gather::{Store as S}}; pub(crate) struct Cell(S);"),
        ]);
        let found = circles(&crate_.imports());
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].contains("2 files") && found[0].contains("cloud.rs needs gather/store.rs"), "{}", found[0]);
    }

    #[test]
    fn a_parent_and_a_child_that_need_each_other_are_a_circle() {
        let parent = "mod child; pub struct Shared; pub fn child() { child::run() }";
        let crate_ = planted(&[("lib.rs", parent), ("child.rs", "use super::Shared; pub fn run() {}")]);
        assert_eq!(circles(&crate_.imports()).len(), 1);
    }

    #[test]
    fn declarations_signboards_tests_and_other_crates_tie_nothing() {
        let crate_ = planted(&[
            ("lib.rs", "mod a; mod b; pub use a::A; pub struct Root; use rayon::prelude::*;"),
            ("a.rs", "use crate::b::B; pub struct A(B); // use crate::Root;"),
            (
                "b.rs",
                "use std::fmt; pub struct B; impl fmt::Debug for B {}\n#[cfg(test)]\nmod tests { use crate::a::A; }",
            ),
        ]);
        assert_eq!(circles(&crate_.imports()), [""; 0]);
        assert_eq!(crate_.imports().edges.len(), 1);
    }
}

//! Faults of the hierarchy.

use pointmill_format::NodeKey;
use pointmill_validate::{Check, Severity};

use crate::file::{INFO, PAGE_LEVEL, good};
use crate::support::{assert_only, broken};

fn page_faults(outcome: &pointmill_validate::Outcome) -> u64 {
    outcome.check(Check::Pages).unwrap().found
}

#[test]
fn a_page_that_leaves_the_file_or_is_no_whole_number_of_entries() {
    let file = good();
    let (key, at) = file.proxies.first_key_value().map(|(k, at)| (*k, *at)).unwrap();
    for (field, new) in [(16, u64::MAX - 7), (16, file.bytes.len() as u64)] {
        let mut file = file.clone();
        file.put(at + field, &new.to_le_bytes());
        let outcome = file.validate();
        assert_eq!(page_faults(&outcome), 1, "{:#?}", outcome.problems);
        let about = outcome.problems.iter().find(|p| p.check == Check::Pages && p.severity == Severity::Error);
        assert_eq!(about.unwrap().node, Some(key.into()));
        // nodes are missing, and their points
        assert_eq!(outcome.check(Check::PointCount).unwrap().found, 1);
    }
    let mut uneven = file.clone();
    uneven.put(at + 24, &33i32.to_le_bytes());
    assert_eq!(page_faults(&uneven.validate()), 1);
    let mut root = file;
    root.put(INFO + 48, &0u64.to_le_bytes());
    let outcome = root.validate();
    assert!(page_faults(&outcome) == 1 && outcome.nodes == 0, "{:#?}", outcome.problems);
}

#[test]
fn pages_that_overlap_or_go_round_in_circles() {
    let file = good();
    let mut proxies = file.proxies.values();
    let (a, b) = (*proxies.next().unwrap(), *proxies.next().unwrap());
    // the second leads to the page of the first: bytes that are taken
    let mut overlap = file.clone();
    let page: Vec<u8> = file.bytes[a + 16..a + 28].to_vec();
    overlap.put(b + 16, &page);
    let outcome = overlap.validate();
    assert!(outcome.problems.iter().any(|p| p.check == Check::Pages && p.subject == "the page"));
    // one leads to the root's page
    let mut circle = file.clone();
    let root: Vec<u8> = [&file.bytes[INFO + 40..INFO + 48], &file.bytes[INFO + 48..INFO + 52]].concat();
    circle.put(a + 16, &root);
    let outcome = circle.validate();
    assert!(outcome.problems.iter().any(|p| p.check == Check::Pages && p.subject == "the page"));
}

#[test]
fn a_page_outside_of_the_record_of_the_hierarchy() {
    let mut file = good();
    let len = file.u64(file.hierarchy + 20);
    // the record ends a page before: what follows belongs to no record that is looked for
    file.put(file.hierarchy + 20, &(len - 32).to_le_bytes());
    let outcome = file.validate();
    assert!(page_faults(&outcome) > 0, "{:#?}", outcome.problems);
}

#[test]
fn bytes_of_the_hierarchy_in_no_page_are_a_warning() {
    let mut file = good();
    let (key, at) = file.proxies.last_key_value().map(|(k, at)| (*k, *at)).unwrap();
    let size = i32::from_le_bytes(file.bytes[at + 24..at + 28].try_into().unwrap());
    file.put(at + 24, &(size - 32).to_le_bytes());
    let outcome = file.validate();
    let unused = outcome.problems.iter().find(|p| p.check == Check::Pages && p.severity == Severity::Warning);
    assert_eq!(unused.unwrap().found, 32, "{key}: {:#?}", outcome.problems);
}

#[test]
fn entries_that_are_no_nodes_twice_or_of_another_page() {
    let file = good();
    let (leaf, at) = file.leaf();
    for (field, new) in [(0, -1i32), (0, 40), (4, 1 << 30), (28, -2)] {
        let mut file = file.clone();
        file.put(at + field, &new.to_le_bytes());
        let outcome = file.validate();
        assert_eq!(page_faults(&outcome), 1, "{leaf} {field}: {:#?}", outcome.problems);
    }
    // the leaf becomes its neighbour, which is there already
    let (other, other_at) = file.entries.iter().rev().nth(1).map(|(k, at)| (*k, *at)).unwrap();
    let mut twice = file.clone();
    let bytes: Vec<u8> = file.bytes[other_at..other_at + 32].to_vec();
    twice.put(at, &bytes);
    let outcome = twice.validate();
    let found = outcome.problems.iter().find(|p| p.check == Check::Pages).unwrap();
    assert!(found.node == Some(other.into()) && found.subject == "entries of the node", "{:#?}", outcome.problems);
    // a node of a page becomes the root
    let mut elsewhere = file;
    elsewhere.put(at, &[0; 16]);
    let outcome = elsewhere.validate();
    assert_eq!(page_faults(&outcome), 1, "{:#?}", outcome.problems);
}

#[test]
fn a_node_without_its_parent() {
    let mut file = good();
    let (key, _) = file.leaf();
    let parent = key.parent().unwrap();
    let at = file.entries[&parent];
    // the parent moves to a place where nothing is
    let free = (0..)
        .map(|x| NodeKey { x, ..parent })
        .find(|key| key.ancestor(PAGE_LEVEL) == parent.ancestor(PAGE_LEVEL) && !file.entries.contains_key(key));
    let Some(free) = free else { panic!("no free place") };
    file.put(at + 4, &(free.x as i32).to_le_bytes());
    let outcome = file.validate();
    let found = outcome.problems.iter().any(|p| p.check == Check::Pages && p.subject == "parent of the node");
    assert!(found, "{:#?}", outcome.problems);
}

#[test]
fn counts_offsets_and_bytes_that_contradict_each_other() {
    let file = good();
    let (leaf, at) = file.leaf();
    let mut no_bytes = file.clone();
    no_bytes.put(at + 24, &0i32.to_le_bytes());
    let outcome = no_bytes.validate();
    assert!(page_faults(&outcome) == 1 && outcome.problems[0].node == Some(leaf.into()), "{:#?}", outcome.problems);
    let mut no_points = file;
    no_points.put(at + 28, &0i32.to_le_bytes());
    let outcome = no_points.validate();
    assert_eq!(page_faults(&outcome), 1, "{:#?}", outcome.problems);
    assert!(broken(&outcome).contains(&Check::PointCount));
}

#[test]
fn the_header_counts_the_points_of_the_nodes() {
    let mut file = good();
    file.put(247, &6001u64.to_le_bytes());
    assert_only(&file.validate(), Check::PointCount, 1);
}

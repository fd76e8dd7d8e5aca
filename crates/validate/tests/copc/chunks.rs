//! Faults of chunks and the chunk table.

use pointmill_format::NodeKey;
use pointmill_validate::{Check, Finding};

use crate::file::{Writer, good};
use crate::support::{Cloud, Sampler, assert_only, broken};

#[test]
fn chunks_that_leave_the_points() {
    let file = good();
    let (leaf, at) = file.leaf();
    for offset in [100, file.table as u64, u64::MAX] {
        let mut file = file.clone();
        file.put(at + 16, &offset.to_le_bytes());
        let outcome = file.validate();
        assert_eq!(broken(&outcome), [Check::Chunks], "{offset}: {:#?}", outcome.problems);
        let about: Vec<_> = outcome.problems.iter().map(|p| p.node).collect();
        assert_eq!(about.iter().filter(|node| **node == Some(leaf.into())).count(), about.len() - 1, "{about:?}");
    }
}

#[test]
fn chunks_that_overlap_leave_gaps() {
    let mut file = good();
    let (leaf, at) = file.leaf();
    let (_, other) = file.entries.iter().rev().nth(1).unwrap();
    let place: Vec<u8> = file.bytes[other + 16..other + 32].to_vec();
    file.put(at + 16, &place);
    let outcome = file.validate();
    let subjects: Vec<_> = outcome.problems.iter().filter(|p| p.check == Check::Chunks).map(|p| &*p.subject).collect();
    assert!(subjects.contains(&"bytes of no node") && subjects.contains(&"start of the chunk"), "{subjects:?}");
    assert!(outcome.problems.iter().any(|p| p.node == Some(leaf.into())));
}

#[test]
fn bytes_between_the_chunks_and_the_table() {
    let mut file = good();
    let (leaf, at) = file.leaf();
    let size = file.u32(at + 24);
    file.put(at + 24, &(size - 1).to_le_bytes());
    let outcome = file.validate();
    // a byte of no node, another size than in the table, and in the chunk itself
    let found = [Check::Chunks, Check::Payloads].map(|check| outcome.check(check).unwrap().found);
    assert_eq!(found, [2, 1], "{leaf}: {:#?}", outcome.problems);
}

#[test]
fn a_table_in_another_order() {
    let writer = Writer { turns_table: true, ..Writer::default() };
    let outcome = writer.encode(&Cloud::new(Sampler::Poisson)).validate();
    assert_only(&outcome, Check::Chunks, 2);
}

#[test]
fn a_table_that_is_not_there_or_has_other_entries() {
    let file = good();
    let start = file.u32(96) as usize;
    for place in [0u64, u64::MAX, file.bytes.len() as u64] {
        let mut file = file.clone();
        file.put(start, &place.to_le_bytes());
        assert_only(&file.validate(), Check::Chunks, 1);
    }
    for (at, new) in [(0, 1u32), (4, 3), (4, 1000), (4, u32::MAX)] {
        let mut file = file.clone();
        file.put(file.table + at, &new.to_le_bytes());
        assert_only(&file.validate(), Check::Chunks, 1);
    }
}

#[test]
fn a_chunk_that_says_something_else_of_itself() {
    let mut file = good();
    let (leaf, at) = file.leaf();
    let chunk = file.u64(at + 16) as usize;
    let points = file.u32(chunk + 36);
    assert_eq!(points, file.u32(at + 28), "behind the first point");
    file.put(chunk + 36, &(points + 1).to_le_bytes());
    let outcome = file.validate();
    assert_eq!(outcome.check(Check::Payloads).unwrap().found, 1);
    assert_eq!(outcome.problems.iter().find(|p| p.check == Check::Payloads).unwrap().node, Some(leaf.into()));
}

#[test]
fn more_points_than_bytes_can_hold() {
    let mut file = good();
    let (leaf, at) = file.leaf();
    let chunk = file.u64(at + 16) as usize;
    let most = 2_000_000_000u32;
    file.put(at + 28, &most.to_le_bytes());
    file.put(chunk + 36, &most.to_le_bytes());
    let outcome = file.validate();
    let is_told = |p: &Finding| p.node == Some(leaf.into()) && p.subject == "points of the chunk";
    assert!(outcome.problems.iter().any(is_told), "{:#?}", outcome.problems);
}

#[test]
fn bytes_of_a_chunk_that_do_not_decode() {
    let mut file = good();
    let at = file.entries[&NodeKey::ROOT];
    let chunk = file.u64(at + 16) as usize;
    // the layer of x and y ends early: its bytes become those of the next
    let (first, second) = (file.u32(chunk + 40), file.u32(chunk + 44));
    file.put(chunk + 40, &8u32.to_le_bytes());
    file.put(chunk + 44, &(second + first - 8).to_le_bytes());
    let outcome = file.validate();
    assert_eq!(outcome.check(Check::Payloads).unwrap().found, 1, "{:#?}", outcome.problems);
    let found = outcome.problems.iter().find(|p| p.check == Check::Payloads).unwrap();
    assert_eq!(found.node, Some(NodeKey::ROOT.into()));
}

//! Bytes that lie: one error that says what is wrong, never a panic, never memory or work without end.

use pointmill_format::bytes::ByteSource;
use pointmill_format::copc::{Dataset, Entry, Info};
use pointmill_format::octree::OctreeNodes;
use pointmill_format::{ErrorKind, NodeKey, NodePoints, ReadError};
use pointmill_testkit::Random;
use pointmill_testkit::damage::{cuts, hit, peak_memory_bytes};

use crate::util::{FIXTURES, entry, entry_at, info, load, open, read_all, set_entry, set_info, walk};

/// Everything that a reader does with a file; the number of points.
fn read(bytes: &[u8]) -> Result<usize, ReadError> {
    let dataset = open(bytes)?;
    walk(&dataset)?;
    Ok(read_all(&dataset)?.iter().map(|(_, points)| points.len()).sum())
}

#[track_caller]
fn assert_fault(bytes: &[u8], part: &str) -> ReadError {
    let fault = read(bytes).expect_err("the fault is not found");
    let line = fault.to_string();
    assert!(line.contains(part) && !line.contains('\n'), "{line}");
    assert!(matches!(fault.kind(), ErrorKind::Broken), "{line}");
    fault
}

/// A golden file whose entry `index` of the hierarchy is changed.
fn with_entry(name: &str, index: usize, change: impl FnOnce(&mut Entry)) -> Vec<u8> {
    let mut bytes = load(name);
    let mut changed = entry(&bytes, index);
    change(&mut changed);
    set_entry(&mut bytes, index, &changed);
    bytes
}

fn with_info(change: impl FnOnce(&mut Info)) -> Vec<u8> {
    let mut bytes = load("pages");
    let mut changed = info(&bytes);
    change(&mut changed);
    set_info(&mut bytes, &changed);
    bytes
}

#[test]
fn damaged_files_give_points_or_an_error_within_bounded_memory() {
    let originals = FIXTURES.map(load);
    let (mut whole, mut refused) = (0, 0);
    for seed in 0..4_000 {
        let random = &mut Random::new(seed);
        let mut bytes = originals[random.index(originals.len())].clone();
        // one of two hits the hierarchy, which is at the end
        let start = if random.index(2) == 0 { entry_at(&bytes, 0) } else { 0 };
        let at = start + random.index(bytes.len() - start);
        hit(&mut bytes, at, random);
        match read(&bytes) {
            Ok(_) => whole += 1,
            Err(e) => {
                assert!(!e.to_string().contains('\n'), "seed {seed}: {e}");
                refused += 1;
            }
        }
    }
    assert!(whole > 300 && refused > 1500, "{whole} read, {refused} refused");
    if let Some(peak) = peak_memory_bytes() {
        assert!(peak < 400 << 20, "{peak} bytes");
    }
}

#[test]
fn a_file_that_was_cut_short_is_an_error_and_never_fewer_points() {
    for bytes in FIXTURES.map(load) {
        for cut in cuts(&bytes) {
            assert!(read(cut).is_err(), "{} of {} bytes", cut.len(), bytes.len());
        }
    }
}

#[test]
fn an_info_record_that_lies_is_told_with_its_byte() {
    for (field, fault, part) in [
        (0, with_info(|i| i.center[0] = f64::NAN), "the middle of the octree is [NaN"),
        (24, with_info(|i| i.half_size = -8.0), "the half size of the octree is -8, which makes no cube"),
        (24, with_info(|i| i.half_size = 1e-12), "which makes no cube"),
        (32, with_info(|i| i.spacing = 0.0), "the spacing of the root is 0, not a number greater than 0"),
    ] {
        assert_eq!(assert_fault(&fault, part).offset(), Some(Info::OFFSET + field), "{part}");
    }
    let len = load("pages").len() as u64;
    for (change, part) in [
        (with_info(|i| i.root_page_size = 0), "the hierarchy page of r has 0 bytes, not a multiple of 32"),
        (with_info(|i| i.root_page_size = 100), "has 100 bytes, not a multiple of 32"),
        (with_info(|i| i.root_page_size = 32 << 40), "bytes that are not in the file"),
        (with_info(|i| i.root_page_offset = len - 16), "bytes that are not in the file"),
        (with_info(|i| i.root_page_offset = u64::MAX - 8), "the hierarchy page of r has 8 bytes"),
        // text in place of entries
        (with_info(|i| i.root_page_offset = 591), "in an octree"),
    ] {
        assert_fault(&change, part);
    }
}

#[test]
fn a_file_that_is_no_copc_says_why() {
    let mut wrong = load("pages");
    wrong[377] = b'k';
    let fault = read(&wrong).unwrap_err();
    assert!(matches!(fault.kind(), ErrorKind::Unsupported) && fault.to_string().contains("no octree"), "{fault}");
    // the record of the extra bytes and the info record change places: the header says so
    let mut later = load("format6");
    let info: Vec<u8> = later.drain(375..589).collect();
    let laszip = 54 + usize::from(u16::from_le_bytes([later[375 + 20], later[375 + 21]]));
    later.splice(375 + laszip..375 + laszip, info);
    let fault = assert_fault(&later, "the info record of COPC has to be the first, with its data at byte 429");
    assert_eq!(fault.offset(), Some(429 + laszip as u64));
    let mut old = load("format6");
    old[25] = 3;
    assert!(read(&old).is_err());
}

#[test]
fn pages_that_go_round_in_circles_or_overlap_are_refused() {
    // entries of `pages`: r5, r, page of r0, r2 · page of r07, r0 · r075, r07, r0754
    let bytes = load("pages");
    let [root, r0, r07] = [0, 4, 6].map(|index| entry_at(&bytes, index) as u64);
    let lead = |offset: u64, size: i32| move |e: &mut Entry| (e.offset, e.byte_size) = (offset, size);
    // the page of r0 is that of the root; r07 is in the page that leads to it; in a part of that page; r0 in the page of r07
    for (index, offset, size, by_entries) in [
        (2, root, 128, "node r5 is in the hierarchy page of r0, and not below it"),
        (4, r0, 64, "node r0 is in the hierarchy page of r07, and not below it"),
        (4, r0 + 32, 128, "node r0 is in the hierarchy page of r07, and not below it"),
        (4, r07 - 64, 32, "the hierarchy page of r07 says that this node is in another page"),
    ] {
        let bytes = with_entry("pages", index, lead(offset, size));
        assert_fault(&bytes, by_entries);
        let fault = open(&bytes).unwrap().read_hierarchy().unwrap_err().to_string();
        assert!(fault.contains(" overlaps the one of r"), "{fault}");
    }
    // a page of its own root
    let own = with_entry("pages", 5, |e| (e.offset, e.byte_size, e.points) = (r07, 96, -1));
    assert_fault(&own, "the hierarchy page of r0 says that this node is in another page");
    for (offset, size, part) in [
        (bytes.len() as u64, 32, "the hierarchy page of node r0 is said to have 32 bytes that are not in the file"),
        (u64::MAX, 32, "not in the file"),
        (r0, 33, "node r0 is said to have a hierarchy page in 33 bytes"),
        (r0, 0, "a hierarchy page in 0 bytes"),
        (r0, -32, "a hierarchy page in -32 bytes"),
    ] {
        assert_fault(&with_entry("pages", 2, lead(offset, size)), part);
    }
}

#[test]
fn entries_that_make_no_tree_are_refused() {
    for (index, key, part) in [
        (0, [-1, 0, 0, 0], "there is no node -1-0-0-0 in an octree"),
        (0, [1, 2, 0, 0], "there is no node 1-2-0-0"),
        (0, [99, 0, 0, 0], "there is no node 99-0-0-0"),
        (0, [0, 0, 0, 0], "node r is twice in the hierarchy page of r"),
        (0, [2, 2, 0, 2], "node r50 is in the hierarchy, its parent is not"),
        (0, [2, 0, 0, 0], "node r00 is below a node that is in another hierarchy page"),
        (1, [1, 1, 1, 1], "the hierarchy page of r does not have that node"),
        (6, [1, 1, 0, 0], "node r4 is in the hierarchy page of r07, and not below it"),
    ] {
        assert_fault(&with_entry("pages", index, |e| e.key = key), part);
    }
}

#[test]
fn counts_and_sizes_that_lie_are_told() {
    for (points, size, part) in [
        (-2, 50, "node r5 is said to have -2 points in 50 bytes"),
        (0, 50, "node r5 is said to have 0 points in 50 bytes"),
        (3, 0, "3 points in 0 bytes"),
        (3, -1, "3 points in -1 bytes"),
        (3, i32::MAX, "the chunk of node r5 is said to have 2147483647 bytes that are not in the file"),
    ] {
        assert_fault(&with_entry("pages", 0, |e| (e.points, e.byte_size) = (points, size)), part);
    }
    // r2, whose chunk is the last
    let own = entry(&load("pages"), 3).byte_size;
    for (points, size) in [(2, own), (i32::MAX, own), (1, own - 1), (1, own + 1)] {
        let part =
            format!("node r2 should have {points} points in {size} bytes; its chunk says that it has 1 in {own}");
        assert_fault(&with_entry("pages", 3, |e| (e.points, e.byte_size) = (points, size)), &part);
    }
    assert_fault(&with_entry("pages", 0, |e| e.offset += 1), "r5");
    assert_fault(&with_entry("pages", 0, |e| e.offset = 400), "is said to begin at byte 400, before the points at");
    // the chunk of another node
    let root = entry(&load("pages"), 1);
    let same =
        with_entry("pages", 0, |e| (e.offset, e.byte_size, e.points) = (root.offset, root.byte_size, root.points));
    assert_fault(&same, "the chunks of nodes r");
}

#[test]
fn a_chunk_that_is_damaged_is_an_error_of_its_node_and_leaves_no_points() {
    let bytes = load("pages");
    let root = entry(&bytes, 1);
    let (mut refused, mut points) = (0, NodePoints::default());
    for at in 0..root.byte_size as usize {
        let mut damaged = bytes.clone();
        damaged[root.offset as usize + at] ^= 0x55;
        let dataset = open(&damaged).unwrap();
        let nodes = dataset.read_hierarchy().unwrap();
        let result = dataset.read_points(&nodes[0], &mut points);
        assert_eq!(points.len(), if result.is_ok() { 7 } else { 0 }, "byte {at}");
        assert!(points.columns().iter().all(|c| c.len().is_multiple_of(7) && c.is_empty() == points.is_empty()));
        if let Err(e) = result {
            let line = e.to_string();
            let place = e.offset().unwrap();
            assert!(line.contains("node r ") && place >= root.offset && place <= root.offset + 500, "{line}");
            refused += 1;
        }
        // the others are as they were
        dataset.read_points(&nodes[3], &mut points).unwrap();
        assert_eq!(points.len(), 3);
    }
    assert!(refused > 30, "{refused}");
}

#[test]
fn nodes_larger_than_allowed_are_refused_and_proxies_have_no_points() {
    let mut dataset = open(&load("pages")).unwrap();
    let nodes = dataset.read_root_page().unwrap();
    let mut points = NodePoints::default();
    let fault = dataset.read_points(nodes.iter().find(|n| n.is_proxy).unwrap(), &mut points).unwrap_err();
    assert!(fault.to_string().contains("the points of node r0 are known when its hierarchy page is read"), "{fault}");
    dataset.set_max_node_bytes(100);
    let fault = dataset.read_points(&nodes[0], &mut points).unwrap_err().to_string();
    assert!(fault.contains("node r would take") && fault.contains("100 are allowed"), "{fault}");
}

/// A file with a page of 2^40 bytes, of which all behind the first are zeros: a sparse file.
struct Sparse(Vec<u8>);

impl ByteSource for Sparse {
    fn read_at(&self, _: &str, offset: u64, buf: &mut [u8]) -> std::io::Result<()> {
        let start = usize::try_from(offset).unwrap().min(self.0.len());
        let there = &self.0[start..(start + buf.len()).min(self.0.len())];
        buf.fill(0);
        buf[..there.len()].copy_from_slice(there);
        Ok(())
    }

    fn size(&self, _: &str) -> std::io::Result<u64> {
        Ok(1 << 41)
    }

    fn locate(&self, file: &str) -> std::path::PathBuf {
        file.into()
    }
}

#[test]
fn a_page_without_end_is_refused_at_its_first_entry_that_cannot_be() {
    let bytes = with_info(|i| i.root_page_size = 1 << 40);
    let dataset = Dataset::from_source(Sparse(bytes), "a.copc.laz").unwrap();
    let fault = OctreeNodes::new(&dataset).unwrap_err().to_string();
    assert!(fault.contains("node r07 is twice") || fault.contains("is twice in the hierarchy page of r"), "{fault}");
    assert!(dataset.read_page(NodeKey::ROOT, 1 << 40, 1 << 40).is_err());
}

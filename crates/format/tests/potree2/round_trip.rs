//! What is written is read back, and does not depend on the order in which it was handed over.

use std::collections::{BTreeSet, HashSet};

use pointmill_format::bytes::Memory;
use pointmill_format::potree2::{
    BrotliScratch, CHUNK_RECORDS, Encoding, HierarchyBytes, Node, NodeEntry, encode_brotli, encode_hierarchy,
};
use pointmill_format::{NodeKey, NodePoints};
use pointmill_testkit::Random;

use crate::util::{attributes, memory, metadata, one_node, open};

/// Entries for `leaves` and all their ancestors, with different numbers, shuffled.
fn entries(leaves: impl IntoIterator<Item = NodeKey>, random: &mut Random) -> Vec<NodeEntry> {
    let ancestors = |leaf: NodeKey| std::iter::successors(Some(leaf), |key| key.parent());
    let keys: BTreeSet<NodeKey> = leaves.into_iter().flat_map(ancestors).chain([NodeKey::ROOT]).collect();
    let mut entries: Vec<NodeEntry> = keys
        .into_iter()
        .map(|key| NodeEntry::new(key, random.next_u64() as u32, random.next_u64(), random.next_u64()))
        .collect();
    shuffle(&mut entries, random);
    entries
}

fn shuffle<T>(items: &mut [T], random: &mut Random) {
    for i in (1..items.len()).rev() {
        items.swap(i, random.index(i + 1));
    }
}

fn name(name: &str) -> NodeKey {
    NodeKey::from_name(name).unwrap()
}

/// Encodes, reads back all nodes and checks everything that the format promises; returns what was read, and the bytes.
fn round_trip(entries: &mut [NodeEntry], most: u32) -> (Vec<Node>, Vec<u8>) {
    let encoded = encode_hierarchy(entries, most);
    let json = metadata(Encoding::Default, encoded.first_chunk_size, attributes()).to_json();
    let files = memory(json.into_bytes(), encoded.bytes.clone(), Vec::new());
    let dataset = open(&files).unwrap();
    let nodes = dataset.read_hierarchy().unwrap();

    let found: Vec<NodeEntry> = nodes.iter().map(NodeEntry::from).collect();
    assert_eq!(found, entries, "at most {most}"); // encode_hierarchy sorted them
    assert_eq!(encoded.depth, nodes.iter().map(|n| u32::from(n.key.level)).max().unwrap());
    let chunks = chunks(&encoded);
    assert_eq!(chunks.iter().sum::<usize>(), nodes.len() + chunks.len() - 1, "at most {most}: a record too many");
    // A root and its children are in one chunk however few are allowed.
    assert!(chunks.iter().all(|records| *records <= (most as usize).max(9)), "at most {most}: {chunks:?}");
    assert!(chunks[1..].iter().all(|records| *records > 1), "at most {most}: a leaf has a chunk: {chunks:?}");
    assert_eq!(chunks.len() == 1, nodes.len() <= most as usize || nodes.len() == chunks[0], "at most {most}");
    let keys: HashSet<NodeKey> = nodes.iter().map(|n| n.key).collect();
    for Node { key, record, .. } in &nodes {
        let mask = (0..8).filter(|c| key.child(*c).is_some_and(|child| keys.contains(&child)));
        assert_eq!(record.child_mask, mask.fold(0, |m, c| m | 1 << c), "{key}");
        assert_eq!(record.node_type, u8::from(record.child_mask == 0), "{key}");
    }
    (nodes, encoded.bytes)
}

/// Records of the chunks, the root's first; they fill the file without gaps.
fn chunks(encoded: &HierarchyBytes) -> Vec<usize> {
    let field = |r: &[u8], at: usize| u64::from_le_bytes(r[at..at + 8].try_into().unwrap()) as usize;
    let proxies = encoded.bytes.chunks_exact(22).filter(|r| r[0] == 2).map(|r| (field(r, 6), field(r, 14)));
    let mut places: Vec<(usize, usize)> = proxies.chain([(0, encoded.first_chunk_size as usize)]).collect();
    places.sort_unstable();
    let end = places.iter().fold(0, |end, (at, size)| {
        assert_eq!(*at, end);
        at + size
    });
    assert_eq!(end, encoded.bytes.len());
    places.iter().map(|(_, size)| size / 22).collect()
}

/// The full tree of `children` children a node and `levels` levels below the root.
fn full_tree(children: u8, levels: u32) -> Vec<NodeEntry> {
    let mut row = vec![NodeKey::ROOT];
    let mut keys = row.clone();
    for _ in 0..levels {
        row = row.iter().flat_map(|key| (0..children).map(|c| key.child(c).unwrap())).collect();
        keys.extend(&row);
    }
    keys.into_iter().map(|key| NodeEntry::new(key, 1, 0, 0)).collect()
}

#[test]
fn a_root_alone_is_one_leaf() {
    let (nodes, bytes) = round_trip(&mut entries([], &mut Random::new(1)), 4);
    assert_eq!((nodes.len(), bytes.len()), (1, 22));
}

#[test]
fn chains_down_to_the_deepest_level_come_back_whatever_a_chunk_may_hold() {
    for digit in ["0", "7"] {
        let leaf = name(&format!("r{}", digit.repeat(31)));
        for most in [0, 1, 2, 4, 5, 30, 31, 32, u32::MAX] {
            let (nodes, _) = round_trip(&mut entries([leaf], &mut Random::new(2)), most);
            assert_eq!(nodes.len(), 32);
        }
    }
}

#[test]
fn a_chunk_has_whole_levels_and_then_the_smallest_subtrees_that_fit() {
    let leaves = ["r0000", "r0001", "r00020", "r7777", "r77777777", "r4"].map(name);
    let mut entries = entries(leaves, &mut Random::new(3));
    let types = |bytes: &[u8]| -> Vec<u8> { bytes.chunks_exact(22).map(|r| r[0]).collect() };
    // r · r0* r4 r7*, then r0 r00 r000 r0000 r0001 r0002 r00020 and r7 r77 … r77777777
    assert_eq!(types(&round_trip(&mut entries, 9).1), [0, 2, 1, 2, 0, 0, 0, 1, 1, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1]);
    // r0 has seven nodes, r7 eight: one of them fits behind the four of the first two levels.
    let (_, bytes) = round_trip(&mut entries, 10);
    assert_eq!(
        types(&bytes)[..10],
        [0, 0, 1, 2, 0, 0, 1, 1, 0, 1],
        "r · r0 r4 r7* · r00 · r000 · r0000 r0001 r0002 · r00020"
    );
    assert_eq!(round_trip(&mut entries, 16).1.len(), 22 * 18, "one less than all nodes");
    assert_eq!(round_trip(&mut entries, 17).1.len(), 22 * 17);
}

#[test]
fn what_a_client_takes_at_once_is_one_chunk_and_a_larger_tree_fills_its_first_chunk() {
    let mut tree = full_tree(8, 4);
    assert_eq!(chunks(&encode_hierarchy(&mut tree, CHUNK_RECORDS)), [4681]);
    tree.push(NodeEntry::new(name("r00000"), 1, 0, 0));
    let divided = chunks(&encode_hierarchy(&mut tree, CHUNK_RECORDS));
    // Three levels are 585 records; of the 512 subtrees of 9 nodes, one of 10, the 512 that cost 8 fill up to 4,681.
    assert_eq!(divided, [4673, 10]);

    // Five levels are 1,365 records; 165 of their 1,024 subtrees of 21 nodes fit as well.
    let surface = chunks(&encode_hierarchy(&mut full_tree(4, 7), CHUNK_RECORDS));
    assert_eq!((surface[0], surface.len()), (1365 + 165 * 20, 1 + 1024 - 165));
    assert!(surface[1..].iter().all(|records| *records == 21));
}

#[test]
fn random_trees_come_back_and_their_bytes_do_not_depend_on_order() {
    for seed in 0..30 {
        let random = &mut Random::new(seed);
        let count = 1 + random.index(300);
        let deepest = 1 + random.index(31);
        let leaf = |random: &mut Random| {
            let level = 1 + random.index(deepest);
            // Few digits near the root, so that paths share ancestors.
            let digits = |l| if l < 6 { random.index(2) } else { random.index(8) };
            (0..level).map(digits).fold(NodeKey::ROOT, |key, d| key.child(d as u8).unwrap())
        };
        let leaves: Vec<NodeKey> = (0..count).map(|_| leaf(random)).collect();
        let mut entries = entries(leaves, random);
        for most in [1, 10, 33, 200, 1000] {
            let (_, bytes) = round_trip(&mut entries, most);
            shuffle(&mut entries, random);
            assert_eq!(bytes, encode_hierarchy(&mut entries, most).bytes, "seed {seed}");
        }
    }
}

#[test]
fn ancestors_that_are_missing_are_added_without_points() {
    let entry = |key| NodeEntry::new(key, 5, 7, 9);
    let encoded = encode_hierarchy(&mut [entry(name("r12")), entry(name("r7"))], 4);
    let points: Vec<(u8, u8)> = encoded.bytes.chunks_exact(22).map(|r| (r[1], r[2])).collect();
    assert_eq!(points, [(0b1000_0010, 0), (0b100, 0), (0, 5), (0, 5)]); // r, r1, r7, r12: mask, points
    assert_eq!(encode_hierarchy(&mut [], 4).bytes.len(), 22);
}

/// DEFAULT records with pseudo-random bytes; every fourth position is one of few, so that positions repeat, and every
/// eighth record is one of few.
fn records(points: usize, random: &mut Random) -> Vec<u8> {
    let record_len: usize = attributes().iter().map(|a| a.size()).sum();
    let mut bytes = Vec::new();
    for _ in 0..points {
        let kind = random.index(8);
        let mut few = Random::new(random.index(3) as u64);
        let (position, rest) = (kind < 2, kind < 1);
        for at in 0..record_len {
            let repeat = if at < 12 { position } else { rest };
            bytes.push(if repeat { few.next_u64() } else { random.next_u64() } as u8);
        }
    }
    bytes
}

fn read(files: &Memory) -> NodePoints {
    let dataset = open(files).unwrap();
    let mut points = NodePoints::default();
    dataset.read_points(&dataset.read_hierarchy().unwrap()[0], &mut points).unwrap();
    points
}

#[test]
fn brotli_payloads_hold_the_same_points_as_default_ones_in_morton_order() {
    let mut scratch = BrotliScratch::default();
    for seed in 0..40 {
        let random = &mut Random::new(seed);
        let count = random.index(2000);
        let bytes = records(count, random);
        let record_len = bytes.len().checked_div(count).unwrap_or(1);

        let mut payload = Vec::new();
        encode_brotli(&attributes(), &bytes, (seed % 7) as u8, &mut scratch, &mut payload).unwrap();
        let brotli = read(&one_node(Encoding::Brotli, attributes(), count as u32, payload.clone()));

        // The same order, worked out bit by bit.
        let mut sorted: Vec<&[u8]> = bytes.chunks_exact(record_len).collect();
        sorted.sort_by_key(|r| (morton_bit_by_bit(r), r.to_vec()));
        let default = read(&one_node(Encoding::Default, attributes(), count as u32, sorted.concat()));
        assert_eq!(brotli.positions(), default.positions(), "seed {seed}");
        assert_eq!(debug_columns(&brotli), debug_columns(&default), "seed {seed}");

        shuffle(&mut sorted, random);
        let mut again = b"before".to_vec();
        encode_brotli(&attributes(), &sorted.concat(), (seed % 7) as u8, &mut scratch, &mut again).unwrap();
        assert_eq!(again, [b"before", &payload[..]].concat(), "seed {seed}: the order of the records shows");
    }
}

/// NaN is among the random numbers, so columns are compared by what they print.
fn debug_columns(points: &NodePoints) -> String {
    format!("{:?}", points.columns())
}

/// The 96-bit code of a record's position: bit k of x at 3k, of y at 3k+1, of z at 3k+2.
fn morton_bit_by_bit(record: &[u8]) -> u128 {
    let axis = |a: usize| u32::from_le_bytes(record[4 * a..4 * a + 4].try_into().unwrap());
    let bit = |a: usize, k: usize| u128::from(axis(a) >> k & 1) << (3 * k + a);
    (0..32).flat_map(|k| (0..3).map(move |a| bit(a, k))).sum()
}

#[test]
fn attributes_and_lengths_that_cannot_be_encoded_are_refused() {
    let encode = |attributes: &[_], records: &[u8], quality| {
        encode_brotli(attributes, records, quality, &mut BrotliScratch::default(), &mut Vec::new())
            .map_err(|e| e.to_string())
    };
    let all = attributes();
    assert!(encode(&all, &[], 4).is_ok());
    assert!(encode(&all[1..], &[], 4).is_err(), "no position");
    assert!(encode(&[], &[], 4).is_err(), "no attributes");
    assert!(encode(&all, &[0; 13], 4).is_err(), "half a record");
    assert!(encode(&all, &[], 12).is_err(), "quality");
}

//! Bytes that lie: an error that says what is wrong, never a panic, never memory without end.

use pointmill_format::bintree::{Bintree, Layout};
use pointmill_format::bytes::Memory;
use pointmill_testkit::Random;
use pointmill_testkit::damage::{hit, peak_memory_bytes};

use crate::exercise::exercise;
use crate::util::{FAR, corridor, files_of, golden, load, open, read_all};

#[track_caller]
fn assert_fault(files: &Memory, part: &str) {
    let fault = match open(files) {
        Err(e) => e.to_string(),
        Ok(tree) => read_all(&tree).expect_err("the fault is not found").to_string(),
    };
    assert!(fault.contains(part) && !fault.contains('\n'), "{fault}");
    assert!(fault.starts_with("memory/"), "no place: {fault}");
}

/// The golden dataset with a part of its index replaced, once.
#[track_caller]
fn with(layout: &str, from: &str, to: &str) -> Memory {
    let mut files = load(layout);
    let text = String::from_utf8(files["index.json"].clone()).unwrap();
    assert!(text.contains(from), "{from}");
    files.insert("index.json".into(), text.replacen(from, to, 1).into_bytes());
    files
}

#[test]
fn header_faults_are_told_by_name_and_byte() {
    let faults = [
        ("\"pointmill-bintree\"", "\"potree\"", "the format is \"potree\""),
        ("\"format\"", "\"fmt\"", "the key format is missing"),
        ("\"version\": 1", "\"version\": 2", "the version is 2"),
        ("\"points\": 17", "\"points\": 18", "points is 18, the nodes have 17 (byte "),
        ("\"points\": 17", "\"points\": -1", "points is -1, it has to be a whole number"),
        ("\"points\": 17,", "", "the key points is missing"),
        ("\"points\": 17", "\"points\": 17, \"points\": 17", "the key points stands there twice"),
        ("\"capacity\": 3", "\"capacity\": 0", "capacity is 0"),
        ("\"layout\": \"files\"", "\"layout\": \"file\"", "layout is \"file\""),
        ("\"layout\": \"files\"", "\"layout\": \"packed\"", "a leaf has a file instead of a start"),
        ("\"split\": \"mean\"", "\"split\": 7", "split is 7, it has to be a string"),
        ("\"scale\":[0.001,", "\"scale\":[0,", "lattice is"),
        ("\"scale\":[0.001,", "\"scale\":[1e999,", "lattice is"),
        ("\"stride\": 40", "\"stride\": 39", "the stride 39"),
        ("\"stride\": 40", "\"stride\": 36", "the stride 36"),
        ("\"stride\": 40", "\"stride\": 18446744073709551615", "the stride 18446744073709551615"),
        ("\"offset\":22", "\"offset\":20", "\"intensity\" is at byte 20"),
        ("\"offset\":22", "\"offset\":23", "\"intensity\" is at byte 23"),
        ("\"elements\":3", "\"elements\":4294967295", "\"rgb\" has 4294967295 elements"),
        ("\"type\":\"double\"", "\"type\":\"half\"", "the type \"half\""),
        ("\"type\":\"float\"", "\"type\":\"double\"", "the first four attributes"),
        ("\"name\":\"intensity\"", "\"name\":\"rgb\"", "two attributes are named \"rgb\""),
        ("\"shift\":[-10.0]", "\"shift\":[]", "its shift has not"),
        ("\"pointmill\": {", "\"pointmill\": [{", "expected"),
    ];
    for (from, to, expected) in faults {
        assert_fault(&with("files", from, to), expected);
    }
}

#[test]
fn node_faults_are_told_by_number_and_byte() {
    let faults = [
        ("\"children\":[1,10]", "\"children\":[1,1]", "node 0 has a high child 1"),
        ("\"children\":[1,10]", "\"children\":[0,10]", "node 0 has the low child 0"),
        ("\"children\":[1,10]", "\"children\":[1,9]", "node 10 stands where the high child 9"),
        ("\"children\":[1,10]", "\"children\":[1,4294967295]", "node 10 stands where the high child 4294967295"),
        ("\"children\":[1,10]", "\"children\":[1,4294967296]", "above 32 bits"),
        ("\"children\":[1,10]", "\"children\":[10,1]", "node 0 has"),
        ("\"children\":[12,13]", "\"children\":[12,10]", "node 11 has a high child 10"),
        ("\"children\":[1,10]", "\"children\":[1]", "expected ','"),
        ("\"count\":17", "\"count\":16", "its parent's count leaves 6"),
        ("\"count\":10", "\"count\":17", "node 1 has 17 points"),
        ("\"count\":1,", "\"count\":0,", "node 5 has no points"),
        ("\"count\":1,", "\"count\":1.5,", "expected a whole number"),
        ("\"count\":1,", "", "node 5 has no count"),
        ("\"min\":[997.0,", "\"min\":[1e400,", "beyond the range"),
        ("\"min\":[997.0,", "\"min\":[1009.0,", "node 0 has a box with min"),
        ("\"min\":[997.0,", "\"min\":[", "expected ','"),
        ("\"axis\":0", "\"axis\":3", "axis has to be"),
        ("\"axis\":0", "\"axis\":-1", "node 0 has axis -1, but is not degenerate"),
        ("\"axis\":-1", "\"axis\":1", "node 11 is degenerate, but has an axis"),
        ("\"degenerate\":true", "\"degenerate\":false", "node 11 has axis -1, but is not degenerate"),
        ("\"split\":1002.346,", "", "node 0 has no split"),
        ("\"file\":\"n00.bin\"", "\"file\":\"../n00.bin\"", "its place in the tree has the name n00.bin"),
        ("\"file\":\"n00.bin\"", "\"file\":\"/etc/passwd\"", "is in the file \"/etc/passwd\""),
        ("\"file\":\"n0100.bin\"", "\"file\":\"n00.bin\"", "node 5 is in the file \"n00.bin\""),
        ("\"file\":\"n00.bin\"", "\"file\":\"a\\nb\"", "is in the file \"a\\nb\""),
        ("\"file\":\"n00.bin\"", "\"start\":0", "a leaf has a start instead of a file"),
        ("\"file\":\"n00.bin\"", "\"axis\":0", "node 2 has to have children, or either a file or a start"),
        ("\"file\":\"n00.bin\"", "\"file\":\"n00.bin\",\"children\":[3,4]", "node 2 has children and points"),
        ("\"count\":3", "\"count\":3,\"count\":3", "stands twice"),
        ("\t]\n}", "", "the text ends too early"),
        ("\t]\n}", "\t]\n} 1", "text behind the end"),
        ("\"nodes\": [", "\"root\": null, \"nodes\": [", "the nodes stand there twice"),
    ];
    for (from, to, expected) in faults {
        assert_fault(&with("files", from, to), expected);
    }
    let byte = "{\"min\":[997.0,1999.9929999998099,-6.0]";
    let at = String::from_utf8(load("files")["index.json"].clone()).unwrap().find(byte).unwrap();
    assert_fault(&with("files", "\"count\":10", "\"count\":17"), &format!("(byte {at})"));
}

#[test]
fn unknown_keys_and_other_orders_are_tolerated() {
    let text = String::from_utf8(load("packed")["index.json"].clone()).unwrap();
    let (header, nodes) = text.split_once("\t\"nodes\"").unwrap();
    let nodes = format!("\"nodes\"{}", nodes.trim_end().strip_suffix('}').unwrap().trim_end());
    let extra = "\"note\": {\"a\": [1, {\"b\": null}]}";
    let header = header.trim().strip_prefix('{').unwrap().trim().trim_end_matches(',');
    let mut files = load("packed");
    let other = format!("\u{feff}{{{nodes}, {extra}, {header}}}").replace("\"count\"", "\"lod\": [0], \"count\"");
    files.insert("index.json".into(), other.into_bytes());
    assert_eq!(open(&files).unwrap().nodes(), open(&load("packed")).unwrap().nodes());
    let bare = with("packed", "\"lattice\": {\"scale\":[0.001,0.001,0.01],\"offset\":[1000.0,2000.0,-5.0]},", "");
    assert_eq!(open(&bare).unwrap().header().lattice.scale, [1.0; 3]);
}

#[test]
fn leaves_that_are_short_long_or_missing_are_named_with_their_file() {
    for (change, expected) in [(39, "has 39"), (41, "has 41"), (0, "has 0")] {
        let mut files = load("files");
        files.get_mut("n0100.bin").unwrap().resize(change, 0);
        assert_fault(&files, "memory/n0100.bin: leaf 5 has 1 points of 40 bytes, 40, but the file");
        assert_fault(&files, expected);
    }
    let mut files = load("files");
    files.remove("n101.bin");
    assert_fault(&files, "memory/n101.bin: is missing");
    files = load("packed");
    files.remove("leaves.bin");
    assert_fault(&files, "memory/leaves.bin: is missing");
    files.remove("index.json");
    assert_fault(&files, "memory/index.json: reading");
}

#[test]
fn ranges_that_leave_the_file_or_overlap_are_refused_before_they_are_read() {
    let mut files = load("packed");
    files.get_mut("leaves.bin").unwrap().pop();
    assert_fault(&files, "leaf 14 has 2 points from byte 600 on, but the file has 679 bytes (byte 600)");
    for start in [640, 680, u64::MAX, u64::MAX - 79] {
        assert_fault(&with("packed", "\"start\":600", &format!("\"start\":{start}")), "leaf 14 has 2 points from byte");
    }
    assert_fault(
        &with("packed", "\"start\":160", "\"start\":159"),
        "the points of leaf 7 begin before those of leaf 5",
    );
    assert_fault(&with("packed", "\"start\":160", "\"start\":120"), "begin before");
    let mut gap = with("packed", "\"start\":600", "\"start\":640");
    gap.get_mut("leaves.bin").unwrap().resize(720, 0);
    assert!(read_all(&open(&gap).unwrap()).is_ok(), "gaps are the validator's");
}

#[test]
fn counts_beyond_the_files_ask_for_no_memory() {
    let huge = u64::MAX;
    for layout in ["files", "packed"] {
        let mut files = load(layout);
        let place = if layout == "files" { "\"file\":\"n.bin\"" } else { "\"start\":0" };
        let node = format!("{{\"min\":[0,0,0],\"max\":[1,1,1],\"count\":{huge},\"center\":[0,0,0],{place}}}");
        let text = String::from_utf8(files["index.json"].clone()).unwrap();
        let (header, _) = text.split_once("\t\"nodes\"").unwrap();
        let header = header.replace("\"points\": 17", &format!("\"points\": {huge}"));
        files.insert("index.json".into(), format!("{header}\"nodes\":[{node}]}}").into_bytes());
        files.insert("n.bin".into(), vec![0; 40]);
        assert_fault(&files, &format!("{huge} points"));
    }
}

/// A chain of `depth` inner nodes in nested form.
fn nested_chain(depth: usize) -> Memory {
    let mut files = load("packed");
    let text = String::from_utf8(files["index.json"].clone()).unwrap();
    let (header, _) = text.split_once("\t\"nodes\"").unwrap();
    let header = header.replace("\"points\": 17", &format!("\"points\": {}", depth + 1));
    let bounds = "\"min\":[0,0,0],\"max\":[1,1,1]";
    let leaf = |i: usize| format!("{{{bounds},\"count\":1,\"center\":[0,0,0],\"start\":{}}}", 40 * i);
    let mut json = format!("{header}\"root\":");
    for i in 0..depth {
        json += &format!("{{{bounds},\"count\":{},\"axis\":0,\"split\":0,\"children\":[{},", depth + 1 - i, leaf(i));
    }
    json += &leaf(depth);
    json += &"]}".repeat(depth);
    json.push('}');
    files.insert("index.json".into(), json.into_bytes());
    files.insert("leaves.bin".into(), vec![0; 40 * (depth + 1)]);
    files
}

#[test]
fn depth_is_followed_to_512_and_refused_beyond_in_both_forms() {
    let tree = open(&nested_chain(512)).unwrap();
    assert_eq!(tree.nodes().len(), 1025);
    assert_eq!(tree.path(1024).len(), 512);
    assert_eq!(read_all(&tree).unwrap().len(), 513);
    assert_fault(&nested_chain(513), "nested more than 512 deep");
    assert_fault(&nested_chain(100_000), "nested more than 512 deep");
    assert_fault(&with("packed", "\"name\":", &format!("\"a\": {}1", "[".repeat(1_000_000))), "nested more than 512");
}

#[test]
fn nested_nodes_have_two_children() {
    let nested = std::fs::read_to_string(golden("nested").join("index.json")).unwrap();
    let mut files = load("packed");
    for (from, to, expected) in [
        ("\"children\": [", "\"children\": [], \"x\": [", "a node has 0 children"),
        ("\"children\": [", "\"children\": [1, ", "expected '{'"),
        ("\"root\"", "\"root\": null, \"other\"", "points is 17, the nodes have 0"),
        ("\"children\": [", "\"children\": [{}, {}, {}, ", "has more than 2 children"),
    ] {
        assert!(nested.contains(from));
        files.insert("index.json".into(), nested.replacen(from, to, 1).into_bytes());
        assert_fault(&files, expected);
    }
}

#[test]
fn an_index_that_ends_anywhere_is_refused() {
    for layout in ["files", "packed", "nested"] {
        let index = std::fs::read(golden(layout).join("index.json")).unwrap();
        let leaves = load("packed")["leaves.bin"].clone();
        for end in 0..index.len() - 2 {
            let fault = exercise(&index[..end], &leaves).unwrap_err().to_string();
            assert!(fault.contains("byte"), "{end}: {fault}");
        }
    }
}

#[test]
fn damaged_files_give_points_or_an_error_within_bounded_memory() {
    let index = |layout: &str| std::fs::read(golden(layout).join("index.json")).unwrap();
    let golden_leaves = load("packed")["leaves.bin"].clone();
    let big = files_of(&mut corridor(500, 50_000.0, 1), 100, Layout::Packed, FAR);
    let originals = [
        (index("files"), golden_leaves.clone()),
        (index("packed"), golden_leaves.clone()),
        (index("nested"), golden_leaves),
        (big["index.json"].clone(), big["leaves.bin"].clone()),
    ];
    let (mut read, mut refused) = (0, 0);
    for seed in 0..4000 {
        let random = &mut Random::new(seed);
        let (mut index, mut leaves) = originals[random.index(4)].clone();
        let file = if random.index(4) == 0 { &mut leaves } else { &mut index };
        hit(file, random.index(file.len()), random);
        match exercise(&index, &leaves) {
            Ok(_) => read += 1,
            Err(e) => {
                assert!(!e.to_string().contains('\n'), "seed {seed}: {e}");
                refused += 1;
            }
        }
    }
    assert!(read > 500 && refused > 1000, "{read} read, {refused} refused");
    if let Some(peak) = peak_memory_bytes() {
        assert!(peak < 400 << 20, "{peak} bytes");
    }
}

#[test]
fn leaves_of_any_bytes_are_read_and_picked_from() {
    let random = &mut Random::new(9);
    let index = load("packed")["index.json"].clone();
    for _ in 0..300 {
        let bytes: Vec<u8> = (0..85).flat_map(|_| random.next_u64().to_le_bytes()).collect();
        assert_eq!(exercise(&index, &bytes).unwrap(), 17);
    }
}

#[test]
fn more_nodes_than_fit_are_refused_with_what_to_do() {
    for layout in ["files", "nested"] {
        let mut files = load(if layout == "nested" { "packed" } else { layout });
        files.insert("index.json".into(), std::fs::read(golden(layout).join("index.json")).unwrap());
        let nodes = open(&files).unwrap().nodes().len();
        let within = |most| Bintree::from_source_within(files.clone(), most).map(|tree| tree.nodes().len());
        let enough = if layout == "nested" { 3 * nodes } else { nodes };
        assert_eq!(within(enough).unwrap(), nodes);
        let fault = within(nodes - 1).unwrap_err();
        assert_eq!(fault.advice(), Some(&pointmill_format::Advice::MoreMemory), "{fault}");
    }
}

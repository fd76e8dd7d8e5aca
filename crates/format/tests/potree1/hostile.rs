//! Bytes that lie: an error that says what is wrong, never a panic, never memory without end.

use pointmill_format::bytes::Memory;
use pointmill_format::octree::{Octree, OctreeNodes};
use pointmill_format::potree1::{Dataset, METADATA_FILE, Metadata};
use pointmill_format::{ErrorKind, NodeKey, NodePoints, Positions, ReadError};
use pointmill_testkit::Random;
use pointmill_testkit::damage::{hit, peak_memory_bytes};

use crate::util::{golden, load, open};

/// Everything that a reader does with a dataset; the number of points.
fn read_all(files: &Memory) -> Result<usize, ReadError> {
    let dataset = open(files)?;
    walk(&dataset)?;
    let (mut points, mut count, mut fault) = (NodePoints::default(), 0, None);
    for node in dataset.read_hierarchy()? {
        match dataset.read_points(node.key, &mut points) {
            Ok(()) => count += points.len(),
            Err(e) => fault = Some(e),
        }
    }
    fault.map_or(Ok(count), Err)
}

fn walk(octree: &dyn Octree) -> Result<(), ReadError> {
    let mut tree = OctreeNodes::new(octree)?;
    let mut stack = vec![NodeKey::ROOT];
    while let Some(key) = stack.pop() {
        tree.load(octree, key)?;
        stack.extend(tree.children(key).map(|n| n.key));
    }
    Ok(())
}

#[track_caller]
fn assert_fault(files: &Memory, part: &str) {
    let fault = read_all(files).expect_err("the fault is not found").to_string();
    assert!(fault.contains(part) && !fault.contains('\n'), "{fault}");
}

/// The golden dataset with a file changed.
fn with(layout: &str, file: &str, change: impl FnOnce(&mut Vec<u8>)) -> Memory {
    let mut files = load(&golden(layout));
    change(files.get_mut(file).unwrap());
    files
}

/// The golden dataset with a part of its metadata replaced, all over.
fn with_text(layout: &str, part: &str, other: &str) -> Memory {
    with(layout, METADATA_FILE, |bytes| {
        let text = String::from_utf8(bytes.clone()).unwrap();
        assert!(text.contains(part), "{part}");
        *bytes = text.replace(part, other).into_bytes();
    })
}

#[test]
fn damaged_files_give_points_or_an_error_within_bounded_memory() {
    let originals = ["words", "objects", "flat"].map(|layout| load(&golden(layout)));
    let (mut read, mut refused) = (0, 0);
    for seed in 0..4_000 {
        let random = &mut Random::new(seed);
        let mut files = originals[random.index(originals.len())].clone();
        let names: Vec<String> = files.keys().cloned().collect();
        // one of two hits the metadata
        let name = if random.index(2) == 0 { METADATA_FILE } else { names[random.index(names.len())].as_str() };
        let file = files.get_mut(name).unwrap();
        hit(file, random.index(file.len()), random);
        match read_all(&files) {
            Ok(_) => read += 1,
            Err(e) => {
                assert!(!e.to_string().contains('\n'), "seed {seed}: {e}");
                refused += 1;
            }
        }
    }
    assert!(read > 500 && refused > 500, "{read} read, {refused} refused");
    if let Some(peak) = peak_memory_bytes() {
        assert!(peak < 400 << 20, "{peak} bytes");
    }
}

#[test]
fn a_folder_of_nodes_outside_of_the_dataset_is_not_looked_at() {
    for dir in ["..", "../data", "data/../../x", "/data", "http://host/data", "C:/data", "a\\\\..\\\\b", "", "."] {
        let files = with_text("words", "\"data\"", &format!("\"{dir}\""));
        assert_fault(&files, "not a folder beside cloud.js");
    }
    for dir in ["data/", "./data"] {
        assert_eq!(read_all(&with_text("words", "\"data\"", &format!("\"{dir}\""))).unwrap(), 13, "{dir}");
    }
}

#[test]
fn metadata_that_nobody_can_mean_is_told() {
    for (layout, part, other, fault) in [
        ("words", "\"1.7\"", "\"1.3\"", "version \"1.3\"; 1.4 to 1.8 are those that are read"),
        ("words", "\"1.7\"", "\"2.0\"", "version \"2.0\""),
        ("words", "\"1.7\"", "1.7", "version is 1.7, not a string"),
        ("words", "\"COLOR_PACKED\"", "\"COLOUR\"", "the attribute \"COLOUR\", of which it is not known"),
        ("words", "\"COLOR_PACKED\"", "\"POSITION_CARTESIAN\"", "2 times POSITION_CARTESIAN"),
        ("words", "\"POSITION_CARTESIAN\"", "\"RGB_PACKED\"", "0 times POSITION_CARTESIAN"),
        ("flat", "\"FILLER_1B\"", "\"RGBA_PACKED\"", "two of pointAttributes are \"rgb\""),
        ("words", "\"scale\": 0.001", "\"scale\": 0", "scale is 0, not one number greater than 0"),
        ("words", "\"scale\": 0.001", "\"scale\": [1, 1, 2]", "scale is [1,1,2], not one number"),
        ("words", "\"lx\": 1000.0", "\"lx\": 2000.0", "above its max"),
        ("words", "\"boundingBox\"", "\"box\"", "boundingBox is missing"),
        ("words", "\"hierarchyStepSize\": 2", "\"hierarchyStepSize\": 0", "hierarchyStepSize is 0"),
        ("words", "\"spacing\": 0.128", "\"spacing\": -1", "spacing -1 has to be greater"),
        ("flat", "\"hierarchy\"", "\"nodes\"", "version 1.4 keeps its nodes in hierarchy, which is missing"),
        ("flat", "\"r000\"", "\"r008\"", "hierarchy[4] is not the name of a node and its points"),
        ("flat", "\"r000\"", "\"r111\"", "hierarchy has node r111, but not its parent"),
        ("flat", "\"r000\"", "\"r00\"", "hierarchy has a node twice"),
        ("flat", "\"r\"", "\"r1\"", "hierarchy lacks the root"),
        ("objects", "\"size\": 12", "\"size\": 13", "its size is 12, not 13"),
        ("objects", "\"type\": \"int32\"", "\"type\": \"uint32\"", "\"POSITION_CARTESIAN\" as uint32 x 3"),
        ("objects", "\"type\": \"int32\"", "\"type\": \"void\"", "has the type \"void\""),
        ("flat", "\"version\"", "\"version\", inf", "is not valid JSON"),
    ] {
        assert_fault(&with_text(layout, part, other), fault);
    }
    let unsupported = open(&with_text("words", "\"1.7\"", "\"1.3\"")).unwrap_err();
    assert!(matches!(unsupported.kind(), ErrorKind::Unsupported));
}

#[test]
fn metadata_that_others_read_is_read() {
    for (part, other) in [
        ("\"scale\": 0.001", "\"scale\": [0.001, 0.001, 0.001]"),
        ("\"projection\": \"\"", "\"projection\": null"),
        ("\"points\": 13,", "/* \"points\": 13, */ \"more\": [1,],"),
        ("\"spacing\": 0.128", "\"spacing\": 0"),
    ] {
        assert_eq!(read_all(&with_text("words", part, other)).unwrap(), 13, "{other}");
    }
    let files = with_text("words", "\"spacing\": 0.128,", "");
    assert!((open(&files).unwrap().metadata().spacing - 16.384 / 200.0).abs() < 1e-9);
}

#[test]
fn version_1_5_takes_its_list_where_there_is_no_index() {
    let mut files = with_text("flat", "\"1.4\"", "\"1.5\"");
    for (name, bytes) in load(&golden("words")) {
        if name.ends_with(".bin") {
            let node = name.rsplit('/').next().unwrap();
            assert!(files.remove(&format!("data/{node}")).is_some());
            // records of 18 bytes in place of 16
            let (records, _) = bytes.as_chunks::<16>();
            let wide = records.iter().flat_map(|record| [record.as_slice(), &[0, 0]].concat()).collect();
            let folder = if node.len() > 9 { "data/r/00007/" } else { "data/r/" };
            files.insert(format!("{folder}{node}"), wide);
        }
    }
    assert_eq!(read_all(&files).unwrap(), 13);
}

#[test]
fn an_index_that_is_no_tree_is_told_where() {
    let root = "data/r/r.hrc";
    for (change, fault) in [
        (
            &(|b: &mut Vec<u8>| b.truncate(15)) as &dyn Fn(&mut Vec<u8>),
            "the index of r ends before the record of r00 (byte 15)",
        ),
        (&|b: &mut Vec<u8>| b.truncate(18), "the index of r has 18 bytes, not a multiple of 5"),
        (&|b: &mut Vec<u8>| b.clear(), "the index of r has 0 bytes"),
        (&|b: &mut Vec<u8>| b.extend([0; 5]), "the index of r goes on after the 4 nodes of its masks (byte 20)"),
        (&|b: &mut Vec<u8>| b[0] = 0x80, "goes on after the 3 nodes"),
        (&|b: &mut Vec<u8>| b[0] = 0xff, "ends before the record of r"),
    ] {
        assert_fault(&with("words", root, change), fault);
    }
    let mut files = load(&golden("words"));
    files.remove("data/r/00/r00.hrc");
    assert_fault(&files, "r00.hrc: is missing; the dataset was copied in part");
}

#[test]
fn levels_end_at_31_and_a_step_may_be_any() {
    let mut files = with_text("words", "\"hierarchyStepSize\": 2", "\"hierarchyStepSize\": 4000000000");
    files.insert("data/r/r.hrc".to_owned(), [1, 0, 0, 0, 0].repeat(40));
    assert_fault(&files, "has children below level 31");
}

#[test]
fn nodes_that_are_missing_or_cut_short_are_told() {
    let mut files = load(&golden("words"));
    files.remove("data/r/r7.bin");
    assert_fault(&files, "r7.bin: is missing");
    let files = with("words", "data/r/r7.bin", |bytes| bytes.truncate(31));
    assert_fault(&files, "node r7 has 31 bytes, no whole number of records of 16 (byte 16)");
    let files = with("words", "data/r/r7.bin", Vec::clear);
    assert_eq!(read_all(&files).unwrap(), 11, "an empty one has no points");
}

#[test]
fn a_node_larger_than_allowed_is_refused() {
    let mut dataset = Dataset::open(golden("words")).unwrap();
    dataset.set_max_node_bytes(63);
    let mut points = NodePoints::default();
    let error = dataset.read_points("r00007".parse().unwrap(), &mut points).unwrap_err();
    assert!(error.to_string().contains("node r00007 would take 64 bytes of memory, 63 are allowed"), "{error}");
    assert!(points.is_empty());
    dataset.read_points(NodeKey::ROOT, &mut points).unwrap();
    assert_eq!(points.len(), 3);
}

#[test]
fn positions_of_32_bits_become_world_coordinates() {
    let files = with("words", "data/r/r0.bin", |bytes| bytes[3] = 0x80);
    let mut points = NodePoints::default();
    open(&files).unwrap().read_points("r0".parse().unwrap(), &mut points).unwrap();
    assert!(matches!(points.positions(), Positions::World(_)));
    let expected = f64::from((1u32 << 31) + 1) * 0.001 + 1000.0;
    assert_eq!(points.world(0).unwrap(), [expected, 2.0 * 0.001 + 2000.0, 3.0 * 0.001 - 5.0]);
}

#[test]
fn deep_javascript_does_not_end_the_program() {
    for text in ["{\"a\":".repeat(1 << 20), "[".repeat(1 << 20), "/*".repeat(1 << 20), "var a = ".repeat(1 << 18)] {
        assert!(Metadata::from_json(text.as_bytes(), "deep").is_err());
    }
}

//! Bytes that lie: an error that says what is wrong, never a panic, never memory without end.

use pointmill_format::bytes::Memory;
use pointmill_format::potree2::{
    BrotliScratch, Dataset, Encoding, HIERARCHY_FILE, Hierarchy, METADATA_FILE, Metadata, NodeRecord, OCTREE_FILE,
    encode_brotli,
};
use pointmill_format::{Attribute, AttributeType, NodeKey, NodePoints, ReadError};
use pointmill_testkit::Random;
use pointmill_testkit::damage::{hit, peak_memory_bytes};
use pointmill_testkit::files::corpus;

use crate::util::{attributes, file_mut, golden, load, memory, metadata, one_node, open};

/// Everything that a reader does with a dataset; the number of points.
fn read_all(files: &Memory) -> Result<usize, ReadError> {
    let dataset = open(files)?;
    walk(&dataset)?;
    let mut points = NodePoints::default();
    let mut count = 0;
    let mut fault = None;
    for node in dataset.read_hierarchy()? {
        match dataset.read_points(&node, &mut points) {
            Ok(()) => count += points.len(),
            Err(e) => fault = Some(e),
        }
    }
    fault.map_or(Ok(count), Err)
}

fn walk(dataset: &Dataset) -> Result<(), ReadError> {
    let mut tree = Hierarchy::new(dataset)?;
    let mut stack = vec![NodeKey::ROOT];
    while let Some(key) = stack.pop() {
        tree.load(dataset, key)?;
        stack.extend(tree.children(key).map(|n| n.key));
    }
    Ok(())
}

fn fault_of(files: &Memory) -> String {
    read_all(files).expect_err("the fault is not found").to_string()
}

#[track_caller]
fn assert_fault(files: &Memory, part: &str) {
    let fault = fault_of(files);
    assert!(fault.contains(part) && !fault.contains('\n'), "{fault}");
}

#[test]
fn damaged_files_give_points_or_an_error_within_bounded_memory() {
    let mut originals: Vec<Memory> = ["default", "brotli"].map(|e| load(&golden(e))).into();
    originals.extend(corpus("potree2/color_1065_BROTLI").map(|path| load(&path)));
    let (mut read, mut refused) = (0, 0);
    for seed in 0..4_000 {
        let random = &mut Random::new(seed);
        let mut files = originals[random.index(originals.len())].clone();
        let file = file_mut(&mut files, random.pick(&[METADATA_FILE, HIERARCHY_FILE, OCTREE_FILE]));
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

/// The golden dataset with one record of its hierarchy changed.
fn with_record(encoding: &str, index: usize, change: impl Fn(&mut NodeRecord)) -> Memory {
    let mut files = load(&golden(encoding));
    change_record(&mut files, index, change);
    files
}

fn change_record(files: &mut Memory, index: usize, change: impl Fn(&mut NodeRecord)) {
    let bytes: &mut [u8; 22] = file_mut(files, HIERARCHY_FILE)[22 * index..].first_chunk_mut().unwrap();
    let mut record = NodeRecord::from_bytes(bytes);
    change(&mut record);
    *bytes = record.to_bytes();
}

#[test]
fn ranges_outside_the_files_are_named() {
    for (offset, size) in [(u64::MAX, 33), (0, u64::MAX), (u64::MAX, u64::MAX), (429, 33), (1 << 63, 1 << 63)] {
        let change = |r: &mut NodeRecord| (r.byte_offset, r.byte_size) = (offset, size);
        assert_fault(&with_record("default", 0, change), "octree.bin has 429");
        assert_fault(&with_record("default", 1, change), "hierarchy");
    }
}

#[test]
fn counts_that_the_payload_cannot_hold_are_refused_before_memory_is_asked_for() {
    let all = |r: &mut NodeRecord| r.points = u32::MAX;
    assert_fault(&with_record("default", 0, all), "node r has 99 bytes, but 4294967295 points of 33 bytes");
    assert_fault(&with_record("brotli", 0, all), "node r claims 4294967295 points");
    let one_more = |r: &mut NodeRecord| r.points += 1;
    assert_fault(&with_record("brotli", 0, one_more), "decompresses to 117 bytes, its 4 points need 156");
    let one_less = |r: &mut NodeRecord| r.points -= 1;
    assert_fault(&with_record("brotli", 0, one_less), "decompresses to more than the 78 bytes of its 2 points");
}

#[test]
fn a_stream_that_gives_more_than_is_allowed_is_not_followed() {
    let position = || vec![Attribute::new("position", AttributeType::Int32, 3)];
    let mut payload = Vec::new();
    let records = vec![0; 12 << 20]; // a million points at one place
    encode_brotli(&position(), &records, 4, &mut BrotliScratch::default(), &mut payload).unwrap();
    assert!(payload.len() < 1000, "{}", payload.len());
    let files = one_node(Encoding::Brotli, position(), 1 << 20, payload.clone());
    assert_eq!(read_all(&files).unwrap(), 1 << 20);

    let mut dataset = open(&files).unwrap();
    dataset.set_max_node_bytes(16 << 19);
    let root = dataset.read_root_chunk().unwrap()[0];
    let fault = dataset.read_points(&root, &mut NodePoints::default()).unwrap_err().to_string();
    assert!(fault.contains("would take 16777216 bytes of memory, 8388608 are allowed"), "{fault}");
    assert_fault(&one_node(Encoding::Brotli, position(), 1, payload.clone()), "more than the 16 bytes");
    let mut longer = payload.clone();
    longer.push(0);
    assert_fault(&one_node(Encoding::Brotli, position(), 1 << 20, longer), "more than");
    payload.pop();
    assert!(fault_of(&one_node(Encoding::Brotli, position(), 1 << 20, payload)).contains("node r "));
}

#[test]
fn proxies_that_go_round_in_circles_or_share_a_chunk_are_refused() {
    // r0 (record 1) names the root's own chunk, then the record of a leaf in it.
    let back = |r: &mut NodeRecord| (r.byte_offset, r.byte_size) = (0, 66);
    assert_fault(&with_record("default", 1, back), "the hierarchy chunk of r0 overlaps the one of r");
    let inside = |r: &mut NodeRecord| (r.byte_offset, r.byte_size) = (44, 22);
    assert_fault(&with_record("default", 1, inside), "overlaps");
    // The chunk of r0 is one record, a proxy for itself.
    let mut files = with_record("default", 1, |r| r.byte_size = 22);
    change_record(&mut files, 3, |r| (r.node_type, r.byte_offset, r.byte_size) = (2, 66, 22));
    assert_fault(&files, "the hierarchy chunk of r0 begins with a proxy");
}

#[test]
fn masks_that_do_not_fit_the_records_are_refused() {
    assert_fault(&with_record("default", 0, |r| r.child_mask = 0xff), "its child masks call for more (node r)");
    assert_fault(&with_record("default", 0, |r| r.child_mask = 0), "its child masks account for 1");
    assert_fault(&with_record("default", 1, |r| r.byte_size = 43), "not a multiple of 22");
    assert_fault(&with_record("default", 1, |r| r.byte_size = 0), "not a multiple of 22");
}

#[test]
fn a_chain_below_the_deepest_level_is_refused() {
    let link = NodeRecord { node_type: 0, child_mask: 1, points: 0, byte_offset: 0, byte_size: 0 };
    let hierarchy: Vec<u8> = (0..40).flat_map(|_| link.to_bytes()).collect();
    let json = metadata(Encoding::Default, hierarchy.len() as u64, attributes()).to_json();
    assert_fault(&memory(json.into_bytes(), hierarchy, Vec::new()), "children below level 31");
}

#[test]
fn records_of_old_converters_are_read_as_meant() {
    let count = |files: &Memory| read_all(files).unwrap();
    let no_payload = |r: &mut NodeRecord| (r.byte_offset, r.byte_size) = (0, 0);
    assert_eq!(count(&with_record("default", 0, no_payload)), 13 - 3, "points without payload");
    assert_eq!(count(&with_record("brotli", 0, |r| r.node_type = 1)), 13, "an inner node marked as a leaf");
    let mut orphan = load(&golden("default"));
    file_mut(&mut orphan, HIERARCHY_FILE).extend([0; 22]);
    assert_eq!(count(&orphan), 13, "a chunk that nothing refers to");
    let mut word = load(&golden("default"));
    let metadata = file_mut(&mut word, METADATA_FILE);
    *metadata = replaced(metadata, "\"DEFAULT\"", "\"UNCOMPRESSED\"");
    assert_eq!(count(&word), 13, "the encoding's other name");
}

fn replaced(json: &[u8], from: &str, to: &str) -> Vec<u8> {
    let text = std::str::from_utf8(json).unwrap();
    assert!(text.contains(from), "{from}");
    text.replacen(from, to, 1).into_bytes()
}

#[test]
fn metadata_faults_are_told_by_name() {
    let golden = load(&golden("default"));
    let faults = [
        ("\"max\": [1016.383, ", "\"max\": [inf, ", "a number is written as inf or nan"),
        ("\"2.0\"", "\"1.8\"", "version \"1.8\""),
        ("\"DEFAULT\"", "\"GLTF\"", "encoding \"GLTF\""),
        ("\"points\": 13", "\"points\": -1", "points is -1, not a whole number"),
        ("\"points\": 13", "\"punkte\": 13", "points is missing"),
        ("\"name\": \"position\"", "\"name\": \"pos\"", "no attribute named position"),
        ("\"name\": \"intensity\"", "\"name\": \"rgb\"", "two attributes are named \"rgb\""),
        ("\"type\": \"double\"", "\"type\": \"undefined\"", "\"gps-time\" has the type \"undefined\""),
        ("\"size\": 8, \"numElements\": 1", "\"size\": 8, \"numElements\": 4294967295", "numElements 4294967295"),
        ("\"size\": 8, ", "\"size\": 9, ", "\"gps-time\" is double x 1, so its size is 8, not 9"),
        ("\"scale\": [0.001, ", "\"scale\": [0.0, ", "has to be greater than 0"),
        ("\"scale\": [0.001, ", "\"scale\": [1e999, ", "not valid JSON"),
        ("\"offset\": [1000.0, ", "\"offset\": [", "offset has 2 numbers, not 3"),
        ("\"spacing\": 0.128", "\"spacing\": 0", "spacing 0 has to be"),
        ("\"firstChunkSize\": 66", "\"firstChunkSize\": 18446744073709551615", "hierarchy.bin has 176"),
    ];
    for (from, to, expected) in faults {
        let mut files = golden.clone();
        files.insert(METADATA_FILE.to_owned(), replaced(&golden[METADATA_FILE], from, to));
        assert_fault(&files, expected);
    }
}

#[test]
fn what_json_cannot_say_is_never_written() {
    let mut made = metadata(Encoding::Default, 22, attributes());
    made.attributes[4].min = vec![f64::NEG_INFINITY];
    made.attributes[4].max = vec![f64::NAN];
    made.attributes[2].max = vec![-0.0];
    (made.attributes[1].min, made.attributes[1].max) = (vec![], vec![]); // no range is given: found by fuzzing
    made.lattice.offset = [636_001.76, 0.1 + 0.2, 5e-324];
    made.name = "a \"quoted\" name\\\n\u{1}".into();
    made.projection = "+proj=utm +zone=10".into();
    let read = Metadata::from_json(made.to_json().as_bytes(), "made").unwrap();
    made.attributes[4].min = vec![f64::MIN];
    made.attributes[4].max = vec![0.0];
    assert_eq!(read, made);
    assert!(read.attributes[2].max[0].is_sign_negative());
}

/// The golden dataset in a folder, where a file has no more bytes than it needs but is as long as it likes.
fn sparse(change: impl Fn(&mut Memory), file: &str, len: u64) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut files = load(&golden("default"));
    change(&mut files);
    for (name, bytes) in &files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    std::fs::File::options().write(true).open(folder.path().join(file)).unwrap().set_len(len).unwrap();
    folder
}

#[test]
fn files_of_holes_are_not_read_into_memory() {
    let chunk = 4_000_000_000u64 * 22;
    let text = |files: &mut Memory| {
        let text = String::from_utf8(files[METADATA_FILE].clone()).unwrap();
        let at = text.find("\"firstChunkSize\":").unwrap() + 17;
        let digits = text[at..].find(|c: char| !c.is_ascii_digit() && c != ' ').unwrap();
        let text = format!("{}{chunk}{}", &text[..at], &text[at + digits..]);
        files.insert(METADATA_FILE.into(), text.into_bytes());
    };
    let folder = sparse(text, HIERARCHY_FILE, chunk);
    let fault = Dataset::open(folder.path()).unwrap().read_root_chunk().unwrap_err().to_string();
    assert!(fault.contains("has 4000000000 records, its child masks"), "{fault}");

    let all = |r: &mut NodeRecord| (r.points, r.byte_offset, r.byte_size) = (u32::MAX, 0, 33 * u64::from(u32::MAX));
    let folder = sparse(|files| change_record(files, 0, all), OCTREE_FILE, 200 << 30);
    let dataset = Dataset::open(folder.path()).unwrap();
    let root = dataset.read_root_chunk().unwrap()[0];
    let fault = dataset.read_points(&root, &mut NodePoints::default()).unwrap_err();
    assert!(fault.to_string().contains("would take 141733920735 bytes of memory"), "{fault}");
    assert_eq!(fault.advice(), Some(&pointmill_format::Advice::MoreMemory));

    let folder = sparse(|_| (), METADATA_FILE, 2 << 30);
    assert!(Dataset::open(folder.path()).unwrap_err().to_string().contains("too many for metadata"));
}

#[cfg(unix)]
#[test]
fn what_is_no_file_is_not_waited_for() {
    for file in [METADATA_FILE, HIERARCHY_FILE, OCTREE_FILE] {
        let folder = sparse(|_| (), file, 0);
        std::fs::remove_file(folder.path().join(file)).unwrap();
        let made = std::process::Command::new("mkfifo").arg(folder.path().join(file)).status();
        assert!(made.is_ok_and(|status| status.success()));
        let fault = Dataset::open(folder.path()).unwrap_err();
        assert!(fault.is_io() && fault.to_string().contains("no file, but a pipe"), "{fault}");
    }
}

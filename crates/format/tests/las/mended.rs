//! Chunk tables that are wrong: mended where the mended table can be proven, else refused or done without.

use laz::LazVlr;
use laz::laszip::{ChunkTable, ChunkTableEntry};
use pointmill_format::ErrorKind;
use pointmill_format::scan::las;
use pointmill_testkit::damage::{put, u64_at};
use pointmill_testkit::files;
use pointmill_testkit::reader::Cloud;

use crate::common::{fixture, points_start, read_bytes};

const VARIABLE: &str = "chunks_variable_format3.laz";
const FIXED: &str = "chunks_fixed_format3.laz";

/// Points and bytes of the chunks of a fixture.
fn chunks(name: &str) -> Vec<(u64, u64)> {
    let scan = las::open(files::fixture("las").join(name)).unwrap();
    scan.pieces().iter().map(|piece| (piece.points, piece.byte_len)).collect()
}

/// The fixture with another chunk table, right behind its last chunk with points.
fn with_table(name: &str, chunks: &[(u64, u64)]) -> Vec<u8> {
    let mut bytes = fixture(name);
    let start = points_start(&bytes);
    let table = start + 8 + self::chunks(name).iter().map(|(_, bytes)| *bytes as usize).sum::<usize>();
    bytes.truncate(table);
    put(&mut bytes, start, &table.to_le_bytes());
    let record = bytes.windows(14).position(|w| w == b"laszip encoded").unwrap() + 52;
    let vlr = LazVlr::from_buffer(&bytes[record..]).unwrap();
    let mut entries = ChunkTable::with_capacity(chunks.len());
    chunks.iter().for_each(|&(point_count, byte_count)| entries.push(ChunkTableEntry { point_count, byte_count }));
    entries.write_to(&mut bytes, &vlr).unwrap();
    bytes
}

/// Asserts that the file has the points of the fixture, and says that its table was mended.
fn is_mended(bytes: &[u8], name: &str, how: &str) {
    let (cloud, right): (Cloud, Cloud) = (read_bytes(bytes).unwrap(), read_bytes(&fixture(name)).unwrap());
    assert_eq!((cloud.len(), &cloud.xyz, &cloud.columns), (400, &right.xyz, &right.columns), "{how}");
    assert!(cloud.errors.is_empty(), "{how}: {:?}", cloud.errors);
    assert!(cloud.warned(how) && cloud.warned("mended"), "{how}: {:?}", cloud.info.warnings);
}

#[test]
fn a_first_entry_that_counts_from_the_start_of_the_file_is_mended() {
    for name in [VARIABLE, FIXED] {
        let mut wrong = chunks(name);
        wrong[0].1 += points_start(&fixture(name)) as u64 + 8;
        is_mended(&with_table(name, &wrong), name, "its first entry counts from the start of the file");
        wrong[0].1 -= 8;
        is_mended(&with_table(name, &wrong), name, "its first entry is too large");
    }
}

#[test]
fn another_entry_that_is_wrong_or_missing_is_mended() {
    for name in [VARIABLE, FIXED] {
        let right = chunks(name);
        let last = right.len() - 1;
        let mut wrong = right.clone();
        wrong[last].1 += 100;
        is_mended(&with_table(name, &wrong), name, "its last entry is too large");
        wrong[last].1 -= 150;
        is_mended(&with_table(name, &wrong), name, "its last entry is too small");
        is_mended(&with_table(name, &right[..last]), name, "the entry of the last chunk is missing");
    }
}

#[test]
fn bytes_between_the_last_chunk_and_the_table_are_told() {
    let mut bytes = fixture(VARIABLE);
    let start = points_start(&bytes);
    let table = u64_at(&bytes, start) as usize;
    bytes.splice(table..table, [0xab; 30]);
    put(&mut bytes, start, &(table as u64 + 30).to_le_bytes());
    is_mended(&bytes, VARIABLE, "30 bytes follow the last chunk");
}

#[test]
fn a_table_at_another_place_than_the_file_says_is_found() {
    for name in [VARIABLE, FIXED] {
        let start = points_start(&fixture(name));
        let table = u64_at(&fixture(name), start);
        for said in [u64::MAX, 0, table - start as u64, table + 1, table - 1, 1 << 40] {
            let mut bytes = fixture(name);
            put(&mut bytes, start, &said.to_le_bytes());
            is_mended(&bytes, name, &format!("it was found at byte {table}"));
            // what is appended behind the table does not hide it
            bytes.extend([7; 500]);
            is_mended(&bytes, name, &format!("it was found at byte {table}"));
        }
    }
}

#[test]
fn one_chunk_needs_no_table() {
    let (points, bytes) = chunks(VARIABLE)[1];
    let mut whole = fixture(VARIABLE);
    let start = points_start(&whole);
    let second = start + 8 + chunks(VARIABLE)[0].1 as usize;
    let chunk = whole[second..second + bytes as usize].to_vec();
    whole.truncate(start + 8);
    whole.extend(&chunk);
    put(&mut whole, 107, &(points as u32).to_le_bytes());
    for offset in [u64::MAX, whole.len() as u64] {
        put(&mut whole, start, &offset.to_le_bytes());
        let mut file = whole.clone();
        if offset != u64::MAX {
            file.extend([0; 8]); // a table without entries
        }
        let (cloud, right) = (read_bytes(&file).unwrap(), read_bytes(&fixture(VARIABLE)).unwrap());
        assert_eq!((cloud.len(), cloud.errors.len()), (200, 0));
        assert_eq!(cloud.xyz.clone().map(|axis| axis[0]), right.xyz.map(|axis| axis[1]));
        assert!(cloud.warned("all points are in one chunk"), "{:?}", cloud.info.warnings);
    }
}

/// No wrong points come out of tables that cannot be mended.
#[test]
fn what_cannot_be_proven_is_refused_with_a_true_sentence() {
    let right = chunks(VARIABLE);
    let mut shifted = right.clone();
    shifted[0].1 += 5;
    shifted[1].1 += 5;
    let mut counts = right;
    (counts[1].0, counts[1].1) = (counts[1].0 - 3, counts[1].1 + 40);
    for (table, why) in [(vec![], "it has no entries for"), (shifted, "its chunks have"), (counts, "its chunks have")] {
        let error = read_bytes(&with_table(VARIABLE, &table)).unwrap_err();
        assert!(matches!(error.kind(), ErrorKind::Broken));
        let line = error.to_string();
        assert!(line.contains(why) && line.contains("the chunk table is unusable"), "{line}");
        assert!(!line.contains("damaged") && !line.contains("cut short"), "{line}");
    }
    // chunks of a fixed size are decoded one after the other without a table
    let mut shifted = chunks(FIXED);
    (shifted[0].1, shifted[1].1) = (shifted[0].1 + 5, shifted[1].1 + 5);
    let (cloud, right) = (read_bytes(&with_table(FIXED, &shifted)).unwrap(), read_bytes(&fixture(FIXED)).unwrap());
    assert_eq!((cloud.xyz, cloud.errors.len()), (right.xyz, 0));
}

#[test]
fn a_codec_that_is_not_known_is_no_damage() {
    let mut bytes = fixture(FIXED);
    let record = bytes.windows(14).position(|w| w == b"laszip encoded").unwrap() + 52;
    bytes[record] = 9;
    let error = read_bytes(&bytes).unwrap_err();
    assert!(matches!(error.kind(), ErrorKind::Unsupported));
    assert!(error.to_string().contains("LASzip compressor 9 is not known"), "{error}");
}

//! Bytes that lie: an error that says what is wrong, never a panic, never memory without end.

use pointmill_format::Lattice;
use pointmill_format::batches::{Header, Precision};
use pointmill_testkit::Random;
use pointmill_testkit::damage::hit;

use crate::util::{Points, golden, open};

/// Everything that a reader does with a file; the number of points.
fn read_all(bytes: &[u8]) -> Result<u64, String> {
    open(bytes).and_then(|b| b.read_everything()).map_err(|e| e.to_string())
}

fn example() -> Vec<u8> {
    std::fs::read(golden("example.qbatch")).unwrap()
}

/// Two batches and a bit, all sections, three planes.
fn cloud() -> Vec<u8> {
    let lattice = Lattice { scale: [0.001; 3], offset: [100.0, -100.0, 0.0] };
    let points = Points::random(3, 2 * 10_240 + 9, [5_000; 3], true, lattice);
    let mut options = points.options(1.0);
    options.precision = Some(Precision::Thirty);
    points.write(&options).0
}

#[track_caller]
fn assert_fault(bytes: &[u8], part: &str) {
    let fault = read_all(bytes).expect_err("the fault is not found");
    assert!(fault.contains(part) && fault.contains("; ") && !fault.contains('\n'), "{fault}");
}

fn patched(at: usize, field: &[u8]) -> Vec<u8> {
    let mut bytes = example();
    bytes[at..at + field.len()].copy_from_slice(field);
    bytes
}

#[test]
fn a_file_cut_short_at_any_border_of_a_section_is_refused() {
    let bytes = cloud();
    let header = Header::parse(&bytes, "a".as_ref()).unwrap();
    let s = &header.sections;
    let mut borders = vec![0, 1, 8, 255, 256, s.batches, s.hi10, s.colour, s.description, bytes.len() as u64 - 1];
    borders.extend([s.mid10, s.lo10, s.originals].map(Option::unwrap));
    for border in borders {
        for cut in [border.saturating_sub(1), border, (border + 1).min(bytes.len() as u64 - 1)] {
            let fault = read_all(&bytes[..cut as usize]).expect_err("cut short");
            assert!(!fault.contains('\n') && fault.contains("; "), "{fault}");
        }
    }
    assert_eq!(read_all(&bytes).unwrap(), 2 * 10_240 + 9);
}

#[test]
fn sections_that_leave_the_file_overlap_or_are_not_aligned_are_refused() {
    for (field, name) in
        [(120, "batches"), (128, "hi10"), (136, "mid10"), (144, "lo10"), (152, "colour"), (160, "originals")]
    {
        for offset in [!255u64, 1 << 40, 4096] {
            assert_fault(&patched(field, &offset.to_le_bytes()), name);
        }
        for offset in [1, 257, 513] {
            assert_fault(&patched(field, &(offset as u64).to_le_bytes()), "no multiple of 256");
        }
        assert_fault(&patched(field, &2304u64.to_le_bytes()), ""); // on the description
    }
    assert_fault(&patched(152, &512u64.to_le_bytes()), "ends at byte 536, but");
    assert_fault(&patched(168, &2560u64.to_le_bytes()), "description");
    assert_fault(&patched(176, &858u64.to_le_bytes()), "section description needs 858 bytes");
    assert_fault(&patched(176, &u64::MAX.to_le_bytes()), "too many for a description");
    assert_fault(&patched(2048, &7u64.to_le_bytes()), "7 originals of 6 points");
    assert_fault(&patched(2048, &u64::MAX.to_le_bytes()), "originals");
    // a point more than the sections hold: they run into each other, or behind the file
    let more = (1u64 << 32) - 1;
    let batches = more.div_ceil(10_240) as u32;
    let mut bytes = patched(16, &more.to_le_bytes());
    bytes[28..32].copy_from_slice(&batches.to_le_bytes());
    assert_fault(&bytes, "section batches needs");
}

#[test]
fn batch_tables_that_contradict_the_header_are_refused_with_the_batch() {
    for (at, field, part) in [
        (256 + 12, 1u32, "6 points from 1, not 6 from 0"),
        (256 + 28, 5, "5 points from 0, not 6"),
        (256 + 28, u32::MAX, "4294967295 points"),
        (256, f32::NAN.to_bits(), "inverted, below the origin or not finite"),
        (256 + 4, (-1f32).to_bits(), "below the origin"),
        (256 + 8, 2f32.to_bits(), "inverted"),
        (256 + 16, f32::INFINITY.to_bits(), "not finite"),
    ] {
        assert_fault(&patched(at, &field.to_le_bytes()), part);
        assert_fault(&patched(at, &field.to_le_bytes()), "(byte 256)");
    }
}

#[test]
fn descriptions_that_contradict_the_sections_are_refused() {
    for (from, to, part) in [
        ("\"bytes\":12", "\"bytes\":13", "13 bytes, not 12"),
        ("\"bytes\":12", "\"bytes\":99999999999999999999", "description"),
        ("\"offset\":1024", "\"offset\":1025", "no multiple of 256"),
        ("\"offset\":1024", "\"offset\":1280", "overlap"),
        ("\"uint16\"", "\"text\"", "the type \"text\""),
        ("\"elements\":1,\"offset\":1024", "\"elements\":0,\"offset\":1024", "x 0"),
        ("\"classification\"", "\"intensity\"", "two attributes are named"),
        ("\"scale\":[0.001", "\"scale\":[-0.001", "scales have to be > 0"),
    ] {
        let mut bytes = example();
        let text = String::from_utf8(bytes.split_off(2304)).unwrap().replacen(from, to, 1);
        bytes[176..184].copy_from_slice(&(text.len() as u64).to_le_bytes());
        bytes.extend(text.into_bytes());
        let part = if part == "overlap" { "but" } else { part };
        assert_fault(&bytes, part);
    }
}

#[test]
fn originals_that_belong_to_no_point_are_found_by_reading_everything() {
    assert_fault(&patched(2056, &6u32.to_le_bytes()), "belong to no point");
    assert_fault(&patched(2060, &(1u32 << 24).to_le_bytes()), "have a level");
}

/// Damage at random places, also in fields that were made to look right: no panic, one line.
fn survives(bytes: &[u8], seed: u64, rounds: usize) -> usize {
    let mut random = Random::new(seed);
    let mut refused = 0;
    for _ in 0..rounds {
        let mut bytes = bytes.to_vec();
        for _ in 0..1 + random.below(3) {
            // a third in the header and the records, a third in the description, a third anywhere
            let len = bytes.len() as u64;
            if len == 0 {
                break;
            }
            let at = match random.below(3) {
                0 => random.below(512.min(len)),
                1 => len - 1 - random.below(900.min(len)),
                _ => random.below(len),
            } as usize;
            if random.below(6) > 0 {
                hit(&mut bytes, at, &mut random);
            } else {
                let field = random.pick(&[16, 24, 28, 112, 116, 120, 128, 136, 144, 152, 160, 168, 176, 184]);
                if let Some(b) = bytes.get_mut(field + random.index(4)) {
                    *b = random.below(256) as u8;
                }
            }
        }
        match read_all(&bytes) {
            Ok(_) => {}
            Err(fault) => {
                assert!(!fault.contains('\n') && fault.len() < 2000, "{fault}");
                refused += 1;
            }
        }
    }
    refused
}

#[test]
fn two_thousand_damaged_files_end_in_an_error_or_in_points() {
    let refused = survives(&example(), 21, 1500);
    assert!((700..1500).contains(&refused), "{refused}: damage to points and names is none that a reader can see");
    survives(&cloud(), 22, 500);
}

#[cfg(feature = "zstd")]
mod compressed {
    use pointmill_format::NodePoints;
    use pointmill_format::batches::{BatchScratch, compress};

    use super::*;

    fn blocks() -> Vec<u8> {
        std::fs::read(golden("blocks.qbatch")).unwrap()
    }

    #[test]
    fn block_tables_and_frames_that_lie_are_refused() {
        let hi10 = Header::parse(&blocks(), "a".as_ref()).unwrap().sections.hi10 as usize;
        for (at, field, part) in [
            (0, 0, "blocks of 0 batches"),
            (0, 257, "blocks of 257 batches"),
            (4, 2, "has 2 blocks"),
            (4, u32::MAX, "blocks"),
            (8, 23, "first block not at 24"),
            (16, 23, "end of block 0 at 23"),
            (16, 1 << 30, "end of block 0"),
            (16, 25, "is no zstd frame"),
            (24, 0, "is no zstd frame"),
            (29, 25, "is no zstd frame of 24 bytes"), // the content size
        ] {
            let mut bytes = blocks();
            bytes[hi10 + at..hi10 + at + 4].copy_from_slice(&u32::to_le_bytes(field));
            assert_fault(&bytes, part);
        }
        // a frame that promises more bytes than its blocks give
        let mut bytes = blocks();
        bytes[hi10 + 37] -= 8; // one byte less in the raw block's header
        assert_fault(&bytes, "section hi10: block 0");
    }

    #[test]
    fn one_scratch_serves_several_files_and_an_error_leaves_no_points() {
        let compressed = |name: &str| {
            let (raw, mut file) =
                (open(&std::fs::read(golden(name)).unwrap()).unwrap(), std::io::Cursor::new(Vec::new()));
            compress(&raw, &mut file, 3, 16).unwrap();
            (raw, file.into_inner())
        };
        let (mut scratch, mut points, mut expected) =
            (BatchScratch::default(), NodePoints::default(), NodePoints::default());
        for (raw, bytes) in [compressed("example.qbatch"), compressed("far.qbatch")] {
            open(&bytes).unwrap().read_batch(0, Precision::Thirty, &mut scratch, &mut points).unwrap();
            raw.read_batch(0, Precision::Thirty, &mut BatchScratch::default(), &mut expected).unwrap();
            let world = |p: &NodePoints| (0..p.len()).map(|i| p.world(i)).collect::<Vec<_>>();
            assert_eq!((world(&points), points.columns()), (world(&expected), expected.columns()));
        }
        let mut bytes = blocks();
        let colour = Header::parse(&bytes, "a".as_ref()).unwrap().sections.colour as usize;
        bytes[colour + 24] ^= 0xff; // the frame behind the table of one block
        let broken = open(&bytes).unwrap();
        assert!(broken.read_batch(0, Precision::Thirty, &mut scratch, &mut points).is_err());
        assert_eq!((points.len(), points.column::<u32>("colour")), (0, Some(&[][..])));
    }

    #[test]
    fn damaged_blocks_end_in_an_error_or_in_points() {
        survives(&blocks(), 23, 1000);
    }
}

#[cfg(not(feature = "zstd"))]
#[test]
fn compressed_sections_are_told_to_need_the_feature() {
    assert_fault(&std::fs::read(golden("blocks.qbatch")).unwrap(), "feature zstd");
}

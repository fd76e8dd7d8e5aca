//! Compressed sections: tables, frames, lengths.

use pointmill_validate::Check;

use super::cloud::{Parts, assert_only, broken, check, good};

fn compressed(k: usize) -> Parts {
    Parts { block: Some(k), ..good() }
}

#[test]
fn compressed_sections_hold_the_same_points() {
    for k in [1, 3, 256] {
        let outcome = compressed(k).validate();
        assert!(outcome.ok && outcome.problems.is_empty(), "{:#?}", outcome.problems);
        assert_eq!(outcome.encoding, Some("zstd"));
        assert!(outcome.check(Check::Blocks).unwrap().checked > 0);
    }
}

#[test]
fn a_damaged_block_is_told_once_and_the_rest_is_checked() {
    let (mut bytes, places) = compressed(1).bytes();
    let table = places["hi10"] + 8;
    let at = |i: usize| u64::from_le_bytes(bytes[table + 8 * i..table + 8 * i + 8].try_into().unwrap()) as usize;
    let (begin, end) = (places["hi10"] + at(1), places["hi10"] + at(2));
    bytes[begin + 20..end].fill(0xff);
    let outcome = check(&bytes);
    assert_only(&outcome, Check::Blocks, 1);
    assert!(outcome.check(Check::Levels).unwrap().checked > 10);
    assert!(outcome.check(Check::Levels).unwrap().skipped.is_some());
}

#[test]
fn tables_that_lie() {
    let (bytes, places) = compressed(2).bytes();
    let at = places["colour"];
    // k, block count, the first block, a block before the one before it
    for (field, value) in [(0, 0u32), (0, 257), (0, 1), (4, 3), (8, 40), (16, 1), (24, u32::MAX)] {
        let mut bytes = bytes.clone();
        bytes[at + field..at + field + 4].copy_from_slice(&value.to_le_bytes());
        let broken = broken(&check(&bytes));
        assert!(broken == [Check::Blocks] || broken == [Check::Sections], "field {field} = {value}: {broken:?}");
    }
}

#[test]
fn a_block_of_another_length_is_not_decompressed() {
    let mut parts = compressed(2);
    parts.intensity.pop();
    let outcome = parts.validate();
    assert_eq!(broken(&outcome), [Check::Blocks], "{:#?}", outcome.problems);
}

#[test]
fn a_block_that_cannot_hold_what_it_states_is_not_decompressed() {
    let (mut bytes, places) = compressed(256).bytes();
    let table = places["hi10"] + 8;
    let begin = places["hi10"] + u64::from_le_bytes(bytes[table..table + 8].try_into().unwrap()) as usize;
    // an empty block of a few bytes in the place of the frame, which is where the next section begins
    let raw = (3 * 10_240 + 1000) * 4u64;
    let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0b1110_0000];
    frame.extend(raw.to_le_bytes());
    bytes[begin..begin + frame.len()].copy_from_slice(&frame);
    let end = (begin - places["hi10"] + frame.len()) as u64;
    bytes[table + 8..table + 16].copy_from_slice(&end.to_le_bytes());
    let outcome = check(&bytes);
    assert!(broken(&outcome).contains(&Check::Blocks), "{:#?}", outcome.problems);
    let problem = outcome.problems.iter().find(|p| p.check == Check::Blocks).unwrap();
    assert!(problem.found.as_str().unwrap().contains("cannot hold that") || raw < 32_768 * 13, "{problem}");
}

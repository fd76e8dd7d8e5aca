//! Damaged chunks in this decoder and in that of the crate `laz`: both give the same points, or both refuse.
//!
//! Known differences, all of chunks that no encoder writes. Here they are refused, there they may give points: a number of
//! raw bits beyond its range, a chunk or layer whose first four bytes are 0xFF, a change of the sequence of GPS times
//! more than four times for one point. There they are refused, or end in a panic: sums of differences that overflow.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use ::laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use pointmill_testkit::{Random, damage};

use super::super::Stop;
use super::damage::first_layer;
use super::format::{Format, formats};

const POINTS: usize = 120;

/// Its decoder of GPS times calls itself: as often as there are symbols in a chunk.
const STACK: usize = 1 << 30;

/// The records; `None`: refused.
fn by_laz(format: Format, chunk: &[u8]) -> Option<Vec<u8>> {
    let mut out = vec![0; POINTS * format.record_len()];
    let decode = AssertUnwindSafe(|| {
        let input = Cursor::new(chunk);
        let mut decoder: Box<dyn RecordDecompressor<Cursor<&[u8]>>> = match format.is_layered() {
            true => Box::new(LayeredPointRecordDecompressor::new(input)),
            false => Box::new(SequentialPointRecordDecompressor::new(input)),
        };
        decoder.set_fields_from(&format.laz_items()).ok()?;
        decoder.decompress_many(&mut out).ok()
    });
    catch_unwind(decode).ok().flatten()?;
    Some(out)
}

/// What became of the chunks.
#[derive(Debug, Default)]
struct Outcomes {
    same: u64,
    both_refuse: u64,
    senseless: u64,
    only_here: u64,
}

fn compare(format: Format, rounds: u64, seed: u64) -> Outcomes {
    let mut random = Random::new(seed);
    let whole = format.chunk(&format.points(POINTS, 0.3, &mut random));
    let sizes = format.record_len() + 4;
    let start = if format.is_layered() { first_layer(&whole, sizes, format) } else { format.record_len() };
    let (mut models, mut outcomes) = (format.models(), Outcomes::default());
    for _ in 0..rounds {
        let coded = start..whole.len();
        let chunk = damage::mutated(&whole, &[coded.clone(), coded], &mut random);
        let (found, result) = format.decode(&mut models, &chunk, POINTS, 64);
        match (result, by_laz(format, &chunk)) {
            (Ok(()), Some(right)) => {
                assert!(found == format.without_waveforms(right), "{format:?}: other points than `laz` gives");
                outcomes.same += 1;
            }
            (Ok(()), None) => outcomes.only_here += 1,
            (Err(_), None) => outcomes.both_refuse += 1,
            (Err(Stop::Corrupt { .. }), Some(_)) => outcomes.senseless += 1,
            (Err(stop), Some(_)) => panic!("{format:?}: refused here alone: {stop:?}"),
        }
    }
    outcomes
}

/// `POINTMILL_MUTATIONS` sets the number of damaged chunks per format (default 20). Formats with waveforms in layers are
/// left out: those layers are not read here.
#[test]
fn damaged_chunks_are_to_both_decoders_the_same() {
    let all = move || {
        let mut sum = Outcomes::default();
        for (f, format) in formats().filter(|format| !matches!(format.number, 9 | 10)).enumerate() {
            let of_format = compare(format, damage::rounds(20), 51 << 32 | f as u64);
            sum.same += of_format.same;
            sum.both_refuse += of_format.both_refuse;
            sum.senseless += of_format.senseless;
            sum.only_here += of_format.only_here;
        }
        sum
    };
    let sum = std::thread::Builder::new().stack_size(STACK).spawn(all).unwrap().join().unwrap();
    println!("{sum:?}");
    assert!(sum.same > 10 * (sum.senseless + sum.only_here), "{sum:?}");
}

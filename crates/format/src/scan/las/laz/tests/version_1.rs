//! Items of LASzip 1. The crate `laz` encodes points and times as LASzip did; colours and extra bytes are encoded here,
//! with its primitives.

use std::io::Cursor;

use ::laz::compressors::IntegerCompressorBuilder;
use ::laz::encoders::ArithmeticEncoder;
use ::laz::models::ArithmeticModelBuilder;
use pointmill_testkit::Random;

use super::super::coder::Coder;
use super::super::integer::Integer;
use super::super::version_1::Rgb;
use super::format::Format;

#[test]
fn points_and_times_come_back() {
    let mut random = Random::new(21);
    for number in [0, 1] {
        let format = Format { number, extra: 0, version: 1 };
        let mut models = format.models();
        for (points, share) in [(1, 0.5), (2, 1.0), (3000, 0.02), (1500, 0.3), (700, 1.0)] {
            let right = format.points(points, share, &mut random);
            let (found, result) = format.decode(&mut models, &format.chunk(&right), points, 512);
            assert!(result.is_ok() && found == right, "{format:?}, {points} points, {share}: {result:?}");
        }
    }
}

#[test]
fn colours_come_back() {
    let mut random = Random::new(22);
    let mut colours = vec![[0u16; 3]];
    for _ in 0..2000 {
        let last = *colours.last().unwrap();
        colours.push(last.map(|value| if random.below(2) == 0 { value } else { random.next_u32() as u16 }));
    }
    let mut encoder = ArithmeticEncoder::new(Cursor::new(Vec::new()));
    let mut changes = ArithmeticModelBuilder::new(64).build();
    let mut bytes = IntegerCompressorBuilder::new().bits(8).contexts(6).build_initialized();
    for pair in colours.windows(2) {
        let [last, new] = [pair[0], pair[1]].map(|colour| colour.map(u16::to_le_bytes));
        let (last, new) = (last.as_flattened(), new.as_flattened());
        let differ = (0..6).filter(|i| last[*i] != new[*i]).fold(0, |bits, i| bits | 1 << i);
        encoder.encode_symbol(&mut changes, differ).unwrap();
        for i in (0..6).filter(|i| last[*i] != new[*i]) {
            bytes.compress(&mut encoder, last[i].into(), new[i].into(), i as u32).unwrap();
        }
    }
    encoder.done().unwrap();
    let coded = encoder.into_inner().into_inner();
    let (mut rgb, mut coder) = (Rgb::new(), Coder::start(&coded, 0));
    for pair in colours.windows(2) {
        assert_eq!(rgb.next(&mut coder, pair[0]), pair[1]);
    }
    assert!(!coder.is_off());
}

/// As extra bytes are: each a context of one decoder of integers of eight bits.
#[test]
fn integers_of_any_width_come_back() {
    let mut random = Random::new(23);
    for bits in [8u32, 16, 32] {
        let mask = if bits == 32 { u32::MAX } else { (1 << bits) - 1 };
        let mut number = || match random.below(4) {
            0 => random.next_u32() & mask,
            1 => 0,
            2 => mask - random.below(3) as u32,
            _ => random.next_u32() >> random.below(32) & mask,
        };
        let numbers: Vec<(i32, i32)> = (0..5000).map(|_| (number().cast_signed(), number().cast_signed())).collect();
        let mut encoder = ArithmeticEncoder::new(Cursor::new(Vec::new()));
        let mut integers = IntegerCompressorBuilder::new().bits(bits).contexts(3).build_initialized();
        for (i, (predicted, real)) in numbers.iter().enumerate() {
            integers.compress(&mut encoder, *predicted, *real, i as u32 % 3).unwrap();
        }
        encoder.done().unwrap();
        let coded = encoder.into_inner().into_inner();
        let (mut integers, mut coder) = (Integer::new(bits as usize, 3), Coder::start(&coded, 0));
        for (i, (predicted, real)) in numbers.iter().enumerate() {
            let found = integers.next(&mut coder, *predicted, i % 3).cast_unsigned();
            assert_eq!(found & mask, real.cast_unsigned(), "{bits} bits, number {i}");
        }
        assert!(!coder.is_off());
    }
}

use pointmill_testkit::Random;

use super::*;
use crate::potree2::brotli;

/// The stream of `columns`, after the library has given back what went into it.
fn encoded(columns: &[Column], planes: &[u8], count: usize) -> Vec<u8> {
    let mut out = vec![7, 7];
    ColumnEncoder::default().encode(planes, columns, count, &|| true, &mut out).unwrap();
    let stream = out.split_off(2);
    assert_eq!(out, [7, 7], "what was there is kept");
    let mut back = Vec::new();
    assert_eq!(brotli::decompress(&stream, planes.len(), &mut back), Ok(()), "{columns:?}, {count} elements");
    assert!(back == planes, "{columns:?}, {count} elements");
    stream
}

/// Elements of `size` bytes, as `value` gives them.
fn column(count: usize, size: usize, mut value: impl FnMut(usize) -> u128) -> Vec<u8> {
    (0..count).flat_map(|number| value(number).to_le_bytes().into_iter().take(size)).collect()
}

/// Values of many kinds: constant, counting, noise, few, in runs, near each other, with shared ends or beginnings.
fn values(kind: usize, random: &mut Random, number: usize) -> u128 {
    let noise = random.next_u64();
    let wide = u128::from(noise) << 64 | u128::from(random.next_u64());
    match kind {
        0 => 0,
        1 => 0x0102_0304_0506_0708_090a_0b0c_0d0e_0f10,
        2 => number as u128,
        3 => wide,
        4 => u128::from(noise % 5) * 0x0123_4567_89ab_cdef,
        5 => (number / 300) as u128 * 0xfedc_ba98_7654_3211,
        6 => 1 << 70 | 5 << 50 | u128::from(noise % 1_000_000),
        7 => u128::from(noise % 50) << 24 | u128::from(noise >> 8 & 0xffff) | wide << 40,
        8 => (u128::from(noise & 0xff_ffff) * 0x0100_0001) & 0xffff_ffff_ffff,
        9 => u128::from((200_000.0 + (noise % 5_000_000) as f64 * 1e-5).to_bits()),
        _ => {
            if noise.is_multiple_of(50) {
                wide
            } else {
                3
            }
        }
    }
}

const KINDS: usize = 11;

#[test]
fn columns_of_any_content_and_length_come_back() {
    let mut random = Random::new(1);
    for kind in 0..KINDS {
        for count in [1, 2, 3, 4, 5, 17, 64, 1000, 9000] {
            for size in 1..=MAX_NUMBER {
                let planes = column(count, size, |number| values(kind, &mut random, number));
                encoded(&[Column::Numbers(size)], &planes, count);
            }
            encoded(&[Column::Colours], &column(count, 8, |n| values(kind, &mut random, n)), count);
            let positions = column(count, 16, |n| values(kind, &mut random, n));
            encoded(&[Column::Positions], &positions, count);
        }
    }
}

#[test]
fn columns_behind_one_another_come_back() {
    let mut random = Random::new(2);
    for round in 0..300 {
        let count = [1, 2, 63, 700][round % 4];
        let columns: Vec<Column> =
            (0..1 + random.below(9)).map(|_| Column::Numbers(1 + random.below(8) as usize)).collect();
        let planes: Vec<u8> = columns
            .iter()
            .flat_map(|c| {
                let kind = random.below(KINDS as u64) as usize;
                column(count, c.size(), |number| values(kind, &mut random, number))
            })
            .collect();
        encoded(&columns, &planes, count);
    }
}

#[test]
fn columns_longer_than_a_meta_block_come_back() {
    let mut random = Random::new(3);
    let count = MAX_BYTES / 8 + 5;
    let columns = [Column::Positions, Column::Numbers(1), Column::Numbers(8), Column::Numbers(3)];
    for kinds in [[2, 10, 9, 0], [0, 0, 0, 0], [3, 5, 3, 7]] {
        let parts = columns.iter().zip(kinds);
        let planes: Vec<u8> =
            parts.flat_map(|(c, kind)| column(count, c.size(), |n| values(kind, &mut random, n))).collect();
        encoded(&columns, &planes, count);
    }
    // more of one value than a meta-block may hold
    let count = (1 << 24) + 3;
    let stream = encoded(&[Column::Numbers(2)], &column(count, 2, |_| 513), count);
    assert!(stream.len() < 200, "{} bytes", stream.len());
}

#[test]
fn what_is_stored_is_close_to_what_there_is() {
    let mut random = Random::new(4);
    let count = 20_000;
    let mut bits = |column: Column, kind: usize| {
        let planes = self::column(count, column.size(), |number| values(kind, &mut random, number));
        8.0 * encoded(&[column], &planes, count).len() as f64 / count as f64
    };
    let mut at_most = |most: f64, column, kind, why| {
        let stored = bits(column, kind);
        assert!(stored <= most, "{why}: {stored} bits");
    };
    at_most(0.02, Column::Numbers(8), 0, "one value");
    at_most(0.6, Column::Numbers(8), 5, "67 runs");
    at_most(32.1, Column::Numbers(4), 3, "noise");
    at_most(2.5, Column::Numbers(1), 4, "five values, 2.3 bits");
    at_most(30.0, Column::Colours, 8, "24 bits twice, two commands");
    at_most(24.5, Column::Numbers(8), 6, "a million values, 20 bits");
}

#[test]
fn the_stream_does_not_depend_on_what_was_encoded_before() {
    let mut random = Random::new(5);
    let mut encoder = ColumnEncoder::default();
    let all: Vec<Vec<u8>> =
        (0..KINDS).map(|kind| column(3000, 8, |number| values(kind, &mut random, number))).collect();
    let columns = [Column::Numbers(8)];
    for planes in all.iter().chain(all.iter().rev()) {
        let mut out = Vec::new();
        encoder.encode(planes, &columns, 3000, &|| true, &mut out).unwrap();
        assert_eq!(out, encoded(&columns, planes, 3000));
    }
}

#[test]
fn it_stops_when_asked_to_and_leaves_the_output_as_it_was() {
    let asked = std::cell::Cell::new(0);
    let goes_on = || asked.replace(asked.get() + 1) < 2;
    let planes = column(1 << 20, 4, |number| number as u128);
    let mut out = vec![7];
    let stopped = ColumnEncoder::default().encode(&planes, &[Column::Numbers(4)], 1 << 20, &goes_on, &mut out);
    assert!(matches!(stopped, Err(WriteError::Stopped)));
    assert_eq!((out, asked.get()), (vec![7], 3));
}

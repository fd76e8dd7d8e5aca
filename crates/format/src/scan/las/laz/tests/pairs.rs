//! Two chunks decoded in turn give what each gives alone.

use pointmill_testkit::{Random, damage};

use super::format::{Decoded, Format, Models, formats};

/// Decodes each alone, and both in turn; what they have in common is told.
fn check(format: Format, models: &mut Models, chunks: [&[u8]; 2], points: [usize; 2], step: usize) -> [Decoded; 2] {
    let both = format.decode_two(models, chunks, points, step);
    for (i, (records, result)) in both.iter().enumerate() {
        let (alone, why) = format.decode(models, chunks[i], points[i], step);
        let what = format!("chunk {i} of {format:?}, {points:?} points in steps of {step}");
        assert_eq!(format!("{result:?}"), format!("{why:?}"), "{what}");
        assert!(*records == alone, "{what}");
    }
    both
}

#[test]
fn chunks_of_any_length_come_back() {
    let mut random = Random::new(41);
    for format in formats() {
        let mut models = format.models();
        for points in [[1, 1], [1, 700], [600, 1], [1300, 1300], [900, 400]] {
            let right = points.map(|points| format.points(points, 0.2, &mut random));
            let chunks = right.each_ref().map(|points| format.chunk(points));
            for step in [3, 300, 512] {
                let both = check(format, &mut models, chunks.each_ref().map(Vec::as_slice), points, step);
                for ((records, result), right) in both.into_iter().zip(right.clone()) {
                    assert!(result.is_ok() && records == format.without_waveforms(right), "{format:?}: {result:?}");
                }
            }
        }
    }
}

/// `POINTMILL_MUTATIONS` sets the number of damaged pairs per format (default 30).
#[test]
fn damage_of_one_chunk_does_not_touch_the_other() {
    const POINTS: usize = 90;
    for (f, format) in formats().enumerate() {
        let mut random = Random::new(42 << 32 | f as u64);
        let right = [0; 2].map(|_| format.points(POINTS, 0.3, &mut random));
        let (whole, mut models) = (right.each_ref().map(|points| format.chunk(points)), format.models());
        for round in 0..damage::rounds(30) {
            let mut chunks = whole.clone();
            for chunk in &mut chunks[..1 + (round % 2) as usize] {
                let places = [0..chunk.len(), format.record_len()..chunk.len()];
                *chunk = damage::mutated(chunk, &places, &mut random);
            }
            chunks.rotate_left((round / 2 % 2) as usize);
            let _ = check(format, &mut models, chunks.each_ref().map(Vec::as_slice), [POINTS; 2], 32);
        }
    }
}

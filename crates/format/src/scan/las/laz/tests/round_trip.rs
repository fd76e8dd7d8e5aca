//! What the crate `laz` encodes comes back, byte for byte.

use pointmill_testkit::Random;

use super::format::formats;

#[test]
fn points_of_every_format_come_back() {
    let mut random = Random::new(11);
    for format in formats() {
        // one set of models for all chunks: nothing of one may be left in the next
        let mut models = format.models();
        for (points, share) in [(1, 0.5), (2, 1.0), (600, 0.0), (3000, 0.02), (1500, 0.3), (700, 1.0), (1, 0.5)] {
            let right = format.points(points, share, &mut random);
            let chunk = format.chunk(&right);
            let (found, result) = format.decode(&mut models, &chunk, points, 512);
            let what = format!("{format:?}, {points} points, {share}");
            assert!(result.is_ok(), "{what}: {result:?}");
            assert!(found == format.without_waveforms(right), "{what}");
        }
    }
}

/// The smallest steps, and steps that end in the midst of a block of layers.
#[test]
fn a_chunk_may_be_taken_in_any_steps() {
    let mut random = Random::new(12);
    for format in formats().filter(|format| format.extra == 1) {
        let points = format.points(1400, 0.2, &mut random);
        let (chunk, mut models) = (format.chunk(&points), format.models());
        let right = format.without_waveforms(points);
        for step in [1, 7, 513, 1400] {
            let (found, result) = format.decode(&mut models, &chunk, 1400, step);
            assert!(result.is_ok() && found == right, "{format:?} in steps of {step}: {result:?}");
        }
    }
}

/// Counts are halved, and the bounds of models as fine as they get.
#[test]
fn a_chunk_of_many_points_comes_back() {
    let mut random = Random::new(13);
    for format in formats().filter(|format| format.extra == 1 && matches!(format.number, 3 | 8)) {
        let points = 50_000;
        let right = format.points(points, 0.1, &mut random);
        let (found, result) = format.decode(&mut format.models(), &format.chunk(&right), points, 512);
        assert!(result.is_ok() && found == right, "{format:?}: {result:?}");
    }
}

//! Damaged chunks: an error, and before it only points that are right as far as their bytes say.

use pointmill_testkit::{Random, damage};

use super::super::Stop;
use super::format::{Decoded, Format, formats};

const POINTS: usize = 60;

/// Decodes; no panic, no more points than there are, no record that is not whole.
fn check(format: Format, models: &mut super::format::Models, chunk: &[u8]) -> Decoded {
    let (found, result) = format.decode(models, chunk, POINTS, 16);
    assert!(found.len() <= POINTS * format.record_len() && found.len().is_multiple_of(format.record_len()));
    assert_eq!(result.is_ok(), found.len() == POINTS * format.record_len());
    (found, result)
}

/// A run of them made decoders change the sequence of GPS times, or stretch an empty interval, without end.
#[test]
fn runs_of_equal_bytes_end_in_an_error_or_in_points() {
    let mut random = Random::new(31);
    let mut senseless = 0;
    for format in formats() {
        let chunk = format.chunk(&format.points(POINTS, 0.3, &mut random));
        let mut models = format.models();
        for start in (format.record_len()..chunk.len()).step_by(17) {
            for (byte, end) in [(0xff, start + 40), (0xff, chunk.len()), (0x00, chunk.len())] {
                let mut bad = chunk.clone();
                bad[start..end.min(chunk.len())].fill(byte);
                let (_, result) = check(format, &mut models, &bad);
                senseless += usize::from(matches!(result, Err(Stop::Corrupt { .. })));
            }
        }
    }
    assert!(senseless > 500, "{senseless}");
}

/// Cut anywhere, the points before the cut are those that were encoded, and no others come.
#[test]
fn a_chunk_of_records_cut_anywhere_gives_the_points_before() {
    let mut random = Random::new(32);
    for format in formats().filter(|format| !format.is_layered()) {
        let right = format.points(POINTS, 0.3, &mut random);
        let (chunk, mut models, mut most) = (format.chunk(&right), format.models(), 0);
        for end in 0..chunk.len() {
            let (found, result) = check(format, &mut models, &chunk[..end]);
            assert!(matches!(result, Err(Stop::CutShort)), "{format:?} cut to {end}: {result:?}");
            assert!(right.starts_with(&found), "{format:?} cut to {end}");
            assert!(found.len() >= most, "more bytes give no fewer points");
            most = found.len();
        }
        assert_eq!(most, (POINTS - 1) * format.record_len(), "the last byte belongs to the last point");
    }
}

#[test]
fn a_layer_cut_anywhere_gives_the_points_before() {
    let mut random = Random::new(33);
    for format in formats().filter(|format| format.is_layered() && format.extra == 1) {
        let right = format.points(POINTS, 0.3, &mut random);
        let (chunk, mut models) = (format.chunk(&right), format.models());
        let right = format.without_waveforms(right);
        let sizes = format.record_len() + 4;
        let mut start = first_layer(&chunk, sizes, format);
        let layers = (start - sizes) / 4;
        for layer in 0..layers {
            let place = sizes + 4 * layer;
            let size = damage::u32_at(&chunk, place) as usize;
            for cut in 1..=size {
                let mut bad = chunk.clone();
                bad.drain(start + size - cut..start + size);
                damage::put(&mut bad, place, &((size - cut) as u32).to_le_bytes());
                let (found, result) = check(format, &mut models, &bad);
                let is_empty = cut == size;
                let is_known = is_empty || result.is_ok() || matches!(result, Err(Stop::LayerEnds { .. }));
                assert!(is_known, "{format:?}, layer {layer} cut by {cut}: {result:?}");
                assert!(is_empty || right.starts_with(&found), "{format:?}, layer {layer} cut by {cut}");
            }
            start += size;
        }
        assert_eq!(start, chunk.len());
    }
}

/// First byte of the layers of a chunk.
pub(super) fn first_layer(chunk: &[u8], sizes: usize, format: Format) -> usize {
    let layers = |start: usize| (start - sizes) / 4;
    let sum = |start: usize| (0..layers(start)).map(|i| damage::u32_at(chunk, sizes + 4 * i) as usize).sum::<usize>();
    let mut starts = (sizes + 36..sizes + 200).step_by(4);
    starts.find(|start| start + sum(*start) == chunk.len()).unwrap_or_else(|| panic!("{format:?}"))
}

#[test]
fn sizes_of_layers_that_lie_are_refused_with_their_place() {
    let format = Format { number: 7, extra: 1, version: 3 };
    let chunk = format.chunk(&format.points(POINTS, 0.3, &mut Random::new(34)));
    let mut models = format.models();
    for layer in 0..11 {
        let place = format.record_len() + 4 + 4 * layer;
        for size in [u32::MAX, chunk.len() as u32] {
            let mut bad = chunk.clone();
            damage::put(&mut bad, place, &size.to_le_bytes());
            let (found, result) = check(format, &mut models, &bad);
            assert!(found.is_empty());
            assert!(matches!(result, Err(Stop::Corrupt { at, .. }) if at == place as u64), "{layer}: {result:?}");
        }
    }
    for end in 0..format.record_len() + 4 + 4 * 11 {
        assert!(check(format, &mut models, &chunk[..end]).0.is_empty());
    }
}

/// `POINTMILL_MUTATIONS` sets the number of damaged chunks per format (default 100: 4,800 in all).
#[test]
fn any_bytes_are_survived() {
    for (f, format) in formats().enumerate() {
        let mut random = Random::new(35 << 32 | f as u64);
        let whole = format.chunk(&format.points(POINTS, 0.3, &mut random));
        let mut models = format.models();
        for round in 0..damage::rounds(100) {
            let bytes = match round % 4 {
                0 => (0..whole.len()).map(|_| random.next_u32() as u8).collect(),
                _ => damage::mutated(&whole, &[0..whole.len(), format.record_len()..whole.len()], &mut random),
            };
            let _ = check(format, &mut models, &bytes);
        }
    }
}

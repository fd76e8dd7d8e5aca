//! LAZ chunks of all sizes, and chunks that no encoder wrote.

use laz::LazVlrBuilder;
use pointmill_testkit::files;

use crate::common::{LAS, fixture, laz_file, points_start, read_bytes};

/// Sizes of chunks.
enum Chunks {
    Fixed(u32),
    /// As many points as these, again and again.
    Variable(&'static [usize]),
}

#[test]
fn chunks_of_any_size_give_the_points_of_the_plain_file() {
    let sizes = [Chunks::Fixed(1), Chunks::Fixed(2), Chunks::Fixed(50_000), Chunks::Variable(&[1, 30, 2, 17])];
    for point_format in 0..=10u8 {
        let plain = fixture(&format!("format{point_format}.las"));
        let right = read_bytes(&plain).unwrap();
        let len = usize::from(u16::from_le_bytes([plain[105], plain[106]]));
        let records = &plain[points_start(&plain)..][..right.len() * len];
        for chunks in &sizes {
            let vlr = LazVlrBuilder::default().with_point_format(point_format, 0).unwrap();
            let vlr = match chunks {
                Chunks::Fixed(size) => vlr.with_fixed_chunk_size(*size),
                Chunks::Variable(_) => vlr.with_variable_chunk_size(),
            };
            let bytes = laz_file(point_format, vlr.build(), right.len(), |compressor| match chunks {
                Chunks::Fixed(_) => compressor.compress_many(records).unwrap(),
                Chunks::Variable(sizes) => {
                    let mut rest = records;
                    for size in sizes.iter().cycle() {
                        let (chunk, behind) = rest.split_at((size * len).min(rest.len()));
                        compressor.compress_many(chunk).unwrap();
                        if behind.is_empty() {
                            break;
                        }
                        compressor.finish_current_chunk().unwrap();
                        rest = behind;
                    }
                }
            });
            let cloud = read_bytes(&bytes).unwrap();
            assert!(cloud.errors.is_empty(), "format {point_format}: {:?}", cloud.errors);
            assert_eq!((&cloud.xyz, &cloud.columns), (&right.xyz, &right.columns), "format {point_format}");
        }
    }
}

/// They made a decoder that calls itself overflow its stack, which nobody can catch.
#[test]
fn runs_of_0xff_are_an_error_in_every_format() {
    for point_format in 0..=10u8 {
        let whole = fixture(&format!("format{point_format}.laz"));
        let first = points_start(&whole) + 8 + usize::from(u16::from_le_bytes([whole[105], whole[106]]));
        // behind the sizes of the layers, where there are any
        let first = if point_format < 6 { first } else { first + 4 + 4 * 12 };
        for start in (first..whole.len() - 600).step_by(97) {
            let mut bytes = whole.clone();
            bytes[start..start + 500].fill(0xff);
            let cloud = read_bytes(&bytes).unwrap();
            let (lost, errors) = (150 - cloud.len(), cloud.errors.len());
            assert_eq!(lost > 0, errors > 0, "format {point_format} from {start}: {:?}", cloud.errors);
            let places = cloud.errors.iter().map(|error| error.to_string());
            assert!(places.into_iter().all(|line| line.contains("(byte ")), "{:?}", cloud.errors);
        }
    }
}

/// Found by fuzzing: a layered chunk whose GPS times change from sequence to sequence for ever.
#[test]
fn gps_times_that_change_sequences_for_ever_are_an_error() {
    let cloud = LAS.read(&files::fixture("broken/gps_time_recursion.laz")).unwrap();
    assert_eq!((cloud.len(), cloud.errors.len()), (0, 1));
    let line = cloud.errors[0].to_string();
    assert!(line.contains("the compressed bytes make no sense (byte 3333)"), "{line}");
}

//! What is written is read back: every point once, within the promised error, whatever the cloud is like.

use std::collections::{BTreeMap, HashMap};

use pointmill_format::batches::{
    AlignedBytes, BATCH_POINTS, BatchRecord, BatchScratch, Batches, Grid, LOD_LEVELS, Precision, lod_of, rgb_of,
};
use pointmill_format::{Lattice, NodePoints};

use crate::util::{Points, open};

/// The promise of §5: half a cell, plus the rounding of doubles.
fn bound(record: &BatchRecord, precision: Precision) -> [f64; 3] {
    let half = record.sides().map(|s| s / f64::from(2u32 << precision.bits()));
    std::array::from_fn(|a| half[a] + f64::from(record.max[a]) * 2f64.powi(-51))
}

/// Writes with three planes, reads, and checks all promises that the source's integers can be held against.
#[track_caller]
fn assert_promises(cloud: &Points, cell: f64) -> Batches<AlignedBytes> {
    let options = cloud.options(cell).precision(Precision::Thirty);
    let (bytes, written) = cloud.write(&options);
    let batches = open(&bytes).unwrap();
    assert_eq!(batches.header(), &written.header);
    assert_eq!(batches.read_everything().unwrap(), cloud.len() as u64);

    // by position on the lattice: the points of the source
    let mut left: HashMap<[i64; 3], Vec<[u8; 3]>> = HashMap::new();
    for i in 0..cloud.len() {
        left.entry(cloud.positions.each_ref().map(|p| p[i])).or_default().push(rgb_of(cloud.colours[i]));
    }
    let grid = batches.header().grid;
    let mut largest: BTreeMap<u32, [f64; 3]> = BTreeMap::new();
    let (mut points, mut scratch) = (NodePoints::default(), BatchScratch::default());
    let (mut before, mut lods) = (0, [0; 4]);
    for m in 0..batches.header().batches {
        let slot = batches.swap(m);
        let record = batches.records()[slot as usize];
        batches.read_batch(slot, Precision::Thirty, &mut scratch, &mut points).unwrap();
        for i in 0..points.len() {
            let index = slot * BATCH_POINTS + i as u32;
            let world = points.world(i).unwrap();
            let quantized = std::array::from_fn(|a| cloud.lattice.quantize(a, world[a]));
            let colours = left.get_mut(&quantized).unwrap_or_else(|| panic!("{quantized:?} is not of the source"));
            let original = batches.original_colour(index).unwrap();
            let found = colours.iter().position(|c| *c == original).expect("its colour is kept");
            colours.swap_remove(found);

            let truth = grid.relative(cloud.lattice.world(quantized));
            assert!((0..3).all(|a| f64::from(record.min[a]) <= truth[a] && truth[a] <= f64::from(record.max[a])));
            let code = grid.morton_code(grid.cells(truth));
            assert!(code >= before, "Morton order");
            before = code;
            for precision in Precision::ALL {
                let decoded = batches.position(index, precision).unwrap();
                let decoded_relative = record.decode(record.quantize(truth), precision);
                assert_eq!(batches.world(decoded_relative), decoded);
                let most = largest.entry(precision.bits()).or_default();
                for a in 0..3 {
                    let error = (decoded_relative[a] - truth[a]).abs();
                    assert!(error <= bound(&record, precision)[a], "{error} on axis {a} with {precision:?}");
                    most[a] = most[a].max(error);
                }
            }
            lods[usize::from(lod_of(points.column::<u32>("colour").unwrap()[i]))] += 1;
        }
    }
    assert!(left.values().all(Vec::is_empty), "every point once");
    assert_eq!(lods, written.lod_points);
    for precision in Precision::ALL {
        let stored = batches.description().errors.get(precision).unwrap();
        assert_eq!(stored.max, largest.get(&precision.bits()).copied().unwrap_or_default());
        assert!((0..3).all(|a| stored.rms[a] <= stored.max[a]));
    }
    assert_levels(cloud, &batches, cell);
    batches
}

/// Levels by their definition, in another way than the writer: each cell on its own.
fn assert_levels(cloud: &Points, batches: &Batches<AlignedBytes>, cell: f64) {
    let grid = batches.header().grid;
    let points: Vec<_> = batches.points_in_morton_order(Precision::Thirty).map(Result::unwrap).collect();
    for level in 0..LOD_LEVELS {
        let mut cells: BTreeMap<[u32; 3], Vec<usize>> = BTreeMap::new();
        for (i, p) in points.iter().enumerate() {
            let world = cloud.lattice.world(std::array::from_fn(|a| cloud.lattice.quantize(a, p.world[a])));
            let u = grid.relative(world).map(|r| r / cell);
            cells.entry(u.map(|u| (u * f64::from(1 << level)).floor() as u32)).or_default().push(i);
        }
        for members in cells.values() {
            assert!(members.iter().any(|i| u32::from(points[*i].lod) <= level), "an occupied cell has its candidate");
            for i in members.iter().filter(|i| u32::from(points[**i].lod) == level) {
                let mean = [0, 1, 2].map(|c| {
                    let sum: usize = members
                        .iter()
                        .map(|m| usize::from(batches.original_colour(points[*m].index).unwrap()[c]))
                        .sum();
                    ((sum + members.len() / 2) / members.len()) as u8
                });
                assert_eq!(points[*i].rgb, mean);
            }
        }
        if level == 0 {
            assert_eq!(points.iter().filter(|p| p.lod == 0).count(), cells.len());
        }
    }
}

const MILLIMETRES: Lattice = Lattice { scale: [0.001; 3], offset: [0.0; 3] };

fn at(offset: [f64; 3]) -> Lattice {
    Lattice { offset, ..MILLIMETRES }
}

#[test]
fn clouds_far_from_the_origin_and_below_zero_keep_the_promises() {
    for offset in [[0.0; 3], [4_428_000.5, -1_000_000.25, 4_400_000.0], [-1e7, -1e7, -1e7], [-12.3456789, -0.5, -0.001]]
    {
        assert_promises(&Points::random(7, 3_000, [20_000, 15_000, 4_000], false, at(offset)), 1.0);
    }
}

#[test]
fn extents_of_a_millimetre_and_of_a_thousand_kilometres_keep_the_promises() {
    let fine = Lattice { scale: [1e-7; 3], offset: [0.3, 0.1, -0.2] };
    let batches = assert_promises(&Points::random(8, 2_000, [10_000; 3], false, fine), 1e-4);
    assert_eq!(batches.header().grid.morton_bits, 21);
    let batches = assert_promises(&Points::random(9, 2_000, [1 << 30, 1 << 30, 1], false, at([-5e5, 5e6, 0.0])), 1.0);
    assert_eq!((batches.header().grid.morton_bits, batches.header().grid.exponent), (32, 21));
}

#[test]
fn every_number_of_points_around_a_batch_keeps_the_promises() {
    for points in [0, 1, 2, 10_239, 10_240, 10_241, 20_480, 5 * 10_240 + 1] {
        let batches = assert_promises(&Points::random(10, points, [9_000; 3], true, MILLIMETRES), 1.0);
        assert_eq!(batches.header().batches as usize, points.div_ceil(10_240));
    }
}

#[test]
fn points_at_one_place_and_axes_without_extent_keep_the_promises() {
    for sides in [[1, 1, 1], [500, 1, 1], [1, 1, 7], [40_000, 30_000, 1]] {
        for offset in [[0.5; 3], [0.1, 123_456.7, -0.3]] {
            assert_promises(&Points::random(11, 11_000, sides, false, at(offset)), 1.0);
        }
    }
}

#[test]
fn points_on_the_borders_of_cells_and_boxes_keep_the_promises_and_attain_the_bound() {
    let lattice = Lattice { scale: [0.25; 3], offset: [-8.0; 3] };
    let mut cloud = Points::empty(lattice, false);
    for (x, y, z) in (0..33).flat_map(|x| (0..33).flat_map(move |y| (0..9).map(move |z| (x, y, z)))) {
        cloud.push([x, y, z], [(x * 7) as u8, (y * 7) as u8, 255], None);
    }
    let batches = assert_promises(&cloud, 1.0);
    assert_eq!(batches.header().points, 33 * 33 * 9);
    let sides = batches.records()[0].sides();
    for precision in Precision::ALL {
        let stored = batches.description().errors.get(precision).unwrap().max;
        assert_eq!(
            stored,
            sides.map(|s| s / f64::from(2u32 << precision.bits())),
            "a corner of the box errs by half a cell"
        );
    }
}

#[test]
fn the_order_of_the_input_does_not_show() {
    let cloud = Points::random(12, 25_000, [60; 3], true, MILLIMETRES);
    let mut reversed = Points::empty(MILLIMETRES, true);
    for i in (0..cloud.len()).rev() {
        let intensity = u16::from_le_bytes([cloud.attributes[0].1[2 * i], cloud.attributes[0].1[2 * i + 1]]);
        let extra = Some((intensity, cloud.attributes[1].1[i]));
        reversed.push(cloud.positions.each_ref().map(|p| p[i]), rgb_of(cloud.colours[i]), extra);
    }
    let options = cloud.options(0.01);
    assert!(cloud.write(&options).0 == reversed.write(&options).0);
}

#[test]
fn planes_that_say_nothing_are_left_out_and_the_integers_still_come_back() {
    for (scale, expected) in [(0.5, Precision::Ten), (0.001, Precision::Twenty), (1e-6, Precision::Thirty)] {
        let lattice = Lattice { scale: [scale; 3], offset: [17.0, -3.0, 0.25] };
        let side = (100.0 / scale) as u64;
        let cloud = Points::random(13, 12_000, [side, side, side / 4], false, lattice);
        let (bytes, written) = cloud.write(&cloud.options(1.0));
        assert_eq!(written.header.precision(), expected);
        let errors = &written.description.errors;
        assert_eq!(Precision::ALL.map(|p| errors.get(p).is_some()), Precision::ALL.map(|p| p <= expected));
        let batches = open(&bytes).unwrap();
        let mut found: Vec<[i64; 3]> = Vec::new();
        for point in batches.points_in_morton_order(Precision::Thirty) {
            let world = point.unwrap().world;
            found.push(std::array::from_fn(|a| lattice.quantize(a, world[a])));
        }
        let mut source: Vec<[i64; 3]> = (0..cloud.len()).map(|i| cloud.positions.each_ref().map(|p| p[i])).collect();
        found.sort();
        source.sort();
        assert!(found == source);
    }
}

#[test]
fn attributes_follow_their_points() {
    // the intensity identifies the point, the class is x
    let mut cloud = Points::empty(MILLIMETRES, true);
    for i in 0..30_000u32 {
        let x = i64::from(i.wrapping_mul(2_654_435_761) >> 24);
        cloud.push([x, i64::from(i % 2000), 0], [0; 3], Some(((i % 2000) as u16, x as u8)));
    }
    let (bytes, _) = cloud.write(&cloud.options(1.0));
    let batches = open(&bytes).unwrap();
    assert_eq!(batches.attributes().map(|a| a.name.as_str()).collect::<Vec<_>>(), ["intensity", "classification"]);
    let (intensity, class) = (batches.attribute::<u16>(0).unwrap(), batches.attribute::<u8>(1).unwrap());
    assert!(batches.attribute::<i16>(0).is_none() && batches.attribute::<u8>(2).is_none());
    for point in batches.points_in_morton_order(Precision::Thirty).map(Result::unwrap) {
        let [x, y, _] = std::array::from_fn(|a| MILLIMETRES.quantize(a, point.world[a]));
        let i = point.index as usize;
        assert_eq!((i64::from(class[i]), i64::from(intensity[i])), (x, y));
    }
}

#[cfg(feature = "zstd")]
#[test]
fn compressed_sections_hold_the_same() {
    use pointmill_format::batches::{BlockScratch, Part, compress};
    use std::io::Cursor;
    let cloud = Points::random(14, 7 * 10_240 + 5, [3_000, 3_000, 200], true, MILLIMETRES);
    let (bytes, _) = cloud.write(&cloud.options(1.0));
    let raw = open(&bytes).unwrap();
    for per_block in [1, 3, 8, 256] {
        let mut file = Cursor::new(Vec::new());
        let header = compress(&raw, &mut file, 3, per_block).unwrap();
        assert!(file.get_ref().len() < bytes.len());
        let packed = open(file.get_ref()).unwrap();
        assert_eq!(packed.header(), &header);
        assert_eq!((packed.records(), packed.originals()), (raw.records(), raw.originals()));
        assert!(packed.hi10().is_none() && packed.colour().is_none() && packed.attribute::<u8>(1).is_none());
        assert_eq!(packed.read_everything().unwrap(), cloud.len() as u64);
        let (mut a, mut b) = (BlockScratch::default(), BlockScratch::default());
        let parts = [Part::Hi10, Part::Mid10, Part::Colour, Part::Attribute(0), Part::Attribute(1)];
        for part in parts {
            for slot in [7, 0, 3, 2, 1, 6, 5, 4] {
                assert_eq!(packed.batch(part, slot, &mut a).unwrap(), raw.batch(part, slot, &mut b).unwrap());
            }
        }
        assert!(packed.batch(Part::Hi10, 8, &mut a).is_err());
        for part in parts {
            let (section, mut reads) = (packed.compressed_section(part).unwrap(), 0);
            let mut c = BlockScratch::default();
            for slot in 0..8 {
                let read = |at: u64, out: &mut [u8]| {
                    reads += 1;
                    out.copy_from_slice(&file.get_ref()[at as usize..at as usize + out.len()]);
                    Ok(())
                };
                assert_eq!(section.batch(slot, &mut c, read).unwrap(), raw.batch(part, slot, &mut b).unwrap());
            }
            assert_eq!(reads, 8u32.div_ceil(per_block), "once a block");
            let unread = |_, _: &mut [u8]| panic!("there is no such slot");
            assert!(section.batch(8, &mut c, unread).is_err());
        }
        assert!(packed.compressed_section(Part::Lo10).is_err() && raw.compressed_section(Part::Hi10).is_err());
    }
}

#[cfg(feature = "mmap")]
#[test]
fn a_mapped_file_is_the_file_that_was_read() {
    let cloud = Points::random(15, 12_345, [3_000; 3], true, MILLIMETRES);
    let (bytes, _) = cloud.write(&cloud.options(1.0));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.qbatch");
    std::fs::write(&path, bytes).unwrap();
    let (mapped, read) = (Batches::map(&path).unwrap(), Batches::open(&path).unwrap());
    assert_eq!((mapped.hi10(), mapped.colour(), mapped.records()), (read.hi10(), read.colour(), read.records()));
    assert_eq!(mapped.read_everything().unwrap(), 12_345);
    assert!(Batches::map(folder.path().join("none")).unwrap_err().to_string().contains("none: opening"));
    std::fs::write(&path, b"").unwrap();
    assert!(Batches::map(&path).unwrap_err().to_string().contains("QBATCHES"), "an empty file maps to nothing");
}

#[test]
fn buffers_that_are_not_aligned_are_refused_with_advice() {
    let (bytes, _) =
        Points::random(16, 10, [9; 3], false, MILLIMETRES).write(&Points::empty(MILLIMETRES, false).options(1.0));
    let shifted = AlignedBytes::from([&[0][..], &bytes].concat().as_slice());
    let error = Batches::from_bytes(&shifted.as_ref()[1..], "a").unwrap_err().to_string();
    assert!(error.contains("AlignedBytes"), "{error}");
}

#[test]
fn iterating_undoes_the_swap_and_storage_order_does_not() {
    let cloud = Points::random(18, 6 * 10_240 + 1, [9_000; 3], false, MILLIMETRES);
    let (bytes, _) = cloud.write(&cloud.options(1.0).precision(Precision::Thirty));
    let batches = open(&bytes).unwrap();
    let grid = batches.header().grid;
    let mut points: Vec<_> = batches.points_in_morton_order(Precision::Thirty).map(Result::unwrap).collect();
    let code = |world: [f64; 3]| {
        let lattice_point = cloud.lattice.world(std::array::from_fn(|a| cloud.lattice.quantize(a, world[a])));
        grid.morton_code(grid.cells(grid.relative(lattice_point)))
    };
    assert!(points.is_sorted_by_key(|p| code(p.world)));
    points.sort_by_key(|p| p.index);
    assert!(points.iter().enumerate().all(|(i, p)| p.index as usize == i), "every index once");
    assert!(!points.is_sorted_by_key(|p| code(p.world)));
}

#[test]
fn grids_of_the_reader_and_of_the_writer_are_one() {
    let cloud = Points::random(17, 100, [9_000; 3], false, MILLIMETRES);
    let (bytes, written) = cloud.write(&cloud.options(0.3));
    let header = open(&bytes).unwrap().header().clone();
    assert_eq!(Grid::new(&header.tight, 0.3).unwrap(), written.header.grid);
}

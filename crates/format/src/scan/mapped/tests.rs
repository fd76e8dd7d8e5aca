use std::sync::Arc;

use super::map::{PointMap, ScanMap};
use super::scan::mapped;
use crate::{
    Aabb, Affine, Attribute, AttributeType, AxisGrid, Column, Lattice, Piece, PointBatch, Positions, ReadError,
    Resolution, Scan, ScanInfo, ScanWarning, Scratch, Sink, Wanted,
};

/// One piece with these points.
struct Fake {
    info: ScanInfo,
    pieces: Vec<Piece>,
    batch: PointBatch,
}

impl Fake {
    fn new(positions: Positions, columns: &[(&str, Column)]) -> Self {
        let mut info = ScanInfo::new("a.las", "", positions.len() as u64);
        let attributes = columns.iter().map(|(name, column)| Attribute::new(*name, column.ty(), 1));
        info.attributes = attributes.collect();
        if matches!(positions, Positions::Quantized(_)) {
            info.lattice = Some(Lattice { scale: [0.01, 0.02, 0.05], offset: [100.0, 200.0, 300.0] });
        }
        let pieces = vec![Piece::new(0..positions.len() as u64, 0..0)];
        let mut batch = PointBatch::new(0, positions, info.attributes.clone());
        batch.columns = columns.iter().map(|(_, column)| column.clone()).collect();
        Self { info, pieces, batch }
    }

    fn boxed(self) -> Box<dyn Scan> {
        Box::new(self)
    }
}

impl Scan for Fake {
    fn info(&self) -> &ScanInfo {
        &self.info
    }

    fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    fn decode_bytes(&self, _: &Wanted) -> u64 {
        0
    }

    fn decode(&self, _: usize, wanted: &Wanted, _: &mut Scratch, sink: &mut Sink<'_>) -> Result<(), ReadError> {
        let mut batch = self.batch.clone();
        let columns = batch.columns.iter_mut().enumerate();
        columns.filter(|(i, _)| !wanted.is_wanted(*i)).for_each(|(_, column)| column.clear());
        let _ = sink(&batch);
        Ok(())
    }
}

fn integers() -> Positions {
    Positions::Quantized([vec![1, -2], vec![10, 20], vec![100, 300]])
}

fn matrix(rows: [[f64; 4]; 3]) -> Affine {
    let mut all = [0.0; 16];
    all[..12].copy_from_slice(rows.as_flattened());
    all[15] = 1.0;
    Affine::from_matrix(&all).unwrap()
}

/// Half a radian and more: 3-4-5 about z, then 10 m to the north.
fn turn() -> Affine {
    matrix([[0.6, -0.8, 0.0, 0.0], [0.8, 0.6, 0.0, 10.0], [0.0, 0.0, 1.0, 0.0]])
}

fn all(scan: &dyn Scan) -> PointBatch {
    let mut batches: Vec<_> = scan.batches(Wanted::all(scan.info())).collect();
    batches.remove(0).unwrap()
}

fn moved(fake: Fake, affine: Affine) -> Box<dyn Scan> {
    mapped(fake.boxed(), &ScanMap::new(affine)).unwrap()
}

#[test]
fn integers_stay_the_integers_of_the_file_where_each_axis_follows_one() {
    let map = Affine::scaling([0.5; 3]).then(&Affine::Y_UP).then(&matrix([
        [1.0, 0.0, 0.0, 1000.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, -7.0],
    ]));
    let scan = moved(Fake::new(integers(), &[]), map);
    let lattice = scan.info().lattice.unwrap();
    assert_eq!((lattice.scale, lattice.offset), ([0.005, 0.025, 0.01], [1050.0, -150.0, 93.0]));
    let Positions::Quantized(q) = all(&*scan).positions else { panic!() };
    assert_eq!(q, [vec![1, -2], vec![-100, -300], vec![10, 20]]);
}

#[test]
fn any_other_map_makes_world_coordinates_of_the_step_that_the_file_has() {
    let mut fake = Fake::new(integers(), &[]);
    fake.info.bounds_declared = Some(Aabb { min: [99.98, 200.2, 305.0], max: [100.01, 200.4, 315.0] });
    let scan = moved(fake, turn());
    assert_eq!(scan.info().lattice, None);
    let Positions::World([x, y, z]) = all(&*scan).positions else { panic!() };
    let (east, north) = (100.01, 200.2);
    assert!(
        (x[0] - (0.6 * east - 0.8 * north)).abs() < 1e-12 && (y[0] - (0.8 * east + 0.6 * north + 10.0)).abs() < 1e-12
    );
    assert_eq!(z[0], 305.0);
    let bounds = scan.info().bounds_declared.unwrap();
    assert!((bounds.min[0] - (0.6 * 99.98 - 0.8 * 200.4)).abs() < 1e-12 && bounds.max[2] == 315.0, "{bounds:?}");
    // x has 0.6 of the step in x and 0.8 of that in y; z is the z of the file
    let grid = Resolution::Grid(AxisGrid { step: 0.05, offset: 300.0 });
    let (x, y) = (0.006f64.hypot(0.016), 0.008f64.hypot(0.012));
    assert_eq!(scan.info().resolution, [Resolution::Step(x), Resolution::Step(y), grid]);
}

#[test]
fn what_single_precision_resolves_is_that_of_the_file_not_of_the_place_it_is_moved_to() {
    let shift = matrix([[1.0, 0.0, 0.0, 5e5], [0.0, 1.0, 0.0, 5.4e6], [0.0, 0.0, 1.0, 0.0]]);
    let mut fake = Fake::new(Positions::World([vec![0.0, 8.0], vec![1.0, 9.0], vec![1.0, 15.0]]), &[]);
    fake.info.resolution = [Resolution::Single; 3];
    let step = Resolution::Step(2f64.powi(-20));
    assert_eq!(moved(fake, shift).info().resolution, [step, step, Resolution::Single], "x and y up to 9, z not moved");
    let mut fake = Fake::new(Positions::World([vec![0.0], vec![1.0], vec![2.0]]), &[]);
    fake.info.resolution = [Resolution::Single; 3];
    assert_eq!(moved(fake, Affine::Y_UP).info().resolution, [Resolution::Single; 3], "the same numbers on other axes");
}

#[test]
fn a_shift_keeps_scaled_integers_of_e57_on_their_own_steps() {
    let mut fake = Fake::new(Positions::World([vec![0.5], vec![1.0], vec![2.0]]), &[]);
    fake.info.resolution = [Resolution::Grid(AxisGrid { step: 0.001, offset: 0.5 }); 3];
    let map =
        Affine::scaling([2.0; 3]).then(&matrix([[0.0, -1.0, 0.0, 7.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]));
    let grid = |offset| Resolution::Grid(AxisGrid { step: 0.002, offset });
    assert_eq!(moved(fake, map).info().resolution, [grid(6.0), grid(1.0), grid(1.0)]);
}

fn normals() -> Vec<(&'static str, Column)> {
    vec![
        ("NormalX", Column::Float32(vec![1.0, 0.0])),
        ("intensity", Column::UInt16(vec![7, 8])),
        ("NormalY", Column::Float32(vec![0.0, 0.0])),
        ("NormalZ", Column::Float32(vec![0.0, 0.0])),
    ]
}

#[test]
fn normals_turn_with_the_points_and_none_stays_none() {
    let batch = all(&*moved(Fake::new(integers(), &normals()), turn()));
    assert_eq!(batch.column::<f32>("NormalX"), Some(&[0.6, 0.0][..]));
    assert_eq!(batch.column::<f32>("NormalY"), Some(&[0.8, 0.0][..]));
    assert_eq!(batch.column::<u16>("intensity"), Some(&[7, 8][..]));
    // stretched east: a wall that faces north-east comes to face more to the north
    let (h, stretch) = (0.5f64.sqrt() as f32, Affine::scaling([3.0, 1.0, 1.0]));
    let wall = [h, h, 0.0].map(|v| Column::Float32(vec![v, v]));
    let [x, y, z] = wall;
    let fake = Fake::new(integers(), &[("normal x", x), ("normal y", y), ("normal z", z)]);
    let batch = all(&*moved(fake, stretch));
    let expected = (1.0f32 / 10.0f32.sqrt(), 3.0f32 / 10.0f32.sqrt());
    let found = (batch.column::<f32>("normal x").unwrap()[0], batch.column::<f32>("normal y").unwrap()[0]);
    assert!((found.0 - expected.0).abs() < 1e-6 && (found.1 - expected.1).abs() < 1e-6, "{found:?}");
}

#[test]
fn normals_of_small_integers_turn_too() {
    let bytes = |v: i8| Column::Int8(vec![v]);
    let mut fake = Fake::new(
        Positions::World([vec![1.0], vec![2.0], vec![3.0]]),
        &[("nx", bytes(127)), ("ny", bytes(0)), ("nz", bytes(0))],
    );
    let mut attributes = fake.info.attributes.to_vec();
    attributes.iter_mut().for_each(|a| a.scale = vec![1.0 / 127.0]);
    fake.info.attributes = attributes.into();
    let batch = all(&*moved(fake, turn()));
    assert_eq!((&batch.columns[0], &batch.columns[1]), (&bytes(76), &bytes(102)));
    assert_eq!(batch.attributes()[0].ty, AttributeType::Int8);
}

#[test]
fn one_component_alone_is_right_too_and_the_others_are_not_given() {
    let scan = moved(Fake::new(integers(), &normals()), turn());
    let wanted = Wanted::named(scan.info(), ["NormalY"]).unwrap();
    let batch = scan.batches(wanted).next().unwrap().unwrap();
    assert_eq!(batch.column::<f32>("NormalY"), Some(&[0.8, 0.0][..]));
    assert_eq!((batch.columns[0].len(), batch.columns[1].len(), batch.columns[3].len()), (0, 0, 0));
}

#[test]
fn a_shift_or_a_change_of_unit_leaves_normals_bit_for_bit() {
    let columns: Vec<_> = ["NormalX", "NormalY", "NormalZ"].map(|n| (n, Column::Float32(vec![0.1, 0.7]))).into();
    let batch = all(&*moved(Fake::new(integers(), &columns), Affine::scaling([0.3048; 3])));
    assert_eq!(batch.columns[0], Column::Float32(vec![0.1, 0.7]));
    let batch = all(&*moved(Fake::new(integers(), &columns), Affine::scaling([0.3048; 3]).then(&Affine::Y_UP)));
    assert_eq!(batch.columns[1], Column::Float32(vec![-0.1, -0.7]));
}

#[test]
fn the_least_integer_cannot_be_negated_and_is_not_changed_in_silence() {
    let least = Positions::Quantized([vec![1, 1], vec![1, 1], vec![5, i32::MIN]]);
    let scan = moved(Fake::new(least.clone(), &[]), Affine::Y_UP);
    let error = scan.batches(Wanted::all(scan.info())).next().unwrap().unwrap_err();
    assert!(error.to_string().contains("point 1 has the coordinate -2147483648"), "{error}");
    let kept = all(&*moved(Fake::new(least, &[]), Affine::scaling([2.0; 3])));
    assert!(matches!(kept.positions, Positions::Quantized(q) if q[2][1] == i32::MIN));
}

#[test]
fn splats_that_are_turned_say_that_their_shapes_are_not() {
    let splat = || Fake::new(integers(), &[("rot_0", Column::Float32(vec![1.0, 1.0]))]);
    assert_eq!(moved(splat(), Affine::Y_UP).info().warnings, [ScanWarning::SplatsUnturned]);
    let shift = matrix([[1.0, 0.0, 0.0, 5.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
    assert_eq!(moved(splat(), shift).info().warnings, []);
}

/// Squares x, has no image for y < 0.
#[derive(Debug)]
struct Square;

impl PointMap for Square {
    fn map(&self, [x, y, z]: [&mut [f64]; 3]) {
        for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
            *x *= *x;
            if *y < 0.0 {
                (*x, *y, *z) = (f64::NAN, f64::NAN, f64::NAN);
            }
        }
    }
}

#[test]
fn a_projection_comes_last_and_what_it_cannot_map_is_no_position() {
    let mut fake = Fake::new(Positions::World([vec![3.0, 4.0], vec![1.0, -20.0], vec![0.0, 0.0]]), &normals());
    fake.info.bounds_declared = Some(Aabb { min: [3.0, -20.0, 0.0], max: [4.0, 1.0, 0.0] });
    fake.info.resolution = [Resolution::Step(0.001), Resolution::Double, Resolution::Step(0.5)];
    let map = ScanMap { projection: Some(Arc::new(Square)), ..ScanMap::new(Affine::scaling([10.0, 1.0, 1.0])) };
    let scan = mapped(fake.boxed(), &map).unwrap();
    let Positions::World([x, y, _]) = all(&*scan).positions else { panic!() };
    assert!(x[0] == 900.0 && y[0] == 1.0 && x[1].is_nan() && y[1].is_nan());
    let bounds = scan.info().bounds_declared.unwrap();
    assert_eq!((bounds.min[0], bounds.max[0]), (900.0, 1600.0));
    assert_eq!((bounds.min[1], bounds.max[1]), (1.0, 1.0), "only what has an image");
    // in the middle, at y = -9.5, there is no image: nothing is known of x and y
    assert_eq!(scan.info().resolution, [Resolution::Double; 3]);
    assert_eq!(scan.info().warnings, [ScanWarning::DirectionsProjected]);
}

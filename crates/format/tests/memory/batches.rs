//! Batches are bounded by bytes as well as by points.

use pointmill_format::{MAX_BATCH_BYTES, MAX_BATCH_POINTS, Wanted};
use pointmill_testkit::reader;

use crate::scenes::{self, Scene};

/// Batches of a scene; `reader::read` refuses one that is too large.
fn sizes(scene: &Scene) -> Vec<usize> {
    let scan = scene.open();
    assert_eq!(reader::read(scan.as_ref(), &Wanted::all(scan.info())).len(), scene.points, "{}", scene.name);
    scan.batches(Wanted::all(scan.info())).map(|batch| batch.unwrap().len()).collect()
}

#[test]
fn wide_points_come_in_batches_of_few_and_usual_ones_in_batches_of_many() {
    for scene in scenes::wide() {
        let sizes = sizes(&scene);
        let most = MAX_BATCH_BYTES / scene.point_bytes;
        assert!(sizes.iter().all(|n| *n <= most), "{}: {sizes:?}, at most {most}", scene.name);
        // and not much smaller than they may be: a piece may end before
        assert!(sizes[0] > most - 8, "{}: {sizes:?}, at most {most}", scene.name);
    }
    for scene in scenes::usual() {
        let piece = scene.open().pieces()[0].points as usize;
        let most = (MAX_BATCH_BYTES / scene.point_bytes).min(MAX_BATCH_POINTS);
        assert_eq!(sizes(&scene)[0], piece.min(most), "{}", scene.name);
    }
}

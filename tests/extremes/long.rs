//! What takes long because there is much of it.

use std::io::Write as _;

use pointmill_testkit::las::{Las, Point};

use crate::output::OUTPUTS;
use crate::support::Dir;

#[test]
#[ignore = "long"]
fn ten_million_points_at_one_place() {
    const POINTS: u64 = 10_000_000;
    let dir = Dir::new();
    let place = [123_456_789, -7, 2_000_000_011];
    let mut las = Las { point_format: 6, ..Las::new(vec![Point::at(place)]) };
    (las.scale, las.points_declared) = ([0.001; 3], Some(POINTS));
    let bytes = las.bytes();
    let (header, record) = bytes.split_at(las.header_len());
    let mut file = std::io::BufWriter::new(std::fs::File::create(dir.path("a.las")).unwrap());
    file.write_all(header).unwrap();
    (0..POINTS).for_each(|_| file.write_all(record).unwrap());
    file.into_inner().unwrap();
    let formats = ["potree2", "potree1", "copc", "bintree", "batches"];
    let options = ["convert", "a.las", "-o", "out", "--attributes", "intensity", "-q"];
    dir.succeed(options.into_iter().chain(formats.iter().flat_map(|format| ["--to", format])));
    let world = [0, 1, 2].map(|a| f64::from(place[a]) * las.scale[a] + las.offset[a]);
    for output in OUTPUTS.iter().filter(|output| output.run == 0) {
        let dataset = format!("out/{}", output.folder);
        dir.validate(&dataset, &["a.las"]);
        let decoded = output.decode(&dir.path(&dataset));
        assert_eq!(decoded.len() as u64, POINTS, "{}", output.name);
        // one place: what is left is the rounding of doubles, at 5.4e6; a box of batches is a distance of singles wide
        let most = [1.2e-7, 1e-8][usize::from(output.folder != "batches")];
        let error = |p: &[f64; 3]| (0..3).map(|a| (p[a] - world[a]).abs()).fold(0.0, f64::max);
        let worst = decoded.iter().map(|p| error(&p.world)).fold(0.0, f64::max);
        assert!(worst <= most, "{}: {worst:e}", output.name);
    }
}

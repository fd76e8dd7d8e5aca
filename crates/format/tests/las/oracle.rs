//! The `las` crate reads the same points, where it is right.

use pointmill_format::{Column, Lattice};

use crate::common::{self, LAS};

#[test]
fn the_las_crate_agrees_point_by_point() {
    // it refuses LAS 1.5
    for fixture in common::small_fixtures().iter().filter(|f| f.name != "las/las_1_5.las") {
        let cloud = LAS.read(&fixture.path).unwrap();
        let Lattice { scale, offset } = cloud.info.lattice.unwrap();
        let mut reader = las::Reader::from_path(&fixture.path).unwrap();
        let Column::UInt16(intensity) = cloud.column("intensity") else { panic!() };
        let Column::UInt8(returns) = cloud.column("return number") else { panic!() };
        let mut count = 0;
        let points = reader.read_all().unwrap();
        for (i, point) in points.points().enumerate() {
            let point = point.unwrap();
            let world = [0, 1, 2].map(|a| cloud.xyz[a][i] * scale[a] + offset[a]);
            assert_eq!([point.x, point.y, point.z], world, "{}", fixture.name);
            assert_eq!((point.intensity, point.return_number), (intensity[i], returns[i]));
            count += 1;
        }
        assert_eq!(count, cloud.len(), "{}", fixture.name);
    }
}

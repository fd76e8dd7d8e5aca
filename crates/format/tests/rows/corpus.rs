//! Real files of other projects, when they are at hand.

use pointmill_testkit::files;

use crate::common::ROWS;

#[test]
fn sound_files_give_their_points() {
    let Some(corpus) = files::corpus("") else { return };
    for (file, points, attributes) in [
        ("ply/issue_2421.ply", 1, "i int32x1"),
        ("ply/mesh.ply", 4, ""),
        ("ply/mesh_fixed.ply", 4, ""),
        ("ply/simple_binary.ply", 3, ""),
        ("ply/simple_text.ply", 3, ""),
        ("ply/sized_dims.ply", 1, "j int32x1, i doublex1"),
        ("ply/unsized_dims.ply", 1, "i doublex1, j int32x1"),
        (
            "ply/text_extradim.ply",
            1,
            "rgb uint16x3, NormalX floatx1, NormalY floatx1, NormalZ floatx1, alpha uint8x1, omg int32x1",
        ),
        (
            "pcd/autzen-utm.pcd",
            1065,
            "rgb uint16x3, intensity uint16x1, classification uint8x1, return number uint8x1, number of returns \
             uint8x1, scan direction flag uint8x1, edge of flight line uint8x1, scan angle floatx1, user data \
             uint8x1, point source id uint16x1, gps-time doublex1",
        ),
        ("pcd/missingheader.pcd", 10, ""),
        ("pcd/utm17_comma.pcd", 10, ""),
        ("pcd/utm17_space.pcd", 10, ""),
        ("pcd/utm17_tab.pcd", 10, ""),
        ("text/1.2-with-color.ptx", 1065, "rgb uint16x3, intensity floatx1"),
        ("text/autzen.pts", 10, "rgb uint16x3, intensity uint16x1"),
        ("text/complex-transform.ptx", 4, "rgb uint16x3, intensity floatx1"),
        ("text/crlf_test.txt", 10, "intensity uint16x1"),
        ("text/missingheader.txt", 5, "intensity uint16x1"),
        ("text/no-color.ptx", 15, "intensity floatx1"),
        ("text/quoted.txt", 9, ""),
        ("text/site_56_8.pts", 8, "intensity uint16x1"),
        ("text/test.pts", 19, "rgb uint16x3, intensity uint16x1"),
        ("text/utm17_1.txt", 10, ""),
    ] {
        let cloud = ROWS.read(&corpus.join(file)).unwrap();
        assert!(cloud.errors.is_empty(), "{file}: {:?}", cloud.errors);
        assert_eq!((cloud.len(), cloud.attributes().as_str()), (points, attributes), "{file}");
    }
}

#[test]
fn what_cannot_be_told_is_refused_with_advice() {
    let Some(corpus) = files::corpus("") else { return };
    for (file, what) in [
        ("ply/no_vertex.ply", "there is no element vertex"),
        ("broken/no_vertex.ply", "there is no element vertex"),
        ("text/badheader.txt", "no z"),
    ] {
        let result = ROWS.read(&corpus.join(file));
        match result {
            Err(e) => assert!(e.to_string().contains(what) && e.advice().is_some(), "{e}"),
            Ok(cloud) => assert!(cloud.warned(what), "{file}: {:?}", cloud.info),
        }
    }
}

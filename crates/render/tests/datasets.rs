//! Pictures of the fixtures of all formats.

use std::path::PathBuf;

use pointmill_render::{Camera, Colour, Picture, RenderError, Scene, Size, Style, View, render_dataset};

fn fixture(name: &str) -> PathBuf {
    PathBuf::from(format!("{}/../../fixtures/{name}", env!("CARGO_MANIFEST_DIR")))
}

const ALL: [&str; 9] = [
    "potree2/default",
    "potree2/brotli",
    "potree1/words",
    "copc/format8.copc.laz",
    "bintree/files",
    "bintree/packed",
    "batches/blocks.qbatch",
    "e57/scans.e57",
    "las/format7.laz",
];

fn size() -> Size {
    Size::new(160, 120).unwrap()
}

fn picture(name: &str, style: &Style, threads: usize) -> Picture {
    let scene = Scene::open(fixture(name)).unwrap();
    scene.render(&scene.best_view(size()), size(), style, u64::MAX, threads).unwrap()
}

#[test]
fn every_kind_of_dataset_is_rendered() {
    for name in ALL {
        for style in [Style::plain(), Style::averaged(), Style::default()] {
            let picture = picture(name, &style, 2);
            assert!(picture.covered() > 0, "{name}: {:?}", picture.drawn);
            assert!(picture.drawn.points > 0 && picture.drawn.bytes > 0, "{name}: {:?}", picture.drawn);
        }
    }
}

#[test]
fn pictures_do_not_depend_on_threads() {
    let styles = [
        Style::averaged(),
        Style { eye_dome: 1.0, is_averaged: true, ..Style::default() },
        Style { colour: Colour::Overdraw, ..Style::plain() },
    ];
    for name in ALL {
        for style in &styles {
            assert_eq!(picture(name, style, 1), picture(name, style, 8), "{name} {style:?}");
        }
    }
}

#[test]
fn a_colour_that_is_not_there_is_refused_with_what_is() {
    let style = Style { colour: Colour::Normal, ..Style::default() };
    let error = render_dataset(fixture("las/format7.laz"), None, size(), &style, 1, 1).unwrap_err();
    assert!(matches!(error, RenderError::NoAttribute { .. }));
    let line = error.to_string();
    assert!(line.contains("format7.laz: the points have no normals to") && line.contains("intensity, "), "{line}");
}

#[test]
fn cameras_anywhere_make_a_picture() {
    for name in ALL {
        let scene = Scene::open(fixture(name)).unwrap();
        let bounds = scene.bounds();
        for eye in [bounds.center(), bounds.min, [1e30, -1e30, 1e30], [0.0; 3]] {
            let camera = Camera::new(eye, [bounds.max[0] + 1.0, bounds.max[1], bounds.max[2]]);
            for style in
                [Style::default(), Style { has_boxes: true, is_averaged: true, eye_dome: 1.0, ..Style::default() }]
            {
                scene.render(&camera, size(), &style, 1000, 2).unwrap();
            }
        }
    }
}

#[test]
fn a_budget_is_kept_by_all_that_have_levels() {
    for name in ["potree2/default", "bintree/packed"] {
        let scene = Scene::open(fixture(name)).unwrap();
        let camera = scene.view(View::South, size());
        let all = scene.render(&camera, size(), &Style::plain(), u64::MAX, 1).unwrap().drawn;
        let few = scene.render(&camera, size(), &Style::plain(), all.points / 2, 1).unwrap().drawn;
        assert!(few.points < all.points, "{name}: {few:?} of {all:?}");
    }
}

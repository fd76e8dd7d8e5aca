//! The names that columns have in other programs.
//!
//! Names count without case, unit, blanks and punctuation, so that "Coord. X [m]", "POINT_X" and "Points:0" are told by
//! one table.

/// Names of x, y and z. The first row with x and y is taken, and its first z; without one the first of [`HEIGHTS`].
pub(super) const POSITIONS: [[&[&str]; 3]; 6] = [
    [&["x"], &["y"], &["z"]],
    [
        &["coordx", "xcoord", "coordinatex", "xcoordinate", "pointx", "posx", "positionx", "cartesianx"],
        &["coordy", "ycoord", "coordinatey", "ycoordinate", "pointy", "posy", "positiony", "cartesiany"],
        &["coordz", "zcoord", "coordinatez", "zcoordinate", "pointz", "posz", "positionz", "cartesianz"],
    ],
    [&["points0", "pointsx"], &["points1", "pointsy"], &["points2", "pointsz"]],
    [&["easting", "eastings", "east", "rechtswert"], &["northing", "northings", "north", "hochwert"], HEIGHTS],
    [&["longitude", "long", "lon", "lng"], &["latitude", "lat"], HEIGHTS],
    [&["e"], &["n"], HEIGHTS],
];

/// Names of z beside any x and y, the surest first.
pub(super) const HEIGHTS: &[&str] =
    &["z", "coordz", "pointz", "elevation", "elev", "altitude", "alt", "height", "höhe", "hoehe", "h"];

pub(super) const COLOURS: [[&[&str]; 3]; 5] = [
    [&["red"], &["green"], &["blue"]],
    [&["r"], &["g"], &["b"]],
    [&["diffusered"], &["diffusegreen"], &["diffuseblue"]],
    [
        &["rgb0", "rgba0", "colors0", "color0", "colorr"],
        &["rgb1", "rgba1", "colors1", "color1", "colorg"],
        &["rgb2", "rgba2", "colors2", "color2", "colorb"],
    ],
    UNIT_COLOURS,
];

/// Colours of 0–1, by their names.
pub(super) const UNIT_COLOURS: [&[&str]; 3] = [&["rf"], &["gf"], &["bf"]];

pub(super) const NORMALS: [[&[&str]; 3]; 4] = [
    [&["nx"], &["ny"], &["nz"]],
    [&["normalx"], &["normaly"], &["normalz"]],
    [&["normalsx"], &["normalsy"], &["normalsz"]],
    [&["normals0", "normal0"], &["normals1", "normal1"], &["normals2", "normal2"]],
];

pub(super) const INTENSITIES: &[&str] = &["intensity", "scalarintensity", "i"];
pub(super) const CLASSES: &[&str] = &["classification", "class", "scalarclassification", "c"];

/// What a title is compared by.
pub(super) fn key(name: &str) -> String {
    let bare = name.split(['[', '(', '{']).next().unwrap_or(name).trim();
    let lower = bare.to_lowercase();
    let words: Vec<_> = lower.split([' ', '_', '.', ':', '-', '\t']).filter(|w| !w.is_empty()).collect();
    let unit = |w: &&&str| ["m", "metre", "metres", "meter", "meters", "ft", "feet", "mm", "deg"].contains(w);
    let kept = words.len() - usize::from(words.len() > 1 && words.last().filter(unit).is_some());
    words[..kept].concat()
}

/// True if the name is one that a table has.
pub(super) fn has_meaning(name: &str) -> bool {
    let key = key(name);
    let key = key.as_str();
    let families = POSITIONS.iter().chain(&COLOURS).chain(&NORMALS);
    families.flatten().any(|names| names.contains(&key)) || INTENSITIES.contains(&key) || CLASSES.contains(&key)
}

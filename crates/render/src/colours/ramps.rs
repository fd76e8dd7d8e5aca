//! Colours for numbers.

/// Stops of the ramp of heights, from low to high: blue, green, yellow, red.
const HEIGHT: [[f32; 3]; 5] =
    [[48.0, 60.0, 170.0], [40.0, 160.0, 190.0], [90.0, 190.0, 80.0], [240.0, 210.0, 70.0], [200.0, 50.0, 40.0]];

/// Stops of the ramp of counts: black, violet, orange, white.
const HEAT: [[f32; 3]; 4] = [[10.0, 8.0, 30.0], [120.0, 30.0, 120.0], [240.0, 130.0, 40.0], [255.0, 255.0, 235.0]];

/// The darkest grey of an intensity: a point is not black on a dark background.
const DARKEST: f32 = 30.0;

/// Classes 0 to 18 of LAS 1.4, table 17; others are spread over the same colours.
const CLASSES: [[u8; 3]; 19] = [
    [160, 160, 160], // never classified
    [190, 190, 190], // unclassified
    [160, 120, 80],  // ground
    [150, 200, 110], // low vegetation
    [90, 170, 70],   // medium vegetation
    [40, 120, 40],   // high vegetation
    [220, 90, 70],   // building
    [255, 0, 255],   // low point, noise
    [220, 220, 60],  // key point, reserved
    [70, 120, 220],  // water
    [150, 90, 160],  // rail
    [110, 110, 120], // road surface
    [200, 160, 220], // overlap, reserved
    [250, 200, 80],  // wire, guard
    [255, 230, 120], // wire, conductor
    [130, 160, 190], // transmission tower
    [240, 150, 60],  // wire connector
    [120, 200, 200], // bridge deck
    [255, 80, 200],  // high noise
];

/// Levels from coarse to fine; deeper ones begin again.
const LEVELS: [[u8; 3]; 8] = [
    [230, 60, 60],
    [240, 150, 50],
    [235, 220, 70],
    [100, 200, 80],
    [60, 190, 190],
    [70, 120, 230],
    [150, 90, 210],
    [230, 110, 190],
];

/// Within 0 and 1; what is not a number is the lowest.
fn part(t: f32) -> f32 {
    if t > 0.0 { t.min(1.0) } else { 0.0 }
}

fn ramp<const N: usize>(stops: &[[f32; 3]; N], t: f32) -> [u8; 3] {
    let at = part(t) * (N - 1) as f32;
    let below = (at as usize).min(N - 2);
    let above = at - below as f32;
    std::array::from_fn(|c| (stops[below][c] + (stops[below + 1][c] - stops[below][c]) * above + 0.5) as u8)
}

/// Of a height, from 0 (low) to 1.
pub(super) fn height(t: f32) -> [u8; 3] {
    ramp(&HEIGHT, t)
}

/// Of an intensity, from 0 to 1.
pub(super) fn grey(t: f32) -> [u8; 3] {
    [(DARKEST + (255.0 - DARKEST) * part(t) + 0.5) as u8; 3]
}

/// Of how many points fell into a pixel: 1 dark, 1,024 white.
pub(crate) fn overdraw(points: u32) -> [u8; 3] {
    ramp(&HEAT, 0.1 + 0.9 * (points.max(1) as f32).log2() / 10.0)
}

/// Of a class of LAS.
pub(super) fn class(class: f64) -> [u8; 3] {
    let class = if class >= 0.0 { class as usize } else { 0 };
    CLASSES[class % CLASSES.len()]
}

/// Of a level of detail.
pub(crate) fn level(level: u8) -> [u8; 3] {
    LEVELS[usize::from(level) % LEVELS.len()]
}

/// Of the bits of a position.
pub(super) fn bits(bits: Option<u32>) -> [u8; 3] {
    match bits {
        Some(10) => [90, 190, 90],
        Some(20) => [240, 210, 70],
        Some(_) => [220, 60, 50],
        None => [255; 3],
    }
}

/// Of a normal: −1 to 1 is 0 to 255. Without a direction: grey.
pub(super) fn normal([x, y, z]: [f64; 3]) -> [u8; 3] {
    let length = (x * x + y * y + z * z).sqrt();
    let by = if length > 0.0 && length.is_finite() { 1.0 / length } else { 0.0 };
    [x, y, z].map(|c| if by > 0.0 { (127.5 + 127.5 * c * by + 0.5) as u8 } else { 128 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ramps_begin_and_end_where_they_are_said_to() {
        assert_eq!([height(0.0), height(-5.0), height(f32::NAN)], [[48, 60, 170]; 3]);
        assert_eq!([height(1.0), height(f32::INFINITY)], [[200, 50, 40]; 2]);
        assert_eq!(height(0.5), [90, 190, 80]);
        assert_eq!(height(0.125), [44, 110, 180]);
        assert_eq!([grey(0.0), grey(1.0)], [[30; 3], [255; 3]]);
        assert_eq!(overdraw(1024), [255, 255, 235]);
        assert!(overdraw(1) < overdraw(2) && overdraw(0) == overdraw(1));
    }

    #[test]
    fn names_have_a_colour_whatever_their_number() {
        assert_eq!(class(2.0), [160, 120, 80]);
        assert_eq!([class(-1.0), class(f64::NAN)], [class(0.0); 2]);
        assert_eq!(class(255.0), CLASSES[255 % 19]);
        assert_eq!(level(9), LEVELS[1]);
        assert_eq!([normal([0.0, 0.0, 2.0]), normal([0.0; 3])], [[128, 128, 255], [128; 3]]);
        assert_eq!(normal([-1.0, 0.0, 0.0])[0], 0);
    }
}

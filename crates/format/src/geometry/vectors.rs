//! Products of vectors.

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

pub(crate) fn length(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

/// The same direction with length 1; not a number without a direction.
pub(crate) fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = length(v);
    v.map(|c| c / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_those_of_the_textbook() {
        let (a, b) = ([2.0, 3.0, 5.0], [7.0, 11.0, 13.0]);
        assert_eq!((dot(a, b), cross(a, b), minus(a, b)), (112.0, [-16.0, 9.0, 1.0], [-5.0, -8.0, -8.0]));
        assert_eq!((length([2.0, -3.0, 6.0]), unit([0.0, -8.0, 0.0])), (7.0, [0.0, -1.0, 0.0]));
    }
}

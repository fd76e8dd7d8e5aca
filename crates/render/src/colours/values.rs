//! Columns as numbers.

use pointmill_format::Column;

/// Hands out the values of one element of a column whose points have `elements` each, in order.
pub(super) fn each(column: &Column, elements: usize, element: usize, mut take: impl FnMut(f64)) {
    macro_rules! match_types {
        ($($name:ident),*) => {
            match column {
                $(Column::$name(values) => {
                    values.iter().skip(element).step_by(elements.max(1)).for_each(|v| take(*v as f64));
                })*
            }
        };
    }
    match_types!(Int8, UInt8, Int16, UInt16, Int32, UInt32, Int64, UInt64, Float32, Float64);
}

/// The values at two places of the order, from 0 (least) to 1 (greatest); values that are not finite do not count. `None`
/// without values.
pub(super) fn percentiles(values: &mut Vec<f64>, [low, high]: [f64; 2]) -> Option<[f64; 2]> {
    values.retain(|v| v.is_finite());
    values.sort_unstable_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    let at = |part: f64| values[(part * last as f64).round() as usize];
    Some([at(low), at(high)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_are_taken_one_by_one() {
        let column = Column::UInt16(vec![1, 2, 3, 4, 5, 6]);
        let mut found = Vec::new();
        each(&column, 3, 1, |v| found.push(v));
        assert_eq!(found, [2.0, 5.0]);
    }

    #[test]
    fn a_few_extremes_do_not_count() {
        let mut values: Vec<f64> = (0..=100).map(f64::from).collect();
        values.extend([f64::NAN, f64::INFINITY]);
        values[100] = 1e9;
        assert_eq!(percentiles(&mut values, [0.02, 0.98]), Some([2.0, 98.0]));
        assert_eq!(percentiles(&mut vec![7.0], [0.02, 0.98]), Some([7.0, 7.0]));
        assert_eq!(percentiles(&mut vec![f64::NAN], [0.02, 0.98]), None);
    }
}

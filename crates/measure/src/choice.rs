//! Which settings are worth a look: the Pareto front, and one setting per profile.

use crate::result::{Profile, Row};

/// Figures that differ by less are equal: times of two runs of one conversion do.
const NOISE: f64 = 0.03;

/// What is to be small.
///
/// `rounding`: errors of positions below that are those of doubles, and none.
fn objectives(row: &Row, rounding: f64) -> Option<[f64; 4]> {
    if row.failed.is_some() {
        return None;
    }
    let position = row.position_error()?;
    Some([
        row.seconds_per_million()?,
        row.bytes_per_point()?,
        if position > rounding { position } else { 0.0 },
        row.picture_error()?,
    ])
}

fn is_less(a: f64, b: f64) -> bool {
    a < b * (1.0 - NOISE)
}

/// True if `a` is better in one figure, and in none worse.
fn dominates(a: [f64; 4], b: [f64; 4]) -> bool {
    let is_worse = a.iter().zip(b).any(|(a, b)| is_less(b, *a));
    let is_better = a.iter().zip(b).any(|(a, b)| is_less(*a, b));
    is_better && !is_worse
}

/// Marks the rows that no other dominates: in time, bytes, error of positions and error of pictures. Rows whose pictures are
/// shaded by depth are compared among themselves.
pub(crate) fn mark_front(rows: &mut [Row], rounding: f64) {
    let figures: Vec<_> = rows.iter().map(|row| Some((row.is_shaded_by_depth, objectives(row, rounding)?))).collect();
    for (row, mine) in rows.iter_mut().zip(&figures) {
        // errors of colours and of depths do not compare
        let is_beaten = |(kind, mine): (bool, [f64; 4])| {
            figures.iter().flatten().any(|(other_kind, other)| *other_kind == kind && dominates(*other, mine))
        };
        row.is_on_front = mine.is_some_and(|mine| !is_beaten(mine));
    }
}

/// The settings of the profiles, by output. If some of an output keep the colours, those that do not are none of them.
pub(crate) fn profiles(rows: &[Row], rounding: f64) -> Vec<Profile> {
    let mut outputs: Vec<&str> = Vec::new();
    for row in rows {
        if !outputs.contains(&row.output.as_str()) {
            outputs.push(&row.output);
        }
    }
    let mut profiles = Vec::new();
    for output in outputs {
        let of_it = rows.iter().filter(|row| row.output == output);
        let mut measured: Vec<(&Row, [f64; 4])> =
            of_it.filter_map(|row| Some((row, objectives(row, rounding)?))).collect();
        if measured.iter().any(|(row, _)| !row.is_shaded_by_depth) {
            measured.retain(|(row, _)| !row.is_shaded_by_depth);
        }
        for (name, order) in [("fast", &[0, 1, 3, 2]), ("exact", &[2, 3, 1, 0])] as [(_, &[usize; 4]); 2] {
            profiles.extend(first_by(&measured, order).map(|row| profile(name, row, &measured)));
        }
        profiles.extend(balanced(&measured).map(|row| profile("balanced", row, &measured)));
    }
    profiles
}

/// The row that is best in the first figure of `order`, of those as good as it in the second, and so on.
fn first_by<'a>(measured: &[(&'a Row, [f64; 4])], order: &[usize; 4]) -> Option<&'a Row> {
    let mut left = measured.to_vec();
    for figure in order {
        let least = left.iter().map(|(_, figures)| figures[*figure]).fold(f64::INFINITY, f64::min);
        left.retain(|(_, figures)| !is_less(least, figures[*figure]));
    }
    left.first().map(|(row, _)| *row)
}

/// The row with the smallest sum of time, bytes and error of pictures, each in multiples of the least; of those whose
/// positions are as exact as any.
fn balanced<'a>(measured: &[(&'a Row, [f64; 4])]) -> Option<&'a Row> {
    let exact = measured.iter().map(|(_, figures)| figures[2]).fold(f64::INFINITY, f64::min);
    let mut left = measured.to_vec();
    left.retain(|(_, figures)| !is_less(exact, figures[2]));
    // a difference of pictures below one step of a channel is none
    let floor = |figure: usize| if figure == 3 { 1.0 } else { f64::MIN_POSITIVE };
    let least = |figure: usize| {
        left.iter().map(|(_, figures)| figures[figure]).fold(f64::INFINITY, f64::min).max(floor(figure))
    };
    let least = [0, 1, 3].map(|figure| (figure, least(figure)));
    let sum = |figures: &[f64; 4]| least.iter().map(|(i, least)| figures[*i].max(*least) / least).sum::<f64>();
    left.iter().min_by(|a, b| sum(&a.1).total_cmp(&sum(&b.1))).map(|(row, _)| *row)
}

fn profile(name: &'static str, row: &Row, measured: &[(&Row, [f64; 4])]) -> Profile {
    let least = |figure: usize| measured.iter().map(|(_, f)| f[figure]).fold(f64::INFINITY, f64::min);
    let mine = measured.iter().find(|(other, _)| std::ptr::eq(*other, row)).map_or([0.0; 4], |(_, figures)| *figures);
    let times = |figure: usize| mine[figure] / least(figure).max(f64::MIN_POSITIVE);
    let why = format!(
        "{:.3} s of processor time per million points ({:.2} times the least of this output), {:.2} bytes per point \
         ({:.2} times the least), positions within {:.3e}, pictures {:.2} grey levels off",
        mine[0],
        times(0),
        mine[1],
        times(1),
        mine[2],
        mine[3]
    );
    Profile { name, output: row.output.clone(), setting: row.name.clone(), arguments: row.arguments.clone(), why }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result::{Cost, ViewError};
    use crate::{AxisError, ImageError};

    fn row(name: &str, seconds: f64, bytes: f64, position: f64, picture: f64) -> Row {
        let cost = Cost {
            wall_seconds: 1.0,
            cpu_seconds: Some(seconds),
            points_per_second: 1e6,
            bytes_per_point: bytes,
            ..Cost::default()
        };
        let psnr = (picture > 0.0).then(|| 20.0 * (255.0 / picture).log10());
        let error = ImageError { psnr, ..ImageError::default() };
        Row {
            name: name.to_owned(),
            output: "potree2".to_owned(),
            cost: Some(cost),
            position: Some([AxisError { max: position, ..AxisError::default() }; 3]),
            views: vec![ViewError { view: "whole", error, points: 1 }],
            ..Row::default()
        }
    }

    fn rows() -> Vec<Row> {
        vec![
            row("quick", 1.0, 30.0, 0.0, 9.0),
            row("quick again", 1.01, 30.0, 0.0, 9.0),
            row("small", 4.0, 10.0, 1e-10, 6.0),
            row("middle", 1.5, 12.0, 0.0, 6.1),
            row("rough", 1.2, 9.0, 0.01, 6.0),
            row("worse", 5.0, 31.0, 0.02, 9.5),
            Row { name: "failed".to_owned(), output: "potree2".to_owned(), ..Row::default() },
        ]
    }

    #[test]
    fn the_front_has_what_nothing_beats() {
        let mut rows = rows();
        mark_front(&mut rows, 1e-9);
        let front: Vec<&str> = rows.iter().filter(|row| row.is_on_front).map(|row| row.name.as_str()).collect();
        // "quick again" is within the noise of "quick"
        assert_eq!(front, ["quick", "quick again", "small", "middle", "rough"]);
    }

    #[test]
    fn errors_of_depths_do_not_compare_with_those_of_colours() {
        let mut rows = rows();
        let without = Row { is_shaded_by_depth: true, ..row("no colours", 0.5, 5.0, 0.0, 1.0) };
        rows.push(without);
        mark_front(&mut rows, 1e-9);
        let front: Vec<&str> = rows.iter().filter(|row| row.is_on_front).map(|row| row.name.as_str()).collect();
        assert_eq!(front, ["quick", "quick again", "small", "middle", "rough", "no colours"]);
        assert!(profiles(&rows, 1e-9).iter().all(|p| p.setting != "no colours"));
        rows.iter_mut().for_each(|row| row.is_shaded_by_depth = true);
        assert!(profiles(&rows, 1e-9).iter().any(|p| p.setting == "no colours"));
    }

    #[test]
    fn profiles_are_the_ends_and_the_middle() {
        let profiles = profiles(&rows(), 1e-9);
        let of = |name: &str| profiles.iter().find(|p| p.name == name).unwrap().setting.clone();
        assert_eq!((of("fast"), of("exact"), of("balanced")), ("quick".into(), "small".into(), "middle".into()));
        assert!(profiles[0].why.contains("1.000 s of processor time"), "{}", profiles[0].why);
        assert_eq!(super::profiles(&[], 0.0).len(), 0);
    }
}

//! Plots as SVG.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::prelude::*;

use crate::result::{Measured, Row};

const SIZE: (u32, u32) = (640, 420);

/// A plot.
#[derive(Debug, Clone)]
pub struct Plot {
    /// What it shows.
    pub title: &'static str,
    /// An SVG element.
    pub svg: String,
}

type Series = (String, Vec<(f64, f64)>);

/// The plots of a result: figures against each other, a colour per output.
pub fn plots(result: &Measured) -> Vec<Plot> {
    let scatter = |title, x: (&str, fn(&Row) -> Option<f64>), y: (&str, fn(&Row) -> Option<f64>)| {
        let series = by_output(result, |row| Some((x.1(row)?, y.1(row)?)));
        draw(title, x.0, y.0, &series, false)
    };
    let time: (_, fn(&Row) -> _) = ("processor seconds per million points", Row::seconds_per_million);
    let bytes: (_, fn(&Row) -> _) = ("bytes per point", Row::bytes_per_point);
    let picture: (_, fn(&Row) -> _) = ("difference of pictures, grey levels", Row::picture_error);
    let all = [
        scatter("Time against size", time, bytes),
        scatter("Size against pictures", bytes, picture),
        scatter("Time against pictures", time, picture),
        draw("Colours by level", "points per cell", "mean ΔE2000", &by_level(result, |l| l.delta_e), true),
        draw(
            "Holes by level",
            "points per cell",
            "cells without a point",
            &by_level(result, |l| Some(1.0 - l.covered)),
            true,
        ),
    ];
    all.into_iter().flatten().collect()
}

/// A series per output with a point per row.
fn by_output(result: &Measured, point: impl Fn(&Row) -> Option<(f64, f64)>) -> Vec<Series> {
    let mut series: Vec<Series> = Vec::new();
    for row in &result.rows {
        let Some(point) = point(row).filter(|(x, y)| x.is_finite() && y.is_finite()) else { continue };
        match series.iter_mut().find(|(name, _)| *name == row.output) {
            Some((_, points)) => points.push(point),
            None => series.push((row.output.clone(), vec![point])),
        }
    }
    series
}

/// A line per setting with points of its own, from its coarsest level to its finest.
fn by_level(result: &Measured, figure: impl Fn(&crate::LevelError) -> Option<f64>) -> Vec<Series> {
    let own = result.rows.iter().filter(|row| row.same_points_as.is_none() && row.levels.len() > 1);
    let line = |row: &Row| {
        let points = row.levels.iter().filter(|l| l.cells > 0 && l.points > 0);
        let points = points.filter_map(|l| Some((l.points as f64 / l.cells as f64, figure(l)?)));
        (row.name.clone(), points.collect::<Vec<_>>())
    };
    own.map(line).filter(|(_, points)| !points.is_empty()).take(12).collect()
}

/// `None` without points. A backend that writes to memory does not fail; if it did, there would be no plot.
fn draw(title: &'static str, x: &str, y: &str, series: &[Series], has_lines: bool) -> Option<Plot> {
    let points = || series.iter().flat_map(|(_, points)| points);
    points().next()?;
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        chart(&area, (x, y), [range(points().map(|p| p.0)), range(points().map(|p| p.1))], series, has_lines).ok()?;
        area.present().ok()?;
    }
    Some(Plot { title, svg })
}

/// From 0 to a little above the largest.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let most = values.fold(0.0, f64::max);
    0.0..if most > 0.0 { most * 1.08 } else { 1.0 }
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

fn chart(
    area: &Area<'_>,
    (x, y): (&str, &str),
    [xs, ys]: [Range<f64>; 2],
    series: &[Series],
    has_lines: bool,
) -> Result<(), Box<dyn std::error::Error>> {
    let describe = |e: DrawingAreaErrorKind<_>| e.to_string();
    area.fill(&WHITE).map_err(describe)?;
    let mut builder = ChartBuilder::on(area);
    builder.margin(12).x_label_area_size(40).y_label_area_size(64);
    let mut chart = builder.build_cartesian_2d(xs, ys).map_err(describe)?;
    chart.configure_mesh().light_line_style(WHITE).x_desc(x).y_desc(y).draw().map_err(describe)?;
    for (i, (name, points)) in series.iter().enumerate() {
        let colour = Palette99::pick(i).to_rgba();
        if has_lines {
            chart.draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2))).map_err(describe)?;
        }
        let dots = points.iter().map(|point| Circle::new(*point, 4, colour.filled()));
        let drawn = chart.draw_series(dots).map_err(describe)?;
        drawn.label(name).legend(move |(x, y)| Circle::new((x + 6, y), 4, colour.filled()));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.2))
        .draw()
        .map_err(describe)?;
    Ok(())
}

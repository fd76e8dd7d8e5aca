//! One page with everything in it.

use std::fmt::Write as _;

use base64::Engine as _;

use super::csv::FIGURES;
use super::plots;
use crate::measurement::Shown;
use crate::result::{Measured, Row};
use crate::trades::length;

const HEAD: &str = include_str!("page.html");

/// The report. What comes from files or options is escaped.
pub(super) fn page(result: &Measured, pictures: &[Shown]) -> String {
    let mut page = HEAD.to_owned();
    // writing to a string does not fail
    let _ = write!(page, "<h1>Speed against accuracy</h1>\n{}", scene(result));
    if !result.is_complete {
        page += "<p class=\"warning\">The measurement was interrupted: settings are missing.</p>\n";
    }
    page += &profiles(result);
    page += &sentences(result);
    page += &table(result);
    page += "<h2>Plots</h2>\n<div class=\"row\">\n";
    for plot in plots(result) {
        let _ = writeln!(page, "<figure><figcaption>{}</figcaption>{}</figure>", plot.title, plot.svg);
    }
    page += "</div>\n";
    page += &side_by_side(result, pictures);
    page += "</main></body></html>\n";
    page
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn scene(result: &Measured) -> String {
    let scene = &result.scene;
    let part = if scene.points < scene.points_declared && scene.chunks[1] > 0 {
        format!(
            " Measured was a part of it: {} points in {} of {} columns of ground, evenly spread. Times of reading are those of \
             that part, which is a LAS file.",
            scene.points, scene.chunks[0], scene.chunks[1]
        )
    } else {
        String::new()
    };
    let inputs = match scene.inputs.as_slice() {
        [one] => escaped(one),
        many => format!("{} inputs", many.len()),
    };
    format!(
        "<p>{inputs}: {} points.{part} {} settings in {:.0} s, {} threads each. Pictures of {} × {} pixels, {} points at most.</p>\n",
        scene.points_declared,
        result.rows.len(),
        result.seconds,
        result.threads,
        result.picture_size[0],
        result.picture_size[1],
        result.budget
    )
}

fn profiles(result: &Measured) -> String {
    let mut html = "<h2>What to take</h2>\n<table><tr><th>output</th><th>profile</th><th>setting</th><th>options</th>\
                    <th>figures</th></tr>\n"
        .to_owned();
    for profile in &result.profiles {
        let cells = [&profile.output, profile.name, &profile.setting, &profile.arguments.join(" "), &profile.why];
        let cells: String = cells.iter().map(|cell| format!("<td>{}</td>", escaped(cell))).collect();
        let _ = writeln!(html, "<tr>{cells}</tr>");
    }
    html + "</table>\n<p>fast: the least processor time. exact: the least error of positions, then of pictures. balanced: the \
            least sum of time, bytes and error of pictures, each in multiples of the least, among settings with the most exact \
            positions.</p>\n"
}

fn sentences(result: &Measured) -> String {
    let items: String = result.trades.iter().map(|trade| format!("<li>{}</li>\n", escaped(&trade.sentence))).collect();
    if items.is_empty() { items } else { format!("<h2>What each option buys and costs</h2>\n<ul>{items}</ul>\n") }
}

fn table(result: &Measured) -> String {
    let mut html = "<h2>All settings</h2>\n<p>A click on a heading sorts. Settings in bold: no other is better in one of time, \
                    bytes, positions and pictures, and as good in all of them.</p>\n<div class=\"wide\"><table class=\"sorts\">\
                    <tr><th>setting</th>"
        .to_owned();
    for (name, _) in FIGURES {
        let _ = write!(html, "<th>{}</th>", name.replace('_', " "));
    }
    html += "</tr>\n";
    for row in &result.rows {
        let class = if row.is_on_front { " class=\"front\"" } else { "" };
        let _ = write!(html, "<tr{class}><td>{}</td>{}", escaped(&row.name), figures(row));
        html += "</tr>\n";
    }
    html + "</table></div>\n"
}

fn figures(row: &Row) -> String {
    if let Some(why) = &row.failed {
        return format!("<td colspan=\"{}\">{}</td>", FIGURES.len(), escaped(why));
    }
    let cell = |value: Option<f64>| match value {
        Some(value) => format!("<td data-value=\"{value}\">{}</td>", number(value)),
        None => "<td></td>".to_owned(),
    };
    FIGURES.iter().map(|(_, figure)| cell(figure(row))).collect()
}

/// Three digits, or whole thousands and millions.
fn number(value: f64) -> String {
    match value.abs() {
        v if v >= 1e6 => format!("{:.1} M", value / 1e6),
        v if v >= 1e4 => format!("{:.0} k", value / 1e3),
        _ => length(value),
    }
}

fn side_by_side(result: &Measured, pictures: &[Shown]) -> String {
    let mut html =
        "<h2>Pictures</h2>\n<p>First of each view: all points, colours averaged, gaps filled. The others are what a \
                    renderer shows of the dataset.</p>\n"
            .to_owned();
    if result.scene.has_colours && result.rows.iter().any(|row| row.is_shaded_by_depth) {
        html += "<p>Datasets without colours are shaded by depth, and compared with the cloud shaded likewise: their errors are \
                 those of geometry alone, and do not compare with errors of colours.</p>\n";
    }
    let mut views: Vec<&str> = pictures.iter().filter(|p| p.setting.is_empty()).map(|p| p.view).collect();
    views.dedup();
    for view in views {
        let _ = write!(html, "<h3>{view}</h3>\n<div class=\"row\">\n");
        for picture in pictures.iter().filter(|picture| picture.view == view) {
            let row = result.rows.iter().find(|row| row.name == picture.setting);
            let error = row.and_then(|row| row.views.iter().find(|v| v.view == view)).map(|v| &v.error);
            let caption = match (picture.setting.as_str(), error) {
                ("", _) => "the whole cloud".to_owned(),
                (setting, None) => escaped(setting),
                (setting, Some(error)) => format!(
                    "{}{}: {} dB, SSIM {:.3}, {:.2} % holes",
                    escaped(setting),
                    if row.is_some_and(|row| row.is_shaded_by_depth) { " (by depth)" } else { "" },
                    error.psnr.map_or("∞".to_owned(), |psnr| format!("{psnr:.1}")),
                    error.ssim,
                    error.holes * 100.0
                ),
            };
            let data = base64::engine::general_purpose::STANDARD.encode(&picture.jpeg);
            let _ = writeln!(
                html,
                "<figure><figcaption>{caption}</figcaption><img loading=\"lazy\" alt=\"{caption}\" \
                 src=\"data:image/jpeg;base64,{data}\"></figure>"
            );
        }
        html += "</div>\n";
    }
    html
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result::{Profile, Scene};

    #[test]
    fn names_cannot_break_the_page_and_nothing_is_fetched() {
        let evil = "<script>alert(1)</script>\"&";
        let result = Measured {
            scene: Scene { inputs: vec![evil.to_owned()], ..Scene::default() },
            rows: vec![Row { name: evil.to_owned(), failed: Some(evil.to_owned()), ..Row::default() }],
            profiles: vec![Profile {
                name: "fast",
                output: evil.to_owned(),
                setting: evil.to_owned(),
                arguments: vec![evil.to_owned()],
                why: evil.to_owned(),
            }],
            ..Measured::default()
        };
        let shown = Shown { view: "whole", setting: evil.to_owned(), jpeg: vec![1, 2, 3] };
        let whole = Shown { setting: String::new(), ..shown.clone() };
        let page = page(&result, &[whole, shown]);
        assert_eq!(page.matches("alert(1)").count(), page.matches("&lt;script&gt;alert(1)").count());
        assert!(page.contains("interrupted") && page.contains("data:image/jpeg;base64,AQID"));
        assert!(!page.contains("http://") && !page.contains("https://"), "a page that fetches is not self-contained");
    }
}

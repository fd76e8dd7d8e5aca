//! Titles of columns: cut from a line, and what they mean.
//!
//! A meaning is given to one column only; others that may have it keep their names and are attributes.

use super::column::Column;
use super::title_names::{CLASSES, COLOURS, HEIGHTS, INTENSITIES, NORMALS, POSITIONS, has_meaning, key};
use crate::ScanWarning;
use crate::scan::tabular::Role;

/// Titles of a file, as they stand there.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Titles {
    names: Vec<String>,
    keys: Vec<String>,
}

impl Titles {
    pub(super) fn new(names: Vec<String>) -> Self {
        let keys = names.iter().map(|n| key(n)).collect();
        Self { names, keys }
    }

    /// Cuts a line into titles for `columns` columns, of which the first may have none. `separator`: of the rows.
    pub(super) fn of_line(line: &[u8], columns: usize, separator: Option<u8>) -> Self {
        let text = String::from_utf8_lossy(line);
        let text = text.trim_start_matches('\u{feff}').trim();
        let mut cuts: Vec<Vec<String>> = [separator, Some(b';'), Some(b'\t'), Some(b',')]
            .into_iter()
            .flatten()
            .map(char::from)
            .filter(|s| text.contains(*s))
            .map(|s| cut(text, s))
            .collect();
        let wide = text.replace("  ", "\t");
        cuts.extend([words(text, char::is_whitespace), with_units(text), words(&wide, |c| c == '\t')]);
        for cut in &mut cuts {
            while cut.len() > columns && cut.last().is_some_and(String::is_empty) {
                cut.pop();
            }
        }
        let of_width = |width: usize| cuts.iter().position(|cut| cut.len() == width);
        let best = of_width(columns).or_else(|| of_width(columns.saturating_sub(1))).unwrap_or(0);
        Self::new(cuts.swap_remove(best))
    }

    /// [`Self::of_line`] for a comment; `None` if it does not name x and y. Words may follow the titles.
    pub(super) fn of_comment(line: &[u8], columns: usize, separator: Option<u8>) -> Option<Self> {
        let bare = line.trim_ascii().iter().copied().skip_while(|b| matches!(b, b'#' | b'/' | b'%' | b' '));
        let bare: Vec<u8> = bare.collect();
        // "columns: x y z"
        let after = bare.iter().position(|b| *b == b':').filter(|at| bare.get(at + 1) == Some(&b' '));
        let bare = &bare[after.map_or(0, |at| at + 1)..];
        let mut titles = Self::of_line(bare, columns, separator);
        if titles.names.len() > columns && titles.names[..columns].iter().all(|n| has_meaning(n)) {
            titles.names.truncate(columns);
            titles.keys.truncate(columns);
        }
        titles.name_x_and_y().then_some(titles)
    }

    pub(super) fn len(&self) -> usize {
        self.names.len()
    }

    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// The first column has no title, or the one that pandas gives such a column when it reads it.
    pub(super) fn lack_the_first(&self) -> bool {
        self.keys.first().is_some_and(|k| k.is_empty() || k == "unnamed0")
    }

    pub(super) fn drop_first(&mut self) {
        self.names.remove(0);
        self.keys.remove(0);
    }

    pub(super) fn name_x_and_y(&self) -> bool {
        self.position().is_some()
    }

    /// The columns that these titles describe.
    pub(super) fn columns(&self, warnings: &mut Vec<ScanWarning>) -> Vec<Column> {
        let other = |(i, name): (usize, &String)| match name.as_str() {
            "" => Column::other(&format!("column {}", i + 1)),
            name => Column::other(name),
        };
        let mut columns: Vec<Column> = self.names.iter().enumerate().map(other).collect();
        let mut give = |role: Role, at: Option<usize>| {
            if let Some(column) = at.and_then(|i| columns.get_mut(i)) {
                column.role = role;
            }
        };
        let position = self.position().unwrap_or_else(|| ["x", "y", "z"].map(|name| self.find(&[name], None)));
        (0..3).for_each(|axis| give(Role::Axis(axis), position[axis]));
        let x = position[0];
        for (families, role) in [(&COLOURS[..], Role::Colour as fn(usize) -> Role), (&NORMALS[..], Role::Normal)] {
            let three = families.iter().find_map(|f| self.three(f, x));
            three.into_iter().flatten().enumerate().for_each(|(i, at)| give(role(i), Some(at)));
        }
        // an i before x counts the rows, if anything
        let intensity = self.find(INTENSITIES, x).filter(|i| self.keys[*i] != "i" || Some(*i) > x);
        give(Role::Intensity, intensity);
        give(Role::Classification, self.find(CLASSES, x));
        warnings.extend(self.doubles(&columns));
        columns
    }

    /// True if the colours among the columns are of 0–1 by their names.
    pub(super) fn have_unit_colours(&self) -> bool {
        COLOURS.iter().position(|f| self.three(f, None).is_some()) == Some(COLOURS.len() - 1)
    }

    /// Columns of x, y and z. Of several with one name the one spelt like the others is taken.
    fn position(&self) -> Option<[Option<usize>; 3]> {
        let found = POSITIONS.iter().find_map(|family| {
            let [x, y, z] = family.map(|names| self.find(names, None));
            let (mut x, mut y) = (x?, y?);
            if self.is_upper(x) != self.is_upper(y) {
                x = self.find(family[0], Some(y)).unwrap_or(x);
                y = self.find(family[1], Some(x)).unwrap_or(y);
            }
            let z = z.and_then(|_| self.find(family[2], Some(x)));
            Some([Some(x), Some(y), z.or_else(|| self.find(HEIGHTS, Some(x)))])
        });
        found.map(|mut axes| {
            let taken = [axes[0], axes[1]];
            axes[2] = axes[2].filter(|z| !taken.contains(&Some(*z)));
            axes
        })
    }

    fn three(&self, family: &[&[&str]; 3], like: Option<usize>) -> Option<[usize; 3]> {
        let [a, b, c] = family.map(|names| self.find(names, like));
        Some([a?, b?, c?])
    }

    /// The first column with the first of these names that there is; rather one spelt `like` another column.
    fn find(&self, names: &[&str], like: Option<usize>) -> Option<usize> {
        names.iter().find_map(|name| {
            let mut all = (0..self.keys.len()).filter(|i| self.keys[*i] == *name);
            let first = all.clone().next();
            like.and_then(|like| all.find(|i| self.is_upper(*i) == self.is_upper(like))).or(first)
        })
    }

    fn is_upper(&self, column: usize) -> bool {
        self.names[column].chars().any(char::is_uppercase)
    }

    /// Columns that have the title of an axis which another column is.
    fn doubles(&self, columns: &[Column]) -> Vec<ScanWarning> {
        let is_double = |i: &usize| {
            let same =
                |(k, c): (usize, &Column)| k != *i && self.keys[k] == self.keys[*i] && matches!(c.role, Role::Axis(_));
            matches!(columns[*i].role, Role::Other(_)) && columns.iter().enumerate().any(|(k, c)| same((k, c)))
        };
        let warning = |i: usize| ScanWarning::TitleTwice { number: i + 1, name: self.names[i].clone() };
        (0..columns.len()).filter(is_double).map(warning).collect()
    }
}

/// Names between single separators that stand outside of quotes; they may be empty.
fn cut(text: &str, separator: char) -> Vec<String> {
    let mut names = vec![String::new()];
    let mut quoted = false;
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        if quoted && c == '"' && chars.next_if_eq(&'"').is_some() {
            // two of them are one that belongs to the name
            names.iter_mut().rev().take(1).for_each(|name| name.push('"'));
            continue;
        }
        quoted ^= c == '"';
        match names.last_mut() {
            Some(name) if quoted || c != separator => name.extend((c != '"').then_some(c)),
            _ => names.push(String::new()),
        }
    }
    names.iter().map(|n| n.trim().to_owned()).collect()
}

/// Names between runs of separators that stand outside of quotes; only quoted ones may be empty.
fn words(text: &str, is_separator: impl Fn(char) -> bool) -> Vec<String> {
    let mut names = Vec::new();
    let (mut quoted, mut open) = (false, None::<String>);
    for c in text.chars() {
        quoted ^= c == '"';
        if quoted || !is_separator(c) {
            open.get_or_insert_default().extend((c != '"').then_some(c));
        } else {
            names.extend(open.take());
        }
    }
    names.extend(open);
    names.iter().map(|n| n.trim().to_owned()).collect()
}

/// Names between blanks, with the unit in brackets and the word "Coord." as parts of a name.
fn with_units(text: &str) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match names.last_mut() {
            Some(name) if word.starts_with(['[', '(']) || name.to_lowercase() == "coord." => {
                *name = format!("{name} {word}");
            }
            _ => names.push(word.to_owned()),
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    fn roles(line: &str, columns: usize) -> String {
        let found = Titles::of_line(line.as_bytes(), columns, None).columns(&mut Vec::new());
        let short = |c: &Column| match &c.role {
            Role::Axis(a) => ["x", "y", "z"][*a].to_owned(),
            Role::Colour(a) => ["r", "g", "b"][*a].to_owned(),
            Role::Normal(a) => ["nx", "ny", "nz"][*a].to_owned(),
            Role::Intensity => "i".to_owned(),
            Role::Classification => "c".to_owned(),
            Role::Other(name) => format!("<{name}>"),
            other => format!("{other:?}"),
        };
        found.iter().map(short).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn programs_name_the_same_columns_in_many_ways() {
        for (line, columns, expected) in [
            ("X Y Z Rf Gf Bf Nx Ny Nz", 9, "x y z r g b nx ny nz"),
            ("X;Y;Z;Illuminance (PCV);scalar_Intensity", 5, "x y z <Illuminance (PCV)> i"),
            ("Coord. X;Coord. Y;Coord. Z", 3, "x y z"),
            ("Coord. X Coord. Y Coord. Z", 3, "x y z"),
            ("X [m] Y [m] Z [m] Intensity", 4, "x y z i"),
            ("x(m), y(m), z(m)", 3, "x y z"),
            ("x_m,y_m,z_m", 3, "x y z"),
            ("\"Points:0\",\"Points:1\",\"Points:2\",\"RGB:0\",\"RGB:1\",\"RGB:2\"", 6, "x y z r g b"),
            ("\"Normals:0\",\"Normals:1\",\"Normals:2\",\"Points_0\",\"Points_1\",\"Points_2\"", 6, "nx ny nz x y z"),
            ("\"x\" \"y\" \"z\"", 3, "x y z"),
            ("lat,lon,height", 3, "y x z"),
            ("Latitude;Longitude;Elevation", 3, "y x z"),
            ("Northing,Easting,Elevation", 3, "y x z"),
            ("OID_,POINT_X,POINT_Y,POINT_Z", 4, "<OID_> x y z"),
            ("Rechtswert;Hochwert;Höhe", 3, "x y z"),
            ("lon,lat,x,y,z,height", 6, "<lon> <lat> x y z <height>"),
            ("i,x,y,z", 4, "<i> x y z"),
            ("x,y,z,i", 4, "x y z i"),
            ("X,x,y,z", 4, "<X> x y z"),
            ("X,Y,X", 3, "x y <X>"),
            ("E N H", 3, "x y z"),
            ("x,y,depth", 3, "x y <depth>"),
            ("X  Y  Point number  Z", 4, "x y <Point number> z"),
            ("x,y,z,", 3, "x y z"),
        ] {
            assert_eq!(roles(line, columns), expected, "{line}");
        }
    }

    #[test]
    fn a_comment_names_columns_or_is_prose() {
        let names = |line: &str, columns| Titles::of_comment(line.as_bytes(), columns, None).map(|t| t.names.join("|"));
        assert_eq!(names("//X Y Z", 3).unwrap(), "X|Y|Z");
        assert_eq!(names("# columns: x y z r g b", 6).unwrap(), "x|y|z|r|g|b");
        assert_eq!(names("# x y z in metres", 3).unwrap(), "x|y|z");
        assert_eq!(names("# made by a scanner", 3), None);
        assert_eq!(names("//X;Y;Z;Illuminance (PCV)", 4).unwrap(), "X|Y|Z|Illuminance (PCV)");
    }

    #[test]
    fn a_title_that_stands_twice_is_told() {
        let mut warnings = Vec::new();
        Titles::of_line(b"X,Y,X", 3, None).columns(&mut warnings);
        assert_eq!(warnings, [ScanWarning::TitleTwice { number: 3, name: "X".to_owned() }]);
    }
}

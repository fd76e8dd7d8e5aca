//! A column of a text, by a name that is given.

use crate::AttributeType;
use crate::scan::tabular::{Role, role};

/// Advice for types.
const TYPES: &str = "types are int8, uint8, int16, uint16, int32, uint32, int64, uint64, float, double";

/// A column before its type is known.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Column {
    pub(super) role: Role,
    pub(super) name: String,
    /// If it is requested.
    pub(super) ty: Option<AttributeType>,
}

impl Column {
    /// A column of that name, with a type behind a colon if there is one.
    pub(super) fn named(name: &str) -> Result<Self, String> {
        let (name, ty) = match name.rsplit_once(':') {
            None => (name, None),
            Some((name, ty)) => {
                let found = AttributeType::from_potree_name(ty.trim());
                (name, Some(found.ok_or_else(|| format!("the type {ty:?} of column {name} is not known; {TYPES}"))?))
            }
        };
        Ok(Self { role: text_role(name), name: name.trim().to_owned(), ty })
    }

    pub(super) fn all(names: &[&str]) -> Vec<Self> {
        let column = |name: &&str| Self { role: text_role(name), name: (*name).to_owned(), ty: None };
        names.iter().map(column).collect()
    }

    /// An attribute without a meaning that is known.
    pub(super) fn other(name: &str) -> Self {
        Self { role: Role::Other(name.to_owned()), name: name.to_owned(), ty: None }
    }

    pub(super) fn padding() -> Self {
        Self { role: Role::Padding, name: String::new(), ty: None }
    }
}

/// [`super::check_columns`].
pub(super) fn check(names: &[String]) -> Result<(), String> {
    let columns: Vec<Column> = names.iter().map(|n| Column::named(n)).collect::<Result<_, _>>()?;
    if let Some(nameless) = columns.iter().position(|c| c.name.is_empty()) {
        return Err(format!("column {} has no name; write - for columns to leave out", nameless + 1));
    }
    let count = |role: &Role| columns.iter().filter(|c| c.role == *role).count();
    for (axis, name) in ["x", "y"].into_iter().enumerate() {
        if count(&Role::Axis(axis)) == 0 {
            return Err(format!("there is no {name}; name every column in order, as in x,y,z,r,g,b,i"));
        }
    }
    let mut seen: Vec<&Column> = Vec::new();
    for column in columns.iter().filter(|c| c.role != Role::Padding) {
        if seen.iter().any(|c| c.role == column.role) {
            return Err(format!("{} stands twice; write - for columns to leave out", column.name));
        }
        seen.push(column);
    }
    Ok(())
}

/// Text has shorter and longer names than the other formats; a unit in brackets does not count.
fn text_role(name: &str) -> Role {
    let bare = name.split(['[', '(']).next().unwrap_or(name).trim();
    match bare.to_ascii_lowercase().as_str() {
        "-" | "_" | "skip" => Role::Padding,
        "i" => Role::Intensity,
        "c" | "class" => Role::Classification,
        "easting" => Role::Axis(0),
        "northing" => Role::Axis(1),
        "elevation" | "height" => Role::Axis(2),
        // packed colours are PCL's
        "rgb" | "rgba" => Role::Other(name.trim().to_owned()),
        _ => match role(bare) {
            Role::Other(_) => Role::Other(name.trim().to_owned()),
            role => role,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_may_have_units_and_types() {
        assert_eq!(text_role("X [m]"), Role::Axis(0));
        assert_eq!(text_role("Easting"), Role::Axis(0));
        let column = Column::named("quality:uint8").unwrap();
        assert_eq!((column.name.as_str(), column.ty), ("quality", Some(AttributeType::UInt8)));
        assert_eq!(Column::named("i:float").unwrap().role, Role::Intensity);
        assert!(Column::named("q:byte").is_err());
    }

    #[test]
    fn columns_that_cannot_be_are_told() {
        let check = |list: &str| check(&list.split(',').map(str::to_owned).collect::<Vec<_>>());
        assert_eq!(check("x,y,z,-,-,r,g,b,i"), Ok(()));
        assert!(check("x,z").unwrap_err().contains("there is no y"));
        assert!(check("x,y,z,i,intensity").unwrap_err().contains("intensity stands twice"));
        assert!(check("x,y,q:byte").unwrap_err().contains("\"byte\" of column q"));
    }
}

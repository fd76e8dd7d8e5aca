//! Which columns a decode fills.

use std::fmt;

use super::ScanInfo;

/// Which columns a decode fills: one flag per entry of [`ScanInfo::attributes`]. Positions always come.
///
/// ```
/// use pointmill_format::{Attribute, AttributeType, ScanInfo, Wanted};
///
/// let mut info = ScanInfo::new("scan.las", "LAS 1.2", 1);
/// info.attributes =
///     [Attribute::new("rgb", AttributeType::UInt16, 3), Attribute::new("intensity", AttributeType::UInt16, 1)].into();
/// let wanted = Wanted::named(&info, ["intensity"])?;
/// assert!(wanted.is_wanted(1) && !wanted.is_wanted(0));
/// let error = Wanted::named(&info, ["colour"]).unwrap_err();
/// assert_eq!(error.to_string(), "there is no attribute \"colour\"; there are \"rgb\", \"intensity\"");
/// # Ok::<(), pointmill_format::UnknownAttribute>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wanted {
    columns: Vec<bool>,
}

impl Wanted {
    /// Everything.
    #[must_use]
    pub fn all(info: &ScanInfo) -> Self {
        Self { columns: vec![true; info.attributes.len()] }
    }

    /// Positions alone.
    #[must_use]
    pub fn positions(info: &ScanInfo) -> Self {
        Self { columns: vec![false; info.attributes.len()] }
    }

    /// The attributes of these names.
    ///
    /// # Errors
    /// A name that no attribute has.
    pub fn named<N: AsRef<str>>(info: &ScanInfo, names: impl IntoIterator<Item = N>) -> Result<Self, UnknownAttribute> {
        let mut wanted = Self::positions(info);
        for name in names {
            let name = name.as_ref();
            let Some((column, _)) = info.attribute(name) else {
                let known = info.attributes.iter().map(|a| a.name.clone()).collect();
                return Err(UnknownAttribute { name: name.to_owned(), known });
            };
            wanted.set(column, true);
        }
        Ok(wanted)
    }

    /// Whether `column` (an index in [`ScanInfo::attributes`]) is filled; false beyond the last.
    #[inline]
    pub fn is_wanted(&self, column: usize) -> bool {
        self.columns.get(column).copied().unwrap_or(false)
    }

    /// Wants `column` (an index in [`ScanInfo::attributes`]), or not; nothing happens beyond the last.
    pub fn set(&mut self, column: usize, is_wanted: bool) {
        if let Some(flag) = self.columns.get_mut(column) {
            *flag = is_wanted;
        }
    }

    /// One flag per attribute.
    pub fn flags(&self) -> &[bool] {
        &self.columns
    }
}

impl FromIterator<bool> for Wanted {
    /// One flag per attribute, in order.
    fn from_iter<I: IntoIterator<Item = bool>>(flags: I) -> Self {
        Self { columns: flags.into_iter().collect() }
    }
}

/// A name that no attribute of a scan has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownAttribute {
    name: String,
    known: Vec<String>,
}

impl UnknownAttribute {
    /// The name requested.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The names of the scan's attributes.
    pub fn known(&self) -> &[String] {
        &self.known
    }
}

impl fmt::Display for UnknownAttribute {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let known: Vec<_> = self.known.iter().map(|name| format!("{name:?}")).collect();
        let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        write!(f, "there is no attribute {:?}; there are {known}", self.name)
    }
}

impl std::error::Error for UnknownAttribute {}

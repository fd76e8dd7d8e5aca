//! Words that files and command lines use for a choice.

/// A word that names none of the choices.
///
/// ```
/// use pointmill_format::bintree::SplitRule;
///
/// assert_eq!("median".parse(), Ok(SplitRule::Median));
/// let error = "middle".parse::<SplitRule>().unwrap_err();
/// assert_eq!(error.to_string(), "\"middle\" is no split rule; known are mean, median, midpoint");
/// ```
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{word:?} is no {choice}; known are {known}")]
pub struct UnknownName {
    word: String,
    choice: &'static str,
    known: String,
}

impl UnknownName {
    pub(crate) fn new(word: &str, choice: &'static str, known: &[&str]) -> Self {
        Self { word: word.to_owned(), choice, known: known.join(", ") }
    }
}

/// `Display` and `FromStr` for an enum with `ALL` and `name`; `choice` is what it is called in messages.
macro_rules! named {
    ($ty:ty, $choice:literal) => {
        impl std::fmt::Display for $ty {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }

        impl std::str::FromStr for $ty {
            type Err = $crate::UnknownName;

            fn from_str(word: &str) -> Result<Self, Self::Err> {
                let found = Self::ALL.iter().copied().find(|choice| choice.name() == word);
                found.ok_or_else(|| {
                    let known: Vec<_> = Self::ALL.iter().map(|choice| choice.name()).collect();
                    $crate::UnknownName::new(word, $choice, &known)
                })
            }
        }
    };
}
pub(crate) use named;

//! Scans within a file, chosen by name or number.

/// The scans that `choice` means in a file whose scans have these names: indices from 0, in order. Those of exactly that
/// name, else the one of that number, from 1; none if the file has neither.
///
/// ```
/// use pointmill_format::scans_named;
///
/// let names = ["Hall", "Yard", "Hall", "1"];
/// assert_eq!(scans_named(&names, "Hall"), [0, 2]);
/// assert_eq!(scans_named(&names, "2"), [1]);
/// assert_eq!(scans_named(&names, "1"), [3], "a name comes before a number");
/// assert!(scans_named(&names, "5").is_empty());
/// ```
pub fn scans_named<N: AsRef<str>>(names: &[N], choice: &str) -> Vec<usize> {
    let is_named = |i: &usize| !choice.is_empty() && names[*i].as_ref() == choice;
    let named: Vec<usize> = (0..names.len()).filter(is_named).collect();
    if !named.is_empty() {
        return named;
    }
    let index = choice.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
    index.filter(|i| *i < names.len()).into_iter().collect()
}

/// For each scan of a file whether it is read; without a choice all are.
#[cfg(any(feature = "depth", feature = "e57", feature = "text"))]
pub(super) fn chosen(choices: Option<&[String]>, names: &[&str]) -> Vec<bool> {
    let Some(choices) = choices else { return vec![true; names.len()] };
    let mut is_chosen = vec![false; names.len()];
    choices.iter().flat_map(|choice| scans_named(names, choice)).for_each(|i| is_chosen[i] = true);
    is_chosen
}

//! Numbers as writers of E57 spell them.

use std::cell::Cell;

use super::element::Element;

/// Reads numbers, and remembers how they were spelled.
#[derive(Debug, Default)]
pub(in crate::scan::e57) struct Numbers {
    /// One had a decimal comma: its writer followed the habits of a country.
    pub(super) commas: Cell<bool>,
}

impl Numbers {
    /// A floating-point number; none is 0, as E57 has it.
    pub(in crate::scan::e57) fn float(&self, text: &str) -> Option<f64> {
        let text = text.trim();
        if text.is_empty() {
            return Some(0.0);
        }
        text.parse().ok().or_else(|| self.with_comma(text)).or_else(|| of_old_microsoft(text))
    }

    /// An integer; also one that is written as a floating-point number.
    pub(in crate::scan::e57) fn integer(&self, text: &str) -> Option<i64> {
        let text = text.trim();
        if text.is_empty() {
            return Some(0);
        }
        let whole = |v: f64| (v.fract() == 0.0 && v.abs() < 2f64.powi(53)).then_some(v as i64);
        text.parse().ok().or_else(|| self.float(text).and_then(whole))
    }

    fn with_comma(&self, text: &str) -> Option<f64> {
        let (whole, decimals) = text.split_once(',').filter(|(_, d)| !d.contains(['.', ',']))?;
        let number = format!("{whole}.{decimals}").parse().ok()?;
        self.commas.set(true);
        Some(number)
    }

    /// The number of a child; `None` without the child.
    ///
    /// # Errors
    /// It is no number.
    pub(super) fn child(&self, parent: &Element<'_>, name: &str) -> Result<Option<f64>, String> {
        let Some(child) = parent.child(name) else { return Ok(None) };
        let number = self.float(child.text()).ok_or_else(|| no_number(name, child.text()))?;
        Ok(Some(number))
    }

    /// The integer in an attribute.
    ///
    /// # Errors
    /// It is none.
    pub(in crate::scan::e57) fn attribute(&self, element: &Element<'_>, name: &str) -> Result<Option<i64>, String> {
        let Some(text) = element.attribute(name) else { return Ok(None) };
        self.integer(text).map(Some).ok_or_else(|| no_number(&format!("{} of {}", name, element.name), text))
    }
}

/// "1.#INF", "-1.#IND", "1.#QNAN": what Microsoft's library wrote until 2015.
fn of_old_microsoft(text: &str) -> Option<f64> {
    let (sign, rest) = text.strip_prefix('-').map_or((1.0, text), |rest| (-1.0, rest));
    match rest.strip_prefix("1.#")? {
        name if name.starts_with("INF") => Some(sign * f64::INFINITY),
        name if name.starts_with("IND") || name.contains("NAN") => Some(f64::NAN),
        _ => None,
    }
}

pub(super) fn no_number(name: &str, text: &str) -> String {
    let text: String = text.chars().take(40).collect();
    format!("{name} is {text:?}, not a number")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_all_their_spellings() {
        let numbers = Numbers::default();
        let floats =
            [(" 1.50000e+00\n", 1.5), ("", 0.0), ("-7", -7.0), ("inf", f64::INFINITY), ("1.#INF00", f64::INFINITY)];
        assert!(floats.iter().all(|(text, v)| numbers.float(text) == Some(*v)));
        assert!(["nan", "-nan", "-1.#IND", "1.#QNAN0"].iter().all(|text| numbers.float(text).unwrap().is_nan()));
        let integers = [("12", Some(12)), (" -3 ", Some(-3)), ("255.0", Some(255)), ("1e3", Some(1000)), ("0.5", None)];
        assert!(integers.iter().all(|(text, v)| numbers.integer(text) == *v));
        assert_eq!(numbers.integer("-9223372036854775808"), Some(i64::MIN));
        assert!(!numbers.commas.get());
        assert_eq!((numbers.float("-1,5e-3"), numbers.commas.get()), (Some(-0.0015), true));
        assert!(["1,000,000", "1,000.5", "one", "1 2"].iter().all(|text| numbers.float(text).is_none()));
    }
}

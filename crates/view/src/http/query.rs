//! The parameters of a request.

use std::borrow::Cow;
use std::str::FromStr;

use percent_encoding::percent_decode_str;

use crate::dataset::{BatchesRequest, PointsRequest};
use crate::refusal::Refusal;

/// Nodes or leaves of a request, at most.
const MOST_UNITS: usize = 256;
/// Batches of a request, at most.
const MOST_BATCHES: usize = 4096;

/// Names and values, decoded. Those that nobody asks for are ignored.
#[derive(Debug, Default)]
pub(super) struct Query<'a>(Vec<(Cow<'a, str>, Cow<'a, str>)>);

impl<'a> Query<'a> {
    /// Takes what stands behind the `?`.
    pub(super) fn new(query: Option<&'a str>) -> Result<Self, Refusal> {
        let pairs = query.unwrap_or_default().split('&').filter(|pair| !pair.is_empty());
        let decoded = pairs.map(|pair| {
            let (name, value) = pair.split_once('=').unwrap_or((pair, ""));
            Ok((decode(name)?, decode(value)?))
        });
        decoded.collect::<Result<_, _>>().map(Self)
    }

    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|(n, _)| n == name).map(|(_, value)| value.as_ref())
    }

    pub(super) fn required(&self, name: &str) -> Result<&str, Refusal> {
        self.get(name).ok_or_else(|| Refusal::bad(format!("the parameter {name} is missing")))
    }

    /// A number of at least `least`, or what it is if nothing is said.
    fn number<T: FromStr + PartialOrd + Copy + std::fmt::Display>(
        &self,
        name: &str,
        least: T,
        usual: T,
    ) -> Result<T, Refusal> {
        let Some(text) = self.get(name) else { return Ok(usual) };
        let number = text.parse().ok().filter(|n| *n >= least);
        number.ok_or_else(|| Refusal::bad(format!("{name} must be a number of at least {least}")))
    }

    /// Parts of a list with commas.
    fn list(&self, name: &str, most: usize) -> Result<Vec<&str>, Refusal> {
        let parts: Vec<&str> = self.required(name)?.split(',').take(most + 1).collect();
        if parts.len() > most {
            return Err(Refusal::bad(format!("{name}: at most {most} per request")));
        }
        Ok(parts)
    }

    pub(super) fn points(&self) -> Result<PointsRequest, Refusal> {
        Ok(PointsRequest {
            units: self.list("units", MOST_UNITS)?.into_iter().map(str::to_owned).collect(),
            attribute: self.get("attribute").map(str::to_owned),
            every: self.number("every", 1, 1)?,
        })
    }

    pub(super) fn batches(&self) -> Result<BatchesRequest, Refusal> {
        let slots = self.list("units", MOST_BATCHES)?.into_iter().map(|slot| slot.parse().ok());
        let units: Option<Vec<u32>> = slots.collect();
        let planes = self.number("planes", 1, 1)?;
        if planes > 3 {
            return Err(Refusal::bad("planes must be 1, 2 or 3"));
        }
        Ok(BatchesRequest {
            units: units.ok_or_else(|| Refusal::bad("units must be numbers of batches"))?,
            planes,
            levels: self.levels()?,
            attribute: self.get("attribute").map(str::to_owned),
        })
    }

    /// `lods=a-b`, both included; all if nothing is said.
    fn levels(&self) -> Result<[u8; 2], Refusal> {
        let Some(text) = self.get("lods") else { return Ok([0, u8::MAX]) };
        let ends = text.split_once('-').unwrap_or((text, text));
        match (ends.0.parse(), ends.1.parse()) {
            (Ok(from), Ok(to)) if from <= to => Ok([from, to]),
            _ => Err(Refusal::bad("lods must be levels from-to, as 0-2")),
        }
    }

    pub(super) fn index(&self) -> Result<u64, Refusal> {
        self.required("index")?;
        self.number("index", 0, 0)
    }
}

fn decode(text: &str) -> Result<Cow<'_, str>, Refusal> {
    let not_text = |_| Refusal::bad("a parameter is no UTF-8 text");
    if text.contains('+') {
        let spaced = text.replace('+', " ");
        return percent_decode_str(&spaced).decode_utf8().map(|t| Cow::Owned(t.into_owned())).map_err(not_text);
    }
    percent_decode_str(text).decode_utf8().map_err(not_text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn query(text: &str) -> Query<'_> {
        Query::new(Some(text)).unwrap()
    }

    #[test]
    fn parameters_are_decoded_once() {
        let q = query("units=r,r0&attribute=scan%20angle+rank%2B%2525&every=3&_=17");
        let request = q.points().unwrap();
        assert_eq!((request.units, request.every), (vec!["r".to_owned(), "r0".to_owned()], 3));
        assert_eq!(request.attribute.as_deref(), Some("scan angle rank+%25"));
        assert!(Query::new(Some("a=%ff")).is_err() && Query::new(None).unwrap().points().is_err());
    }

    #[test]
    fn nonsense_is_refused_with_a_line() {
        let many = vec!["r"; 257].join(",");
        for bad in ["", "units=r&every=0", "units=r&every=-1", "units=r&every=1e99", &format!("units={many}")] {
            assert_eq!(query(bad).points().unwrap_err().status, 400, "{bad}");
        }
        for bad in ["units=r", "units=1&planes=0", "units=1&planes=4", "units=1&lods=2-1", "units=1&lods=a", "units=-1"]
        {
            assert_eq!(query(bad).batches().unwrap_err().status, 400, "{bad}");
        }
        assert_eq!(query("units=1,2&lods=1-2&planes=3").batches().unwrap().levels, [1, 2]);
        assert_eq!(query("units=1").batches().unwrap().levels, [0, 255]);
        assert!(query("index=18446744073709551616").index().is_err());
    }
}

//! What units are called, and what is known of one before it is done.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

/// A unit of a job: what is done at once, by one process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct UnitName {
    pub(crate) stage: Stage,
    pub(crate) number: u64,
}

/// What a unit is a part of; they come in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Stage {
    /// Reading some scans, in a pass over all of them.
    Read { pass: u32 },
    /// Grouping what a pass has read, and dividing it into units to build. There is one.
    Settle { pass: u32 },
    /// Building a part of the outputs of a group.
    Build { group: u32 },
}

impl fmt::Display for UnitName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kind, of) = self.stage.parts();
        write!(f, "{kind}-{of}-{}", self.number)
    }
}

impl UnitName {
    /// Tells its file from those of other units; `mark`: how the work was divided.
    pub(crate) fn label(self, mark: u32) -> u32 {
        crc32c::crc32c_append(mark, self.to_string().as_bytes())
    }
}

impl Stage {
    fn parts(self) -> (&'static str, u32) {
        match self {
            Self::Read { pass } => ("read", pass),
            Self::Settle { pass } => ("settle", pass),
            Self::Build { group } => ("build", group),
        }
    }

    /// Its name without numbers.
    pub(crate) fn kind(self) -> &'static str {
        self.parts().0
    }
}

impl FromStr for UnitName {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let mut parts = text.split('-');
        let (Some(kind), Some(of), Some(number), None) = (parts.next(), parts.next(), parts.next(), parts.next())
        else {
            return Err(());
        };
        let of = of.parse().map_err(|_| ())?;
        let stage = match kind {
            "read" => Stage::Read { pass: of },
            "settle" => Stage::Settle { pass: of },
            "build" => Stage::Build { group: of },
            _ => return Err(()),
        };
        let name = Self { stage, number: number.parse().map_err(|_| ())? };
        if name.to_string() == text { Ok(name) } else { Err(()) }
    }
}

impl Serialize for UnitName {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

/// A unit of a job, as far as it is known.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct JobUnit {
    /// Its name.
    pub name: UnitName,
    /// `read`, `settle` or `build`.
    pub kind: &'static str,
    /// Points that it decodes or builds, as far as known; what it only looks at does not count.
    pub points: u64,
    /// Units of the same list that must be done before it.
    pub needs: Vec<UnitName>,
    /// It is done.
    pub done: bool,
}

impl JobUnit {
    pub(crate) fn new(name: UnitName, points: u64, needs: Vec<UnitName>, done: bool) -> Self {
        Self { name, kind: name.stage.kind(), points, needs, done }
    }
}

/// The units of a job that are known: those of the stage that it has reached. Later ones are known when all of these are done.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct JobUnits {
    /// In an order in which they can be done.
    pub units: Vec<JobUnit>,
    /// All units are done: what is left is to finish.
    pub complete: bool,
}

impl JobUnits {
    /// Units that are not done and whose needs are.
    pub fn ready(&self) -> impl Iterator<Item = &JobUnit> {
        let done: std::collections::HashSet<UnitName> = self.units.iter().filter(|u| u.done).map(|u| u.name).collect();
        self.units.iter().filter(move |u| !u.done && u.needs.iter().all(|need| done.contains(need)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_back_and_nothing_else_is_one() {
        for text in ["read-1-0", "settle-5-0", "build-0-18446744073709551615"] {
            assert_eq!(text.parse::<UnitName>().unwrap().to_string(), text);
        }
        for text in ["", "read", "read-1", "read-1-2-3", "read-01-2", "read-1-+2", "Read-1-2", "build-1-x", "read--1-2"]
        {
            assert!(text.parse::<UnitName>().is_err(), "{text}");
        }
    }

    #[test]
    fn what_is_ready_is_not_done_and_needs_nothing_that_is_not() {
        let name = |number| UnitName { stage: Stage::Build { group: 0 }, number };
        let unit = |n, needs: &[u64], done| JobUnit::new(name(n), 1, needs.iter().map(|n| name(*n)).collect(), done);
        let units = vec![unit(0, &[], true), unit(1, &[0], false), unit(2, &[0, 1], false), unit(3, &[], false)];
        let ready: Vec<u64> = JobUnits { units, complete: false }.ready().map(|u| u.name.number).collect();
        assert_eq!(ready, [1, 3]);
    }
}

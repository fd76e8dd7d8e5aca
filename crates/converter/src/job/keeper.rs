//! Where units leave what they have made: a job of one run, or one that several processes share.

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::Job;
use super::shared::SharedJob;
use super::unit_file::{UnitReader, UnitWriter};
use crate::cloud::{Cloud, Store};
use crate::error::{ConvertError, JobFault};
use crate::runtime::{DiskFile, Runtime};
use crate::unit_name::{JobUnit, Stage, UnitName};

/// A job of either kind.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Keeper<'a> {
    /// Of one run, on one machine.
    Own(&'a Job),
    Shared(&'a SharedJob),
}

/// What outputs are built from, with what, and where a job keeps what their units come to.
#[derive(Clone, Copy)]
pub(crate) struct Build<'a> {
    pub(crate) cloud: &'a Cloud<'a>,
    pub(crate) rt: &'a Runtime<'a>,
    pub(crate) units: Option<GroupUnits<'a>>,
}

impl Build<'_> {
    /// True if several processes share the work: they may have other memory and threads, and must divide it alike.
    pub(crate) fn is_shared(&self) -> bool {
        self.units.is_some_and(|units| units.shared().is_some())
    }

    /// How the work is divided: as `divide` says, or as another process that shares it has said, if that `can_be`.
    pub(crate) fn divided<T: Serialize + DeserializeOwned>(
        &self,
        can_be: impl FnOnce(&T) -> bool,
        divide: impl FnOnce() -> Result<T, ConvertError>,
    ) -> Result<T, ConvertError> {
        let name = self.units.map_or_else(String::new, |units| units.division());
        settled(self.units.map(|units| units.keeper), &name, &self.cloud.store, can_be, divide)
    }
}

/// A result of settling by its name, where several processes share a job; anywhere else what `make` makes. `store`: where it puts
/// records; `can_be`: whether what another process has said can be of this cloud.
pub(crate) fn settled<T: Serialize + DeserializeOwned>(
    keeper: Option<Keeper<'_>>,
    name: &str,
    store: &Store,
    can_be: impl FnOnce(&T) -> bool,
    make: impl FnOnce() -> Result<T, ConvertError>,
) -> Result<T, ConvertError> {
    match keeper.and_then(Keeper::shared) {
        Some(job) => job.settled_in(name, store, None, can_be, make),
        None => make(),
    }
}

impl<'a> Keeper<'a> {
    /// Parts with files of the output that are about to get their names.
    pub(crate) fn part_with_output(self) -> Result<(), ConvertError> {
        match self {
            Self::Shared(_) => Ok(()),
            Self::Own(job) => job.part_with_output(),
        }
    }

    /// True if others have read records: nobody has looked whether they lie where that says.
    pub(crate) fn is_of_others(self) -> bool {
        match self {
            Self::Shared(_) => true,
            Self::Own(job) => job.recalled() > 0,
        }
    }

    /// The job, if it is one that several processes share.
    pub(crate) fn shared(self) -> Option<&'a SharedJob> {
        match self {
            Self::Shared(job) => Some(job),
            Self::Own(_) => None,
        }
    }
}

/// The units that build the outputs of a group.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GroupUnits<'a> {
    keeper: Keeper<'a>,
    group: u32,
    /// Tells divisions apart: another run may divide the group otherwise.
    mark: u32,
}

impl<'a> GroupUnits<'a> {
    /// Those of a group, by its number.
    pub(crate) fn new(keeper: Keeper<'a>, group: u32) -> Self {
        Self { keeper, group, mark: 0 }
    }

    /// The same, of a group that is divided into these: what a run has kept that divided it otherwise, or took the cloud for another
    /// one, is not found.
    pub(crate) fn divided(self, cloud: &Cloud<'_>, units: &impl Serialize) -> Result<Self, ConvertError> {
        let Cloud { lattice, frame, stats, facts, census, .. } = cloud;
        let of_all = (lattice.lattice, &frame.cube, frame.origin, stats.bounds, stats.checksum);
        let facts = format!("{:?}", (of_all, &facts.ranges, &facts.relations, &facts.widening));
        let mark = super::encode(&(facts, &census.cells, units))?;
        Ok(Self { mark: crc32c::crc32c(&mark), ..self })
    }

    /// As [`Keeper::is_of_others`].
    pub(crate) fn is_of_others(&self) -> bool {
        self.keeper.is_of_others()
    }

    /// The name of a unit.
    pub(crate) fn name(&self, number: usize) -> UnitName {
        UnitName { stage: Stage::Build { group: self.group }, number: number as u64 }
    }

    /// The job, if several processes share it and this one does not finish it: its units are done one by one.
    pub(crate) fn in_parts(&self) -> Option<&'a SharedJob> {
        self.keeper.shared().filter(|job| !matches!(job.task(), super::Task::Finish))
    }

    /// The name under which settling keeps how the group is divided.
    pub(crate) fn division(&self) -> String {
        format!("division {}", self.group)
    }

    /// A unit as it is listed.
    pub(crate) fn listed(&self, job: &SharedJob, number: usize, points: u64, needs: Vec<usize>) -> JobUnit {
        job.listed(self.name(number), points, needs.into_iter().map(|n| self.name(n)).collect())
    }

    /// The folder in which a job of one run keeps files of the output.
    pub(crate) fn kept_in(&self) -> Option<&'a Path> {
        match self.keeper {
            Keeper::Shared(_) => None,
            Keeper::Own(job) => Some(job.folder()),
        }
    }

    /// True if a unit is done: of a job that several processes share, if its file is there; else if `check` does not find it
    /// damaged, either.
    pub(crate) fn is_done(
        &self,
        number: usize,
        check: impl FnOnce(&UnitReader) -> Result<(), ConvertError>,
    ) -> Result<bool, ConvertError> {
        match self.keeper {
            Keeper::Shared(job) => Ok(job.is_done(self.name(number))),
            Keeper::Own(_) => Ok(self.recall(number, check)?.is_some()),
        }
    }

    /// The error for a unit that is not whole any more, though it was done.
    pub(crate) fn gone(&self, number: usize) -> ConvertError {
        let unit = JobUnit::new(self.name(number), 0, Vec::new(), false);
        JobFault::Unfinished { units: vec![unit] }.into()
    }

    /// Fails if several processes share the job and one of so many units is not done.
    pub(crate) fn all_done(&self, units: usize) -> Result<(), ConvertError> {
        let Some(job) = self.shared() else { return Ok(()) };
        let open = (0..units).filter(|i| !job.is_done(self.name(*i)));
        let open: Vec<JobUnit> = open.map(|i| JobUnit::new(self.name(i), 0, Vec::new(), false)).collect();
        if open.is_empty() { Ok(()) } else { Err(JobFault::Unfinished { units: open }.into()) }
    }

    /// The job, if how the group is divided is kept.
    pub(crate) fn shared(&self) -> Option<&'a SharedJob> {
        self.keeper.shared()
    }

    /// Hands what a unit has left to `take`; `None`: it is not done.
    pub(crate) fn recall<T>(
        &self,
        number: usize,
        take: impl FnOnce(&UnitReader) -> Result<T, ConvertError>,
    ) -> Result<Option<T>, ConvertError> {
        let unit = self.name(number);
        let job = match self.keeper {
            Keeper::Shared(job) => return job.recall_marked(unit, self.mark, take),
            Keeper::Own(job) => job,
        };
        let path = job.built_path(unit);
        let Ok(meta) = std::fs::metadata(&path) else { return Ok(None) };
        let file = DiskFile::open(&path, path.clone(), &job.disk)?;
        match UnitReader::open(&path, unit.label(self.mark), file, meta.len()).and_then(|reader| take(&reader)) {
            Ok(value) => Ok(Some(value)),
            // it was not safe when the power failed
            Err(ConvertError::Job(JobFault::Damaged { .. })) => Ok(None),
            Err(other) => Err(other),
        }
    }

    /// Notes units that another run has built.
    pub(crate) fn count_recalled(&self, units: usize) {
        if let Keeper::Own(job) = self.keeper {
            job.count_recalled_units(units as u64);
        }
    }

    /// Writes what a unit leaves: `fill` puts it into the file.
    pub(crate) fn keep(
        &self,
        number: usize,
        fill: impl FnOnce(&mut UnitWriter) -> Result<(), ConvertError>,
    ) -> Result<(), ConvertError> {
        let unit = self.name(number);
        match self.keeper {
            Keeper::Shared(job) => job.keep_marked(unit, self.mark, fill),
            Keeper::Own(job) => {
                let mut file = self.begin_of(job, number)?;
                fill(&mut file)?;
                file.finish(false) // what the disk loses is found out by its sums, and made again
            }
        }
    }

    /// Begins the file of a unit whose bytes are in the output; `None`: processes share the job, each output is made in the end.
    pub(crate) fn begin(&self, number: usize) -> Result<Option<UnitWriter>, ConvertError> {
        match self.keeper {
            Keeper::Shared(_) => Ok(None),
            Keeper::Own(job) => self.begin_of(job, number).map(Some),
        }
    }

    fn begin_of(&self, job: &Job, number: usize) -> Result<UnitWriter, ConvertError> {
        let unit = self.name(number);
        UnitWriter::create(&job.built_path(unit), unit.label(self.mark), &job.disk)
    }
}

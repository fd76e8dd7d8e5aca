//! All units of a tree in one process: each is built in its turn, or taken from what a job has kept of it, and handed in.

use super::commit::Committer;
use super::finished::Piece;
use super::keep;
use super::sample::{Sampler, Sampling};
use super::sinks::{Encoders, Sinks};
use super::unit::{BuiltUnit, Shared, UnitBuilder};
use super::units::{Unit, Work};
use crate::error::ConvertError;
use crate::job::{GroupUnits, KeptFile, UnitReader};

/// What all threads share.
pub(super) struct Making<'a, S> {
    pub(super) units: &'a [Unit],
    /// Where a job keeps what units come to.
    pub(super) kept: Option<GroupUnits<'a>>,
    /// The files of the output, if the job has them, too: those that are not in memory together are kept apart all the same.
    pub(super) in_place: Option<&'a [KeptFile<'a>]>,
    pub(super) shared: &'a Shared<'a>,
    pub(super) committer: &'a Committer<'a, S>,
    pub(super) sinks: &'a S,
    pub(super) sampling: Sampling,
}

impl<S: Sinks> Making<'_, S> {
    /// Makes the whole tree.
    ///
    /// # Errors
    /// Several processes share the job, and one of the units is not done.
    pub(super) fn all(&self) -> Result<(), ConvertError> {
        let Self { units, kept, shared, committer, sinks, sampling, .. } = self;
        kept.map_or(Ok(()), |of| of.all_done(units.len()))?;
        let builder = || UnitBuilder::new(shared, Sampler::new(*sampling, shared.borders.spacing()), sinks.encoders());
        let one = |builder: &mut _, index| self.one(builder, index);
        shared.rt.in_parallel_or(units.len(), builder, one, |_| (), |index| committer.stop_above(index))?;
        Ok(())
    }

    fn one<E: Encoders>(&self, builder: &mut UnitBuilder<'_, E>, index: usize) -> Result<(), ConvertError> {
        let unit = &self.units[index];
        let Some(buffers) = self.committer.admit(index) else { return Ok(()) };
        self.shared.rt.check_stop()?; // it may have waited long
        let built = match self.kept {
            None => self.build(unit, index, builder, buffers)?,
            Some(of) => match of.recall(index, |file| self.read(unit, file))? {
                Some(built) => self.recalled(unit, index, built)?,
                None if of.shared().is_some() => return Err(of.gone(index)),
                None => {
                    let built = self.build(unit, index, builder, buffers)?;
                    built.map(|built| self.keep(of, index, built, builder)).transpose()?
                }
            },
        };
        let Some(mut built) = built else { return Ok(()) };
        self.sinks.add_notes(&built.notes)?;
        self.shared.borders.publish(std::mem::take(&mut built.outer))?;
        self.committer.submit(index, built, &mut builder.encoder)?;
        if self.kept.is_some() {
            // of nodes that were encoded once they had their place: no part of the unit that comes next
            self.sinks.add_notes(&builder.encoder.take_notes()?)?;
        }
        self.shared.rt.advance(unit.points());
        Ok(())
    }

    fn read(&self, unit: &Unit, file: &UnitReader) -> Result<BuiltUnit, ConvertError> {
        let of = keep::Of { key: unit.key, streams: self.sinks.count() };
        keep::read(file, of, &self.shared.lists, self.in_place)
    }

    fn build<E: Encoders>(
        &self,
        unit: &Unit,
        index: usize,
        builder: &mut UnitBuilder<'_, E>,
        buffers: Vec<Vec<u8>>,
    ) -> Result<Option<BuiltUnit>, ConvertError> {
        let wait = || self.committer.wait_for(index, unit.class_start);
        match &unit.work {
            Work::Subtree(chunks) => builder.subtree(unit.key, chunks, buffers, wait),
            Work::Above(children) if wait() => {
                builder.above(unit.key, self.committer.take(children)?, buffers).map(Some)
            }
            Work::Above(_) => Ok(None),
        }
    }

    /// Takes the place of what the unit was built from.
    fn recalled(&self, unit: &Unit, index: usize, built: BuiltUnit) -> Result<Option<BuiltUnit>, ConvertError> {
        if let Some(of) = self.kept {
            of.count_recalled(1);
        }
        match &unit.work {
            Work::Subtree(_) => Ok(Some(built)),
            Work::Above(children) if self.committer.wait_for(index, unit.class_start) => {
                self.committer.take(children)?;
                Ok(Some(built))
            }
            Work::Above(_) => Ok(None),
        }
    }

    fn keep<E: Encoders>(
        &self,
        of: GroupUnits<'_>,
        index: usize,
        mut built: BuiltUnit,
        builder: &mut UnitBuilder<'_, E>,
    ) -> Result<BuiltUnit, ConvertError> {
        built.take_notes(&mut builder.encoder)?;
        let is_in_memory = built.pieces.iter().all(|piece| matches!(piece, Piece::Nodes(_)));
        let file = if is_in_memory && self.in_place.is_some() { of.begin(index)? } else { None };
        match file {
            Some(mut file) => {
                keep::write_first(&built, &self.shared.lists, &mut file)?;
                built.file = Some(file);
            }
            None => of.keep(index, |file| keep::write(&built, &self.shared.lists, file))?,
        }
        Ok(built)
    }
}

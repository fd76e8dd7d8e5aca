//! What a format is to the converter: the one extension point.

use std::fmt::Debug;
use std::sync::Arc;

use pointmill_format::DatasetKind;
use serde_json::{Map, Value};

use super::octrees::{ChosenSpacing, TreeSettings};
use super::staging::StagedDataset;
use crate::cloud::Cloud;
use crate::error::ConvertError;
use crate::job::Build;
use crate::octree::{AnySink, Octree, OctreeSettings};
use crate::plan::{AttributeChoice, Duplicates, Plan, PlanError, PlanFault, Setting};
use crate::report::{OutputReport, PlannedChoice, SavedBytes};
use crate::runtime::Runtime;
use crate::sources::{ResolvedCrs, Schema};
use crate::warning::Warning;

/// A format to write, with its settings.
pub(crate) trait Output: Debug + Send + Sync {
    /// Which format.
    fn kind(&self) -> DatasetKind;

    /// Refuses settings that cannot be used, before anything is read.
    fn check(&self, plan: &Plan) -> Result<(), ConvertError>;

    /// What it needs of the cloud; `all`: the attributes of the inputs.
    fn wants(&self, plan: &Plan, all: &Schema) -> Wants;

    /// The minimum of points that it must have in memory together.
    fn least_points(&self) -> u64 {
        0
    }

    /// The minimum of bytes of its own that a thread must have in memory together, beside points.
    fn least_bytes(&self) -> u64 {
        0
    }

    /// What it takes on disk; `kept`: bytes per point of the attributes that the plan keeps.
    fn disk_size(&self, plan: &Plan, schema: &Schema, kept: u64) -> DiskSize;

    /// Adds the settings that shape the dataset to those of the report.
    fn describe_settings(&self, settings: &mut Map<String, Value>);

    /// What it would be made with, and why.
    fn choices(&self, plan: &Plan) -> Vec<PlannedChoice>;

    /// What there is to say before any point was read. `kept`: the attributes of the schema that go in, in order.
    fn foresee(&self, _schema: &Schema, _kept: &[usize], _crs: &ResolvedCrs) -> Vec<Warning> {
        Vec::new()
    }

    /// True if what is built stays where it is written, in few files, so that a job can keep these.
    fn stays_in_place(&self) -> bool {
        true
    }

    /// True if points of the lattice come back as they are, but for the rounding of doubles.
    fn keeps_lattice(&self) -> bool {
        false
    }

    /// What a coarser step of positions saves, as far as that is known before the dataset is made.
    fn saved_bytes(&self) -> SavedBytes {
        SavedBytes::FixedRecords
    }

    /// The octree that it is, if it is one: then it is built together with others that have the same nodes, and
    /// [`Self::write`] is not called.
    fn octree(&self) -> Option<&dyn OctreeOutput> {
        None
    }

    /// Builds and writes the dataset.
    fn write(&self, build: Build<'_>, to: &StagedDataset) -> Result<OutputReport, ConvertError> {
        let _ = (build, to);
        Err(ConvertError::Internal(format!("{} has no writer of its own", self.kind())))
    }
}

/// A format whose nodes are those of any octree format with the same settings.
pub(crate) trait OctreeOutput: Output {
    /// Those that shape the tree.
    fn tree(&self) -> TreeSettings;

    /// Prepares for the nodes of a tree with this spacing.
    ///
    /// # Errors
    /// A cloud that the format cannot hold, a disk that cannot be written.
    fn begin<'a>(
        &'a self,
        cloud: &'a Cloud<'a>,
        rt: &'a Runtime<'a>,
        spacing: ChosenSpacing,
        to: &'a StagedDataset,
    ) -> Result<Box<dyn OctreeWriter + 'a>, ConvertError>;
}

/// A dataset while its nodes are made.
pub(crate) trait OctreeWriter {
    /// Where nodes go.
    fn sink(&self) -> &dyn AnySink;

    /// Builds the tree for this format alone: compiled for it.
    ///
    /// # Errors
    /// As [`crate::octree::build`].
    fn build(&self, build: Build<'_>, settings: OctreeSettings) -> Result<Octree, ConvertError>;

    /// Writes what is around the nodes, and syncs all.
    ///
    /// # Errors
    /// A disk that cannot be written, a tree that the format cannot hold.
    fn finish(self: Box<Self>, tree: Octree) -> Result<OutputReport, ConvertError>;
}

/// A dataset to make: the settings of one of the formats. Made from [`crate::Potree2Settings`],
/// [`crate::BintreeSettings`] or [`crate::BatchesSettings`] by `into()`.
#[derive(Debug, Clone)]
pub struct Target(Arc<dyn Output>);

impl Target {
    pub(super) fn new(output: impl Output + 'static) -> Self {
        Self(Arc::new(output))
    }

    /// Its format.
    pub fn kind(&self) -> DatasetKind {
        self.0.kind()
    }

    pub(crate) fn output(&self) -> &dyn Output {
        &*self.0
    }
}

/// What an output needs of the cloud.
#[derive(Debug, Clone)]
pub(crate) struct Wants {
    /// For each attribute of the inputs: is it needed?
    pub(crate) attributes: Vec<bool>,
    /// Names that the output understands besides those of the attributes.
    pub(crate) other_names: &'static [&'static str],
    /// Sums and extremes of the cells.
    pub(crate) moments: bool,
}

impl Wants {
    /// The attributes that the plan asks for; `is_usual`: whether the format keeps an attribute where the plan leaves it
    /// to the format.
    pub(super) fn chosen(plan: &Plan, all: &Schema, is_usual: bool) -> Self {
        let is_chosen = |name: &String| {
            plan.derive.makes(name)
                || match &plan.attributes {
                    AttributeChoice::Usual => is_usual,
                    AttributeChoice::All | AttributeChoice::Scene => true,
                    AttributeChoice::List(names) => names.contains(name),
                }
        };
        let attributes = all.attributes.iter().map(|a| is_chosen(&a.name)).collect();
        Self { attributes, other_names: &[], moments: false }
    }

    /// Needs one more attribute, if there is one.
    pub(super) fn add(&mut self, attribute: Option<usize>) {
        if let Some(i) = attribute {
            self.attributes[i] = true;
        }
    }
}

/// What an output takes on disk, at most: bytes of each point, and of nodes or batches for a thousand points.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DiskSize {
    pub(crate) per_point: u64,
    pub(crate) per_1000_points: u64,
}

/// For each attribute of the inputs: whether the plan names it, or all.
///
/// # Errors
/// An attribute that was requested and that no input has.
pub(crate) fn named_attributes(plan: &Plan, all: &Schema) -> Result<Vec<bool>, PlanError> {
    check_names(plan, all, &[])?;
    Ok(Wants::chosen(plan, all, true).attributes)
}

/// What all outputs need together.
///
/// # Errors
/// An attribute that was requested and that no input has.
pub(crate) fn wants(plan: &Plan, targets: &[Target], all: &Schema) -> Result<Wants, PlanError> {
    let each: Vec<Wants> = targets.iter().map(|t| t.output().wants(plan, all)).collect();
    check_names(plan, all, &each)?;
    let differ = each.iter().any(|w| w.attributes != each[0].attributes);
    if plan.duplicates == Duplicates::Drop && differ {
        return Err(PlanError::new(Setting::Outputs, PlanFault::DifferentDuplicates));
    }
    let attributes = (0..all.attributes.len()).map(|i| each.iter().any(|w| w.attributes[i])).collect();
    Ok(Wants { attributes, other_names: &[], moments: each.iter().any(|w| w.moments) })
}

/// Refuses a list that names an attribute which neither the inputs nor an output have.
fn check_names(plan: &Plan, all: &Schema, each: &[Wants]) -> Result<(), PlanError> {
    let AttributeChoice::List(names) = &plan.attributes else { return Ok(()) };
    let is_known = |n: &&String| {
        let n = n.as_str();
        n == "position" || all.find(n).is_some() || each.iter().any(|w| w.other_names.contains(&n))
    };
    let Some(name) = names.iter().find(|n| !is_known(n)) else { return Ok(()) };
    let known = all.attributes.iter().map(|a| a.name.clone()).collect();
    Err(PlanError::new(Setting::Attributes, PlanFault::UnknownAttribute { name: name.clone(), known }))
}

/// True if all outputs hold points of the lattice as they are.
pub(crate) fn keep_lattice(targets: &[Target]) -> bool {
    targets.iter().all(|target| target.output().keeps_lattice())
}

/// What all outputs would be made with, and why; the lattice and the attributes aside.
pub(crate) fn choices(plan: &Plan, targets: &[Target]) -> Vec<PlannedChoice> {
    let of = |target: &Target| {
        let output = target.kind().name().to_owned();
        let named = move |choice| PlannedChoice { output: output.clone(), ..choice };
        target.output().choices(plan).into_iter().map(named)
    };
    targets.iter().flat_map(of).collect()
}

/// Refuses plans and targets that cannot be used, before anything is read.
pub(crate) fn check(plan: &Plan, targets: &[Target]) -> Result<(), ConvertError> {
    plan.check()?;
    if targets.is_empty() {
        return Err(PlanError::new(Setting::Outputs, PlanFault::Missing).into());
    }
    for (i, target) in targets.iter().enumerate() {
        if targets[..i].iter().any(|other| other.kind() == target.kind()) {
            return Err(PlanError::new(Setting::Outputs, PlanFault::Twice(target.kind())).into());
        }
        target.output().check(plan)?;
    }
    Ok(())
}

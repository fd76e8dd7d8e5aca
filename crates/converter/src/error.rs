//! Why a run could not finish. Each error is one line: what, where, what to do.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use pointmill_format::{Aabb, DatasetKind, ErrorKind, ReadError, system_reason};

use crate::advice::Advice;
use crate::plan::{ExportFormat, PlanError};
use crate::unit_name::JobUnit;

/// Why a run could not finish; the output is as it was before.
///
/// `Display` gives one line: [`Self::what`], and after a semicolon [`Self::advice`] in words.
#[derive(Debug)]
#[non_exhaustive]
pub enum ConvertError {
    /// An input is broken, not supported or not readable (see its kind).
    Read(ReadError),
    /// A setting has a value that cannot be used.
    Plan(PlanError),
    /// The request is sensible, but this version cannot do it.
    Unsupported(Unsupported),
    /// The inputs break a promise together, or hold nothing that can be converted.
    Input(InputFault),
    /// The output may not be replaced.
    Output(OutputFault),
    /// Disk full, no permission, …
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried ("writing the spill file").
        doing: &'static str,
        /// The error of the operating system.
        error: io::Error,
        /// True for a temporary file, false for what is written at the output.
        is_temporary: bool,
    },
    /// The memory ceiling is too small for this run.
    Memory {
        /// Bytes allowed.
        ceiling: u64,
        /// Bytes that are enough.
        needed: u64,
        /// What needs them.
        why: MemoryNeed,
    },
    /// A job cannot be gone on with, or begun.
    Job(JobFault),
    /// What was made was looked at before it got its name, and refused.
    Refused {
        /// The output.
        output: PathBuf,
        /// Why.
        why: String,
    },
    /// The run was asked to stop.
    Interrupted,
    /// A promise of our own code did not hold.
    Internal(String),
}

/// A request that this version cannot carry out.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Unsupported {
    /// Duplicates can be dropped for octrees only.
    DropDuplicates(DatasetKind),
    /// An attribute with more elements than the readers of the format accept.
    WideAttribute {
        /// The format.
        kind: DatasetKind,
        /// The attribute.
        name: String,
        /// Elements per point.
        elements: usize,
        /// Maximum elements per point.
        max: usize,
    },
    /// The columns of a leaf record cannot be stored.
    LeafColumns(String),
    /// More points in one place than a node can hold.
    CrowdedNode {
        /// Points in that place.
        points: u64,
        /// Maximum points of a node.
        max: u64,
    },
    /// The inputs are too far apart for one lattice of 31 bits.
    TooFarApart,
    /// One step serves all axes of the format, and is longer than that of one of them.
    FineAxis {
        /// The format.
        kind: DatasetKind,
        /// The axis: 0, 1 or 2.
        axis: usize,
        /// Its step, world units.
        step: f64,
        /// The shortest step that the cube allows, world units.
        least: f64,
    },
    /// The extent of the cloud needs a step that is coarser than the requested precision.
    CoarseLattice {
        /// The axis: 0, 1 or 2.
        axis: usize,
        /// Its step, world units.
        step: f64,
        /// Largest error, world units.
        error: f64,
        /// Largest error that was allowed, world units.
        allowed: f64,
    },
    /// A format does not keep the requested precision.
    Imprecise {
        /// The format.
        kind: DatasetKind,
        /// The axis: 0, 1 or 2.
        axis: usize,
        /// Largest error, or a bound of it, world units.
        error: f64,
        /// Largest error that was allowed, world units.
        allowed: f64,
    },
    /// A file of this format cannot hold these points.
    Export {
        /// The format.
        format: ExportFormat,
        /// Why.
        what: String,
    },
    /// The format cannot hold this cloud.
    Format {
        /// The format.
        kind: DatasetKind,
        /// Why.
        what: String,
    },
}

/// Inputs that cannot be converted, though each of them can be read.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum InputFault {
    /// Every input was skipped as unreadable.
    NoneReadable,
    /// No point passed the filter.
    NothingLeft {
        /// Points read.
        read: u64,
        /// Points outside the bounds.
        outside_bounds: u64,
        /// Points of other classes.
        other_class: u64,
        /// Points removed by thinning.
        thinned: u64,
        /// Points without a valid position.
        invalid: u64,
        /// Points exactly at the origin of their scan that were skipped for it.
        at_origin: u64,
    },
    /// Points farther away than coordinates can be.
    FarPoints {
        /// Lower corner of the points, world units.
        min: [f64; 3],
        /// Upper corner of the points, world units.
        max: [f64; 3],
    },
    /// Points so far from all others that these lose precision.
    CostlyOutliers {
        /// At least as many.
        points: u64,
        /// The box of all others, world units.
        others: Aabb,
        /// The axis that loses most: 0, 1 or 2.
        axis: usize,
        /// Its step with them, world units.
        step: f64,
        /// Its step without them.
        without: f64,
    },
    /// A point without a finite position, and the run was asked to fail at it.
    InvalidPosition {
        /// The scan.
        path: PathBuf,
        /// Index of the point in the scan.
        point: u64,
    },
    /// A file was changed between the read of its header and that of its points.
    Changed {
        /// The scan.
        path: PathBuf,
    },
    /// Colours declared as 8 bits deep have values above 255.
    DeepColours {
        /// The scan.
        path: PathBuf,
    },
}

/// Why a run cannot go on where another one ended, or cannot leave anything for another one.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum JobFault {
    /// Another run works with it.
    InUse {
        /// Its folder.
        folder: PathBuf,
    },
    /// The folder holds other things than a job.
    NoJob {
        /// The folder.
        folder: PathBuf,
    },
    /// It was begun by another version of the program.
    Version {
        /// That version.
        was: String,
    },
    /// It was begun with another setting.
    Setting {
        /// The setting, as reports name it.
        name: String,
        /// Its value then.
        was: String,
        /// Its value now.
        now: String,
    },
    /// An input is not as it was.
    ChangedInput {
        /// The input.
        path: PathBuf,
    },
    /// An input was, or is, not among the others.
    OtherInputs {
        /// The first such.
        path: PathBuf,
    },
    /// The folder for a job that is to be planned holds something.
    NotEmpty {
        /// The folder.
        folder: PathBuf,
    },
    /// The folder holds no job that was planned.
    NotThere {
        /// The folder.
        folder: PathBuf,
    },
    /// The job has no such unit, or not yet.
    NoUnit {
        /// Its name.
        unit: String,
    },
    /// Files of the job do not fit together: records or units were changed, lost or exchanged.
    Mixed {
        /// Its folder.
        folder: PathBuf,
        /// How that was found.
        what: String,
    },
    /// What an unfinished run has left does not fit together.
    Unfit {
        /// Its folder.
        folder: PathBuf,
        /// How that was found.
        what: String,
    },
    /// Units are not done: those that are known, in order.
    Unfinished {
        /// All units of the stage that the job has reached.
        units: Vec<JobUnit>,
    },
    /// A file of the job is not as it was written.
    Damaged {
        /// The file.
        file: PathBuf,
        /// From this byte on.
        byte: u64,
    },
}

impl JobFault {
    fn advice(&self) -> Option<Advice> {
        match self {
            Self::InUse { .. } => Some(Advice::WaitForRun),
            Self::NoJob { .. } => Some(Advice::MoveAway),
            Self::NotEmpty { .. } => Some(Advice::OtherFolder),
            Self::NotThere { .. } => Some(Advice::PlanJob),
            Self::Mixed { .. } => Some(Advice::PlanAnew),
            Self::NoUnit { .. } => Some(Advice::ListUnits),
            Self::Unfinished { .. } => Some(Advice::RunUnits),
            _ => Some(Advice::StartAnew),
        }
    }
}

impl fmt::Display for JobFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InUse { folder } => write!(f, "{}: another run works with it", folder.display()),
            Self::NoJob { folder } => {
                write!(f, "{}: the folder for an unfinished run holds other files", folder.display())
            }
            Self::Version { was } => write!(f, "what is to go on was begun by version {was}, this is another one"),
            Self::Setting { name, was, now } => {
                write!(f, "what is to go on was begun with another {name}: {was}, now {now}")
            }
            Self::ChangedInput { path } => write!(f, "{}: changed since the work was begun", path.display()),
            Self::OtherInputs { path } => {
                write!(f, "{}: not an input of both this command and what is to go on", path.display())
            }
            Self::NotEmpty { folder } => write!(f, "{}: the folder for a job is not empty", folder.display()),
            Self::NotThere { folder } => write!(f, "{}: not the folder of a planned job", folder.display()),
            Self::NoUnit { unit } => write!(f, "{unit}: the job has no such unit, or not yet"),
            Self::Mixed { folder, what } => {
                write!(f, "{}: files of the job were changed or exchanged ({what})", folder.display())
            }
            Self::Unfit { folder, what } => {
                write!(f, "{}: what the unfinished run has left does not fit together ({what})", folder.display())
            }
            Self::Unfinished { units } => {
                let open = units.iter().filter(|unit| !unit.done);
                let first =
                    open.clone().next().map_or_else(String::new, |unit| format!("; the first is {}", unit.name));
                write!(f, "{} of {} known units are not done{first}", open.count(), units.len())
            }
            Self::Damaged { file, byte } => {
                write!(f, "{}: not as it was written, from byte {byte} on", file.display())
            }
        }
    }
}

impl From<JobFault> for ConvertError {
    fn from(fault: JobFault) -> Self {
        Self::Job(fault)
    }
}

/// An existing output that may not be replaced.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum OutputFault {
    /// It exists, and nothing may be replaced.
    Exists(PathBuf),
    /// It is a dataset that contains a file which belongs to no dataset.
    Foreign {
        /// The output.
        output: PathBuf,
        /// The file.
        file: PathBuf,
    },
    /// It is not a dataset.
    NotADataset(PathBuf),
    /// It is a folder, or nothing that a file can replace.
    NotAFile(PathBuf),
    /// Another run writes in it.
    Busy(PathBuf),
}

/// What needs more memory than is allowed.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum MemoryNeed {
    /// The least that every thread works on.
    Threads {
        /// Worker threads.
        threads: u64,
        /// Points that each of them must have in memory.
        points: u64,
    },
    /// What is known of the inputs.
    Inputs {
        /// Bytes for all of them.
        bytes: u64,
    },
    /// A part of the run whose size only the points tell, such as "the lists of nodes".
    Part(&'static str),
}

impl ConvertError {
    /// Wraps an error of the operating system.
    pub(crate) fn io(path: impl AsRef<Path>, doing: &'static str, error: io::Error) -> Self {
        Self::Io { path: path.as_ref().to_path_buf(), doing, error, is_temporary: false }
    }

    /// The same for a temporary file, which can be put elsewhere.
    pub(crate) fn temporary(self) -> Self {
        match self {
            Self::Io { path, doing, error, .. } => Self::Io { path, doing, error, is_temporary: true },
            other => other,
        }
    }

    /// The line without the advice: what and where.
    pub fn what(&self) -> String {
        match self {
            Self::Read(e) => e.to_string(),
            Self::Plan(e) => e.to_string(),
            Self::Unsupported(e) => e.to_string(),
            Self::Input(e) => e.to_string(),
            Self::Output(e) => e.to_string(),
            Self::Job(e) => e.to_string(),
            Self::Io { path, doing, error, .. } => format!("{}: {doing}: {}", path.display(), system_reason(error)),
            Self::Memory { ceiling, why, .. } => {
                format!("the memory ceiling of {} is too small: {why}", amount(*ceiling))
            }
            Self::Refused { output, why } => {
                format!("{}: the new dataset is not valid and was not kept: {why}", output.display())
            }
            Self::Interrupted => "interrupted; nothing was written".to_owned(),
            Self::Internal(what) => {
                format!("internal fault: {what}; please report it with the command line and the input")
            }
        }
    }

    /// True if a run with the same inputs and settings would end in the same way, whatever room it has.
    pub(crate) fn comes_again(&self) -> bool {
        match self {
            Self::Read(error) => !matches!(error.kind(), ErrorKind::Io(_)),
            Self::Plan(_) | Self::Unsupported(_) | Self::Input(_) | Self::Job(_) | Self::Refused { .. } => true,
            Self::Output(_) | Self::Io { .. } | Self::Memory { .. } | Self::Interrupted | Self::Internal(_) => false,
        }
    }

    /// What the user can do, where there is something.
    pub fn advice(&self) -> Option<Advice> {
        match self {
            Self::Unsupported(e) => e.advice(),
            Self::Input(e) => e.advice(),
            Self::Output(e) => Some(e.advice()),
            Self::Io { error, is_temporary, .. } => match error.kind() {
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded if *is_temporary => {
                    Some(Advice::FreeTemporaryDisk)
                }
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Some(Advice::FreeDisk),
                io::ErrorKind::FileTooLarge => Some(Advice::AllowLargerFiles),
                _ => None,
            },
            Self::Memory { needed, .. } => Some(Advice::RaiseMemory { mib: (needed >> 20) + 1 }),
            Self::Job(e) => e.advice(),
            Self::Read(_) | Self::Plan(_) | Self::Refused { .. } | Self::Interrupted | Self::Internal(_) => None,
        }
    }
}

/// A size as it was meant: a ceiling below a mebibyte is a slip of the unit, which MiB would show as 0.
fn amount(bytes: u64) -> String {
    match bytes {
        1 => "1 byte".to_owned(),
        0..1024 => format!("{bytes} bytes"),
        1024..1_048_576 => format!("{} KiB", bytes >> 10),
        _ => format!("{} MiB", bytes >> 20),
    }
}

impl fmt::Display for ConvertError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what())?;
        match self.advice() {
            Some(advice) => write!(f, "; {advice}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for ConvertError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            // the line of the error itself is in `Display`
            Self::Read(error) => error.source(),
            _ => None,
        }
    }
}

impl From<ReadError> for ConvertError {
    fn from(error: ReadError) -> Self {
        Self::Read(error)
    }
}

impl From<PlanError> for ConvertError {
    fn from(error: PlanError) -> Self {
        Self::Plan(error)
    }
}

impl From<Unsupported> for ConvertError {
    fn from(error: Unsupported) -> Self {
        Self::Unsupported(error)
    }
}

impl From<InputFault> for ConvertError {
    fn from(error: InputFault) -> Self {
        Self::Input(error)
    }
}

impl From<OutputFault> for ConvertError {
    fn from(error: OutputFault) -> Self {
        Self::Output(error)
    }
}

impl Unsupported {
    fn advice(&self) -> Option<Advice> {
        match self {
            Self::DropDuplicates(_) => Some(Advice::KeepDuplicates),
            Self::WideAttribute { .. } => Some(Advice::NameAttributes),
            Self::LeafColumns(_) => Some(Advice::LeaveOutAttribute),
            Self::CrowdedNode { .. } => Some(Advice::DropDuplicates),
            Self::TooFarApart => Some(Advice::ConvertApart),
            Self::FineAxis { least, .. } => Some(Advice::CoarserStep { least: *least }),
            Self::CoarseLattice { .. } => Some(Advice::CoarserPrecision { is_by_format: false }),
            Self::Imprecise { .. } => Some(Advice::CoarserPrecision { is_by_format: true }),
            Self::Export { .. } => Some(Advice::NameAttributes),
            Self::Format { .. } => None,
        }
    }
}

impl fmt::Display for Unsupported {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::DropDuplicates(kind) => write!(f, "{kind}: duplicates can be dropped for octrees only"),
            Self::WideAttribute { kind, name, elements, max } => {
                write!(f, "{kind}: \"{name}\" has {elements} elements per point, viewers read at most {max}")
            }
            Self::LeafColumns(what) => write!(f, "the columns of a leaf: {what}"),
            Self::CrowdedNode { points, max } => {
                write!(f, "{points} points share one place; a node holds at most {max}")
            }
            Self::TooFarApart => f.write_str("the inputs are too far apart for one lattice of 31 bits"),
            Self::FineAxis { kind, axis, step, least } => {
                let axis = ['x', 'y', 'z'][*axis];
                write!(
                    f,
                    "{kind}: positions have one step for all axes, at least {least} here; that of {axis} is {step}"
                )
            }
            Self::CoarseLattice { axis, step, error, allowed } => {
                let axis = ['x', 'y', 'z'][*axis];
                write!(
                    f,
                    "the step of {axis} is {step}, the finest for this extent and these coordinates; that is off by up to \
                     {error:.3e}, and the requested precision allows {allowed:.3e}"
                )
            }
            Self::Imprecise { kind, axis, error, allowed } => {
                let axis = ['x', 'y', 'z'][*axis];
                write!(f, "{kind}: {axis} would be off by up to {error}; the requested precision allows {allowed}")
            }
            Self::Export { format, what } => write!(f, "{format}: {what}"),
            Self::Format { kind, what } => write!(f, "{kind}: {what}"),
        }
    }
}

impl InputFault {
    fn advice(&self) -> Option<Advice> {
        match self {
            Self::FarPoints { .. } => Some(Advice::CutBounds { bounds: None }),
            Self::CostlyOutliers { others, .. } => Some(Advice::CutOutliers { bounds: *others }),
            Self::InvalidPosition { .. } => Some(Advice::SkipInvalid),
            Self::Changed { .. } => Some(Advice::StopWriting),
            Self::DeepColours { .. } => Some(Advice::DetectRgbDepth),
            Self::NoneReadable | Self::NothingLeft { .. } => None,
        }
    }
}

impl fmt::Display for InputFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoneReadable => f.write_str("none of the inputs could be read"),
            Self::NothingLeft { read, outside_bounds, other_class, thinned, invalid, at_origin } => write!(
                f,
                "no points left after filtering {read}: {outside_bounds} outside the bounds, {other_class} of other \
                 classes, {thinned} thinned out, {invalid} without a valid position, {at_origin} at the scanner's origin"
            ),
            Self::FarPoints { min, max } => {
                let corner = |c: &[f64; 3]| format!("{:e}, {:e}, {:e}", c[0], c[1], c[2]);
                write!(f, "there are points from ({}) to ({}), which cannot be coordinates", corner(min), corner(max))
            }
            Self::CostlyOutliers { points, axis, step, without, .. } => {
                let lie = if *points == 1 { "point lies" } else { "or more points lie" };
                let short = |v: f64| if (1e-4..1e9).contains(&v) { v.to_string() } else { format!("{v:e}") };
                let axis = ["x", "y", "z"].get(*axis).unwrap_or(&"z");
                let (step, without) = (short(*step), short(*without));
                write!(
                    f,
                    "{points} {lie} so far from all others that the step of {axis} would be {step}, not {without}, and \
                     all coordinates would be rounded to it"
                )
            }
            Self::InvalidPosition { path, point } => {
                write!(f, "{}: point {point} has no finite position", path.display())
            }
            Self::Changed { path } => {
                write!(f, "{}: the file was changed while it was being read", path.display())
            }
            Self::DeepColours { path } => {
                write!(f, "{}: has colour values above 255, so they cannot be 8 bits deep", path.display())
            }
        }
    }
}

impl OutputFault {
    fn advice(&self) -> Advice {
        match self {
            Self::Exists(_) => Advice::ReplaceOutput,
            Self::Foreign { .. } => Advice::MoveAway,
            Self::NotADataset(_) | Self::NotAFile(_) => Advice::OtherOutput,
            Self::Busy(_) => Advice::WaitForRun,
        }
    }
}

impl fmt::Display for OutputFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exists(output) => write!(f, "{}: the output exists already", output.display()),
            Self::Foreign { output, file } => write!(
                f,
                "{}: {} in it is not part of a dataset of ours, so the output is not replaced",
                output.display(),
                file.display()
            ),
            Self::NotADataset(output) => {
                write!(f, "{}: exists and is not a dataset of ours, so it is not replaced", output.display())
            }
            Self::NotAFile(output) => write!(f, "{}: is there, and no file that another can replace", output.display()),
            Self::Busy(output) => write!(f, "{}: another run is writing there", output.display()),
        }
    }
}

impl fmt::Display for MemoryNeed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Threads { threads, points } => {
                write!(f, "{threads} worker threads need {points} points each in memory")
            }
            Self::Inputs { bytes } => write!(f, "what is known of the inputs takes {} MiB", bytes.div_ceil(1 << 20)),
            Self::Part(what) => write!(f, "{what} need more"),
        }
    }
}

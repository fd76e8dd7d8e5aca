//! `pointmill validate`: does a dataset keep the promises of its format?

use crate::args::ValidateArgs;
use crate::exit::Failure;

pub(crate) fn run(args: &ValidateArgs) -> Result<(), Failure> {
    Err(Failure::Unsupported(format!("{}: not built yet", args.dataset.display())))
}

//! Where the programs are.

use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::cases::Program;

/// The programs that are measured.
pub(crate) struct Programs {
    pointmill: PathBuf,
    /// The folder of this program and others of its crate.
    folder: PathBuf,
}

impl Programs {
    /// Builds what is built here, if cargo runs this program; `pointmill` is another one to measure.
    ///
    /// # Errors
    /// Something does not build, or is not there.
    pub(crate) fn new(pointmill: Option<&Path>) -> io::Result<Self> {
        let this = std::env::current_exe()?;
        let folder = this.parent().unwrap_or(Path::new("")).to_path_buf();
        let profile = match folder.file_name().and_then(|name| name.to_str()) {
            None | Some("debug") => "dev",
            Some(profile) => profile,
        };
        if let Some(cargo) = std::env::var_os("CARGO") {
            // One by one: together they would share the features that the other wants.
            build(Command::new(&cargo).args(["build", "--profile", profile, "-p", "pointmill-bench", "--bins"]))?;
            if pointmill.is_none() {
                build(Command::new(&cargo).args(["build", "--profile", profile, "-p", "pointmill"]))?;
            }
        }
        let pointmill = pointmill.map_or_else(|| executable(&folder, "pointmill"), Path::to_path_buf);
        let programs = Self { pointmill, folder };
        let ours = Program::ALL.into_iter().filter(|program| !program.is_foreign());
        if let Some(missing) = ours.map(|program| programs.path(program)).find(|path| !path.exists()) {
            let advice = "start this program with cargo run, which builds it, or pass --pointmill FILE";
            return Err(io::Error::other(format!("{} is not there; {advice}", missing.display())));
        }
        Ok(programs)
    }

    /// What to start.
    pub(crate) fn path(&self, program: Program) -> PathBuf {
        match program {
            Program::Pointmill => self.pointmill.clone(),
            // By its whole path: PotreeConverter looks for its files beside the name it is started with.
            Program::PotreeConverter | Program::CopcConverter => {
                on_path(program).unwrap_or_else(|| program.binary().into())
            }
            Program::Floor | Program::Reader | Program::Laz => executable(&self.folder, program.binary()),
        }
    }
}

fn build(command: &mut Command) -> io::Result<()> {
    if command.status()?.success() { Ok(()) } else { Err(io::Error::other("what is measured does not build")) }
}

fn executable(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{name}{}", std::env::consts::EXE_SUFFIX))
}

/// Where a foreign program is, if it is on `PATH`.
pub(crate) fn on_path(program: Program) -> Option<PathBuf> {
    let paths = std::env::var_os("PATH")?;
    std::env::split_paths(&paths).map(|dir| dir.join(program.binary())).find(|path| path.is_file())
}

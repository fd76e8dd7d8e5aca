//! What must be the same for a run to go on where another one ended.

use std::fs::File;
use std::path::{Path, PathBuf};

use pointmill_format::bytes;
use serde::{Deserialize, Serialize};

use crate::error::{ConvertError, JobFault};
use crate::plan::Plan;
use crate::sources::Sources;

/// Bytes of the head and of the tail of a file that are looked at.
const ENDS: u64 = 64 << 10;

/// Settings that change no byte.
const RESOURCES: [&str; 2] = ["memory", "threads"];

/// What a job was begun for.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Identity {
    version: String,
    /// Everything that shapes the output, by name.
    settings: Vec<(String, String)>,
    inputs: Vec<Fingerprint>,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Fingerprint {
    /// As bytes: names need not be UTF-8.
    path: Vec<u8>,
    bytes: u64,
    /// See [`crate::sources::Source::mark`].
    mark: u64,
    /// Checksums of the first and the last bytes; `None`: not looked at.
    ends: Option<[u32; 2]>,
}

impl Fingerprint {
    fn shown(&self) -> PathBuf {
        one_line(&String::from_utf8_lossy(&self.path)).into()
    }
}

impl Identity {
    /// Of a run. `settings`: those of the report, which shape the datasets. `looks_closely`: into the files, too.
    pub(crate) fn of(
        plan: &Plan,
        sources: &Sources,
        settings: serde_json::Map<String, serde_json::Value>,
        looks_closely: bool,
    ) -> Result<Self, ConvertError> {
        let mut all: Vec<(String, String)> =
            settings.into_iter().map(|(name, value)| (name, value.to_string())).collect();
        all.retain(|(name, _)| !RESOURCES.contains(&name.as_str()));
        all.push(("reading of scans".into(), format!("{:?}", plan.open)));
        all.push(("filter".into(), format!("{:?}", plan.filter)));
        all.push(("attributes".into(), format!("{:?}", plan.attributes)));
        all.push(("step".into(), format!("{:?}", plan.scale)));
        all.push(("size of a unit".into(), plan.checkpoint_points.to_string()));
        let inputs = sources.all.iter().map(|source| {
            let path = source.path.to_path_buf();
            let look = || ends(&path, source.file_bytes);
            let ends =
                looks_closely.then(look).transpose().map_err(|e| ConvertError::io(&path, "reading the scan", e))?;
            let path = path.as_os_str().as_encoded_bytes().to_vec();
            Ok(Fingerprint { path, bytes: source.file_bytes, mark: source.mark(), ends })
        });
        let version = env!("CARGO_PKG_VERSION").to_owned();
        Ok(Self { version, settings: all, inputs: inputs.collect::<Result<_, ConvertError>>()? })
    }

    /// What differs from `was`, if anything does.
    pub(super) fn differs_from(&self, was: &Self) -> Option<JobFault> {
        if self.version != was.version {
            return Some(JobFault::Version { was: one_line(&was.version) });
        }
        let setting = |all: &Self, name: &str| all.settings.iter().find(|(n, _)| n == name).map(|(_, v)| v.clone());
        for (name, _) in was.settings.iter().chain(&self.settings) {
            let (was, now) = (setting(was, name), setting(self, name));
            if was != now {
                let text = |value: Option<String>| value.map_or_else(|| "not given".into(), |value| one_line(&value));
                return Some(JobFault::Setting { name: one_line(name), was: text(was), now: text(now) });
            }
        }
        for (was, now) in was.inputs.iter().zip(&self.inputs) {
            if was.path != now.path {
                return Some(JobFault::OtherInputs { path: was.shown() });
            }
            let are_ends_same = was.ends.zip(now.ends).is_none_or(|(was, now)| was == now);
            if (was.bytes, was.mark) != (now.bytes, now.mark) || !are_ends_same {
                return Some(JobFault::ChangedInput { path: now.shown() });
            }
        }
        let more = was.inputs.get(self.inputs.len()).or_else(|| self.inputs.get(was.inputs.len()));
        more.map(|input| JobFault::OtherInputs { path: input.shown() })
    }
}

/// What a file says of itself, for a line.
fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { '?' } else { c }).collect()
}

/// Checksums of the first and the last bytes of a file, of which it may have fewer.
fn ends(path: &Path, length: u64) -> std::io::Result<[u32; 2]> {
    if !path.is_file() {
        return Ok([0; 2]); // the folder of a dataset: its mark tells
    }
    let file = File::open(path)?;
    let mut buffer = vec![0; length.min(ENDS) as usize];
    bytes::read_exact_at(&file, &mut buffer, 0)?;
    let head = crc32c::crc32c(&buffer);
    bytes::read_exact_at(&file, &mut buffer, length.saturating_sub(ENDS))?;
    Ok([head, crc32c::crc32c(&buffer)])
}

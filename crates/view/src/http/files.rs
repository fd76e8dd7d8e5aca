//! The files of a dataset as they are, and nothing else.

use std::path::{Path, PathBuf};

use http_body_util::BodyExt as _;
use hyper::{HeaderMap, Method, Request};
use percent_encoding::percent_decode_str;
use tower_http::services::ServeFile;

use super::answer::Answer;
use crate::Dataset;
use crate::refusal::Refusal;

/// The file that a path of the request names. `segments`: behind `data/{d}/`, not decoded.
pub(super) fn find<'a>(dataset: &Dataset, segments: impl Iterator<Item = &'a str>) -> Result<PathBuf, Refusal> {
    let absent = || Refusal::absent("no such file in the dataset");
    let names: Option<Vec<String>> = segments.map(name).collect();
    let names = names.filter(|names| !names.is_empty()).ok_or_else(absent)?;
    if let Some(file) = dataset.single_file() {
        let is_it = names.len() == 1 && names.iter().all(|name| name == file);
        return if is_it { Ok(dataset.path().to_path_buf()) } else { Err(absent()) };
    }
    let path = names.iter().fold(dataset.path().to_path_buf(), |path, name| path.join(name));
    let found = path.canonicalize().ok().filter(|found| is_file_in(dataset.path(), found));
    found.ok_or_else(absent)
}

/// A link that leads out of the dataset, a folder and a pipe are no files of it.
fn is_file_in(folder: &Path, found: &Path) -> bool {
    found.starts_with(folder) && found != folder && found.is_file()
}

/// One name, decoded once. Hidden ones are of runs that are not finished.
fn name(segment: &str) -> Option<String> {
    let name = percent_decode_str(segment).decode_utf8().ok()?;
    let is_plain = !name.is_empty() && !name.starts_with('.') && !name.contains(['/', '\\', '\0']);
    let is_drive = cfg!(windows) && name.contains(':');
    (is_plain && !is_drive).then(|| name.into_owned())
}

/// The file or the range of it that the headers ask for.
pub(super) async fn serve(path: &Path, method: &Method, headers: &HeaderMap) -> Result<Answer, Refusal> {
    let mut request = Request::new(());
    request.method_mut().clone_from(method);
    request.headers_mut().clone_from(headers);
    let answer = ServeFile::new(path).try_call(request).await;
    let answer = answer.map_err(|error| Refusal::broken(format!("{}: reading: {error}", path.display())))?;
    Ok(answer.map(|body| body.boxed_unsync()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_elsewhere_are_none() {
        assert_eq!(name("r%20042.bin").as_deref(), Some("r 042.bin"));
        assert_eq!(name("%252e%252e").as_deref(), Some("%2e%2e"), "decoded once");
        for bad in ["", ".", "..", "%2e%2e", "%2E.", "a%2fb", "a%5cb", "a\\b", "a%00", ".unfinished-1", "%ff"] {
            assert_eq!(name(bad), None, "{bad}");
        }
    }
}

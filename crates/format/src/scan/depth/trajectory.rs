//! Poses of frames, from text files: camera to world.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use super::camera::{PoseFault, pose};
use crate::{Advice, Affine, ReadError};

/// A frame and its pose, or its colour picture, may be that many seconds apart.
pub(super) const MAX_SECONDS: f64 = 0.02;

/// A file of poses or of frames is smaller: an hour at 100 Hz is 40 MB.
const MAX_BYTES: u64 = 256 << 20;

/// Lines of a frame in a `.log`: three numbers, and the rows of the matrix.
const LOG_LINES: usize = 5;

/// The least and the greatest length of a quaternion that was to have length 1.
const UNIT: std::ops::RangeInclusive<f64> = 0.99..=1.01;

/// Where frames get their poses from.
#[derive(Debug)]
pub(super) enum Trajectory {
    /// By time, in seconds, in order, each with the byte of its line: lines `timestamp tx ty tz qx qy qz qw` (TUM RGB-D).
    Timed { path: PathBuf, poses: Vec<(f64, (u64, Affine))> },
    /// By number: three numbers and a matrix for each frame (Redwood, Open3D).
    Counted { path: PathBuf, poses: Vec<Affine> },
    /// A file with a matrix for each frame.
    Each,
}

/// A line that is no comment, and where it starts.
pub(super) struct Line<'a> {
    pub(super) at: u64,
    pub(super) text: &'a str,
}

/// The text of a file.
pub(super) fn text(path: &Path) -> Result<String, ReadError> {
    let io = |e| ReadError::io(path, "reading it", e);
    let mut bytes = Vec::new();
    File::open(path).map_err(io)?.take(MAX_BYTES).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 == MAX_BYTES {
        return Err(
            ReadError::unsupported(path, format!("longer than {MAX_BYTES} bytes")).advise("divide the sequence")
        );
    }
    String::from_utf8(bytes).map_err(|e| {
        let at = e.utf8_error().valid_up_to() as u64;
        ReadError::broken(path, at, "not text in UTF-8").advise(Advice::WrongFile)
    })
}

/// The lines that hold something, but for those that start with `#`.
pub(super) fn lines(text: &str) -> impl Iterator<Item = Line<'_>> {
    let mut at = 0;
    let lines = text.split_inclusive('\n').map(move |line| {
        let start = at;
        at += line.len() as u64;
        Line { at: start, text: line.trim() }
    });
    lines.filter(|line| !line.text.is_empty() && !line.text.starts_with('#'))
}

/// The numbers of a text between blanks or commas; `None` if there is something else.
fn numbers(text: &str) -> Option<Vec<f64>> {
    let fields = text.split(|c: char| c.is_whitespace() || c == ',').filter(|field| !field.is_empty());
    fields.map(|field| field.parse().ok()).collect()
}

impl Trajectory {
    /// Reads lines of times and quaternions.
    pub(super) fn timed(path: &Path) -> Result<Self, ReadError> {
        let text = text(path)?;
        let mut poses = Vec::new();
        for line in lines(&text) {
            let broken = |what: String| ReadError::broken(path, line.at, what).advise(Advice::ExportAgain);
            let numbers: Option<[f64; 8]> =
                numbers(line.text).and_then(|n| n.try_into().ok()).filter(|n: &[f64; 8]| n[0].is_finite());
            let [time, x, y, z, quaternion @ ..] =
                numbers.ok_or_else(|| broken("expected the 8 numbers timestamp tx ty tz qx qy qz qw".to_owned()))?;
            let matrix = matrix(quaternion, [x, y, z]).map_err(broken)?;
            let pose = pose(&matrix).map_err(|fault| broken(format!("no pose: {}", fault.what)))?;
            poses.push((time, (line.at, pose)));
        }
        poses.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(Self::Timed { path: path.to_path_buf(), poses })
    }

    /// Reads matrices, each below a line of three numbers.
    pub(super) fn counted(path: &Path) -> Result<Self, ReadError> {
        let text = text(path)?;
        let lines: Vec<Line<'_>> = lines(&text).collect();
        let mut poses = Vec::new();
        for frame in lines.chunks(LOG_LINES) {
            let broken = |at, what: &str| ReadError::broken(path, at, what).advise(Advice::ExportAgain);
            let [above, rows @ ..] = frame else { break };
            if frame.len() < LOG_LINES {
                return Err(broken(above.at, "expected 3 numbers and the 4 rows of a matrix"));
            }
            if numbers(above.text).is_none_or(|numbers| numbers.len() != 3) {
                return Err(broken(above.at, "expected 3 numbers, those above a matrix"));
            }
            let mut matrix = [0.0; 16];
            for (line, row) in rows.iter().zip(matrix.chunks_exact_mut(4)) {
                let found = numbers(line.text).filter(|numbers| numbers.len() == 4);
                row.copy_from_slice(&found.ok_or_else(|| broken(line.at, "expected 4 numbers, a row of a matrix"))?);
            }
            let at = |row: Option<usize>| rows.get(row.unwrap_or(0)).map_or(above.at, |line| line.at);
            let no_pose = |PoseFault { row, what }| broken(at(row), &format!("no pose: {what}"));
            poses.push(pose(&matrix).map_err(no_pose)?);
        }
        Ok(Self::Counted { path: path.to_path_buf(), poses })
    }
}

/// The pose in a file of 16 numbers.
pub(super) fn of_file(path: &Path) -> Result<Affine, ReadError> {
    let text = text(path)?;
    let broken = |at, what: &str| ReadError::broken(path, at, what).advise(Advice::SkipUnreadable);
    let not_16 = |at| broken(at, "not the 16 numbers of a pose");
    // each with the start of its line
    let mut found = Vec::new();
    for line in lines(&text) {
        let numbers = numbers(line.text).ok_or_else(|| not_16(line.at))?;
        found.extend(numbers.into_iter().map(|number| (line.at, number)));
    }
    let numbers: Vec<f64> = found.iter().map(|(_, number)| *number).collect();
    let matrix = <[f64; 16]>::try_from(numbers).map_err(|_| not_16(0))?;
    pose(&matrix).map_err(|PoseFault { row, what }| {
        let at = found.get(4 * row.unwrap_or(0)).map_or(0, |(at, _)| *at);
        broken(at, &format!("no pose: {what}"))
    })
}

/// The entry whose time is nearest to `time`, and how far it is; `sorted` by time.
pub(super) fn nearest<T>(sorted: &[(f64, T)], time: f64) -> Option<(&T, f64)> {
    let after = sorted.partition_point(|(t, _)| *t < time);
    let around = sorted.get(after.saturating_sub(1)..(after + 1).min(sorted.len()))?;
    let distance = |(t, _): &'_ (f64, T)| (t - time).abs();
    let found = around.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    Some((&found.1, distance(found)))
}

/// The matrix of a rotation x y z w, and a place. The quaternion is made one of length 1.
fn matrix(quaternion: [f64; 4], [tx, ty, tz]: [f64; 3]) -> Result<[f64; 16], String> {
    let length = quaternion.iter().map(|q| q * q).sum::<f64>().sqrt();
    if !UNIT.contains(&length) {
        return Err(format!("the quaternion has length {length}, not 1"));
    }
    let [x, y, z, w] = quaternion.map(|q| q / length);
    Ok([
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - z * w),
        2.0 * (x * z + y * w),
        tx,
        2.0 * (x * y + z * w),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - x * w),
        ty,
        2.0 * (x * z - y * w),
        2.0 * (y * z + x * w),
        1.0 - 2.0 * (x * x + y * y),
        tz,
        0.0,
        0.0,
        0.0,
        1.0,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quaternion_turns_as_its_axis_and_angle_say() {
        let half = 0.5f64.sqrt();
        let map = pose(&matrix([0.0, 0.0, half, half], [5.0, 6.0, 7.0]).unwrap()).unwrap();
        let found = map.apply([1.0, 0.0, 0.0]);
        assert!(found.iter().zip([5.0, 7.0, 7.0]).all(|(a, b)| (a - b).abs() < 1e-15), "{found:?}");
        assert!(matrix([0.0; 4], [0.0; 3]).unwrap_err().contains("length 0"));
    }

    #[test]
    fn the_nearest_in_time_is_found_on_either_side() {
        let times = [(1.0, 'a'), (2.0, 'b'), (4.0, 'c')];
        let found = |time| nearest(&times, time).map(|(value, seconds)| (*value, seconds));
        assert_eq!(found(0.0), Some(('a', 1.0)));
        assert_eq!(found(2.75), Some(('b', 0.75)));
        assert_eq!(found(3.5), Some(('c', 0.5)));
        assert_eq!(found(9.0), Some(('c', 5.0)));
        assert_eq!(nearest::<char>(&[], 1.0), None);
    }

    #[test]
    fn poses_are_read_from_each_kind_of_text_and_refused_with_their_byte() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("poses");
        std::fs::write(&path, "# made\n2.5 1 2 3 0 0 0 1\n1.5 4 5 6 0 0 0 1.0001\n").unwrap();
        let Trajectory::Timed { poses, .. } = Trajectory::timed(&path).unwrap() else { panic!() };
        assert_eq!(
            poses.iter().map(|(t, (at, map))| (*t, *at, map.translation())).collect::<Vec<_>>(),
            [(1.5, 25, [4.0, 5.0, 6.0]), (2.5, 7, [1.0, 2.0, 3.0])]
        );
        std::fs::write(&path, "1 1 2 3 0 0 0 1\n2 1 2 3 0 0 0\n").unwrap();
        assert_eq!(Trajectory::timed(&path).unwrap_err().offset(), Some(16));
        let matrix = "1 0 0 9\n0 1 0 8\n0 0 1 7\n0 0 0 1\n";
        std::fs::write(&path, format!("0 0 1\n{matrix}1 1 2\n{matrix}")).unwrap();
        let Trajectory::Counted { poses, .. } = Trajectory::counted(&path).unwrap() else { panic!() };
        assert_eq!(poses.iter().map(Affine::translation).collect::<Vec<_>>(), [[9.0, 8.0, 7.0]; 2]);
        std::fs::write(&path, format!("0 0 1\n{matrix}1 1 2\n1 0 0 9\n")).unwrap();
        assert_eq!(Trajectory::counted(&path).unwrap_err().offset(), Some(38));
        std::fs::write(&path, matrix).unwrap();
        assert_eq!(of_file(&path).unwrap().translation(), [9.0, 8.0, 7.0]);
        std::fs::write(&path, matrix.replace('9', "-inf")).unwrap();
        assert!(of_file(&path).unwrap_err().to_string().contains("a number is not finite"));
    }
}

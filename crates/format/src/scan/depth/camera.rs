//! The camera of a depth map: options, then the JSON file beside it, then that of its folder.

use std::fs::File;
use std::io::Read as _;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::json::{Fault, Fields, broken, syntax_error};
use crate::scan::depth_options::UNITS_PER_METRE;
use crate::{Advice, Affine, AffineFault, DepthOptions, Intrinsics, ReadError};

/// Where the centre of a camera lies in its pictures, as parts of a side. Of cut pictures it may lie elsewhere: their size must
/// be given.
const CENTRAL: RangeInclusive<f64> = 0.125..=0.875;

/// A description of a camera is smaller.
const MAX_BYTES: u64 = 1 << 20;

/// What to do about a file that is none.
const CORRECT: &str = "correct it, or give the camera in options";

/// What a JSON file says of a camera; other keys are not read.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Sidecar {
    fx: Option<f64>,
    fy: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    width: Option<u32>,
    height: Option<u32>,
    depth_scale: Option<f64>,
    pose: Option<Vec<f64>>,
    color: Option<PathBuf>,
    /// The file.
    path: PathBuf,
}

impl Sidecar {
    /// The file at `path`; `None` if there is none.
    pub(super) fn read(path: &Path) -> Result<Option<Self>, ReadError> {
        if !path.is_file() {
            return Ok(None);
        }
        let io = |e| ReadError::io(path, "reading the camera", e);
        let mut bytes = Vec::new();
        File::open(path).map_err(io)?.take(MAX_BYTES).read_to_end(&mut bytes).map_err(io)?;
        Self::parse(&bytes, path).map(Some)
    }

    fn parse(bytes: &[u8], path: &Path) -> Result<Self, ReadError> {
        let value: Value = serde_json::from_slice(bytes).map_err(|e| syntax_error(bytes, path, &e).advise(CORRECT))?;
        Self::of(value, path).map_err(|fault| {
            let (Fault::Broken(what) | Fault::Unsupported(what)) = fault;
            ReadError::broken(path, None, format!("not the description of a camera: {what}")).advise(CORRECT)
        })
    }

    fn of(value: Value, path: &Path) -> Result<Self, Fault> {
        let mut map = match value {
            Value::Object(map) => map,
            Value::Array(_) => return broken("it is an array, not an object"),
            _ => return broken("it is a single value, not an object"),
        };
        map.retain(|_, value| !value.is_null());
        let fields = &mut Fields { map: &mut map, place: "" };
        let [cx, cy] = [["cx", "ppx"], ["cy", "ppy"]].map(|names| one_of(fields, names));
        let color = one_of(fields, ["color", "colour"])?;
        let path = path.to_path_buf();
        Ok(Self {
            fx: fields.optional_number("fx")?,
            fy: fields.optional_number("fy")?,
            cx: fields.optional_number(cx?)?,
            cy: fields.optional_number(cy?)?,
            width: whole(fields, "width")?,
            height: whole(fields, "height")?,
            depth_scale: fields.optional_number("depth_scale")?,
            pose: fields.numbers("pose")?,
            color: if fields.map.contains_key(color) { Some(fields.text(color)?.into()) } else { None },
            path,
        })
    }

    /// True if it describes a camera.
    pub(super) const fn has_camera(&self) -> bool {
        self.fx.is_some()
    }

    /// The colour picture that it names, beside itself.
    pub(super) fn colour(&self) -> Option<PathBuf> {
        let name = self.color.as_ref()?;
        Some(self.path.parent().unwrap_or(Path::new("")).join(name))
    }

    /// The pose that it has.
    pub(super) fn pose(&self) -> Result<Option<Affine>, ReadError> {
        let Some(numbers) = &self.pose else { return Ok(None) };
        let broken = |what: String| ReadError::broken(&self.path, None, what).advise(Advice::ExportAgain);
        let matrix: [f64; 16] = numbers.as_slice().try_into().map_err(|_| {
            broken(format!("the pose has {} numbers; a 4 × 4 matrix, row by row, has 16", numbers.len()))
        })?;
        pose(&matrix).map(Some).map_err(|fault| broken(format!("the pose is none: {}", fault.what)))
    }

    fn intrinsics(&self) -> Result<Option<Intrinsics>, String> {
        let numbers = [("fx", self.fx), ("fy", self.fy), ("cx", self.cx), ("cy", self.cy)];
        if numbers.iter().all(|(_, number)| number.is_none()) {
            return Ok(None);
        }
        let get = |i: usize| numbers[i].1.ok_or_else(|| format!("{} is missing", numbers[i].0));
        let size = match (self.width, self.height) {
            (Some(width), Some(height)) => Some([width, height]),
            (None, None) => None,
            _ => return Err("width or height is missing".to_owned()),
        };
        Ok(Some(Intrinsics { focal: [get(0)?, get(1)?], centre: [get(2)?, get(3)?], size }))
    }
}

/// Which of two names for the same an object has; the first if it has neither.
fn one_of<'n>(fields: &Fields<'_>, [name, other]: [&'n str; 2]) -> Result<&'n str, Fault> {
    match [name, other].map(|name| fields.map.contains_key(name)) {
        [true, true] => broken(format!("{name} and {other} are the same: leave one of them out")),
        [false, true] => Ok(other),
        _ => Ok(name),
    }
}

fn whole(fields: &mut Fields<'_>, key: &str) -> Result<Option<u32>, Fault> {
    if fields.map.contains_key(key) { fields.small(key).map(Some) } else { Ok(None) }
}

/// Why a matrix is no pose.
#[derive(Debug)]
pub(super) struct PoseFault {
    /// The row that is to blame, from 0, if it is one.
    pub(super) row: Option<usize>,
    pub(super) what: String,
}

/// A pose by its matrix, row by row.
pub(super) fn pose(matrix: &[f64; 16]) -> Result<Affine, PoseFault> {
    let map = Affine::from_matrix(matrix).map_err(|fault| {
        let row = match fault {
            AffineFault::NotFinite => matrix.chunks(4).position(|row| row.iter().any(|v| !v.is_finite())),
            AffineFault::LastRow(_) => Some(3),
            _ => None,
        };
        PoseFault { row, what: fault.to_string() }
    })?;
    match map.misplaced_row() {
        Some(row) => {
            let what = format!("row {} of the matrix places no point where coordinates can be", row + 1);
            Err(PoseFault { row: Some(row), what })
        }
        None => Ok(map),
    }
}

/// A camera whose pictures are depths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Camera {
    pub(super) intrinsics: Intrinsics,
    pub(super) units_per_metre: f64,
}

impl Camera {
    /// What is given first: the options, else the first of the files that says it. `path`: the depth map.
    pub(super) fn of(path: &Path, options: &DepthOptions, files: &[&Sidecar]) -> Result<Self, ReadError> {
        let mut intrinsics = options.intrinsics;
        let mut scale = options.units_per_metre;
        for file in files {
            let broken = |what: String| ReadError::broken(&file.path, None, what).advise(Advice::NameCamera);
            if intrinsics.is_none() {
                intrinsics = file.intrinsics().map_err(broken)?;
            }
            if let (None, Some(given)) = (scale, file.depth_scale) {
                check_scale(given).map_err(broken)?;
                scale = Some(given);
            }
        }
        let missing = |what: &str| ReadError::broken(path, None, what).advise(Advice::NameCamera);
        let intrinsics = intrinsics.ok_or_else(|| missing("nothing says the intrinsics of the camera"))?;
        let scale = scale.ok_or_else(|| missing("nothing says the scale of the depths"))?;
        let units_per_metre = check_scale(scale).map_err(|what| missing(&what))?;
        if !intrinsics.is_sound() {
            return Err(missing("the focal lengths of the camera are no lengths above 0, or a number is not finite"));
        }
        Ok(Self { intrinsics, units_per_metre })
    }
}

/// `Err` says why that scale is none.
fn check_scale(units_per_metre: f64) -> Result<f64, String> {
    if UNITS_PER_METRE.contains(&units_per_metre) {
        return Ok(units_per_metre);
    }
    let (least, most) = (UNITS_PER_METRE.start(), UNITS_PER_METRE.end());
    Err(format!("depth_scale is {units_per_metre}; it counts units in a metre, {least} to {most}"))
}

impl Intrinsics {
    /// Where the pixel of that column and row is, in the axes of the camera, if it is that deep.
    #[inline]
    pub(super) fn place(&self, pixel: [usize; 2], depth: f64) -> [f64; 3] {
        let [x, y] = [0, 1].map(|a| (pixel[a] as f64 - self.centre[a]) * depth / self.focal[a]);
        [x, y, depth]
    }

    /// `Err` says why a picture of that size is none of this camera.
    pub(super) fn check(&self, size: [u32; 2]) -> Result<(), String> {
        let [width, height] = size;
        match self.size {
            Some([w, h]) if [w, h] != size => {
                Err(format!("the picture has {width} × {height} pixels, the intrinsics are those of {w} × {h}"))
            }
            Some(_) => Ok(()),
            None => {
                let is_central = |a: usize| CENTRAL.contains(&((self.centre[a] + 0.5) / f64::from(size[a])));
                if is_central(0) && is_central(1) {
                    return Ok(());
                }
                let [cx, cy] = self.centre;
                Err(format!(
                    "the centre {cx} {cy} of the intrinsics is far from that of the picture of {width} × {height} pixels; \
                     they are of another size, or lack width and height"
                ))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sidecar(text: &str) -> Sidecar {
        Sidecar::parse(text.as_bytes(), Path::new("a.json")).unwrap()
    }

    #[test]
    fn options_go_before_files_and_nothing_is_guessed() {
        let file =
            sidecar(r#"{"fx": 1, "fy": 2, "ppx": 3, "ppy": 4, "width": 8, "height": 6, "depth_scale": 1000, "a": {}}"#);
        let mut options = DepthOptions::default();
        let camera = |options: &DepthOptions, file: &Sidecar| Camera::of(Path::new("a.png"), options, &[file]);
        let found = camera(&options, &file).unwrap();
        assert_eq!(found.intrinsics, Intrinsics { focal: [1.0, 2.0], centre: [3.0, 4.0], size: Some([8, 6]) });
        options.units_per_metre = Some(5000.0);
        assert_eq!(camera(&options, &file).unwrap().units_per_metre, 5000.0);
        for (text, what) in [
            (r#"{"fx": 1, "fy": 2, "cx": 3}"#, "cy is missing"),
            (r#"{"fx": 1, "fy": 2, "cx": 3, "cy": 4, "width": 5}"#, "width or height"),
            (r#"{"fx": -1, "fy": 2, "cx": 3, "cy": 4}"#, "no lengths above 0"),
            ("{}", "nothing says the intrinsics"),
        ] {
            let file = sidecar(text);
            let line = camera(&options, &file).unwrap_err().to_string();
            assert!(line.contains(what), "{line}");
        }
        let file = sidecar(r#"{"fx": 1, "fy": 1, "cx": 3, "cy": 4, "depth_scale": 0.001}"#);
        let line = camera(&DepthOptions::default(), &file).unwrap_err().to_string();
        assert!(line.contains("depth_scale is 0.001; it counts units in a metre"), "{line}");
    }

    #[test]
    fn a_picture_must_be_of_the_size_of_its_camera() {
        let mut camera = Intrinsics { focal: [5.0; 2], centre: [319.5, 239.5], size: None };
        assert_eq!(camera.check([640, 480]), Ok(()));
        assert!(camera.check([320, 240]).unwrap_err().contains("far from that of the picture of 320 × 240"));
        assert!(camera.check([1280, 4000]).is_err());
        camera.size = Some([640, 480]);
        assert!(camera.check([320, 240]).unwrap_err().contains("are those of 640 × 480"));
    }
}

//! A camera that moves.

use pointmill_format::json_fault;
use pointmill_format::serde_json::Value;

use crate::{Camera, CameraError};

/// More cameras than these are no path that somebody made.
const MOST_KEYFRAMES: usize = 100_000;

/// A path of cameras through keyframes, evenly spread over time.
///
/// Eye and target follow Catmull-Rom curves (1974): they pass through every keyframe without a corner; the first and the last
/// keyframe count twice. Up and the field of view change evenly from one keyframe to the next.
///
/// ```
/// use pointmill_render::Flight;
///
/// let text = r#"{"keyframes": [
///     {"eye": [0, -10, 5], "target": [0, 0, 0], "fov": 60},
///     {"eye": [10, 0, 5], "target": [0, 0, 0], "up": [0, 0, 1]}
/// ]}"#;
/// let flight = Flight::from_json(text.as_bytes())?;
/// assert_eq!(flight.at(1.0).eye, [10.0, 0.0, 5.0]);
/// # Ok::<(), pointmill_render::FlightError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Flight {
    keyframes: Vec<Camera>,
}

/// Why there is no path.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FlightError {
    /// The text is no JSON, or not of this form.
    #[error("{0}; a path is {{\"keyframes\": [{{\"eye\": [x, y, z], \"target\": [x, y, z]}}, …]}}")]
    Form(String),
    /// A keyframe, counted from 1, is no camera.
    #[error("keyframe {0}: {1}")]
    Camera(usize, CameraError),
}

impl Flight {
    /// A path through these cameras.
    ///
    /// # Errors
    /// No camera, or one that cannot be used.
    pub fn new(keyframes: Vec<Camera>) -> Result<Self, FlightError> {
        if keyframes.is_empty() || keyframes.len() > MOST_KEYFRAMES {
            return Err(FlightError::Form(format!("there are {} keyframes", keyframes.len())));
        }
        for (i, camera) in keyframes.iter().enumerate() {
            camera.axes().map_err(|e| FlightError::Camera(i + 1, e))?;
        }
        Ok(Self { keyframes })
    }

    /// Parses a path: an object whose key `keyframes` is an array of objects with `eye` and `target` (x, y, z), and, if they
    /// are not z and 60, `up` (x, y, z) and `fov` (degrees from top to bottom).
    ///
    /// # Errors
    /// Another form, and those of [`Self::new`].
    pub fn from_json(bytes: &[u8]) -> Result<Self, FlightError> {
        let form = |what: String| FlightError::Form(what);
        let value: Value = pointmill_format::serde_json::from_slice(bytes).map_err(|e| form(json_fault(&e)))?;
        let keyframes = value.get("keyframes").and_then(Value::as_array);
        let keyframes = keyframes.ok_or_else(|| form("there is no array \"keyframes\"".to_owned()))?;
        let cameras = keyframes.iter().enumerate().map(|(i, keyframe)| {
            let vector = |key: &str| {
                let numbers: Option<Vec<f64>> = keyframe.get(key)?.as_array()?.iter().map(Value::as_f64).collect();
                <[f64; 3]>::try_from(numbers?).ok()
            };
            let needed = |key: &str| {
                vector(key).ok_or_else(|| form(format!("keyframe {} has no \"{key}\" of three numbers", i + 1)))
            };
            let mut camera = Camera::new(needed("eye")?, needed("target")?);
            if keyframe.get("up").is_some() {
                camera.up = needed("up")?;
            }
            if let Some(fov) = keyframe.get("fov") {
                let number = fov.as_f64();
                camera.vertical_fov =
                    number.ok_or_else(|| form(format!("keyframe {}: \"fov\" is no number", i + 1)))?;
            }
            Ok(camera)
        });
        Self::new(cameras.collect::<Result<_, _>>()?)
    }

    /// Its keyframes.
    pub fn keyframes(&self) -> &[Camera] {
        &self.keyframes
    }

    /// The camera at a time: 0 is the first keyframe, 1 the last one.
    #[must_use]
    pub fn at(&self, time: f64) -> Camera {
        let last = self.keyframes.len() - 1;
        let place = if time > 0.0 { time.min(1.0) * last as f64 } else { 0.0 };
        let from = (place as usize).min(last.saturating_sub(1));
        let t = place - from as f64;
        let [before, a, b, after] =
            [from.saturating_sub(1), from, (from + 1).min(last), (from + 2).min(last)].map(|i| &self.keyframes[i]);
        let curve = |of: fn(&Camera) -> [f64; 3]| {
            std::array::from_fn(|axis| catmull_rom([before, a, b, after].map(|camera| of(camera)[axis]), t))
        };
        let even = |a: f64, b: f64| a + (b - a) * t;
        Camera {
            eye: curve(|camera| camera.eye),
            target: curve(|camera| camera.target),
            up: std::array::from_fn(|axis| even(a.up[axis], b.up[axis])),
            vertical_fov: even(a.vertical_fov, b.vertical_fov),
        }
    }

    /// That many cameras, the first and the last keyframe among them; of one the first.
    pub fn frames(&self, count: u32) -> impl Iterator<Item = Camera> + '_ {
        (0..count).map(move |i| self.at(f64::from(i) / f64::from(count.max(2) - 1)))
    }
}

/// Between the second and the third of four values.
fn catmull_rom([before, a, b, after]: [f64; 4], t: f64) -> f64 {
    // relative to the value at the beginning, so that large coordinates keep their digits
    let [before, b, after] = [before - a, b - a, after - a];
    let linear = b - before;
    let square = 2.0 * before + 4.0 * b - after;
    let cube = -before - 3.0 * b + after;
    a + 0.5 * t * (linear + t * (square + t * cube))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flight() -> Flight {
        let camera = |x: f64| Camera { vertical_fov: 40.0 + x, ..Camera::new([x, 0.0, 1e7], [x, 10.0, 1e7]) };
        Flight::new([0.0, 10.0, 20.0, 10.0].map(camera).to_vec()).unwrap()
    }

    #[test]
    fn keyframes_are_reached() {
        let flight = flight();
        for (i, keyframe) in flight.keyframes().iter().enumerate() {
            assert_eq!(flight.at(i as f64 / 3.0), *keyframe);
        }
        assert_eq!([flight.at(-1.0), flight.at(f64::NAN)], [flight.keyframes()[0]; 2]);
        assert_eq!(flight.at(2.0), flight.keyframes()[3]);
    }

    #[test]
    fn curves_are_those_of_catmull_and_rom() {
        let middle = flight().at(0.5);
        // (−p₀ + 9p₁ + 9p₂ − p₃) / 16 = (0 + 90 + 180 − 10) / 16
        assert_eq!(middle.eye, [16.25, 0.0, 1e7]);
        assert_eq!(middle.vertical_fov, 55.0, "evenly");
    }

    #[test]
    fn frames_begin_and_end_with_keyframes() {
        let frames: Vec<Camera> = flight().frames(7).collect();
        assert_eq!((frames.len(), frames[0], frames[6]), (7, flight().keyframes()[0], flight().keyframes()[3]));
        assert_eq!(flight().frames(1).collect::<Vec<_>>(), [flight().keyframes()[0]]);
        let one = Flight::new(vec![Camera::new([0.0; 3], [1.0; 3])]).unwrap();
        assert_eq!(one.frames(3).collect::<Vec<_>>(), [one.keyframes()[0]; 3]);
    }

    #[test]
    fn what_is_no_path_is_refused() {
        let line = |text: &str| Flight::from_json(text.as_bytes()).unwrap_err().to_string();
        assert!(line("{").starts_with("it ends within an object"), "{}", line("{"));
        assert!(line("[]").starts_with("there is no array"));
        assert!(line(r#"{"keyframes": []}"#).starts_with("there are 0 keyframes"));
        let keyframe = |text: &str| line(&format!(r#"{{"keyframes": [{{"eye": [0,0,0], {text}}}]}}"#));
        assert!(keyframe(r#""target": [1, 2]"#).starts_with("keyframe 1 has no \"target\""));
        assert!(keyframe(r#""target": [1,2,3], "up": 5"#).starts_with("keyframe 1 has no \"up\""));
        assert!(keyframe(r#""target": [1,2,3], "fov": "wide""#).contains("is no number"));
        assert!(keyframe(r#""target": [0,0,0]"#).starts_with("keyframe 1: the camera stands"));
    }
}

//! Why there is no picture.

use pointmill_format::ReadError;

/// What is wrong with a camera or with the size of a picture.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// A number of the camera is NaN or infinite.
    #[error("the camera has a number that is not finite; all of eye, target, up and field of view must be")]
    NotFinite,
    /// A coordinate is beyond [`pointmill_format::Lattice::FARTHEST`].
    #[error("the camera is farther than 1e30 from the origin; move it to where the points are")]
    TooFar,
    /// There is no direction of view.
    #[error("the camera stands at its own target {0:?}; move one of them")]
    NoDirection([f64; 3]),
    /// The vertical field of view, in degrees, is not between 0 and 180.
    #[error("a field of view of {0} degrees; it must be above 0 and below 180")]
    FieldOfView(f64),
    /// A side of the picture, in pixels, is 0 or too large.
    #[error("a picture of {0} x {1} pixels; each side must have 1 to 16384")]
    Side(u32, u32),
    /// The picture has too many pixels.
    #[error("a picture of {0} x {1} pixels; at most 67108864 pixels fit, for example 8192 x 8192")]
    Pixels(u32, u32),
}

/// Why nothing was rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The camera or the size of the picture cannot be used.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// Points could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// What the picture was to show is not in the points.
    #[error("{at}: the points have no {what} to be coloured by; they have {known}")]
    NoAttribute {
        /// The file or dataset.
        at: String,
        /// The attribute.
        what: &'static str,
        /// The attributes that are there, for people.
        known: String,
    },
    /// The picture could not be encoded.
    #[error("internal error: encoding the picture: {0}")]
    Encode(String),
}

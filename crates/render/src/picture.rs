//! What was rendered.

use crate::{Colour, RenderError, Size};

/// What a picture shows, counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Drawn {
    /// Octree nodes, leaves, batches or pieces of scans.
    pub nodes: u64,
    /// Points of these that were drawn, in sight or not.
    pub points: u64,
    /// Bytes that were read for them, as stored.
    pub bytes: u64,
    /// What the colours say, where [`Colour::Auto`] was requested; else what was requested.
    pub colour: Colour,
}

/// A picture: rows from the top, pixels from the left.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Picture {
    /// Pixels from left to right.
    pub width: u32,
    /// Pixels from top to bottom.
    pub height: u32,
    /// Red, green and blue of each pixel.
    pub rgb: Vec<[u8; 3]>,
    /// Distance along the direction of view of the point that each pixel shows, world units; infinite without a point.
    /// Filled pixels have the depth that was filled in.
    pub depth: Vec<f32>,
    /// What it shows.
    pub drawn: Drawn,
}

impl Picture {
    pub(crate) fn new(size: Size, rgb: Vec<[u8; 3]>, depth: Vec<f32>) -> Self {
        Self { width: size.width(), height: size.height(), rgb, depth, drawn: Drawn::default() }
    }

    /// Pixels that show a point.
    #[must_use]
    pub fn covered(&self) -> usize {
        self.depth.iter().filter(|depth| depth.is_finite()).count()
    }

    /// The bytes of a PNG file.
    ///
    /// # Errors
    /// [`RenderError::Encode`]; not of a picture that this crate made.
    pub fn png(&self) -> Result<Vec<u8>, RenderError> {
        let fail = |e: png::EncodingError| RenderError::Encode(e.to_string());
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Fast);
        let mut writer = encoder.write_header().map_err(fail)?;
        writer.write_image_data(self.rgb.as_flattened()).map_err(fail)?;
        writer.finish().map_err(fail)?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_png_holds_the_pixels() {
        let size = Size::new(3, 2).unwrap();
        let rgb: Vec<[u8; 3]> = (0..6).map(|i| [i, 2 * i, 255 - i]).collect();
        let picture = Picture::new(size, rgb.clone(), vec![f32::INFINITY; 6]);
        let bytes = picture.png().unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut out = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut out).unwrap();
        assert_eq!((reader.info().width, reader.info().height), (3, 2));
        assert_eq!(out, rgb.as_flattened());
        assert_eq!(picture.covered(), 0);
    }
}

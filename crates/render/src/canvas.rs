//! A picture that is being drawn.

use crate::projection::Projection;
use crate::raster::{Pass, Sizes, Splats, Target, word};
use crate::{Camera, CameraError, Colour, Picture, PointSize, Size, Style, shading};

/// A picture of points that the caller has: threads add them in blocks, in any order.
///
/// High-quality shading ([`Style::is_averaged`]) needs all points twice:
///
/// ```
/// use pointmill_render::{Camera, Canvas, Size, Style};
///
/// let camera = Camera::new([0.0, -10.0, 0.0], [0.0; 3]);
/// let mut canvas = Canvas::new(Size::new(160, 120)?, &camera, &Style::averaged())?;
/// loop {
///     // a block of positions in world coordinates, and their colours; as many blocks as there are
///     canvas.add(&[[0.0; 3], [1.0, 0.0, 0.0]], &[[255, 0, 0], [0, 255, 0]]);
///     if !canvas.next_pass() {
///         break;
///     }
/// }
/// let picture = canvas.finish();
/// assert_eq!(picture.rgb[60 * 160 + 80], [255, 0, 0]);
/// # Ok::<(), pointmill_render::CameraError>(())
/// ```
#[derive(Debug)]
pub struct Canvas {
    pub(crate) projection: Projection,
    pub(crate) style: Style,
    target: Target,
    pass: Pass,
    added: std::sync::atomic::AtomicU64,
}

impl Canvas {
    /// An empty picture of that size, seen by the camera.
    ///
    /// [`Style::colour`] does not matter unless it is [`Colour::Overdraw`]: points bring their colours. Nor is anything known
    /// of the distance between points: [`PointSize::Adaptive`] is one pixel.
    ///
    /// # Errors
    /// A camera that cannot be used ([`Camera::axes`]).
    pub fn new(size: Size, camera: &Camera, style: &Style) -> Result<Self, CameraError> {
        let projection = Projection::new(camera, size)?;
        let is_counted = style.colour == Colour::Overdraw;
        let (target, style) = (Target::new(size, is_counted), style.clone());
        let pass = if is_counted { Pass::Count } else { Pass::Nearest };
        Ok(Self { projection, style, target, pass, added: 0.into() })
    }

    /// Adds points: world coordinates, and red, green and blue of each. What is not finite is not drawn; of two lists the
    /// shorter one counts.
    pub fn add(&self, positions: &[[f64; 3]], colours: &[[u8; 3]]) {
        if self.pass != Pass::Gather {
            self.added.fetch_add(positions.len() as u64, std::sync::atomic::Ordering::Relaxed);
        }
        let frame = self.projection.world_frame();
        let splats = self.splats();
        let size = self.fixed_size();
        // in steps that stay in the cache
        let mut views = [[0.0; 3]; 256];
        let mut words = [0; 256];
        for (positions, colours) in positions.chunks(256).zip(colours.chunks(256)) {
            for ((view, rgb), (position, colour)) in views.iter_mut().zip(&mut words).zip(positions.iter().zip(colours))
            {
                *view = self.projection.view(&frame, *position).map(|c| c as f32);
                *rgb = word(*colour);
            }
            let count = positions.len().min(colours.len());
            splats.draw(&views[..count], &words[..count], size);
        }
    }

    /// Ends a pass. True if every point is to be added once more.
    #[must_use]
    pub fn next_pass(&mut self) -> bool {
        let again = self.style.is_averaged && self.pass == Pass::Nearest;
        if again {
            self.target.prepare_sums();
            self.pass = Pass::Gather;
        }
        again
    }

    /// The picture, shaded as the style says.
    #[must_use]
    pub fn finish(self) -> Picture {
        self.finish_on(0)
    }

    /// As [`Self::finish`], on that many threads; 0 is one per core.
    pub(crate) fn finish_on(self, threads: usize) -> Picture {
        let is_counted = self.pass == Pass::Count;
        let size = self.projection.size;
        let mut rgb = if is_counted {
            let colours = self.target.counts().map(|n| if n > 0 { crate::colours::overdraw(n) } else { [0; 3] });
            colours.collect()
        } else {
            self.target.colours(self.style.background, self.pass == Pass::Gather)
        };
        let mut depth = self.target.depths();
        drop(self.target);
        if !is_counted {
            shading::shade(&mut rgb, &mut depth, &self.projection, &self.style, threads);
        }
        let mut picture = Picture::new(size, rgb, depth);
        picture.drawn.points = self.added.into_inner();
        picture.drawn.colour = self.style.colour;
        picture
    }

    /// Draws points that were projected already, or rather what comes before that: right, up and depth from the eye.
    pub(crate) fn draw(&self, views: &[[f32; 3]], words: &[u32], sizes: Sizes<'_>) {
        self.splats().draw(views, words, sizes);
    }

    /// Sizes that do not depend on the points.
    fn fixed_size(&self) -> Sizes<'static> {
        match self.style.size {
            PointSize::Pixels(pixels) => Sizes::Pixels(pixels),
            PointSize::World(size) => Sizes::World(size),
            PointSize::Adaptive(_) => Sizes::One,
        }
    }

    fn splats(&self) -> Splats<'_> {
        Splats::new(&self.target, &self.projection, self.style.shape, self.pass, self.style.depth_tolerance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two points in one pixel, the farther one within 1 %, and one beyond.
    fn drawn(style: &Style) -> Picture {
        let camera = Camera { vertical_fov: 90.0, ..Camera::new([5e6, 0.0, 0.0], [5e6, 1.0, 0.0]) };
        let mut canvas = Canvas::new(Size::new(8, 8).unwrap(), &camera, style).unwrap();
        let points = [[5e6 + 0.1, 100.0, 0.1], [5e6 + 0.1, 100.9, 0.1], [5e6 + 0.1, 102.0, 0.1]];
        loop {
            canvas.add(&points, &[[10, 20, 30], [20, 30, 41], [200; 3]]);
            if !canvas.next_pass() {
                return canvas.finish();
            }
        }
    }

    const AT: usize = 3 * 8 + 4;

    #[test]
    fn plain_points_hide_each_other() {
        let picture = drawn(&Style::plain());
        assert_eq!((picture.rgb[AT], picture.depth[AT]), ([10, 20, 30], 100.0));
        assert_eq!((picture.covered(), picture.drawn.points), (1, 3));
        assert_eq!(picture.rgb[0], Style::default().background);
    }

    #[test]
    fn averaged_points_mix_within_the_tolerance() {
        let picture = drawn(&Style::averaged());
        assert_eq!((picture.rgb[AT], picture.depth[AT]), ([15, 25, 36], 100.0));
    }

    #[test]
    fn overdraw_counts_all_points() {
        let picture = drawn(&Style { colour: Colour::Overdraw, ..Style::averaged() });
        assert_eq!(picture.rgb[AT], crate::colours::overdraw(3));
        assert_eq!(picture.rgb[0], [0; 3]);
    }

    #[test]
    fn threads_add_in_any_order() {
        let camera = Camera::new([0.0, -10.0, 0.0], [0.0; 3]);
        let mut random = pointmill_testkit::Random::new(7);
        let mut cloud = Vec::new();
        for _ in 0..4000 {
            cloud.push([random.unit() * 4.0 - 2.0, random.unit(), random.unit() * 4.0 - 2.0]);
        }
        let colours: Vec<[u8; 3]> = cloud.iter().map(|p| p.map(|c| (c * 50.0) as u8)).collect();
        let picture = |threads: usize| {
            let mut canvas = Canvas::new(Size::new(64, 48).unwrap(), &camera, &Style::averaged()).unwrap();
            loop {
                std::thread::scope(|scope| {
                    for (part, colours) in cloud.chunks(4000 / threads).zip(colours.chunks(4000 / threads)).rev() {
                        let canvas = &canvas;
                        scope.spawn(move || canvas.add(part, colours));
                    }
                });
                if !canvas.next_pass() {
                    return canvas.finish();
                }
            }
        };
        assert_eq!(picture(1), picture(8));
    }
}

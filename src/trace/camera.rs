//! The camera: perspective, with a thin lens, in motion.

use super::math::{Ray, Vec3};
use super::motion::AnimationFrame;
use super::plan::effect;
use super::sampling::{Random, Stream, concentric_disk};
use super::transform::Affine;
use crate::image::Rect;

/// How the samples of a pixel lie around its middle. The filter is sampled, not splatted, so pixels
/// stay independent of each other under every filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    /// Even over the pixel.
    Box,
    /// A tent of two pixels' width.
    Tent,
    /// A Gaussian with a standard deviation of half a pixel.
    Gaussian,
}

impl Filter {
    /// An offset from the pixel's middle, in pixels.
    fn sample(self, u: [f32; 2]) -> [f32; 2] {
        match self {
            Filter::Box => u.map(|u| u - 0.5),
            Filter::Tent => {
                u.map(|u| if u < 0.5 { (2.0 * u).sqrt() - 1.0 } else { 1.0 - (2.0 - 2.0 * u).sqrt() })
            }
            Filter::Gaussian => {
                let radius = 0.5 * (-2.0 * (1.0 - u[0]).ln()).sqrt();
                let (sin, cos) = (std::f32::consts::TAU * u[1]).sin_cos();
                [radius * cos, radius * sin]
            }
        }
    }
}

/// A camera that looks along its own z axis, with x to the right and y up.
#[derive(Debug, Clone)]
pub struct Camera {
    /// From the camera to the world, at the shutter's opening.
    pub to_world: Affine,
    /// The same at its closing, for a camera that moves.
    pub to_world_end: Option<Affine>,
    /// Tangent of half the horizontal field of view.
    pub tan_half_fov: f32,
    /// Size of the whole picture, in pixels.
    pub resolution: [usize; 2],
    /// The part of it that is rendered.
    pub crop: Rect,
    /// Radius of the lens; 0 for a pinhole.
    pub aperture_radius: f32,
    /// Distance of the plane in focus, along the viewing axis.
    pub focus_distance: f32,
    /// The pixel filter.
    pub filter: Filter,
}

impl Camera {
    /// The ray of sample `sample` of the pixel at column `x` and row `y` of the crop, during `frame` or
    /// all of the motion. The generators of lens and time exist only where the effects call for them.
    #[inline(always)]
    pub fn ray<const E: u32>(
        &self,
        [x, y]: [usize; 2],
        frame: Option<&AnimationFrame>,
        seed: u64,
        sample: u32,
        random: &mut Random,
    ) -> Ray {
        let (x, y) = (self.crop.x + x, self.crop.y + y);
        let pixel = self.pixel_index([x, y]);
        let offset = self.filter.sample(random.next_2d());
        let [width, height] = self.resolution.map(|size| size as f32);
        let scale = 2.0 * self.tan_half_fov / width;
        let mut direction = Vec3::new(
            (x as f32 + 0.5 + offset[0] - 0.5 * width) * scale,
            (0.5 * height - (y as f32 + 0.5 + offset[1])) * scale,
            1.0,
        );
        let mut origin = Vec3::zeros();
        if E & effect::LENS != 0 && self.aperture_radius > 0.0 {
            let lens = concentric_disk(Random::new(seed, pixel, sample, Stream::Lens).next_2d());
            origin = Vec3::new(lens[0], lens[1], 0.0) * self.aperture_radius;
            direction = direction * self.focus_distance - origin;
        }
        let mut time = 0.0;
        let mut to_world = self.to_world;
        if E & effect::MOTION != 0 {
            time = Random::new(seed, pixel, sample, Stream::Time).next();
            time = frame.map_or(time, |frame| frame.moment(time));
            if let Some(end) = &self.to_world_end {
                to_world = to_world.blend(end, time);
            }
        }
        Ray { origin: to_world.point(origin), direction: (to_world.linear * direction).normalize(), time }
    }

    /// Column and row of the whole picture at which `point` is seen at `time` (which may lie outside of
    /// the motion), through the middle of the lens; with `w` 0 instead of 1 it is a direction. Far away
    /// where it is behind the camera.
    pub fn project(&self, point: Vec3, w: f32, time: f32) -> [f32; 2] {
        const BEHIND: f32 = -1e6;
        let to_world = self.to_world_end.as_ref().map_or(self.to_world, |end| self.to_world.blend(end, time));
        let Some(to_camera) = to_world.inverse() else { return [BEHIND; 2] };
        let seen = to_camera.linear * point + to_camera.shift * w;
        if seen.z <= 0.0 {
            return [BEHIND; 2];
        }
        let [width, height] = self.resolution.map(|size| size as f32);
        let scale = 2.0 * self.tan_half_fov / width * seen.z;
        [0.5 * width + seen.x / scale, 0.5 * height - seen.y / scale]
    }

    /// The number of the pixel at `[x, y]` of the whole picture, which seeds its random numbers: a crop
    /// shows the same bits as the whole picture does there.
    pub fn pixel_index(&self, [x, y]: [usize; 2]) -> u32 {
        (y * self.resolution[0] + x) as u32
    }
}

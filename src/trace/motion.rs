//! Animation: a frame is a piece of the scene's motion, and knows where what it shows is in the frames
//! beside it.

use serde::Serialize;

use super::camera::Camera;
use super::math::Ray;
use super::world::{Hit, World};
use crate::error::{Error, ErrorKind, Result};

/// One of the frames that a scene's motion, from `transform` to `motion`, is cut into.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AnimationFrame {
    /// Its number, 1 to `count`.
    number: u32,
    /// Frames that the motion is cut into.
    count: u32,
    /// The share of the frame's time during which the shutter is open, from its beginning on; 0 to 1.
    shutter: f32,
}

impl AnimationFrame {
    /// Frame `number` of `count`, with the shutter open for a share `shutter` of it.
    ///
    /// # Errors
    /// When there is no such frame or the share is not 0 to 1.
    pub fn new(number: u32, count: u32, shutter: f32) -> Result<Self> {
        if !(1..=count).contains(&number) {
            return Err(Error::new(ErrorKind::Usage, format!("there is no frame {number} of {count}"))
                .remedy("frames are counted from 1"));
        }
        if !(0.0..=1.0).contains(&shutter) {
            return Err(Error::new(
                ErrorKind::Usage,
                format!("the shutter is open for {shutter} of a frame"),
            )
            .remedy("give 0 to 1"));
        }
        Ok(Self { number, count, shutter })
    }

    /// The seed of this frame under a render's `seed`: frames that shared their noise could not take it
    /// out of each other.
    pub fn seed(&self, seed: u64) -> u64 {
        seed ^ u64::from(self.number).wrapping_mul(0x9e37_79b9_7f4a_7c15)
    }

    /// The moment of the scene's motion, 0 to 1, at which a sample with the random number `u` is taken.
    pub fn moment(&self, u: f32) -> f32 {
        ((self.number - 1) as f32 + self.shutter * u) / self.count as f32
    }

    /// How far the surface at `hit`, or without one the far background, is from its place on the picture
    /// in the frame before and in the next: columns to the right, rows down.
    pub(super) fn vectors<const E: u32>(
        &self,
        (camera, world): (&Camera, &World),
        ray: &Ray,
        hit: Option<&Hit>,
    ) -> [f32; 4] {
        let place = |time: f32| match hit {
            Some(hit) => camera.project(world.moved::<E>(ray, hit, time), 1.0, time),
            None => camera.project(ray.direction, 0.0, time),
        };
        let (here, step) = (place(ray.time), 1.0 / self.count as f32);
        let [before, after] = [place(ray.time - step), place(ray.time + step)];
        [before[0] - here[0], before[1] - here[1], after[0] - here[0], after[1] - here[1]]
    }
}

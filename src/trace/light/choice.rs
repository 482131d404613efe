//! All lights of a scene and the choice between them.

use super::{Environment, Light, LightTree};
use crate::trace::math::Vec3;
use crate::trace::plan::effect;
use crate::trace::sampling::Random;

/// The lights of a scene.
#[derive(Debug, Clone, Default)]
pub struct Lights {
    lights: Vec<Light>,
    tree: LightTree,
    distant: Vec<usize>,
    environment: Option<usize>,
}

impl Lights {
    /// Prepares the choice between `lights`, at most one of which is an environment.
    pub fn new(lights: Vec<Light>) -> Self {
        let near =
            lights.iter().enumerate().filter_map(|(i, light)| Some((i as u32, light.extent()?))).collect();
        let tree = LightTree::new(near, lights.len());
        let distant = (0..lights.len()).filter(|&i| lights[i].extent().is_none()).collect();
        let environment = lights.iter().position(|light| matches!(light, Light::Environment(_)));
        Self { lights, tree, distant, environment }
    }

    /// Their number.
    pub fn count(&self) -> usize {
        self.lights.len()
    }

    /// Light number `index`.
    pub fn get(&self, index: usize) -> &Light {
        &self.lights[index]
    }

    /// The environment with its index.
    pub fn environment(&self) -> Option<(usize, &Environment)> {
        let index = self.environment?;
        match &self.lights[index] {
            Light::Environment(environment) => Some((index, environment)),
            _ => None,
        }
    }

    /// Probability to choose among the distant lights: each counts as much as all near ones together.
    fn distant_share(&self) -> f32 {
        let near = usize::from(!self.tree.is_empty());
        self.distant.len() as f32 / (self.distant.len() + near) as f32
    }

    /// Chooses a light for `point` (with `normal` on a surface): its index and probability. Draws a
    /// random number only where there is a choice.
    #[inline(always)]
    pub fn choose<const E: u32>(
        &self,
        point: Vec3,
        normal: Option<Vec3>,
        random: &mut Random,
    ) -> Option<(usize, f32)> {
        if E & effect::MANY_LIGHTS == 0 || self.lights.len() < 2 {
            return self.lights.first().map(|_| (0, 1.0));
        }
        let (u, share) = (random.next(), self.distant_share());
        if u < share {
            let count = self.distant.len();
            let i = ((u / share * count as f32) as usize).min(count - 1);
            return Some((self.distant[i], share / count as f32));
        }
        let (light, probability) = self.tree.sample(point, normal, (u - share) / (1.0 - share))?;
        Some((light, probability * (1.0 - share)))
    }

    /// The probability of [`Lights::choose`] to take light `index`.
    #[inline(always)]
    pub fn probability<const E: u32>(&self, point: Vec3, normal: Option<Vec3>, index: usize) -> f32 {
        if E & effect::MANY_LIGHTS == 0 || self.lights.len() < 2 {
            return 1.0;
        }
        let share = self.distant_share();
        match self.distant.contains(&index) {
            true => share / self.distant.len() as f32,
            false => (1.0 - share) * self.tree.probability(point, normal, index),
        }
    }
}

//! Which effects a scene calls for. What it lacks costs nothing: the integrator is compiled for sets
//! of effects, and an effect that is not in the set draws no random number, takes no branch per ray
//! and allocates no buffer.

use serde::Serialize;

use super::bsdf::Material;
use super::render::RenderOptions;
use super::scene::Scene;

/// The effects, as bits of a set.
pub mod effect {
    /// Some colour varies over a surface.
    pub const TEXTURES: u32 = 1;
    /// Some material is not plainly diffuse.
    pub const GLOSSY: u32 = 1 << 1;
    /// Rays that leave the scene meet light.
    pub const ENVIRONMENT: u32 = 1 << 2;
    /// There is a choice between lights.
    pub const MANY_LIGHTS: u32 = 1 << 3;
    /// Groups are placed by instances.
    pub const INSTANCES: u32 = 1 << 4;
    /// Shapes or the camera move while the shutter is open.
    pub const MOTION: u32 = 1 << 5;
    /// The lens has a size.
    pub const LENS: u32 = 1 << 6;
    /// A medium absorbs or scatters.
    pub const MEDIUM: u32 = 1 << 7;
    /// Light groups are kept apart.
    pub const LIGHT_GROUPS: u32 = 1 << 8;
    /// Everything.
    pub const ALL: u32 = (1 << 9) - 1;
}

/// One effect of a plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Effect {
    /// Its name.
    pub name: &'static str,
    /// Whether it is simulated.
    pub used: bool,
    /// Why, or why not.
    pub reason: String,
}

/// The effects that a render simulates, each with the reason for taking it or leaving it out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Plan {
    /// All effects.
    pub effects: Vec<Effect>,
    #[serde(skip)]
    set: u32,
}

impl Plan {
    /// The plan for `scene` under `options`.
    pub fn new(scene: &Scene, options: &RenderOptions) -> Self {
        let mut plan = Self { effects: vec![], set: 0 };
        plan.materials(scene);
        plan.lights(scene);
        plan.geometry(scene);
        plan.camera(scene);
        plan.output(scene, options);
        plan
    }

    /// The set of effects, as bits of [`effect`].
    pub(super) fn effects(&self) -> u32 {
        self.set
    }

    fn decide(&mut self, bit: u32, name: &'static str, used: bool, reason: String) {
        self.effects.push(Effect { name, used, reason });
        self.set |= if used { bit } else { 0 };
    }

    fn materials(&mut self, scene: &Scene) {
        let textured = count(&scene.materials, |m| m.texture().is_some_and(|t| t.constant().is_none()));
        self.decide(effect::TEXTURES, "textures", textured > 0, counted(textured, "textured material"));
        let glossy = count(&scene.materials, |m| !matches!(m, Material::Diffuse(_)));
        self.decide(effect::GLOSSY, "glossy", glossy > 0, counted(glossy, "material that is not diffuse"));
    }

    fn lights(&mut self, scene: &Scene) {
        let environment = scene.lights.environment().is_some();
        let reason =
            if environment { "the scene has an environment" } else { "the scene has no environment" };
        self.decide(effect::ENVIRONMENT, "environment", environment, reason.into());
        let lights = scene.lights.count();
        self.decide(effect::MANY_LIGHTS, "light choice", lights > 1, counted(lights, "light"));
    }

    fn geometry(&mut self, scene: &Scene) {
        let placed = scene.instances + scene.moving_shapes;
        self.decide(effect::INSTANCES, "instances", placed > 0, counted(placed, "instanced or moving shape"));
        let camera = scene.camera.to_world_end.is_some();
        let moves = format!(
            "{}, the camera {}",
            counted(scene.moving_shapes, "moving shape"),
            if camera { "moves" } else { "stands still" }
        );
        self.decide(effect::MOTION, "motion blur", camera || scene.moving_shapes > 0, moves);
        let reason = match &scene.medium {
            Some(medium) if medium.bounds.is_some() => "a medium fills a box",
            Some(_) => "a medium fills all space",
            None => "the scene has no medium",
        };
        self.decide(effect::MEDIUM, "medium", scene.medium.is_some(), reason.into());
    }

    fn camera(&mut self, scene: &Scene) {
        let radius = scene.camera.aperture_radius;
        self.decide(
            effect::LENS,
            "depth of field",
            radius > 0.0,
            format!("the aperture's radius is {radius}"),
        );
    }

    fn output(&mut self, scene: &Scene, options: &RenderOptions) {
        let groups = scene.group_names.len();
        let reason = match options.light_groups {
            true => counted(groups, "light group"),
            false => "not asked for".into(),
        };
        self.decide(effect::LIGHT_GROUPS, "light groups", options.light_groups && groups > 0, reason);
    }
}

fn count<T>(things: &[T], is: impl Fn(&T) -> bool) -> usize {
    things.iter().filter(|thing| is(thing)).count()
}

fn counted(n: usize, thing: &str) -> String {
    match n {
        0 => format!("no {thing}"),
        1 => format!("1 {thing}"),
        _ => format!("{n} × {thing}"),
    }
}

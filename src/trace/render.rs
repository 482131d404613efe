//! Rendering in passes.

use rayon::prelude::*;
use serde::Serialize;

use super::film::{Buffers, Film, Row};
use super::motion::AnimationFrame;
use super::path::Integrator;
use super::plan::{Plan, effect};
use super::sample::{FeatureMode, Sample};
use super::scene::Scene;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::Frame;

/// Options of a render.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RenderOptions {
    /// Samples per pixel, at least 1; 16 by default.
    pub spp: u32,
    /// Seed of all random numbers; 0 by default.
    pub seed: u64,
    /// Where features are recorded; at the first hit by default.
    pub features: FeatureMode,
    /// Whether to record what a glossy first surface shows: `albedo2`, `normal2`, `depth2`.
    pub second_hit: bool,
    /// Whether to keep the scene's light groups apart; they sum to the colour.
    pub light_groups: bool,
    /// The frame of an animation, with motion vectors; by default the shutter is open during all of the
    /// scene's motion.
    pub frame: Option<AnimationFrame>,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            spp: 16,
            seed: 0,
            features: FeatureMode::FirstHit,
            second_hit: false,
            light_groups: false,
            frame: None,
        }
    }
}

/// A finished render.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendered {
    /// The picture with its variances, halves, features and light groups.
    pub frame: Frame,
    /// The effects that were simulated.
    pub plan: Plan,
    /// Samples drawn, over all pixels.
    pub samples: u64,
    /// Of those, dropped because some number was not finite.
    pub dropped: u64,
    /// Features that are the same in every pixel, so that a fit has no use for them.
    pub constant_features: Vec<String>,
}

/// How many samples a pass draws in each pixel.
#[derive(Debug, Clone, Copy)]
pub enum Samples<'a> {
    /// The same number in all.
    Uniform(u32),
    /// One number for each pixel, row by row.
    Map(&'a [u32]),
}

/// Renders a scene in passes.
#[derive(Debug, Clone)]
pub struct Renderer<'a> {
    scene: &'a Scene,
    options: RenderOptions,
    plan: Plan,
    film: Film,
}

/// Renders `scene` with `options.spp` samples in every pixel.
///
/// # Errors
/// When `options.spp` is 0, or there is no memory for the picture.
pub fn render(scene: &Scene, options: &RenderOptions) -> Result<Rendered> {
    if options.spp == 0 {
        let error = Error::new(ErrorKind::Usage, "0 samples per pixel where at least 1 was expected");
        return Err(error.remedy("give an spp of 1 or more"));
    }
    let mut renderer = Renderer::new(scene, options)?;
    renderer.pass(Samples::Uniform(options.spp))?;
    renderer.finish()
}

impl<'a> Renderer<'a> {
    /// Prepares a render; `options.spp` is left to the passes.
    ///
    /// # Errors
    /// When there is no memory for the picture.
    pub fn new(scene: &'a Scene, options: &RenderOptions) -> Result<Self> {
        let plan = Plan::new(scene, options);
        let features = options.features != FeatureMode::None;
        let buffers = Buffers {
            features,
            second: features && options.second_hit,
            motion: options.frame.is_some(),
            groups: if options.light_groups { scene.group_names.clone() } else { vec![] },
        };
        let crop = scene.camera.crop;
        let film = Film::new(crop.width, crop.height, buffers)?;
        Ok(Self { scene, options: options.clone(), plan, film })
    }

    /// The effects that are simulated.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// What has added up so far.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// The same, to restore an earlier state.
    pub fn film_mut(&mut self) -> &mut Film {
        &mut self.film
    }

    /// Draws `samples` more, after those that the film holds.
    ///
    /// # Errors
    /// When a map is of another size than the picture.
    pub fn pass(&mut self, samples: Samples) -> Result<()> {
        let (width, height) = (self.film.width(), self.film.height());
        if let Samples::Map(map) = samples
            && map.len() != width * height
        {
            let what =
                format!("the sample map has {} pixels where the picture has {width}×{height}", map.len());
            return Err(Error::new(ErrorKind::Lacking, what).remedy("make it of the picture's size"));
        }
        let run = integrator(self.plan.effects());
        let groups = self.film.group_count();
        self.film.rows().into_par_iter().enumerate().for_each_init(
            || Sample::new(groups),
            |sample, (y, row)| {
                let counts: &dyn Fn(usize) -> u32 = &|x| match samples {
                    Samples::Uniform(spp) => spp,
                    Samples::Map(map) => map[y * width + x],
                };
                run(self.scene, &self.options, y, row, counts, sample);
            },
        );
        Ok(())
    }

    /// The picture so far.
    ///
    /// # Errors
    /// When the picture has no pixel.
    pub fn finish(&self) -> Result<Rendered> {
        let frame = self.film.to_frame()?;
        let constant = |plane: &crate::image::Plane| plane.data().iter().all(|&v| v == plane.data()[0]);
        let constant_features = frame
            .features()
            .iter()
            .filter(|feature| feature.planes.iter().all(constant))
            .map(|feature| feature.name.clone())
            .collect();
        let (samples, dropped) = (self.film.drawn(), self.film.dropped());
        Ok(Rendered { frame, plan: self.plan.clone(), samples, dropped, constant_features })
    }
}

/// Draws the samples of one row.
type RunRow = fn(&Scene, &RenderOptions, usize, Row, &dyn Fn(usize) -> u32, &mut Sample);

fn run_row<const E: u32>(
    scene: &Scene,
    options: &RenderOptions,
    y: usize,
    mut row: Row,
    counts: &dyn Fn(usize) -> u32,
    sample: &mut Sample,
) {
    let RenderOptions { features, frame, seed, .. } = *options;
    let seed = frame.map_or(seed, |frame| frame.seed(seed));
    let integrator = Integrator::<E> { scene, features, frame, seed };
    for x in 0..scene.camera.crop.width {
        for _ in 0..counts(x) {
            integrator.follow([x, y], row.drawn(x), sample);
            row.add(x, sample);
        }
    }
}

/// Declares the sets of effects that the integrator is compiled for, smallest first.
macro_rules! compiled_sets {
    ($($set:expr),+ $(,)?) => {
        const SETS: &[(u32, RunRow)] = &[$(($set, run_row::<{ $set }>)),+];
    };
}

const FLAT: u32 = effect::TEXTURES | effect::MANY_LIGHTS | effect::ENVIRONMENT;
const STILL: u32 = FLAT | effect::GLOSSY;

compiled_sets![
    0,
    effect::TEXTURES,
    effect::GLOSSY,
    effect::TEXTURES | effect::GLOSSY,
    effect::ENVIRONMENT,
    effect::ENVIRONMENT | effect::GLOSSY,
    FLAT,
    STILL,
    STILL | effect::LENS,
    STILL | effect::INSTANCES,
    STILL | effect::INSTANCES | effect::MOTION | effect::LENS,
    STILL | effect::MEDIUM,
    effect::ALL,
];

/// The integrator for the smallest compiled set that holds `effects`. A larger set than needed costs
/// branches; it changes no bit of the picture.
fn integrator(effects: u32) -> RunRow {
    let holds = |set: u32| set & effects == effects;
    let smallest = SETS.iter().filter(|(set, _)| holds(*set)).min_by_key(|(set, _)| set.count_ones());
    smallest.map_or(run_row::<{ effect::ALL }>, |(_, run)| *run)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Leaving effects out of the compiled code must leave the picture as it is.
    #[test]
    fn every_compiled_set_that_holds_the_plan_gives_the_same_bits() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/scenes");
        for name in ["cornell_box", "textured_room", "frosted_glass", "foliage", "lens_table", "motion_blur"]
        {
            let text = std::fs::read_to_string(folder.join(format!("{name}.json"))).unwrap();
            let mut scene: serde_json::Value = serde_json::from_str(&text).unwrap();
            scene["camera"]["resolution"] = serde_json::json!([12, 9]);
            let scene = Scene::parse(&scene.to_string(), &folder).unwrap();
            let options = RenderOptions { second_hit: true, ..RenderOptions::default() };
            let film_of = |run: RunRow| {
                let mut renderer = Renderer::new(&scene, &options).unwrap();
                let mut sample = Sample::new(0);
                for (y, row) in renderer.film.rows().into_iter().enumerate() {
                    run(&scene, &options, y, row, &|_| 4, &mut sample);
                }
                renderer.film
            };
            let effects = Plan::new(&scene, &options).effects();
            let least = film_of(integrator(effects));
            for (set, run) in SETS.iter().filter(|(set, _)| set & effects == effects) {
                assert_eq!(film_of(*run), least, "{name} with the set {set:b}");
            }
        }
    }
}

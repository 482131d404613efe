//! The path integrator: next-event estimation and multiple importance sampling at every vertex,
//! Russian roulette, compiled for a set of effects.

use super::bsdf::{Bsdf, Scatter, diffuse_eval, diffuse_sample};
use super::math::{Basis, Ray, Vec3};
use super::medium::Medium;
use super::motion::AnimationFrame;
use super::plan::effect;
use super::sample::{FeatureMode, Sample};
use super::sampling::{Random, Stream, power_heuristic};
use super::scene::Scene;
use super::shape::Surface;

/// Largest probability with which roulette lets a path live on: no path is endless.
const SURVIVAL_LIMIT: f32 = 0.95;

/// Follows paths through a scene with effects `E`.
pub struct Integrator<'a, const E: u32> {
    /// The scene.
    pub scene: &'a Scene,
    /// Where features are recorded.
    pub features: FeatureMode,
    /// The frame that is rendered; all of the motion where there is none.
    pub frame: Option<AnimationFrame>,
    /// The render's seed.
    pub seed: u64,
}

/// The point a ray left from, and how its direction was chosen: what the weight of light that the ray
/// finds by itself depends on.
struct Origin {
    point: Vec3,
    normal: Option<Vec3>,
    pdf: f32,
    delta: bool,
}

/// What a path carries from vertex to vertex.
struct Path<'a> {
    ray: Ray,
    origin: Origin,
    throughput: Vec3,
    eta: f32, // product of index ratios crossed: radiance is squeezed by its square
    random: Random,
    medium_random: Option<Random>,
    sample: &'a mut Sample,
}

/// A surface vertex in its local frame.
struct Vertex {
    surface: Surface,
    basis: Basis,
    bsdf: Bsdf,
    wi: Vec3,
}

impl Vertex {
    /// The normal on the only side from which light is scattered to where the path came from; none where
    /// the other side's comes through. Only the choice between lights asks for it.
    #[inline(always)]
    fn lit_side<const E: u32>(&self) -> Option<Vec3> {
        let opaque = E & effect::GLOSSY == 0 || !matches!(self.bsdf, Bsdf::Dielectric(_));
        let side = 1f32.copysign(self.wi.z);
        (E & effect::MANY_LIGHTS != 0 && opaque).then(|| self.surface.shading_normal * side)
    }
}

impl<const E: u32> Integrator<'_, E> {
    /// Follows path number `index` of the pixel at `[x, y]` of the crop; fills `sample`.
    pub fn follow(&self, [x, y]: [usize; 2], index: u32, sample: &mut Sample) {
        let camera = &self.scene.camera;
        let pixel = camera.pixel_index([x + camera.crop.x, y + camera.crop.y]);
        let mut random = Random::new(self.seed, pixel, index, Stream::Path);
        let ray = camera.ray::<E>([x, y], self.frame.as_ref(), self.seed, index, &mut random);
        sample.reset(self.features);
        let medium_random =
            (E & effect::MEDIUM != 0).then(|| Random::new(self.seed, pixel, index, Stream::Medium));
        let mut path = Path {
            ray,
            origin: Origin { point: ray.origin, normal: None, pdf: 1.0, delta: true },
            throughput: Vec3::repeat(1.0),
            eta: 1.0,
            random,
            medium_random,
            sample,
        };
        for depth in 1..=self.scene.max_depth {
            if !self.step(&mut path, depth) || !self.survives(&mut path, depth) {
                break;
            }
        }
    }

    /// Follows the ray to its end and scatters there; false when the path ends.
    #[inline(always)]
    fn step(&self, path: &mut Path, depth: u32) -> bool {
        let hit = self.scene.world.closest::<E>(&path.ray);
        let distance = hit.as_ref().map_or(f32::INFINITY, |hit| hit.t);
        if let Some(frame) = self.frame.as_ref().filter(|_| depth == 1) {
            let scene = (&self.scene.camera, &self.scene.world);
            path.sample.motion = frame.vectors::<E>(scene, &path.ray, hit.as_ref());
        }
        let vertex = hit.map(|hit| {
            let (surface, shape) = self.scene.world.surface::<E>(&path.ray, &hit);
            (self.vertex(&path.ray, surface, shape), shape)
        });
        let mut recorded = false;
        if let Some((vertex, _)) = vertex.as_ref().filter(|_| path.sample.is_recording()) {
            recorded = path.sample.surface(self.features, &vertex.surface, &vertex.bsdf, distance);
        }
        if let Some(medium) = self.scene.medium.as_ref().filter(|_| E & effect::MEDIUM != 0)
            && let Some(t) = self.fly(medium, path, distance)
        {
            path.sample.end_recording();
            return depth < self.scene.max_depth && self.scatter_in_medium(medium, path, t, recorded);
        }
        let Some((vertex, shape)) = vertex else {
            self.add_environment(path);
            return false;
        };
        self.add_emission(path, &vertex.surface, shape, distance);
        depth < self.scene.max_depth && self.scatter_at_surface(path, &vertex, recorded)
    }

    fn vertex(&self, ray: &Ray, surface: Surface, shape: u32) -> Vertex {
        let material = &self.scene.materials[self.scene.shapes[shape as usize].material as usize];
        let basis = Basis::around(surface.shading_normal);
        let uv = if E & effect::TEXTURES == 0 { [0.0; 2] } else { surface.uv };
        Vertex { bsdf: material.at(uv), basis, wi: basis.to_local(-ray.direction), surface }
    }

    /// Russian roulette, by the share of the light that the path can still carry; none while the surface
    /// whose features are wanted is still to come, for without it the path would count as a miss.
    #[inline(always)]
    fn survives(&self, path: &mut Path, depth: u32) -> bool {
        if depth < self.scene.roulette_depth || path.sample.is_recording() {
            return true;
        }
        let survival = (path.throughput.amax() * path.eta * path.eta).min(SURVIVAL_LIMIT);
        if path.random.next() >= survival {
            return false;
        }
        path.throughput /= survival;
        true
    }

    /// Radiance from outside that the path's ray reaches.
    #[inline(always)]
    fn add_environment(&self, path: &mut Path) {
        if E & effect::ENVIRONMENT == 0 {
            return;
        }
        let Some((index, environment)) = self.scene.lights.environment() else { return };
        let direction = path.ray.direction;
        let weight = self.found_weight(&path.origin, index, || environment.pdf(direction));
        let radiance = environment.radiance(direction).component_mul(&path.throughput) * weight;
        path.sample.add::<E>(radiance, self.scene.groups[index]);
    }

    /// Radiance of the surface itself.
    #[inline(always)]
    fn add_emission(&self, path: &mut Path, surface: &Surface, shape: u32, distance: f32) {
        let shape = &self.scene.shapes[shape as usize];
        let cos = -path.ray.direction.dot(&surface.normal);
        if shape.radiance == Vec3::zeros() || cos <= 0.0 {
            return;
        }
        let weight = match shape.emitter {
            None => 1.0, // moving or instanced: found by chance only
            Some(light) => self.found_weight(&path.origin, light as usize, || {
                self.scene.emitter_pdf(light as usize, path.origin.point, distance, cos)
            }),
        };
        path.sample.add::<E>(shape.radiance.component_mul(&path.throughput) * weight, shape.group);
    }

    /// Weight of light that scattering found, beside next-event estimation of the same light.
    #[inline(always)]
    fn found_weight(&self, origin: &Origin, light: usize, pdf: impl Fn() -> f32) -> f32 {
        if origin.delta {
            return 1.0;
        }
        let chosen = self.scene.lights.probability::<E>(origin.point, origin.normal, light);
        power_heuristic(origin.pdf, pdf() * chosen)
    }

    /// Lights the vertex and scatters there; false when the path is absorbed.
    #[inline(always)]
    fn scatter_at_surface(&self, path: &mut Path, vertex: &Vertex, recorded: bool) -> bool {
        let Vertex { surface, basis, bsdf, wi } = vertex;
        let normal = vertex.lit_side::<E>();
        if E & effect::GLOSSY == 0 || !bsdf.is_delta() {
            self.add_direct(path, surface.point, Some((surface, normal)), recorded, |direction| {
                eval::<E>(bsdf, *wi, basis.to_local(direction))
            });
        }
        let Some(scatter) = sample::<E>(bsdf, *wi, &mut path.random) else { return false };
        let direction = basis.to_world(scatter.wo);
        path.throughput.component_mul_assign(&scatter.weight);
        path.eta *= scatter.eta;
        path.origin = Origin { point: surface.point, normal, pdf: scatter.pdf, delta: scatter.delta };
        path.ray = surface.leaving(direction, path.ray.time);
        path.throughput != Vec3::zeros()
    }

    /// Flies through the medium up to `distance`; where the path is scattered, if at all.
    #[inline(always)]
    fn fly(&self, medium: &Medium, path: &mut Path, distance: f32) -> Option<f32> {
        let flight = medium.sample(&path.ray, distance, path.medium_random.as_mut()?);
        path.throughput.component_mul_assign(&flight.weight);
        flight.scattered_at
    }

    /// Lights the point at distance `t` in the medium and scatters there.
    fn scatter_in_medium(&self, medium: &Medium, path: &mut Path, t: f32, recorded: bool) -> bool {
        let (point, travel) = (path.ray.at(t), path.ray.direction);
        self.add_direct(path, point, None, recorded, |direction| {
            let phase = medium.phase(travel.dot(&direction));
            (Vec3::repeat(phase), phase)
        });
        let Some(random) = path.medium_random.as_mut() else { return false };
        let direction = medium.scatter(travel, random);
        let pdf = medium.phase(travel.dot(&direction));
        path.origin = Origin { point, normal: None, pdf, delta: false };
        path.ray = Ray { origin: point, direction, time: path.ray.time };
        true
    }

    /// Next-event estimation: light that reaches `point` straight, scattered by `eval`, which gives value
    /// and density of scattering into a direction.
    #[inline(always)]
    fn add_direct(
        &self,
        path: &mut Path,
        point: Vec3,
        surface: Option<(&Surface, Option<Vec3>)>,
        recorded: bool,
        eval: impl Fn(Vec3) -> (Vec3, f32),
    ) {
        let normal = surface.and_then(|(_, lit_side)| lit_side);
        let chosen = self.scene.lights.choose::<E>(point, normal, &mut path.random);
        let u = path.random.next_2d();
        let mut reached = false;
        if let Some((index, probability)) = chosen
            && let Some(light) = self.scene.lights.get(index).sample(point, u)
        {
            let (value, pdf) = eval(light.direction);
            // A black surface still tells what reaches it.
            if pdf > 0.0 && (recorded || value != Vec3::zeros()) {
                let ray = match surface {
                    Some((surface, _)) => surface.leaving(light.direction, path.ray.time),
                    None => Ray { origin: point, direction: light.direction, time: path.ray.time },
                };
                let (ray, end) = ray.aimed(light.end);
                if !self.scene.world.occluded::<E>(&ray, end) {
                    reached = true;
                    let density = light.pdf * probability;
                    let weight = if light.delta { 1.0 } else { power_heuristic(density, pdf) };
                    let mut radiance = value.component_mul(&light.radiance) * (weight / density);
                    if let Some(medium) = self.scene.medium.as_ref().filter(|_| E & effect::MEDIUM != 0) {
                        radiance.component_mul_assign(&medium.transmittance(&ray, light.distance));
                    }
                    let radiance = radiance.component_mul(&path.throughput);
                    path.sample.add::<E>(radiance, self.scene.groups[index]);
                }
            }
        }
        if recorded {
            path.sample.visibility(reached);
        }
    }
}

#[inline(always)]
fn eval<const E: u32>(bsdf: &Bsdf, wi: Vec3, wo: Vec3) -> (Vec3, f32) {
    match bsdf {
        Bsdf::Diffuse(reflectance) => diffuse_eval(*reflectance, wi, wo),
        _ if E & effect::GLOSSY == 0 => (Vec3::zeros(), 0.0),
        _ => bsdf.eval(wi, wo),
    }
}

#[inline(always)]
fn sample<const E: u32>(bsdf: &Bsdf, wi: Vec3, random: &mut Random) -> Option<Scatter> {
    match bsdf {
        Bsdf::Diffuse(reflectance) => diffuse_sample(*reflectance, wi, random),
        _ if E & effect::GLOSSY == 0 => None,
        _ => bsdf.sample(wi, random),
    }
}

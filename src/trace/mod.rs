//! The bundled path tracer: it makes the denoiser's inputs and the many-sample references.
//!
//! A [`Scene`] comes from a JSON file ([`Scene::load`]) or text ([`Scene::parse`]). From it a [`Plan`]
//! is derived: which effects exist, so that the integrator can be compiled without the others.
//! [`render`] gives a [`Frame`](crate::frame::Frame) with variances, halves and features; a
//! [`Renderer`] does the same in passes, each with its own number of samples per pixel.
//!
//! Everything is deterministic: the same scene, options and seed give the same bits on any number of
//! threads and in any split into passes.

mod bsdf;
mod bvh;
mod camera;
mod film;
mod light;
mod math;
mod medium;
mod motion;
mod path;
mod plain;
mod plan;
mod render;
mod sample;
mod sampling;
mod scene;
mod shape;
mod texture;
mod transform;
mod world;

pub use bvh::Split;
pub use film::{Count, Film};
pub use motion::AnimationFrame;
pub use plan::{Effect, Plan};
pub use render::{RenderOptions, Rendered, Renderer, Samples, render};
pub use sample::FeatureMode;
pub use scene::Scene;

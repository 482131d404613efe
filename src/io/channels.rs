//! The channel map: what renderers call the pictures they write, and which statistic a number is.
//!
//! Three tables and nothing else. [`LAYERS`] names the layers that hold means, [`COMPANIONS`] says
//! how the layer of a statistic is named after the layer of its mean, [`MARKS`] tells the renderers
//! apart. A renderer that is missing needs rows here and no code.
//!
//! A *layer* is a channel's name up to its last dot (with the part's name in front where the part is
//! the layer), a *component* is what follows. Names are compared without regard to case. In a
//! pattern `*.` at the start stands for any layers around it, or none (Cycles puts its view layer
//! there), `#` for any number or none (`albedo2` is the albedo of the second hit), `*` at the end for
//! any further letters, one at least, and a lone `*` for everything.

use serde::{Deserialize, Serialize};

use crate::frame::FeatureKind;

/// The programs whose names are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Renderer {
    /// This project's own names, and the usual ones. Every other renderer falls back on them.
    Plain,
    /// Mitsuba 3.
    Mitsuba,
    /// PBRT-v4 with the gbuffer film.
    Pbrt,
    /// Blender Cycles, multilayer.
    Cycles,
    /// Arnold.
    Arnold,
    /// RenderMan.
    RenderMan,
    /// V-Ray.
    VRay,
    /// Corona.
    Corona,
    /// LuxCore: one file per buffer.
    LuxCore,
    /// Tungsten: one file per buffer.
    Tungsten,
}

impl Renderer {
    /// All of them, with the names that the command line takes.
    pub const NAMES: [(&'static str, Renderer); 10] = [
        ("plain", Renderer::Plain),
        ("mitsuba", Renderer::Mitsuba),
        ("pbrt", Renderer::Pbrt),
        ("cycles", Renderer::Cycles),
        ("arnold", Renderer::Arnold),
        ("renderman", Renderer::RenderMan),
        ("vray", Renderer::VRay),
        ("corona", Renderer::Corona),
        ("luxcore", Renderer::LuxCore),
        ("tungsten", Renderer::Tungsten),
    ];

    /// Whether it writes one file per buffer, so that the others lie beside the colour.
    pub fn writes_one_file_per_buffer(self) -> bool {
        matches!(self, Renderer::LuxCore | Renderer::Tungsten)
    }
}

/// What a layer is to the denoiser.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// The picture to denoise.
    Color,
    /// The picture that is to hold the result, where it is not the noisy one.
    Beauty,
    /// A feature.
    Feature(FeatureKind),
    /// Samples per pixel: a number, or a share of the most.
    SampleCount,
    /// The colour once more: only its statistics are of use.
    ColorCopy,
    /// The colour in CIE XYZ, whose second moments say nothing about RGB.
    ColorXyz,
    /// A component of the beauty, which goes through its operator.
    Aov,
    /// Where the pixel's surface is in the frames beside.
    Motion(Flow),
}

/// What motion vectors point to, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Flow {
    /// From here to the place in the frame before, rows down.
    Previous,
    /// From here to the place in the next frame, rows down.
    Next,
    /// From here to the place in the frame before, then from the place in the next frame to here, rows up.
    Cycles,
}

/// What a variance buffer holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum VarianceKind {
    /// Variance of the stored mean: used as it is.
    Mean,
    /// Variance of one sample: divided by the number of samples.
    Sample,
    /// Mean of the squares: the squared mean is taken off, then divided by the samples less one.
    M2,
    /// Standard deviation of the stored mean: squared.
    Stddev,
    /// None is read: the denoiser estimates it from the difference of the half buffers.
    Halves,
}

impl VarianceKind {
    /// All of them, with the names that the command line takes.
    pub const NAMES: [(&'static str, VarianceKind); 5] = [
        ("mean", VarianceKind::Mean),
        ("sample", VarianceKind::Sample),
        ("m2", VarianceKind::M2),
        ("stddev", VarianceKind::Stddev),
        ("halves", VarianceKind::Halves),
    ];
}

/// Which statistic of a role a layer holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Statistic {
    Mean,
    /// A variance of the kind.
    Variance(VarianceKind),
    /// The mean of one half of the samples.
    HalfA,
    /// The mean of the other half.
    HalfB,
}

/// What the numbers of a layer must look like, where names are the user's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Evidence {
    /// The name is enough.
    Name,
    /// Equal to the colour.
    EqualsColor,
    /// The colour in CIE XYZ.
    EqualsColorInXyz,
    /// Every vector has length 1 at most, and most have 1 (or 0, where there is no surface).
    UnitVectors,
    /// Between 0 and 1, but for a few.
    UnitRange,
}

/// One row of [`LAYERS`].
#[derive(Debug)]
pub(super) struct LayerRow {
    pub(super) renderer: Renderer,
    /// Pattern of the layer's name.
    pub(super) layer: &'static str,
    /// Sets of components that will do, each in its order; of the first set that is there in full.
    pub(super) components: &'static [&'static [&'static str]],
    pub(super) role: Role,
    pub(super) evidence: Evidence,
}

/// One row of [`COMPANIONS`].
#[derive(Debug)]
pub(super) struct CompanionRow {
    pub(super) renderer: Renderer,
    /// Whether the row is for the colour (and its copies), for the features, or for both.
    pub(super) of: Of,
    /// Name of the statistic's layer; `{}` stands for the mean's layer, or for what follows any of
    /// its dots (`m2_{}` finds `a.m2_b` for `a.b`).
    pub(super) layer: &'static str,
    pub(super) statistic: Statistic,
}

/// Which roles have a companion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Of {
    Color,
    Features,
    Both,
}

/// How a renderer is known.
#[derive(Debug, Clone, Copy)]
pub(super) enum Mark {
    /// An attribute whose name starts so.
    Attribute(&'static str),
    /// An attribute of that name whose text starts so.
    Text(&'static str, &'static str),
    /// A layer that matches the pattern.
    Layer(&'static str),
}

/// Where samples per pixel stand in the header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CountAs {
    /// Samples per pixel.
    Samples,
    /// The square root of it.
    Root,
}

const RGB: &[&[&str]] = &[&["R", "G", "B"]];
const VECTOR: &[&[&str]] = &[&["X", "Y", "Z"], &["R", "G", "B"]];
const XYZ: &[&[&str]] = &[&["X", "Y", "Z"]];
const DEPTH: &[&[&str]] = &[&["Z"], &["T"], &["V"], &["Y"], &["D"], &["X"], &[""], &["R"]];
const SCALAR: &[&[&str]] = &[&["Y"], &["X"], &["V"], &["Z"], &[""], &["R"]];
const FLOW: &[&[&str]] = &[&["X", "Y"], &["R", "G"]];
const BOTH_FLOWS: &[&[&str]] = &[&["X", "Y", "Z", "W"]];
const BARE_Z: &[&[&str]] = &[&["Z"]];
const BARE_T: &[&[&str]] = &[&["T"]];

const COLOR: Role = Role::Color;
const ALBEDO: Role = Role::Feature(FeatureKind::Albedo);
const NORMAL: Role = Role::Feature(FeatureKind::Normal);
const POSITION: Role = Role::Feature(FeatureKind::Position);
const DISTANCE: Role = Role::Feature(FeatureKind::Depth);
const PREVIOUS: Role = Role::Motion(Flow::Previous);
const NEXT: Role = Role::Motion(Flow::Next);
const VISIBILITY: Role = Role::Feature(FeatureKind::Visibility);

const fn named(
    renderer: Renderer,
    layer: &'static str,
    components: &'static [&'static [&'static str]],
    role: Role,
) -> LayerRow {
    LayerRow { renderer, layer, components, role, evidence: Evidence::Name }
}

const fn shown(
    renderer: Renderer,
    components: &'static [&'static [&'static str]],
    evidence: Evidence,
    role: Role,
) -> LayerRow {
    LayerRow { renderer, layer: "*", components, role, evidence }
}

/// The layers that hold means. For each role the first row that matches wins, the detected
/// renderer's rows before the plain ones.
#[rustfmt::skip]
pub(super) const LAYERS: &[LayerRow] = &[
    named(Renderer::Plain, "",               RGB,    COLOR),
    named(Renderer::Plain, "rgba",           RGB,    COLOR),
    named(Renderer::Plain, "beauty",         RGB,    COLOR),
    named(Renderer::Plain, "albedo#",        RGB,    ALBEDO),
    named(Renderer::Plain, "diffuse_albedo", RGB,    ALBEDO),
    named(Renderer::Plain, "texture",        RGB,    ALBEDO),
    named(Renderer::Plain, "normal#",        VECTOR, NORMAL),
    named(Renderer::Plain, "normals",        VECTOR, NORMAL),
    named(Renderer::Plain, "N",              VECTOR, NORMAL),
    named(Renderer::Plain, "position#",      VECTOR, POSITION),
    named(Renderer::Plain, "P",              VECTOR, POSITION),
    named(Renderer::Plain, "depth#",         DEPTH,  DISTANCE),
    named(Renderer::Plain, "zdepth",         DEPTH,  DISTANCE),
    named(Renderer::Plain, "",               BARE_Z, DISTANCE),
    named(Renderer::Plain, "Z",              DEPTH,  DISTANCE),
    named(Renderer::Plain, "visibility#",    SCALAR, VISIBILITY),
    named(Renderer::Plain, "sampleCount",    SCALAR, Role::SampleCount),
    named(Renderer::Plain, "motionPrevious", FLOW,   PREVIOUS),
    named(Renderer::Plain, "motionNext",     FLOW,   NEXT),

    // `aov` and `moment` in any nesting: the user names the layers, so their numbers must tell.
    named(Renderer::Mitsuba, "",         RGB,    COLOR),
    named(Renderer::Mitsuba, "*.albedo", RGB,    ALBEDO),
    named(Renderer::Mitsuba, "*.sh_normal", XYZ, NORMAL),
    named(Renderer::Mitsuba, "*.geo_normal", XYZ, NORMAL),
    named(Renderer::Mitsuba, "*.position", XYZ,  POSITION),
    shown(Renderer::Mitsuba, RGB,    Evidence::EqualsColor,      Role::ColorCopy),
    shown(Renderer::Mitsuba, XYZ,    Evidence::EqualsColorInXyz, Role::ColorXyz),
    shown(Renderer::Mitsuba, RGB,    Evidence::UnitRange,        ALBEDO),
    shown(Renderer::Mitsuba, XYZ,    Evidence::UnitVectors,      NORMAL),
    shown(Renderer::Mitsuba, XYZ,    Evidence::Name,             POSITION),
    shown(Renderer::Mitsuba, BARE_T, Evidence::Name,             DISTANCE),

    // No depth channel: the camera-space position has it.
    named(Renderer::Pbrt, "",       RGB, COLOR),
    named(Renderer::Pbrt, "Albedo", RGB, ALBEDO),
    named(Renderer::Pbrt, "Ns",     XYZ, NORMAL),
    named(Renderer::Pbrt, "N",      XYZ, NORMAL),
    named(Renderer::Pbrt, "P",      XYZ, POSITION),

    // With the denoiser on, `Combined` is denoised already and `Noisy Image` is the render.
    named(Renderer::Cycles, "*.Noisy Image",      RGB,    COLOR),
    named(Renderer::Cycles, "*.Combined",         RGB,    COLOR),
    named(Renderer::Cycles, "*.Combined",         RGB,    Role::Beauty),
    named(Renderer::Cycles, "*.Denoising Albedo", RGB,    ALBEDO),
    named(Renderer::Cycles, "*.DiffCol",          RGB,    ALBEDO),
    named(Renderer::Cycles, "*.Denoising Normal", XYZ,    NORMAL),
    named(Renderer::Cycles, "*.Normal",           XYZ,    NORMAL),
    named(Renderer::Cycles, "*.Position",         XYZ,    POSITION),
    named(Renderer::Cycles, "*.Depth",            DEPTH,  DISTANCE),
    named(Renderer::Cycles, "*.Denoising Depth",  DEPTH,  DISTANCE),
    named(Renderer::Cycles, "*.Debug Sample Count", SCALAR, Role::SampleCount),
    named(Renderer::Cycles, "*.Vector",           BOTH_FLOWS, Role::Motion(Flow::Cycles)),

    named(Renderer::Arnold, "",               RGB,    COLOR),
    named(Renderer::Arnold, "RGBA",           RGB,    COLOR),
    named(Renderer::Arnold, "denoise_albedo", RGB,    ALBEDO),
    named(Renderer::Arnold, "diffuse_albedo", RGB,    ALBEDO),
    named(Renderer::Arnold, "albedo",         RGB,    ALBEDO),
    named(Renderer::Arnold, "N",              VECTOR, NORMAL),
    named(Renderer::Arnold, "P",              VECTOR, POSITION),
    named(Renderer::Arnold, "",               BARE_Z, DISTANCE),
    named(Renderer::Arnold, "Z",              DEPTH,  DISTANCE),

    named(Renderer::RenderMan, "Ci",          RGB,    COLOR),
    named(Renderer::RenderMan, "",            RGB,    COLOR),
    named(Renderer::RenderMan, "albedo",      RGB,    ALBEDO),
    named(Renderer::RenderMan, "normal",      VECTOR, NORMAL),
    named(Renderer::RenderMan, "zfiltered",   DEPTH,  DISTANCE),
    named(Renderer::RenderMan, "sampleCount", SCALAR, Role::SampleCount),

    named(Renderer::VRay, "",              RGB,    COLOR),
    named(Renderer::VRay, "diffuse",       RGB,    ALBEDO),
    named(Renderer::VRay, "diffuseFilter", RGB,    ALBEDO),
    named(Renderer::VRay, "normals",       VECTOR, NORMAL),
    named(Renderer::VRay, "zDepth",        DEPTH,  DISTANCE),
    // V-Ray for 3ds Max names its elements by their classes.
    named(Renderer::VRay, "VRayDiffuseFilter", RGB,    ALBEDO),
    named(Renderer::VRay, "VRayNormals",       VECTOR, NORMAL),
    named(Renderer::VRay, "VRayZDepth",        DEPTH,  DISTANCE),

    named(Renderer::Corona, "",                 RGB,    COLOR),
    named(Renderer::Corona, "VisibleDiffuse",   RGB,    ALBEDO),
    named(Renderer::Corona, "VisibleNormals",   VECTOR, NORMAL),
    named(Renderer::Corona, "OptixNormals",     VECTOR, NORMAL),
    named(Renderer::Corona, "CGeometry_ZDepth", DEPTH,  DISTANCE),

    // One file per buffer: the layer is the file's name. One channel is written as three.
    named(Renderer::LuxCore, "RGB",                RGB,    COLOR),
    named(Renderer::LuxCore, "RGB_IMAGEPIPELINE",  RGB,    COLOR),
    named(Renderer::LuxCore, "ALBEDO",             RGB,    ALBEDO),
    named(Renderer::LuxCore, "AVG_SHADING_NORMAL", VECTOR, NORMAL),
    named(Renderer::LuxCore, "SHADING_NORMAL",     VECTOR, NORMAL),
    named(Renderer::LuxCore, "GEOMETRY_NORMAL",    VECTOR, NORMAL),
    named(Renderer::LuxCore, "POSITION",           VECTOR, POSITION),
    named(Renderer::LuxCore, "DEPTH",              DEPTH,  DISTANCE),
    named(Renderer::LuxCore, "SAMPLECOUNT",        SCALAR, Role::SampleCount),

    named(Renderer::Tungsten, "color",      RGB,    COLOR),
    named(Renderer::Tungsten, "albedo",     RGB,    ALBEDO),
    named(Renderer::Tungsten, "normal",     VECTOR, NORMAL),
    named(Renderer::Tungsten, "depth",      DEPTH,  DISTANCE),
    named(Renderer::Tungsten, "visibility", SCALAR, VISIBILITY),
];

const fn companion(renderer: Renderer, of: Of, layer: &'static str, statistic: Statistic) -> CompanionRow {
    CompanionRow { renderer, of, layer, statistic }
}

const OF_MEAN: Statistic = Statistic::Variance(VarianceKind::Mean);
const OF_SAMPLE: Statistic = Statistic::Variance(VarianceKind::Sample);
const SECOND_MOMENT: Statistic = Statistic::Variance(VarianceKind::M2);

/// How statistics are named after their mean. Renderers without rows here and without the plain
/// names export none: Cycles, LuxCore, V-Ray (`noiseLevel` is no variance), Corona (the scale of its
/// hidden `Sqr…` channels is not documented).
#[rustfmt::skip]
pub(super) const COMPANIONS: &[CompanionRow] = &[
    companion(Renderer::Plain, Of::Both, "{}Variance", OF_MEAN), // `variance` for the bare colour
    companion(Renderer::Plain, Of::Both, "{}HalfA",    Statistic::HalfA),
    companion(Renderer::Plain, Of::Both, "{}HalfB",    Statistic::HalfB),

    companion(Renderer::Mitsuba, Of::Both, "m2_{}", SECOND_MOMENT),

    companion(Renderer::Pbrt, Of::Color, "Variance", OF_SAMPLE),

    companion(Renderer::Arnold, Of::Color, "variance", OF_MEAN),

    companion(Renderer::RenderMan, Of::Color,    "mse",    OF_MEAN),
    companion(Renderer::RenderMan, Of::Features, "{}_mse", OF_MEAN),
    companion(Renderer::RenderMan, Of::Features, "{}_var", OF_SAMPLE),

    companion(Renderer::Tungsten, Of::Both, "{}Variance", OF_MEAN),
    companion(Renderer::Tungsten, Of::Both, "{}A",        Statistic::HalfA),
    companion(Renderer::Tungsten, Of::Both, "{}B",        Statistic::HalfB),
];

/// [choice] Variances whose scale their renderer does not document, and what they are taken for.
pub(super) const UNSURE: &[(Renderer, &str)] = &[(
    Renderer::Arnold,
    "Arnold does not document the scale of its variance: it is taken for that of the mean; if the result is \
     too smooth or too noisy, try --variance-kind sample or stddev",
)];

/// How a file tells who wrote it; the first mark that is there decides. Renderers that write one
/// file per buffer leave no mark and must be named.
#[rustfmt::skip]
pub(super) const MARKS: &[(Renderer, Mark)] = &[
    (Renderer::Cycles,    Mark::Attribute("cycles.")),
    (Renderer::Cycles,    Mark::Attribute("BlenderMultiChannel")),
    (Renderer::Cycles,    Mark::Layer("*.Combined")),
    (Renderer::Mitsuba,   Mark::Text("generatedBy", "Mitsuba")),
    (Renderer::Arnold,    Mark::Attribute("arnold/")),
    (Renderer::VRay,      Mark::Attribute("vrayInfo/")),
    (Renderer::Corona,    Mark::Attribute("corona.")),
    (Renderer::Pbrt,      Mark::Layer("RelativeVariance")),
    (Renderer::Pbrt,      Mark::Layer("Ns")),
    (Renderer::RenderMan, Mark::Attribute("rman")),
    (Renderer::RenderMan, Mark::Layer("Ci")),
    (Renderer::RenderMan, Mark::Layer("zfiltered")),
];

/// Attributes that state the samples per pixel: start and end of the name, and how to read it.
pub(super) const COUNTS: &[(&str, &str, CountAs)] = &[
    ("samplesPerPixel", "", CountAs::Samples),
    ("cycles.", ".samples", CountAs::Samples),
    ("arnold/AA_samples", "", CountAs::Root),
];

/// What a pattern found in a layer's name.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Matched<'a> {
    /// The layers around it, with their dot.
    pub(super) around: &'a str,
    /// The number at `#`.
    pub(super) number: &'a str,
}

/// Holds `layer` against a pattern of [`LAYERS`].
pub(super) fn match_layer<'a>(pattern: &str, layer: &'a str) -> Option<Matched<'a>> {
    if pattern == "*" {
        return Some(Matched { around: "", number: "" });
    }
    let (around, name, pattern) = match pattern.strip_prefix("*.") {
        Some(pattern) => {
            let start = layer.rfind('.').map_or(0, |dot| dot + 1);
            (&layer[..start], &layer[start..], pattern)
        }
        None => ("", layer, pattern),
    };
    if let Some(start) = pattern.strip_suffix('*') {
        let fits = name.len() > start.len()
            && name.get(..start.len()).is_some_and(|head| head.eq_ignore_ascii_case(start));
        return fits.then_some(Matched { around, number: "" });
    }
    let (head, tail) = pattern.split_once('#').unwrap_or((pattern, ""));
    let number = name.get(head.len()..name.len().checked_sub(tail.len())?)?;
    let is_number =
        number.bytes().all(|byte| byte.is_ascii_digit()) && (pattern.contains('#') || number.is_empty());
    let fits = name[..head.len()].eq_ignore_ascii_case(head)
        && name[head.len() + number.len()..].eq_ignore_ascii_case(tail);
    (is_number && fits).then_some(Matched { around, number })
}

/// The names that a companion of `layer` may have.
pub(super) fn companion_names(row: &CompanionRow, layer: &str) -> Vec<String> {
    let starts = std::iter::once(0).chain(layer.match_indices('.').map(|(dot, _)| dot + 1));
    let mut names: Vec<String> = starts
        .map(|start| format!("{}{}", &layer[..start], row.layer.replace("{}", &layer[start..])))
        .collect();
    names.dedup();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_take_layers_around_and_numbers() {
        let around = |pattern, layer| match_layer(pattern, layer).map(|m| m.around.to_owned());
        assert_eq!(around("*.Noisy Image", "ViewLayer.Noisy Image"), Some("ViewLayer.".into()));
        assert_eq!(around("*.Noisy Image", "noisy image"), Some(String::new()));
        assert_eq!(around("*.Combined", "ViewLayer.Combined_key"), None);
        assert_eq!(around("albedo", "scene.albedo"), None);
        assert_eq!(around("*.Combined_*", "ViewLayer.Combined_key"), Some("ViewLayer.".into()));
        assert_eq!(around("*.Combined_*", "ViewLayer.Combined_"), None);
        assert_eq!(around("RGBA_*", "RGBÄ_key"), None);
        let number = |pattern, layer| match_layer(pattern, layer).map(|m| m.number.to_owned());
        assert_eq!(number("albedo#", "albedo"), Some(String::new()));
        assert_eq!(number("albedo#", "Albedo12"), Some("12".into()));
        assert_eq!(number("albedo#", "albedoVariance"), None);
        assert_eq!(number("albedo#", "albédo"), None);
        assert_eq!(number("N", "Ns"), None);
        assert_eq!(number("", ""), Some(String::new()));
        assert_eq!(number("", "R"), None);
    }

    #[test]
    fn companions_are_named_after_any_part_of_the_layer() {
        let m2 = COMPANIONS.iter().find(|row| row.renderer == Renderer::Mitsuba).unwrap();
        assert_eq!(companion_names(m2, "nested.img"), ["m2_nested.img", "nested.m2_img"]);
        assert_eq!(companion_names(m2, "alb"), ["m2_alb"]);
        let own = &COMPANIONS[0];
        assert_eq!(companion_names(own, ""), ["Variance"]);
        assert_eq!(companion_names(own, "depth"), ["depthVariance"]);
    }

    #[test]
    fn every_renderer_names_a_colour_and_can_be_chosen() {
        for (name, renderer) in Renderer::NAMES {
            let colors = LAYERS.iter().filter(|row| row.renderer == renderer && row.role == Role::Color);
            assert!(colors.count() > 0, "{name} has no row for the colour");
            assert_eq!(format!("{renderer:?}").to_lowercase(), name);
        }
    }
}

//! Names of features: what a scene may have, and what a node may require of the device.

use std::{cmp::Ordering, fmt};

/// Something that a scene has or has not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Flag {
    /// What `Feature("…")` calls it.
    pub name: &'static str,
    /// What scenes have it.
    pub doc: &'static str,
}

/// Every feature that a scene or the light that was baked for it reports, and that `Feature("…")` conditions can test.
pub const KNOWN: &[Flag] = &[
    Flag { name: "textures", doc: "some material has a texture" },
    Flag { name: "glossy", doc: "some material has specular reflection" },
    Flag { name: "normals", doc: "some mesh has normals of its own at its vertices" },
    Flag { name: "several_lights", doc: "there is more than one light" },
    Flag { name: "moving_objects", doc: "some object moves or turns" },
    Flag { name: "deforming_objects", doc: "some object changes its shape: a key-framed mesh or metaballs" },
    Flag { name: "moving_lights", doc: "some light moves or turns, as the sun of a sky does" },
    Flag { name: "moving_camera", doc: "the camera moves or turns" },
    Flag { name: "baked_atlas", doc: "precomputed light is given and looked up in an atlas over the surfaces" },
    Flag { name: "baked_cube", doc: "precomputed light is given and looked up on a cube round the camera" },
];

/// The names in [`KNOWN`].
pub fn flags() -> impl Iterator<Item = &'static str> + Clone {
    KNOWN.iter().map(|flag| flag.name)
}

/// Something that is measured of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredFeature {
    /// What `Above("…", …)` calls it.
    pub name: &'static str,
    /// What it is.
    pub doc: &'static str,
    /// It is between 0 and this.
    pub most: f64,
}

/// Every feature that is measured, and that `Above("…", …)` conditions can test. What is estimated is for the scene's own camera and lights, over
/// their motion.
pub const MEASURED: &[MeasuredFeature] = &[
    MeasuredFeature {
        name: "indirect_occlusion",
        doc: "share of the one-bounce light towards the surfaces that the camera sees that is blocked on its way from the lit surface to them",
        most: 1.0,
    },
    MeasuredFeature {
        name: "direct_occlusion",
        doc: "share of the lights' own light towards the surfaces that the camera sees that something blocks",
        most: 1.0,
    },
    MeasuredFeature {
        name: "second_bounce",
        doc: "share of the light of two and more bounces in all the light of lights that the picture shows",
        most: 1.0,
    },
    MeasuredFeature {
        name: "specular_energy",
        doc: "share of all the light of lights that the picture shows that comes by way of a specular lobe",
        most: 1.0,
    },
    MeasuredFeature {
        name: "unseen_light",
        doc: "share of the flux that lit surfaces reflect that reaches nothing of what the camera sees, or leaves the scene",
        most: 1.0,
    },
    MeasuredFeature {
        name: "depth_spread",
        doc: "standard deviation of the logarithm of the distance of what the camera sees",
        most: f64::INFINITY,
    },
    MeasuredFeature { name: "lit_share", doc: "share of the texels of the reflective shadow map that reflect light", most: 1.0 },
];

/// The names in [`MEASURED`].
pub fn measured() -> impl Iterator<Item = &'static str> + Clone {
    MEASURED.iter().map(|feature| feature.name)
}

/// An estimate of a measured feature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// The estimate.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
}

/// Standard errors that an estimate must lie below a bound by, so that it is known to be below.
const SURE: f64 = 2.0;

impl Measured {
    /// Whether the feature is more than the bound, or may be: an effect is left out only when it is known to be small.
    pub fn above(&self, bound: f64) -> bool {
        // What is no number may be anything.
        !matches!(self.at_most().partial_cmp(&bound), Some(Ordering::Less | Ordering::Equal))
    }

    /// What the feature is not above, as far as the error lets one say.
    pub fn at_most(&self) -> f64 {
        self.value + SURE * self.standard_error
    }
}

impl fmt::Display for Measured {
    /// With as many places as the error leaves meaning.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let places = |size: f64, digits: f64| {
            if size > 0.0 && size.is_finite() { (digits - size.log10().floor()).clamp(0.0, 9.0) as usize } else { 0 }
        };
        let Self { value, standard_error: error } = *self;
        if error > 0.0 {
            let places = places(error, 0.0);
            return write!(f, "{value:.places$} ± {error:.places$}");
        }
        let places = places(value.abs(), 2.0);
        write!(f, "{value:.places$} ± 0")
    }
}

/// Device features that a node's `requires` can name: those of wgpu that change what a shader may do.
pub const DEVICE: &[&str] = &[
    "FLOAT32_FILTERABLE",
    "FLOAT32_BLENDABLE",
    "TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES",
    "TEXTURE_ATOMIC",
    "TEXTURE_INT64_ATOMIC",
    "TEXTURE_FORMAT_16BIT_NORM",
    "FORMATS_TIER_1",
    "RW_STORAGE_TEXTURE_TIER_1",
    "RG11B10UFLOAT_RENDERABLE",
    "BGRA8UNORM_STORAGE",
    "SHADER_F16",
    "SHADER_F64",
    "SHADER_I16",
    "SHADER_INT64",
    "SHADER_INT64_ATOMIC_MIN_MAX",
    "SHADER_INT64_ATOMIC_ALL_OPS",
    "SHADER_FLOAT32_ATOMIC",
    "SHADER_EARLY_DEPTH_TEST",
    "SHADER_BARYCENTRICS",
    "SHADER_PER_VERTEX",
    "SHADER_DRAW_INDEX",
    "SUBGROUP",
    "SUBGROUP_VERTEX",
    "SUBGROUP_BARRIER",
    "VERTEX_WRITABLE_STORAGE",
    "CONSERVATIVE_RASTERIZATION",
    "DEPTH_CLIP_CONTROL",
    "DUAL_SOURCE_BLENDING",
    "CLIP_DISTANCES",
    "PRIMITIVE_INDEX",
    "EXPERIMENTAL_RAY_QUERY",
    "EXPERIMENTAL_COOPERATIVE_MATRIX",
];

//! Scene and frame data as pipelines see them: what the externals are, how large, and how they get onto the GPU.

use std::collections::BTreeMap;

use bytemuck::{bytes_of, cast_slice};
use manylight_gpu::{Externals, Fault, Gpu, TextureArray};
use manylight_graph::{
    registry::{External, PortKind},
    shader::Layout,
    value::{Encoding, Format, ResourceDesc},
};
use manylight_scene::{
    Scene, SceneState,
    gpu_data::{self, Frame, Light, LightView, SceneInfo, Seed, View},
};

use crate::baked::{Baked, CORNERS, Lookup};

/// The scene's texture array.
const TEXTURES: &str = "scene_textures";

/// Precomputed light.
const BAKED: &str = "baked_light";

/// What an external holds and what it is for.
struct Entry {
    name: &'static str,
    element: &'static str,
    uniform: bool,
    doc: &'static str,
}

const ENTRIES: &[Entry] = &[
    uniform("frame", "Frame", "number of the frame, seed, scene time"),
    uniform("seed", "Seed", "seed of what is random once, not in every frame"),
    uniform("scene_camera", "View", "the camera"),
    uniform("scene_info", "SceneInfo", "bounds, areas and counts of the scene at this time"),
    uniform("scene_sky", "Sky", "light of the sky at this time, W/(m² sr); black if the scene has none"),
    buffer("scene_lights", "Light", "all lights of all kinds at this time, world space; one dark light if there are none"),
    buffer(
        "scene_light_views",
        "LightView",
        "what the lights see, in their order: one view of a spot or directional light, six of a point light; a dark one if there are none",
    ),
    buffer("scene_vertices", "Vertex", "vertices of all meshes at this time, object space"),
    buffer("scene_triangles", "Triangle", "triangles of all objects at this time; those beyond `scene_info.triangle_count` have no area"),
    buffer("scene_objects", "Object", "transforms of all objects at this time"),
    buffer("scene_materials", "Material", "linear albedo, specular colour and exponent, texture of all materials"),
    buffer(
        "baked_corners",
        "vec2f",
        "where in an atlas of precomputed light all triangles are, in texels: six corners each, those of the front first; zero where they were not baked",
    ),
    buffer("baked_weights", "f32", "what each layer of `baked_light` is multiplied with at this time"),
];

const fn uniform(name: &'static str, element: &'static str, doc: &'static str) -> Entry {
    Entry { name, element, uniform: true, doc }
}

const fn buffer(name: &'static str, element: &'static str, doc: &'static str) -> Entry {
    Entry { name, element, uniform: false, doc }
}

/// Every external that this crate provides, for the registry: name, kind, documentation and the layout that Rust fills.
pub fn declarations() -> Vec<External> {
    let layouts: BTreeMap<&str, Layout> = gpu_data::layouts().into_iter().collect();
    let mut all: Vec<External> = ENTRIES
        .iter()
        .map(|e| External {
            name: e.name.to_owned(),
            kind: if e.uniform { PortKind::Uniform { of: e.element.to_owned() } } else { PortKind::Buffer { of: e.element.to_owned() } },
            doc: e.doc.to_owned(),
            layout: layouts.get(e.element).cloned(),
        })
        .collect();
    all.push(External {
        name: BAKED.to_owned(),
        kind: PortKind::Texture { format: Some(Format::Rgba16Float), array: true },
        doc: "precomputed light: mean, components, sky, one a layer; one black texel without a baked file".to_owned(),
        layout: None,
    });
    all.push(External {
        name: TEXTURES.to_owned(),
        kind: PortKind::Texture { format: Some(Format::Rgba8UnormSrgb), array: true },
        doc: "textures of the materials, one a layer, all of one size; one white texel if there are none".to_owned(),
        layout: None,
    });
    all
}

/// Sizes of the externals for a scene, as a plan needs them; no GPU is asked.
pub fn descriptions(scene: &Scene, baked: Option<&Baked>) -> BTreeMap<String, ResourceDesc> {
    let count = |name: &str| match name {
        "baked_corners" => baked.filter(|b| b.header.lookup == Lookup::Atlas).map_or(0, |_| CORNERS * scene.room.triangles),
        "baked_weights" => baked.map_or(0, |b| b.header.layers()),
        "scene_lights" => scene.lights.len(),
        "scene_light_views" => scene.light_view_count(),
        "scene_vertices" => scene.room.vertices,
        "scene_triangles" => scene.room.triangles,
        "scene_objects" => scene.objects.len(),
        _ => scene.materials.len(),
    };
    let describe = |e: &Entry| {
        let (element, size) = (e.element.to_owned(), size_of_element(e.element));
        if e.uniform {
            ResourceDesc::Uniform { element, size }
        } else {
            ResourceDesc::Buffer { element, stride: size, count: count(e.name).max(1) as u64 }
        }
    };
    let mut all: BTreeMap<_, _> = ENTRIES.iter().map(|e| (e.name.to_owned(), describe(e))).collect();
    let header = baked.map(|b| &b.header);
    all.insert(
        BAKED.to_owned(),
        ResourceDesc::Texture {
            format: Format::Rgba16Float,
            width: header.map_or(1, |h| h.width as u32),
            height: header.map_or(1, |h| h.height as u32),
            layers: header.map_or(1, |h| h.layers() as u32),
            array: true,
            mips: 1,
            encoding: Encoding::Plain,
        },
    );
    let textures = &scene.textures;
    all.insert(
        TEXTURES.to_owned(),
        ResourceDesc::Texture {
            format: Format::Rgba8UnormSrgb,
            width: textures.width,
            height: textures.height,
            layers: textures.layers(),
            array: true,
            mips: textures.levels.len() as u32,
            encoding: Encoding::Plain,
        },
    );
    all
}

fn size_of_element(element: &str) -> u32 {
    let size = match element {
        "Frame" => size_of::<Frame>(),
        "Seed" => size_of::<Seed>(),
        "View" => size_of::<View>(),
        "Light" => size_of::<Light>(),
        "LightView" => size_of::<LightView>(),
        "SceneInfo" => size_of::<SceneInfo>(),
        "Sky" => size_of::<gpu_data::Sky>(),
        "Vertex" => size_of::<gpu_data::Vertex>(),
        "Triangle" => size_of::<gpu_data::Triangle>(),
        "f32" => size_of::<f32>(),
        "vec2f" => size_of::<[f32; 2]>(),
        "Object" => size_of::<gpu_data::Object>(),
        _ => size_of::<gpu_data::Material>(),
    };
    size as u32
}

/// Puts a scene onto the GPU: static data once, the rest when it differs from what is there.
#[derive(Debug, Default)]
pub struct SceneUpload {
    /// Hash of the scene whose static data are on the GPU.
    scene: Option<u64>,
    /// Whether precomputed light is on the GPU.
    baked: bool,
    /// Bytes on the GPU of what may change from frame to frame.
    known: BTreeMap<&'static str, Vec<u8>>,
}

impl SceneUpload {
    /// Nothing uploaded yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Makes the externals hold the scene at one time, for a picture of width / height = `aspect`.
    ///
    /// # Errors
    /// A buffer or texture of the scene is larger than the device allows.
    pub fn upload(
        &mut self,
        gpu: &Gpu,
        externals: &mut Externals,
        scene: &Scene,
        state: &SceneState,
        frame: &Frame,
        aspect: f32,
    ) -> Result<(), Fault> {
        if self.scene != Some(scene.hash) {
            upload_static(gpu, externals, scene)?;
            self.scene = Some(scene.hash);
        }
        let camera = state.camera_view(aspect);
        let seed = Seed { value: frame.seed };
        let parts: [(&'static str, &[u8]); 8] = [
            ("frame", bytes_of(frame)),
            ("seed", bytes_of(&seed)),
            ("scene_camera", bytes_of(&camera)),
            ("scene_info", bytes_of(&state.info)),
            ("scene_sky", bytes_of(&state.sky)),
            ("scene_lights", cast_slice(&state.lights)),
            ("scene_light_views", cast_slice(&state.light_views)),
            ("scene_objects", cast_slice(&state.objects)),
        ];
        for (name, bytes) in parts {
            self.set(gpu, externals, name, bytes)?;
        }
        if scene.deforms() {
            self.set(gpu, externals, "scene_vertices", cast_slice(&scene.gpu_vertices_at(state)))?;
            self.set(gpu, externals, "scene_triangles", cast_slice(&scene.gpu_triangles_at(state)))?;
        }
        Ok(())
    }

    /// Makes the externals hold precomputed light at the time of a state; always the same light.
    ///
    /// # Errors
    /// Its texture is larger than the device allows.
    pub fn upload_baked(
        &mut self,
        gpu: &Gpu,
        externals: &mut Externals,
        baked: Option<&Baked>,
        scene: &Scene,
        state: &SceneState,
    ) -> Result<(), Fault> {
        if !self.baked || scene.deforms() {
            let atlas = baked.filter(|baked| baked.header.lookup == Lookup::Atlas);
            let corners = atlas.map_or_else(Vec::new, |baked| baked.corners_at(scene, state));
            self.set(gpu, externals, "baked_corners", cast_slice(&corners))?;
        }
        if !self.baked {
            upload_layers(gpu, externals, baked)?;
            self.baked = true;
        }
        let weights = baked.map_or_else(Vec::new, |baked| baked.weights_at(state.time, f64::from(state.sky.daylight)));
        self.set(gpu, externals, "baked_weights", cast_slice(&weights))
    }

    fn set(&mut self, gpu: &Gpu, externals: &mut Externals, name: &'static str, bytes: &[u8]) -> Result<(), Fault> {
        if self.known.get(name).is_some_and(|known| known == bytes) {
            return Ok(());
        }
        let Some(entry) = ENTRIES.iter().find(|e| e.name == name) else { return Ok(()) };
        if entry.uniform {
            externals.set_uniform(gpu, name, entry.element, bytes)?;
        } else {
            externals.set_buffer(gpu, name, entry.element, size_of_element(entry.element), bytes)?;
        }
        let known = self.known.entry(name).or_default();
        known.clear();
        known.extend_from_slice(bytes);
        Ok(())
    }
}

fn upload_static(gpu: &Gpu, externals: &mut Externals, scene: &Scene) -> Result<(), Fault> {
    let mut set = |name: &str, element: &str, bytes: &[u8]| externals.set_buffer(gpu, name, element, size_of_element(element), bytes);
    if !scene.deforms() {
        set("scene_vertices", "Vertex", cast_slice(&scene.gpu_vertices()))?;
        set("scene_triangles", "Triangle", cast_slice(&scene.gpu_triangles()))?;
    }
    set("scene_materials", "Material", cast_slice(&scene.gpu_materials()))?;
    let layers = texture_layers(scene);
    let layers: Vec<&[u8]> = layers.iter().map(Vec::as_slice).collect();
    let textures = &scene.textures;
    externals.set_texture_array(
        gpu,
        TEXTURES,
        TextureArray {
            format: Format::Rgba8UnormSrgb,
            width: textures.width,
            height: textures.height,
            mips: textures.levels.len() as u32,
            layers: &layers,
        },
    )
}

fn upload_layers(gpu: &Gpu, externals: &mut Externals, baked: Option<&Baked>) -> Result<(), Fault> {
    let layers: Vec<&[u8]> = baked.map_or_else(Vec::new, |baked| baked.layers().collect());
    let (width, height) = baked.map_or((1, 1), |baked| (baked.header.width as u32, baked.header.height as u32));
    externals.set_texture_array(gpu, BAKED, TextureArray { format: Format::Rgba16Float, width, height, mips: 1, layers: &layers })
}

/// The texels layer by layer with all levels of each; the scene has them level by level with all layers of each.
fn texture_layers(scene: &Scene) -> Vec<Vec<u8>> {
    let textures = &scene.textures;
    let count = textures.layers() as usize;
    let of_layer = |layer: usize| {
        textures.levels.iter().flat_map(move |level| {
            let size = level.len() / count;
            level[layer * size..(layer + 1) * size].iter().copied()
        })
    };
    (0..count).map(|layer| of_layer(layer).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_external_of_a_structure_has_its_layout_and_size() {
        for external in declarations() {
            match &external.kind {
                PortKind::Buffer { of } | PortKind::Uniform { of } => {
                    let is_plain = ["f32", "vec2f"].contains(&of.as_str());
                    let size = external.layout.as_ref().map(|layout| layout.size);
                    assert_eq!(size, (!is_plain).then(|| size_of_element(of)), "a layout for each structure: {of}");
                }
                PortKind::Texture { .. } => assert!(external.layout.is_none()),
            }
            assert!(!external.doc.is_empty());
        }
    }
}

//! Writes small glTF files.

use base64::{Engine as _, engine::general_purpose::STANDARD};
use manylight_graph::diagnostics::Diagnostics;
use manylight_scene::Scene;

use crate::memory::load;

/// Component types.
pub const U8: u32 = 5121;
pub const U16: u32 = 5123;
pub const U32: u32 = 5125;
pub const F32: u32 = 5126;

/// Buffers and accessors of a file; the rest is JSON text.
#[derive(Default, Clone)]
pub struct Doc {
    pub bin: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Doc {
    /// A buffer view of these bytes.
    pub fn view(&mut self, bytes: &[u8], more: &str) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.views.push(format!("{{\"buffer\":0,\"byteOffset\":{},\"byteLength\":{}{more}}}", self.bin.len(), bytes.len()));
        self.bin.extend(bytes);
        self.views.len() - 1
    }

    /// An accessor of these bytes.
    pub fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize, more: &str) -> usize {
        let view = self.view(bytes, "");
        self.raw(&format!("\"bufferView\":{view},\"componentType\":{component},\"type\":\"{kind}\",\"count\":{count}{more}"))
    }

    /// An accessor as written.
    pub fn raw(&mut self, fields: &str) -> usize {
        self.accessors.push(format!("{{{fields}}}"));
        self.accessors.len() - 1
    }

    /// An accessor of numbers; `kind` has as many as `values` has a row.
    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(&bytes, F32, kind, values.len(), "")
    }

    /// An accessor of indices.
    pub fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        self.accessor(&bytes, U16, "SCALAR", indices.len(), "")
    }

    fn json(&self, rest: &str, uri: &str) -> String {
        format!(
            "{{\"asset\":{{\"version\":\"2.0\"}},\"buffers\":[{{{uri}\"byteLength\":{}}}],\"bufferViews\":[{}],\"accessors\":[{}],{rest}}}",
            self.bin.len(),
            self.views.join(","),
            self.accessors.join(",")
        )
    }

    /// A text that holds its data.
    pub fn gltf(&self, rest: &str) -> String {
        self.json(rest, &format!("\"uri\":\"data:application/octet-stream;base64,{}\",", STANDARD.encode(&self.bin)))
    }

    /// A text whose data lies beside it.
    pub fn beside(&self, rest: &str, uri: &str) -> String {
        self.json(rest, &format!("\"uri\":\"{uri}\","))
    }

    /// A binary file.
    pub fn glb(&self, rest: &str) -> Vec<u8> {
        glb(self.json(rest, "").as_bytes(), Some(&self.bin))
    }
}

/// A binary file of these chunks.
pub fn glb(json: &[u8], bin: Option<&[u8]>) -> Vec<u8> {
    let mut chunks = Vec::new();
    let mut chunk = |kind: &[u8; 4], bytes: &[u8], filler: u8| {
        let length = bytes.len().next_multiple_of(4);
        chunks.extend((length as u32).to_le_bytes());
        chunks.extend(kind);
        chunks.extend(bytes);
        chunks.extend(std::iter::repeat_n(filler, length - bytes.len()));
    };
    chunk(b"JSON", json, b' ');
    if let Some(bin) = bin {
        chunk(b"BIN\0", bin, 0);
    }
    let mut out = b"glTF".to_vec();
    out.extend(2_u32.to_le_bytes());
    out.extend((12 + chunks.len() as u32).to_le_bytes());
    out.extend(chunks);
    out
}

/// A triangle of area 0.5 in the xy plane, as accessor 0.
pub fn triangle() -> Doc {
    let mut doc = Doc::default();
    doc.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    doc
}

/// The rest of a file with one mesh of accessor 0, shown by node 0.
pub const ONE: &str =
    "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"material\":0}]}],\"materials\":[{}],\"nodes\":[{\"mesh\":0}]";

/// Loads a text.
pub fn gltf(text: &str) -> Result<Scene, Diagnostics> {
    load("a.gltf", &[("a.gltf", text)])
}

/// The corners of all triangles in the world at a time.
pub fn corners(scene: &Scene, time: f64) -> Vec<[glam::DVec3; 3]> {
    let of = |object: &manylight_scene::SceneObject| {
        let (mesh, matrix) = (&scene.meshes[object.mesh], object.pose.at(time).world_from_object());
        mesh.triangles.iter().map(|triangle| mesh.corners(triangle).map(|corner| matrix.transform_point3(corner))).collect::<Vec<_>>()
    };
    scene.objects.iter().flat_map(of).collect()
}

//! Structures that shaders read, laid out as `shaders/common/scene.wgsl`, `points.wgsl` and `texels.wgsl` declare them.
//!
//! [`layouts`] describes them from Rust, so that whoever loads a shader can compare them with what reflection says of the WGSL.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Mat4, Vec3, Vec4};
use manylight_graph::shader::{Layout, Member, MemberKind, Scalar};

use crate::bvh::{BvhNode, BvhTriangle};

/// A pinhole camera, or a light seen as a camera, whose rays may be parallel. World space, right-handed; all vectors have unit length.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct View {
    /// Reverse z without a far plane: 1 at `near`, 0 at infinity; y up. Of parallel rays: 1 where they start, 0 at `far`.
    pub clip_from_world: Mat4,
    /// The eye. Of parallel rays: the middle of the square where they start.
    pub origin: Vec3,
    /// Distance of the near plane; 0 for parallel rays.
    pub near: f32,
    /// To the right of the picture.
    pub right: Vec3,
    /// Tangent of half the horizontal field of view. Of parallel rays: half the width of the picture, in the units of the world.
    pub tan_half_x: f32,
    /// To the top of the picture.
    pub up: Vec3,
    /// Tangent of half the vertical field of view. Of parallel rays: half the height of the picture.
    pub tan_half_y: f32,
    /// Into the picture.
    pub forward: Vec3,
    /// A distance beyond everything in the scene.
    pub far: f32,
}

/// How a spot light darkens between its beam and its cut-off.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[repr(u32)]
pub enum Falloff {
    /// Linear in the angle.
    #[default]
    Linear = 0,
    /// `cos θ / cos(cutoff)` up to the cut-off: brighter than 1 inside (ACRSM fig. 5.1).
    Cosine = 1,
    /// A smooth step in the angle.
    Smooth = 2,
}

/// Where a light's rays come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum LightKind {
    /// A point, in a cone.
    Spot = 0,
    /// A point, in all directions alike.
    Point = 1,
    /// Far away: they are parallel.
    Directional = 2,
}

/// A light.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Light {
    /// World space. Of a directional light: the middle of a disk across its rays, before the scene and as wide as all of it.
    pub position: Vec3,
    /// A [`LightKind`].
    pub kind: u32,
    /// Unit vector along the axis of a spot light, and along the rays of a directional one.
    pub direction: Vec3,
    /// A [`Falloff`], of a spot light.
    pub falloff: u32,
    /// Intensity along the axis in W/sr. Of a directional light: irradiance of a surface that faces it, in W/m².
    pub strength: Vec3,
    /// Half-angle of full intensity; π for a point light.
    pub beam_rad: f32,
    /// Half-angle beyond which it is dark; π for a point light.
    pub cutoff_rad: f32,
    /// Of a directional light's disk.
    pub radius: f32,
    /// Its part of the power of all lights: the probability with which a path tracer sends a ray from it.
    pub share: f32,
    /// `share` over what its rays are spread over: the solid angle of the cone or sphere in sr, or the area of the disk in m².
    pub ray_density: f32,
}

/// A light, or a sixth of one, as a camera with a square picture: a cell of the reflective shadow map.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct LightView {
    /// The camera; its rays are parallel for a directional light.
    pub view: View,
    /// Index of the [`Light`].
    pub light: u32,
    /// The light's [`LightKind`].
    pub kind: u32,
    /// Of a point light, whose six views follow each other: towards +x, −x, +y, −y, +z, −z; 0 for other lights.
    pub face: u32,
    /// What a texel of it can reflect, over the same of the view where that is most.
    pub weight: f32,
}

/// Light of the sky at one time: what a ray meets that leaves the scene, W/(m² sr).
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Sky {
    /// Radiance straight above.
    pub zenith: Vec3,
    /// Share of its light that the sky has at this time; the radiances have it in them.
    pub daylight: f32,
    /// Radiance at the horizon.
    pub horizon: Vec3,
    /// From horizon to zenith radiance is mixed by the sine of the elevation to this power.
    pub exponent: f32,
    /// Radiance below the horizon.
    pub ground: Vec3,
    /// 0 if all of it is black.
    pub is_lit: u32,
}

/// Counters and sizes of the frame.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct Frame {
    /// Frames since the last reset.
    pub index: u32,
    /// Seed of everything random.
    pub seed: u32,
    /// Scene time in seconds.
    pub time: f32,
    /// Seconds since the frame before.
    pub delta_time: f32,
}

/// Seed of what is random once, not in every frame.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct Seed {
    /// Any number.
    pub value: u32,
}

/// Extent and statistics of the scene in world space at one time.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct SceneInfo {
    /// Least corner of the bounding box.
    pub bounds_min: Vec3,
    /// Diagonal of the bounding box.
    pub diagonal: f32,
    /// Greatest corner of the bounding box.
    pub bounds_max: Vec3,
    /// Surface of all triangles.
    pub total_area: f32,
    /// Area of the smallest triangle, before object transforms.
    pub area_min: f32,
    /// Area of the largest triangle, before object transforms.
    pub area_max: f32,
    /// Shortest edge, before object transforms.
    pub edge_min: f32,
    /// Longest edge, before object transforms.
    pub edge_max: f32,
    /// Triangles of all objects.
    pub triangle_count: u32,
    /// Objects.
    pub object_count: u32,
    /// Lights.
    pub light_count: u32,
    /// Layers of the texture array that hold textures.
    pub texture_count: u32,
}

/// A vertex in object space.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Vertex {
    /// Object space.
    pub position: Vec3,
    /// Texture coordinate to the right.
    pub u: f32,
    /// Shading normal of unit length; zero: use the flat normal of the triangle.
    pub normal: Vec3,
    /// Texture coordinate **downwards** (an OBJ's `vt` counts upwards: v = 1 − vt.y), so that (0, 0) is the first texel in memory.
    pub v: f32,
}

/// A triangle of an object.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct Triangle {
    /// First vertex.
    pub a: u32,
    /// Second vertex.
    pub b: u32,
    /// Third vertex.
    pub c: u32,
    /// Index of the [`Object`].
    pub object: u32,
    /// Index of the [`Material`].
    pub material: u32,
}

/// Where an object is.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Object {
    /// Affine.
    pub world_from_object: Mat4,
    /// Inverse transpose up to a positive factor; the upper left 3×3 counts.
    pub normal_from_object: Mat4,
}

/// [`Material::diffuse_texture`] of a material without a texture.
pub const NO_TEXTURE: u32 = u32::MAX;

/// A surface: Lambert and Blinn.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Material {
    /// Linear albedo, Kd.
    pub diffuse: Vec3,
    /// Layer of the texture array, or [`NO_TEXTURE`].
    pub diffuse_texture: u32,
    /// Linear, Ks.
    pub specular: Vec3,
    /// Blinn exponent, Ns.
    pub shininess: f32,
}

/// A point that stands for a piece of surface in imperfect shadow maps.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ScenePoint {
    /// Object space.
    pub position: Vec3,
    /// The surface it stands for, in square world units at time 0.
    pub area: f32,
    /// Unit geometric normal, object space.
    pub normal: Vec3,
    /// Index of the [`Object`].
    pub object: u32,
}

/// [`SurfaceTexel::triangle`] of a texel without a surface.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// A texel of an atlas over the surfaces of the scene: world space, normals of the side whose light it holds.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct SurfaceTexel {
    /// A point of the triangle.
    pub position: Vec3,
    /// Index of the [`Triangle`], or [`NO_TRIANGLE`].
    pub triangle: u32,
    /// Unit vector; smooth where the surface is.
    pub normal: Vec3,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Unit vector; the triangle's own.
    pub geometric: Vec3,
    /// Barycentric weight of the third corner.
    pub v: f32,
}

impl View {
    /// The perspective view of an eye at `origin` that looks at `target`.
    ///
    /// forward = normalize(target − origin), right = normalize(forward × up), up' = right × forward. `fov_x_rad` is the full
    /// horizontal angle, `aspect` width over height. Clip space is wgpu's: y up, depth 1 at `near` and 0 at infinity. Where the
    /// eye is on its target or looks along `up`, another axis is taken, so that the view is always a valid one.
    ///
    /// Computed in 64 bits and rounded once.
    pub fn perspective(origin: Vec3, target: Vec3, up: Vec3, fov_x_rad: f32, aspect: f32, near: f32, far: f32) -> Self {
        let forward = (target.as_dvec3() - origin.as_dvec3()).try_normalize().unwrap_or(DVec3::NEG_Z);
        let tan_half_x = (f64::from(fov_x_rad) / 2.0).tan();
        Self::along(origin, forward, up, [tan_half_x, tan_half_x / f64::from(aspect)], near, far)
    }

    /// The same along a unit vector, with the tangents of half the angles.
    pub(crate) fn along(origin: Vec3, forward: DVec3, up: Vec3, tan_half: [f64; 2], near: f32, far: f32) -> Self {
        let axes @ [right, up, forward] = basis(forward, up.as_dvec3());
        let eye = origin.as_dvec3();
        let row = |axis: DVec3| axis.extend(-axis.dot(eye)).as_vec4();
        let rows = [row(right / tan_half[0]), row(up / tan_half[1]), Vec4::new(0.0, 0.0, 0.0, near), row(forward)];
        Self::of_rows(rows, origin, axes, tan_half, [near, far])
    }

    /// Parallel rays along a unit vector, from a square of this half width around `origin`, of this length.
    pub(crate) fn parallel(origin: Vec3, forward: DVec3, half_width: f64, length: f64) -> Self {
        let axes @ [right, up, forward] = basis(forward, DVec3::Y);
        let eye = origin.as_dvec3();
        let row = |axis: DVec3, offset: f64| axis.extend(offset - axis.dot(eye)).as_vec4();
        let rows = [row(right / half_width, 0.0), row(up / half_width, 0.0), row(-forward / length, 1.0), Vec4::W];
        Self::of_rows(rows, origin, axes, [half_width; 2], [0.0, length as f32])
    }

    fn of_rows(rows: [Vec4; 4], origin: Vec3, axes: [DVec3; 3], half: [f64; 2], [near, far]: [f32; 2]) -> Self {
        let [right, up, forward] = axes.map(|axis| axis.as_vec3());
        let [tan_half_x, tan_half_y] = half.map(|half| half as f32);
        let clip_from_world = Mat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
        Self { clip_from_world, origin, near, right, tan_half_x, up, tan_half_y, forward, far }
    }
}

/// Right, up and forward of an eye. Defined for every `up`: see [`View::perspective`].
fn basis(forward: DVec3, up: DVec3) -> [DVec3; 3] {
    let right = [up, DVec3::Y, DVec3::Z, DVec3::X]
        .into_iter()
        .filter_map(DVec3::try_normalize)
        .map(|up| forward.cross(up))
        .find(|right| right.length_squared() > SMALLEST_SINE * SMALLEST_SINE)
        .map_or(DVec3::X, DVec3::normalize);
    [right, right.cross(forward), forward]
}

/// Sine of the angle to `up` below which a view counts as looking along it: the picture's roll would be rounding noise.
const SMALLEST_SINE: f64 = 1e-6;

/// A Rust type with a WGSL counterpart.
trait WgslType {
    /// Its WGSL type.
    fn kind() -> MemberKind;
}

/// A scalar, vector or matrix.
const fn numeric(scalar: Scalar, rows: u32, columns: u32, column_stride: u32) -> MemberKind {
    MemberKind::Numeric { scalar, rows, columns, column_stride }
}

impl WgslType for f32 {
    fn kind() -> MemberKind {
        numeric(Scalar::F32, 1, 1, 0)
    }
}

impl WgslType for u32 {
    fn kind() -> MemberKind {
        numeric(Scalar::U32, 1, 1, 0)
    }
}

impl WgslType for Vec3 {
    fn kind() -> MemberKind {
        numeric(Scalar::F32, 3, 1, 0)
    }
}

impl WgslType for Mat4 {
    fn kind() -> MemberKind {
        numeric(Scalar::F32, 4, 4, 16)
    }
}

impl WgslType for View {
    fn kind() -> MemberKind {
        MemberKind::Struct("View".to_owned())
    }
}

/// The WGSL type of a member's value.
fn kind_of<T: WgslType>(_: &T) -> MemberKind {
    T::kind()
}

/// The name and layout of a structure. A member that is left out does not compile.
macro_rules! layout {
    ($name:ident { $($member:ident),* }) => {{
        let $name { $($member),* } = $name::zeroed();
        let members = vec![$(Member {
            name: stringify!($member).to_owned(),
            offset: std::mem::offset_of!($name, $member) as u32,
            kind: kind_of(&$member),
        }),*];
        (stringify!($name), Layout { size: size_of::<$name>() as u32, members })
    }};
}

/// The names and layouts of all structures of this module that shaders read.
pub fn layouts() -> Vec<(&'static str, Layout)> {
    vec![
        layout!(BvhNode { low, first, high, count }),
        layout!(BvhTriangle { a, index, ab, material, ac, object }),
        layout!(View { clip_from_world, origin, near, right, tan_half_x, up, tan_half_y, forward, far }),
        layout!(Light { position, kind, direction, falloff, strength, beam_rad, cutoff_rad, radius, share, ray_density }),
        layout!(LightView { view, light, kind, face, weight }),
        layout!(Sky { zenith, daylight, horizon, exponent, ground, is_lit }),
        layout!(Frame { index, seed, time, delta_time }),
        layout!(Seed { value }),
        layout!(SceneInfo {
            bounds_min,
            diagonal,
            bounds_max,
            total_area,
            area_min,
            area_max,
            edge_min,
            edge_max,
            triangle_count,
            object_count,
            light_count,
            texture_count
        }),
        layout!(Vertex { position, u, normal, v }),
        layout!(Triangle { a, b, c, object, material }),
        layout!(Object { world_from_object, normal_from_object }),
        layout!(Material { diffuse, diffuse_texture, specular, shininess }),
        layout!(ScenePoint { position, area, normal, object }),
        layout!(SurfaceTexel { position, triangle, normal, u, geometric, v }),
    ]
}

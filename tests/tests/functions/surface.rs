//! What rasterization stores of surfaces. It samples textures, which only fragments can: a draw over as many pixels as there are inputs calls it.

use std::fmt::Write as _;

use glam::{DVec2, DVec3, Mat4, Quat, Vec3};
use manylight_graph::value::Format;
use manylight_scene::gpu_data::{Material, NO_TEXTURE, Object, Triangle, Vertex};
use proptest::strategy::Strategy;

use super::{
    directions::v3,
    harness::{Case, Outcome, Resource, Want, World, absolute, check, judge, ulps, values, values_of},
    inputs::{Numbers, draw, index, join, magnitude, one_of, unit_interval, unit_vector, vector},
};

/// All cases of this theme that are calls.
pub fn cases() -> Vec<Case> {
    vec![corner()]
}

/// The function of this theme that is drawn.
pub const DRAWN: &str = "surface::describe_surface";

fn vertices() -> Vec<Vertex> {
    let at = |i: u32| {
        let f = |k: u32| (super::random::hash(16 * i + k) % 2001) as f32 / 1000.0 - 1.0;
        let normal = if i.is_multiple_of(4) { Vec3::ZERO } else { Vec3::new(f(3), f(4), f(5)).normalize_or(Vec3::Y) };
        Vertex { position: Vec3::new(f(0), f(1), f(2)), u: f(6), normal, v: f(7) }
    };
    (0..30).map(at).collect()
}

fn triangles() -> Vec<Triangle> {
    let mut all: Vec<Triangle> =
        (0..20).map(|i| Triangle { a: i, b: (i * 7 + 3) % 30, c: (i * 11 + 5) % 30, object: i % 3, material: i % 5 }).collect();
    // No area.
    all.push(Triangle { a: 1, b: 1, c: 2, object: 0, material: 0 });
    all
}

fn objects() -> Vec<Object> {
    let of = |m: Mat4| Object { world_from_object: m, normal_from_object: m.inverse().transpose() };
    let turned = Mat4::from_scale_rotation_translation(Vec3::new(1.0, 2.0, -0.5), Quat::from_rotation_y(1.0), Vec3::new(10.0, -5.0, 3.0));
    vec![of(Mat4::IDENTITY), of(turned), of(Mat4::from_scale(Vec3::splat(1e3)))]
}

fn corner() -> Case {
    let (v, t, o) = (vertices(), triangles(), objects());
    Case::new("surface::corner_in_world", "index: u32")
        .before("let corner = corner_in_world(index);")
        .also("vec3f", "corner.world")
        .also("vec3f", "corner.normal")
        .also("vec2f", "corner.uv")
        .also("vec3f", "corner.flat_normal")
        .also("u32", "corner.material")
        .reads(&[
            Resource::buffer("scene_vertices", "Vertex", &v),
            Resource::buffer("scene_triangles", "Triangle", &t),
            Resource::buffer("scene_objects", "Object", &o),
        ])
        .edges((0..3 * t.len()).map(|i| vec![i as f64]))
        .twin(ulps(8.0, "a matrix times a vector; a cross product of differences"), move |i| {
            let (triangle, place) = (t[i[0] as usize / 3], i[0] as usize % 3);
            let corners = [triangle.a, triangle.b, triangle.c].map(|vertex| v[vertex as usize]);
            let [a, b, c] = corners.map(|vertex| vertex.position.as_dvec3());
            let [world, normals] =
                [o[triangle.object as usize].world_from_object, o[triangle.object as usize].normal_from_object].map(|m| m.as_dmat4());
            let vertex = &corners[place];
            let size = normals.col(0).truncate().length().max(normals.col(1).truncate().length()).max(normals.col(2).truncate().length());
            let position = world.transform_point3(vertex.position.as_dvec3());
            let reach = world.transform_vector3(DVec3::ONE).length() + world.col(3).truncate().length();
            let flat = normals.transform_vector3((b - a).cross(c - a));
            let mut all = values_of(position.to_array(), reach);
            all.extend(values_of(normals.transform_vector3(vertex.normal.as_dvec3()).to_array(), size));
            all.extend(values([f64::from(vertex.u), f64::from(vertex.v)]));
            all.extend(values_of(flat.to_array(), size * 8.0));
            all.push(Want::new(triangle.material.into()));
            all
        })
}

const WIDTH: u32 = 64;

fn materials() -> Vec<Material> {
    let plain = Material { diffuse: Vec3::new(0.8, 0.4, 0.2), diffuse_texture: NO_TEXTURE, specular: Vec3::ZERO, shininess: 1.0 };
    vec![
        plain,
        Material { specular: Vec3::new(0.5, 0.25, 0.125), shininess: 1000.0, ..plain },
        Material { diffuse: Vec3::ONE, diffuse_texture: 0, ..plain },
        Material { diffuse: Vec3::splat(0.5), diffuse_texture: 1, ..plain },
    ]
}

/// Normal, flat normal, place in the texture, material, to the viewer, distance.
fn inputs() -> Vec<Vec<f64>> {
    let normal = || proptest::prop_oneof![1 => one_of(&[0.0]).prop_map(|_| vec![0.0; 3]), 5 => vector(1e-6, 1e3)].boxed();
    let strategy: Numbers = join([
        normal(),
        vector(1e-12, 1e6),
        unit_interval(),
        unit_interval(),
        index(4),
        join([unit_vector(), magnitude(1e-3, 1e4)]).prop_map(|v| v[..3].iter().map(|c| c * v[3]).collect()).boxed(),
        magnitude(1e-3, 1e4),
    ]);
    let mut all = draw(&strategy, 4096 - 2);
    // Nothing to go by; and normals that cancel.
    all.push([vec![0.0; 6], vec![0.5, 0.5, 0.0], vec![0.0, 0.0, 1.0, 1.0]].concat());
    all.push([vec![0.0; 3], vec![0.0, 0.0, -1e-12], vec![0.5, 0.5, 0.0], vec![0.0, 0.0, 1.0, 1.0]].concat());
    all.into_iter().map(|input| input.into_iter().map(|v| f64::from(v as f32)).collect()).collect()
}

#[test]
fn surfaces_are_as_their_twins() {
    check(cases());
    let inputs = inputs();
    let words: Vec<u32> = inputs.iter().flatten().map(|v| (*v as f32).to_bits()).collect();
    let texels = |layer: u32| -> Vec<u8> {
        (0..64)
            .flat_map(|texel| [0, 1, 2].map(|c| (super::random::hash(256 * layer + 4 * texel + c) % 256) as u8).into_iter().chain([255]))
            .collect()
    };
    let layers = [texels(0), texels(1)];
    let mut world = World::new(vec![
        Resource::buffer("arguments", "u32", &words),
        Resource::buffer("scene_materials", "Material", &materials()),
        Resource::texture_array("scene_textures", Format::Rgba8UnormSrgb, (8, 8), &layers),
    ]);
    let mut shader = format!(
        "#import common::surface::{{Corner, Surface, describe_surface}}
@group(0) @binding(0) var<storage, read> arguments: array<u32>;
@vertex fn cover(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {{
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.5, 1.0);
}}
fn number(pixel: vec4f, at: u32) -> f32 {{ return bitcast<f32>(arguments[(u32(pixel.y) * {WIDTH}u + u32(pixel.x)) * 13u + at]); }}
@fragment fn describe(@builtin(position) at: vec4f) -> Surface {{
    var corner: Corner;\n"
    );
    let parts = [("normal", 0, 3), ("flat_normal", 3, 3), ("uv", 6, 2), ("material", 8, 1)];
    for (name, first, width) in parts {
        for k in 0..width {
            let place = if width > 1 { format!("[{k}]") } else { String::new() };
            let value = format!("number(at, {}u)", first + k);
            let value = if name == "material" { format!("u32({value})") } else { value };
            writeln!(shader, "    corner.{name}{place} = {value};").expect("a string");
        }
    }
    shader.push_str(
        "    return describe_surface(corner, vec3f(number(at, 9u), number(at, 10u), number(at, 11u)), number(at, 12u), true);\n}\n",
    );
    world.add("shaders/test/draw.wgsl", &shader);
    world.add(
        "shaders/test/draw.ron",
        r#"Node(doc: "Draws surfaces.", inputs: {"arguments": Buffer(of: "u32", doc: "of all calls"),
            "scene_materials": Buffer(of: "Material", doc: "test data"), "scene_textures": Texture(format: Rgba8UnormSrgb, array: true, doc: "test data")},
            outputs: {"albedo": Texture(format: Rgba32Float, doc: "a"), "specular": Texture(format: Rgba32Float, doc: "b"),
            "normal": Texture(format: R32Uint, doc: "c"), "distance": Texture(format: R32Float, doc: "d")},
            steps: [Draw(vertex: "cover", fragment: "describe", vertices: 3, targets: ["albedo", "specular", "normal", "distance"])])"#,
    );
    let size = format!("size: Fixed({WIDTH}, {})", inputs.len() as u32 / WIDTH);
    world.add(
        "pipelines/test.ron",
        &format!(
            "Pipeline(doc: \"t\", resources: {{\"albedo\": Texture(format: Rgba32Float, {size}), \"specular\": Texture(format: Rgba32Float, {size}),
            \"normal\": Texture(format: R32Uint, {size}, encoding: Octahedral), \"distance\": Texture(format: R32Float, {size})}},
            nodes: [(id: \"draw\", node: \"test/draw\")], presents: \"albedo\")"
        ),
    );
    let ran = world.run(DRAWN, &["albedo", "specular", "normal", "distance"]);
    let [albedo, specular, normal, distance] = ["albedo", "specular", "normal", "distance"].map(|name| ran.image(name));
    let channels = |image: &manylight_gpu::Image| image.data.len() / inputs.len();
    let mut outcome = Outcome::new(
        DRAWN,
        absolute(1e-4, "the normal is stored with 16 bits a component; textures apart, which are interpolated in steps of 1/256"),
    );
    for (n, input) in inputs.iter().enumerate() {
        let mut got: Vec<f64> = Vec::new();
        for image in [&albedo, &specular, &normal, &distance] {
            let width = channels(image);
            got.extend(image.data[n * width..(n + 1) * width].iter().map(|v| f64::from(*v)));
        }
        outcome.add(&describe(input, &layers, channels(&normal), channels(&distance)), &got, || format!("{input:?}"));
    }
    judge(vec![outcome]);
}

fn describe(i: &[f64], layers: &[Vec<u8>], normal_channels: usize, distance_channels: usize) -> Vec<Want> {
    let (smooth, flat, to_viewer) = (v3(i), v3(&i[3..]), v3(&i[9..]));
    let material = &materials()[i[8] as usize];
    let mut all: Vec<Want> = if material.diffuse_texture == NO_TEXTURE {
        values(material.diffuse.as_dvec3().to_array())
    } else {
        let tint = texture(&layers[material.diffuse_texture as usize], DVec2::new(i[6], i[7]));
        (material.diffuse.as_dvec3() * tint).to_array().map(|v| Want::Between(v - 0.012, v + 0.012)).to_vec()
    };
    all.push(Want::new(1.0));
    all.extend(values(material.specular.as_dvec3().to_array()));
    all.push(Want::Between(f64::from(material.shininess), f64::from(material.shininess)));
    // The smooth normal, or else the flat one, on the side of the flat one that is seen.
    let chosen = if smooth.length_squared() > 0.0 { smooth } else { flat };
    let side = if flat.dot(to_viewer) >= 0.0 { flat } else { -flat };
    let facing = if chosen.dot(side) >= 0.0 { chosen } else { -chosen };
    // Edge-on rounding decides, and without any normal there is none.
    let is_certain = chosen.length() > 0.0
        && chosen.normalize().dot(flat.normalize_or_zero()).abs() > 1e-5
        && flat.normalize_or_zero().dot(to_viewer.normalize()).abs() > 1e-5
        && chosen.length() > 1e-18;
    let wanted = if is_certain { values(facing.normalize().to_array()) } else { vec![Want::Between(-1.01, 1.01); 3] };
    all.extend(wanted);
    all.extend(vec![Want::finite(); normal_channels - 3]);
    all.push(Want::of(i[12], 1.0));
    all.extend(vec![Want::finite(); distance_channels - 1]);
    all
}

/// Eight texels a side, repeated.
fn texture(texels: &[u8], uv: DVec2) -> DVec3 {
    let p = uv * 8.0 - 0.5;
    let (low, share) = (p.floor(), p - p.floor());
    let at = |dx: f64, dy: f64| {
        let (x, y) = ((low.x + dx).rem_euclid(8.0) as usize, (low.y + dy).rem_euclid(8.0) as usize);
        DVec3::from_array([0, 1, 2].map(|c| {
            let v = f64::from(texels[4 * (8 * y + x) + c]) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        }))
    };
    at(0.0, 0.0).lerp(at(1.0, 0.0), share.x).lerp(at(0.0, 1.0).lerp(at(1.0, 1.0), share.x), share.y)
}

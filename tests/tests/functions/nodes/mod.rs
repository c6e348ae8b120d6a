//! Formulas that live in one node each, through the node itself on small inputs.

mod clusters;
mod picture;
mod shadows;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec2, Vec3};

use super::random::hash;

/// A number of [0, 1) that looks random.
pub fn noise(seed: u32) -> f64 {
    f64::from(hash(seed) >> 8) / f64::from(1 << 24)
}

pub fn pipeline(resources: &str, nodes: &str, presents: &str) -> String {
    format!("Pipeline(doc: \"One node.\", resources: {{{resources}}}, nodes: [{nodes}], presents: \"{presents}\")")
}

/// A code of a unit vector, with steps of 1/32767.
pub fn code(unit: DVec3) -> u32 {
    let p = unit / unit.abs().element_sum();
    assert!(unit.z >= 0.0, "the upper half is enough here");
    let part = |v: f64| (v * 32_767.0).round() as i16 as u16;
    match u32::from(part(p.x)) | u32::from(part(p.y)) << 16 {
        0 => 0x8000,
        code => code,
    }
}

/// As `common::cluster` declares it.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Cluster {
    pub position: Vec3,
    pub area: f32,
    pub normal: Vec3,
    pub importance: f32,
    pub flux: Vec3,
    pub count: u32,
    pub texel: Vec2,
    pub state: u32,
    pub generation: u32,
    pub delta: f32,
    pub delta_mean: f32,
    pub cancelled: u32,
    pub rank: u32,
}

//! Animations: curves of nodes' translations, rotations and scales.

use std::collections::HashMap;

use glam::{DQuat, DVec3, DVec4};
use gltf::json::{
    Index,
    accessor::Accessor,
    animation::{Interpolation, Property, Sampler},
    validation::Checked,
};

use super::{
    document::Model,
    losses::Losses,
    nodes::unit,
    transform::{Transform, Trs},
};

/// How long before its time a step begins, in seconds: motion of the scene has no steps.
pub(super) const STEP: f64 = 1e-6;

/// Values over time; rotations as quaternions, other vectors without a fourth number.
struct Curve {
    times: Vec<f64>,
    values: Vec<DVec4>,
    /// Of cubic splines: slopes before and after each key.
    slopes: Vec<(DVec4, DVec4)>,
    step: bool,
    rotation: bool,
}

impl Curve {
    fn at(&self, time: f64) -> DVec4 {
        let next = self.times.partition_point(|key| *key <= time);
        if next == 0 {
            return self.values[0];
        }
        let last = next - 1;
        if next == self.times.len() || self.step {
            return self.values[last];
        }
        let length = self.times[next] - self.times[last];
        let t = (time - self.times[last]) / length;
        let (a, b) = (self.values[last], self.values[next]);
        if let (Some((_, out)), Some((into, _))) = (self.slopes.get(last), self.slopes.get(next)) {
            let (t2, t3) = (t * t, t * t * t);
            return a * (2.0 * t3 - 3.0 * t2 + 1.0)
                + *out * (length * (t3 - 2.0 * t2 + t))
                + b * (3.0 * t2 - 2.0 * t3)
                + *into * (length * (t3 - t2));
        }
        if self.rotation { DVec4::from(DQuat::from_vec4(a).slerp(DQuat::from_vec4(b), t)) } else { a.lerp(b, t) }
    }

    /// Times at which its course changes.
    fn breaks(&self) -> Vec<f64> {
        let before = self.times.iter().filter(|_| self.step).map(|time| time - STEP);
        self.times.iter().copied().chain(before).collect()
    }
}

#[derive(Default)]
struct NodeCurves {
    translate: Option<Curve>,
    rotate: Option<Curve>,
    scale: Option<Curve>,
}

/// The curves of all nodes, of all animations together.
#[derive(Default)]
pub(super) struct Curves {
    nodes: HashMap<usize, NodeCurves>,
    end: f64,
}

impl Curves {
    /// Reads all animations. Those with faults are left out.
    pub(super) fn read(model: &Model<'_>, losses: &mut Losses) -> Self {
        let mut curves = Self::default();
        for (a, animation) in model.root.animations.iter().enumerate() {
            for (c, channel) in animation.channels.iter().enumerate() {
                let at = format!("animations[{a}].channels[{c}]");
                let (Checked::Valid(property), Some(sampler)) = (channel.target.path, animation.samplers.get(channel.sampler.value()))
                else {
                    continue;
                };
                if property == Property::MorphTargetWeights {
                    losses.add(at, "animations of morph targets are left out", "export key frames as one OBJ file each");
                    continue;
                }
                let curve = match read(model, sampler, property == Property::Rotation) {
                    Ok(curve) => curve,
                    Err(reason) => {
                        losses.add(at, format!("{reason}: what it animates stays at rest"), "export the animation again");
                        continue;
                    }
                };
                let node = curves.nodes.entry(channel.target.node.value()).or_default();
                let place = match property {
                    Property::Translation => &mut node.translate,
                    Property::Rotation => &mut node.rotate,
                    _ => &mut node.scale,
                };
                if place.is_some() {
                    losses.add(at, "of several animations of the same the first is shown", "save each in a file of its own");
                    continue;
                }
                curves.end = curve.times.last().copied().unwrap_or(0.0).max(curves.end);
                *place = Some(curve);
            }
        }
        curves
    }

    pub(super) fn has(&self, node: usize) -> bool {
        self.nodes.contains_key(&node)
    }

    /// From 0 to the last key of all.
    pub(super) fn span(&self) -> (f64, f64) {
        (0.0, self.end)
    }

    pub(super) fn breaks(&self, node: usize) -> Vec<f64> {
        let Some(curves) = self.nodes.get(&node) else { return Vec::new() };
        [&curves.translate, &curves.rotate, &curves.scale].into_iter().flatten().flat_map(Curve::breaks).collect()
    }

    /// Where a node is in its parent's space at a time.
    pub(super) fn local(&self, node: usize, at_rest: &Transform, time: f64) -> Transform {
        let Some(curves) = self.nodes.get(&node) else { return *at_rest };
        let rest = at_rest.without_shear().0;
        let vector = |curve: &Option<Curve>, rest: DVec3| curve.as_ref().map_or(rest, |curve| curve.at(time).truncate());
        let rotate = curves.rotate.as_ref().and_then(|curve| unit(DQuat::from_vec4(curve.at(time))));
        Transform::Trs(Trs {
            translate: vector(&curves.translate, rest.translate),
            rotate: rotate.unwrap_or(rest.rotate),
            scale: vector(&curves.scale, rest.scale),
        })
    }
}

/// Reads a curve.
fn read(model: &Model<'_>, sampler: &Sampler, rotation: bool) -> Result<Curve, String> {
    let times: Vec<f64> = model.floats::<1>(sampler.input)?.into_iter().map(|[time]| f64::from(time)).collect();
    if times.is_empty() {
        return Err("an animation has no key frame".to_owned());
    }
    // Two keys of a step need some room.
    let ordered = times.windows(2).all(|pair| pair[1] - pair[0] > 2.0 * STEP);
    if !ordered || !times.iter().all(|time| (0.0..=1e9).contains(time)) {
        return Err("the times of key frames do not increase from 0".to_owned());
    }
    let cubic = matches!(sampler.interpolation, Checked::Valid(Interpolation::CubicSpline));
    let values = values(model, sampler.output, rotation)?;
    let wanted = times.len() * if cubic { 3 } else { 1 };
    if values.len() != wanted {
        return Err(format!("an animation has {} values for {} key frames", values.len(), times.len()));
    }
    if !values.iter().all(|value| value.is_finite()) {
        return Err("an animation has values that are not finite".to_owned());
    }
    let key = |value: DVec4| {
        if rotation {
            unit(DQuat::from_vec4(value)).map(DVec4::from).ok_or("an animation has a rotation that is no unit quaternion")
        } else {
            Ok(value)
        }
    };
    let step = matches!(sampler.interpolation, Checked::Valid(Interpolation::Step));
    let (keys, slopes) = if cubic {
        let slopes = values.chunks_exact(3).map(|key| (key[0], key[2])).collect();
        // A spline goes through its keys as they are written.
        (values.chunks_exact(3).map(|triple| triple[1]).collect(), slopes)
    } else {
        (values.into_iter().map(key).collect::<Result<Vec<_>, _>>()?, Vec::new())
    };
    Ok(Curve { times, values: keys, slopes, step, rotation })
}

fn values(model: &Model<'_>, index: Index<Accessor>, rotation: bool) -> Result<Vec<DVec4>, String> {
    let number = f64::from;
    if rotation {
        return Ok(model.floats::<4>(index)?.into_iter().map(|value| DVec4::from_array(value.map(number))).collect());
    }
    Ok(model.floats::<3>(index)?.into_iter().map(|value| DVec3::from_array(value.map(number)).extend(0.0)).collect())
}

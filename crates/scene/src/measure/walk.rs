//! One sample after the other: a path from the camera, a ray from a light, a texel of the reflective shadow map.
//!
//! Light of one bounce is estimated in the two ways of `shaders/common/path.wgsl`, joined by the balance heuristic: by a point that a ray
//! from a light meets, and by a cosine-distributed direction from what the camera sees. For the light that *would* arrive if nothing
//! were in the way, the direction goes on through all surfaces: then both ways find every pair of points with the same densities as for the
//! light that does arrive, the same weights bound 1/distance² for both, and what is blocked is the difference of the same samples.

use std::f32::consts::PI;

use glam::Vec3;

use super::{
    light::{Arrival, Both, Surface, arrival, cosine_direction, falloff, flux_of_ray, light_ray, unit},
    random::{Purpose, Random},
    sums::{Quantity, Sums},
    world::World,
};
use crate::{
    bvh::{Hit, MISSED, Ray},
    gpu_data::{Light, LightKind, View},
};

/// Surfaces after the first that a path may meet, as of the node `reference/trace`.
const MAX_BOUNCES: u32 = 32;
/// Lit points, of those that the rays of a batch met, that each point which the camera sees is joined with: a shadow ray each.
const SHARED: u32 = 4;
/// Survival of a path is never likelier than this, so that a white scene's paths end.
const MOST_SURVIVAL: f32 = 0.95;
/// Lights that shadow rays of one point go to; of more, so many are chosen, evenly over their list.
const MOST_LIGHTS: usize = 8;
/// What densities are divided by at least.
const LEAST_DENSITY: f32 = 1e-30;

/// Where a ray from a light met a surface.
struct Lit {
    light: usize,
    surface: Surface,
    /// Flux that the ray stands for.
    flux: Vec3,
}

/// Takes samples of one batch.
pub(super) struct Walk<'a> {
    world: &'a World<'a>,
    random: Random,
    hits: Vec<Hit>,
    sums: Sums,
}

/// The sums of a batch of samples.
pub(super) fn batch(world: &World<'_>, seed: u32, count: u32) -> Sums {
    let mut walk = Walk { world, random: Random::new(seed, count), hits: Vec::new(), sums: Sums::ZERO };
    let mut lit = Vec::with_capacity(count as usize);
    for index in 0..count {
        walk.random.start(index);
        walk.texel(index);
        let u = walk.random.even(Purpose::FromLight);
        lit.push(walk.ray_from_light(u));
        if let Some(Some(lit)) = lit.last() {
            walk.onward(lit);
        }
    }
    for index in 0..count {
        walk.random.start(index);
        walk.random.one(); // the light was chosen with it
        // Some that are far apart in the batch: the batch as a whole spreads them, whichever they are.
        let some = (0..SHARED).filter_map(|i| lit[((index + i * count.div_ceil(SHARED)) % count) as usize].as_ref());
        walk.look(some);
    }
    walk.sums
}

fn sum(rgb: Vec3) -> f64 {
    rgb.as_dvec3().element_sum()
}

impl<'a> Walk<'a> {
    /// A texel of the reflective shadow map: does it reflect light?
    fn texel(&mut self, index: u32) {
        let views = &self.world.views;
        if views.is_empty() {
            return;
        }
        let view = &views[index as usize % views.len()];
        let light = &self.world.lights[view.light as usize];
        let ray = ray_through(&view.view, view.kind == LightKind::Directional as u32, self.random.even(Purpose::Texel));
        self.sums.add(Quantity::Texels, 1.0);
        let strength = light.strength * falloff(light, ray.direction);
        if strength.max_element() <= 0.0 {
            return;
        }
        if let Some(hit) = self.world.nearest(&ray, MISSED) {
            let reflected = strength * self.world.surface(&ray, &hit).albedo;
            self.sums.add(Quantity::TexelsLit, f64::from(u8::from(reflected.max_element() > 0.0)));
        }
    }

    /// A ray from one of the lights, chosen in proportion to their power.
    fn ray_from_light(&mut self, u: [f32; 2]) -> Option<Lit> {
        let index = self.choose_light()?;
        let light = &self.world.lights[index];
        let ray = light_ray(light, u);
        let hit = self.world.nearest(&ray, MISSED)?;
        Some(Lit { light: index, surface: self.world.surface(&ray, &hit), flux: flux_of_ray(light, ray.direction) })
    }

    fn choose_light(&mut self) -> Option<usize> {
        let mut rest = self.random.one();
        let mut chosen = None;
        for (index, light) in self.world.lights.iter().enumerate().filter(|(_, light)| light.share > 0.0) {
            // The last one also has what rounding leaves.
            chosen = Some(index);
            if rest < light.share {
                break;
            }
            rest -= light.share;
        }
        chosen
    }

    /// Where matt reflection sends the flux of a lit point: to something that the camera sees?
    fn onward(&mut self, lit: &Lit) {
        let from = &lit.surface;
        let flux = sum(from.albedo * lit.flux);
        if flux <= 0.0 || !flux.is_finite() {
            return;
        }
        self.sums.add(Quantity::Flux, flux);
        let ray = Ray::new(self.world.lift(from), cosine_direction(from.geometric, self.random.even(Purpose::Onward)));
        if let Some(hit) = self.world.nearest(&ray, MISSED) {
            let to = self.world.surface(&ray, &hit);
            if self.is_in_picture(&to) {
                self.sums.add(Quantity::FluxSeen, flux);
            }
        }
    }

    /// Whether the camera sees the side of a surface that a ray met.
    fn is_in_picture(&self, surface: &Surface) -> bool {
        let camera = &self.world.camera;
        let v = surface.position - camera.origin;
        let z = v.dot(camera.forward);
        let inside = v.dot(camera.right).abs() <= z * camera.tan_half_x && v.dot(camera.up).abs() <= z * camera.tan_half_y;
        z > 0.0 && inside && surface.geometric.dot(v) < 0.0 && self.world.sees(self.world.lift(surface), camera.origin)
    }

    /// A path from the camera.
    fn look<'l>(&mut self, some: impl Iterator<Item = &'l Lit>) {
        let ray = ray_through(&self.world.camera, false, self.random.even(Purpose::Pixel));
        let Some(hit) = self.world.nearest(&ray, MISSED) else { return };
        let x = self.world.surface(&ray, &hit);
        let log_distance = f64::from(hit.t).max(f64::MIN_POSITIVE).ln();
        self.sums.add(Quantity::Seen, 1.0);
        self.sums.add(Quantity::LogDistance, log_distance);
        self.sums.add(Quantity::LogDistanceSquared, log_distance * log_distance);

        let direct = self.direct(&x);
        self.sums.add(Quantity::DirectSent, sum(direct.sent.all));
        self.sums.add(Quantity::DirectReaching, sum(direct.reaching.all));

        let direction = x.cosine_direction(self.random.even(Purpose::Next));
        let (mut bounce, next) = self.bounce_along(&x, direction);
        for lit in some {
            let from = self.bounce_from(lit, &x, SHARED);
            bounce.sent += from.sent;
            bounce.reaching += from.reaching;
        }
        self.sums.add(Quantity::BounceSent, sum(bounce.sent.all));
        self.sums.add(Quantity::BounceReaching, sum(bounce.reaching.all));

        let later = next.map_or(Both::ZERO, |y| self.later(y, x.brdf(direction) * PI));
        self.sums.add(Quantity::Later, sum(later.all));
        let total = direct.reaching + bounce.reaching + later;
        self.sums.add(Quantity::All, sum(total.all));
        self.sums.add(Quantity::Matt, sum(total.matt));
    }

    /// Lights for shadow rays, and how many each of them stands for: each light is as likely.
    fn some_lights(&mut self) -> (f32, impl Iterator<Item = &'a Light> + use<'a>) {
        let lights = &self.world.lights;
        let step = (lights.len() as f32 / MOST_LIGHTS as f32).max(1.0);
        let first = if step > 1.0 { self.random.one() * step } else { 0.0 };
        let chosen = (0..lights.len().min(MOST_LIGHTS)).map(move |i| (first + i as f32 * step) as usize);
        (step, chosen.filter_map(|index| lights.get(index)))
    }

    /// Radiance that a surface sends to its viewer of the lights themselves.
    fn direct(&mut self, x: &Surface) -> Bounced {
        let mut out = Bounced::ZERO;
        let (each, lights) = self.some_lights();
        for light in lights {
            let arrival = arrival(light, x.position);
            let radiance = x.reflected(&arrival) * each;
            if !radiance.is_dark() {
                out.sent += radiance;
                if self.is_lit(x, light, &arrival) {
                    out.reaching += radiance;
                }
            }
        }
        out
    }

    /// Whether nothing is between a surface and a light.
    fn is_lit(&self, x: &Surface, light: &Light, arrival: &Arrival) -> bool {
        if x.geometric.dot(arrival.to_light) <= 0.0 {
            return false;
        }
        let from = self.world.lift(x);
        if light.kind == LightKind::Directional as u32 {
            return !self.world.is_blocked(&Ray::new(from, -light.direction), MISSED);
        }
        self.world.sees(from, light.position)
    }

    /// One bounce by way of a point that a ray from a light met, one of `joined` that are.
    fn bounce_from(&self, lit: &Lit, x: &Surface, joined: u32) -> Bounced {
        let mut y = lit.surface;
        let arrival = arrival(&self.world.lights[lit.light], y.position);
        y.to_viewer = unit(x.position - y.position);
        let between = x.coupling(&y);
        let radiance = y.reflected(&arrival);
        if between <= 0.0 || radiance.is_dark() {
            return Bounced::ZERO;
        }
        // Integrand over the densities of all samples that could have found the pair: the balance heuristic.
        let weight = between / (joined as f32 * y.pdf_light(&arrival) + between / PI);
        let sent = x.brdf(-y.to_viewer) * radiance * weight;
        let reaching = x.geometric.dot(y.to_viewer) < 0.0 && self.world.sees(self.world.lift(x), self.world.lift(&y));
        Bounced { sent, reaching: if reaching { sent } else { Both::ZERO } }
    }

    /// One bounce by way of what a direction meets: the nearest surface sends what arrives, and those behind it what is blocked. Also the
    /// nearest surface, from which the path goes on.
    fn bounce_along(&mut self, x: &Surface, direction: Vec3) -> (Bounced, Option<Surface>) {
        // A smooth normal has directions behind its triangle, from where nothing comes.
        let is_before = direction.dot(x.geometric) > 0.0;
        let origin = if is_before { self.world.lift(x) } else { self.world.behind(x) };
        let ray = Ray::new(origin, direction);
        let mut hits = std::mem::take(&mut self.hits);
        self.world.all_hits(&ray, MISSED, &mut hits);
        let nearest = hits.iter().enumerate().min_by(|a, b| a.1.t.total_cmp(&b.1.t)).map(|(index, _)| index).filter(|_| is_before);
        let throughput = x.brdf(direction) * PI;
        let mut out = Bounced::ZERO;
        let mut next = None;
        for (index, hit) in hits.iter().enumerate() {
            let y = self.world.surface(&ray, hit);
            let radiance = throughput * self.weighted_direct(x, &y, SHARED);
            out.sent += radiance;
            if nearest == Some(index) {
                out.reaching += radiance;
                next = Some(y);
            }
        }
        self.hits = hits;
        (out, next)
    }

    /// Radiance that `y`, which a cosine-distributed direction from `x` met, sends to `x` of the lights themselves. What one of `joined` rays from
    /// lights could have found counts less.
    fn weighted_direct(&mut self, x: &Surface, y: &Surface, joined: u32) -> Both {
        let own = x.coupling(y) / PI;
        let mut radiance = Both::ZERO;
        let (each, lights) = self.some_lights();
        for light in lights {
            let arrival = arrival(light, y.position);
            let reflected = y.reflected(&arrival) * each;
            if !reflected.is_dark() && self.is_lit(y, light, &arrival) {
                radiance += reflected * (own / (own + joined as f32 * y.pdf_light(&arrival)).max(LEAST_DENSITY));
            }
        }
        radiance
    }

    /// Light of two and more bounces: one bounce and more at the second surface of a path, as the first surface's viewer gets it.
    fn later(&mut self, mut x: Surface, mut throughput: Both) -> Both {
        let mut radiance = Both::ZERO;
        for _ in 1..MAX_BOUNCES {
            let survival = throughput.all.max_element().min(MOST_SURVIVAL);
            if self.random.one() >= survival {
                break;
            }
            throughput = throughput * survival.recip();
            let u = self.random.pair();
            if let Some(lit) = self.ray_from_light(u) {
                radiance += throughput * self.bounce_from(&lit, &x, 1).reaching;
            }
            let direction = x.cosine_direction(self.random.pair());
            if direction.dot(x.geometric) <= 0.0 {
                break;
            }
            let ray = Ray::new(self.world.lift(&x), direction);
            let Some(hit) = self.world.nearest(&ray, MISSED) else { break };
            throughput = throughput * (x.brdf(direction) * PI);
            let y = self.world.surface(&ray, &hit);
            radiance += throughput * self.weighted_direct(&x, &y, 1);
            x = y;
        }
        radiance
    }
}

/// Light that would arrive if nothing were in the way, and that does.
#[derive(Debug, Clone, Copy)]
struct Bounced {
    sent: Both,
    reaching: Both,
}

impl Bounced {
    const ZERO: Self = Self { sent: Both::ZERO, reaching: Both::ZERO };
}

/// The ray of a view through a place of its picture: (0, 0) is the top left corner, (1, 1) the bottom right. Of unit length, from beyond a
/// light's near plane as far as that counts.
fn ray_through(view: &View, is_parallel: bool, uv: [f32; 2]) -> Ray {
    let across = view.right * ((2.0 * uv[0] - 1.0) * view.tan_half_x) + view.up * ((1.0 - 2.0 * uv[1]) * view.tan_half_y);
    if is_parallel { Ray::new(view.origin + across, view.forward) } else { Ray::new(view.origin, unit(view.forward + across)) }
}

//! A scene at one time.

use glam::{DMat3, DMat4, DVec3, Mat4};

use crate::{
    bounds::Bounds,
    deform::Deformed,
    gpu_data::{Light, LightView, Object, SceneInfo, Sky, View},
    import::Mesh,
    lights::{self, NEAR},
    motion::{CameraPose, Pose},
    scene::{Extent, Scene, SceneObject},
};

/// Everything that changes with time, ready for the GPU.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneState {
    /// Seconds.
    pub time: f64,
    /// Where the objects are.
    pub objects: Vec<Object>,
    /// The meshes that deform, in the order of the scene's.
    pub deformed: Vec<Deformed>,
    /// The lights, with their shares of the power.
    pub lights: Vec<Light>,
    /// What the lights see, in the order of the lights: one view of a spot or directional light, six of a point light. Without lights a dark one.
    pub light_views: Vec<LightView>,
    /// The light of the sky.
    pub sky: Sky,
    /// The camera; [`SceneState::camera_view`] makes a view of it.
    pub camera: CameraPose,
    /// Around all objects, world space. Tight around objects that stand still or deform, loose around others.
    pub bounds: Bounds,
    /// Extent and statistics.
    pub info: SceneInfo,
}

/// The near plane is never farther than this share of the distance from the camera to its target.
const NEAR_OF_TARGET: f64 = 1e-2;
/// … but never nearer than this share of the diagonal: a camera on its target still has a view.
const NEAR_AT_LEAST: f64 = 1e-6;

impl Scene {
    /// Share of its light that the sky has at a time: that of the sun, and all of it in a scene without one.
    pub fn daylight(&self, time: f64) -> f64 {
        self.sun.as_ref().map_or(1.0, |sun| sun.sun.daylight(time))
    }

    /// The scene at a time in seconds.
    pub fn sample(&self, time: f64) -> SceneState {
        let at = |(mesh, of): (usize, &Mesh)| of.at(time).map(|shape| Deformed { mesh, shape });
        let deformed: Vec<Deformed> = self.meshes.iter().enumerate().filter_map(at).collect();
        let mut bounds = Bounds::EMPTY;
        let mut area = 0.0;
        let mut objects = Vec::with_capacity(self.objects.len());
        for object in &self.objects {
            let pose = object.pose.at(time);
            let mesh = &self.meshes[object.mesh];
            let extent = match (mesh.deformation.is_some(), object.pose.moves()) {
                (true, _) => extent(self.shape(object.mesh, &deformed), &pose),
                (false, true) => extent_moving(mesh, &pose),
                (false, false) => object.at_rest,
            };
            bounds = bounds.union(extent.bounds);
            area += extent.area;
            objects.push(Object {
                world_from_object: pose.world_from_object().as_mat4(),
                normal_from_object: Mat4::from_mat3(normal_from_object(&pose).as_mat3()),
            });
        }
        if bounds.is_empty() {
            bounds = reach(&self.meshes, &self.objects, time);
        }
        let mut light_poses: Vec<_> = self.lights.iter().map(|light| light.pose.at(time)).collect();
        if let Some(sun) = &self.sun {
            light_poses[sun.light] = sun.sun.pose(time);
        }
        let mesh_now = |object: &SceneObject| self.shape(object.mesh, &deformed);
        let statistics = |pick: fn(&Mesh) -> f64| self.objects.iter().map(mesh_now).map(pick);
        // Infinite where there is no triangle.
        let least = |pick: fn(&Mesh) -> f64| Some(statistics(pick).fold(f64::INFINITY, f64::min)).filter(|least| least.is_finite());
        let info = SceneInfo {
            bounds_min: bounds.min.as_vec3(),
            diagonal: bounds.diagonal() as f32,
            bounds_max: bounds.max.as_vec3(),
            total_area: area as f32,
            area_min: least(|mesh| mesh.statistics.area_min).unwrap_or(0.0) as f32,
            area_max: statistics(|mesh| mesh.statistics.area_max).fold(0.0, f64::max) as f32,
            edge_min: least(|mesh| mesh.statistics.edge_min).unwrap_or(0.0) as f32,
            edge_max: statistics(|mesh| mesh.statistics.edge_max).fold(0.0, f64::max) as f32,
            triangle_count: self.used(&deformed).triangles as u32,
            object_count: self.objects.len() as u32,
            light_count: self.lights.len() as u32,
            texture_count: self.textures.count,
        };
        let lights = lights::on_gpu(&self.lights, &light_poses, &bounds);
        let light_views = lights::views(&lights, &light_poses, &bounds);
        let sky = self.sky.on_gpu(self.daylight(time));
        SceneState { time, objects, deformed, lights, light_views, sky, camera: self.camera.at(time), bounds, info }
    }
}

impl SceneState {
    /// The camera for a picture of width / height = `aspect`.
    ///
    /// Near plane: 1/1000 of the scene's diagonal, or 1/100 of the distance to the target where that is less. `far` is twice the diagonal
    /// and the distance to the scene's bounds.
    pub fn camera_view(&self, aspect: f32) -> View {
        let CameraPose { origin, target, up, fov_x_deg } = self.camera;
        let diagonal = self.bounds.diagonal();
        let distance = origin.as_dvec3().distance(target.as_dvec3());
        let near = (NEAR * diagonal).min(NEAR_OF_TARGET * distance).max(NEAR_AT_LEAST * diagonal);
        View::perspective(origin, target, up, fov_x_deg.to_radians(), aspect, near as f32, self.bounds.beyond(origin.as_dvec3()) as f32)
    }
}

/// Exact extent of a mesh in a pose.
pub(crate) fn extent(mesh: &Mesh, pose: &Pose) -> Extent {
    let matrix = pose.world_from_object();
    let mut bounds = Bounds::EMPTY;
    let mut area = 0.0;
    for triangle in &mesh.triangles {
        let corners = mesh.corners(triangle).map(|corner| matrix.transform_point3(corner));
        area += crate::import::area(&corners);
        corners.into_iter().for_each(|corner| bounds.add(corner));
    }
    Extent { bounds, area }
}

/// Bounds of a scene of nothing but metaballs without a surface: around where they might have one.
pub(crate) fn reach(meshes: &[Mesh], objects: &[SceneObject], time: f64) -> Bounds {
    let of = |object: &SceneObject| meshes[object.mesh].reach().transformed(&object.pose.at(time).world_from_object());
    objects.iter().fold(Bounds::EMPTY, |bounds, object| bounds.union(of(object)))
}

/// Extent of a mesh that moves: its bounds are those of the turned bounding box, so that a frame does not visit every vertex.
fn extent_moving(mesh: &Mesh, pose: &Pose) -> Extent {
    let scale = pose.scale.as_dvec3().abs();
    let uniform = scale.max_element() - scale.min_element() <= 1e-6 * scale.max_element();
    let bounds = mesh.statistics.bounds.transformed(&pose.world_from_object());
    let area = if uniform { mesh.statistics.area * scale.x * scale.x } else { extent(mesh, pose).area };
    Extent { bounds, area }
}

/// The inverse transpose up to a positive factor. As cofactors it exists for flattened objects, too; where it loses an axis (an object scaled
/// to nothing), the rotation alone is taken.
fn normal_from_object(pose: &Pose) -> DMat3 {
    let [a, b, c] = linear_part(&pose.world_from_object());
    let cofactors = [b.cross(c), c.cross(a), a.cross(b)];
    let sign = if a.dot(cofactors[0]) < 0.0 { -1.0 } else { 1.0 };
    let longest = cofactors.iter().map(|v| v.length()).fold(0.0, f64::max);
    if cofactors.iter().any(|v| v.length() <= f64::from(f32::EPSILON) * longest) {
        let [a, b, c] = linear_part(&Pose { scale: glam::Vec3::ONE, ..*pose }.world_from_object());
        return DMat3::from_cols(a, b, c);
    }
    DMat3::from_cols(cofactors[0], cofactors[1], cofactors[2]) * (sign / longest)
}

/// Columns of the linear part.
fn linear_part(matrix: &DMat4) -> [DVec3; 3] {
    [matrix.x_axis.truncate(), matrix.y_axis.truncate(), matrix.z_axis.truncate()]
}

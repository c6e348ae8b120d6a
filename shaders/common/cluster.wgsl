// A cluster of RSM texels: a virtual area light. [ACRSM] 5.1.2, table 5.2.

// Parked: nothing is lit where it is.
const CLUSTER_IDLE: u32 = 0u;
const CLUSTER_ACTIVE: u32 = 1u;
// Waits for a place from the Halton sequence ...
const CLUSTER_RESEED: u32 = 2u;
// ... or has one already, near the cluster that was split.
const CLUSTER_PLACED: u32 = 3u;

// "No cluster" in a cluster map.
const NO_CLUSTER: u32 = 0xffffffffu;
// Buffers of clusters have as many elements as there are; none has more than this.
const MAX_CLUSTERS: u32 = 4096u;

struct Cluster {
    position: vec3f, // world space
    area: f32, // m²
    normal: vec3f, // unit length, world space
    importance: f32, // mean, 0 to 1
    flux: vec3f, // reflected, W
    count: u32, // texels that belong to it
    texel: vec2f, // its centre in the RSM, in texels
    state: u32,
    generation: u32, // how often it was seeded: picks the next point of the sequence
    delta: f32, // [ACRSM] eq. 4.6
    delta_mean: f32, // of its neighbourhood, eq. 4.7; equal to delta when it has no neighbour
    cancelled: u32, // frames in a row in which the mean of its normals vanished and the old one was kept
    rank: u32, // while evaluating: 1 + its place among those to be merged or split, the worst first; 0: it fits
}

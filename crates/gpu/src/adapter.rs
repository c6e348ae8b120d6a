//! Which adapter to open, and with which features.

use std::fmt;

use crate::error::GpuError;

/// Environment variable that names the wanted adapter (part of its name, in any case).
pub const ADAPTER_VARIABLE: &str = "WGPU_ADAPTER_NAME";

/// What to look for when a device is opened.
#[derive(Debug, Clone, Default)]
pub struct GpuOptions {
    /// Part of the adapter's name, in any case. Without it, [`ADAPTER_VARIABLE`] is asked, then hardware is preferred to software.
    pub adapter: Option<String>,
}

/// What sort of machine renders; printed with every time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum GpuKind {
    /// A graphics card.
    Discrete,
    /// A GPU that shares memory with the CPU.
    Integrated,
    /// A GPU seen through a virtual machine.
    Virtual,
    /// The driver does not say.
    Other,
    /// The CPU: times say nothing about GPUs.
    Software,
}

impl From<wgpu::DeviceType> for GpuKind {
    fn from(kind: wgpu::DeviceType) -> Self {
        match kind {
            wgpu::DeviceType::DiscreteGpu => Self::Discrete,
            wgpu::DeviceType::IntegratedGpu => Self::Integrated,
            wgpu::DeviceType::VirtualGpu => Self::Virtual,
            wgpu::DeviceType::Other => Self::Other,
            wgpu::DeviceType::Cpu => Self::Software,
        }
    }
}

impl GpuKind {
    /// `discrete`, `integrated`, `virtual`, `other` or `software`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Discrete => "discrete",
            Self::Integrated => "integrated",
            Self::Virtual => "virtual",
            Self::Other => "other",
            Self::Software => "software",
        }
    }
}

impl fmt::Display for GpuKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The adapter that fits best.
pub(crate) fn choose(
    instance: &wgpu::Instance,
    options: &GpuOptions,
    surface: Option<&wgpu::Surface<'_>>,
) -> Result<wgpu::Adapter, GpuError> {
    let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    if adapters.is_empty() {
        return Err(GpuError::NoAdapter);
    }
    let names = |adapters: &[wgpu::Adapter]| adapters.iter().map(|a| a.get_info().name).collect();
    let wanted = options.adapter.clone().or_else(|| std::env::var(ADAPTER_VARIABLE).ok());
    if let Some(wanted) = wanted.filter(|w| !w.is_empty()) {
        let found = names(&adapters);
        let needle = wanted.to_lowercase();
        adapters.retain(|a| a.get_info().name.to_lowercase().contains(&needle));
        if adapters.is_empty() {
            return Err(GpuError::NoSuchAdapter { wanted, found });
        }
    }
    if let Some(surface) = surface {
        let found = names(&adapters);
        adapters.retain(|a| a.is_surface_supported(surface));
        if adapters.is_empty() {
            return Err(GpuError::NoSurface { found });
        }
    }
    let best = adapters.into_iter().min_by_key(|a| GpuKind::from(a.get_info().device_type));
    best.ok_or(GpuError::NoAdapter)
}

/// Everything a shader or a timer may use. Experimental features and those that cost when merely on are left out.
pub(crate) fn wanted_features() -> wgpu::Features {
    use wgpu::Features as F;
    F::all_webgpu_mask()
        | F::TIMESTAMP_QUERY_INSIDE_ENCODERS
        | F::TIMESTAMP_QUERY_INSIDE_PASSES
        | F::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES
        | F::TEXTURE_FORMAT_16BIT_NORM
        | F::SHADER_FLOAT32_ATOMIC
        | F::SHADER_INT64
        | F::SHADER_INT64_ATOMIC_MIN_MAX
        | F::SHADER_INT64_ATOMIC_ALL_OPS
        | F::SHADER_F64
        | F::SHADER_I16
        | F::TEXTURE_ATOMIC
        | F::SUBGROUP
        | F::SUBGROUP_VERTEX
        | F::SUBGROUP_BARRIER
        | F::VERTEX_WRITABLE_STORAGE
        | F::CONSERVATIVE_RASTERIZATION
        | F::SHADER_EARLY_DEPTH_TEST
        | F::SHADER_BARYCENTRICS
        | F::CLEAR_TEXTURE
}

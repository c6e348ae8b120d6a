//! The device: which adapter, with which features and limits, and what it complains about.

use std::{
    fmt,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
};

use crate::{
    adapter::{choose, wanted_features},
    error::{GpuError, tidy},
    pipeline_cache::PipelineCache,
};

pub use crate::adapter::{ADAPTER_VARIABLE, GpuKind, GpuOptions};

/// Messages kept until [`Gpu::take_errors`]; what exceeds this is counted only.
const KEPT_ERRORS: usize = 32;

/// An open device. Cloning is cheap and shares it.
#[derive(Clone)]
pub struct Gpu {
    inner: Arc<Inner>,
}

struct Inner {
    instance: wgpu::Instance,
    adapter: wgpu::Adapter,
    device: wgpu::Device,
    queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    features: wgpu::Features,
    limits: wgpu::Limits,
    period_ns: f32,
    complaints: Arc<Complaints>,
    samplers: [wgpu::Sampler; 3],
    cache: Mutex<PipelineCache>,
}

#[derive(Default)]
struct Complaints {
    errors: Mutex<Vec<String>>,
    count: AtomicU64,
    lost: Mutex<Option<String>>,
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Gpu").field("adapter", &self.inner.info.name).finish_non_exhaustive()
    }
}

/// The guard of a mutex, also when a thread panicked while it held it: the data here is always valid.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Gpu {
    /// Opens the adapter that fits best, with every feature that manylight or a node's `requires` can use.
    pub fn new(options: &GpuOptions) -> Result<Self, GpuError> {
        let descriptor = wgpu::InstanceDescriptor::new_without_display_handle().with_env();
        Self::on_instance(wgpu::Instance::new(descriptor), options, None)
    }

    /// Like [`Gpu::new`], on an instance of the caller; with a surface, only adapters that can present to it count.
    pub fn on_instance(instance: wgpu::Instance, options: &GpuOptions, surface: Option<&wgpu::Surface<'_>>) -> Result<Self, GpuError> {
        let adapter = choose(&instance, options, surface)?;
        let info = adapter.get_info();
        let features = adapter.features() & wanted_features();
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("manylight"),
            required_features: features,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let opened = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) = opened.map_err(|e| GpuError::Device { adapter: info.name.clone(), message: e.to_string() })?;
        let complaints = Arc::new(Complaints::default());
        listen(&device, &complaints);
        let samplers = samplers(&device);
        let inner = Inner {
            limits: device.limits(),
            period_ns: queue.get_timestamp_period(),
            instance,
            adapter,
            device,
            queue,
            info,
            features,
            complaints,
            samplers,
            cache: Mutex::default(),
        };
        Ok(Self { inner: Arc::new(inner) })
    }

    /// The instance, for surfaces.
    pub fn instance(&self) -> &wgpu::Instance {
        &self.inner.instance
    }

    /// The adapter, for surfaces.
    pub fn adapter(&self) -> &wgpu::Adapter {
        &self.inner.adapter
    }

    /// wgpu's device.
    pub fn device(&self) -> &wgpu::Device {
        &self.inner.device
    }

    /// wgpu's queue.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.inner.queue
    }

    /// Name, driver and backend.
    pub fn adapter_info(&self) -> &wgpu::AdapterInfo {
        &self.inner.info
    }

    /// What sort of machine it is.
    pub fn kind(&self) -> GpuKind {
        self.inner.info.device_type.into()
    }

    /// Features that are on.
    pub fn features(&self) -> wgpu::Features {
        self.inner.features
    }

    /// Limits that hold.
    pub fn limits(&self) -> &wgpu::Limits {
        &self.inner.limits
    }

    /// Nanoseconds of a timestamp's unit.
    pub fn timestamp_period_ns(&self) -> f32 {
        self.inner.period_ns
    }

    /// Whether GPU times can be measured.
    pub fn has_timestamps(&self) -> bool {
        self.features().contains(wgpu::Features::TIMESTAMP_QUERY)
    }

    /// Messages of errors that no operation returned, oldest first, and forgets them. wgpu would have panicked.
    pub fn take_errors(&self) -> Vec<String> {
        std::mem::take(&mut *lock(&self.inner.complaints.errors))
    }

    /// Number of such errors since the device was opened.
    pub fn error_count(&self) -> u64 {
        self.inner.complaints.count.load(Ordering::Relaxed)
    }

    /// Why the device is gone, when it is: nothing works on it from then on, and all that was on it is lost. Never waits.
    pub fn lost(&self) -> Option<String> {
        // The callback is called from here at the latest. A failed look means a lost device, which it has told by then.
        let _ = self.device().poll(wgpu::PollType::Poll);
        lock(&self.inner.complaints.lost).clone()
    }

    /// Waits until the GPU has done all work submitted so far.
    pub fn wait(&self) {
        // A failed wait means a lost device, which the callback records.
        let _ = self.device().poll(wgpu::PollType::wait_indefinitely());
    }

    pub(crate) fn cache(&self) -> MutexGuard<'_, PipelineCache> {
        lock(&self.inner.cache)
    }

    pub(crate) fn sampler(&self, name: &str) -> Option<&wgpu::Sampler> {
        let at = SAMPLERS.iter().position(|s| *s == name)?;
        Some(&self.inner.samplers[at])
    }

    /// Runs `work` under error scopes; the first error of any kind is returned as text.
    pub(crate) fn scoped<T>(&self, work: impl FnOnce() -> T) -> Result<T, String> {
        let device = self.device();
        let internal = device.push_error_scope(wgpu::ErrorFilter::Internal);
        let memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let result = work();
        let found = [validation, memory, internal].map(|scope| pollster::block_on(scope.pop()));
        match found.into_iter().flatten().next() {
            Some(error) => Err(tidy(&error)),
            None => Ok(result),
        }
    }
}

/// Names of the samplers a shader can bind, in the order of `Inner::samplers`.
const SAMPLERS: [&str; 3] = ["linear_sampler", "linear_repeat_sampler", "nearest_sampler"];

fn samplers(device: &wgpu::Device) -> [wgpu::Sampler; 3] {
    let make = |name: &'static str| {
        let nearest = name.starts_with("nearest");
        let filter = if nearest { wgpu::FilterMode::Nearest } else { wgpu::FilterMode::Linear };
        let mipmap_filter = if nearest { wgpu::MipmapFilterMode::Nearest } else { wgpu::MipmapFilterMode::Linear };
        let address = if name.contains("repeat") { wgpu::AddressMode::Repeat } else { wgpu::AddressMode::ClampToEdge };
        device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some(name),
            address_mode_u: address,
            address_mode_v: address,
            mag_filter: filter,
            min_filter: filter,
            mipmap_filter,
            ..Default::default()
        })
    };
    SAMPLERS.map(make)
}

fn listen(device: &wgpu::Device, complaints: &Arc<Complaints>) {
    let heard = complaints.clone();
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
        heard.count.fetch_add(1, Ordering::Relaxed);
        let mut errors = lock(&heard.errors);
        if errors.len() < KEPT_ERRORS {
            errors.push(tidy(&error));
        }
    }));
    let heard = complaints.clone();
    device.set_device_lost_callback(move |reason, message| {
        let said = message.trim();
        let why = match reason {
            wgpu::DeviceLostReason::Destroyed => "it was destroyed",
            _ if said.is_empty() => "the driver does not say why",
            _ => said,
        };
        *lock(&heard.lost) = Some(why.to_owned());
    });
}

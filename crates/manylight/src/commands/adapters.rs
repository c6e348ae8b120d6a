//! `manylight adapters`: what there is to render with.

use manylight::{
    fault::Fault,
    gpu::{GpuError, GpuKind, wgpu},
};
use serde_json::json;

use super::table::Table;
use crate::cli::{AdaptersArgs, TextOrJson};

/// Lists the adapters with their kinds.
pub fn run(args: &AdaptersArgs) -> Result<(), Fault> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle().with_env());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let adapters: Vec<wgpu::AdapterInfo> = adapters.iter().map(wgpu::Adapter::get_info).collect();
    if adapters.is_empty() {
        return Err(Fault::NoGpu(GpuError::NoAdapter.to_string()));
    }
    if args.format == TextOrJson::Json {
        let list: Vec<_> = adapters
            .iter()
            .map(|a| json!({"name": a.name, "kind": GpuKind::from(a.device_type).name(), "backend": format!("{:?}", a.backend), "driver": a.driver, "driver_info": a.driver_info}))
            .collect();
        return super::print(&format!("{:#}\n", json!(list)));
    }
    let mut table = Table::new(&[("name", true), ("kind", true), ("backend", true), ("driver", true)]);
    for a in &adapters {
        let driver = [a.driver.as_str(), a.driver_info.as_str()].join(" ");
        table.row(vec![a.name.clone(), GpuKind::from(a.device_type).to_string(), format!("{:?}", a.backend), driver.trim().to_owned()]);
    }
    super::print(&table.render())
}

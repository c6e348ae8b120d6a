//! manylight
pub mod fault;
pub mod files;
pub mod metrics;

//! How much memory the resources of a frame take.

use crate::{format::byte_size, frame::Frame, pool::Place};

/// How a resource holds its memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Holding {
    /// Given from outside.
    External,
    /// Shares a slot of the pool.
    Pool {
        /// The slot.
        slot: usize,
    },
    /// Alone, since it is read after the frame.
    Kept,
    /// Alone, since a host node writes it only when something changed.
    Host,
    /// Two copies that swap.
    History,
}

/// Memory of one resource.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ResourceMemory {
    /// Name in the pipeline.
    pub name: String,
    /// Bytes of its texels or elements; of both copies for a history.
    pub bytes: u64,
    /// How it holds them.
    pub holding: Holding,
}

/// Memory of a frame in bytes, without the driver's padding.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct MemoryReport {
    /// All resources of the plan.
    pub resources: Vec<ResourceMemory>,
    /// The pool: every slot once.
    pub pool: u64,
    /// What the pool would take if no two resources shared a slot.
    pub pool_unshared: u64,
    /// Histories, both copies.
    pub history: u64,
    /// Resources read after the frame.
    pub kept: u64,
    /// Outputs of host nodes.
    pub host: u64,
    /// Externals that the plan reads.
    pub external: u64,
}

impl MemoryReport {
    /// What the frame itself holds: all but externals.
    pub fn total(&self) -> u64 {
        self.pool + self.history + self.kept + self.host
    }
}

impl Frame {
    /// How much memory the frame takes.
    pub fn memory_report(&self) -> MemoryReport {
        let mut report = MemoryReport::default();
        let mut slots = Vec::new();
        for r in &self.resources {
            let single = byte_size(&r.desc);
            let (bytes, holding) = match &r.place {
                Place::External => {
                    report.external += single;
                    (single, Holding::External)
                }
                Place::Pool { slot, .. } => {
                    report.pool_unshared += single;
                    if !slots.contains(slot) {
                        slots.push(*slot);
                        report.pool += single;
                    }
                    (single, Holding::Pool { slot: *slot })
                }
                Place::Kept(_) => {
                    report.kept += single;
                    (single, Holding::Kept)
                }
                Place::Host(_) => {
                    report.host += single;
                    (single, Holding::Host)
                }
                Place::History(_) => {
                    report.history += 2 * single;
                    (2 * single, Holding::History)
                }
            };
            report.resources.push(ResourceMemory { name: r.name.clone(), bytes, holding });
        }
        report
    }
}

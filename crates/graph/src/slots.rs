//! Which transient resources share memory: those with equal descriptions whose lives do not touch.

use crate::{
    plan::{Lifetime, PlanResource},
    value::ResourceDesc,
};

/// Gives every transient resource a slot; returns their number. With `reuse` off each has its own.
pub(crate) fn assign(resources: &mut [PlanResource], reuse: bool) -> usize {
    let mut order: Vec<usize> = (0..resources.len()).filter(|ix| matches!(resources[*ix].lifetime, Lifetime::Transient { .. })).collect();
    order.sort_by_key(|ix| match resources[*ix].lifetime {
        Lifetime::Transient { first, .. } => (first, *ix),
        _ => (0, *ix),
    });
    let mut slots: Vec<(ResourceDesc, usize)> = Vec::new();
    for ix in order {
        let desc = resources[ix].desc.clone();
        let Lifetime::Transient { first, last, slot } = &mut resources[ix].lifetime else { continue };
        // A node may not write to the memory that it reads, so lives that meet in a node do touch.
        match slots.iter().position(|(of, until)| reuse && *of == desc && *until < *first) {
            Some(free) => {
                slots[free].1 = *last;
                *slot = free;
            }
            None => {
                *slot = slots.len();
                slots.push((desc, *last));
            }
        }
    }
    slots.len()
}

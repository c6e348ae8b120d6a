//! The order of nodes: producers before consumers, ties by document order or at random; and cycles.

use std::{cmp::Reverse, collections::BinaryHeap};

use petgraph::{
    Direction,
    algo::tarjan_scc,
    graph::{DiGraph, NodeIndex},
    visit::EdgeRef,
};

/// Nodes by document index; edges from producer to consumer.
pub(crate) type Dag<E> = DiGraph<usize, E>;

/// Nodes in a legal order, as document indices. Ready nodes go in document order, or by chance with a seed.
/// Nodes of cycles are left out.
pub(crate) fn sort<E>(dag: &Dag<E>, shuffle: Option<u64>) -> Vec<usize> {
    let mut waiting: Vec<usize> = dag.node_indices().map(|n| dag.edges_directed(n, Direction::Incoming).count()).collect();
    let mut random = shuffle.map(Random);
    let mut key = |n: NodeIndex| match &mut random {
        Some(random) => random.next(),
        None => dag[n] as u64,
    };
    let mut ready: BinaryHeap<Reverse<(u64, usize)>> = BinaryHeap::new();
    for n in dag.node_indices().filter(|n| waiting[n.index()] == 0) {
        ready.push(Reverse((key(n), n.index())));
    }
    let mut order = Vec::with_capacity(dag.node_count());
    while let Some(Reverse((_, index))) = ready.pop() {
        let n = NodeIndex::new(index);
        order.push(dag[n]);
        for edge in dag.edges(n) {
            let to = edge.target();
            waiting[to.index()] -= 1;
            if waiting[to.index()] == 0 {
                ready.push(Reverse((key(to), to.index())));
            }
        }
    }
    order
}

/// One cycle for each group of nodes that reach each other, starting with its first node in document order.
pub(crate) fn cycles<E>(dag: &Dag<E>) -> Vec<Vec<NodeIndex>> {
    let mut found = Vec::new();
    for group in tarjan_scc(dag) {
        let Some(start) = group.iter().copied().min_by_key(|n| dag[*n]) else { continue };
        if group.len() > 1 || dag.find_edge(start, start).is_some() {
            found.extend(shortest_cycle(dag, start));
        }
    }
    found.sort_by_key(|cycle| cycle.first().map(|n| dag[*n]));
    found
}

/// Breadth-first from `start` back to it.
fn shortest_cycle<E>(dag: &Dag<E>, start: NodeIndex) -> Option<Vec<NodeIndex>> {
    let mut parent = vec![None; dag.node_count()];
    let mut queue = std::collections::VecDeque::from([start]);
    while let Some(at) = queue.pop_front() {
        for next in dag.neighbors(at) {
            if next == start {
                let mut path = vec![at];
                let mut back = at;
                while back != start {
                    back = parent[back.index()]?;
                    path.push(back);
                }
                path.reverse();
                return Some(path);
            }
            if parent[next.index()].is_none() {
                parent[next.index()] = Some(at);
                queue.push_back(next);
            }
        }
    }
    None
}

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}

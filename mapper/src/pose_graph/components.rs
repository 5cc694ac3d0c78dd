//! Which nodes hang together.

/// For every node the lowest node that a chain of edges leads to.
pub(super) fn components(nodes: usize, edges: impl Iterator<Item = (usize, usize)>) -> Vec<usize> {
    let mut parent: Vec<usize> = (0..nodes).collect();
    for (a, b) in edges {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        // The lowest index is the root, so that it can stand for the component.
        let (low, high) = (a.min(b), a.max(b));
        parent[high] = low;
    }
    (0..nodes).map(|node| root(&mut parent, node)).collect()
}

fn root(parent: &mut [usize], mut node: usize) -> usize {
    while parent[node] != node {
        parent[node] = parent[parent[node]];
        node = parent[node];
    }
    node
}

#[cfg(test)]
mod tests {
    use super::components;

    #[test]
    fn the_lowest_node_names_its_component() {
        let edges = [(5, 4), (1, 2), (4, 6), (2, 5)];
        assert_eq!(components(7, edges.into_iter()), [0, 1, 1, 3, 1, 1, 1]);
        assert_eq!(components(3, [(1, 2), (2, 1)].into_iter()), [0, 1, 1]);
        assert!(components(0, [].into_iter()).is_empty());
    }
}

//! Why a pose graph refuses something.

/// Why a pose graph refuses something.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A node that is not there.
    #[error("node {node}: the graph has {count}")]
    NoNode {
        /// The index asked for.
        node: usize,
        /// How many there are.
        count: usize,
    },
    /// An edge from a node to itself has no information.
    #[error("an edge from node {0} to itself")]
    SameNode(usize),
    /// A number that no measurement has.
    #[error("edge {from} -> {to}: {what}")]
    BadEdge {
        /// First node.
        from: usize,
        /// Second node.
        to: usize,
        /// What is wrong and what would be right.
        what: String,
    },
    /// A pose that is not finite or too far away.
    #[error("pose ({x_m}, {y_m}, {yaw_rad}): coordinates are finite and below {limit_m} m")]
    BadPose {
        /// m.
        x_m: f64,
        /// m.
        y_m: f64,
        /// rad.
        yaw_rad: f64,
        /// The farthest that is taken, m.
        limit_m: f64,
    },
    /// Names of loops that do not rise, or are to be given again: the next name.
    #[error("the loops' names do not rise to below {0}")]
    LoopNames(u64),
    /// A node that is no unknown any more.
    #[error("node {0} was marginalized")]
    Marginalized(usize),
    /// A node that cannot be marginalized.
    #[error(
        "node {0} cannot stand on another one: it needs odometry on both sides, no other on it, and an unknown of its component to stand on"
    )]
    NotBetween(usize),
    /// Two nodes without a chain of edges between them.
    #[error("nodes {from} and {to} are in components of the graph that no edge connects")]
    NotConnected {
        /// First node.
        from: usize,
        /// Second node.
        to: usize,
    },
    /// The equations have no solution, however much they are damped.
    #[error(
        "the equations of {unknowns} poses are not positive definite with a damping of {damping:e}"
    )]
    Singular {
        /// Poses that were to be found.
        unknowns: usize,
        /// The last damping tried, relative to the diagonal.
        damping: f64,
    },
    /// The library that factorises could not do so.
    #[error("factorising {unknowns} poses: {what}")]
    Factorisation {
        /// Poses that were to be found.
        unknowns: usize,
        /// Its word.
        what: String,
    },
}

//! What can be wrong with a world's file.

/// What is wrong with a world, where, and what would be right.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum WorldError {
    /// A word that cannot stand there.
    #[error("line {line}: {word:?}: expected {expected}")]
    Word {
        /// Counted from 1.
        line: usize,
        /// As it stands in the file.
        word: String,
        /// What would be right.
        expected: String,
    },
    /// A line that ends too early.
    #[error("line {line}: {statement:?} ends too early: expected {expected}")]
    Short {
        /// Counted from 1.
        line: usize,
        /// The line's first word.
        statement: String,
        /// What would be right.
        expected: String,
    },
    /// Nothing to drive along.
    #[error(
        "the route has {corners} corners: expected a line \"route X,Y X,Y X,Y ...\" of at least 3"
    )]
    Route {
        /// Corners of all route lines.
        corners: usize,
    },
    /// More than a simulation is meant for.
    #[error(
        "line {line}: the walls up to here are {length_m:.0} m in {walls} pieces: expected at most \
         {length_max_m:.0} m in {walls_max}"
    )]
    Large {
        /// Counted from 1.
        line: usize,
        /// Length of all walls.
        length_m: f64,
        /// Straight pieces of all walls.
        walls: usize,
        /// The longest that may be.
        length_max_m: f64,
        /// The most that may be.
        walls_max: usize,
    },
}

//! Normal distributions transform with intensity as third dimension.

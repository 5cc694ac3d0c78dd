//! Tests of whole inputs: written by `support`, rewritten, cut, mutated, read back.

mod bags;
mod damage;
mod learning;
mod mounting;
mod oxford;
mod support;
mod twists;

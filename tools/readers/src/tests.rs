//! Tests of whole inputs: written by `support`, rewritten, cut, mutated, read back.

mod bags;
mod choices;
mod damage;
mod data_sets;
mod layouts;
mod learning;
mod live;
mod mounting;
mod mutated;
mod navtech;
mod oxford;
mod support;
mod twists;

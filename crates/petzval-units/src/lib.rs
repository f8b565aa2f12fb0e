//! Many jobs: each is a unit of work with a key of its own in a store that several processes share.

pub mod runs;
pub mod sweep;

//! Generators of objects: each draws one object of a family from a random stream.

pub(crate) mod furniture;
pub(crate) mod house;
pub(crate) mod person;
pub(crate) mod signal;
pub(crate) mod tree;
pub(crate) mod truck;
pub(crate) mod vehicle;

//! Networks, losses and data sets of the camera.
//!
//! The input of this crate is the developed picture.
//!
//! | module | holds |
//! |---|---|
//! | [`network`] | the network that improves the picture |
//! | [`loss`] | losses: the distance between a picture and the photograph |
//! | [`metric`] | scores in the form of the literature |
//! | [`dataset`] | photographs, split into training and held-out pictures |
//! | [`task`] | a network with its loss and optimiser |
//!
//! Pictures are tensors of shape `[batch, channel, row, column]`, sRGB-encoded, about 0..1. Networks and losses take and
//! return tensors on the device on which they were made. Files are read only by [`dataset::load_folder`] and
//! [`task::Task::load`].

pub mod dataset;
pub mod loss;
pub mod metric;
pub mod network;
pub mod task;

pub use burn::prelude::Device;

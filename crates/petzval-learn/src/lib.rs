//! Networks, losses and data sets of the camera.
//!
//! Light has become a developed picture by the time it reaches this crate. Here a network improves the picture
//! ([`network`]), a loss says how far it is from the photograph ([`loss`]), a metric says it in the words of the
//! literature ([`metric`]), and a data set says which photographs are for training and which are for judging
//! ([`dataset`]).
//!
//! Pictures are tensors of shape `[batch, channel, row, column]`, sRGB-encoded, about 0..1. Networks and losses take
//! and return tensors on the device they were made on; the library reads no file but the folder named to
//! [`dataset::load_folder`].

pub mod dataset;
pub mod loss;
pub mod metric;
pub mod network;
pub mod task;

pub use burn::prelude::Device;

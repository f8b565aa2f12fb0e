//! Networks, losses and data sets of the camera.
//!
//! Light has become a developed picture by the time it reaches this crate. Here a network improves the picture
//! ([`network`]), an [`objective`] says what the camera is for in terms of [`loss`]es, a [`score`] says how good the
//! result is in the numbers of the literature, and a [`dataset`] says which photographs are for training and which are
//! for scoring.
//!
//! Pictures are tensors of shape `[batch, channel, row, column]`, sRGB-encoded, about 0..1. Networks and losses take
//! and return tensors on the device they were made on; the library reads no file but the folder named to
//! [`dataset::load_folder`].

pub mod dataset;
pub mod loss;
pub mod network;
pub mod objective;
pub mod score;

pub use burn::prelude::Device;

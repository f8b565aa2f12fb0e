//! Networks, losses and data sets of the camera.
//!
//! The input of this crate is the developed picture.
//!
//! | module | holds |
//! |---|---|
//! | [`network`] | the network that improves the picture |
//! | [`detection`] | networks that find objects |
//! | [`guest`], [`guest_task`] | networks, losses and scores of a user, in another language |
//! | [`loss`] | losses: the distance between a picture and the photograph |
//! | [`optimizer`] | how weights are moved where Adam alone is slow |
//! | [`proxy_isp`] | a network in place of an image signal processor |
//! | [`score`] | how good a picture is, and how well objects are detected in it, in the numbers of the literature |
//! | [`weight_file`] | weights of any network as bytes |
//! | [`any_network`] | a network of any kind from its weights alone, with a name for each of them |
//! | [`convolution`] | convolutions as values: which kind, of which shape |
//! | [`device_check`] | whether a device computes them as the CPU does |
//! | [`dataset`] | photographs, split into training and held-out pictures |
//!
//! Pictures are tensors of shape `[batch, channel, row, column]`, sRGB-encoded, about 0..1. Networks and losses take and
//! return tensors on the device on which they were made. Files are read only by [`dataset`].

pub mod any_network;
pub mod convolution;
pub mod dataset;
pub mod detection;
pub mod device_check;
pub mod guest;
pub mod guest_task;
pub mod loss;
pub mod network;
pub mod optimizer;
pub mod proxy_isp;
pub mod score;
pub mod weight_file;

pub use burn::prelude::Device;

//! Tests of the networks and of the operations below them.

mod conv;
mod isp_proxy;
mod naf;
mod pointwise;
mod segmenter;
mod stored;
mod support;
mod tiles;
mod unet;

//! A trained network from its folder.

use std::path::Path;

use burn::prelude::*;
use petzval_files::optics_proxy_file::OpticsProxyFile;
use petzval_files::write_lens;
use petzval_learn::network::OpticsProxyConfig;
use petzval_optics::design_space::Focus;

use super::proxy::{ProxyDomain, ProxyOptics, Scale};
use crate::error::{DesignError, Result};
use crate::lens::psf_plan::PsfPlan;
use crate::lens::start::Start;

/// The files of a network's folder.
pub const FILES: [&str; 3] = ["proxy.toml", "lens.toml", "weights.bin"];

const TRAIN: &str = "train one for this experiment: `petzval train optics-proxy EXPERIMENT --out FOLDER`";

/// Reads the network that a description names, for the lenses of a start and the PSFs of a plan. One that was trained for others is
/// refused.
pub fn read_proxy_optics(path: &Path, start: &Start, plan: &PsfPlan, device: &Device) -> Result<ProxyOptics> {
    let text = petzval_base::read_text(path).map_err(DesignError::io(path))?;
    let file = OpticsProxyFile::parse(&text).map_err(DesignError::input(path))?;
    let beside = |name: &str| path.parent().unwrap_or(Path::new("")).join(name);
    let misfit = |message: &str| DesignError::misfit(path, &message, TRAIN);

    let lens = beside(&file.lens);
    let lens = petzval_base::read_text(&lens).map_err(DesignError::io(&lens))?;
    if lens != write_lens(&start.lens_file) {
        return Err(misfit("was trained for another lens, or for other bounds of its variables"));
    }
    let space = start.space.space();
    if space.focus() != (Focus::Paraxial { range_mm: file.defocus_mm }) {
        return Err(misfit("was trained for another range of defocus, optics.defocus_mm"));
    }
    let domain = ProxyDomain::of(plan).map_err(|(key, hint)| {
        DesignError::misfit(path, &format!("cannot give the PSFs of this experiment's {key}"), &hint)
    })?;
    let OpticsProxyFile { wavelengths_um, grid, pitch_um, corner_mm, .. } = file;
    if domain != (ProxyDomain { wavelengths_um, grid, pitch_um, corner_mm }) {
        return Err(misfit("was trained for other PSFs: wavelengths, grid, pitch or sensor differ"));
    }
    if file.mean.len() != space.dimension() + 1 {
        return Err(misfit("has another number of inputs than the lens has variables"));
    }
    let scale = Scale { mean: file.mean, deviation: file.deviation };
    let config =
        OpticsProxyConfig { hidden: file.hidden, channels: file.channels, ..OpticsProxyConfig::default() };
    let weights = beside(&file.weights);
    let bytes = petzval_base::read_whole(&weights).map_err(DesignError::io(&weights))?;
    let proxy = ProxyOptics::new(space.clone(), domain, scale, config, 0, device)?;
    proxy.with_weights(bytes).map_err(|e| DesignError::misfit(&weights, &e, TRAIN))
}

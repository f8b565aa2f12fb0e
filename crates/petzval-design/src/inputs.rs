//! What a run was made from. Its folder keeps lens and sensor, so that it stands on its own; of photographs it keeps a
//! fingerprint, because a run that went on with other pictures would be worth nothing.

use std::path::{Path, PathBuf};

use petzval_files::write_lens;
use sha2::{Digest, Sha256};

use crate::assets::Assets;
use crate::error::DesignError;
use crate::experiment::{Experiment, is_derived_lens};
use crate::optics_proxy::FILES;
use crate::run::{RunFolder, RunRecord, write_file};
use crate::setup::Setup;

/// SHA-256 of the lens with its glasses, the sensor, the hardware ISP, the networks in place of tracing and
/// given weights of a network or a detector if there are any, and every photograph by name and content.
pub fn fingerprint(setup: &Setup) -> Result<String, DesignError> {
    let mut hash = Sha256::new();
    for variant in &setup.variants {
        hash.update(write_lens(&setup.start(variant).lens_file));
    }
    hash.update(DesignError::json("the sensor", &setup.body.sensor)?);
    if let Some(chip) = &setup.body.chip {
        match chip.settings() {
            Some(settings) => hash.update(DesignError::json("the ISP", settings)?),
            // Of an ISP outside this program the description is known, with its command and version, and its values.
            None => {
                hash.update(chip.description());
                for (parameter, value) in chip.parameters().iter().zip(chip.values()) {
                    hash.update(format!(
                        "{} {} {} {value}",
                        parameter.name, parameter.about.min, parameter.about.max
                    ));
                }
            }
        }
    }
    for path in setup.variants.iter().filter_map(|v| v.optics_proxy.as_ref()) {
        for file in proxy_files(Path::new(path)) {
            hash.update(read(&file)?);
        }
    }
    if let Some(weights) = &setup.network_weights {
        hash.update(weights);
    }
    let photos = &setup.photos;
    let lists = [
        ("training", photos.training()),
        ("validation", photos.validation()),
        ("held out", photos.held_out()),
    ];
    for (list, photos) in lists {
        for photo in photos {
            hash.update(format!("{list}: {} {}x{}", photo.name, photo.image.height, photo.image.width));
            for value in &photo.image.data {
                hash.update(value.to_le_bytes());
            }
        }
    }
    if let Some(scenes) = &setup.scenes {
        hash.update(scenes.fingerprint()?);
    }
    Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Keeps in a new run folder what the run is made from, and writes the `config.toml` that names it, and its record.
pub fn keep_inputs(setup: &Setup, assets: &Assets, run: &RunFolder) -> Result<(), DesignError> {
    let experiment = &setup.experiment;
    // The setup has read the lens already, and reported its warnings.
    let lens = assets.import(&experiment.lens)?.file;
    write_file(&run.nominal_lens(), write_lens(&lens).as_bytes())?;
    let sensor = assets.text("sensor", "sensors", &experiment.sensor)?;
    write_file(&run.sensor(), sensor.text.as_bytes())?;
    write_file(&run.fingerprint(), format!("{}\n", fingerprint(setup)?).as_bytes())?;
    // Names in an experiment are looked for beside it.
    let mut kept = Experiment {
        lens: "inputs/lens.toml".to_owned(),
        sensor: "inputs/sensor.toml".to_owned(),
        ..experiment.clone()
    };
    if kept.isp.is_used() {
        let preset = assets.text("ISP", "isp", &kept.isp.preset)?;
        write_file(&run.input("isp.toml"), preset.text.as_bytes())?;
        // The command of an external ISP lies where its description does.
        kept.isp.preset = match setup.body.chip.as_ref().and_then(|chip| chip.settings()) {
            Some(_) => "inputs/isp.toml".to_owned(),
            None => std::path::absolute(&preset.path)
                .map_err(DesignError::io(&preset.path))?
                .display()
                .to_string(),
        };
    }
    // The built-in ones are known by their fingerprint, as the built-in photographs are.
    if let Some(weights) = &setup.network_weights {
        if kept.task.finds_objects() {
            let ending = if kept.detector.safetensors().is_some() { "safetensors" } else { "bin" };
            let name = format!("detector-weights.{ending}");
            write_file(&run.input(&name), weights)?;
            kept.detector.weights = Some(format!("inputs/{name}"));
        } else if !kept.network.has_built_in_weights() {
            write_file(&run.input("network.safetensors"), weights)?;
            kept.network.weights = "inputs/network.safetensors".to_owned();
        }
    }
    for variant in &mut kept.variant {
        if let Some(name) = variant.lens.as_mut().filter(|name| !is_derived_lens(name)) {
            let file = format!("{}-lens.toml", variant.name);
            let lens = assets.import(name)?.file;
            write_file(&run.input(&file), write_lens(&lens).as_bytes())?;
            *name = format!("inputs/{file}");
        }
        if let Some(proxy) = &mut variant.optics_proxy {
            let folder = format!("{}-optics-proxy", variant.name);
            for file in proxy_files(Path::new(proxy.as_str())) {
                let bytes = read(&file)?;
                let name = file.file_name().unwrap_or_default().to_string_lossy();
                let kept = run.input(&folder).join(&*name);
                make_parent(&kept)?;
                write_file(&kept, &bytes)?;
            }
            *proxy = format!("inputs/{folder}/{}", FILES[0]);
        }
    }
    let text = kept.to_toml()?;
    RunRecord::begin(kept).write(run)?;
    write_file(&run.config(), text.as_bytes())
}

fn read(path: &Path) -> Result<Vec<u8>, DesignError> {
    petzval_base::read_whole(path).map_err(DesignError::io(path))
}

/// The files of a network whose description lies here.
fn proxy_files(description: &Path) -> impl Iterator<Item = PathBuf> {
    let folder = description.parent().unwrap_or(Path::new("")).to_owned();
    FILES.into_iter().map(move |file| folder.join(file))
}

fn make_parent(path: &Path) -> Result<(), DesignError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    std::fs::create_dir_all(folder).map_err(DesignError::io(folder))
}

/// Refuses to go on with a run, or to score it again, from other inputs than it was made from.
pub fn check_inputs(setup: &Setup, run: &RunFolder) -> Result<(), DesignError> {
    let path = run.fingerprint();
    let noted = petzval_base::read_text(&path).map_err(DesignError::io(&path))?;
    if noted.trim() == fingerprint(setup)? {
        return Ok(());
    }
    let problem = "lens, glasses, sensor, ISP, networks in place of tracing, given weights, photographs or labelled pictures \
                   are not those that this run began with, or an earlier version began it; put them back, or start a new run";
    let problem = problem.to_owned();
    Err(DesignError::Run { path, problem })
}

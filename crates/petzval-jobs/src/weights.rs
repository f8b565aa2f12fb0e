//! `weights`: the weights of a network by name, and a file of them.

use std::path::{Path, PathBuf};

use petzval_design::error::DesignError;
use petzval_learn::any_network::{FileNames, NamedNetwork};
use petzval_learn::network::NetworkError;
use petzval_learn::weight_file::NamedArray;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::as_unit::{AsUnit, within};
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::results::{check_file, has_ending, write_result};

/// Files of weights in the folder of a camera, and in that of a proxy.
const FILES: [&str; 2] = ["network.safetensors", "weights.safetensors"];

/// The ending of files of weights.
const ENDING: &str = "safetensors";

/// By which names a file has weights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum WeightNames {
    /// As files of runs have them.
    #[default]
    Petzval,
    /// As torchvision has them: for detectors of two stages on one of its backbones alone.
    Torchvision,
}

/// Weights to list, and to write to a file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// The weights: a safetensors file, the folder of a run, of a camera or of a proxy, or a built-in name such as `restoration_naf`.
    pub weights: PathBuf,
    /// The camera of a run; it need not be named where one has weights.
    pub camera: Option<String>,
    /// What the network is, where neither its weights nor their file say so, such as `segmenter`.
    pub kind: Option<String>,
    /// The safetensors file to write; none to list the weights alone.
    pub to: Option<PathBuf>,
    /// By which names the file has them.
    pub names: WeightNames,
}

/// A network and its weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// What the network is.
    pub kind: String,
    /// Its sizes.
    pub settings: Value,
    /// Its weights in the order of the layers: those of detectors under torchvision's names where torchvision has such weights.
    pub weights: Vec<WeightRow>,
    /// The file that was written.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub to: Option<PathBuf>,
}

/// A weight in a few numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WeightRow {
    /// Its name.
    pub name: String,
    /// Its shape.
    pub shape: Vec<usize>,
    /// Root of the mean square of its numbers.
    pub rms: f64,
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> = AsUnit::placed(|request, folder| {
    request.to = request.to.as_ref().map(|to| within(folder, to, "weights.safetensors"));
});

/// Reads the weights, and writes them if a file is named.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    if let Some(to) = &request.to {
        check_ending(to)?;
        check_file(to, context)?;
    }
    let network = network(request, context)?;
    let spec = network.spec();
    let mut whole = serde_json::to_value(spec).map_err(|e| JobError::failed(e.to_string()))?;
    let tensors = network.tensors().map_err(|e| JobError::failed(e.to_string()))?;
    if let Some(to) = &request.to {
        let names = match request.names {
            WeightNames::Petzval => FileNames::Petzval,
            WeightNames::Torchvision => FileNames::Torchvision,
        };
        let refused = |e: NetworkError| JobError::input(e.to_string(), "leave out the names of torchvision");
        write_result(to, network.to_file(names).map_err(refused)?, context)?;
        context.wrote(to, "weights");
    }
    Ok(Response {
        kind: spec.kind().to_owned(),
        settings: whole.get_mut("settings").map(Value::take).unwrap_or_default(),
        weights: tensors.into_iter().map(row).collect(),
        to: request.to.clone(),
    })
}

fn row(weight: NamedArray) -> WeightRow {
    let NamedArray { name, shape, values } = weight;
    let square: f64 = values.iter().map(|value| f64::from(*value).powi(2)).sum();
    WeightRow { name, shape, rms: (square / values.len().max(1) as f64).sqrt() }
}

/// The network that a request names.
fn network(request: &Request, context: &Context) -> Result<NamedNetwork> {
    let (path, kind) = (&request.weights, request.kind.as_deref());
    let misfit = |error: NetworkError| {
        let hint = "give all weights of one network, and its `kind` if they fit several";
        JobError::input(format!("{}: {error}", path.display()), hint)
    };
    if !path.exists() {
        let built_in = path.to_str().map(|name| context.assets.bytes(&format!("weights/{name}.{ENDING}")));
        let Some(Ok(bytes)) = built_in else {
            let message =
                format!("{}: there is no such file, and no built-in weights have this name", path.display());
            return Err(JobError::input(message, "built in are restoration_naf and restoration_naf_waves"));
        };
        return NamedNetwork::read(bytes, kind).map_err(misfit);
    }
    let file = file_of(path, request.camera.as_deref())?;
    let bytes = petzval_base::read_whole(&file).map_err(DesignError::io(&file))?;
    NamedNetwork::read(&bytes, kind).map_err(misfit)
}

/// The file of weights that a path stands for.
fn file_of(path: &Path, camera: Option<&str>) -> Result<PathBuf> {
    let cameras = path.join("cameras");
    if !cameras.is_dir() {
        if let Some(name) = camera {
            let message = format!("{} is not the folder of a run", path.display());
            return Err(JobError::setting(
                "camera",
                name,
                message,
                "leave it out, or name the folder of a run",
            ));
        }
        if !path.is_dir() {
            return Ok(path.to_owned());
        }
        let known = FILES.iter().map(|name| path.join(name)).find(|file| file.is_file());
        return known.ok_or_else(|| {
            let message = format!("{}: there are no weights in this folder", path.display());
            JobError::input(message, format!("name a run, or a folder with {}", FILES.join(" or ")))
        });
    }
    let mut made = Vec::new();
    for entry in std::fs::read_dir(&cameras).map_err(DesignError::io(&cameras))? {
        let entry = entry.map_err(DesignError::io(&cameras))?;
        if entry.path().join(FILES[0]).is_file() {
            made.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    made.sort();
    let named = match (camera, &made[..]) {
        (None, [only]) => Some(only.as_str()),
        (name, made) => name.filter(|name| made.iter().any(|made| made == name)),
    };
    let Some(name) = named else {
        let found = if made.is_empty() { "none".to_owned() } else { made.join(", ") };
        let hint = format!(
            "cameras with weights of a network of Petzval are: {found}; the state of a class in Python is in blocks/network/weights.bin of its camera"
        );
        let message = format!("{}: which camera?", path.display());
        return Err(match camera {
            Some(name) => {
                JobError::setting("camera", name, "there are no weights of a camera of this name", hint)
            }
            None => JobError::input(message, hint),
        });
    };
    Ok(cameras.join(name).join(FILES[0]))
}

/// Fails unless a file to write ends as files of weights do.
fn check_ending(to: &Path) -> Result<()> {
    if has_ending(to, ENDING) {
        return Ok(());
    }
    let message = format!("{}: weights are written to files that end in .{ENDING}", to.display());
    Err(JobError::input(
        message,
        "NumPy has its own: numpy.savez(FILE, **petzval.Weights.load(PATH).tensors)",
    ))
}

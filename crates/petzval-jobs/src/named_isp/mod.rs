//! ISPs by name: a preset of the built-in ISP, a file of settings, or the description of an external ISP or of a proxy.

pub mod external;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use petzval_base::Cancel;
use petzval_camera::isp::{
    Clipped, FrameData, GainKnot, HardwareIsp, Isp, IspError, IspParameter, IspPreset, IspSettings, RawInput,
    RgbPicture, check_values,
};
use petzval_design::assets::{Assets, OutsideIsp};
use petzval_design::error::DesignError;
use petzval_files::isp_file::{
    ExternalIspFile, IspFile, IspProxyFile, parse_isp_file, preset_toml, settings_toml,
};
use petzval_learn::Device;
use petzval_learn::network::IspProxyConfig;
use petzval_learn::proxy_isp::{FRAME_NUMBERS, ProxyIsp};
use petzval_learn::weight_file::Weights;
use serde::Serialize;

use self::external::ExternalIsp;
use crate::error::{JobError, Result, Stopped};

/// Name of the settings in which every parameter of the built-in ISP has its default.
pub const NEUTRAL: &str = "neutral";

/// Number of runs over which the median time of each stage is taken.
const TIMED_RUNS: usize = 9;

/// An ISP that a name stands for, with values for all of its parameters.
pub struct NamedIsp {
    /// Its parameters.
    pub parameters: Vec<IspParameter>,
    kind: Kind,
    /// Places and values that were set beside those of the file.
    changes: Vec<(usize, f64)>,
}

enum Kind {
    /// Ours, with values by the gain of the sensor.
    BuiltIn { isp: Box<HardwareIsp>, preset: Box<IspPreset> },
    /// A command, with the path of its description.
    External { isp: Box<ExternalIsp>, values: Vec<f64>, description: PathBuf },
    /// A network that imitates another.
    Proxy { isp: Box<ProxyIsp>, values: Vec<f64>, of: Box<NamedIsp> },
}

/// The ISP of a name: [`NEUTRAL`], a preset of `crates/petzval-data/data/isp/`, or the path of a preset, of settings, or of the description of an external
/// ISP or of a proxy. The flag stops the calls of an external ISP.
pub fn isp_by_name(name: &str, assets: &Assets, cancel: &Cancel) -> Result<NamedIsp> {
    if name == NEUTRAL && !Path::new(name).is_file() {
        return Ok(NamedIsp::of_preset(IspPreset::default()));
    }
    let source = assets.text("ISP", "isp", name).map_err(with_neutral)?;
    let settings = match parse_isp_file(&source.text).map_err(DesignError::input(&source.path))? {
        IspFile::Preset(preset) => return Ok(NamedIsp::of_preset(*preset)),
        IspFile::External(about) => return NamedIsp::external(about, &source.path, cancel),
        IspFile::Proxy(about) => return NamedIsp::proxy(&about, &source.path, assets, cancel),
        IspFile::Settings(settings) => settings,
    };
    // A relative path begins at the file that names it.
    let path = source.path.parent().unwrap_or(Path::new("")).join(&settings.isp);
    let wrong = |reason: String| {
        let message =
            format!("{}: `isp = \"{}\"`: {}: {reason}", source.path.display(), settings.isp, path.display());
        JobError::input(
            message,
            "give the path of the description of an external ISP, from the folder of the settings",
        )
    };
    let text = petzval_base::read_text(&path).map_err(|e| wrong(e.to_string()))?;
    let IspFile::External(about) = parse_isp_file(&text).map_err(DesignError::input(&path))? else {
        return Err(wrong("no description, which has the key `command`".to_owned()));
    };
    let mut named = NamedIsp::external(about, &path, cancel)?;
    if let Kind::External { values, .. } = &mut named.kind {
        *values = settings.values(&named.parameters).map_err(DesignError::input(&source.path))?;
    }
    Ok(named)
}

/// An error about an unknown name that lists [`NEUTRAL`] among the known ones.
fn with_neutral(error: DesignError) -> DesignError {
    match error {
        DesignError::Unknown { kind, name, near, known } => {
            let near = near.or(petzval_base::nearest(&name, &[NEUTRAL]).map(str::to_owned));
            DesignError::Unknown { kind, name, near, known: format!("{NEUTRAL}, {known}") }
        }
        other => other,
    }
}

/// The external ISP of a description, or of settings for one, in a camera that is designed. The flag stops its calls.
pub(crate) fn external_isp(path: &Path, cancel: &Cancel) -> Result<OutsideIsp, DesignError> {
    let named =
        isp_by_name(&path.display().to_string(), &Assets::default(), cancel).map_err(
            |error| match error {
                JobError::File { path, error } => DesignError::Input { path, error },
                other => DesignError::misfit(path, &other, "`petzval isp show` reads the same file"),
            },
        )?;
    let Kind::External { isp, values, description } = named.kind else {
        return Err(DesignError::misfit(path, &"describes no external ISP", "give its description"));
    };
    let description = petzval_base::read_text(&description).map_err(DesignError::io(&description))?;
    Ok(OutsideIsp { isp: Arc::from(isp as Box<dyn Isp>), values, description })
}

impl NamedIsp {
    /// Whether it is a command, or a network that imitates one.
    pub fn is_external(&self) -> bool {
        match &self.kind {
            Kind::BuiltIn { .. } => false,
            Kind::External { .. } => true,
            Kind::Proxy { of, .. } => of.is_external(),
        }
    }

    /// The built-in ISP with the values of a preset.
    pub fn of_preset(preset: IspPreset) -> Self {
        let isp = Box::new(HardwareIsp { settings: preset.settings.clone() });
        let preset = Box::new(preset);
        Self {
            parameters: IspSettings::parameters(),
            kind: Kind::BuiltIn { isp, preset },
            changes: Vec::new(),
        }
    }

    fn external(about: ExternalIspFile, path: &Path, cancel: &Cancel) -> Result<Self> {
        let home = path.parent().filter(|home| !home.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let cache = about.cache.clone().unwrap_or_default();
        let isp = ExternalIsp::new(about, home, cancel.clone()).map_err(|e| {
            let message = format!("{}: `cache = \"{cache}\"`: {e}", path.display());
            JobError::input(message, "give a folder that can be written")
        })?;
        let description =
            std::path::absolute(path).map_err(|e| JobError::failed(format!("{}: {e}", path.display())))?;
        let (parameters, values) = (isp.parameters(), isp.defaults());
        let isp = Box::new(isp);
        Ok(Self { parameters, kind: Kind::External { isp, values, description }, changes: Vec::new() })
    }

    fn proxy(about: &IspProxyFile, path: &Path, assets: &Assets, cancel: &Cancel) -> Result<Self> {
        let wrong = |message: String| {
            let hint = "the description and the weights of one `petzval train isp-proxy` belong together";
            JobError::input(format!("{}: {message}", path.display()), hint)
        };
        let of = isp_by_name(&about.proxy_of, assets, cancel)?;
        if matches!(of.kind, Kind::Proxy { .. }) {
            return Err(wrong(format!("`proxy_of = \"{}\"` is a proxy itself", about.proxy_of)));
        }
        let value = |p: &IspParameter| {
            about.values.get(&p.name).copied().ok_or_else(|| wrong(format!("[values] lacks {}", p.name)))
        };
        let values: Vec<f64> = of.parameters.iter().map(value).collect::<Result<_, _>>()?;
        check_values(&of.parameters, &values).map_err(|e| wrong(e.to_string()))?;
        let place =
            |name: &String| of.place(name).map_err(|_| wrong(format!("no parameter is called {name}")));
        let varied: Vec<usize> = about.varied.iter().map(place).collect::<Result<_, _>>()?;
        let weights = path.parent().unwrap_or(Path::new("")).join(&about.weights);
        let bytes =
            petzval_base::read_whole(&weights).map_err(|e| wrong(format!("{}: {e}", weights.display())))?;
        let config = IspProxyConfig {
            parameters: varied.len() + FRAME_NUMBERS,
            base_channels: about.base_channels,
            levels: about.levels,
            ..IspProxyConfig::default()
        };
        let network = config.init(0, &Device::flex()).and_then(|network| network.load_any(bytes));
        let network = network.map_err(|e| wrong(format!("{}: {e}", weights.display())))?;
        let isp = Box::new(ProxyIsp::new(of.isp(), varied, values.clone(), network));
        let parameters = of.parameters.clone();
        Ok(Self { parameters, kind: Kind::Proxy { isp, values, of: Box::new(of) }, changes: Vec::new() })
    }

    /// The preset of the built-in ISP, without what was set beside it; none of another ISP.
    pub fn preset(&self) -> Option<&IspPreset> {
        match &self.kind {
            Kind::BuiltIn { preset, .. } => Some(preset),
            Kind::External { .. } | Kind::Proxy { .. } => None,
        }
    }

    /// The ISP behind its interface.
    pub fn isp(&self) -> &dyn Isp {
        match &self.kind {
            Kind::BuiltIn { isp, .. } => isp.as_ref(),
            Kind::External { isp, .. } => isp.as_ref(),
            Kind::Proxy { isp, .. } => isp.as_ref(),
        }
    }

    /// What makes its pictures, in words: name, methods, parameters with their ranges and values.
    pub fn in_words(&self, values: &[f64]) -> String {
        let methods = match &self.kind {
            Kind::BuiltIn { isp, .. } => format!("{:?} {:?}", isp.settings.demosaic, isp.settings.domain),
            Kind::External { .. } | Kind::Proxy { .. } => String::new(),
        };
        let lines = self.parameters.iter().zip(values).map(|(parameter, value)| {
            let IspParameter { name, about } = parameter;
            format!("{name} {} {} {value}\n", about.min, about.max)
        });
        format!("{} {methods}\n{}", self.isp().name(), lines.collect::<String>())
    }

    /// The values at a gain of the sensor, EV.
    pub fn values(&self, gain_ev: f64) -> Result<Vec<f64>> {
        let mut values = match &self.kind {
            Kind::BuiltIn { preset, .. } => preset
                .at_gain(gain_ev)
                .map_err(|e| JobError::input(e.to_string(), "correct the preset"))?
                .values(),
            Kind::External { values, .. } | Kind::Proxy { values, .. } => values.clone(),
        };
        for (place, value) in &self.changes {
            values[*place] = *value;
        }
        Ok(values)
    }

    /// Sets the bits of the pictures of the built-in ISP. An external ISP decides itself, and a proxy makes 16.
    pub fn set_bits(&mut self, bits: u32) {
        if let Kind::BuiltIn { isp, .. } = &mut self.kind {
            isp.settings.bits = bits;
        }
    }

    /// The picture after each stage, with the name of the stage; of another ISP only the result is known.
    pub fn develop_steps(
        &self,
        frame: &RawInput,
        values: &[f64],
    ) -> Result<Vec<(String, RgbPicture)>, IspError> {
        let mut steps = Vec::new();
        let last = match &self.kind {
            Kind::BuiltIn { isp, .. } => HardwareIsp { settings: isp.settings.with_values(values)? }
                .develop_steps(frame, &mut |stage, picture| steps.push((stage.to_owned(), picture)))?,
            Kind::External { .. } | Kind::Proxy { .. } => self.isp().develop(frame, values)?,
        };
        steps.push(("output".to_owned(), last));
        Ok(steps)
    }

    /// The coefficients that the registers of the built-in ISP cut off at these values, if a frame has this calibration. Other ISPs do
    /// not show theirs.
    pub fn clipped(&self, about: &FrameData, values: &[f64]) -> Result<Vec<Clipped>, IspError> {
        let Kind::BuiltIn { isp, .. } = &self.kind else { return Ok(Vec::new()) };
        let settings = isp.settings.with_values(values)?;
        Ok(HardwareIsp { settings }.clipped(about))
    }

    /// The light of a frame that the registers of the built-in ISP cut off, if it is that of many pixels.
    pub fn clipped_light(&self, frame: &RawInput) -> Option<Clipped> {
        matches!(self.kind, Kind::BuiltIn { .. }).then(|| HardwareIsp::clipped_light(frame))?
    }

    /// How long each stage of the built-in ISP takes on a frame, s: medians of some runs. Other ISPs have no stages.
    pub fn stage_times(&self, frame: &RawInput, values: &[f64]) -> Result<Vec<(&'static str, f64)>> {
        let Kind::BuiltIn { isp, .. } = &self.kind else { return Ok(Vec::new()) };
        let failed = |e: IspError| JobError::failed(e.to_string());
        let isp = HardwareIsp { settings: isp.settings.with_values(values).map_err(failed)? };
        isp.stage_times(frame, TIMED_RUNS).map_err(failed)
    }

    /// Changes values by `stage.key=value`, each of which has to be in its range.
    pub fn set(&mut self, changes: &[String]) -> Result<()> {
        for change in changes {
            let wrong = |message: String, hint: String| Err(JobError::setting("set", change, message, hint));
            let Some((name, value)) = change.split_once('=') else {
                return wrong("no value".to_owned(), "write stage.key=value".to_owned());
            };
            let i = self
                .place(name.trim())
                .map_err(|hint| JobError::setting("set", change, "the ISP has no such parameter", hint))?;
            let about = &self.parameters[i].about;
            match value.trim().parse::<f64>() {
                Ok(value) if (about.min..=about.max).contains(&value) => self.changes.push((i, value)),
                _ => {
                    let unit = if about.unit.is_empty() { String::new() } else { format!(" {}", about.unit) };
                    let message = format!("must lie between {} and {}{unit}", about.min, about.max);
                    return wrong(message, about.hint.to_owned());
                }
            }
        }
        Ok(())
    }

    /// Places of the parameters that a name stands for: a parameter, all numbers of an array, all of a stage, or `all`.
    pub fn places(&self, name: &str) -> Result<Vec<usize>, String> {
        let belongs = |p: &IspParameter| {
            name == "all"
                || p.name == name
                || p.name.strip_prefix(name).is_some_and(|rest| rest.starts_with(['.', '[']))
        };
        let places: Vec<usize> =
            (0..self.parameters.len()).filter(|i| belongs(&self.parameters[*i])).collect();
        if !places.is_empty() {
            return Ok(places);
        }
        self.place(name).map(|i| vec![i]).map_err(|hint| self.nearer_stage(name).unwrap_or(hint))
    }

    /// A hint with the stage whose name is at least as near to a name as those of all parameters.
    fn nearer_stage(&self, name: &str) -> Option<String> {
        let distance = |known: &str| strsim::damerau_levenshtein(known, name);
        let stages = self.parameters.iter().filter_map(|p| p.name.split(['.', '[']).next());
        let stage = stages.min_by_key(|stage| distance(stage))?;
        let of_parameters = self.parameters.iter().map(|p| distance(&p.name)).min()?;
        (distance(stage) <= of_parameters)
            .then(|| format!("did you mean {stage}? `petzval isp show` prints all"))
    }

    /// Places of the parameters that several names stand for, each once, in the order of the ISP.
    pub fn all_places(&self, names: &[String]) -> Result<Vec<usize>> {
        let mut places = Vec::new();
        for name in names {
            let found = self.places(name);
            places
                .extend(found.map_err(|hint| {
                    JobError::setting("vary", name, "the ISP has no such parameter", hint)
                })?);
        }
        places.sort_unstable();
        places.dedup();
        if places.is_empty() {
            Err(JobError::setting(
                "vary",
                "",
                "no parameter varies",
                "name parameters or stages, or give all",
            ))
        } else {
            Ok(places)
        }
    }

    /// Place of a parameter; the error is a hint with the nearest name.
    fn place(&self, name: &str) -> Result<usize, String> {
        let found = self.parameters.iter().position(|p| p.name == name);
        found.ok_or_else(|| {
            let distance = |p: &&IspParameter| strsim::damerau_levenshtein(&p.name, name);
            match self.parameters.iter().min_by_key(distance) {
                Some(near) => format!("did you mean {}? `petzval isp show` prints all", near.name),
                None => "the ISP has no parameters".to_owned(),
            }
        })
    }

    /// A file of these values, which [`isp_by_name`] reads.
    pub fn settings_toml(&self, about: &str, values: &[f64]) -> Result<String> {
        match &self.kind {
            Kind::BuiltIn { preset, .. } => {
                let settings = preset.settings.with_values(values);
                Ok(preset_toml(about, &settings.map_err(|e| JobError::failed(e.to_string()))?))
            }
            Kind::External { description, .. } => {
                Ok(settings_toml(about, &description.display().to_string(), &self.parameters, values))
            }
            // What was found with the proxy is for the ISP that it imitates.
            Kind::Proxy { of, .. } => of.settings_toml(about, values),
        }
    }
}

/// A file of a preset with its values by gain, which [`isp_by_name`] reads.
pub fn preset_file(preset: &IspPreset) -> Result<String> {
    #[derive(Serialize)]
    struct Knots<'a> {
        knot: &'a [GainKnot],
    }
    let knots = toml::to_string(&Knots { knot: &preset.knot });
    let knots = knots.map_err(|e| JobError::failed(e.to_string()))?;
    // An empty list would be a key of the last stage.
    let knots = if preset.knot.is_empty() { String::new() } else { format!("\n{knots}") };
    Ok(preset_toml(&preset.about, &preset.settings) + &knots)
}

/// The error of an ISP about the frame of a file.
pub fn about_frame(file: &Path) -> impl Fn(IspError) -> JobError {
    move |error| match error {
        IspError::Input { what, .. } => {
            let hint = match what {
                "colour filter array" => {
                    "ISPs take Bayer mosaics alone; if the frame has one, correct `cfa` in its sidecar"
                }
                "size of the frame" => {
                    "a mosaic is of whole blocks of 2 x 2 pixels: drop the last row or column of an odd side and save the frame as .npy, with its \
                     sidecar: numpy.save(\"even.npy\", dn[: h // 2 * 2, : w // 2 * 2])"
                }
                _ => "correct the frame or its sidecar",
            };
            JobError::input(format!("{}: {error}", file.display()), hint)
        }
        IspError::External(_) => JobError::failed(format!("{}: {error}", file.display())),
        IspError::Stopped(_) => Stopped::new(format!("{}: {error}", file.display())).into(),
        IspError::Count { .. } | IspError::Parameter { .. } => JobError::input(error.to_string(), ""),
    }
}

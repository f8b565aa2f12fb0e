//! ISPs by name: a preset of the built-in ISP, a file of settings, or the description of an external ISP.

use std::path::{Path, PathBuf};

use petzval_camera::isp::{Isp, IspError, IspParameter, RawInput, RgbPicture};
use petzval_design::assets::Assets;
use petzval_design::error::DesignError;
use petzval_files::isp_file::{ExternalIspFile, IspFile, parse_isp_file, settings_toml};

use super::external::ExternalIsp;
use super::plain::PlainIsp;
use crate::error::JobError;

/// Name of the settings in which every parameter of the built-in ISP has its default.
pub const NEUTRAL: &str = "neutral";

/// The ISP that settings without the key `isp` belong to.
type BuiltIn = PlainIsp;

/// An ISP that a name stands for.
pub enum AnyIsp {
    /// Ours.
    BuiltIn(BuiltIn),
    /// A command.
    External(ExternalIsp),
}

impl AnyIsp {
    /// The ISP behind its interface.
    pub fn isp(&self) -> &dyn Isp {
        match self {
            Self::BuiltIn(isp) => isp,
            Self::External(isp) => isp,
        }
    }

    /// The picture after each stage, with the name of the stage; of an external ISP only the result is known.
    pub fn develop_steps(
        &self,
        frame: &RawInput,
        values: &[f64],
    ) -> Result<Vec<(String, RgbPicture)>, IspError> {
        match self {
            Self::BuiltIn(isp) => isp.develop_steps(frame, values),
            Self::External(isp) => Ok(vec![("result".to_owned(), isp.develop(frame, values)?)]),
        }
    }
}

/// An ISP with values for all of its parameters.
pub struct NamedIsp {
    /// The ISP.
    pub isp: AnyIsp,
    /// Its parameters.
    pub parameters: Vec<IspParameter>,
    /// Their values.
    pub values: Vec<f64>,
    /// The description of an external ISP; none for the built-in one.
    pub description: Option<PathBuf>,
}

/// The ISP of a name: [`NEUTRAL`], a preset of `data/isp/`, or the path of a file of settings or of the description of an external ISP.
pub fn isp_by_name(name: &str, assets: &Assets) -> Result<NamedIsp, JobError> {
    if name == NEUTRAL && !Path::new(name).exists() {
        return NamedIsp::new(AnyIsp::BuiltIn(BuiltIn::default()), None);
    }
    let source = assets.text("ISP", "isp", name)?;
    let settings = match parse_isp_file(&source.text).map_err(DesignError::input(&source.path))? {
        IspFile::External(about) => return external(about, &source.path),
        IspFile::Settings(settings) => settings,
    };
    let mut chosen = match &settings.isp {
        None => NamedIsp::new(AnyIsp::BuiltIn(BuiltIn::default()), None)?,
        Some(isp) => {
            // A relative path begins at the file that names it.
            let path = source.path.parent().unwrap_or(Path::new("")).join(isp);
            let text = std::fs::read_to_string(&path).map_err(|e| {
                let message = format!("{}: `isp = \"{isp}\"`: {}: {e}", source.path.display(), path.display());
                JobError::input(message, "give the path of the description of an ISP, from the file of the settings")
            })?;
            match parse_isp_file(&text).map_err(DesignError::input(&path))? {
                IspFile::External(about) => external(about, &path)?,
                IspFile::Settings(_) => {
                    let message = format!("{}: the description of an ISP has the key `command`", path.display());
                    return Err(JobError::input(message, "give a description, not further settings"));
                }
            }
        }
    };
    chosen.values = settings.values(&chosen.parameters).map_err(DesignError::input(&source.path))?;
    Ok(chosen)
}

fn external(about: ExternalIspFile, path: &Path) -> Result<NamedIsp, JobError> {
    let home = path.parent().unwrap_or(Path::new(""));
    let home = if home.as_os_str().is_empty() { Path::new(".") } else { home };
    let cache = about.cache.clone().unwrap_or_default();
    let isp = ExternalIsp::new(about, home).map_err(|e| {
        JobError::input(
            format!("{}: `cache = \"{cache}\"`: {e}", path.display()),
            "give a folder that can be written",
        )
    })?;
    let path = std::path::absolute(path).map_err(|e| JobError::failed(format!("{}: {e}", path.display())))?;
    NamedIsp::new(AnyIsp::External(isp), Some(path))
}

impl NamedIsp {
    fn new(isp: AnyIsp, description: Option<PathBuf>) -> Result<Self, JobError> {
        let parameters = isp.isp().parameters();
        let values = isp.isp().defaults();
        Ok(Self { isp, parameters, values, description })
    }

    /// Changes values by `stage.key=value`, each of which has to be in its range.
    pub fn set(&mut self, changes: &[String]) -> Result<(), JobError> {
        for change in changes {
            let wrong = |message: String, hint: String| Err(JobError::setting("set", change, message, hint));
            let Some((name, value)) = change.split_once('=') else {
                return wrong("no value".to_owned(), "write stage.key=value".to_owned());
            };
            let i = self.place(name.trim()).map_err(|hint| {
                JobError::setting("set", change, "the ISP has no such parameter", hint)
            })?;
            let about = &self.parameters[i].about;
            match value.trim().parse::<f64>() {
                Ok(value) if (about.min..=about.max).contains(&value) => self.values[i] = value,
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
        let places: Vec<usize> = (0..self.parameters.len()).filter(|i| belongs(&self.parameters[*i])).collect();
        if places.is_empty() { self.place(name).map(|i| vec![i]) } else { Ok(places) }
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

    /// A settings file with these values, below a comment of one line.
    pub fn settings_toml(&self, head: &str, values: &[f64]) -> String {
        let isp = self.description.as_ref().map(|path| path.display().to_string());
        settings_toml(head, isp.as_deref(), &self.parameters, values)
    }
}

/// The error of an ISP about the frame of a file.
pub(super) fn about_frame(file: &Path) -> impl Fn(IspError) -> JobError {
    move |error| match error {
        IspError::Input { .. } => {
            JobError::input(format!("{}: {error}", file.display()), "correct the frame or its sidecar")
        }
        IspError::External(_) => JobError::failed(format!("{}: {error}", file.display())),
        IspError::Count { .. } | IspError::Parameter { .. } => JobError::input(error.to_string(), ""),
    }
}

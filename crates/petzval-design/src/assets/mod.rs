//! The built-in library of lenses, glasses, sensors, experiments, photographs and weights, and the rule by
//! which a name on the command line or in an experiment becomes text.

pub mod glass_warnings;

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use petzval_base::{Cancel, FileError};
use petzval_camera::isp::Isp;
use petzval_camera::sensor::SensorModel;
use petzval_files::{
    Effect, Import, LensFile, decode, parse_lens_start, parse_optiland_start, parse_seq_start,
    parse_zmx_start,
};
use petzval_learn::guest::{GuestError, Host};
use petzval_optics::glass::Catalog;

use crate::assets::glass_warnings::glass_warnings;
use crate::error::{DesignError, Result};

/// Files built into the program, by their path below `data/`.
#[derive(Clone, Default)]
pub struct Assets {
    files: Vec<(String, Cow<'static, [u8]>)>,
    /// Texts that are in no file, by the name under which they are looked for.
    texts: Vec<(String, String)>,
    /// Glasses that win over the built-in ones.
    chosen: Catalog,
    /// All glasses, once they have been read, by this library or a copy of it.
    catalog: Arc<OnceLock<Arc<Catalog>>>,
    warnings: Option<WarningSink>,
    external_isps: Option<ExternalIsps>,
    guests: Option<Guests>,
    cancel: Cancel,
}

/// An ISP outside this program, of which nothing is known but what it makes of raw frames.
#[derive(Clone)]
pub struct OutsideIsp {
    /// Its interface.
    pub isp: Arc<dyn Isp>,
    /// A value for each of its parameters.
    pub values: Vec<f64>,
    /// The text that describes it. A run goes on only as long as it stays.
    pub description: String,
}

/// Makes the ISP of a file that describes one outside this program.
pub type ExternalIsps = Arc<dyn Fn(&Path) -> Result<OutsideIsp> + Send + Sync>;

/// Makes the host of a run's networks and losses in Python. The number is the longest time of a call, s, where the host can limit it.
pub type Guests = Arc<dyn Fn(f64) -> Arc<dyn Host> + Send + Sync>;

/// Receives one line per warning.
pub type WarningSink = Arc<dyn Fn(&str) + Send + Sync>;

/// Built-in glass files: where several know a name, the first counts.
const GLASS_FILES: [&str; 9] =
    ["crystals", "polymers", "materials", "schott", "ohara", "hoya", "hikari", "sumita", "cdgm"];

/// A text with the place it came from, for messages.
pub struct Text {
    /// File, or path of the built-in file below `data/`.
    pub path: PathBuf,
    /// Its contents.
    pub text: String,
}

impl Assets {
    /// A library of these files.
    pub fn new(files: Vec<(String, Cow<'static, [u8]>)>) -> Self {
        Self { files, ..Self::default() }
    }

    /// The library with further files, by their path below `data/`.
    pub fn with_files(mut self, more: impl IntoIterator<Item = (String, String)>) -> Self {
        self.files.extend(more.into_iter().map(|(path, text)| (path, Cow::Owned(text.into_bytes()))));
        self.catalog = Arc::default();
        self
    }

    /// The library with a text that is in no file and is found under this name alone: it wins over a file. The ending of the name is that of the
    /// format: none is TOML. Errors call the text by its name.
    pub fn with_text(mut self, name: String, text: String) -> Self {
        self.texts.retain(|(known, _)| *known != name);
        self.texts.push((name, text));
        self
    }

    /// The text that is in no file of this name.
    pub fn text_in_no_file(&self, name: &str) -> Option<&str> {
        self.texts.iter().find(|(known, _)| known == name).map(|(_, text)| text.as_str())
    }

    /// The library with these glasses, which win over the built-in ones.
    pub fn with_glasses(self, chosen: Catalog) -> Self {
        Self { chosen, catalog: Arc::default(), ..self }
    }

    /// The same library, which from now on reports what a lens file of another program loses when it is read, and what is
    /// odd about the glasses of any lens ([`glass_warnings()`]).
    pub fn reporting_warnings(self, warnings: WarningSink) -> Self {
        Self { warnings: Some(warnings), ..self }
    }

    /// The same library, which can make external ISPs.
    pub fn with_external_isps(self, external_isps: ExternalIsps) -> Self {
        Self { external_isps: Some(external_isps), ..self }
    }

    /// The same library, which can call networks and losses in Python.
    pub fn with_guests(self, guests: Guests) -> Self {
        Self { guests: Some(guests), ..self }
    }

    /// The same library, whose reading of pictures ends once the flag is set, as does the work of what is made from it.
    pub fn stopped_by(self, cancel: Cancel) -> Self {
        Self { cancel, ..self }
    }

    /// The flag that stops the reading of pictures and other long work.
    pub fn cancel(&self) -> &Cancel {
        &self.cancel
    }

    /// The external ISP of a file.
    pub fn external_isp(&self, path: &Path) -> Result<OutsideIsp> {
        match &self.external_isps {
            Some(make) => make(path),
            None => Err(DesignError::misfit(
                path,
                &"describes an ISP outside this program, which cannot be called here",
                "name a preset of the built-in ISP",
            )),
        }
    }

    /// A host for the networks and losses of one run.
    pub fn guest_host(&self, timeout_s: f64) -> Result<Arc<dyn Host>> {
        let make = self.guests.as_ref().ok_or_else(|| GuestError::Unusable {
            message: "classes in Python cannot be called here".to_owned(),
            hint: "name a network and a task of this program".to_owned(),
        })?;
        Ok(make(timeout_s))
    }

    /// All files below a folder on disk, for tests and for a changed library.
    pub fn from_folder(root: &Path) -> Result<Self> {
        let (mut files, mut open) = (Vec::new(), vec![root.to_path_buf()]);
        while let Some(folder) = open.pop() {
            for entry in std::fs::read_dir(&folder).map_err(DesignError::io(&folder))? {
                let path = entry.map_err(DesignError::io(&folder))?.path();
                if path.is_dir() {
                    open.push(path);
                } else if let Ok(below) = path.strip_prefix(root) {
                    let bytes = petzval_base::read_whole(&path).map_err(DesignError::io(&path))?;
                    files.push((below.to_string_lossy().replace('\\', "/"), Cow::Owned(bytes)));
                }
            }
        }
        files.sort();
        Ok(Self::new(files))
    }

    /// A built-in file.
    pub fn bytes(&self, path: &str) -> Result<&[u8]> {
        let found = self.files.iter().find(|(name, _)| name == path);
        found.map(|(_, bytes)| bytes.as_ref()).ok_or_else(|| DesignError::Unknown {
            kind: "built-in file",
            name: path.to_owned(),
            near: None,
            known: "data/".to_owned(),
        })
    }

    /// Names (without `.toml`) of the built-in files of a folder.
    pub fn names(&self, folder: &str) -> Vec<&str> {
        let prefix = format!("{folder}/");
        let below = |name| str::strip_prefix(name, &prefix).and_then(|n| n.strip_suffix(".toml"));
        let mut names: Vec<&str> = self.files.iter().filter_map(|(name, _)| below(name.as_str())).collect();
        names.sort_unstable();
        names
    }

    /// A text by path or by built-in name: a file that exists wins.
    pub fn text(&self, kind: &'static str, folder: &str, name: &str) -> Result<Text> {
        let path = Path::new(name);
        if let Some(text) = self.text_in_no_file(name) {
            return Ok(Text { path: path.to_path_buf(), text: text.to_owned() });
        }
        if path.exists() && !path.is_dir() {
            let text = petzval_base::read_text(path).map_err(|e| unreadable(path, &e))?;
            return Ok(Text { path: path.to_path_buf(), text });
        }
        // `data/lenses/x.toml` names the built-in x also where no such folder exists.
        let stem = name.strip_prefix(&format!("data/{folder}/")).unwrap_or(name);
        let stem = stem.strip_suffix(".toml").unwrap_or(stem);
        let built_in = format!("{folder}/{stem}.toml");
        let Ok(bytes) = self.bytes(&built_in) else {
            let known = self.names(folder);
            let near = known
                .iter()
                .max_by(|a, b| strsim::jaro_winkler(a, stem).total_cmp(&strsim::jaro_winkler(b, stem)));
            let near = near.filter(|n| strsim::jaro_winkler(n, stem) > 0.85).map(|n| (*n).to_owned());
            return Err(DesignError::Unknown { kind, name: name.to_owned(), near, known: known.join(", ") });
        };
        let text = String::from_utf8_lossy(bytes).into_owned();
        Ok(Text { path: Path::new("data").join(built_in), text })
    }

    /// The glass catalogue: every built-in file of `glasses/`, then the glasses that were chosen.
    pub fn catalog(&self) -> Result<Arc<Catalog>> {
        if let Some(catalog) = self.catalog.get() {
            return Ok(Arc::clone(catalog));
        }
        let mut names = self.names("glasses");
        names.sort_by_key(|name| {
            GLASS_FILES.iter().position(|known| known == name).unwrap_or(GLASS_FILES.len())
        });
        let mut catalog = Catalog::default();
        // The last that comes counts.
        for name in names.into_iter().rev() {
            let source = self.text("glass catalogue", "glasses", name)?;
            let part =
                petzval_files::parse_catalog(&source.text).map_err(DesignError::input(&source.path))?;
            catalog.merge(part);
        }
        catalog.merge(self.chosen.clone());
        Ok(Arc::clone(self.catalog.get_or_init(|| Arc::new(catalog))))
    }

    /// A lens by path or built-in name, checked to be possible; the path of a file of Zemax (`.zmx`), CODE V
    /// (`.seq`) or Optiland (`.json`) will do.
    pub fn lens(&self, name: &str) -> Result<LensFile> {
        Ok(self.reported(name)?.file)
    }

    /// As [`Self::lens`], with what is known of its file.
    pub fn reported(&self, name: &str) -> Result<Import> {
        let import = self.import(name)?;
        self.warn_of(name, &import)?;
        Ok(import)
    }

    /// A lens to start an optimisation from, as [`Self::lens`], but it need not be buildable: a warning says why it is not.
    pub fn start(&self, name: &str) -> Result<LensFile> {
        let import = self.import_start(name)?;
        self.warn_of(name, &import)?;
        if let (Some(warn), Some(error)) = (&self.warnings, &import.unbuildable) {
            warn(&format!("{name}: {}; the optimisation starts from there", error.message));
        }
        Ok(import.file)
    }

    /// Reports the losses of an import, and doubts about its glasses.
    fn warn_of(&self, name: &str, Import { file, losses, .. }: &Import) -> Result<()> {
        if let Some(warn) = &self.warnings {
            // Who hands a lens over has changed its numbers, and knows that they no longer fulfil its solve.
            let is_changed = self.text_in_no_file(name).is_some();
            let reported = losses.iter().filter(|loss| !(is_changed && loss.effect == Effect::Unsolved));
            reported.for_each(|loss| warn(&loss.in_file(Path::new(name))));
            for warning in glass_warnings(&file.lens, self.catalog()?.as_ref()) {
                warn(&format!("{name}: {warning}"));
            }
        }
        Ok(())
    }

    /// A lens by path or built-in name, with what it lost if its file is that of another program. Nothing is reported.
    pub fn import(&self, name: &str) -> Result<Import> {
        let import = self.import_start(name)?;
        match import.unbuildable {
            None => Ok(import),
            Some(error) => Err(DesignError::input(Path::new(name))(error)),
        }
    }

    /// As [`Self::import`], but the lens need not be buildable.
    pub fn import_start(&self, name: &str) -> Result<Import> {
        let path = Path::new(name);
        let catalog = self.catalog()?;
        let parse = match extension(path).as_str() {
            "zmx" => parse_zmx_start,
            "seq" => parse_seq_start,
            "json" => parse_optiland_start,
            _ => {
                let source = self.text("lens", "lenses", name)?;
                return parse_lens_start(&source.text, &catalog).map_err(DesignError::input(&source.path));
            }
        };
        let text = match self.text_in_no_file(name) {
            Some(text) => Cow::Borrowed(text),
            None => {
                let bytes = petzval_base::read_whole(path).map_err(|e| unreadable(path, &e))?;
                Cow::Owned(decode(&bytes).into_owned())
            }
        };
        let mut import = parse(&text, &catalog).map_err(DesignError::input(path))?;
        if import.file.lens.name.is_empty() {
            import.file.lens.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        }
        Ok(import)
    }

    /// A sensor by path or built-in name.
    pub fn sensor(&self, name: &str) -> Result<SensorModel> {
        let source = self.text("sensor", "sensors", name)?;
        petzval_files::parse_sensor(&source.text).map_err(DesignError::input(&source.path))
    }
}

/// The ending of a path, in lower case.
pub fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// A file that was named as input and is no text, or may not be read.
fn unreadable(path: &Path, error: &std::io::Error) -> DesignError {
    let error = FileError {
        line: None,
        column: None,
        key: String::new(),
        value: String::new(),
        message: format!("cannot be read: {error}"),
        hint: Some("give a file that exists and is text".to_owned()),
    };
    DesignError::input(path)(error)
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    /// A singlet of 101 mm whose solve makes it 50 mm: its file is at fault, and a caller who changed the lens knows.
    #[test]
    fn an_unmet_solve_is_reported_of_files_alone() {
        let text = "name = \"singlet\"\nunits = \"mm\"\n[aperture]\nentrance_pupil_diameter_mm = 10.0\n[object]\ndistance_mm = inf\n\
                    [wavelengths]\num = [0.5876]\nreference_um = 0.5876\n[fields]\nangle_deg = [0.0, 14.0]\n\
                    [glass.crown]\nnd = 1.5\nvd = 60.0\n\
                    [[surface]]\nstop = true\nradius_mm = 100.0\nthickness_mm = 5.0\nglass = \"crown\"\nsemi_diameter_mm = 6.0\n\
                    [[surface]]\nradius_mm = -100.0\nthickness_mm = 99.0\nsemi_diameter_mm = 7.0\n\
                    [solve]\nefl = { surface = 2, efl_mm = 50.0 }\n";
        let said = Arc::new(Mutex::new(Vec::new()));
        let lines = Arc::clone(&said);
        let sink: WarningSink = Arc::new(move |line: &str| lines.lock().unwrap().push(line.to_owned()));
        let files = vec![("lenses/mine.toml".to_owned(), Cow::Borrowed(text.as_bytes()))];
        let of_file = Assets::new(files).reporting_warnings(sink);
        let of_caller = of_file.clone().with_text("mine".to_owned(), text.to_owned());
        let unsolved = |assets: &Assets| {
            said.lock().unwrap().clear();
            assets.lens("mine").unwrap();
            let said = said.lock().unwrap();
            said.iter().filter(|line| line.contains("its solve makes it 50 mm")).count()
        };
        assert_eq!([unsolved(&of_file), unsolved(&of_caller)], [1, 0]);
    }
}

//! What a run was made from. Its folder keeps lens and sensor, so that it stands on its own; of pictures it keeps names, sizes, times and
//! digests, because a run that went on with other pictures would be worth nothing.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use burn::prelude::Device;
use petzval_base::reason_and_hint;
use petzval_camera::psf::PsfBank;
use petzval_files::psf_file::{AXES_FILE, read_psfs, write_psfs};
use petzval_files::{FloatType, write_lens};
use sha2::{Digest, Sha256};

use crate::assets::Assets;
use crate::camera::optics_proxy::FILES;
use crate::error::{DesignError, Result};
use crate::experiment::{Experiment, is_derived_lens};
use crate::library::Library;
use crate::path_text::{path_text, relative_path};
use crate::run::first_reads;
use crate::run::input_list::{BUILT_IN, InputList, Pictures};
use crate::run::{ChangedFile, DigestCheck, Digests, RunFolder, RunRecord, hex, write_file};
use crate::scoring::Scorer;
use crate::setup::Setup;
use crate::task::{Content, Purpose, WindowInputs};

/// Folder of the PSFs of a file, below that of the inputs.
const PSFS: &str = "psfs";

/// The inputs of a setup: one by one, and all of them in one digest.
pub struct Inputs {
    /// SHA-256 of all: the lens with its glasses, the sensor, and every photograph by name and content. With them, where there are any: the
    /// hardware ISP, the networks in place of tracing, PSFs of a file, and given weights of a network or a detector.
    pub fingerprint: String,
    /// Each by its name.
    pub list: InputList,
}

impl Inputs {
    /// Those of a setup. Its pictures are read, unless they are a large set.
    pub fn of(setup: &Setup) -> Result<Self> {
        Self::with(setup, Content::AtStart)
    }

    /// Those of a setup with so much of the content of its pictures.
    fn with(setup: &Setup, content: Content) -> Result<Self> {
        let mut hash = Sha256::new();
        let mut parts = parts_of(setup, &mut hash)?;
        let WindowInputs { parts: built_in, pictures } =
            setup.windows()?.inputs(&setup.experiment, content, &mut hash)?;
        parts.extend(built_in);
        let list = InputList { parts, held_out: setup.held_out_pictures()?, pictures };
        Ok(Self { fingerprint: hex(hash), list })
    }
}

/// The inputs of a setup without its pictures: SHA-256 by name. Their content is added to the hash. The setup needs no windows.
fn parts_of(setup: &Setup, hash: &mut Sha256) -> Result<BTreeMap<String, String>> {
    let mut parts = BTreeMap::new();
    let mut add = |name: String, bytes: &[u8]| {
        hash.update(bytes);
        parts.insert(name, hex(Sha256::new_with_prefix(bytes)));
    };
    for variant in &setup.variants {
        let lens = write_lens(&setup.start(variant).lens_file);
        add(format!("lens of {}", variant.name), lens.as_bytes());
    }
    add("sensor".to_owned(), DesignError::json("the sensor", &setup.body.sensor)?.as_bytes());
    if let Some(chip) = &setup.body.chip {
        match chip.settings() {
            Some(settings) => add("ISP".to_owned(), DesignError::json("the ISP", settings)?.as_bytes()),
            // Of an ISP outside this program the description is known, with its command and version, and its values.
            None => {
                let mut known = chip.description().to_owned();
                for (parameter, value) in chip.parameters().iter().zip(chip.values()) {
                    let about = &parameter.about;
                    known += &format!("{} {} {} {value}", parameter.name, about.min, about.max);
                }
                add("ISP".to_owned(), known.as_bytes());
            }
        }
    }
    for variant in &setup.variants {
        let Some(path) = &variant.optics_proxy else { continue };
        let mut network = Vec::new();
        for file in proxy_files(Path::new(path)) {
            network.extend(read(&file)?);
        }
        add(format!("network in place of tracing of {}", variant.name), &network);
    }
    if let Some(file) = setup.experiment.psf.named_file() {
        let bank = read_psfs(Path::new(file))?;
        let mut bytes = DesignError::json("the PSFs", &bank.axes)?.into_bytes();
        let numbers = bank.values.iter().chain(&bank.illumination);
        bytes.extend(numbers.flat_map(|number| number.to_le_bytes()));
        add("PSFs".to_owned(), &bytes);
    }
    if let Some(weights) = setup.task.given_weights() {
        add("given weights".to_owned(), weights);
    }
    Ok(parts)
}

/// Keeps in a new run folder what the run of this scorer's setup is made from, and writes the `config.toml` that names it, and its record
/// with its [usual steps](RunRecord::usual_steps).
pub fn keep_inputs(
    scorer: &Scorer,
    assets: &Assets,
    run: &RunFolder,
    usual_steps: Option<usize>,
) -> Result<()> {
    let setup = scorer.setup();
    let experiment = &setup.experiment;
    // The setup has read the lens already, and reported its warnings.
    let lens = assets.import(&experiment.lens)?.file;
    write_file(&run.nominal_lens(), write_lens(&lens).as_bytes())?;
    let sensor = assets.text("sensor", "sensors", &experiment.sensor)?;
    write_file(&run.sensor(), sensor.text.as_bytes())?;
    let inputs = Inputs::of(setup)?;
    write_file(&run.fingerprint(), format!("{}\n", inputs.fingerprint).as_bytes())?;
    inputs.list.write(run)?;
    // Names in an experiment are looked for beside it.
    let mut kept = Experiment {
        lens: "inputs/lens.toml".to_owned(),
        sensor: "inputs/sensor.toml".to_owned(),
        ..experiment.clone()
    };
    // A run and its pictures can be moved together.
    let root = std::fs::canonicalize(run.root()).map_err(DesignError::io(run.root()))?;
    if let Some(Pictures { place, .. }) = &inputs.list.pictures {
        let there = path_text(&relative_path(place, &root))?;
        *kept.pictures_mut(setup.facts.pictures) = there;
    }
    if kept.isp.is_used() {
        let preset = assets.text("ISP", "isp", &kept.isp.preset)?;
        write_file(&run.input("isp.toml"), preset.text.as_bytes())?;
        // The command of an external ISP lies where its description does.
        kept.isp.preset = match setup.body.chip.as_ref().and_then(|chip| chip.settings()) {
            Some(_) => "inputs/isp.toml".to_owned(),
            None => {
                let there = std::fs::canonicalize(&preset.path).map_err(DesignError::io(&preset.path))?;
                path_text(&relative_path(&there, &root))?
            }
        };
    }
    if let Some(file) = kept.psf.named_file() {
        let folder = run.input(PSFS);
        write_psfs(&read_psfs(Path::new(file))?, &folder, FloatType::Float64)?;
        kept.psf.file = format!("inputs/{PSFS}/{AXES_FILE}");
    }
    setup.task.keep_weights(run, &mut kept)?;
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
    // Lists of pictures change as pictures are read or moved; they hold digests of their own.
    let folder = run.input("");
    Digests::of_folder(&folder)?.without(&["inputs.json", "sha256", "first-reads.jsonl"]).write(&folder)?;
    let text = kept.to_toml()?;
    RunRecord::begin(kept, usual_steps, scorer.scores()).write(run)?;
    write_file(&run.config(), text.as_bytes())
}

fn read(path: &Path) -> Result<Vec<u8>> {
    petzval_base::read_whole(path).map_err(DesignError::io(path))
}

/// The files of a network whose description lies here.
fn proxy_files(description: &Path) -> impl Iterator<Item = PathBuf> {
    let folder = description.parent().unwrap_or(Path::new("")).to_owned();
    FILES.into_iter().map(move |file| folder.join(file))
}

fn make_parent(path: &Path) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new(""));
    std::fs::create_dir_all(folder).map_err(DesignError::io(folder))
}

/// What the setup of a run is needed for.
#[derive(Clone, Copy)]
pub enum SetupFor<'p> {
    /// Its cameras, without windows.
    Cameras,
    /// Windows for a purpose, with PSFs in place of those of every lens, if there are any.
    Windows(Purpose<'p>, Option<&'p Arc<PsfBank>>),
}

/// The setup of a run for its experiment, as [`Library::experiment_of_run`] or [`Library::experiment_in`] reads it. An error names the files of the
/// folder `inputs` that were changed since the run kept them.
pub fn setup_of_run(
    run: &RunFolder,
    experiment: Experiment,
    library: &Library,
    device: Device,
    needed: SetupFor<'_>,
) -> Result<Setup> {
    let setup = match needed {
        SetupFor::Cameras => Setup::without_windows(experiment, library, device),
        SetupFor::Windows(purpose, psfs) => Setup::with_psfs(experiment, library, device, psfs, purpose),
    };
    setup.map_err(|error| blamed_on_inputs(error, run))
}

/// The error of the setup of a run. Where the folder `inputs` holds other files than the run kept there, the error names them: a lens that was
/// changed there may fit neither the experiment nor itself.
fn blamed_on_inputs(error: DesignError, run: &RunFolder) -> DesignError {
    let changes = DigestCheck::new(run, &[], &|_| {}).changes("inputs").unwrap_or_default();
    if changes.is_empty() || error.is_stopped() {
        return error;
    }
    let named: Vec<String> = changes.iter().map(ToString::to_string).collect();
    let said = error.to_string();
    let problem = format!(
        "{}, and cannot be used: {}; hint: put it back from a copy of the run, or start a new run",
        named.join(", "),
        reason_and_hint(&said).0
    );
    DesignError::Run { path: run.root().to_path_buf(), problem }
}

/// Refuses to go on with a run from other inputs than it was made from, which are named. Returns those of the setup.
pub fn check_inputs(setup: &Setup, run: &RunFolder) -> Result<Inputs> {
    compared(setup, run)?.map_err(|changed| {
        let problem = format!("{changed}; put them back, or start a new run");
        DesignError::Run { path: run.fingerprint(), problem }
    })
}

/// Refuses to score a run on its own pictures from other inputs than it was made from. A user may accept them as a change of the folder `inputs`.
pub fn check_inputs_or_accepted(setup: &Setup, run: &RunFolder, check: &DigestCheck) -> Result<()> {
    let Err(changed) = compared(setup, run)? else { return Ok(()) };
    accepted_or_refused(&changed, run, check)
}

/// Accepts inputs that were changed, as a change of the folder `inputs`, or refuses them with what was changed.
fn accepted_or_refused(changed: &str, run: &RunFolder, check: &DigestCheck) -> Result<()> {
    if check.is_accepted(&ChangedFile { name: "inputs".to_owned(), is_missing: false }) {
        return Ok(());
    }
    let problem =
        format!("{changed}; hint: put them back, or add `--accept-changed inputs` if you mean the change");
    Err(DesignError::Run { path: run.root().to_path_buf(), problem })
}

/// The inputs of the setup if they are those that the run was made from, else what was changed, in words.
fn compared(setup: &Setup, run: &RunFolder) -> Result<Result<Inputs, String>> {
    let path = run.fingerprint();
    let noted = petzval_base::read_text(&path).map_err(DesignError::io(&path))?;
    let then = InputList::read(run)?;
    // Earlier versions read every picture at the start, however many there were.
    let pictures = then.as_ref().and_then(|then| then.pictures.as_ref());
    let are_read_later = pictures.is_some_and(|pictures| !pictures.are_read());
    let content = if are_read_later { Content::AtStart } else { Content::All };
    let now = Inputs::with(setup, content)?;
    if let Some(then) = then.as_ref().filter(|_| noted.trim() == now.fingerprint) {
        let unlike = then.parts_unlike(&now.list);
        if !unlike.is_empty() {
            let list = "inputs/inputs.json is not as the run wrote it: it has another digest of";
            return Ok(Err(format!("{list} the {}", unlike.join(", the "))));
        }
    }
    let read = first_reads::read(run)?;
    let then = then.map(|then| then.with_unread(&now.list, |name| read.contains_key(name)));
    let changed = then.map_or_else(Vec::new, |then| then.differences(&now.list));
    if noted.trim() == now.fingerprint || are_read_later && changed.is_empty() {
        if let Some(reads) = setup.windows()?.first_reads() {
            reads.expect(read);
        }
        return Ok(Ok(now));
    }
    Ok(Err(match &changed[..] {
        [] => "lens, glasses, sensor, ISP, networks in place of tracing, PSFs, given weights, photographs or labelled pictures are not those that \
               this run began with, or an earlier version began it"
            .to_owned(),
        named => other_inputs(named),
    }))
}

fn other_inputs(named: &[String]) -> String {
    format!("inputs are not those that this run began with: {}", named.join(", "))
}

/// Refuses to use or to show the cameras of a run with another lens, sensor, ISP or network than it was made from: what every verb checks that
/// needs no pictures of the run. A user may accept other inputs as a change of the folder `inputs`. The setup needs no windows.
pub fn check_parts_or_accepted(setup: &Setup, run: &RunFolder, check: &DigestCheck) -> Result<()> {
    let changed = changed_parts(setup, run)?;
    if changed.is_empty() { Ok(()) } else { accepted_or_refused(&other_inputs(&changed), run, check) }
}

/// What of lens, sensor, ISP and networks is not as the run was made from, in words. Nothing is known of a folder of an earlier version.
fn changed_parts(setup: &Setup, run: &RunFolder) -> Result<Vec<String>> {
    let Some(then) = InputList::read(run)? else { return Ok(Vec::new()) };
    let mut then = InputList { parts: then.parts, ..InputList::default() };
    then.parts.remove(BUILT_IN);
    let now = InputList { parts: parts_of(setup, &mut Sha256::new())?, ..InputList::default() };
    Ok(then.differences(&now))
}

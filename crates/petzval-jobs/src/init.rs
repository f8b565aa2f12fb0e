//! `init`: an experiment with its lens and its sensor as files of one's own.

use std::path::{Path, PathBuf};

use petzval_base::pasted;
use petzval_camera::develop::Demosaic;
use petzval_camera::sensor::Colour;
use petzval_design::error::DesignError;
use petzval_design::experiment::{
    BUILT_IN_PHOTOS, Experiment, PicturesKey, commented_toml, is_derived_lens, is_input,
};
use petzval_design::fit::{demands, white_that_fits};
use petzval_design::path_text::{path_text, relative_path};
use petzval_files::{parse_lens, parse_sensor, write_lens};
use petzval_optics::design_space::near_variables;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::Result;
use crate::event::WarningKind;
use crate::input::{ExperimentInput, Inline, Input, LensInput, SensorInput};
use crate::own_lens::{OwnLens, own_lens};
use crate::own_pictures::with_pictures;
use crate::results::{check_folder, write_result};

/// Names of the files.
pub(crate) const EXPERIMENT: &str = "experiment.toml";
const LENS: &str = "lens.toml";
const SENSOR: &str = "sensor.toml";

petzval_base::parameters! {
    /// What to start from.
    pub struct Request {
        /// The folder of the files; made if it is not there.
        out: PathBuf = PathBuf::new();
        /// An experiment: a built-in name, the path of a file, or the experiment itself.
        from: ExperimentInput = crate::experiment::DEFAULT_EXPERIMENT.into();
        /// A lens in place of the experiment's: a built-in name, the path of a file, also of another program, or the lens itself. The experiment is
        /// fitted to it.
        lens: Option<LensInput> = None;
        /// A sensor in place of the experiment's: a built-in name, the path of a file, or the sensor itself. Without one, a lens of one's own gets the
        /// sensor that fits it.
        sensor: Option<SensorInput> = None;
        /// Folder of photographs in place of the experiment's. The experiment names it from the folder of the files, if this path is relative.
        photos: Option<PathBuf> = None;
        /// Folder or file of pictures with labels in place of the experiment's scenes. The experiment names it from the folder of the files, if this path
        /// is relative.
        data: Option<PathBuf> = None;
    }
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The experiment.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub experiment: PathBuf,
    /// The lens.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub lens: PathBuf,
    /// The sensor.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub sensor: PathBuf,
    /// Whether the lens was given variables because its file names none.
    pub gave_variables: bool,
    /// Whether the sensor is monochrome and the experiment's photographs are in colour: it needs others.
    pub needs_gray_photos: bool,
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> =
    AsUnit { out_in: Some(""), ..AsUnit::placed(|request, folder| request.out = folder.to_owned()) };

/// Writes the files. With a lens of one's own the experiment is fitted to it: its title, focus, sensor, fields, PSFs, requirements and, if the file
/// names none, variables follow from the lens.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let Request { out, from, lens, sensor, photos, data } = request;
    let (from, context) = from.placed(context)?;
    let (lens, context) = placed(lens.as_ref(), context)?;
    let (sensor, context) = &placed(sensor.as_ref(), context)?;
    check_folder(out, [EXPERIMENT, LENS, SENSOR], context)?;
    let experiment = context.assets.experiment(&from)?;
    let pictures = context.assets.facts_of(&experiment)?.pictures;
    let experiment = with_pictures(experiment, photos.as_deref(), data.as_deref(), pictures)?;
    let own_lens_name = experiment.lens.clone();
    let made = match &lens {
        Some(lens) => own_lens(experiment, lens, sensor.as_deref(), context)?,
        None => as_it_is(experiment, sensor.as_deref(), context)?,
    };
    let OwnLens { mut experiment, lens_text, sensor_text, sensor_name, gave_variables } = made;
    parse_lens(&lens_text, context.assets.catalog()?.as_ref())
        .map_err(DesignError::input(&out.join(LENS)))?;
    // Checked as a run would, and written as it stands.
    let model = parse_sensor(&sensor_text).map_err(DesignError::input(&out.join(SENSOR)))?;
    let array = model.cfa;
    if experiment.development.demosaic.check_array(array).is_err() {
        experiment.development.demosaic = Demosaic::Bilinear;
        context.note(format!("development.demosaic is \"bilinear\", as `{sensor_name}` needs it"));
    }
    let sees_photos = pictures == PicturesKey::Photos && experiment.photos == BUILT_IN_PHOTOS;
    let needs_gray_photos = array.colours() == [Colour::Clear] && sees_photos;
    if needs_gray_photos {
        context.warning(WarningKind::Experiment, format!(
            "`{sensor_name}` is monochrome, and the built-in photographs are in colour; give the experiment gray ones: `photos`, or `design --photos DIR`"
        ));
    }
    demands(&experiment, pictures, &model, &context.assets)?.iter().for_each(|line| context.note(line));

    if lens.is_some() {
        warn_of_other_lenses(&experiment, &own_lens_name, context);
    }
    // Pictures are named as the request names them. A folder may have the name of what is built in.
    let as_given = |path: &Path| path_text(&Path::new(".").join(path));
    if let Some(photos) = photos {
        experiment.photos = as_given(photos)?;
    }
    if let Some(data) = data {
        experiment.data = as_given(data)?;
    }
    context.check(|| "stopped before the files were written")?;
    std::fs::create_dir_all(out).map_err(DesignError::io(out))?;
    name_files(&mut experiment, &own_lens_name, out)?;
    let text = format!(
        "# From the experiment `{from}`, with every key, its unit and its range. `petzval design {}` runs it.\n\n{}",
        pasted(&out.join(EXPERIMENT)),
        commented_toml(&experiment)?
    );
    let path = |name: &str| out.join(name);
    for (name, text) in [(LENS, &lens_text), (SENSOR, &sensor_text), (EXPERIMENT, &text)] {
        write_result(&path(name), text, context)?;
        context.wrote(
            path(name),
            if name == LENS {
                "lens"
            } else if name == SENSOR {
                "sensor"
            } else {
                "experiment"
            },
        );
    }
    Ok(Response {
        experiment: path(EXPERIMENT),
        lens: path(LENS),
        sensor: path(SENSOR),
        gave_variables,
        needs_gray_photos,
    })
}

/// Warns of variants that start neither from the experiment's own lens, in whose place another one comes, nor from one that is derived from it.
fn warn_of_other_lenses(experiment: &Experiment, own_lens: &str, context: &Context) {
    for variant in &experiment.variant {
        let Some(named) = variant.lens.as_deref() else { continue };
        if named != own_lens && !is_derived_lens(named) {
            context.warning(
                WarningKind::Experiment,
                format!("the variant `{}` starts from `{named}`, which is not your lens", variant.name),
            );
        }
    }
}

/// Names the lens and the sensor that are written, in place of the experiment's own. Other inputs that lie in files are named as they are found from
/// the new folder `out`; built-in names and absolute paths stay.
fn name_files(experiment: &mut Experiment, own_lens: &str, out: &Path) -> Result<()> {
    let is_own: Vec<bool> = experiment.variant.iter().map(|v| v.lens.as_deref() == Some(own_lens)).collect();
    // The names of the files that are written count from the new folder and come last: the current one may have files of the same names.
    for (key, name) in experiment.inputs_mut() {
        let path = Path::new(name.as_str());
        if is_input(&key, path) {
            *name = path_text(&found_from(out, path).map_err(DesignError::io(path))?)?;
        }
    }
    experiment.lens = LENS.to_owned();
    experiment.sensor = SENSOR.to_owned();
    for (variant, _) in experiment.variant.iter_mut().zip(is_own).filter(|(_, is_own)| *is_own) {
        variant.lens = Some(LENS.to_owned());
    }
    Ok(())
}

/// A path as it leads to its file from a folder that is there; an absolute one as it is. A file and the folder can then be moved together. A link at
/// the end of the path is not followed: it may lead out of what is moved.
fn found_from(folder: &Path, path: &Path) -> std::io::Result<PathBuf> {
    if path.is_absolute() {
        return Ok(path.to_owned());
    }
    let path = std::path::absolute(path)?;
    let real = match (path.parent(), path.file_name()) {
        (Some(parent), Some(name)) => std::fs::canonicalize(parent)?.join(name),
        _ => std::fs::canonicalize(&path)?,
    };
    let way = relative_path(&real, &std::fs::canonicalize(Path::new(".").join(folder))?);
    // A single word could be the name of what is built in, and no word is none of the folder itself.
    Ok(if way.components().count() <= 1 { Path::new(".").join(way) } else { way })
}

/// The name of an input that may be left out, and the context in which it is found.
fn placed<T: Inline>(input: Option<&Input<T>>, context: Context) -> Result<(Option<String>, Context)> {
    let Some(input) = input else { return Ok((None, context)) };
    let (name, context) = input.placed(&context)?;
    Ok((Some(name), context))
}

/// An experiment with its own lens, which gets variables if its file names none, and with another sensor if one is named.
fn as_it_is(mut experiment: Experiment, sensor: Option<&str>, context: &Context) -> Result<OwnLens> {
    let lens = experiment.lens.clone();
    let mut file = context.assets.lens(&lens)?;
    let usual = if file.variables.is_empty() { near_variables(&file.lens, &file.solves()) } else { None };
    let gave_variables = usual.is_some();
    // The text of a file that needs no change keeps its comments.
    let is_ours = Path::new(&lens).extension().is_none_or(|ending| ending == "toml");
    let lens_text = match usual {
        Some((variables, solves)) => {
            file.give(variables, &solves);
            write_lens(&file)
        }
        None if is_ours => context.assets.text("lens", "lenses", &lens)?.text,
        None => write_lens(&file),
    };
    let sensor_name = sensor.unwrap_or(&experiment.sensor).to_owned();
    let model = context.assets.sensor(&sensor_name)?;
    if let Some(note) = white_that_fits(&mut experiment.exposure, &model) {
        context.note(note);
    }
    let sensor_text = context.assets.text("sensor", "sensors", &sensor_name)?.text;
    Ok(OwnLens { experiment, lens_text, sensor_text, sensor_name, gave_variables })
}

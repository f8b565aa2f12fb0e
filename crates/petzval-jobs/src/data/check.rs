//! `data check`: what a data set holds, and what is wrong with it.

use std::path::PathBuf;

use petzval_files::CheckedPictures;
use petzval_files::coco::{Annotation, Attribute, Defect, Loaded, Severity, Statistics, load_coco};
use petzval_learn::dataset::Classes;
use petzval_report::data_sheet::{DataSheet, DefectRow, Sample, SampleBox, page};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::check_pictures_in;
use super::memory::{remember, remembered};
use super::photographs::{checked, photographs_of};
use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result, make_folder, write_file};
use crate::event::WarningKind;
use crate::input::ExperimentInput;
use crate::noted_pictures::NotedPictures;
use crate::range::check_ranges;
use crate::results::check_folder;

pub use petzval_learn::dataset::Taken;

petzval_base::parameters! {
    /// A data set to check. What is left out has the default of the command.
    pub struct Request {
        /// Pictures on the page.
        samples: usize = 12, "", 0..200, Linear, "the page holds its pictures";
    }
    also {
        /// Its folder, or its file of annotations; or photographs: a folder, a list with one path a line, a tar shard or a folder of shards.
        data: PathBuf = PathBuf::from(".");
        /// Folder for a page with samples; none is written without.
        out: Option<PathBuf> = None;
        /// An experiment, by built-in name, by path, or itself, whose classes are looked for in the data set.
        classes_of: Option<ExperimentInput> = None;
        /// Decodes every picture, also those that an earlier check has decoded and that have not changed since by size and time.
        no_cache: bool = false;
    }
}

/// What a data set holds, and what is wrong with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The file of annotations, or where the photographs are.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub annotations: PathBuf,
    /// What can be used.
    pub statistics: Statistics,
    /// What was found wrong, errors first.
    pub defects: Vec<Defect>,
    /// What the classes of an experiment take of it, if one was named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub taken: Option<Taken>,
    /// Cases that cannot be used.
    pub errors: usize,
    /// The page.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub page: Option<PathBuf>,
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> =
    AsUnit::placed(|request, folder| request.out = request.out.take().map(|_| folder.to_owned()));

/// Reads and checks annotations and pictures. The folder `out` gets `data.json` (the response) and `data.html`.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    check_ranges(request)?;
    if let Some(out) = &request.out {
        check_folder(out, ["data.html", "data.json"], context)?;
    }
    let classes =
        request.classes_of.as_ref().map(|experiment| classes_of(experiment, context)).transpose()?;
    let place = &request.data;
    let before = if request.no_cache { CheckedPictures::default() } else { remembered(place) };
    let loaded = match photographs_of(place)? {
        Some(pictures) => checked(place, &pictures, &before, context),
        None => load_coco(place, context.cancel()).map_err(JobError::from).and_then(|mut loaded| {
            check_pictures_in(&mut loaded, &before, context)?;
            Ok(loaded)
        }),
    };
    // Also what a check had done that was stopped.
    if !request.no_cache {
        remember(place, &before, context);
    }
    let loaded = loaded?;
    let mut response = Response {
        annotations: loaded.file.clone(),
        statistics: Statistics::of(&loaded.data),
        defects: loaded.defects.iter().cloned().collect(),
        taken: classes.map(|classes| Taken::of(&loaded.data, &classes)),
        errors: loaded.defects.errors(),
        page: None,
    };
    let Some(out) = &request.out else { return Ok(response) };
    make_folder(out)?;
    let path = out.join("data.html");
    response.page = Some(path.clone());
    let samples = samples(&loaded, request.samples, context)?;
    write_file(&path, page(&sheet(&response, samples)))?;
    context.wrote(&path, "page");
    let json = serde_json::to_string_pretty(&response).map_err(|e| JobError::failed(e.to_string()))?;
    let path = out.join("data.json");
    write_file(&path, json)?;
    context.wrote(path, "figures");
    Ok(response)
}

/// The classes of an experiment, which must have some.
fn classes_of(experiment: &ExperimentInput, context: &Context) -> Result<Classes> {
    let classes = experiment.read(&context.assets)?.classes();
    if classes.is_empty() {
        let hint = "name one that looks for objects, such as pedestrian-vehicle";
        return Err(JobError::setting("classes_of", experiment, "the experiment has no classes", hint));
    }
    Ok(classes)
}

/// Pictures with boxes, evenly over the data set; the last is the one with the most.
fn samples(loaded: &Loaded, most: usize, context: &Context) -> Result<Vec<Sample>> {
    // What files say was said when they were checked.
    let silent = context.silent();
    let data = &loaded.data;
    let objects = data.objects_of_images();
    let with_boxes: Vec<usize> = (0..data.images.len()).filter(|i| !objects[*i].is_empty()).collect();
    let mut chosen: Vec<usize> = match with_boxes.len() {
        n if n <= most => with_boxes,
        n => (0..most).map(|k| with_boxes[k * n / most]).collect(),
    };
    let fullest = (0..objects.len()).max_by_key(|i| objects[*i].len());
    if let (Some(fullest), Some(last)) = (fullest, chosen.last_mut())
        && *last != fullest
    {
        *last = fullest;
        chosen.sort_unstable();
        chosen.dedup();
    }
    let (mut samples, pictures) = (Vec::new(), NotedPictures::new(&silent));
    for (k, &i) in chosen.iter().enumerate() {
        let image = &data.images[i];
        context.progress(k as u64 + 1, chosen.len() as u64, "samples");
        context.check(|| "stopped before the page was written")?;
        let Some(path) = loaded.picture(&image.file_name) else { continue };
        let light = match pictures.light(&path) {
            Ok(light) => light,
            Err(error) => {
                context.warning(WarningKind::UnreadablePicture, error.to_string());
                continue;
            }
        };
        let class_of =
            |a: &Annotation| data.categories.iter().position(|c| c.id == a.category_id).unwrap_or(0);
        let boxes = objects[i].iter().map(|&k| &data.annotations[k]).map(|a| SampleBox {
            class: class_of(a),
            bounds: a.bounds.into(),
            counts: !(a.crowd || a.ignore),
            note: a.attributes.get("state").and_then(Attribute::text).unwrap_or("").to_owned(),
        });
        samples.push(Sample::new(
            image.file_name.clone(),
            &light.to_srgb(),
            light.height,
            light.width,
            boxes.collect(),
        ));
    }
    Ok(samples)
}

fn sheet(response: &Response, samples: Vec<Sample>) -> DataSheet {
    let statistics = &response.statistics;
    let list = |pairs: Vec<String>| (!pairs.is_empty()).then(|| pairs.join(", "));
    let splits = statistics.images_by_split.iter().map(|(name, n)| format!("{name} {n}")).collect();
    let sizes = statistics.sizes.iter().map(|(w, h, n)| format!("{w} x {h} ({n})")).collect();
    let facts = vec![
        ("annotations", Some(response.annotations.display().to_string())),
        ("pictures", Some(statistics.images.to_string())),
        ("parts", list(splits)),
        (
            "pictures without a part",
            (statistics.images_without_split > 0).then(|| statistics.images_without_split.to_string()),
        ),
        ("sequences", (statistics.sequences > 0).then(|| statistics.sequences.to_string())),
        ("sizes, px", list(sizes)),
        ("boxes", Some(statistics.boxes.to_string())),
        ("most boxes in a picture", Some(statistics.most_boxes.to_string())),
    ];
    let classes = statistics.classes.iter().map(|class| {
        let states: Vec<String> = class.states.iter().map(|(state, n)| format!("{state} {n}")).collect();
        let [low, middle, high] = class.side_px.map(|side| format!("{side:.0}"));
        let numbers = [class.boxes, class.images, class.ignored, class.small, class.medium, class.large];
        let mut cells: Vec<String> = numbers.iter().map(usize::to_string).collect();
        cells.extend([low, middle, high, states.join(", ")]);
        (class.name.clone(), cells)
    });
    let defects = response.defects.iter().map(|defect| DefectRow {
        is_error: defect.severity == Severity::Error,
        sentence: defect.kind.sentence(),
        hint: defect.kind.hint(),
        count: defect.count,
        examples: defect
            .worst
            .iter()
            .map(|worst| format!("worst: {worst}"))
            .chain(defect.first.clone())
            .collect(),
    });
    DataSheet { facts, classes: classes.collect(), defects: defects.collect(), samples }
}

//! `isp develop`: raw frames to pictures.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::time::Instant;

pub use petzval_camera::isp::{Chroma, Range, Standard};
use petzval_camera::isp::{HardwareIsp, RgbPicture, YcbcrFormat};
use petzval_files::isp_file::picture_png_bytes;
use petzval_files::{y4m_bytes, yuv_bytes};
use petzval_report::isp_strip::{Strip, StripParameter, StripStep, page};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::frame::{
    Frame, FrameOptions, Merge, Source, noted_frames, read_merged, read_one, warn_of_clipped,
};
use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result, make_folder, write_file};
use crate::named_isp::{NamedIsp, about_frame, isp_by_name};
use crate::noted::Noted;
use crate::pixels::check_numbers;
use crate::range::check_ranges;
use crate::results::{check_folder, has_ending};

pub use super::frame::RawInMemory;

/// Bits of the picture that luma and colour differences are computed from, so that they are rounded once.
const BITS_OF_YCBCR: u32 = 16;

petzval_base::parameters! {
    /// Raw frames to develop.
    ///
    /// For each `NAME.*` the folder `out` gets `NAME.png`, or `NAME.y4m` or `NAME.yuv`, and, with `strip`, `NAME-strip.html`: the picture after
    /// every stage, with the parameters of the stage. Frames that are merged give one picture, named by the first.
    pub struct Request {
        /// Bits of the pictures, 8, 10 or 16; of luma and colour differences, 8 or 10. A PNG of 10 bits has its codes scaled to 16.
        bits: u32 = 8, "", 8..16, Linear, "give 8, 10 or 16; of luma and colour differences 8 or 10";
    }
    also {
        /// The frames, in files with sidecars.
        raws: Vec<PathBuf> = Vec::new();
        /// Name of a preset, or a file of settings or of the description of an external ISP.
        isp: String = super::NEUTRAL.to_owned();
        /// Further values, each `stage.key=value`.
        set: Vec<String> = Vec::new();
        /// What the raw files leave open.
        frame: FrameOptions = FrameOptions::default();
        /// Merge the frames, exposures of one scene, into one.
        merge: Option<Merge> = None;
        /// Luma and colour differences in place of a PNG.
        ycbcr: Option<YcbcrFile> = None;
        /// Whether to write the page of all stages.
        strip: bool = false;
        /// Folder for the pictures; or, where there is one picture, its file.
        out: PathBuf = PathBuf::new();
    }
}

/// A file of luma and colour differences.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct YcbcrFile {
    /// The kind of file.
    pub container: Container,
    /// The standard of luma.
    pub standard: Standard,
    /// The codes between black and white.
    pub range: Range,
    /// How many colour differences there are.
    pub chroma: Chroma,
}

/// What holds the planes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Container {
    /// Y4M (YUV4MPEG2).
    #[default]
    Y4m,
    /// Nothing: the planes one after the other.
    Yuv,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// One for each frame, in the order of the request.
    pub pictures: Vec<Developed>,
}

/// A developed frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Developed {
    /// The raw file.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub raw: PathBuf,
    /// The picture.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub picture: PathBuf,
    /// The page of all stages.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub strip: Option<PathBuf>,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// How long the development took, s.
    pub seconds: f64,
}

/// A developed frame as a value: what `isp develop` keeps as a file.
#[derive(Clone, Debug)]
pub struct Picture {
    /// The raw file; the first of those that were merged.
    pub raw: PathBuf,
    /// The picture, red, green and blue of each pixel.
    pub picture: RgbPicture,
    /// How long the development took, s.
    pub seconds: f64,
}

/// Develops every frame; writes nothing. All inputs are read before the first is developed.
pub fn pictures(request: &Request, context: &Context) -> Result<Vec<Picture>> {
    let named = named_isp(request, context)?;
    let (_, shots) = shots(request)?;
    values(request, &named, &shots, context)
}

/// [`pictures`] of raw frames in memory, which are developed in place of the files of the request.
pub fn pictures_of(request: &Request, raws: &[RawInMemory<'_>], context: &Context) -> Result<Vec<Picture>> {
    let named = named_isp(request, context)?;
    raws.iter().try_for_each(|raw| check_numbers(raw.frame, raw.name))?;
    let sources: Vec<Source<'_>> = raws.iter().copied().map(Source::Memory).collect();
    let shots: Shots<'_> = match (&request.merge, raws.first()) {
        (_, None) => return Err(no_frame()),
        (Some(_), Some(first)) => vec![(first.name.into(), sources)],
        (None, Some(_)) => {
            raws.iter().zip(sources).map(|(raw, source)| (raw.name.into(), vec![source])).collect()
        }
    };
    values(request, &named, &shots, context)
}

/// The pictures of all shots.
fn values(request: &Request, named: &NamedIsp, shots: &Shots<'_>, context: &Context) -> Result<Vec<Picture>> {
    check_readable(request, shots, context)?;
    let mut pictures = Vec::new();
    develop(request, named, shots, context, &mut |_, _, _, picture| {
        pictures.push(picture);
        Ok(())
    })?;
    Ok(pictures)
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> =
    AsUnit { out_in: Some(""), ..AsUnit::placed(|request, folder| request.out = folder.to_owned()) };

/// Develops every frame, and keeps the pictures. All inputs are read before the first picture is written.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let named = named_isp(request, context)?;
    let (out, shots) = shots(request)?;
    check_readable(request, &shots, context)?;
    let page_of = |name: &OsStr| with_end(name, "-strip.html");
    let files = shots.iter().flat_map(|(name, _)| {
        let page = request.strip.then(|| page_of(name));
        [Some(picture_name(request, name)), page].into_iter().flatten()
    });
    check_folder(&out, files, context)?;
    check_inputs_stay(request, &out, &shots)?;
    make_folder(&out)?;

    let mut pictures = Vec::new();
    develop(request, &named, &shots, context, &mut |name, frame, values, picture| {
        let Picture { raw, picture, seconds } = picture;
        let path = out.join(picture_name(request, name));
        write_file(&path, encoded(request, &picture)?)?;
        context.wrote(&path, "picture");
        let strip = if request.strip {
            let steps = named.develop_steps(&frame.input, values).map_err(about_frame(&raw))?;
            let turned = |(stage, picture)| (stage, frame.turned(picture));
            let steps: Vec<(String, RgbPicture)> = steps.into_iter().map(turned).collect();
            let strip_path = out.join(page_of(name));
            write_file(&strip_path, page(&strip(&raw, &named, values, &steps)).as_bytes())?;
            context.wrote(&strip_path, "page");
            Some(strip_path)
        } else {
            None
        };
        let RgbPicture { height, width, .. } = picture;
        pictures.push(Developed { raw, picture: path, strip, height, width, seconds });
        Ok(())
    })?;
    Ok(Response { pictures })
}

/// The ISP of a request with its values, once every setting is in its range.
fn named_isp(request: &Request, context: &Context) -> Result<NamedIsp> {
    check_ranges(request)?;
    match (request.ycbcr, request.bits) {
        (None, 8 | 10 | 16) | (Some(_), 8 | 10) => {}
        (None, bits) => return Err(JobError::setting("bits", bits, "out of range", "give 8, 10 or 16")),
        (Some(_), bits) => return Err(JobError::setting("bits", bits, "out of range", "give 8 or 10")),
    }
    let mut named = isp_by_name(&request.isp, &context.assets, context.cancel())?;
    named.set(&request.set)?;
    named.set_bits(if request.ycbcr.is_some() { BITS_OF_YCBCR } else { request.bits });
    Ok(named)
}

/// Reads every frame once, before the first is developed.
fn check_readable(request: &Request, shots: &Shots<'_>, context: &Context) -> Result<()> {
    let quiet = context.silent();
    let noted = noted_frames(&quiet);
    shots.iter().try_for_each(|(_, raws)| read(request, raws, &noted).map(drop))
}

/// What happens to each picture: called with its name, the raw frame and the values of the ISP.
type Each<'a> = dyn FnMut(&OsStr, &Frame, &[f64], Picture) -> Result<()> + 'a;

/// Develops frame after frame, and gives each to `each`.
fn develop(
    request: &Request,
    named: &NamedIsp,
    shots: &Shots<'_>,
    context: &Context,
    each: &mut Each<'_>,
) -> Result<()> {
    let noted = noted_frames(context);
    for (i, (name, raws)) in shots.iter().enumerate() {
        context.check(|| format!("stopped after {i} of {} pictures", shots.len()))?;
        context.progress(i as u64, shots.len() as u64, name.to_string_lossy());
        let raw = raws.first().map_or(Path::new(""), Source::path);
        let frame = read(request, raws, &noted)?;
        frame.note_turn(raw, &noted);
        let values = named.values(frame.input.about.gain_ev)?;
        warn_of_clipped((named, &values), &frame.input, raw, &noted)?;
        let start = Instant::now();
        let picture = named.isp().develop(&frame.input, &values).map_err(about_frame(raw))?;
        let picture = frame.turned(picture);
        let seconds = start.elapsed().as_secs_f64();
        each(name, &frame, &values, Picture { raw: raw.to_owned(), picture, seconds })?;
    }
    Ok(())
}

/// A frame, of one raw frame or merged.
fn read(request: &Request, raws: &[Source<'_>], noted: &Noted<'_>) -> Result<Frame> {
    match (&request.merge, raws.first()) {
        (Some(merge), _) => read_merged(raws, merge, &request.frame, noted),
        (None, Some(raw)) => read_one(*raw, &request.frame, noted),
        (None, None) => Err(no_frame()),
    }
}

/// The error of a request without a frame.
fn no_frame() -> JobError {
    JobError::input("no raw frame is given", "give one or more raw files")
}

/// Pictures, each with its name and its raw frames.
type Shots<'a> = Vec<(OsString, Vec<Source<'a>>)>;

/// The folder of the pictures, and their names and raw files. The name of a file for `out` is that of the only picture.
fn shots(request: &Request) -> Result<(PathBuf, Shots<'_>)> {
    let out = &request.out;
    let files = || request.raws.iter().map(|raw| Source::File(raw));
    let shots: Shots<'_> = match (&request.merge, request.raws.first()) {
        (Some(_), Some(first)) => vec![(stem(first), files().collect())],
        _ => {
            let names = distinct_stems(&request.raws)?;
            names.into_iter().zip(files().map(|raw| vec![raw])).collect()
        }
    };
    let Some(ending) = ENDINGS.into_iter().find(|ending| has_ending(out, ending) && !out.is_dir()) else {
        return Ok((out.clone(), shots));
    };
    let own = extension(request);
    if !own.eq_ignore_ascii_case(ending) {
        let message = format!("the name of a {ending} file, and the picture is a {own} file");
        let hint = format!("--format {ending} writes such a file");
        return Err(JobError::setting("out", out.display(), message, hint));
    }
    match &shots[..] {
        [(_, raws)] => {
            let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty());
            Ok((folder.unwrap_or(Path::new(".")).to_owned(), vec![(stem(out), raws.clone())]))
        }
        several => {
            let message = format!("the name of one file, and there are {} pictures", several.len());
            Err(JobError::setting("out", out.display(), message, "name a folder"))
        }
    }
}

/// Refuses to replace a raw frame by its picture, also with the leave to overwrite results.
fn check_inputs_stay(request: &Request, out: &Path, shots: &Shots<'_>) -> Result<()> {
    let same = |a: &Path, b: &Path| matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b);
    for (name, _) in shots {
        let picture = out.join(picture_name(request, name));
        if request.raws.iter().any(|raw| same(raw, &picture)) {
            let message = format!("{}: the picture would replace its raw frame", picture.display());
            return Err(JobError::input(message, "name another folder with --out"));
        }
    }
    Ok(())
}

/// The ending and the bytes of a picture's file.
fn encoded(request: &Request, picture: &RgbPicture) -> Result<Vec<u8>> {
    let Some(YcbcrFile { container, standard, range, chroma }) = request.ycbcr else {
        return picture_png_bytes(picture, request.bits).map_err(JobError::failed);
    };
    let format = YcbcrFormat { standard, range, chroma, bits: request.bits };
    let planes = picture.to_ycbcr(format).map_err(|e| JobError::failed(e.to_string()))?;
    match container {
        Container::Y4m => y4m_bytes(&planes).map_err(|e| JobError::failed(e.to_string())),
        Container::Yuv => Ok(yuv_bytes(&planes)),
    }
}

/// Endings of pictures.
const ENDINGS: [&str; 3] = ["png", "y4m", "yuv"];

/// Name of the file of a picture.
fn picture_name(request: &Request, name: &OsStr) -> OsString {
    with_end(name, &format!(".{}", extension(request)))
}

/// A name of any bytes, and what is behind it.
fn with_end(name: &OsStr, end: &str) -> OsString {
    let mut whole = name.to_owned();
    whole.push(end);
    whole
}

/// File extension of the pictures. If `out` is the name of a file, its upper and lower case letters are kept.
fn extension(request: &Request) -> String {
    let usual = match request.ycbcr.map(|file| file.container) {
        None => "png",
        Some(Container::Y4m) => "y4m",
        Some(Container::Yuv) => "yuv",
    };
    let out = &request.out;
    let own = out.extension().filter(|_| has_ending(out, usual) && !out.is_dir());
    own.map_or_else(|| usual.to_owned(), |own| own.to_string_lossy().into_owned())
}

/// The page of all stages. The numbers of a stage without a picture stand at the one that is its picture too.
fn strip(raw: &Path, named: &NamedIsp, values: &[f64], steps: &[(String, RgbPicture)]) -> Strip {
    let place = |stage: &str| steps.iter().position(|(name, _)| name == stage);
    let mut shown = vec![Vec::new(); steps.len()];
    let mut shared = vec![Vec::new(); steps.len()];
    for (p, value) in named.parameters.iter().zip(values) {
        let stage = p.name.split_once('.').map_or("", |(stage, _)| stage);
        let of_another = HardwareIsp::WITHOUT_PICTURE.iter().find(|(own, _)| *own == stage);
        let of_another = of_another.and_then(|(_, picture)| place(picture));
        if let Some(at) = of_another
            && !shared[at].iter().any(|name| name == stage)
        {
            shared[at].push(stage.to_owned());
        }
        // An ISP of someone else's shows one picture for all of its stages.
        let at = place(stage).or(of_another).unwrap_or(steps.len().saturating_sub(1));
        shown[at].push(StripParameter {
            name: p.name.clone(),
            value: *value,
            unit: p.about.unit.to_owned(),
            is_default: *value == p.default_value(),
            sentence: p.about.sentence.clone(),
        });
    }
    let step = |(((stage, picture), parameters), shared): ((&(String, RgbPicture), _), _)| StripStep {
        stage: stage.clone(),
        shared,
        height: picture.height,
        width: picture.width,
        encoded: picture.encoded(),
        parameters,
    };
    Strip {
        raw: raw.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        isp: named.isp().name().to_owned(),
        steps: steps.iter().zip(shown).zip(shared).map(step).collect(),
    }
}

fn stem(raw: &Path) -> OsString {
    raw.file_stem().unwrap_or_default().to_owned()
}

/// Names of the files without their endings, each of which names a picture.
fn distinct_stems(raws: &[PathBuf]) -> Result<Vec<OsString>> {
    if raws.is_empty() {
        return Err(no_frame());
    }
    let mut seen: BTreeMap<OsString, &PathBuf> = BTreeMap::new();
    let mut names = Vec::new();
    for raw in raws {
        let name = stem(raw);
        if let Some(first) = seen.insert(name.clone(), raw) {
            let (first, raw, name) = (first.display(), raw.display(), Path::new(&name).display());
            let message = format!("{first} and {raw} would give the same picture {name}.png");
            return Err(JobError::input(message, "develop them into different folders"));
        }
        names.push(name);
    }
    Ok(names)
}

//! Reads a file: its objects, then the lens that they define.

use petzval_base::FileError;
use petzval_optics::glass::Catalog;

use super::object::Object;
use super::surface::RawSurface;
use super::system::{aperture, fields, wavelengths};
use crate::draft::{Draft, Import, Item, MOST_SURFACES, check_size};
use crate::loss::{Effect, Losses};
use crate::yaml;

/// Keys of a file. How the program aims its rays (`ray_tracer`) is no property of the lens.
const KEYS: &[&str] = &[
    "version",
    "name",
    "aperture",
    "fields",
    "wavelengths",
    "apodization",
    "pickups",
    "solves",
    "surface_group",
    "ray_tracer",
];

/// Reads a lens file. Glasses are looked up in `catalog` by name and maker.
///
/// Errors name the line, and the surface that cannot be traced as it stands.
pub fn parse_optiland(text: &str, catalog: &Catalog) -> Result<Import, FileError> {
    parse_optiland_start(text, catalog)?.buildable()
}

/// Reads a lens file to start an optimisation from: [`Import::unbuildable`] says whether its glass is too thin or its surfaces cross.
pub fn parse_optiland_start(text: &str, catalog: &Catalog) -> Result<Import, FileError> {
    check_size(text)?;
    if !text.trim_start().starts_with('{') {
        let error = FileError::at_line(1, text, "a lens in JSON begins with a brace");
        return Err(error.hint("the file that Optiland's save_optiland_file writes is read"));
    }
    // JSON is YAML; the reader of YAML knows lines, and takes the bare words Infinity and NaN that Python writes.
    let tree = yaml::parse(text)
        .map_err(|error| FileError { message: error.message.replacen("YAML", "JSON", 1), ..error })?;
    let root = Object::new(&tree, "")?;
    let mut losses = Losses::default();
    root.report_others(KEYS, &mut losses);
    report_lost(&root, &mut losses)?;

    let listed = root.needed_object("surface_group")?.list("surfaces")?;
    if listed.len() > MOST_SURFACES {
        let message = format!("a lens with more than {MOST_SURFACES} surfaces is not read");
        return Err(root.error("surface_group", message));
    }
    let raw: Vec<RawSurface> =
        listed.iter().enumerate().map(|(i, node)| RawSurface::new(node, i)).collect::<Result<_, _>>()?;
    let [object, between @ .., image] = &raw[..] else { return Err(no_lens(&root)) };
    if between.is_empty() || object.kind()? != "ObjectSurface" {
        return Err(no_lens(&root));
    }
    object.check_end("an object", catalog, &mut losses)?;
    image.check_end("an image", catalog, &mut losses)?;
    let stop = match &between.iter().enumerate().filter(|(_, s)| s.is_stop).collect::<Vec<_>>()[..] {
        [(stop, _)] => *stop,
        [_, (_, second), ..] => return Err(second.record.error("another surface is already the stop")),
        [] => {
            let error = root.error("surface_group", "no surface is the aperture stop");
            return Err(error.hint("one has `\"is_stop\": true`"));
        }
    };

    // The distance to the next surface is the difference of their places.
    let mut items = Vec::with_capacity(between.len());
    for pair in raw[1..].windows(2) {
        let drafted = pair[0].make(pair[1].z_mm - pair[0].z_mm, catalog, &mut losses)?;
        items.push(Item::Surface(Box::new(drafted)));
    }
    let (wavelengths, reference) = wavelengths(&root, &mut losses)?;
    let draft = Draft {
        name: root.text("name")?.unwrap_or("").to_owned(),
        source: String::new(),
        items,
        stop,
        aperture: aperture(&root)?,
        object: (between[0].z_mm - object.z_mm, object.record.clone()),
        wavelengths,
        reference,
        fields: fields(&root, &mut losses)?,
        at_paraxial_focus: false,
    };
    draft.finish(losses)
}

/// Reports what the file says of the lens as a whole and what is not kept.
fn report_lost(root: &Object<'_>, losses: &mut Losses) -> Result<(), FileError> {
    if root.has("pickups") {
        let message = "pickups are not kept, but their values are";
        losses.add(root.line("pickups"), "pickups", Effect::NoRay, message);
    }
    let solves = match root.object("solves") {
        Ok(Some(group)) => group.has("solves"),
        _ => root.has("solves"),
    };
    if solves {
        losses.add(root.line("solves"), "solves", Effect::NoRay, "solves are not kept, but their values are");
    }
    if let Some(apodization) = root.object("apodization")? {
        let kind = apodization.text("type")?.unwrap_or("");
        if kind != "UniformApodization" {
            let message = "the pupil is lit evenly: apodization is not kept";
            losses.add(root.line("apodization"), kind, Effect::Approximated, message);
        }
    }
    Ok(())
}

fn no_lens(root: &Object<'_>) -> FileError {
    let error = root.error("surface_group", "this is not a lens: it has no object, surface and image");
    error.hint("the first of its surfaces is an ObjectSurface, the last the image")
}

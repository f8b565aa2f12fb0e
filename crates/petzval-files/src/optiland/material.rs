//! The medium behind a surface.

use std::sync::Arc;

use petzval_base::FileError;
use petzval_optics::glass::{Catalog, Dispersion, Glass};

use super::object::Object;
use crate::decimal::shown;
use crate::draft::Record;
use crate::loss::{Effect, Losses};
use crate::old_glass::{substitute, unknown_glass};

/// The medium that an object describes; `record` is that of its surface.
pub(super) fn medium(
    material: &Object<'_>,
    record: &Record,
    catalog: &Catalog,
    losses: &mut Losses,
) -> Result<Arc<Glass>, FileError> {
    let mut lose = |key: &str, effect, message: &str| {
        losses.add(material.line(key), &record.text, effect, message);
    };
    match material.needed_text("type")? {
        "IdealMaterial" => {
            let index = material.needed_number("index")?;
            if !(1.0..10.0).contains(&index) {
                let message = format!("{}: an index from 1 to 10 is traced", record.text);
                return Err(material.error("index", message));
            }
            if material.number("absorp")?.is_some_and(|k| k != 0.0) {
                lose("absorp", Effect::NoRay, "absorption is not kept");
            }
            Ok(match index {
                1.0 => Glass::air(),
                _ => Arc::new(Glass::new(shown(index), Dispersion::Constant(index))),
            })
        }
        "Air" => {
            lose("type", Effect::Approximated, "air has the index 1, and glasses have theirs relative to it");
            Ok(Glass::air())
        }
        "AbbeMaterial" => {
            let (nd, vd) = (material.needed_number("index")?, material.needed_number("abbe")?);
            if !(nd > 1.0 && nd < 10.0 && vd > 0.0 && vd.is_finite()) {
                let message =
                    format!("{}: an index above 1 and an Abbe number above 0 are traced", record.text);
                return Err(material.error("index", message));
            }
            let message =
                "the glass has the dispersion of its Abbe number by Cauchy's formula, not by the program's";
            lose("abbe", Effect::Approximated, message);
            let name = format!("{}:{}", shown(nd), shown(vd));
            Ok(Arc::new(Glass::new(&name, Dispersion::NdVd { nd, vd })))
        }
        "Material" | "MaterialFile" => glass(material, record, catalog, losses),
        other => {
            let message = format!("{}: media of the type {other} are not traced", record.text);
            Err(material
                .error("type", message)
                .hint("IdealMaterial, AbbeMaterial, Material and MaterialFile are"))
        }
    }
}

/// A glass by name. The file of refractiveindex.info that the program took says which one it is where a name is not unique; without it the
/// reference says the maker.
fn glass(
    material: &Object<'_>,
    record: &Record,
    catalog: &Catalog,
    losses: &mut Losses,
) -> Result<Arc<Glass>, FileError> {
    let filename = material.text("filename")?.unwrap_or("");
    let parts: Vec<&str> = filename.rsplit(['/', '\\']).collect();
    let page = parts.first().and_then(|file| file.strip_suffix(".yml"));
    // The folder of glasses has one of each maker; other pages are named by their author.
    let of_maker = match (page, &parts[..]) {
        (Some(name), [_, maker, "glass", ..] | [_, "optical", maker, "specs", ..]) => Some((name, *maker)),
        _ => None,
    };
    let (name, maker) = match (of_maker, material.text("name")?) {
        (Some((name, maker)), _) => (name, Some(maker)),
        (None, Some(name)) => (name, material.text("reference")?),
        (None, None) => {
            let message = format!("{}: the file of this material is not read", record.text);
            return Err(material.error("filename", message).hint("name a glass of the catalogue"));
        }
    };
    let is_made_by = |glass: &&Arc<Glass>| maker.is_some_and(|maker| glass.maker.eq_ignore_ascii_case(maker));
    if let Some(glass) = catalog.all(name).iter().find(is_made_by) {
        return Ok(glass.clone());
    }
    let (line, text) = (material.line("name"), format!("{name} in {}", record.text));
    let is_named = |refused: &str| maker.is_some_and(|maker| refused.eq_ignore_ascii_case(maker));
    if let Some((_, refused)) = catalog.refusals(name).find(|(maker, _)| is_named(maker)) {
        return Err(unknown_glass(&Record::new(line, &text), &refused));
    }
    let glass = match catalog.get(name) {
        Ok(glass) => glass,
        Err(unknown) => {
            let Some((glass, said)) = substitute(name, None, catalog) else {
                return Err(unknown_glass(&Record::new(line, &text), &unknown));
            };
            losses.add(line, &text, Effect::Approximated, said);
            return Ok(glass);
        }
    };
    if let Some(maker) = maker.filter(|_| !glass.maker.is_empty()) {
        let message = format!("the glass is that of {}, and the file names {maker}", glass.maker);
        losses.add(line, &text, Effect::Approximated, message);
    }
    Ok(glass)
}

//! `lens-edit`: changes of a lens, one after the other, and its text in any format that is written.

mod change;

use petzval_files::{Export, LensFile, Loss, parse_lens_start, write_lens, write_seq, write_zmx};
use petzval_optics::glass::Catalog;
use petzval_optics::lens::traceable;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::{JobError, Result};
use crate::input::LensInput;

pub use change::Edit;
use change::{Editor, settle};

/// A lens, and how it changes. Nothing is written into a file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Lens: a built-in name, the path of a file, or the lens itself. It may be one that cannot be built.
    pub lens: LensInput,
    /// The changes, in this order.
    pub edits: Vec<Edit>,
    /// The format of the text.
    pub format: TextFormat,
}

/// A format in which lenses are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TextFormat {
    /// Petzval's own, which holds every lens to the last bit.
    #[default]
    Toml,
    /// Zemax OpticStudio.
    Zmx,
    /// CODE V.
    Seq,
}

/// The lens as it is then.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Name of the lens.
    pub name: String,
    /// Its text in the format of the request.
    pub text: String,
    /// Records of the file that the lens does not represent.
    pub losses_of_reading: Vec<Loss>,
    /// Properties of the lens that the text does not represent.
    pub losses_of_writing: Vec<Loss>,
    /// Why the lens cannot be built; none if it can.
    pub unbuildable: Option<String>,
}

/// A lens that was read and changed.
pub(crate) struct Edited {
    pub file: LensFile,
    /// Its text in Petzval's format: reading it gives the same lens to the last bit.
    pub toml: String,
    pub losses: Vec<Loss>,
    pub unbuildable: Option<String>,
}

/// Reads a lens and changes it.
pub(crate) fn edited(lens: &LensInput, edits: &[Edit], context: &Context) -> Result<Edited> {
    let (name, context) = &lens.placed(context)?;
    let import = context.assets.import_start(name)?;
    let catalog = context.assets.catalog()?;
    let mut file = import.file;
    if edits.is_empty() {
        let unbuildable = import.unbuildable.map(|error| error.message);
        return Ok(Edited { toml: write_lens(&file), file, losses: import.losses, unbuildable });
    }
    let editor = Editor { catalog: &catalog };
    for edit in edits {
        editor.apply(edit, &mut file)?;
        refuse_impossible(&file)?;
    }
    settle(&mut file)?;
    refuse_impossible(&file)?;
    let toml = write_lens(&file);
    let unbuildable = read_again(&toml, &catalog)?;
    Ok(Edited { file, toml, losses: import.losses, unbuildable })
}

/// Refuses a lens that has no meaning.
fn refuse_impossible(file: &LensFile) -> Result<()> {
    let hint = "the lens stays as it was";
    traceable(&file.lens).map_err(|defect| JobError::input(defect.to_string(), hint))
}

/// Checks that a lens file can be read; why its lens cannot be built, if it cannot.
fn read_again(toml: &str, catalog: &Catalog) -> Result<Option<String>> {
    match parse_lens_start(toml, catalog) {
        Ok(import) => Ok(import.unbuildable.map(|error| error.message)),
        Err(error) => {
            let hint = error.hint.unwrap_or_else(|| "the lens stays as it was".to_owned());
            Err(JobError::input(error.message, hint))
        }
    }
}

/// Changes the lens, and writes its text.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let Edited { file, toml, losses, unbuildable } = edited(&request.lens, &request.edits, context)?;
    let catalog = context.assets.catalog()?;
    let export = match request.format {
        TextFormat::Toml => Ok(Export { text: toml, losses: Vec::new() }),
        TextFormat::Zmx => write_zmx(&file, &catalog),
        TextFormat::Seq => write_seq(&file, &catalog),
    };
    let export = export.map_err(|error| {
        let hint = error.hint.clone().unwrap_or_else(|| "the format \"toml\" holds every lens".to_owned());
        JobError::input(error.message, hint)
    })?;
    Ok(Response {
        name: file.lens.name,
        text: export.text,
        losses_of_reading: losses,
        losses_of_writing: export.losses,
        unbuildable,
    })
}

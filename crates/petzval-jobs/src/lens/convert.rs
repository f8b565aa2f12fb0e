//! `lens convert`: a lens from one file format to another, with a report of what is lost.

use std::path::{Path, PathBuf};

use petzval_base::FileError;
use petzval_design::assets::extension;
use petzval_files::{Export, LensFile, Loss, write_lens, write_seq, write_zmx};
use petzval_optics::paraxial::first_order;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::as_unit::{AsUnit, within};
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::finite::finite;
use crate::input::LensInput;
use crate::results::{check_file, write_result};

/// A lens to be written in Petzval's format (`.toml`), Zemax's (`.zmx`) or CODE V's (`.seq`).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Lens: a built-in name, the path of a file, or the lens itself.
    pub from: LensInput,
    /// The file to write, whose ending names the format.
    pub to: PathBuf,
}

/// What was written and what was lost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Name of the lens.
    pub name: String,
    /// The lens as the request names it.
    pub from: String,
    /// The file that was written.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub to: PathBuf,
    /// Focal length, mm; `None` if the lens is afocal.
    pub efl_mm: Option<f64>,
    /// Records of the file that the lens does not represent.
    pub losses_of_reading: Vec<Loss>,
    /// Properties of the lens that the new file does not represent.
    pub losses_of_writing: Vec<Loss>,
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> =
    AsUnit::placed(|request, folder| request.to = within(folder, &request.to, "lens.toml"));

/// Reads the lens and writes it in the other format. A lens that would bend light otherwise there is refused.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let (name, context) = &request.from.placed(context)?;
    let import = context.assets.import(name)?;
    let export = write_as_named(&import.file, &request.to, context)?;
    let lens = import.file.lens;
    Ok(Response {
        efl_mm: finite(first_order(&lens.at_wavelength(lens.reference_um)).efl_mm),
        name: lens.name,
        from: name.clone(),
        to: request.to.clone(),
        losses_of_reading: import.losses,
        losses_of_writing: export.losses,
    })
}

/// Writes a lens in the format that the ending of a file names; returns what the file does not represent.
pub(super) fn write_as_named(file: &LensFile, to: &Path, context: &Context) -> Result<Export> {
    let catalog = context.assets.catalog()?;
    let export = match extension(to).as_str() {
        "toml" => Ok(Export { text: write_lens(file), losses: Vec::new() }),
        "zmx" => write_zmx(file, &catalog),
        "seq" => write_seq(file, &catalog),
        _ => {
            let message = format!("{}: no lens format that is written has this ending", to.display());
            return Err(JobError::input(message, "write .toml, .zmx or .seq"));
        }
    };
    let export = export.map_err(|error| not_writable(to, &error))?;
    check_file(to, context)?;
    write_result(to, encoded(to, &export.text), context)?;
    context.wrote(to, "lens");
    Ok(export)
}

/// The bytes of a file. Zemax takes ASCII as it is, and other text in UTF-16 with a byte order mark.
fn encoded(path: &Path, text: &str) -> Vec<u8> {
    if extension(path) == "zmx" && !text.is_ascii() {
        "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect()
    } else {
        text.as_bytes().to_vec()
    }
}

/// The error for a lens that the format cannot describe.
fn not_writable(path: &Path, error: &FileError) -> JobError {
    let bare = FileError { hint: None, ..error.clone() };
    let hint = error.hint.as_deref().unwrap_or("convert to .toml, which holds every lens");
    JobError::input(format!("{}: nothing is written: {bare}", path.display()), hint)
}

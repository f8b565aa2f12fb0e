//! `petzval lens convert`: a lens from one file format to another, with a report of what is lost.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use petzval::base::FileError;
use petzval::built_in_assets;
use petzval::design::assets::extension;
use petzval::design::run::write_atomically;
use petzval::files::{Export, Loss, write_lens, write_seq, write_zmx};
use petzval::optics::paraxial::first_order;
use serde_json::{Value, json};

use crate::cli::{Failure, print_json};

/// Convert a lens between Petzval's format (.toml), Zemax's (.zmx) and CODE V's (.seq). The endings say which is which.
///
/// Nothing is dropped in silence: what the new file does not say is reported, and a lens that would bend light otherwise is
/// refused.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    #[arg(value_name = "IN")]
    from: String,
    /// The file to write, whose ending names the format
    #[arg(value_name = "OUT")]
    to: PathBuf,
    /// The report on stdout, for machines
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    let assets = built_in_assets();
    let import = assets.import(&args.from)?;
    let catalog = assets.catalog()?;
    let export = match extension(&args.to).as_str() {
        "toml" => Ok(Export { text: write_lens(&import.file), losses: Vec::new() }),
        "zmx" => write_zmx(&import.file, &catalog),
        "seq" => write_seq(&import.file, &catalog),
        _ => {
            let message = format!("{}: no lens format has this ending", args.to.display());
            return Err(Failure::input(message, "write .toml, .zmx or .seq"));
        }
    };
    let export = export.map_err(|error| cannot_hold(&args.to, &error))?;
    write_atomically(&args.to, &encoded(&args.to, &export.text))?;
    if args.json {
        let lens = &import.file.lens;
        return print_json(&json!({
            "name": lens.name,
            "from": args.from,
            "to": args.to.display().to_string(),
            "efl_mm": first_order(&lens.at_wavelength(lens.reference_um)).efl_mm,
            "losses_of_reading": import.losses.iter().map(to_json).collect::<Vec<_>>(),
            "losses_of_writing": export.losses.iter().map(to_json).collect::<Vec<_>>(),
        }));
    }
    for loss in &import.losses {
        eprintln!("{}: {}", loss.effect.name(), loss.in_file(Path::new(&args.from)));
    }
    for loss in &export.losses {
        eprintln!("{}: {}", loss.effect.name(), loss.in_file(&args.to));
    }
    println!("{}", args.to.display());
    Ok(ExitCode::SUCCESS)
}

/// The bytes of a file. Zemax takes ASCII as it is, and other text in UTF-16 with a byte order mark.
fn encoded(path: &Path, text: &str) -> Vec<u8> {
    match extension(path) == "zmx" && !text.is_ascii() {
        true => "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect(),
        false => text.as_bytes().to_vec(),
    }
}

/// A lens that the format to be written has no words for.
fn cannot_hold(path: &Path, error: &FileError) -> Failure {
    let bare = FileError { hint: None, ..error.clone() };
    let hint = error.hint.as_deref().unwrap_or("convert to .toml, which holds every lens");
    Failure::input(format!("{}: nothing is written: {bare}", path.display()), hint)
}

fn to_json(loss: &Loss) -> Value {
    json!({
        "line": loss.line,
        "record": loss.record,
        "effect": loss.effect.name(),
        "message": loss.message,
        "more": loss.more,
    })
}

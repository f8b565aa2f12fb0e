//! `petzval data convert`: a data set of another format in COCO format.

use std::ffi::OsStr;
use std::path::PathBuf;

use clap::builder::{PossibleValue, TypedValueParser};
use clap::error::ErrorKind;
use clap::{Arg, Command};

use crate::jobs::data::SourceFormat;
use crate::jobs::data::convert::{self, Request};

use super::defects::table;
use crate::cli::choice::choice;
use crate::cli::code::Code;
use crate::cli::failure::Failure;
use crate::cli::plain::shown;
use crate::cli::terminal::{Terminal, print_json};

/// Convert a data set for object detection to the format of COCO, which all verbs read.
///
/// OUT gets annotations.json and the pictures in images/. Pictures are hard links to those of IN: they take no space, and stay when IN is
/// deleted. Where the file system does not allow links they are copies. Nothing in IN changes.
///
/// A line that cannot be understood ends the conversion. Boxes and pictures that cannot be used are left out and listed; everything else is written,
/// and the exit code is 2. Notes alone give 0.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Format of IN
    #[arg(value_parser = Formats(choice::<SourceFormat>()))]
    format: SourceFormat,
    /// Folder of the data set; for bdd100k also its JSON file
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// Folder for the converted data set; it must be new or empty
    #[arg(value_name = "OUT")]
    out: PathBuf,
    /// Copy pictures in place of links, so that changes of the ones do not reach the others
    #[arg(long)]
    copy: bool,
    /// Whether boxes of pictures that EXIF turns are of the pictures as shown (true) or of the stored pixels (false). It counts where neither the format
    /// nor a stated size says so; without it such pictures are left out
    #[arg(long, value_name = "true|false")]
    turned: Option<bool>,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// Reads a format, and says of COCO that it needs no conversion: no other word is near it.
#[derive(Clone)]
struct Formats<P>(P);

impl<P: TypedValueParser<Value = SourceFormat>> TypedValueParser for Formats<P> {
    type Value = SourceFormat;

    fn parse_ref(
        &self,
        command: &Command,
        arg: Option<&Arg>,
        value: &OsStr,
    ) -> Result<SourceFormat, clap::Error> {
        if value.to_str().is_some_and(convert::is_coco) {
            let error = clap::Error::raw(ErrorKind::InvalidValue, format!("{}\n", convert::NO_CONVERSION));
            return Err(error.with_cmd(command));
        }
        self.0.parse_ref(command, arg, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        self.0.possible_values()
    }
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let Args { format, input, out, copy, turned, json } = args;
    let request = Request { format, input, out, copy, turned };
    let response = convert::run(&request, &terminal.context())?;
    if json {
        print_json(&response)?;
    } else {
        out!("{}", table(&response.statistics, &response.defects));
        outln!(
            "\n{} ({} pictures linked, {} copied)",
            shown(&response.annotations),
            response.linked,
            response.copied
        );
    }
    Ok(if response.errors > 0 { Code::INPUT } else { Code::SUCCESS })
}

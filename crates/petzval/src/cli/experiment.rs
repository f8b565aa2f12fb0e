//! `petzval experiment` and `petzval schema`: the built-in experiments, and the schemas of files.

use std::process::ExitCode;

use clap::{Subcommand, ValueEnum};
use petzval::jobs::experiment::{self, FileKind};

use super::failure::Failure;
use super::terminal::{Terminal, print_json};

/// Verbs about experiments.
#[derive(Debug, Subcommand)]
pub enum ExperimentVerb {
    /// List the built-in experiments with their variants
    List {
        /// Machine-readable output
        #[arg(long)]
        json: bool,
    },
    /// Print an experiment, to read it or to start from it
    ///
    /// `petzval design NAME --print-config` prints it with every default filled in.
    Show {
        /// Experiment file, or the name of a built-in one
        name: String,
    },
}

/// Runs a verb.
pub fn run(verb: ExperimentVerb, terminal: &Terminal) -> Result<ExitCode, Failure> {
    match verb {
        ExperimentVerb::List { json } => {
            let entries = experiment::list(&terminal.context())?;
            if json {
                return print_json(&entries);
            }
            for entry in entries {
                println!("{}\n    {}\n    variants: {}", entry.name, entry.title, entry.variants.join(", "));
            }
        }
        ExperimentVerb::Show { name } => print!("{}", experiment::show(&name, &terminal.context())?),
    }
    Ok(ExitCode::SUCCESS)
}

/// Kinds of files that a user writes.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    /// An experiment of `petzval design`
    Experiment,
    /// A lens
    Lens,
    /// A sensor
    Sensor,
}

/// Print the JSON Schema of a kind of file, with which editors complete and check it.
///
/// In VS Code with the extension Even Better TOML, write the schema to a file and name it in the first line of your own
/// file: `#:schema ./experiment.schema.json`.
#[derive(Debug, clap::Args)]
pub struct SchemaArgs {
    /// Kind of file
    #[arg(value_enum)]
    kind: Kind,
}

/// Runs the verb.
pub fn schema(args: SchemaArgs) -> Result<ExitCode, Failure> {
    let kind = match args.kind {
        Kind::Experiment => FileKind::Experiment,
        Kind::Lens => FileKind::Lens,
        Kind::Sensor => FileKind::Sensor,
    };
    print_json(&experiment::schema(kind))
}

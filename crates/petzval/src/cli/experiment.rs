//! `petzval experiment` and `petzval schema`: the built-in experiments, and the schemas of files.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::jobs::Call;
use crate::jobs::design::Changes;
use crate::jobs::experiment::{self, FileKind, SchemaRequest};
use crate::jobs::run_all::{self, Request};
use crate::units::sweep::SweepFile;
use crate::units::table;
use clap::{Subcommand, ValueEnum};

use super::defaults::{numbers, word};
use super::failure::Failure;
use super::plain::shown;
use super::signals;
use super::terminal::{Terminal, ending, found, print_json};

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
    /// Run all built-in experiments that compare cameras, or some, with several seeds, and show them on one page
    ///
    /// It may take days and be interrupted: what is finished is kept, and the same command goes on with the rest. Every run can also be
    /// made alone by `petzval design NAME --seed S`. The tables are printed in Markdown.
    RunAll(RunAllArgs),
}

/// Arguments of `run-all`.
#[derive(Debug, clap::Args)]
pub struct RunAllArgs {
    /// Folder for the runs and the page
    #[arg(long, value_name = "DIR", default_value = word(Request::default().out))]
    out: PathBuf,
    /// Experiments, by built-in name or file [default: all built-in ones that compare cameras]
    #[arg(long, value_name = "NAME,NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Seeds; all experiments have a run of the first before any has one of the second
    #[arg(long, value_name = "N,N", value_delimiter = ',', default_value = numbers(&Request::default().seeds))]
    seeds: Vec<u64>,
    /// Minutes to three hours for each run on two cores: the experiments as they are [default]
    #[arg(long, conflicts_with = "full")]
    quick: bool,
    /// A night on a GPU for each run, see `petzval design --help`
    #[arg(long)]
    full: bool,
    /// Network steps of each camera in place of the experiments'; lens steps in proportion
    #[arg(long, value_name = "N", conflicts_with = "full")]
    steps: Option<usize>,
    /// Folder of pictures to use in place of the built-in photographs
    #[arg(long, value_name = "DIR")]
    photos: Option<PathBuf>,
    /// Device for tensors; `petzval doctor` lists them
    #[arg(long, default_value = word(Request::default().device))]
    device: String,
}

/// Runs a verb.
pub fn run(verb: ExperimentVerb, terminal: &Terminal) -> Result<Code, Failure> {
    match verb {
        ExperimentVerb::List { json } => {
            let entries = experiment::list(&experiment::ListRequest {}, &terminal.context())?;
            if json {
                return print_json(&entries);
            }
            for entry in entries {
                outln!("{}\n    {}\n    variants: {}", entry.name, entry.title, entry.variants.join(", "));
            }
        }
        ExperimentVerb::Show { name } => {
            out!("{}", experiment::show(&experiment::ShowRequest { name }, &terminal.context())?);
        }
        ExperimentVerb::RunAll(args) => return run_all(args, terminal),
    }
    Ok(Code::SUCCESS)
}

fn run_all(args: RunAllArgs, terminal: &Terminal) -> Result<Code, Failure> {
    let context = terminal.context().with_cancellation(signals::stop_on_signal()?);
    let request = Request {
        out: args.out,
        experiments: args.only,
        seeds: args.seeds,
        changes: Changes { photos: args.photos, steps: args.steps, is_full: args.full, ..Changes::default() },
        device: args.device,
    };
    let (response, stopped) = found(run_all::run(&request, &context))?;
    drop(context);
    if let Some(compared) = &response.compared {
        outln!("{}\npage: {}", compared.markdown, shown(&compared.page));
    }
    for (run, message) in &response.failed {
        noteln!("failed: {}: {message}", shown(run));
    }
    Ok(match (stopped, response.failed.is_empty()) {
        (None, false) => Code::FAILURE,
        (stopped, _) => ending(stopped.as_ref(), "the same command goes on"),
    })
}

/// Kinds of files that a user writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// An experiment of `petzval design`
    Experiment,
    /// A lens
    Lens,
    /// A sensor
    Sensor,
    /// A sweep of `petzval sweep`
    Sweep,
    /// A call of `petzval call`
    Call,
    /// The request of a job, by its name, or its response
    Job,
}

/// Print the JSON Schema of a kind of file, with which editors complete and check it; or that of a job's request or response.
///
/// In VS Code with the extension Even Better TOML, write the schema to a file and name it in the first line of your own
/// file: `#:schema ./experiment.schema.json`.
#[derive(Debug, clap::Args)]
pub struct SchemaArgs {
    /// Kind of file
    #[arg(value_enum)]
    kind: Kind,
    /// Name of the job whose request is meant; `petzval jobs` lists them
    #[arg(value_name = "NAME", required_if_eq("kind", "job"))]
    job: Option<String>,
    /// Print the schema of the response of the job in place of that of its request
    #[arg(long)]
    response: bool,
}

/// Runs the verb.
pub fn schema(args: SchemaArgs, terminal: &Terminal) -> Result<Code, Failure> {
    if let (Some(job), false) = (&args.job, args.kind == Kind::Job) {
        let hint = match table().row(job) {
            Ok(_) => format!("petzval schema job {job}"),
            Err(_) => "leave the name out".to_owned(),
        };
        return Err(Failure::input(format!("{job}: only the schema of a job has a name"), hint));
    }
    if args.response && args.kind != Kind::Job {
        return Err(Failure::input(
            "--response: only a job has a response",
            "petzval schema job NAME --response",
        ));
    }
    let kind = match args.kind {
        Kind::Experiment => FileKind::Experiment,
        Kind::Lens => FileKind::Lens,
        Kind::Sensor => FileKind::Sensor,
        Kind::Sweep => return print_json(&SweepFile::schema()),
        Kind::Call => return print_json(&Call::schema()),
        Kind::Job => {
            let table = table();
            let row = table.row(args.job.as_deref().unwrap_or_default())?;
            return print_json(&if args.response { row.response_schema() } else { row.schema() });
        }
    };
    print_json(&experiment::schema(&SchemaRequest { kind }, &terminal.context())?)
}

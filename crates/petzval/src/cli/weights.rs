//! `petzval weights`: the weights of a network by name, and a file of them.

use std::path::PathBuf;

use crate::jobs::weights::{self, WeightNames};

use crate::cli::code::Code;
use crate::cli::failure::Failure;
use crate::cli::number::six_digits;
use crate::cli::plain::shown;
use crate::cli::terminal::{Terminal, print_response};
use crate::cli::text_table::TextTable;

/// List the weights of a network by name, shape and size, and write them to a safetensors file.
///
/// A file of weights is taken by `network.weights` and `detector.weights` of experiments, by the description of a proxy, and by
/// `petzval.Weights` of Python. `detect --weights` takes one under the names of torchvision.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Safetensors file; folder of a run, of a camera or of a proxy; or a built-in name such as restoration_naf
    weights: PathBuf,
    /// The safetensors file to write
    #[arg(value_name = "OUT")]
    to: Option<PathBuf>,
    /// Camera of the run; it need not be named where one has weights
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
    /// What the network is, where neither its weights nor their file say so, such as segmenter
    #[arg(long, value_name = "KIND")]
    kind: Option<String>,
    /// Write the names of torchvision
    #[arg(long, requires = "to")]
    torchvision: bool,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let names = if args.torchvision { WeightNames::Torchvision } else { WeightNames::Petzval };
    let Args { weights, to, camera, kind, .. } = args;
    let response = weights::run(&weights::Request { weights, camera, kind, to, names }, &terminal.context())?;
    print_response(args.json, &response, || {
        let mut table = TextTable::new(["weight", "shape", "RMS"]);
        let mut numbers = 0;
        for row in &response.weights {
            let shape: Vec<String> = row.shape.iter().map(usize::to_string).collect();
            numbers += row.shape.iter().product::<usize>();
            table.row([row.name.clone(), shape.join(" x "), six_digits(row.rms)]);
        }
        out!("{}", table.text());
        outln!("{}: {} weights, {numbers} numbers", response.kind, response.weights.len());
        if let Some(to) = &response.to {
            outln!("{}", shown(to));
        }
    })
}

//! `petzval data check`: what a data set holds and what is wrong with it.

use std::collections::BTreeSet;
use std::path::PathBuf;

use crate::jobs::data::check::{self, Request, Taken};

use super::defects::table;
use crate::cli::code::Code;
use crate::cli::failure::Failure;
use crate::cli::plain::{plain, shown};
use crate::cli::terminal::{Terminal, print_json};

/// Show what a data set in COCO format holds: pictures, boxes by class and size, and everything that is wrong with it.
///
/// In a folder, annotations.json, _annotations.coco.json, annotations/instances_*.json, _annotations.coco.json in train/, valid/ and test/, or the one
/// JSON file is read; several files are parts of one data set. Pictures are beside the annotations or in images/. The annotations are checked, and
/// every picture is decoded.
///
/// Photographs without annotations are checked, too: a folder of pictures, a list (.txt) with one path a line, a tar shard, or a folder of shards.
///
/// Pictures that were decoded without an error are remembered in the cache folder of the user, with the SHA-256 of each: as long as size and time
/// of a file stay, a later check does not decode it again.
///
/// Exit code 2 if something cannot be used; notes alone give 0.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the data set, or its file of annotations; or a folder, list or tar file of photographs
    #[arg(value_name = "DATA")]
    data: PathBuf,
    /// Folder for data.html, a page with sample pictures and their boxes, and data.json
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Pictures on the page
    #[arg(long, default_value_t = Request::default().samples, value_name = "N")]
    samples: usize,
    /// Show which categories the classes of this experiment take, by built-in name or path
    #[arg(long, value_name = "EXPERIMENT")]
    classes_of: Option<String>,
    /// Decode every picture, whatever earlier checks have found
    #[arg(long)]
    no_cache: bool,
    /// Print figures and defects as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = Request {
        data: args.data,
        out: args.out,
        samples: args.samples,
        classes_of: args.classes_of.map(Into::into),
        no_cache: args.no_cache,
    };
    let response = check::run(&request, &terminal.context())?;
    if args.json {
        print_json(&response)?;
    } else {
        out!("{}", table(&response.statistics, &response.defects));
        if let Some(taken) = &response.taken {
            outln!("\n{}", taken_table(taken));
        }
        if let Some(page) = &response.page {
            outln!("\n{}", shown(page));
        }
    }
    Ok(if response.errors > 0 { Code::INPUT } else { Code::SUCCESS })
}

/// Which categories are of which class.
fn taken_table(taken: &Taken) -> String {
    let list = |names: &BTreeSet<String>| {
        if names.is_empty() {
            return "no category".to_owned();
        }
        names.iter().map(|name| plain(name)).collect::<Vec<_>>().join(", ")
    };
    let width = taken.classes.iter().map(|c| c.class.chars().count()).max().unwrap_or(0).max(10);
    let row = |name: &str, boxes: String, names: &BTreeSet<String>| {
        format!("{name:width$}  {boxes:>8}  {}", list(names))
    };
    let mut rows = vec![format!("{:width$}  {:>8}  categories", "class", "boxes")];
    rows.extend(taken.classes.iter().map(|c| row(&c.class, c.boxes.to_string(), &c.categories)));
    if !taken.not_judged.is_empty() {
        rows.push(row("not judged", String::new(), &taken.not_judged));
    }
    if !taken.background.is_empty() {
        rows.push(row("background", String::new(), &taken.background));
    }
    rows.join("\n")
}

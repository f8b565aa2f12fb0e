//! Chores of the workspace.
//!
//! `cargo xtask layers` checks that the crates keep the order of the light path, and that no modules and no folders inside a crate use
//! each other in a circle; and that results take paths that are no UTF-8. `cargo xtask words` checks the comments: short sentences, no house
//! words. `cargo xtask python` installs the Python package and tests it. `cargo xtask studio` builds the page of the studio anew, compares it, and tests it in a browser. `cargo xtask engines` runs
//! units of work under Slurm, HyperQueue, Ray and submitit. `cargo xtask devices` proves the build for GPUs on a Vulkan device that is a program
//! on the CPU. `cargo xtask results` writes the tables of the book's results from their data. `cargo xtask full` runs what continuous integration
//! has no time for.

mod circles;
mod devices;
mod ended;
mod engines;
mod files;
mod full;
mod layers;
mod lexer;
mod python;
mod result_paths;
mod results;
mod sources;
mod studio;
mod words;

use std::process::ExitCode;

fn main() -> ExitCode {
    let verb = std::env::args().nth(1).unwrap_or_default();
    let result = match verb.as_str() {
        "layers" => layers::check(),
        "words" => words::check(),
        "python" => {
            let has = |word: &str| std::env::args().any(|given| given == word);
            let ended = if has("--deeplens") {
                python::beside_deeplens().map_err(|problem| vec![problem])
            } else {
                python::check(has("--torch"))
            };
            ended.map(|ended| ended.to_string())
        }
        "studio" => {
            studio::check(std::env::args().any(|word| word == "--page")).map(|ended| ended.to_string())
        }
        "engines" => engines::check(&std::env::args().skip(2).collect::<Vec<_>>()),
        "devices" => devices::check(&std::env::args().skip(2).collect::<Vec<_>>()),
        "results" => results::run(&std::env::args().skip(2).collect::<Vec<_>>()),
        "full" => full::check(&std::env::args().skip(2).collect::<Vec<_>>()),
        _ => {
            eprintln!(
                "usage: cargo xtask layers|words|python [--torch|--deeplens]|studio [--page]|engines|devices|results [--check]|full [WORD]..."
            );
            return ExitCode::from(2);
        }
    };
    match result {
        Ok(report) => {
            println!("{report}");
            ExitCode::SUCCESS
        }
        Err(problems) => {
            problems.iter().for_each(|p| eprintln!("{verb}: {p}"));
            ExitCode::FAILURE
        }
    }
}

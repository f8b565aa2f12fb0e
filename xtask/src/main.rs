//! Chores of the workspace: `cargo xtask layers` checks that the crates keep the order of the light path, `cargo xtask
//! glasses FOLDER` makes the built-in glass catalogues from the database of refractiveindex.info.

mod glasses;
mod layers;

use std::process::ExitCode;

fn main() -> ExitCode {
    let verb = std::env::args().nth(1);
    match verb.as_deref() {
        Some("layers") => match layers::check() {
            Ok(report) => {
                println!("{report}");
                ExitCode::SUCCESS
            }
            Err(problems) => {
                problems.iter().for_each(|p| eprintln!("layers: {p}"));
                ExitCode::FAILURE
            }
        },
        Some("glasses") if std::env::args().count() == 3 => {
            let database = std::env::args().nth(2).unwrap_or_default();
            match glasses::refresh(database.as_ref()) {
                Ok(report) => {
                    println!("{report}");
                    ExitCode::SUCCESS
                }
                Err(problem) => {
                    eprintln!("glasses: {problem}");
                    ExitCode::FAILURE
                }
            }
        }
        _ => {
            eprintln!("usage: cargo xtask layers | cargo xtask glasses FOLDER");
            ExitCode::from(2)
        }
    }
}

//! Chores of the workspace: `cargo xtask layers` checks that the crates keep the order of the light path, and
//! that no modules and no folders inside a crate use each other in a circle.

mod circles;
mod layers;
mod sources;

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
        _ => {
            eprintln!("usage: cargo xtask layers");
            ExitCode::from(2)
        }
    }
}

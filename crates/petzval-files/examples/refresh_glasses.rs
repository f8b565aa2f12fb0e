//! Rewrites the built-in glass catalogues from the database of refractiveindex.info (CC0 1.0):
//! `cargo run --release -p petzval-files --example refresh_glasses FOLDER`, where FOLDER holds `specs`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use petzval_files::{parse_rii, write_catalog};
use petzval_optics::glass::{Glass, Status};

/// A maker whose glasses are built in.
struct Maker {
    /// File below `crates/petzval-data/data/glasses`, without `.toml`.
    file: &'static str,
    /// Folder below `specs`.
    folder: &'static str,
    name: &'static str,
    /// Title in the first line of the file.
    title: &'static str,
    /// Whether extinction data are included. They are half of the data of a glass: with all of them the built-in catalogue
    /// would double in size.
    extinction: bool,
    /// Statuses of the glasses that are included; `None` stands for glasses without a stated status.
    built_in: &'static [Option<Status>],
    /// Discontinued glasses that are included because many published lenses use them.
    classics: &'static [&'static str],
}

const REGULAR: &[Option<Status>] = &[Some(Status::Preferred), Some(Status::Standard)];

const MAKERS: [Maker; 6] = [
    Maker {
        file: "schott",
        folder: "schott/optical",
        name: "Schott",
        title: "Optical glasses of Schott, Mainz: Schott catalogue of 2017-01-20",
        extinction: true,
        // The special glasses include the radiation-resistant ones.
        built_in: &[Some(Status::Preferred), Some(Status::Standard), Some(Status::Special)],
        classics: &["SF14", "SF15", "LASFN9"],
    },
    Maker {
        file: "ohara",
        folder: "ohara/optical",
        name: "Ohara",
        title: "Optical glasses of Ohara, Sagamihara: Ohara catalogue of 2017-11-30",
        extinction: true,
        built_in: REGULAR,
        classics: &[],
    },
    Maker {
        file: "hoya",
        folder: "hoya/optical",
        name: "Hoya",
        title: "Optical glasses of Hoya, Tokyo: Hoya catalogue of 2017-04-01",
        extinction: true,
        built_in: REGULAR,
        classics: &[],
    },
    Maker {
        file: "hikari",
        folder: "hikari/optical",
        name: "Hikari",
        title: "Optical glasses of Hikari, Akita: Nikon catalogue of 2017-11; SK16 is the crown of many published triplets",
        extinction: false,
        built_in: REGULAR,
        classics: &["SK16", "SK4", "SF8"],
    },
    Maker {
        file: "sumita",
        folder: "sumita/optical",
        name: "Sumita",
        title: "Optical glasses of Sumita, Saitama: Sumita catalogue of 2017-02-02",
        extinction: false,
        // Its pages state no status.
        built_in: &[None],
        classics: &[],
    },
    Maker {
        file: "cdgm",
        folder: "cdgm/optical",
        name: "CDGM",
        title: "Optical glasses of CDGM, Chengdu: CDGM catalogue of 2022-06",
        extinction: false,
        built_in: REGULAR,
        classics: &[],
    },
];

/// Writes `crates/petzval-data/data/glasses/*.toml` from the database in a folder (the one that holds `specs`); returns a report.
fn refresh(database: &Path) -> Result<String, String> {
    let out = Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data/glasses");
    let mut report = Vec::new();
    for maker in &MAKERS {
        let glasses = read(maker, &database.join("specs").join(maker.folder))?;
        let header = format!(
            "# {}, by way of refractiveindex.info (CC0 1.0).\n\
             # Written by the example `refresh_glasses` of petzval-files. The manual's chapter on glass says what the keys mean; `nd` and `vd` are as\n\
             # the source prints them, against which the formula is tested.\n",
            maker.title
        );
        let text = header + &write_catalog(&glasses);
        let path = out.join(maker.file).with_extension("toml");
        fs::write(&path, &text).map_err(|e| format!("{}: {e}", path.display()))?;
        report.push(format!("{}: {} glasses, {} kB", maker.file, glasses.len(), text.len() / 1000));
    }
    Ok(report.join("\n"))
}

/// The included glasses of a maker, in the order of their names.
fn read(maker: &Maker, folder: &Path) -> Result<Vec<Glass>, String> {
    let said = |e: std::io::Error| format!("{}: {e}", folder.display());
    let mut pages: Vec<PathBuf> = Vec::new();
    for entry in fs::read_dir(folder).map_err(said)? {
        let path = entry.map_err(said)?.path();
        if path.extension().is_some_and(|e| e == "yml") {
            pages.push(path);
        }
    }
    pages.sort();
    let mut glasses = Vec::new();
    for path in pages {
        let page = fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        // File names cannot contain `*`, so `H-K9L*` is stored as `H-K9Lstar`.
        let name = stem.strip_suffix("star").map_or(stem.to_string(), |name| format!("{name}*"));
        let file = parse_rii(&page, &name, maker.name).map_err(|e| format!("{}: {e}", path.display()))?;
        for warning in &file.warnings {
            eprintln!("{}: {}", path.display(), warning.error);
        }
        for mut glass in file.glasses {
            glass.status = if maker.built_in.contains(&None) { None } else { Some(status(&page)) };
            if !maker.built_in.contains(&glass.status) && !maker.classics.contains(&name.as_str()) {
                continue;
            }
            // The head of the file states the source for all glasses.
            glass.source.clear();
            if !maker.extinction {
                glass.absorption = None;
            }
            glasses.push(glass);
        }
    }
    Ok(glasses)
}

/// The status of a page's glass in the maker's own file.
///
/// The status numbers of the makers' AGF files count from 0; the database read them as if they counted from 1. Its pages
/// therefore have no status for 0 (standard), `standard` for 1 (preferred) and `preferred` for 2 (obsolete). Evidence:
/// Schott's obsolete LASFN9 and SF14 are `preferred` there, and Hoya's files of the same years have 1 where the page has
/// `standard`.
fn status(page: &str) -> Status {
    match page.lines().find_map(|line| line.trim().strip_prefix("glass_status:")).map(str::trim) {
        Some("standard") => Status::Preferred,
        Some("preferred") => Status::Obsolete,
        Some("special") => Status::Special,
        _ => Status::Standard,
    }
}

fn main() -> ExitCode {
    let Some(folder) = std::env::args().nth(1) else {
        eprintln!("usage: refresh_glasses FOLDER, the folder that holds `specs`");
        return ExitCode::from(2);
    };
    match refresh(folder.as_ref()) {
        Ok(report) => {
            println!("{report}");
            ExitCode::SUCCESS
        }
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::FAILURE
        }
    }
}

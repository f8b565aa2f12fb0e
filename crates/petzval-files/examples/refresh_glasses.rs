//! Rewrites the built-in glass catalogues from the database of refractiveindex.info (CC0 1.0):
//! `cargo run --release -p petzval-files --example refresh_glasses FOLDER`, with the folder that holds `specs`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use petzval_files::{parse_rii, write_catalog};
use petzval_optics::glass::{Glass, Status};

/// A maker whose glasses are built in.
struct Maker {
    /// File below `data/glasses`, without `.toml`.
    file: &'static str,
    /// Folder below `specs`.
    folder: &'static str,
    name: &'static str,
    /// What the file begins with.
    title: &'static str,
    /// Whether the extinction comes along. It is half of what is known of a glass, and all of it would double the
    /// program's catalogue.
    extinction: bool,
    /// Glasses that come along; `None` is a glass of whose status nothing is said.
    built_in: &'static [Option<Status>],
    /// Glasses that are made no more, but stand in many published lenses.
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
        // Among its specials are the glasses that withstand radiation.
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
        // Its pages say nothing of any glass.
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

/// Writes `data/glasses/*.toml` from the database in a folder (the one that holds `specs`); returns what was written.
fn refresh(database: &Path) -> Result<String, String> {
    let out = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/glasses");
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

/// The glasses of a maker that come along, in the order of their names.
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
        // No file may be called `H-K9L*`.
        let name = stem.strip_suffix("star").map_or(stem.to_string(), |name| format!("{name}*"));
        let file = parse_rii(&page, &name, maker.name).map_err(|e| format!("{}: {e}", path.display()))?;
        for warning in &file.warnings {
            eprintln!("{}: {warning}", path.display());
        }
        for mut glass in file.glasses {
            glass.status = if maker.built_in.contains(&None) { None } else { Some(status(&page)) };
            if !maker.built_in.contains(&glass.status) && !maker.classics.contains(&name.as_str()) {
                continue;
            }
            // The head of the file says it for all.
            glass.source.clear();
            if !maker.extinction {
                glass.absorption = None;
            }
            glasses.push(glass);
        }
    }
    Ok(glasses)
}

/// The status that a maker's own file gives to the glass of a page.
///
/// The database took the numbers of the makers' AGF files for a list that begins with 1, where it begins with 0: pages
/// say nothing for 0 (standard), `standard` for 1 (preferred) and `preferred` for 2 (obsolete). Schott's LASFN9 and SF14
/// are `preferred` there, Hoya's files of the same years have 1 where the page says `standard`.
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

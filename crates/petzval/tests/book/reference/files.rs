//! The pages of files: what may stand in each kind, by its schema, and what becomes of records of other programs.

use petzval::camera::isp::IspPreset;
use petzval::design::experiment::Experiment;
use petzval::files::{OperandFile, lens_schema, psf_file::PsfAxes};
use petzval::units::Unit;
use petzval::units::sweep::SweepFile;
use serde_json::Value;

use super::Page;
use super::markdown::{sentence, table};
use super::schema_rows::{Schema, as_table};
use crate::common::run_ok;

/// The page of all files, and one each for lenses, for other parts of a camera, and for work.
pub fn pages() -> Vec<Page> {
    let folder = std::env::temp_dir();
    let of_command = |kind: &str| run_ok(&folder, &["schema", kind]).json();
    let experiment = schemars::schema_for!(Experiment).to_value();
    let mut class = experiment["$defs"]["ObjectClass"].clone();
    class["$defs"] = experiment["$defs"].clone();
    let own = |title: &str, text: &str, schema: Value| (title.to_owned(), text.to_owned(), schema);
    let operands = own(
        "Operands",
        "A TOML file of figures that a lens should reach: `petzval lens optimize --operands FILE`.",
        schemars::schema_for!(OperandFile).to_value(),
    );
    let psfs = own(
        "Bank of PSFs",
        "`psf.json` in a folder that `petzval psf` or `petzval psf-calibrate` wrote, beside its arrays.",
        schemars::schema_for!(PsfAxes).to_value(),
    );
    let isp = own(
        "Preset of the built-in ISP",
        "A TOML file: `--isp FILE` of `petzval isp`, `isp.preset` of an experiment.",
        schemars::schema_for!(IspPreset).to_value(),
    );
    let lens = own("Lens", "A TOML file, wherever a command takes a lens.", lens_schema().to_value());
    let sensor = own("Sensor", "A TOML file, wherever a command takes a sensor.", of_command("sensor"));
    let preset = own(
        "Task with classes of its own",
        "A TOML file with the key `task`, one of \"objects\" and \"segments\", and a table `[[class]]` for each class. These are the keys of a class.",
        class,
    );
    let sweep =
        own("Sweep", "A TOML file: `petzval sweep FILE`.", schemars::schema_for!(SweepFile).to_value());
    let unit = own("Unit", "A JSON file: `petzval unit run FILE`.", Unit::schema());
    let call = own("Call", "A JSON file: `petzval call FILE`.", of_command("call"));
    let parts = [
        ("lens", "Files of lenses", vec![lens, operands]),
        ("camera", "Files of sensors, PSFs and ISPs", vec![sensor, psfs, isp]),
        ("work", "Files of tasks, sweeps and units", vec![preset, sweep, unit, call]),
    ];
    let mut rows = Vec::new();
    let mut pages = Vec::new();
    for (path, title, files) in parts {
        for (kind, text, _) in &files {
            let anchor = kind.to_lowercase().replace(' ', "-");
            rows.push(vec![format!("[{kind}](files/{path}.md#{anchor})"), text.clone()]);
        }
        pages.push(Page {
            path: format!("files/{path}.md"),
            frame: format!("# {title}\n\nWhich files are read and written stands in [files](../files.md).\n"),
            generated: files.iter().map(section).collect(),
        });
    }
    let index = format!("## Files with keys\n\n{}", table(&["what", "where it is read"], &rows));
    pages.insert(0, Page { path: "files.md".to_owned(), frame: String::new(), generated: index });
    pages
}

fn section((title, text, schema): &(String, String, Value)) -> String {
    let about =
        schema["description"].as_str().map(|about| format!("{}\n\n", sentence(about))).unwrap_or_default();
    format!("## {title}\n\n{text}\n\n{about}{}\n", as_table(&Schema(schema).rows(usize::MAX)))
}

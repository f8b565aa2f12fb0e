//! The pages of files: what may stand in each kind, by its schema, and what becomes of records of other programs.

use petzval::design::experiment::Experiment;
use petzval::files::{ForeignRecords, file_schemas, lens_schema, seq, zmx};
use petzval::units::Unit;
use petzval::units::sweep::SweepFile;
use serde_json::Value;

use super::Page;
use super::markdown::{code, prose, sentence, table};
use super::schema_rows::{Schema, as_table};
use crate::common::run_ok;

/// The page of all files, and one each for lenses, for sensors and frames, for ISPs, and for work.
pub fn pages() -> Vec<Page> {
    let folder = std::env::temp_dir();
    let of_command = |kind: &str| run_ok(&folder, &["schema", kind]).json();
    let experiment = schemars::schema_for!(Experiment).to_value();
    let mut class = experiment["$defs"]["ObjectClass"].clone();
    class["$defs"] = experiment["$defs"].clone();
    let own = |title: &str, text: &str, schema: Value| (title.to_owned(), text.to_owned(), schema);
    let more = file_schemas().into_iter().map(|file| own(file.title, file.read_by, file.schema.to_value()));
    let (of_lens, of_camera): (Vec<_>, Vec<_>) =
        more.partition(|(title, ..)| ["Glass catalogue", "Operands", "Tolerances"].contains(&title.as_str()));
    let (of_isp, of_camera): (Vec<_>, Vec<_>) =
        of_camera.into_iter().partition(|(title, ..)| title.contains("ISP"));
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
        ("lens", "Files of lenses", [vec![lens], of_lens].concat()),
        ("camera", "Files of sensors, PSFs and frames", [vec![sensor], of_camera].concat()),
        ("isp", "Files of ISPs", of_isp),
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
    let index =
        format!("## Files with keys\n\n{}\n{}", table(&["what", "where it is read"], &rows), foreign());
    pages.insert(0, Page { path: "files.md".to_owned(), frame: String::new(), generated: index });
    pages
}

fn section((title, text, schema): &(String, String, Value)) -> String {
    let about =
        schema["description"].as_str().map(|about| format!("{}\n\n", sentence(about))).unwrap_or_default();
    format!("## {title}\n\n{text}\n\n{about}{}\n", as_table(&Schema(schema).rows(usize::MAX)))
}

/// Records of other programs that are not read into the lens.
fn foreign() -> String {
    let all = [("Zemax", "record", zmx::records()), ("CODE V", "command", seq::records())];
    all.into_iter().map(|(program, what, records)| records_of(program, what, &records)).collect()
}

fn records_of(program: &str, what: &str, records: &ForeignRecords) -> String {
    let list = |names: &[&str]| names.iter().map(|name| code(name)).collect::<Vec<_>>().join(" ");
    let mut out = format!("## {program}: what does not become a part of the lens\n\n");
    out += &format!("Ignored, because it does not describe the lens: {}.\n\n", list(&records.ignored));
    if !records.solves.is_empty() {
        out += &format!(
            "Solves, of which the value is kept and the solve reported: {}.\n\n",
            list(&records.solves)
        );
    }
    for (title, rows) in [
        ("Reported, because it changes no ray", &records.lost),
        ("Refused, because rays would take another path", &records.refused),
    ] {
        // Names with one reason stand in one row.
        let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
        for (name, reason) in rows {
            match reasons.iter_mut().find(|(other, _)| other == reason) {
                Some((_, names)) => names.push(name),
                None => reasons.push((reason, vec![name])),
            }
        }
        if !reasons.is_empty() {
            let rows: Vec<_> =
                reasons.iter().map(|(reason, names)| vec![list(names), prose(reason)]).collect();
            out += &format!("{title}:\n\n{}\n", table(&[what, "why"], &rows));
        }
    }
    out
}

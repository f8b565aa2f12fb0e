//! Blocks of TOML: each is read by the reader of the file that it is, or of which it is a part.

use std::path::Path;

use petzval::base::FileError;
use petzval::camera::isp::IspPreset;
use petzval::design::experiment::Experiment;
use petzval::design::task::Tasks;
use petzval::files::raw_file::{self, FrameCalibration};
use petzval::files::{
    OperandFile, isp_file, lens_schema, parse_catalog, parse_lens, parse_operands, parse_sensor,
    parse_tolerances, spectral_file,
};
use petzval::units::sweep::SweepFile;
use serde_json::Value;
use toml::Table;

use crate::common::{data, read, run};
use crate::reference::schema_rows::{Row, Schema};

/// A kind of file: its name, its keys, and its reader.
struct Kind {
    name: String,
    rows: Vec<Row>,
    read: Option<Reader>,
}

/// Reads a block. The error says what every reader that knows the keys of the block has to say.
pub fn check(text: &str, folder: &Path) -> Result<(), String> {
    let table: Table = text.parse().map_err(|error: toml::de::Error| error.to_string())?;
    // Lists of captures, which a reader knows only with their folder: it is content if all that it misses are the frames.
    for (key, verb) in [("point", &["sensor", "characterize"][..]), ("position", &["psf-calibrate"])] {
        if table.contains_key(key) {
            let list = folder.join(format!("captures-{key}"));
            std::fs::create_dir_all(&list).expect("a folder");
            std::fs::write(list.join("captures.toml"), text).expect("a list");
            let outcome = run(&list, &[verb, &["."]].concat());
            let is_read =
                outcome.code == Some(0) || outcome.says("is not there") || outcome.says("No such file");
            return if is_read { Ok(()) } else { Err(outcome.stderr) };
        }
    }
    let mut said = Vec::new();
    for kind in kinds() {
        let is_known = table.keys().all(|key| kind.rows.iter().any(|row| row.key == *key));
        if !is_known && !kind.rows.is_empty() {
            continue;
        }
        let whole = kind.read.map(|read| read(text));
        match whole {
            Some(Ok(())) => return Ok(()),
            Some(Err(error)) if kind.rows.is_empty() => {
                said.push(format!("{}: {error}", kind.name));
                continue;
            }
            _ => {}
        }
        // A part of a file: each of its keys is known, and each value fits.
        match part(&table, "", &kind.rows) {
            Ok(()) => return Ok(()),
            Err(error) => said.push(format!("{}: {error}", kind.name)),
        }
    }
    Err(format!("no reader takes it:\n{}", said.join("\n")))
}

/// Reads a file, and says what is wrong with it.
type Reader = fn(&str) -> Result<(), FileError>;

fn kind(name: &str, schema: Value, read: Option<Reader>) -> Kind {
    Kind { name: name.to_owned(), rows: Schema(&schema).rows(usize::MAX), read }
}

fn kinds() -> Vec<Kind> {
    let mut kinds = vec![
        kind(
            "experiment",
            schemars::schema_for!(Experiment).to_value(),
            Some(|text| Tasks::built_in().parse(text).map(drop)),
        ),
        kind(
            "lens",
            lens_schema().to_value(),
            Some(|text| parse_lens(text, &petzval::optics::glass::Catalog::default()).map(drop)),
        ),
        kind(
            "sensor",
            schemars::schema_for!(petzval::camera::sensor::SensorModel).to_value(),
            Some(|text| parse_sensor(text).map(drop)),
        ),
        kind(
            "sweep",
            schemars::schema_for!(SweepFile).to_value(),
            Some(|text| petzval::units::sweep::parse(text).map(drop)),
        ),
    ];
    kinds.push(kind(
        "operands",
        schemars::schema_for!(OperandFile).to_value(),
        Some(|text| parse_operands(text).map(drop)),
    ));
    kinds.push(kind(
        "preset of the built-in ISP",
        schemars::schema_for!(IspPreset).to_value(),
        Some(|text| isp_file::parse_isp_preset(text).map(drop)),
    ));
    // Files without a schema: their reader alone decides.
    for (name, read) in BY_READER {
        kinds.push(Kind { name: (*name).to_owned(), rows: Vec::new(), read: Some(*read) });
    }
    kinds
}

/// Files without a schema.
const BY_READER: &[(&str, Reader)] = &[
    ("glass catalogue", |text| parse_catalog(text).map(drop)),
    ("tolerances", |text| {
        let catalog = petzval::built_in_assets().catalog().expect("the built-in glasses");
        let lens = parse_lens(&read(&data("lenses/cooke-triplet-nominal.toml")), &catalog)?;
        parse_tolerances(text, &lens.lens).map(drop)
    }),
    ("description of an external ISP", |text| isp_file::parse_external_isp(text).map(drop)),
    ("calibration of a raw frame", |text| FrameCalibration::from_toml(text).map(drop)),
    ("spectral image", |text| {
        toml::from_str::<spectral_file::Sidecar>(text)
            .map(drop)
            .map_err(|error| FileError::from_toml(text, &error))
    }),
    ("raw frame", |text| {
        let folder = tempfile::tempdir().expect("a folder");
        let frame = folder.path().join("frame.raw");
        std::fs::write(raw_file::sidecar_path(&frame), text).expect("a file");
        let wrong = |error: raw_file::RawFileError| FileError::of_value(".", &error.to_string());
        raw_file::Sidecar::beside(&frame).map(drop).map_err(wrong)
    }),
];

/// Checks the keys of a part of a file, and their values.
fn part(table: &Table, path: &str, rows: &[Row]) -> Result<(), String> {
    for (key, value) in table {
        let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        let row = rows.iter().find(|row| row.key == path).ok_or_else(|| format!("`{path}`: no such key"))?;
        let is_free = !rows.iter().any(|row| row.key.starts_with(&format!("{path}.")));
        match value {
            toml::Value::Table(_) if is_free => {}
            toml::Value::Table(below) => part(below, &path, rows)?,
            toml::Value::Array(all) => {
                for one in all {
                    match one {
                        toml::Value::Table(below) if !is_free => part(below, &path, rows)?,
                        other => row.check(&json(other)).map_err(|what| format!("`{path}`: {what}"))?,
                    }
                }
            }
            other => row.check(&json(other)).map_err(|what| format!("`{path}`: {what}"))?,
        }
    }
    Ok(())
}

fn json(value: &toml::Value) -> Value {
    serde_json::to_value(value).unwrap_or(Value::Null)
}

#[test]
fn a_block_is_read_by_its_reader() {
    let folder = tempfile::tempdir().unwrap();
    let check = |text: &str| check(text, folder.path());
    for good in [
        "[training]\nsteps = 2000\n",
        "[nonuniformity]\nspecimen = 7\n",
        "[glass.A]\nnd = 1.5\nvd = 60.0\n",
        "[[surface]]\nradius_mm = inf\nthickness_mm = 1.0\n",
        "experiment = \"a.toml\"\nseeds = [1, 2]\n[grid]\npsf.grid = [64]\n",
    ] {
        check(good).unwrap_or_else(|error| panic!("{good}\n{error}"));
    }
    for (wrong, says) in [
        ("[training]\nstepps = 2000\n", "training.stepps"),
        ("[training]\nsteps = -1\n", "training.steps"),
        ("[psf]\nkind = \"wave\"\n", "psf.kind"),
        ("[[surface]]\nradius = 3\n", "surface.radius"),
        ("nothing = 1\n", "no reader takes it"),
    ] {
        let error = check(wrong).unwrap_err();
        assert!(error.contains(says), "{wrong}{error}");
    }
}

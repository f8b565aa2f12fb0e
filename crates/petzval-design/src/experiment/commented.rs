//! An experiment as a file to read and to start from: every key with its unit, range and sentence.

use petzval_base::parameter::{ParameterTable, Parameters};
use petzval_learn::loss::ImageLoss;

use super::{
    CheckpointConfig, ConstraintConfig, Experiment, ExposureConfig, IspConfig, NetworkConfig, OpticsConfig,
    PsfConfig, ScoringConfig, SpotConfig, StreetConfig, TrainingConfig, ValidationConfig,
};
use crate::error::DesignError;

/// The tables of numbers of an experiment, by name.
pub(super) fn tables() -> [(&'static str, ParameterTable); 13] {
    [
        ("exposure", ExposureConfig::table()),
        ("psf", PsfConfig::table()),
        ("isp", IspConfig::table()),
        ("network", NetworkConfig::table()),
        ("street", StreetConfig::table()),
        ("training", TrainingConfig::table()),
        ("loss", ImageLoss::table()),
        ("optics", OpticsConfig::table()),
        ("spot", SpotConfig::table()),
        ("constraints", ConstraintConfig::table()),
        ("scoring", ScoringConfig::table()),
        ("validation", ValidationConfig::table()),
        ("checkpoint", CheckpointConfig::table()),
    ]
}

/// [`Experiment::to_toml`] with a comment above each table and behind each number.
pub fn commented_toml(experiment: &Experiment) -> Result<String, DesignError> {
    let tables = tables();
    let mut current: Option<&ParameterTable> = None;
    let mut out = String::new();
    for line in experiment.to_toml()?.lines() {
        if let Some(header) = line.strip_prefix('[') {
            let name = header.trim_end_matches(']');
            current = tables.iter().find(|(table, _)| *table == name).map(|(_, table)| table);
            if let Some(table) = current {
                out += &format!("# {}\n", table.sentence);
            }
        }
        let key = line.split(" = ").next().unwrap_or_default();
        let parameter = current.and_then(|t| t.parameters.iter().find(|p| p.name == key));
        out += &match parameter {
            Some(p) => {
                let unit = if p.unit.is_empty() { String::new() } else { format!(" {}", p.unit) };
                format!("{line:<40} # {} to {}{unit}: {}\n", p.min, p.max, p.sentence)
            }
            None => format!("{line}\n"),
        };
    }
    Ok(out)
}

/// The numbers of an experiment as a Markdown table: key, default, range, unit, sentence.
pub fn reference_markdown() -> String {
    let mut out = "| key | default | range | unit | meaning |\n|---|---|---|---|---|\n".to_owned();
    for (table, numbers) in tables() {
        for p in numbers.parameters {
            let default = match &p.default[..] {
                [one] => one.to_string(),
                several => format!("[{}]", several.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")),
            };
            let (name, unit, sentence) = (p.name, p.unit, p.sentence);
            out +=
                &format!("| `{table}.{name}` | {default} | {} to {} | {unit} | {sentence} |\n", p.min, p.max);
        }
    }
    out
}

//! The figures of several seeds that runs quote (`crates/petzval-data/data/studies`): they are those of a table.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde::Deserialize;

use super::claims::below;
use super::data::{Data, Table};

/// What is compared of the file of a study.
#[derive(Deserialize)]
struct Study {
    seeds: Vec<u64>,
    #[serde(default)]
    difference: Vec<Difference>,
}

#[derive(Deserialize)]
struct Difference {
    against: String,
    #[serde(default)]
    score: BTreeMap<String, Spread>,
}

#[derive(Deserialize)]
struct Spread {
    mean: f64,
    deviation: f64,
}

/// Where the files of studies differ from their tables.
pub(super) fn problems(root: &Path, data: &Data) -> Vec<String> {
    let tables = data.files.values().flat_map(|file| &file.tables);
    let quoted = tables.filter_map(|table| Some((table, table.study.as_deref()?)));
    let problem = |(table, path): (&Table, &str)| match below(root, path) {
        None => vec![format!("table {:?}: study = {path:?}: there is no such file", table.key)],
        Some(file) => match fs::read_to_string(file) {
            Err(e) => vec![format!("{path}: {e}")],
            Ok(text) => compared(table, &text).into_iter().map(|what| format!("{path}: {what}")).collect(),
        },
    };
    quoted.flat_map(problem).collect()
}

/// Where the text of a study differs from its table.
fn compared(table: &Table, text: &str) -> Vec<String> {
    let study: Study = match toml::from_str(text) {
        Ok(study) => study,
        Err(e) => return vec![e.message().to_owned()],
    };
    let mut problems = Vec::new();
    if study.seeds != table.seeds {
        problems.push(format!("seeds = {:?}, in table {:?} {:?}", study.seeds, table.key, table.seeds));
    }
    if study.difference.is_empty() {
        problems.push(format!("no [[difference]]: table {:?} is compared with nothing", table.key));
    }
    for difference in &study.difference {
        let has_column =
            |metric: &str| table.columns.iter().any(|column| column.metric.as_deref() == Some(metric));
        for metric in difference.score.keys().filter(|metric| !has_column(metric)) {
            problems.push(format!(
                "score.{metric} against {}: table {:?} has no column of this metric, so nothing holds the figure",
                difference.against, table.key
            ));
        }
        if difference.score.is_empty() {
            problems.push(format!("against {}: no score is stated", difference.against));
        }
        for (place, column) in table.columns.iter().enumerate() {
            let Some(score) = column.metric.as_ref().and_then(|metric| difference.score.get(metric)) else {
                continue;
            };
            let cell = table.row(&difference.against).and_then(|row| row.get(place)?.as_ref()?.spread());
            let rounded = |value: f64| format!("{value:.*}", column.decimals);
            let is_same = cell.is_some_and(|(mean, deviation)| {
                rounded(mean) == rounded(score.mean) && rounded(deviation) == rounded(score.deviation)
            });
            if !is_same {
                let cell = cell.map_or("nothing".to_owned(), |(mean, deviation)| {
                    format!("{} +- {}", rounded(mean), rounded(deviation))
                });
                problems.push(format!(
                    "{} against {}: {} +- {}, but table {:?} has {cell}; runs quote the study, so write the figures of the table into it",
                    column.name, difference.against, score.mean, score.deviation, table.key
                ));
            }
        }
    }
    problems
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::data::DataFile;

    #[test]
    fn a_study_that_is_not_its_table_is_named() {
        let table = r#"{"tables": [{"key": "gain", "title": "Gain", "command": "petzval", "seeds": [1, 2], "version": "0.1.0",
            "date": "2026-11-27", "origin": "runs", "study": "crates/petzval-data/data/studies/gain.toml",
            "columns": [{"name": "against"}, {"name": "PSNR", "decimals": 2, "metric": "psnr_db"}],
            "rows": [["nominal", {"seeds": [0.8, 0.9]}]]}]}"#;
        let table = &DataFile::parse(table).unwrap().tables[0];
        let study = "seeds = [1, 2]\n[[difference]]\ncamera = 'a'\nagainst = 'nominal'\nscore.psnr_db = { mean = 0.85, deviation = 0.07 }\n";
        assert_eq!(compared(table, study), [""; 0]);
        let problem = |from: &str, to: &str| compared(table, &study.replace(from, to)).concat();
        assert!(problem("0.85", "0.86").starts_with("PSNR against nominal: 0.86 +- 0.07"));
        assert!(problem("nominal", "other").contains("has nothing"));
        assert!(problem("[1, 2]", "[1]").starts_with("seeds = [1]"));
        assert!(
            problem("score.psnr_db", "score.psnr")
                .contains("score.psnr against nominal: table \"gain\" has no")
        );
        assert!(problem("score.psnr_db", "#").contains("against nominal: no score is stated"));
        assert!(compared(table, "seeds = [1, 2]").concat().starts_with("no [[difference]]"));
    }
}

//! The pages of the experiment file, from its schema.

use petzval::design::experiment::Experiment;

use super::Page;
use super::markdown::{code, sentence, table};
use super::schema_rows::{Row, Schema, as_table};

/// The tables of each page, by its name and title. A table that is new has to be given a place.
const PARTS: [(&str, &str, &[&str]); 3] = [
    (
        "variants",
        "Experiment file: variants",
        &["variant", "checkpoint", "validation", "scoring", "reading", "python"],
    ),
    (
        "camera",
        "Experiment file: the camera",
        &["psf", "optics", "spot", "constraints", "exposure", "development", "isp"],
    ),
    (
        "training",
        "Experiment file: task and training",
        &["class", "street", "detector", "network", "training", "loss"],
    ),
];

/// Keys at the top with the list of tables, then the tables on pages of their own.
pub fn pages() -> Vec<Page> {
    let schema = schemars::schema_for!(Experiment).to_value();
    let rows = Schema(&schema).rows(usize::MAX);
    let is_below = |row: &Row, key: &str| row.key.starts_with(&format!("{key}."));
    let (tables, plain): (Vec<Row>, Vec<Row>) = (rows.iter().filter(|row| !row.key.contains('.')).cloned())
        .partition(|top| rows.iter().any(|row| is_below(row, &top.key)));
    for top in &tables {
        let places = PARTS.iter().filter(|(_, _, of)| of.contains(&top.key.as_str())).count();
        assert_eq!(places, 1, "the table {} has no page", top.key);
    }
    let mut index = Vec::new();
    let mut pages = Vec::new();
    for (path, title, keys) in PARTS {
        let mut body = String::new();
        for key in keys {
            let top = tables
                .iter()
                .find(|top| top.key == *key)
                .unwrap_or_else(|| panic!("there is no table {key}"));
            let is_list = top.kind.starts_with("list");
            let heading = code(&if is_list { format!("[[{key}]]") } else { format!("[{key}]") });
            let below: Vec<Row> = rows.iter().filter(|row| is_below(row, key)).cloned().collect();
            body += &format!("## {heading}\n\n{}\n\n{}\n", sentence(&top.meaning), as_table(&below));
            index.push(vec![format!("[{heading}](experiment-file/{path}.md#{key})"), sentence(&top.meaning)]);
        }
        let frame = format!(
            "# {title}\n\nHow an experiment is written stands in [the experiment file](../experiment-file.md).\n"
        );
        pages.push(Page { path: format!("experiment-file/{path}.md"), frame, generated: body });
    }
    let top = format!(
        "## Keys at the top\n\n{}\n## Tables\n\n{}",
        as_table(&plain),
        table(&["table", "about"], &index)
    );
    pages.insert(0, Page { path: "experiment-file.md".to_owned(), frame: String::new(), generated: top });
    pages
}

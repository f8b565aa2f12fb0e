//! The data of the results: tables in `book/results/*.json`, each with its seeds, its version, its command and its date.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::figure::Figure;

/// The folder of the data, below the root of the workspace.
pub(super) const FOLDER: &str = "book/results";

/// The tables of a file.
#[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DataFile {
    pub tables: Vec<Table>,
}

/// A table with its origin.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Table {
    /// Its name in the file.
    pub key: String,
    /// What it shows, as a sentence.
    pub title: String,
    /// What makes the runs, with `N` for the seed.
    pub command: String,
    #[serde(default)]
    pub seeds: Vec<u64>,
    /// Version of Petzval.
    pub version: String,
    /// Day of the figures, as `2026-11-27`.
    pub date: String,
    /// Where the figures were taken from.
    pub origin: String,
    /// How the table follows from the files `metrics.json` of its runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from_runs: Option<FromRuns>,
    /// The file of `crates/petzval-data/data/studies` that quotes the differences of this table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub study: Option<String>,
    /// Rows that are newer than the table.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub renewed: Vec<Renewed>,
    pub columns: Vec<Column>,
    /// The first cell of a row is its name.
    pub rows: Vec<Vec<Option<Figure>>>,
}

/// A row that was made again after its table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Renewed {
    pub row: String,
    /// Version of Petzval.
    pub version: String,
    /// Day of the figures, as `2026-11-27`.
    pub date: String,
}

/// A column of a table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Column {
    pub name: String,
    /// Empty for numbers without a unit, and for words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// Decimals that the data have.
    #[serde(default, skip_serializing_if = "is_default")]
    pub decimals: usize,
    /// Whether numbers above zero have a plus sign.
    #[serde(default, skip_serializing_if = "is_default")]
    pub signed: bool,
    /// The name in `metrics.json`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub metric: Option<String>,
    /// The column of the score whose gap between the first camera and perfect optics each camera closes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap: Option<String>,
    /// The camera of the column, in tables by place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<String>,
}

/// How a table follows from runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case", tag = "kind")]
pub(super) enum FromRuns {
    /// A row a camera.
    Cameras,
    /// A row a camera: the scores of `camera` less those of the row's camera. The runs are those of table `of`.
    Differences { of: String, camera: String },
    /// A row a place of the field, a column a camera and score: means over photographs and seeds. The runs are those of table `of`.
    Places { of: String },
}

/// The order of the keys of a table in its file; columns and rows stand behind them.
const ORDER: [&str; 10] =
    ["key", "title", "command", "seeds", "version", "date", "origin", "from_runs", "study", "renewed"];

/// An array with a value a line.
fn line_each<T: Serialize>(values: &[T]) -> Result<String, serde_json::Error> {
    let lines = values.iter().map(serde_json::to_string).collect::<Result<Vec<_>, _>>()?;
    Ok(format!("[\n        {}\n      ]", lines.join(",\n        ")))
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// All tables.
#[derive(Debug, Default)]
pub(super) struct Data {
    /// By the name of the file without its ending.
    pub files: BTreeMap<String, DataFile>,
}

impl Data {
    /// Reads every file of a folder.
    pub(super) fn read(root: &Path) -> Result<Self, String> {
        let folder = root.join(FOLDER);
        let entries = fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let mut files = BTreeMap::new();
        for entry in entries {
            let path = entry.map_err(|e| format!("{FOLDER}: {e}"))?.path();
            if path.extension().is_none_or(|ending| ending != "json") {
                continue;
            }
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let text = fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
            let file = DataFile::parse(&text).map_err(|problem| format!("{FOLDER}/{name}.json{problem}"))?;
            files.insert(name, file);
        }
        Ok(Self { files })
    }

    /// The table of a key `file/table`.
    pub(super) fn table(&self, key: &str) -> Result<&Table, String> {
        let known = |names: Vec<&str>| names.join(", ");
        let (file, name) = key.split_once('/').unwrap_or((key, ""));
        let Some(found) = self.files.get(file) else {
            let files = known(self.files.keys().map(String::as_str).collect());
            return Err(format!("table {key:?}: {FOLDER} has no {file}.json; it has {files}"));
        };
        let table = found.tables.iter().find(|table| table.key == name);
        table.ok_or_else(|| {
            let names = known(found.tables.iter().map(|table| table.key.as_str()).collect());
            format!("table {key:?}: {FOLDER}/{file}.json has no table {name:?}; it has {names}")
        })
    }

    /// The figure of an address `file/table: row, column`, with its column.
    pub(super) fn figure(&self, address: &str) -> Result<(&Figure, &Column), String> {
        let parts = address.split_once(": ").and_then(|(table, cell)| {
            let (row, column) = cell.rsplit_once(", ")?;
            Some((table, row, column))
        });
        let Some((key, row, column)) = parts else {
            return Err(format!("figure {address:?}: write it as \"file/table: row, column\""));
        };
        let table = self.table(key)?;
        let Some(place) = table.columns.iter().position(|known| known.name == column) else {
            let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
            return Err(format!("figure {address:?}: no column {column:?}; there are {}", names.join(", ")));
        };
        let Some(found) = table.row(row) else {
            let names: Vec<&str> = table.rows.iter().filter_map(|row| name_of(row)).collect();
            return Err(format!("figure {address:?}: no row {row:?}; there are {}", names.join(", ")));
        };
        let figure = found.get(place).and_then(Option::as_ref);
        let figure = figure.ok_or_else(|| format!("figure {address:?}: the cell is empty"))?;
        Ok((figure, &table.columns[place]))
    }
}

/// The name of a row.
pub(super) fn name_of(row: &[Option<Figure>]) -> Option<&str> {
    match row.first() {
        Some(Some(Figure::Text(name))) => Some(name),
        _ => None,
    }
}

impl Table {
    /// The row of a name.
    pub(super) fn row(&self, name: &str) -> Option<&[Option<Figure>]> {
        self.rows.iter().find(|row| name_of(row) == Some(name)).map(Vec::as_slice)
    }

    /// What is wrong with the table, if anything.
    fn problem(&self) -> Option<String> {
        let is_day = self.date.len() == 10 && self.date.chars().all(|c| c.is_ascii_digit() || c == '-');
        if !is_day {
            return Some(format!("table {:?}: date {:?}: write it as 2026-11-27", self.key, self.date));
        }
        let words = [
            ("title", &self.title),
            ("command", &self.command),
            ("version", &self.version),
            ("origin", &self.origin),
        ];
        if let Some((name, _)) = words.iter().find(|(_, value)| value.trim().is_empty()) {
            return Some(format!("table {:?}: {name} is empty", self.key));
        }
        let width = self.columns.len();
        if let Some(row) = self.rows.iter().position(|row| row.len() != width || name_of(row).is_none()) {
            let row = row + 1;
            let key = &self.key;
            return Some(format!("table {key:?}: row {row}: it needs a name and {width} cells in all"));
        }
        let lengths = self.rows.iter().flatten().flatten().filter_map(Figure::seeds);
        if let Some(length) = lengths.map(<[f64]>::len).find(|length| *length != self.seeds.len()) {
            let (key, seeds) = (&self.key, self.seeds.len());
            return Some(format!(
                "table {key:?}: a figure has {length} values, and `seeds` has {seeds}; write one value a seed"
            ));
        }
        let names: Vec<_> = self.rows.iter().filter_map(|row| name_of(row)).collect();
        let twin = names.iter().enumerate().find(|(i, name)| names[..*i].contains(name));
        if let Some((_, name)) = twin {
            return Some(format!("table {:?}: two rows are named {name:?}", self.key));
        }
        let unknown = self.renewed.iter().find(|renewed| !names.contains(&renewed.row.as_str()));
        if let Some(renewed) = unknown {
            return Some(format!("table {:?}: no row {:?}, which is called renewed", self.key, renewed.row));
        }
        self.gap_problem()
    }
}

impl DataFile {
    /// Reads a file; a problem begins with `:line:column: ` or `: `.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let file: Self = serde_json::from_str(text).map_err(|e| {
            let text = e.to_string();
            let what = text.split(" at line ").next().unwrap_or_default().to_owned();
            format!(":{}:{}: {what}", e.line(), e.column())
        })?;
        let keys: Vec<&str> = file.tables.iter().map(|table| table.key.as_str()).collect();
        let twin = keys.iter().enumerate().find(|(i, key)| keys[..*i].contains(key));
        let twin =
            twin.map(|(_, key)| format!("two tables have the key {key:?}; a mark finds the first alone"));
        match file.tables.iter().find_map(Table::problem).or(twin) {
            Some(problem) => Err(format!(": {problem}")),
            None => Ok(file),
        }
    }

    /// The text of the file, a row or a column a line, so that changes are easy to read.
    pub(super) fn text(&self) -> Result<String, serde_json::Error> {
        let mut text = String::from("{\n  \"tables\": [");
        for (i, table) in self.tables.iter().enumerate() {
            text += if i == 0 { "\n    {" } else { ",\n    {" };
            let fields = serde_json::to_value(table)?;
            let fields = ORDER.iter().filter_map(|name| Some((name, fields.get(name)?)));
            for (name, value) in fields {
                let _ = write!(text, "\n      {name:?}: {},", serde_json::to_string(value)?);
            }
            let _ = write!(text, "\n      \"columns\": {},", line_each(&table.columns)?);
            let _ = write!(text, "\n      \"rows\": {}", line_each(&table.rows)?);
            text += "\n    }";
        }
        Ok(text + "\n  ]\n}\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = r#"{"tables": [{"key": "main", "title": "Main", "command": "petzval design", "seeds": [1],
        "version": "0.1.0", "date": "2026-11-27", "origin": "runs",
        "columns": [{"name": "camera"}, {"name": "PSNR", "unit": "dB", "decimals": 2}],
        "rows": [["nominal", {"mean": 28.35, "deviation": 0.04}], ["perfect", null]]}]}"#;

    fn data() -> Data {
        let file = DataFile::parse(TABLE).unwrap();
        Data { files: [("quality".to_owned(), file)].into() }
    }

    #[test]
    fn a_file_is_read_again_from_its_own_text() {
        let file = DataFile::parse(TABLE).unwrap();
        let text = file.text().unwrap();
        assert_eq!(DataFile::parse(&text).unwrap(), file);
        assert!(text.contains("\n        [\"perfect\",null]\n"), "{text}");
    }

    #[test]
    fn a_figure_is_found_by_its_address_or_what_is_there_is_said() {
        let data = data();
        let (figure, column) = data.figure("quality/main: nominal, PSNR").unwrap();
        assert_eq!(figure.text(column), "28.35 +- 0.04");
        let problem = |address: &str| data.figure(address).unwrap_err();
        assert!(problem("quality/main: middle, PSNR").ends_with("there are nominal, perfect"));
        assert!(problem("quality/main: nominal, SSIM").ends_with("there are camera, PSNR"));
        assert!(problem("quality/main: perfect, PSNR").ends_with("the cell is empty"));
        assert!(problem("quality/other: perfect, PSNR").ends_with("it has main"));
        assert!(problem("other/main: perfect, PSNR").ends_with("it has quality"));
        assert!(problem("quality/main").ends_with("\"file/table: row, column\""));
    }

    #[test]
    fn damage_is_named_with_its_place() {
        let problem = |text: &str| DataFile::parse(text).unwrap_err();
        assert!(problem(&TABLE.replace("\"unit\"", "\"units\"")).starts_with(":3:"));
        assert!(problem(&TABLE.replace("2026-11-27", "yesterday")).contains("write it as 2026-11-27"));
        assert!(problem(&TABLE.replace(", null]", "]")).contains("row 2: it needs a name and 2 cells"));
        assert!(problem(&TABLE.replace("\"perfect\"", "\"nominal\"")).contains("two rows are named"));
        assert!(problem(&TABLE.replace("\"runs\"", "\" \"")).contains("origin is empty"));
        let seeds = TABLE.replace(r#"{"mean": 28.35, "deviation": 0.04}"#, r#"{"seeds": [28.3, 28.4]}"#);
        assert!(problem(&seeds).contains("a figure has 2 values, and `seeds` has 1"));
        assert!(DataFile::parse(&seeds.replace("[1]", "[1, 2]")).is_ok());
        let mut twice: serde_json::Value = serde_json::from_str(TABLE).unwrap();
        twice["tables"] = [&twice["tables"][0]; 2].into_iter().cloned().collect();
        assert!(problem(&twice.to_string()).contains("two tables have the key \"main\""));
    }
}

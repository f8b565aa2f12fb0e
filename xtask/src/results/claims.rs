//! What Petzval states about itself beside other programs, the paper, or another way: `book/results/claims.toml`, a figure each, with what
//! makes it.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::data::{Data, FOLDER};

/// All claims.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Claims {
    #[serde(default)]
    pub claim: Vec<Claim>,
}

/// A figure that is stated about Petzval.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Claim {
    /// Its name in marks.
    pub key: String,
    /// The sentence that the figure ends.
    pub says: String,
    /// The figure of a table, by its address; command, date and data are then those of the table.
    pub of: Option<String>,
    /// The figure, where no table has it.
    pub figure: Option<String>,
    /// Other ways to write it: its number with fewer digits, or its unit in words.
    #[serde(default)]
    pub also: Vec<String>,
    /// The figure as a share of another, in words.
    pub share: Option<Share>,
    /// The command that makes it.
    pub made_by: Option<String>,
    pub date: Option<String>,
    /// The file that holds it, below the root of the workspace.
    pub data: Option<String>,
    /// Text of that file without which the claim would not hold.
    pub holds: Option<String>,
}

/// A share of a figure of a table, in words.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Share {
    /// One of [`SHARES`], in any case.
    pub says: String,
    /// The address of the whole.
    pub of: String,
    /// Whether the share is what the figure lacks of the whole.
    #[serde(default)]
    pub is_lost: bool,
}

/// Shares in words, with their values.
const SHARES: [(&str, f64); 5] = [
    ("a quarter", 0.25),
    ("a third", 1.0 / 3.0),
    ("half", 0.5),
    ("two thirds", 2.0 / 3.0),
    ("three quarters", 0.75),
];

/// Units in words.
const UNITS: [(&str, &str); 1] = [("min", "CPU minutes")];

/// A claim with what its row shows.
struct Row<'a> {
    figure: String,
    made_by: &'a str,
    date: &'a str,
    data: String,
}

impl Claims {
    /// Reads the file; a problem begins with `:line: ` or `: `.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let claims: Self = toml::from_str(text).map_err(|e| {
            let line = e.span().map_or(1, |span| text[..span.start].matches('\n').count() + 1);
            format!(":{line}: {}", e.message())
        })?;
        for (i, claim) in claims.claim.iter().enumerate() {
            let whole = [&claim.figure, &claim.made_by, &claim.date, &claim.data, &claim.holds];
            let stated = whole.iter().filter(|value| value.is_some()).count();
            if stated != if claim.of.is_some() { 0 } else { whole.len() } {
                return Err(format!(
                    ": claim {:?} needs `of`, or `figure`, `made_by`, `date`, `data` and `holds`",
                    claim.key
                ));
            }
            if claims.claim[..i].iter().any(|other| other.key == claim.key) {
                return Err(format!(": two claims have the key {:?}", claim.key));
            }
        }
        Ok(claims)
    }

    /// The ways to write the figure of a claim, the longest first.
    pub(super) fn forms(&self, key: &str, data: &Data) -> Result<Vec<String>, String> {
        let claim = self.claim.iter().find(|claim| claim.key == key);
        let claim = claim.ok_or_else(|| format!("claim {key:?}: {FOLDER}/claims.toml has no such key"))?;
        let mut forms = match &claim.of {
            Some(address) => data.figure(address).map(|(figure, column)| figure.forms(column))?,
            None => claim.figure.iter().cloned().collect(),
        };
        forms.extend(claim.also.iter().cloned());
        forms.extend(claim.share.iter().map(|share| share.says.clone()));
        Ok(forms)
    }

    /// The table of all claims in Markdown.
    pub(super) fn text(&self, data: &Data) -> Result<String, String> {
        let mut text = "| claim | figure | made by | date | data |\n|---|---|---|---|---|\n".to_owned();
        for claim in &self.claim {
            let Row { figure, made_by, date, data } = claim.row(data)?;
            text += &format!("| {} | {figure} | `{made_by}` | {date} | `{data}` |\n", claim.says);
        }
        Ok(text)
    }

    /// What does not hold: a file that is missing, or does not hold what a claim rests on.
    pub(super) fn problems(&self, root: &Path, data: &Data) -> Vec<String> {
        let problem = |claim: &Claim| {
            if let Some(problem) = claim.figure_problem(data) {
                return Some(problem);
            }
            let (path, holds) = (claim.data.as_deref()?, claim.holds.as_deref()?);
            let Some(file) = below(root, path) else {
                return Some(format!(
                    "data = {path:?}: there is no such file; name the one that holds the figure"
                ));
            };
            let text = fs::read_to_string(file).map_err(|e| format!("{path}: {e}"));
            match text {
                Err(problem) => Some(problem),
                Ok(text) if text.contains(holds) => None,
                Ok(_) => Some(format!(
                    "{path} does not hold {holds:?}; measure the figure again, or name what holds it"
                )),
            }
        };
        let with_key = |claim: &Claim| {
            problem(claim).map(|problem| format!("{FOLDER}/claims.toml: claim {:?}: {problem}", claim.key))
        };
        self.claim.iter().filter_map(with_key).collect()
    }
}

impl Claim {
    /// What is wrong with the figure of a claim, or with another way to write it.
    fn figure_problem(&self, data: &Data) -> Option<String> {
        let (value, unit) = match (&self.of, &self.figure) {
            (Some(address), _) => match data.figure(address) {
                Err(problem) => return Some(problem),
                Ok((figure, column)) => (figure.value(), column.unit.as_str()),
            },
            (None, figure) => {
                let (number, unit) = figure.as_deref()?.split_once(' ').unwrap_or((figure.as_deref()?, ""));
                (number.parse().ok(), unit)
            }
        };
        let wrong = self.also.iter().find(|way| !is_way_to_write(way, value, unit));
        if let Some(way) = wrong {
            return Some(format!(
                "also = {way:?} is not the figure{} rounded to its decimals, with its unit; write it so, or as a `share`",
                value.map_or_else(String::new, |value| format!(" {value} {unit}"))
            ));
        }
        self.share.as_ref().and_then(|share| share.problem(value, data))
    }

    fn row<'a>(&'a self, data: &'a Data) -> Result<Row<'a>, String> {
        if let Some(address) = &self.of {
            let (figure, column) = data.figure(address)?;
            let (key, _) = address.split_once(": ").unwrap_or((address, ""));
            let table = data.table(key)?;
            let unit = if column.unit.is_empty() { String::new() } else { format!(" {}", column.unit) };
            return Ok(Row {
                figure: figure.text(column) + &unit,
                made_by: &table.command,
                date: &table.date,
                data: key.to_owned(),
            });
        }
        Ok(Row {
            figure: self.figure.clone().unwrap_or_default(),
            made_by: self.made_by.as_deref().unwrap_or_default(),
            date: self.date.as_deref().unwrap_or_default(),
            data: self.data.clone().unwrap_or_default(),
        })
    }
}

/// Whether a text is a number with its unit, and the number is a value rounded to the decimals written. The sign may be said in words.
fn is_way_to_write(text: &str, value: Option<f64>, unit: &str) -> bool {
    let (number, behind) = text.split_once(' ').unwrap_or((text, ""));
    let decimals = number.split_once('.').map_or(0, |(_, digits)| digits.len());
    let is_value = value.is_some_and(|value| {
        let rounded = [value, value.abs()].map(|value| format!("{value:.decimals$}"));
        rounded.iter().any(|rounded| rounded == number.trim_start_matches('+'))
    });
    let is_unit = behind.is_empty() || behind == unit || UNITS.contains(&(unit, behind));
    is_value && is_unit
}

impl Share {
    /// What is wrong: the words are not those of the share in [`SHARES`] that is nearest to the one of the data.
    fn problem(&self, value: Option<f64>, data: &Data) -> Option<String> {
        let whole = match data.figure(&self.of) {
            Err(problem) => return Some(problem),
            Ok((figure, _)) => figure.value(),
        };
        let (Some(value), Some(whole)) = (value, whole.filter(|whole| *whole != 0.0)) else {
            return Some(format!("share: {:?} and the figure are no numbers, so none is a share", self.of));
        };
        let share = if self.is_lost { 1.0 - value / whole } else { value / whole };
        let far = |(_, known): &(&str, f64)| (known - share).abs();
        let nearest = SHARES.iter().min_by(|a, b| far(a).total_cmp(&far(b)))?.0;
        let is_nearest = self.says.to_lowercase() == nearest;
        (!is_nearest).then(|| {
            format!(
                "share.says = {:?}, but the share is {share:.2}: write {nearest:?}, or a figure",
                self.says
            )
        })
    }
}

/// A file below the root of the workspace, or below the folder of a crate: `data/` may stand in either.
pub(super) fn below(root: &Path, path: &str) -> Option<PathBuf> {
    let at_root = root.join(path);
    if at_root.is_file() {
        return Some(at_root);
    }
    let crates = fs::read_dir(root.join("crates")).ok()?;
    crates.flatten().map(|folder| folder.path().join(path)).find(|file| file.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLAIM: &str = "[[claim]]\nkey = 'rays'\nsays = 'Rays agree with Optiland to'\nfigure = '1e-9 mm'\nmade_by = 'cargo test'\n\
        date = '2026-11-27'\ndata = 'xtask/Cargo.toml'\nholds = 'name = \"xtask\"'\n";

    #[test]
    fn a_claim_has_a_row_and_holds_by_its_file() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let claims = Claims::parse(CLAIM).unwrap();
        let row =
            "| Rays agree with Optiland to | 1e-9 mm | `cargo test` | 2026-11-27 | `xtask/Cargo.toml` |\n";
        assert!(claims.text(&Data::default()).unwrap().ends_with(row));
        assert_eq!(claims.problems(&root, &Data::default()), [""; 0]);
        let broken = |from: &str, to: &str| {
            Claims::parse(&CLAIM.replace(from, to)).unwrap().problems(&root, &Data::default()).concat()
        };
        assert!(broken("\"xtask\"", "\"other\"").contains("does not hold"));
        assert!(broken("Cargo.toml", "Cargo.json").contains("there is no such file"));
    }

    const TABLE: &str = r#"{"tables": [{"key": "made", "title": "Made", "command": "petzval", "version": "0.1.0",
        "date": "2026-11-27", "origin": "runs",
        "columns": [{"name": "grade"}, {"name": "PSNR", "unit": "dB", "decimals": 2}, {"name": "time", "unit": "min"}],
        "rows": [["drawn", 0.96, 10.3], ["commercial", {"mean": 0.29, "deviation": 0.02}, null]]}]}"#;

    /// The problems of a claim of a cell, with further keys.
    fn of_cell(cell: &str, more: &str) -> String {
        let file = crate::results::data::DataFile::parse(TABLE).unwrap();
        let data = Data { files: [("lenses".to_owned(), file)].into() };
        let text = format!("[[claim]]\nkey = 'k'\nsays = 's'\nof = 'lenses/made: {cell}'\n{more}\n");
        Claims::parse(&text).unwrap().problems(Path::new("."), &data).concat()
    }

    #[test]
    fn another_way_to_write_a_figure_has_its_number_and_its_unit() {
        for right in ["0.3 dB", "0.29", "+0.29 dB"] {
            assert_eq!(of_cell("commercial, PSNR", &format!("also = ['{right}']")), "", "{right}");
        }
        for wrong in ["0.4 dB", "0.30 dB", "0.3 um", "-0.29 dB", "Two thirds", "about 0.3 dB", ""] {
            let problem = of_cell("commercial, PSNR", &format!("also = ['{wrong}']"));
            assert!(problem.contains("is not the figure 0.29 dB rounded"), "{wrong}: {problem}");
        }
        assert_eq!(of_cell("drawn, time", "also = ['10 CPU minutes']"), "");
        assert!(of_cell("drawn, time", "also = ['11 CPU minutes']").contains("is not the figure 10.3 min"));
        let stated = |way: &str| {
            let text = format!("{CLAIM}also = ['{way}']\n");
            let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
            Claims::parse(&text).unwrap().problems(&root, &Data::default()).concat()
        };
        assert_eq!(stated("0.000000001 mm"), "");
        assert!(stated("1e-8 mm").contains("is not the figure"));
    }

    #[test]
    fn a_share_in_words_is_the_one_of_the_data() {
        let share = |says: &str, more: &str| {
            of_cell("commercial, PSNR", &format!("share = {{ says = '{says}', of = 'lenses/made: {more} }}"))
        };
        assert_eq!(share("Two thirds", "drawn, PSNR', is_lost = true"), "");
        assert_eq!(share("A third", "drawn, PSNR'"), "");
        assert!(share("Two thirds", "drawn, PSNR'").contains("the share is 0.30: write \"a third\""));
        assert!(share("Most", "drawn, PSNR', is_lost = true").contains("the share is 0.70"));
        assert!(share("Half", "commercial, time'").contains("the cell is empty"));
    }

    #[test]
    fn half_a_claim_and_a_second_one_of_a_key_are_refused() {
        let problem = |text: &str| Claims::parse(text).unwrap_err();
        assert!(problem(&CLAIM.replace("date", "#")).contains("claim \"rays\" needs `of`"));
        assert!(problem(&format!("{CLAIM}of = 'a/b: c, d'\n")).contains("claim \"rays\" needs `of`"));
        assert!(problem(&CLAIM.repeat(2)).contains("two claims have the key \"rays\""));
        assert!(problem(&CLAIM.replace("says", "say")).starts_with(":3: "));
    }
}

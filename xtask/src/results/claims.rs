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
    /// Other ways to write it.
    #[serde(default)]
    pub also: Vec<String>,
    /// The command that makes it.
    pub made_by: Option<String>,
    pub date: Option<String>,
    /// The file that holds it, below the root of the workspace.
    pub data: Option<String>,
    /// Text of that file without which the claim would not hold.
    pub holds: Option<String>,
}

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
            if let Some(address) = &claim.of {
                return data.figure(address).err();
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

    #[test]
    fn half_a_claim_and_a_second_one_of_a_key_are_refused() {
        let problem = |text: &str| Claims::parse(text).unwrap_err();
        assert!(problem(&CLAIM.replace("date", "#")).contains("claim \"rays\" needs `of`"));
        assert!(problem(&format!("{CLAIM}of = 'a/b: c, d'\n")).contains("claim \"rays\" needs `of`"));
        assert!(problem(&CLAIM.repeat(2)).contains("two claims have the key \"rays\""));
        assert!(problem(&CLAIM.replace("says", "say")).starts_with(":3: "));
    }
}

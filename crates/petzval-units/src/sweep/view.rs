//! The page of a sweep: which figures, axes and pictures it shows.

use std::path::Path;

use petzval_base::nearest;
use petzval_design::run::picture_names::file_name;
use petzval_jobs::{JobError, Result};
use petzval_report::sweep_page::{
    FailedUnit, Scatter, ScatterGroup, SweepFigure, SweepPicture, SweepRow, SweepView,
};

use super::gather::{FigureColumn, Gathered, GatheredRow, Spread, UnitResult, in_words};

/// Figures that the page shows of a job whose numbers have no description.
const SHOWN_FIGURES: usize = 8;

/// Most pictures of the page. Each takes about 0.1 MB.
const MOST_PICTURES: usize = 60;

/// Digits of a figure for which no number of decimals is known.
const DIGITS: usize = 5;

/// What the page shows, where its reader chooses.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Choice {
    /// Figure or key along the axis to the right; the first key with numbers if none is named, or the second figure.
    pub x: Option<String>,
    /// Figure or key along the upward axis; the first figure if none is named.
    pub y: Option<String>,
    /// Figures of the table; all scores and those of the lens if none is named.
    pub figures: Vec<String>,
}

/// The page of what was gathered. `again` is the command that runs a failed unit, without its name.
///
/// Fails on a figure or a key that the sweep does not have, or one whose values are no numbers.
pub fn view(gathered: &Gathered, choice: &Choice, again: &str) -> Result<SweepView> {
    let shown = shown_figures(gathered, &choice.figures)?;
    let figures = shown.iter().map(|k| {
        let FigureColumn { title, unit, .. } = &gathered.figures[*k];
        (title.clone(), unit.replace("um", "µm"))
    });
    let row = |row: &GatheredRow| SweepRow {
        camera: row.camera.clone(),
        values: row.values.iter().map(in_words).collect(),
        units: row.units.len(),
        figures: shown.iter().map(|k| cell(&gathered.figures[*k], row.figures[*k])).collect(),
        best: shown.iter().map(|k| gathered.is_best(row, *k)).collect(),
    };
    let failed = gathered.status.units.iter().filter(|unit| unit.has_error());
    let cpu: f64 = gathered.status.units.iter().filter_map(|unit| unit.cpu_seconds).sum();
    Ok(SweepView {
        title: gathered.title.clone(),
        subtitle: format!(
            "{} units: {}. CPU time so far {:.2} hours.",
            gathered.status.units.len(),
            gathered.status.in_words(),
            cpu / 3600.0
        ),
        keys: gathered.keys.clone(),
        figures: figures.collect(),
        rows: gathered.rows.iter().map(row).collect(),
        scatter: scatter(gathered, choice, &shown)?,
        pictures: pictures(gathered),
        failed: failed
            .map(|unit| FailedUnit {
                name: unit.name.clone(),
                error: unit.error.clone().unwrap_or_default(),
                again: format!("{again} '{}'", unit.name),
            })
            .collect(),
    })
}

/// Places of the figures that the table shows.
fn shown_figures(gathered: &Gathered, named: &[String]) -> Result<Vec<usize>> {
    if named.is_empty() {
        let has_decimals = |k: &usize| gathered.figures[*k].decimals.is_some();
        let described: Vec<usize> = (0..gathered.figures.len()).filter(has_decimals).collect();
        let all = || (0..gathered.figures.len().min(SHOWN_FIGURES)).collect();
        return Ok(if described.is_empty() { all() } else { described });
    }
    named.iter().map(|name| figure(gathered, name, "figure")).collect()
}

/// The place of a figure by its name, or by the last part of its name where that is of one figure alone. The error names those that there are.
fn figure(gathered: &Gathered, name: &str, setting: &'static str) -> Result<usize> {
    let names: Vec<&str> = gathered.figures.iter().map(|figure| figure.name.as_str()).collect();
    let last = |known: &&'_ str| known.rsplit('.').next().unwrap_or_default().to_owned();
    let by_last: Vec<usize> = (0..names.len()).filter(|k| last(&names[*k]) == name).collect();
    let only = if let [one] = by_last[..] { Some(one) } else { None };
    names.iter().position(|known| *known == name).or(only).ok_or_else(|| {
        let short: Vec<String> = names.iter().map(last).collect();
        let all: Vec<&str> = names
            .iter()
            .copied()
            .chain(gathered.keys.iter().map(String::as_str))
            .chain(short.iter().map(String::as_str))
            .collect();
        let near = nearest(name, &all).map(|near| format!("did you mean `{near}`? ")).unwrap_or_default();
        JobError::setting(
            setting,
            name,
            "no unit has such a figure",
            format!("{near}there are {}", all.join(", ")),
        )
    })
}

/// A figure of a row in words.
fn cell(figure: &FigureColumn, spread: Option<Spread>) -> SweepFigure {
    let Some(spread) = spread else { return SweepFigure { mean: "-".to_owned(), range: String::new() } };
    let number = |value: f64| match figure.decimals {
        Some(decimals) => format!("{value:.decimals$}"),
        None => significant(value),
    };
    let Some(deviation) = spread.deviation else {
        return SweepFigure { mean: number(spread.mean), range: String::new() };
    };
    SweepFigure {
        mean: format!("{} ± {}", number(spread.mean), number(deviation)),
        range: format!("{} to {}", number(spread.low), number(spread.high)),
    }
}

/// A number with a few digits.
fn significant(value: f64) -> String {
    let power = value.abs().log10().floor();
    if value == 0.0 || !power.is_finite() {
        return value.to_string();
    }
    if !(-4.0..9.0).contains(&power) {
        return format!("{value:.*e}", DIGITS - 1);
    }
    let decimals = (DIGITS as f64 - 1.0 - power).max(0.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A quantity of an axis.
enum Quantity {
    Key(usize),
    Figure(usize),
}

impl Quantity {
    fn of(gathered: &Gathered, name: &str, setting: &'static str) -> Result<Self> {
        let Some(key) = gathered.keys.iter().position(|key| key == name) else {
            return figure(gathered, name, setting).map(Self::Figure);
        };
        if gathered.units.iter().any(|unit| unit.values[key].as_f64().is_none()) {
            let hint = "name a key whose values are numbers, or a figure";
            return Err(JobError::setting(setting, name, "the values of this key are no numbers", hint));
        }
        Ok(Self::Key(key))
    }

    fn value(&self, unit: &UnitResult) -> Option<f64> {
        match self {
            Self::Key(key) => unit.values[*key].as_f64(),
            Self::Figure(k) => unit.figures[*k],
        }
    }

    fn name(&self, gathered: &Gathered) -> String {
        match self {
            Self::Key(key) => format!("key {}", gathered.keys[*key]),
            Self::Figure(k) => {
                let FigureColumn { title, unit, .. } = &gathered.figures[*k];
                let unit = unit.replace("um", "µm");
                if unit.is_empty() { title.clone() } else { format!("{title}, {unit}") }
            }
        }
    }
}

/// Two quantities against each other; none where no unit has both.
fn scatter(gathered: &Gathered, choice: &Choice, shown: &[usize]) -> Result<Option<Scatter>> {
    let with_numbers = (0..gathered.keys.len()).find(|key| {
        let values = || gathered.units.iter().map(|unit| unit.values[*key].as_f64());
        values().all(|value| value.is_some()) && values().any(|value| value != values().next().flatten())
    });
    let y = match &choice.y {
        Some(name) => Some(Quantity::of(gathered, name, "y")?),
        None => shown.first().map(|k| Quantity::Figure(*k)),
    };
    let x = match (&choice.x, with_numbers) {
        (Some(name), _) => Some(Quantity::of(gathered, name, "x")?),
        (None, Some(key)) => Some(Quantity::Key(key)),
        (None, None) => shown.get(1).map(|k| Quantity::Figure(*k)),
    };
    let (Some(x), Some(y)) = (x, y) else { return Ok(None) };
    let mut groups: Vec<ScatterGroup> = Vec::new();
    for unit in &gathered.units {
        let (Some(at_x), Some(at_y)) = (x.value(unit), y.value(unit)) else { continue };
        match groups.iter_mut().find(|group| group.name == unit.camera) {
            Some(group) => group.at.push([at_x, at_y]),
            None => groups.push(ScatterGroup { name: unit.camera.clone(), at: vec![[at_x, at_y]] }),
        }
    }
    let names = [x.name(gathered), y.name(gathered)];
    Ok((!groups.is_empty()).then_some(Scatter { names, groups }))
}

/// The first held-out picture by the first unit of every row, and the scene itself.
fn pictures(gathered: &Gathered) -> Vec<SweepPicture> {
    let mut pictures: Vec<SweepPicture> = Vec::new();
    for row in &gathered.rows {
        let first = row.units.first().and_then(|name| {
            gathered.units.iter().find(|unit| unit.unit == *name && unit.camera == row.camera)
        });
        let Some((unit, files)) = first.and_then(|unit| Some((unit, unit.files.as_ref()?))) else { continue };
        let read = |state: &str, camera: Option<&str>| {
            let path = folder_of_pictures(files).join(file_name(0, state, camera));
            petzval_base::read_whole(&path).ok()
        };
        if pictures.is_empty()
            && let Some(png) = read("truth", None)
        {
            pictures.push(SweepPicture { label: "scene".to_owned(), remark: String::new(), png });
        }
        let Some(png) = read("output", Some(&unit.camera)) else { continue };
        let is_alone = gathered.rows.iter().filter(|other| other.units == row.units).count() == 1;
        let label = if is_alone { unit.unit.clone() } else { format!("{}: {}", unit.unit, unit.camera) };
        let score = gathered.figures.first().zip(unit.figures.first().copied().flatten());
        let remark = score.map_or_else(String::new, |(figure, value)| {
            let value = cell(
                figure,
                Some(Spread { count: 1, mean: value, deviation: None, low: value, high: value }),
            )
            .mean;
            format!("{} {value} {}", figure.title, figure.unit).trim_end().to_owned()
        });
        pictures.push(SweepPicture { label, remark, png });
        if pictures.len() == MOST_PICTURES {
            break;
        }
    }
    pictures
}

/// The pictures of a run.
fn folder_of_pictures(files: &Path) -> std::path::PathBuf {
    files.join("pictures")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_a_few_digits() {
        for (value, text) in [
            (0.0, "0"),
            (12.0, "12"),
            (0.125, "0.125"),
            (1234567.0, "1234567"),
            (1e-7, "1.0000e-7"),
            (2.7654321, "2.7654"),
        ] {
            assert_eq!(significant(value), text);
        }
    }

    #[test]
    fn a_key_keeps_its_name_on_an_axis() {
        let gathered = Gathered {
            title: String::new(),
            keys: vec!["training.learning_rate".to_owned()],
            figures: Vec::new(),
            rows: Vec::new(),
            units: Vec::new(),
            status: crate::sweep::SweepStatus { title: String::new(), units: Vec::new() },
        };
        assert_eq!(Quantity::Key(0).name(&gathered), "key training.learning_rate");
    }
}

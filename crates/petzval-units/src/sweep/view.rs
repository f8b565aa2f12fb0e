//! The page of a sweep: which figures, axes and pictures it shows.

use std::collections::BTreeSet;
use std::path::Path;

use petzval_base::{nearest, time_text};
use petzval_design::run::picture_names::file_name;
use petzval_jobs::{JobError, Result};
use petzval_report::capitalised;
use petzval_report::sweep_page::{
    FailedUnit, Scatter, ScatterGroup, SweepFigure, SweepPicture, SweepRow, SweepView,
};

use super::gather::{Column, FigureColumn, Gathered, GatheredRow, Spread, UnitResult, in_words};

/// Figures that the page shows of a job whose numbers have no description.
const SHOWN_FIGURES: usize = 8;

/// Most pictures of the page. Each takes about 0.1 MB.
const MOST_PICTURES: usize = 60;

/// Digits of a figure for which no number of decimals is known.
const DIGITS: usize = 5;

/// What the page shows, where its reader chooses.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Choice {
    /// Figure or key along the axis to the right; the key with the most values other than the seed if none is named, or the second figure.
    pub x: Option<String>,
    /// Figure or key along the upward axis; the first figure that varies if none is named.
    pub y: Option<String>,
    /// Figures of the table; those that vary if none is named: all scores and those of the lens.
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
    let has_status = gathered.shown_columns(&shown).contains(&Column::Status);
    let row = |row: &GatheredRow| SweepRow {
        camera: row.camera.clone(),
        values: row.values.iter().map(in_words).collect(),
        units: row.units.len(),
        figures: shown.iter().map(|k| cell(&gathered.figures[*k], row.figures[*k])).collect(),
        best: shown.iter().map(|k| gathered.is_best(row, *k)).collect(),
        status: if has_status { row.status.clone() } else { String::new() },
    };
    let failed = gathered.status.units.iter().filter(|unit| unit.has_error());
    let cpu: f64 = gathered.status.units.iter().filter_map(|unit| unit.cpu_seconds).sum();
    let machines = gathered.unlike_machines();
    Ok(SweepView {
        title: gathered.title.clone(),
        subtitle: format!(
            "{} units: {}. CPU time so far: {}.{}",
            gathered.status.units.len(),
            gathered.status.in_words(),
            time_text(cpu),
            machines.map_or_else(String::new, |text| format!(" {}.", capitalised(&text)))
        ),
        answer: answer(gathered, &shown),
        constant: constant_figures(gathered, &shown),
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

/// Places of the figures that the table shows: those that are named, else those that vary.
fn shown_figures(gathered: &Gathered, named: &[String]) -> Result<Vec<usize>> {
    if named.is_empty() {
        Ok(figures_that_vary(gathered))
    } else {
        named.iter().map(|name| figure(gathered, name, "figure")).collect()
    }
}

/// Places of the figures that say how units differ, last those that only some units have; all figures where none does.
pub fn figures_that_vary(gathered: &Gathered) -> Vec<usize> {
    let has_decimals = |k: &usize| gathered.figures[*k].decimals.is_some();
    let described: Vec<usize> = (0..gathered.figures.len()).filter(has_decimals).collect();
    let all = if described.is_empty() { (0..gathered.figures.len()).collect() } else { described };
    let (varying, same): (Vec<usize>, Vec<usize>) = all.iter().copied().partition(|k| varies(gathered, *k));
    let lacking = same.into_iter().filter(|k| is_lacking(gathered, *k));
    let unlike: Vec<usize> =
        varying.into_iter().chain(lacking).filter(|k| !repeats_a_key(gathered, *k)).collect();
    let mut chosen = if unlike.is_empty() { all } else { unlike };
    if !chosen.iter().any(has_decimals) {
        chosen.truncate(SHOWN_FIGURES);
    }
    chosen
}

/// Whether two of the values that units have of a figure differ.
fn varies(gathered: &Gathered, k: usize) -> bool {
    let mut values = gathered.units.iter().filter_map(|unit| unit.figures[k]);
    values.next().is_some_and(|first| values.any(|value| value != first))
}

/// Whether a figure has the value of a key wherever it has one, as the seed of a response does.
fn repeats_a_key(gathered: &Gathered, k: usize) -> bool {
    let repeats = |key: usize| {
        gathered
            .units
            .iter()
            .all(|unit| unit.figures[k].is_none_or(|value| unit.values[key].as_f64() == Some(value)))
    };
    (0..gathered.keys.len()).any(repeats)
}

/// Units that have figures. One that has none, such as a ray that is lost, says nothing of a single figure.
fn units_with_figures(gathered: &Gathered) -> impl Iterator<Item = &UnitResult> {
    gathered.units.iter().filter(|unit| unit.figures.iter().any(Option::is_some))
}

/// Whether some units have a figure and others, which have figures, lack it.
fn is_lacking(gathered: &Gathered, k: usize) -> bool {
    let mut has = units_with_figures(gathered).map(|unit| unit.figures[k].is_some());
    has.next().is_some_and(|first| has.any(|other| other != first))
}

/// Titles and values of the figures that every unit with figures has alike and the table leaves out.
fn constant_figures(gathered: &Gathered, shown: &[usize]) -> Vec<(String, String)> {
    let left_out = (0..gathered.figures.len()).filter(|k| !shown.contains(k));
    left_out
        .filter_map(|k| {
            let mut values = units_with_figures(gathered).map(|unit| unit.figures[k]);
            let value = values.next()??;
            let is_same = values.all(|other| other == Some(value));
            let FigureColumn { title, unit, .. } = &gathered.figures[k];
            let number = number(&gathered.figures[k], value);
            is_same.then(|| {
                (title.clone(), format!("{number} {}", unit.replace("um", "µm")).trim_end().to_owned())
            })
        })
        .collect()
}

/// The first of the figures with two different values.
fn leading_figure(gathered: &Gathered, shown: &[usize]) -> Option<usize> {
    let has_two = |k: &usize| {
        let mut values =
            gathered.units.iter().filter(|unit| !unit.is_ceiling).filter_map(|unit| unit.figures[*k]);
        values.next().is_some_and(|first| values.any(|value| value != first))
    };
    shown.iter().copied().find(has_two)
}

/// Whether a key is a seed: units that differ in it alone repeat each other.
fn is_seed(key: &str) -> bool {
    key.rsplit('.').next() == Some("seed")
}

/// Between which values the first figure that varies lies, and at which values of the keys it is best: means over the seeds. None where it is the same in all.
fn answer(gathered: &Gathered, shown: &[usize]) -> Option<String> {
    let k = leading_figure(gathered, shown)?;
    let keys: Vec<usize> = (0..gathered.keys.len()).filter(|key| !is_seed(&gathered.keys[*key])).collect();
    let mut groups: Vec<(String, Vec<f64>)> = Vec::new();
    for unit in gathered.units.iter().filter(|unit| !unit.is_ceiling) {
        let Some(value) = unit.figures[k] else { continue };
        let of_keys =
            keys.iter().map(|key| format!("{} {}", gathered.keys[*key], in_words(&unit.values[*key])));
        let camera = Some(unit.camera.clone()).filter(|camera| !camera.is_empty());
        let name = of_keys.chain(camera).collect::<Vec<_>>().join(", ");
        match groups.iter_mut().find(|known| known.0 == name) {
            Some((_, values)) => values.push(value),
            None => groups.push((name, vec![value])),
        }
    }
    let has_seeds = groups.iter().any(|(_, values)| values.len() > 1);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let mut means: Vec<(String, f64)> =
        groups.into_iter().map(|(name, values)| (name, mean(&values))).collect();
    means.sort_by(|a, b| a.1.total_cmp(&b.1));
    let [(_, low), .., (_, high)] = &means[..] else { return None };
    // Several combinations may be as good.
    let with = |value: &f64| {
        let names = means.iter().filter(|(_, mean)| mean == value).map(|(name, _)| name.as_str());
        names.collect::<Vec<_>>().join(" and ")
    };
    let figure = &gathered.figures[k];
    let ends = match figure.higher_is_better {
        Some(true) => format!("best: {}", with(high)),
        Some(false) => format!("best: {}", with(low)),
        None => format!("least: {}; largest: {}", with(low), with(high)),
    };
    Some(format!(
        "{} from {} to {}{}; {ends}.",
        capitalised(&figure.title),
        number(figure, *low),
        format!("{} {}", number(figure, *high), figure.unit.replace("um", "µm")).trim_end(),
        if has_seeds { ", means over the seeds" } else { "" },
    ))
}

/// The place of a figure by its name, or by the last part of its name where that is of one figure alone. The error names those that there are.
fn figure(gathered: &Gathered, name: &str, setting: &'static str) -> Result<usize> {
    let names: Vec<&str> = gathered.figures.iter().map(|figure| figure.name.as_str()).collect();
    let last = |known: &&'_ str| known.rsplit('.').next().unwrap_or_default().to_owned();
    let by_last: Vec<usize> = (0..names.len()).filter(|k| last(&names[*k]) == name).collect();
    let only = if let [one] = by_last[..] { Some(one) } else { None };
    names.iter().position(|known| *known == name).or(only).ok_or_else(|| {
        let keys = gathered.keys.iter().map(String::as_str).filter(|key| !names.contains(key));
        let all: Vec<&str> = names.iter().copied().chain(keys).collect();
        let short: Vec<String> = names.iter().map(last).collect();
        let spellings: Vec<&str> = all.iter().copied().chain(short.iter().map(String::as_str)).collect();
        let near =
            nearest(name, &spellings).map(|near| format!("did you mean `{near}`? ")).unwrap_or_default();
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
    let number = |value: f64| number(figure, value);
    let Some(deviation) = spread.deviation else {
        return SweepFigure { mean: number(spread.mean), range: String::new() };
    };
    SweepFigure {
        mean: format!("{} ± {}", number(spread.mean), number(deviation)),
        range: format!("{} to {}", number(spread.low), number(spread.high)),
    }
}

/// A value of a figure, with the decimals that are worth printing.
pub fn number(figure: &FigureColumn, value: f64) -> String {
    match figure.decimals {
        Some(decimals) => format!("{value:.decimals$}"),
        None => significant(value),
    }
}

/// A number with a few digits.
fn significant(value: f64) -> String {
    let power = value.abs().log10().floor();
    if value == 0.0 || !power.is_finite() {
        return value.to_string();
    }
    if !(-4.0..DIGITS as f64).contains(&power) {
        return format!("{value:.*e}", DIGITS - 1);
    }
    let decimals = (DIGITS as f64 - 1.0 - power).max(0.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A quantity of an axis.
enum Quantity {
    Key(usize),
    /// A key whose values are words, with the words in the order of the sweep.
    Words(usize, Vec<String>),
    Figure(usize),
}

impl Quantity {
    fn of(gathered: &Gathered, name: &str, setting: &'static str) -> Result<Self> {
        let Some(key) = gathered.keys.iter().position(|key| key == name) else {
            return figure(gathered, name, setting).map(Self::Figure);
        };
        Ok(Self::of_key(gathered, key))
    }

    /// A quantity of the upward axis, which has no words.
    fn upward(gathered: &Gathered, name: &str) -> Result<Self> {
        const SETTING: &str = "y";
        match Self::of(gathered, name, SETTING)? {
            Self::Words(..) => {
                let hint = "name a key whose values are numbers, or a figure";
                Err(JobError::setting(SETTING, name, "the values of this key are no numbers", hint))
            }
            quantity => Ok(quantity),
        }
    }

    fn of_key(gathered: &Gathered, key: usize) -> Self {
        if gathered.units.iter().all(|unit| unit.values[key].as_f64().is_some()) {
            return Self::Key(key);
        }
        let mut words: Vec<String> = Vec::new();
        for word in gathered.units.iter().map(|unit| in_words(&unit.values[key])) {
            if !words.contains(&word) {
                words.push(word);
            }
        }
        Self::Words(key, words)
    }

    fn value(&self, unit: &UnitResult) -> Option<f64> {
        match self {
            Self::Key(key) => unit.values[*key].as_f64(),
            Self::Words(key, words) => {
                let word = in_words(&unit.values[*key]);
                words.iter().position(|known| *known == word).map(|place| place as f64)
            }
            Self::Figure(k) => unit.figures[*k],
        }
    }

    fn name(&self, gathered: &Gathered) -> String {
        match self {
            Self::Key(key) | Self::Words(key, _) => format!("key {}", gathered.keys[*key]),
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
    let y = match &choice.y {
        Some(name) => Some(Quantity::upward(gathered, name)?),
        None => leading_figure(gathered, shown).or(shown.first().copied()).map(Quantity::Figure),
    };
    let x = match (&choice.x, leading_key(gathered)) {
        (Some(name), _) => Some(Quantity::of(gathered, name, "x")?),
        (None, Some(key)) => Some(Quantity::of_key(gathered, key)),
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
    let x_words = if let Quantity::Words(_, words) = x { words } else { Vec::new() };
    Ok((!groups.is_empty()).then_some(Scatter { names, x_words, groups }))
}

/// The key with the most values; the first of those that have equally many. A seed is taken only if no other key varies. None if no key has two
/// values.
fn leading_key(gathered: &Gathered) -> Option<usize> {
    let count = |key: &usize| {
        let values: BTreeSet<String> =
            gathered.units.iter().map(|unit| in_words(&unit.values[*key])).collect();
        values.len()
    };
    let varying = (0..gathered.keys.len()).rev().filter(|key| count(key) > 1);
    varying.max_by_key(|key| (!is_seed(&gathered.keys[*key]), count(key)))
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
            (54321.0, "54321"),
            (1234567.0, "1.2346e6"),
            (35.25785574293837, "35.258"),
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

    /// Tolerances of two grades with two seeds each: yields, means, an estimate that no seed moves, and what is the same in all.
    fn tolerances() -> Gathered {
        let names = ["estimate", "mean", "seed", "trials"];
        let plain = |name: &str| FigureColumn {
            name: name.to_owned(),
            title: name.to_owned(),
            unit: String::new(),
            decimals: None,
            higher_is_better: None,
        };
        let yielded = FigureColumn { higher_is_better: Some(true), ..plain("yield at the limit") };
        let unit = |grade: &str, seed: u64, yielded: f64, estimate: f64| UnitResult {
            unit: format!("grade={grade},seed={seed}"),
            camera: String::new(),
            is_ceiling: false,
            values: vec![serde_json::json!(seed), serde_json::json!(grade)],
            seed: None,
            figures: [yielded, estimate, 35.0 + yielded, seed as f64, 50.0].map(Some).to_vec(),
            status: String::new(),
            files: None,
            cpu_seconds: 0.1,
            widest_simd: "avx2".to_owned(),
        };
        Gathered {
            title: String::new(),
            keys: vec!["seed".to_owned(), "grade".to_owned()],
            figures: [yielded].into_iter().chain(names.map(plain)).collect(),
            rows: Vec::new(),
            units: vec![
                unit("commercial", 1, 0.5, 1.0578),
                unit("commercial", 2, 0.75, 1.0578),
                unit("high", 1, 0.875, 0.0583),
                unit("high", 2, 1.0, 0.0583),
            ],
            status: crate::sweep::SweepStatus { title: String::new(), units: Vec::new() },
        }
    }

    #[test]
    fn figures_that_do_not_vary_have_no_column_and_the_seed_is_no_axis() {
        let gathered = tolerances();
        let view = view(&gathered, &Choice::default(), "").unwrap();
        let titles: Vec<&str> = view.figures.iter().map(|(title, _)| title.as_str()).collect();
        assert_eq!(titles, ["yield at the limit", "estimate", "mean"], "the seed repeats a key");
        assert_eq!(view.constant, [("trials".to_owned(), "50".to_owned())]);
        assert_eq!(
            view.answer.unwrap(),
            "Yield at the limit from 0.625 to 0.9375, means over the seeds; best: grade high."
        );
        let scatter = view.scatter.unwrap();
        assert_eq!(scatter.names, ["key grade", "yield at the limit"]);
        assert_eq!(scatter.x_words, ["commercial", "high"]);
        assert_eq!(scatter.groups[0].at, [[0.0, 0.5], [0.0, 0.75], [1.0, 0.875], [1.0, 1.0]]);
    }

    #[test]
    fn the_page_says_that_machines_differ() {
        let mut gathered = tolerances();
        let subtitle = |gathered: &Gathered| view(gathered, &Choice::default(), "").unwrap().subtitle;
        assert!(!subtitle(&gathered).contains("machines"));
        gathered.units[1].widest_simd = "avx512".to_owned();
        assert!(
            subtitle(&gathered)
                .contains(". The units ran on machines whose widest instruction sets differ: ")
        );
    }

    #[test]
    fn a_missing_value_is_no_other_value_and_the_status_says_why() {
        let mut gathered = tolerances();
        // The last unit has no result but a word, as a ray that is lost.
        let lost = gathered.units.last_mut().unwrap();
        lost.figures = vec![None; 5];
        lost.status = "missed surface 3".to_owned();
        gathered.units[0].status = "ok".to_owned();
        let row = |unit: &UnitResult| GatheredRow {
            camera: String::new(),
            is_ceiling: false,
            values: unit.values.clone(),
            units: vec![unit.unit.clone()],
            figures: vec![None; 5],
            status: unit.status.clone(),
        };
        gathered.rows = gathered.units.iter().map(row).collect();
        assert_eq!(figures_that_vary(&gathered), [0, 1, 2], "`trials` is 50 wherever it has a value");
        let view = view(&gathered, &Choice::default(), "").unwrap();
        assert_eq!(view.rows[3].status, "missed surface 3");
        assert_eq!(view.constant, [("trials".to_owned(), "50".to_owned())]);
    }

    #[test]
    fn a_figure_that_a_unit_lacks_has_a_column_though_it_is_the_same_in_all_others() {
        for without in 0..4 {
            let mut gathered = tolerances();
            gathered.units[without].figures[4] = None;
            assert_eq!(figures_that_vary(&gathered), [0, 1, 2, 4], "unit {without}");
            let view = view(&gathered, &Choice::default(), "").unwrap();
            assert_eq!(view.figures.last().unwrap().0, "trials");
            assert!(view.constant.is_empty());
        }
        // One that only a single unit has is none of all; a seed that repeats its key stays one.
        let mut gathered = tolerances();
        gathered.units[..3].iter_mut().for_each(|unit| unit.figures[4] = None);
        gathered.units[1].figures[3] = None;
        assert_eq!(figures_that_vary(&gathered), [0, 1, 2, 4]);
    }

    #[test]
    fn a_wrong_name_lists_every_figure_once() {
        let gathered = tolerances();
        let error = figure(&gathered, "nope", "figure").unwrap_err().report();
        assert_eq!(error.hint, "there are yield at the limit, estimate, mean, seed, trials, grade");
    }

    #[test]
    fn a_named_figure_stays_and_words_go_to_the_right_alone() {
        let gathered = tolerances();
        let choice = |x: Option<&str>, y: Option<&str>, figure: &str| Choice {
            x: x.map(str::to_owned),
            y: y.map(str::to_owned),
            figures: vec![figure.to_owned()],
        };
        let trials = view(&gathered, &choice(Some("seed"), None, "trials"), "").unwrap();
        assert_eq!((trials.figures.len(), trials.answer), (1, None));
        assert_eq!(trials.scatter.unwrap().names[0], "key seed");
        let refused = view(&gathered, &choice(None, Some("grade"), "mean"), "").unwrap_err();
        assert!(refused.to_string().contains("no numbers"), "{refused}");
    }
}

//! The results of a sweep as tables: a row for each combination, with mean, spread and range over its seeds; and a row for each unit.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use petzval_base::{Cancel, counted, csv_number, csv_text};
use petzval_design::run::Metrics;
use petzval_jobs::{JobError, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::kept::KeptSweep;
use super::plan::DESIGN;
use super::status::SweepStatus;
use crate::store::State;
use crate::store::Store;

/// Most figures of a response that become columns, for jobs without scores.
const MOST_FIGURES: usize = 40;

/// The job that makes lenses at random, and where their figures stand in its response.
const TOLERANCES: &str = "lens-tolerance";
const RANDOM_LENSES: &str = "report.monte_carlo";

/// A figure that units have, a column of the tables.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FigureColumn {
    /// Its name in files: `psnr_db`.
    pub name: String,
    /// Its name in words.
    pub title: String,
    /// Its unit; may be empty.
    pub unit: String,
    /// Digits after the point that are worth printing; none where that is not known.
    pub decimals: Option<usize>,
    /// Whether more is better; none where neither is.
    pub higher_is_better: Option<bool>,
}

/// A figure over the units of a row.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Spread {
    /// Units that have it.
    pub count: usize,
    /// Their mean.
    pub mean: f64,
    /// Their standard deviation, by the number less one; none for one unit.
    pub deviation: Option<f64>,
    /// The least of their values.
    pub low: f64,
    /// The largest of their values.
    pub high: f64,
}

/// A finished unit, or one of its cameras.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct UnitResult {
    /// Name of the unit.
    pub unit: String,
    /// The camera; empty where the job makes none.
    pub camera: String,
    /// Whether the camera has a lens without aberrations.
    pub is_ceiling: bool,
    /// The values of the keys that vary.
    pub values: Vec<Value>,
    /// The seed of the unit.
    pub seed: Option<u64>,
    /// Every figure; none where it has no value.
    pub figures: Vec<Option<f64>>,
    /// What the job says of its result in the key `status` of its response, such as the fate of a ray; empty where it says nothing.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub status: String,
    /// Folder of the files of the unit, if its job wrote some.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub files: Option<PathBuf>,
    /// CPU seconds of all attempts of the unit, s.
    pub cpu_seconds: f64,
    /// Widest instruction set of the machine that finished the unit, by which the tensor framework chooses its kernels; empty if it is not known.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub widest_simd: String,
}

/// Results that differ in their seeds alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GatheredRow {
    /// The camera; empty where the job makes none.
    pub camera: String,
    /// Whether the camera has a lens without aberrations.
    pub is_ceiling: bool,
    /// The values of the keys that vary.
    pub values: Vec<Value>,
    /// Names of the units, in the order of the sweep.
    pub units: Vec<String>,
    /// Every figure; none where no unit has it.
    pub figures: Vec<Option<Spread>>,
    /// What its units say of their results, each status once.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub status: String,
}

/// A column of the tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    /// A key that varies, by its place.
    Key(usize),
    /// The camera.
    Camera,
    /// Of a row the number of its units; of a unit its seed, which differs within a row.
    Repeats,
    /// A figure, by its place.
    Figure(usize),
    /// What the job says of its result in words.
    Status,
}

/// The results of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Gathered {
    /// Title of the sweep.
    pub title: String,
    /// Keys that vary.
    pub keys: Vec<String>,
    /// Figures, scores first.
    pub figures: Vec<FigureColumn>,
    /// A row for each combination and camera.
    pub rows: Vec<GatheredRow>,
    /// A row for each unit and camera.
    pub units: Vec<UnitResult>,
    /// How all units stand.
    pub status: SweepStatus,
}

/// Gathers the results of the units that are finished. `cancel` ends it between two of them.
pub fn gather(sweep: &KeptSweep, root: &Path, status: SweepStatus, cancel: &Cancel) -> Result<Gathered> {
    let store = Store::open(root)?;
    let mut figures: Vec<FigureColumn> = Vec::new();
    let mut found: Vec<(UnitResult, BTreeMap<String, f64>)> = Vec::new();
    for (unit, _) in sweep.units.iter().zip(&status.units).filter(|(_, status)| status.state == State::Done) {
        cancel.check()?;
        // What was done a moment ago may not be visible any more on a network file system.
        let Some(result) = store.result(&unit.key)? else { continue };
        let bare = |camera: &str, is_ceiling| UnitResult {
            unit: unit.name.clone(),
            camera: camera.to_owned(),
            is_ceiling,
            values: unit.values.clone(),
            seed: unit.seed,
            figures: Vec::new(),
            status: result.response["status"].as_str().unwrap_or_default().to_owned(),
            files: store.files(&result),
            cpu_seconds: result.cost.all_cpu_seconds,
            widest_simd: result.cost.widest_simd.clone(),
        };
        if sweep.job == DESIGN {
            let metrics: Metrics =
                serde_json::from_value(result.response["metrics"].clone()).map_err(|e| {
                    let message =
                        format!("store: {}: the figures of unit `{}`: {e}", root.display(), unit.name);
                    JobError::input(
                        message,
                        "another version wrote them; run the unit again in another store",
                    )
                })?;
            add_columns(&mut figures, of_design(&metrics));
            for row in &metrics.rows {
                if unit.variant.as_ref().is_some_and(|variant| *variant != row.camera) {
                    continue;
                }
                let mut values = row.scores.clone();
                values.extend(
                    [
                        ("rms_spot_um", row.rms_spot_um),
                        ("efl_mm", row.efl_mm),
                        ("f_number", row.f_number),
                        ("fov_deg", row.fov_deg),
                    ]
                    .map(|(name, value)| (name.to_owned(), value)),
                );
                found.push((bare(&row.camera, row.is_ceiling), values));
            }
        } else {
            let mut values = BTreeMap::new();
            add_numbers("", &result.response, &mut values);
            if sweep.job == TOLERANCES {
                add_columns(&mut figures, of_random_lenses(&result.response, &mut values));
            }
            add_columns(&mut figures, values.keys().take(MOST_FIGURES).map(|name| plain(name)));
            found.push((bare("", false), values));
        }
    }
    let units: Vec<UnitResult> = found
        .into_iter()
        .map(|(unit, values)| UnitResult {
            figures: figures.iter().map(|figure| values.get(&figure.name).copied()).collect(),
            ..unit
        })
        .collect();
    let rows = rows(&units, figures.len());
    Ok(Gathered { title: sweep.title.clone(), keys: sweep.keys.clone(), figures, rows, units, status })
}

/// The figures of a design: its scores, then those of the lens.
fn of_design(metrics: &Metrics) -> impl Iterator<Item = FigureColumn> + '_ {
    let scores = metrics.scores.iter().map(|score| FigureColumn {
        name: score.name.clone(),
        title: score.title.clone(),
        unit: score.unit.clone(),
        decimals: Some(score.decimals),
        higher_is_better: Some(score.higher_is_better),
    });
    let lens = [
        ("rms_spot_um", "RMS spot", "um", 2),
        ("efl_mm", "focal length", "mm", 3),
        ("f_number", "f-number", "", 3),
        ("fov_deg", "field of view", "deg", 2),
    ];
    scores.chain(lens.into_iter().map(|(name, title, unit, decimals)| FigureColumn {
        name: name.to_owned(),
        title: title.to_owned(),
        unit: unit.to_owned(),
        decimals: Some(decimals),
        higher_is_better: None,
    }))
}

/// The figures of lenses made at random, which head the columns. What nine of ten lenses reach stands in a list of the response.
fn of_random_lenses(response: &Value, values: &mut BTreeMap<String, f64>) -> Vec<FigureColumn> {
    let found = &response["report"]["monte_carlo"];
    let is_90 = |entry: &&Value| entry["percent"].as_f64() == Some(90.0);
    let of_90 = found["percentiles"].as_array().and_then(|all| all.iter().find(is_90)?["merit"].as_f64());
    values.extend(of_90.map(|merit| (format!("{RANDOM_LENSES}.merit_of_90_percent"), merit)));
    let is_higher = response["report"]["better"] == "higher";
    let columns = [
        ("yield_at_limit", "yield at the limit", true),
        ("merit_of_90_percent", "merit that 90 % of the lenses reach", is_higher),
        ("mean", "mean merit of random lenses", is_higher),
        ("standard_deviation", "standard deviation of random lenses", false),
    ];
    let column = |(name, title, higher): (&str, &str, bool)| FigureColumn {
        title: title.to_owned(),
        higher_is_better: Some(higher),
        ..plain(&format!("{RANDOM_LENSES}.{name}"))
    };
    columns.map(column).into_iter().filter(|column| values.contains_key(&column.name)).collect()
}

/// A figure of which only its name is known.
fn plain(name: &str) -> FigureColumn {
    FigureColumn {
        name: name.to_owned(),
        title: name.replace(['_', '.'], " "),
        unit: String::new(),
        decimals: None,
        higher_is_better: None,
    }
}

fn add_columns(known: &mut Vec<FigureColumn>, more: impl IntoIterator<Item = FigureColumn>) {
    for column in more {
        if !known.iter().any(|other| other.name == column.name) {
            known.push(column);
        }
    }
}

/// Every number of a response by its key path; those in lists are left out.
fn add_numbers(path: &str, value: &Value, found: &mut BTreeMap<String, f64>) {
    match value {
        Value::Number(number) => {
            if let Some(value) = number.as_f64() {
                found.insert(path.to_owned(), value);
            }
        }
        Value::Object(keys) => keys.iter().for_each(|(key, value)| {
            let below = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            add_numbers(&below, value, found);
        }),
        _ => {}
    }
}

/// Units that differ in their seeds alone in one row.
fn rows(units: &[UnitResult], figures: usize) -> Vec<GatheredRow> {
    let mut groups: Vec<(GatheredRow, Vec<&UnitResult>)> = Vec::new();
    for unit in units {
        let same = groups.iter_mut().find(|(row, _)| row.camera == unit.camera && row.values == unit.values);
        if let Some((_, of_row)) = same {
            of_row.push(unit);
            continue;
        }
        let row = GatheredRow {
            camera: unit.camera.clone(),
            is_ceiling: unit.is_ceiling,
            values: unit.values.clone(),
            units: Vec::new(),
            figures: Vec::new(),
            status: String::new(),
        };
        groups.push((row, vec![unit]));
    }
    groups
        .into_iter()
        .map(|(row, of_row)| GatheredRow {
            units: of_row.iter().map(|unit| unit.unit.clone()).collect(),
            figures: (0..figures).map(|k| spread(of_row.iter().filter_map(|unit| unit.figures[k]))).collect(),
            status: each_once(of_row.iter().map(|unit| unit.status.as_str())).join("; "),
            ..row
        })
        .collect()
}

/// Texts in their order, each once; empty ones are left out.
fn each_once<'t>(texts: impl Iterator<Item = &'t str>) -> Vec<&'t str> {
    let mut found = Vec::new();
    for text in texts.filter(|text| !text.is_empty()) {
        if !found.contains(&text) {
            found.push(text);
        }
    }
    found
}

/// Mean, standard deviation and range; none of no values.
fn spread(values: impl Iterator<Item = f64>) -> Option<Spread> {
    let values: Vec<f64> = values.collect();
    let count = values.len();
    if count == 0 {
        return None;
    }
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mean = values.iter().sum::<f64>() / count as f64;
    // Rounding may leave the range of values that are nearly equal; equal values have no deviation.
    let mean = if low <= high { mean.clamp(low, high) } else { mean };
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    Some(Spread {
        count,
        mean,
        deviation: (count > 1).then(|| (squares / (count - 1) as f64).sqrt()),
        low,
        high,
    })
}

impl Gathered {
    /// All columns, which the files have. A status is among them if any result states one.
    pub fn columns(&self) -> Vec<Column> {
        let has_status = self.units.iter().any(|unit| !unit.status.is_empty());
        self.columns_with(0..self.figures.len(), has_status)
    }

    /// The columns that a reader sees: of the figures these, by their places, and a status if results differ in it.
    pub fn shown_columns(&self, figures: &[usize]) -> Vec<Column> {
        let has_status = each_once(self.units.iter().map(|unit| unit.status.as_str())).len() > 1;
        self.columns_with(figures.iter().copied(), has_status)
    }

    fn columns_with(&self, figures: impl Iterator<Item = usize>, has_status: bool) -> Vec<Column> {
        let keys = (0..self.keys.len()).map(Column::Key);
        keys.chain([Column::Camera, Column::Repeats])
            .chain(figures.map(Column::Figure))
            .chain(has_status.then_some(Column::Status))
            .collect()
    }

    /// The rows as comma-separated values: keys, camera, number of units; of each figure mean, deviation, least and largest value; status.
    pub fn csv(&self) -> String {
        let columns = self.columns();
        let head = |column: &Column| match *column {
            Column::Figure(k) => {
                let name = &self.figures[k].name;
                ["mean", "deviation", "low", "high"].map(|what| format!("{name}_{what}")).to_vec()
            }
            _ => vec![self.head(*column)],
        };
        let cells = |row: &GatheredRow, column: &Column| match *column {
            Column::Key(k) => vec![in_words(&row.values[k])],
            Column::Camera => vec![row.camera.clone()],
            Column::Repeats => vec![row.units.len().to_string()],
            Column::Figure(k) => {
                let spread = row.figures[k];
                [
                    spread.map(|s| s.mean),
                    spread.and_then(|s| s.deviation),
                    spread.map(|s| s.low),
                    spread.map(|s| s.high),
                ]
                .map(csv_number)
                .to_vec()
            }
            Column::Status => vec![row.status.clone()],
        };
        let heads: Vec<String> = columns.iter().flat_map(head).collect();
        let row = |row: &GatheredRow| -> Vec<String> {
            columns.iter().flat_map(|column| cells(row, column)).collect()
        };
        csv_text([heads].into_iter().chain(self.rows.iter().map(row)))
    }

    /// The single units as comma-separated values: name, keys, camera, seed, figures, status, CPU seconds.
    pub fn units_csv(&self) -> String {
        let columns = self.columns();
        let head = |column: &Column| match *column {
            Column::Repeats => "seed".to_owned(),
            _ => self.head(*column),
        };
        let cell = |unit: &UnitResult, column: &Column| match *column {
            Column::Key(k) => in_words(&unit.values[k]),
            Column::Camera => unit.camera.clone(),
            Column::Repeats => unit.seed.map_or_else(String::new, |seed| seed.to_string()),
            Column::Figure(k) => csv_number(unit.figures[k]),
            Column::Status => unit.status.clone(),
        };
        let framed = |first: String, cells: Vec<String>, last: String| -> Vec<String> {
            [first].into_iter().chain(cells).chain([last]).collect()
        };
        let heads = columns.iter().map(head).collect();
        let rows = self.units.iter().map(|unit| {
            let cells = columns.iter().map(|column| cell(unit, column)).collect();
            framed(unit.unit.clone(), cells, unit.cpu_seconds.to_string())
        });
        csv_text([framed("unit".to_owned(), heads, "cpu_seconds".to_owned())].into_iter().chain(rows))
    }

    /// Which kinds of machines finished the units, if their widest instruction sets differ; none if all have the same.
    ///
    /// The key of a unit holds the instruction set of Petzval's own kernels. The tensor framework chooses its kernels by the machine.
    pub fn unlike_machines(&self) -> Option<String> {
        let mut kinds: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for unit in self.units.iter().filter(|unit| !unit.widest_simd.is_empty()) {
            let of_kind = kinds.entry(&unit.widest_simd).or_default();
            // The cameras of a unit follow each other.
            if of_kind.last() != Some(&unit.unit.as_str()) {
                of_kind.push(&unit.unit);
            }
        }
        if kinds.len() < 2 {
            return None;
        }
        let of_kind = |(widest, units): (&&str, &Vec<&str>)| {
            format!("{widest} for {}, such as `{}`", counted(units.len(), "unit"), units[0])
        };
        let kinds: Vec<String> = kinds.iter().map(of_kind).collect();
        Some(format!(
            "the units ran on machines whose widest instruction sets differ: {}; results of networks agree to the bit only between machines of one kind",
            kinds.join("; ")
        ))
    }

    /// The heading of a column.
    pub fn head(&self, column: Column) -> String {
        match column {
            Column::Key(k) => self.keys[k].clone(),
            Column::Camera => "camera".to_owned(),
            Column::Repeats => "units".to_owned(),
            Column::Figure(k) => self.figures[k].name.clone(),
            Column::Status => "status".to_owned(),
        }
    }

    /// Whether the mean of a row is the best of its column among cameras that are no ceiling; no figure without a direction is.
    pub fn is_best(&self, row: &GatheredRow, k: usize) -> bool {
        let Some(higher) = self.figures[k].higher_is_better else { return false };
        let of =
            |row: &GatheredRow| row.figures[k].map(|spread| if higher { spread.mean } else { -spread.mean });
        let others = self.rows.iter().filter(|other| !other.is_ceiling).filter_map(of);
        let best = others.fold(f64::NEG_INFINITY, f64::max);
        self.rows.len() > 1 && !row.is_ceiling && of(row) == Some(best)
    }
}

/// A value of a key as a cell: texts without quotes.
pub fn in_words(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn unit(name: &str, camera: &str, grid: u64, psnr: Option<f64>) -> UnitResult {
        UnitResult {
            unit: name.to_owned(),
            camera: camera.to_owned(),
            is_ceiling: camera == "ideal",
            values: vec![json!(grid), json!("a, b")],
            seed: Some(1),
            figures: vec![psnr, Some(1.0)],
            status: String::new(),
            files: None,
            cpu_seconds: 2.5,
            widest_simd: "avx2".to_owned(),
        }
    }

    fn gathered(units: Vec<UnitResult>) -> Gathered {
        let psnr = FigureColumn { decimals: Some(2), higher_is_better: Some(true), ..plain("psnr_db") };
        Gathered {
            title: String::new(),
            keys: vec!["psf.grid".to_owned(), "lens".to_owned()],
            figures: vec![psnr, plain("spot")],
            rows: rows(&units, 2),
            units,
            status: SweepStatus { title: String::new(), units: Vec::new() },
        }
    }

    #[test]
    fn a_row_has_mean_spread_and_range_over_its_seeds() {
        let all = gathered(vec![
            unit("1", "a", 64, Some(20.0)),
            unit("2", "a", 64, Some(22.0)),
            unit("3", "ideal", 64, Some(40.0)),
            unit("4", "a", 128, Some(21.5)),
            unit("5", "a", 128, None),
            unit("6", "b", 128, None),
        ]);
        let [first, ideal, second, none] = &all.rows[..] else { panic!("{:?}", all.rows) };
        let wanted = Spread { count: 2, mean: 21.0, deviation: Some(2f64.sqrt()), low: 20.0, high: 22.0 };
        assert_eq!((first.figures[0], &first.units), (Some(wanted), &vec!["1".to_owned(), "2".to_owned()]));
        assert_eq!(second.figures[0].unwrap().deviation, None);
        assert_eq!((second.units.len(), none.figures[0]), (2, None));
        // A ceiling is no candidate, a figure without a direction has no best.
        let best: Vec<bool> = all.rows.iter().map(|row| all.is_best(row, 0)).collect();
        assert_eq!(best, [false, false, true, false]);
        assert!(!all.is_best(first, 1) && ideal.is_ceiling);
        let csv = all.csv();
        let lines: Vec<&str> = csv.lines().collect();
        assert!(lines[0].starts_with(
            "psf.grid,lens,camera,units,psnr_db_mean,psnr_db_deviation,psnr_db_low,psnr_db_high,spot_mean"
        ));
        assert!(lines[3].starts_with("128,\"a, b\",a,2,21.5,,21.5,21.5,1,0,1,1"), "{}", lines[3]);
        assert_eq!(all.units_csv().lines().nth(5).unwrap(), "5,128,\"a, b\",a,1,,1,2.5");
    }

    #[test]
    fn the_status_of_results_is_in_every_table() {
        let lost = UnitResult { status: "missed, surface 3".to_owned(), ..unit("2", "a", 128, None) };
        let all = gathered(vec![
            UnitResult { status: "ok".to_owned(), ..unit("1", "a", 64, Some(20.0)) },
            lost.clone(),
        ]);
        assert_eq!(all.shown_columns(&[0]).last(), Some(&Column::Status));
        for (csv, end) in [(all.csv(), ",status"), (all.units_csv(), ",status,cpu_seconds")] {
            let lines: Vec<&str> = csv.lines().collect();
            assert!(lines[0].ends_with(end), "{csv}");
            assert!(lines[1].contains(",ok") && lines[2].contains(",\"missed, surface 3\""), "{csv}");
        }
        // One that all results share is in the files alone.
        let same = gathered(vec![lost.clone(), UnitResult { unit: "3".to_owned(), ..lost }]);
        assert!(!same.shown_columns(&[0]).contains(&Column::Status) && same.csv().contains(",status"));
        assert!(!gathered(vec![unit("1", "a", 64, None)]).units_csv().contains("status"));
    }

    #[test]
    fn units_of_machines_with_different_instruction_sets_are_named() {
        let [first, same] = [unit("1", "a", 64, None), unit("1", "b", 64, None)];
        assert_eq!(gathered(vec![first.clone(), same.clone()]).unlike_machines(), None);
        let unknown = UnitResult { widest_simd: String::new(), ..unit("2", "a", 64, None) };
        let wider = UnitResult { widest_simd: "avx512".to_owned(), ..unit("3", "a", 64, None) };
        let said = gathered(vec![first, same, unknown, wider]).unlike_machines().unwrap();
        assert!(said.contains("avx2 for 1 unit, such as `1`; avx512 for 1 unit, such as `3`"), "{said}");
    }

    #[test]
    fn equal_values_have_their_own_mean_and_no_deviation() {
        // Three times this field of view, divided by three, is not itself.
        let value = 28.005382457702687f64;
        assert_ne!((value + value + value) / 3.0, value);
        let wanted = Spread { count: 3, mean: value, deviation: Some(0.0), low: value, high: value };
        assert_eq!(spread([value; 3].into_iter()), Some(wanted));
    }

    #[test]
    fn numbers_of_any_response_are_figures() {
        let mut found = BTreeMap::new();
        add_numbers("", &json!({"a": 1, "b": {"c": 2.5, "d": "x"}, "e": [3], "f": null}), &mut found);
        assert_eq!(found, BTreeMap::from([("a".to_owned(), 1.0), ("b.c".to_owned(), 2.5)]));
    }

    #[test]
    fn what_random_lenses_reach_heads_the_columns_of_tolerances() {
        let response = json!({"report": {"better": "lower", "estimate": {"mean": 35.3}, "monte_carlo": {
            "mean": 35.6, "standard_deviation": 0.99, "yield_at_limit": null,
            "percentiles": [{"percent": 50.0, "merit": 35.2}, {"percent": 90.0, "merit": 36.8}],
        }}});
        let mut values = BTreeMap::new();
        add_numbers("", &response, &mut values);
        let columns = of_random_lenses(&response, &mut values);
        let titles: Vec<&str> = columns.iter().map(|column| column.title.as_str()).collect();
        assert_eq!(
            titles,
            [
                "merit that 90 % of the lenses reach",
                "mean merit of random lenses",
                "standard deviation of random lenses"
            ]
        );
        assert_eq!(values[&columns[0].name], 36.8);
        assert!(columns.iter().all(|column| column.higher_is_better == Some(false)));
    }
}

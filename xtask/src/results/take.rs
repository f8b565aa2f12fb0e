//! Fills tables from finished runs: one value a seed of every camera, the differences between cameras, and scores by place of the field.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde::Deserialize;

use super::data::{Column, Data, FOLDER, FromRuns, Renewed, Table, name_of};
use super::figure::Figure;

/// What is taken of the `metrics.json` of a run.
#[derive(Deserialize)]
struct Metrics {
    rows: Vec<Camera>,
    seeds: Vec<u64>,
    version: String,
}

/// The figures of a camera, by name.
#[derive(Deserialize)]
struct Camera {
    camera: String,
    #[serde(default)]
    pictures: Vec<BTreeMap<String, serde_json::Value>>,
    #[serde(flatten)]
    figures: BTreeMap<String, serde_json::Value>,
}

/// What is taken of `run.json`.
#[derive(Deserialize)]
struct Record {
    begun: String,
}

/// A finished run.
struct Run {
    metrics: Metrics,
    seed: u64,
    /// The day on which it began.
    date: String,
}

/// Digits of a value that are kept behind those of its column.
const SPARE_DECIMALS: usize = 2;

/// Fills a table `file/table` from runs of several seeds, and with it all tables of that file that follow from the same runs.
pub(super) fn take(root: &Path, key: &str, folders: &[&Path]) -> Result<(), String> {
    changed(root, key, folders, |tables, at, runs| {
        if tables[at].from_runs != Some(FromRuns::Cameras) {
            return Err(format!(
                "table {key:?} is no table of cameras: give it \"from_runs\": {{\"kind\": \"cameras\"}}"
            ));
        }
        let name = tables[at].key.clone();
        tables.iter_mut().try_for_each(|table| fill(table, &name, runs))
    })
}

/// Fills one row of a table from runs of several seeds, and the gaps that follow from it. The other rows stay.
pub(super) fn take_row(root: &Path, key: &str, row: &str, folders: &[&Path]) -> Result<(), String> {
    let (row, camera) = row.split_once('=').unwrap_or((row, row));
    changed(root, key, folders, |tables, at, runs| renew(&mut tables[at], row, camera, runs))
}

/// Changes the tables of the file of a table, which is the one at a place among them, by runs, and writes the file.
fn changed(
    root: &Path,
    key: &str,
    folders: &[&Path],
    change: impl FnOnce(&mut [Table], usize, &[Run]) -> Result<(), String>,
) -> Result<(), String> {
    let mut data = Data::read(root)?;
    let name = data.table(key)?.key.clone();
    let runs = folders.iter().map(|folder| read(folder)).collect::<Result<Vec<_>, _>>()?;
    let runs = samples(runs)?;
    let (file, _) = key.split_once('/').unwrap_or((key, ""));
    let Some(found) = data.files.get_mut(file) else { return Ok(()) };
    let Some(at) = found.tables.iter().position(|table| table.key == name) else { return Ok(()) };
    change(&mut found.tables, at, &runs)?;
    let text = found.text().map_err(|e| e.to_string())?;
    fs::write(root.join(FOLDER).join(format!("{file}.json")), text).map_err(|e| format!("{file}.json: {e}"))
}

/// Makes a row of a table again from a camera of runs that have the seeds of the table. Columns without a metric keep their cell.
fn renew(table: &mut Table, row: &str, camera: &str, runs: &[Run]) -> Result<(), String> {
    let seeds: Vec<u64> = runs.iter().map(|run| run.seed).collect();
    if seeds != table.seeds {
        return Err(format!(
            "the runs have the seeds {seeds:?}, the table {:?}: name one run a seed",
            table.seeds
        ));
    }
    let filled = filled_row(row, &table.columns, |column| scores(runs, camera, column))?;
    if filled.iter().skip(1).all(Option::is_none) {
        return Err(format!(
            "table {:?} has no column with a metric, by which a run fills a cell",
            table.key
        ));
    }
    let Some(old) = table.rows.iter_mut().find(|old| name_of(old) == Some(row)) else {
        return Err(format!("table {:?} has no row {row:?}; write --row ROW=CAMERA", table.key));
    };
    for (old, new) in old.iter_mut().zip(filled) {
        *old = new.or(old.take());
    }
    table.renewed.retain(|renewed| renewed.row != row);
    table.renewed.push(Renewed {
        row: row.to_owned(),
        version: runs[0].metrics.version.clone(),
        date: runs.iter().map(|run| run.date.clone()).max().unwrap_or_default(),
    });
    table.fill_gaps();
    Ok(())
}

/// Runs in the order of their seeds, if they are samples of one thing: each of another seed, and all made by the version that the table states.
fn samples(mut runs: Vec<Run>) -> Result<Vec<Run>, String> {
    runs.sort_by_key(|run| run.seed);
    for pair in runs.windows(2) {
        let [one, other] = pair else { continue };
        if one.seed == other.seed {
            let seed = one.seed;
            return Err(format!("two runs have seed {seed}: one sample would count twice; name one of them"));
        }
        let versions = [&one.metrics.version, &other.metrics.version];
        if versions[0] != versions[1] {
            return Err(format!(
                "the run of seed {} was made by Petzval {}, that of seed {} by {}; make them by one version",
                one.seed, versions[0], other.seed, versions[1]
            ));
        }
    }
    Ok(runs)
}

/// Reads a run.
fn read(folder: &Path) -> Result<Run, String> {
    let text = |name: &str| {
        let path = folder.join(name);
        fs::read_to_string(&path)
            .map_err(|e| format!("{}: {e}; name the folder of a finished run", path.display()))
    };
    let place = |name: &str, e: serde_json::Error| format!("{}: {e}", folder.join(name).display());
    let metrics: Metrics =
        serde_json::from_str(&text("metrics.json")?).map_err(|e| place("metrics.json", e))?;
    let record: Record = serde_json::from_str(&text("run.json")?).map_err(|e| place("run.json", e))?;
    let &[seed] = metrics.seeds.as_slice() else {
        return Err(format!("{}: seeds = {:?}: one run has one seed", folder.display(), metrics.seeds));
    };
    Ok(Run { seed, date: record.begun.chars().take(10).collect(), metrics })
}

/// Fills a table if it follows from the runs of table `of`.
fn fill(table: &mut Table, of: &str, runs: &[Run]) -> Result<(), String> {
    let columns = &table.columns;
    let rows = match &table.from_runs {
        Some(FromRuns::Cameras) if table.key == of => {
            let cameras = runs[0].metrics.rows.iter().map(|row| row.camera.as_str());
            let row = |camera: &str| filled_row(camera, columns, |column| scores(runs, camera, column));
            cameras.map(row).collect::<Result<Vec<_>, _>>()?
        }
        Some(FromRuns::Differences { of: other, camera }) if other == of => {
            let against = table.rows.iter().filter_map(|row| name_of(row));
            let difference = |other: &str, column: &Column| {
                let (one, other) = (scores(runs, camera, column)?, scores(runs, other, column)?);
                Ok(one.iter().zip(other).map(|(one, other)| one - other).collect())
            };
            let row = |name: &str| filled_row(name, columns, |column| difference(name, column));
            against.map(row).collect::<Result<Vec<_>, _>>()?
        }
        Some(FromRuns::Places { of: other }) if other == of => places(columns, runs)?,
        _ => return Ok(()),
    };
    table.rows = rows;
    table.fill_gaps();
    table.renewed.clear();
    table.seeds = runs.iter().map(|run| run.seed).collect();
    table.version = runs[0].metrics.version.clone();
    table.date = runs.iter().map(|run| run.date.clone()).max().unwrap_or_default();
    table.origin = "metrics.json of the runs".to_owned();
    Ok(())
}

/// A row with one value a seed in every column that has a metric.
fn filled_row(
    name: &str,
    columns: &[Column],
    values: impl Fn(&Column) -> Result<Vec<f64>, String>,
) -> Result<Vec<Option<Figure>>, String> {
    let mut row = vec![Some(Figure::Text(name.to_owned()))];
    for column in &columns[1..] {
        let seeds = match &column.metric {
            Some(_) => Some(values(column)?.iter().map(|value| kept(*value, column)).collect()),
            None => None,
        };
        row.push(seeds.map(|seeds| Figure::Seeds { seeds }));
    }
    Ok(row)
}

/// A value with the digits that are kept of it.
fn kept(value: f64, column: &Column) -> f64 {
    let unit = 10_f64.powi((column.decimals + SPARE_DECIMALS) as i32);
    (value * unit).round() / unit
}

/// The values of a camera in a column, one a seed.
fn scores(runs: &[Run], camera: &str, column: &Column) -> Result<Vec<f64>, String> {
    let metric = column.metric.as_deref().unwrap_or_default();
    let score = |run: &Run| {
        let row = run.metrics.rows.iter().find(|row| row.camera == camera);
        let row = row.ok_or_else(|| format!("the run of seed {} has no camera {camera:?}", run.seed))?;
        let value = row.figures.get(metric).and_then(serde_json::Value::as_f64);
        value.ok_or_else(|| format!("camera {camera:?} of seed {} has no number {metric:?}", run.seed))
    };
    runs.iter().map(score).collect()
}

/// A row a place of the field: means over photographs and seeds.
fn places(columns: &[Column], runs: &[Run]) -> Result<Vec<Vec<Option<Figure>>>, String> {
    let mut sums: BTreeMap<String, Vec<(f64, usize)>> = BTreeMap::new();
    for (number, column) in columns.iter().enumerate().skip(1) {
        let (Some(metric), Some(camera)) = (&column.metric, &column.camera) else {
            return Err(format!("column {:?} of a table by place needs a metric and a camera", column.name));
        };
        let cameras = runs.iter().flat_map(|run| &run.metrics.rows).filter(|row| row.camera == *camera);
        for picture in cameras.flat_map(|row| &row.pictures) {
            let number_of = |name: &str| picture.get(name).and_then(serde_json::Value::as_f64);
            let (Some(place), Some(value)) = (number_of("relative_field"), number_of(metric)) else {
                return Err(format!("a picture of {camera:?} has no place or no {metric:?}"));
            };
            let row = sums.entry(format!("{place:.2}")).or_insert_with(|| vec![(0.0, 0); columns.len()]);
            row[number].0 += value;
            row[number].1 += 1;
        }
    }
    let row = |(place, sums): (String, Vec<(f64, usize)>)| {
        let means = sums.iter().zip(columns).skip(1);
        let means = means.map(|((sum, count), column)| {
            (*count > 0).then(|| Figure::Number(kept(sum / *count as f64, column)))
        });
        [Some(Figure::Text(place))].into_iter().chain(means).collect()
    };
    Ok(sums.into_iter().map(row).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::data::DataFile;

    fn run(seed: u64, nominal: f64, designed: f64) -> Run {
        let text = format!(
            r#"{{"seeds": [{seed}], "version": "0.2.0", "rows": [
            {{"camera": "nominal", "psnr_db": {nominal}, "pictures": [
                {{"photo": "a", "relative_field": 0.001, "psnr_db": 20}},
                {{"photo": "b", "relative_field": 0.002, "psnr_db": 22}}, {{"photo": "a", "relative_field": 0.5, "psnr_db": 30}}]}},
            {{"camera": "end-to-end", "psnr_db": {designed}, "efl_mm": null}}]}}"#
        );
        Run { metrics: serde_json::from_str(&text).unwrap(), seed, date: format!("2026-11-0{seed}") }
    }

    const TABLES: &str = r#"{"tables": [
        {"key": "main", "title": "t", "command": "c", "version": "0.1.0", "date": "2026-01-01", "origin": "o", "from_runs": {"kind": "cameras"},
         "columns": [{"name": "camera"}, {"name": "PSNR", "decimals": 1, "metric": "psnr_db"}], "rows": []},
        {"key": "gain", "title": "t", "command": "c", "version": "0.1.0", "date": "2026-01-01", "origin": "o",
         "from_runs": {"kind": "differences", "of": "main", "camera": "end-to-end"},
         "columns": [{"name": "against"}, {"name": "PSNR", "decimals": 1, "metric": "psnr_db"}], "rows": [["nominal", 0]]},
        {"key": "field", "title": "t", "command": "c", "version": "0.1.0", "date": "2026-01-01", "origin": "o",
         "from_runs": {"kind": "places", "of": "main"},
         "columns": [{"name": "place"}, {"name": "PSNR", "decimals": 1, "metric": "psnr_db", "camera": "nominal"}], "rows": []},
        {"key": "other", "title": "t", "command": "c", "version": "0.1.0", "date": "2026-01-01", "origin": "o",
         "columns": [{"name": "camera"}], "rows": [["nominal"]]}]}"#;

    #[test]
    fn runs_fill_cameras_differences_and_places() {
        let mut file = DataFile::parse(TABLES).unwrap();
        let runs = [run(1, 20.1234567, 21.0), run(2, 20.5, 21.9)];
        for table in &mut file.tables {
            fill(table, "main", &runs).unwrap();
        }
        let rows = |i: usize| serde_json::to_string(&file.tables[i].rows).unwrap();
        assert_eq!(rows(0), r#"[["nominal",{"seeds":[20.123,20.5]}],["end-to-end",{"seeds":[21.0,21.9]}]]"#);
        assert_eq!(rows(1), r#"[["nominal",{"seeds":[0.877,1.4]}]]"#);
        assert_eq!(rows(2), r#"[["0.00",21.0],["0.50",30.0]]"#);
        assert_eq!(rows(3), r#"[["nominal"]]"#);
        let table = &file.tables[1];
        assert_eq!((table.seeds.as_slice(), table.date.as_str()), ([1, 2].as_slice(), "2026-11-02"));
        assert_eq!((table.version.as_str(), table.origin.as_str()), ("0.2.0", "metrics.json of the runs"));
        assert_eq!(file.tables[3].version, "0.1.0");
    }

    #[test]
    fn a_renewed_row_leaves_the_others_and_moves_their_gaps() {
        let text = r#"{"tables": [{"key": "old", "title": "t", "command": "c", "seeds": [1, 2], "version": "0.1.0", "date": "2026-01-01", "origin": "o",
            "columns": [{"name": "camera"}, {"name": "PSNR", "decimals": 1, "metric": "psnr_db"}, {"name": "note"}, {"name": "gap", "gap": "PSNR"}],
            "rows": [["nominal", {"mean": 20.0, "deviation": 0.1}, null, null], ["made", 21.0, "kept", 50], ["perfect optics", 22.0, "thin", null]]}]}"#;
        let mut file = DataFile::parse(text).unwrap();
        let table = &mut file.tables[0];
        renew(table, "perfect optics", "end-to-end", &[run(1, 0.0, 24.0), run(2, 0.0, 26.0)]).unwrap();
        assert_eq!(
            serde_json::to_string(&table.rows).unwrap(),
            r#"[["nominal",{"mean":20.0,"deviation":0.1},null,null],["made",21.0,"kept",20.0],["perfect optics",{"seeds":[24.0,26.0]},"thin",null]]"#
        );
        assert_eq!((table.version.as_str(), table.renewed[0].version.as_str()), ("0.1.0", "0.2.0"));
        let problem =
            |row: &str, runs: &[Run]| renew(&mut file.tables[0].clone(), row, "nominal", runs).unwrap_err();
        assert!(problem("perfect", &[run(1, 0.0, 0.0), run(2, 0.0, 0.0)]).contains("has no row \"perfect\""));
        assert!(
            problem("made", &[run(1, 0.0, 0.0)]).contains("the runs have the seeds [1], the table [1, 2]")
        );
        // Without a metric nothing would be made again, and the table would say that it was.
        let mut without = DataFile::parse(&text.replace("\"metric\"", "\"unit\"")).unwrap();
        let runs = [run(1, 0.0, 24.0), run(2, 0.0, 26.0)];
        let refused = renew(&mut without.tables[0], "perfect optics", "end-to-end", &runs).unwrap_err();
        assert!(refused.contains("no column with a metric"), "{refused}");
    }

    #[test]
    fn runs_of_one_seed_or_of_two_versions_are_no_samples() {
        let runs = || vec![run(2, 20.5, 21.9), run(1, 20.0, 21.0)];
        let seeds: Vec<u64> = samples(runs()).unwrap().iter().map(|run| run.seed).collect();
        assert_eq!(seeds, [1, 2]);
        let problem = |change: fn(&mut Run)| {
            let mut runs = runs();
            change(&mut runs[0]);
            samples(runs).err().unwrap_or_default()
        };
        let newer = problem(|run| run.metrics.version = "0.3.0".to_owned());
        assert!(newer.contains("seed 1 was made by Petzval 0.2.0, that of seed 2 by 0.3.0"), "{newer}");
        assert!(problem(|run| run.seed = 1).contains("two runs have seed 1"));
    }

    #[test]
    fn what_runs_lack_is_named() {
        let mut file = DataFile::parse(&TABLES.replace("\"psnr_db\"", "\"efl_mm\"")).unwrap();
        let problem = fill(&mut file.tables[0], "main", &[run(1, 20.0, 21.0)]).unwrap_err();
        assert_eq!(problem, "camera \"nominal\" of seed 1 has no number \"efl_mm\"");
        let mut file = DataFile::parse(&TABLES.replace("[\"nominal\", 0]", "[\"made\", 0]")).unwrap();
        let problem = fill(&mut file.tables[1], "main", &[run(1, 20.0, 21.0)]).unwrap_err();
        assert_eq!(problem, "the run of seed 1 has no camera \"made\"");
    }
}

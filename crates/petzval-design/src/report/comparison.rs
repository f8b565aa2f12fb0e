//! Runs side by side: of one experiment with several seeds, and of several experiments.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use petzval_base::{FileError, csv_number, csv_text};
use petzval_learn::dataset::PictureFile;
use petzval_learn::score::ScoreDescription;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::error::{DesignError, Result};
use crate::experiment::Experiment;
use crate::library::Library;
use crate::path_text::path_text;
use crate::report::run_report::read_metrics;
use crate::run::input_list::InputList;
use crate::run::{CameraMetrics, DigestCheck, Metrics, RunFolder, RunRecord, hex, read_json_if_there};
use crate::study::{MeanAndDeviation, is_same_lens};

/// Finished runs of one experiment that differ in their seeds alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Comparison {
    /// Title of the experiment.
    pub title: String,
    /// The runs' folders.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub runs: Vec<PathBuf>,
    /// Their seeds.
    pub seeds: Vec<u64>,
    /// What differs from the other comparisons, by key of the experiment file or name of the input, with the value here: the columns that
    /// tell them apart. Empty for a single comparison.
    #[serde(default)]
    pub differs: Vec<(String, String)>,
    /// Steps of the network, or of the hardware ISP, of each camera.
    pub steps: usize,
    /// Wall-clock hours of all runs together.
    pub hours: f64,
    /// Peak memory of a run, GB; none if the system does not report it.
    pub memory_gb: Option<f64>,
    /// The scores.
    pub scores: Vec<ScoreDescription>,
    /// The cameras, in the order of the experiment.
    pub cameras: Vec<ComparedCamera>,
    /// Scores of the last camera that is no ceiling less those of each other one.
    pub differences: Vec<ComparedDifference>,
    /// What the paper prints for the same comparison.
    pub paper: Option<PaperTable>,
}

/// A camera over the seeds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ComparedCamera {
    /// Its name.
    pub name: String,
    /// Whether its lens has no aberrations.
    pub is_ceiling: bool,
    /// Its scores.
    pub scores: Vec<MeanAndDeviation>,
    /// Share of the gap between the first camera that is no ceiling and the ceiling that this camera closes, by score. None without a
    /// ceiling, or if the gap is not significant: the ceiling must lie above that camera with every seed, and on average by twice the
    /// spread of the seeds.
    pub gap_closed: Vec<Option<MeanAndDeviation>>,
    /// RMS spot radius, um.
    pub rms_spot_um: MeanAndDeviation,
    /// Effective focal length, mm.
    pub efl_mm: MeanAndDeviation,
    /// F-number.
    pub f_number: MeanAndDeviation,
}

/// The difference between two cameras over the seeds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ComparedDifference {
    /// The camera from whose scores the other's are taken.
    pub camera: String,
    /// The other.
    pub against: String,
    /// By score.
    pub scores: Vec<MeanAndDeviation>,
}

/// The figures of the paper for one experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PaperTable {
    /// Names of the experiments that repeat it.
    pub experiments: Vec<String>,
    /// Where it stands.
    pub source: String,
    /// Its rows.
    pub row: Vec<PaperRow>,
}

/// A row of a table of the paper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PaperRow {
    /// The camera, as the paper calls it.
    pub camera: String,
    /// Scores by name.
    pub scores: BTreeMap<String, f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PaperFile {
    table: Vec<PaperTable>,
}

/// The cameras of comparisons as comma-separated values, a line each, with the unit in the name of each column: means and standard deviations
/// over the seeds. A score that an experiment does not have is left empty, and so is the deviation of a single seed.
pub fn comparison_csv(comparisons: &[Comparison]) -> String {
    let mut names: Vec<&str> = Vec::new();
    for score in comparisons.iter().flat_map(|comparison| &comparison.scores) {
        if !names.contains(&score.name.as_str()) {
            names.push(&score.name);
        }
    }
    let columns = names.iter().copied().chain(["rms_spot_um", "efl_mm", "f_number"]);
    let heads = columns.flat_map(|name| [format!("{name}_mean"), format!("{name}_deviation")]);
    let differs = comparisons.first().map_or(&[][..], |first| &first.differs);
    let first = ["experiment", "seeds"].map(str::to_owned).into_iter();
    let first = first.chain(differs.iter().map(|(key, _)| key.clone())).chain(["camera".to_owned()]);
    let mut lines: Vec<Vec<String>> = vec![first.chain(heads).collect()];
    for Comparison { title, seeds, differs, scores, cameras, .. } in comparisons {
        let is_several = seeds.len() > 1;
        let cells = |value: Option<MeanAndDeviation>| {
            let deviation = value.filter(|_| is_several).map(|v| v.deviation);
            [value.map(|v| v.mean), deviation].map(csv_number)
        };
        let seeds: Vec<String> = seeds.iter().map(u64::to_string).collect();
        for camera in cameras {
            let score = |name: &&str| {
                let place = scores.iter().position(|score| score.name == *name);
                place.and_then(|place| camera.scores.get(place).copied())
            };
            let of_lens = [camera.rms_spot_um, camera.efl_mm, camera.f_number].map(Some);
            let values = names.iter().map(score).chain(of_lens);
            let first = [title.clone(), seeds.join(" ")].into_iter();
            let first =
                first.chain(differs.iter().map(|(_, value)| value.clone())).chain([camera.name.clone()]);
            lines.push(first.chain(values.flat_map(cells)).collect());
        }
    }
    csv_text(lines)
}

/// A finished run.
struct Finished {
    root: PathBuf,
    /// Of its inputs.
    fingerprint: String,
    config: Experiment,
    record: Option<RunRecord>,
    metrics: Metrics,
    /// Inputs and instruction set by name, shortened where they are digests.
    facts: BTreeMap<String, String>,
}

impl Finished {
    /// The version that made it; none where it is not known.
    fn version(&self) -> Option<&str> {
        self.record.as_ref().map(|record| record.version.as_str())
    }

    /// The experiment without what may differ between runs that repeat it: the seed, the memory for reading, and where inputs lie, whose content the
    /// fingerprint has.
    fn repeated(&self) -> Experiment {
        let mut config = Experiment { seed: 0, reading: Default::default(), ..self.config.clone() };
        for (key, place) in config.inputs_mut() {
            if ["photos", "data", "isp"].contains(&key[0].as_str()) {
                *place = "one's own".to_owned();
            }
        }
        config
    }
}

/// Groups finished runs by what they repeat and by the version of Petzval that made them, in the order in which they are given. `accepted` and
/// `warn` are those of a [`DigestCheck`].
pub fn compare(
    runs: &[PathBuf],
    library: &Library,
    accepted: &[String],
    warn: &dyn Fn(&str),
) -> Result<Vec<Comparison>> {
    let mut groups: Vec<Vec<Finished>> = Vec::new();
    for root in runs {
        let run = finished(root, library, accepted, warn)?;
        let is_same = |group: &&mut Vec<Finished>| {
            group[0].repeated() == run.repeated()
                && group[0].fingerprint == run.fingerprint
                && group[0].metrics.scores == run.metrics.scores
                && group[0].version() == run.version()
        };
        match groups.iter_mut().find(is_same) {
            Some(group) => {
                if let Some(twin) = group.iter().find(|other| other.metrics.seeds == run.metrics.seeds) {
                    let problem = format!(
                        "repeats {} with the same seed: one sample would count twice; name one of them",
                        twin.root.display()
                    );
                    return Err(DesignError::Run { path: run.root, problem });
                }
                group.push(run);
            }
            None => groups.push(vec![run]),
        }
    }
    let source = library.text("table", "studies", "paper")?;
    let paper: PaperFile = toml::from_str(&source.text)
        .map_err(|e| DesignError::input(&source.path)(FileError::from_toml(&source.text, &e)))?;
    let differs = differences(&groups);
    let are_of_one_version = groups.iter().all(|group| group[0].version() == groups[0][0].version());
    let named = |(group, differs): (&Vec<Finished>, Vec<(String, String)>)| {
        let paper = printed_for(&group[0], &paper.table, library)?;
        let found = Comparison { differs, ..comparison(group, paper) };
        Ok(match (are_of_one_version, group[0].version()) {
            (false, Some(version)) => {
                Comparison { title: format!("{}, Petzval {version}", found.title), ..found }
            }
            _ => found,
        })
    };
    groups.iter().zip(differs).map(named).collect()
}

/// What differs between groups, with the value in each of them: keys of the experiment, inputs, version, instruction set.
fn differences(groups: &[Vec<Finished>]) -> Vec<Vec<(String, String)>> {
    let all = |group: &Vec<Finished>| {
        let run = &group[0];
        let mut values = run.repeated().values();
        // Names in the folder of a run: their content is among the facts.
        values.retain(|_, value| !value.trim_matches('"').starts_with("inputs/"));
        // The title has a column of its own.
        values.remove("name");
        values.insert("version".to_owned(), run.version().unwrap_or("").to_owned());
        values.extend(run.facts.clone());
        values
    };
    let all: Vec<BTreeMap<String, String>> = groups.iter().map(all).collect();
    let keys: BTreeSet<&String> = all.iter().flat_map(BTreeMap::keys).collect();
    let differ = |key: &&String| all.iter().any(|values| values.get(*key) != all[0].get(*key));
    let keys: Vec<&String> = keys.into_iter().filter(differ).collect();
    let value = |values: &BTreeMap<String, String>, key: &String| {
        (key.clone(), values.get(key).map_or_else(|| "-".to_owned(), Clone::clone))
    };
    all.iter().map(|values| keys.iter().map(|key| value(values, key)).collect()).collect()
}

/// First digits of a digest: enough to tell two inputs apart.
const SHOWN_OF_DIGEST: usize = 8;

/// Inputs and instruction set of a run by name.
fn facts(run: &RunFolder, fingerprint: &str) -> Result<BTreeMap<String, String>> {
    let short = |digest: &str| digest.chars().take(SHOWN_OF_DIGEST).collect::<String>();
    let mut facts = BTreeMap::new();
    match InputList::read(run)? {
        Some(list) => {
            facts.extend(list.parts.iter().map(|(name, digest)| (name.clone(), short(digest))));
            if let Some(pictures) = &list.pictures {
                // Of a large set, names and sizes are known.
                let known = |file: &PictureFile| {
                    file.sha256.clone().unwrap_or_else(|| format!("{} {}", file.name, file.bytes))
                };
                let known: String = pictures.files.iter().map(known).collect();
                let labels = pictures.labels.as_deref().unwrap_or("");
                let digest = hex(Sha256::new_with_prefix(known + labels));
                facts.insert("pictures".to_owned(), format!("{}, {}", pictures.files.len(), short(&digest)));
            }
        }
        None => drop(facts.insert("inputs".to_owned(), short(fingerprint))),
    }
    let environment: Option<serde_json::Value> = read_json_if_there(&run.environment())?;
    if let Some(simd) = environment.as_ref().and_then(|environment| environment["simd_used"].as_str()) {
        facts.insert("SIMD".to_owned(), simd.to_owned());
    }
    Ok(facts)
}

fn finished(root: &Path, library: &Library, accepted: &[String], warn: &dyn Fn(&str)) -> Result<Finished> {
    let run = RunFolder::open(root)?;
    let check = DigestCheck::new(&run, accepted, warn);
    let metrics = read_metrics(&run)?;
    check.check("")?;
    check.check_cameras(metrics.rows.iter().map(|row| row.camera.as_str()))?;
    let record = RunRecord::read(&run)?;
    let config = match &record {
        Some(record) => record.config.clone(),
        None => library.config_of_run(&run)?,
    };
    let path = run.fingerprint();
    let fingerprint = petzval_base::read_text(&path).map_err(DesignError::io(&path))?;
    let facts = facts(&run, &fingerprint)?;
    Ok(Finished { root: root.to_owned(), fingerprint, config, record, metrics, facts })
}

/// What the paper prints for the experiment of a run: one with the title, the task, the lens and cameras of a built-in experiment that repeats a
/// table.
fn printed_for(run: &Finished, tables: &[PaperTable], library: &Library) -> Result<Option<PaperTable>> {
    let config = &run.config;
    let Some(table) = tables.iter().find(|table| table.experiments.contains(&config.name)) else {
        return Ok(None);
    };
    let lens = path_text(&run.root.join(&config.lens))?;
    for name in library.names("experiments") {
        let built_in = library.experiment(name)?;
        let has_camera = |name: &str| built_in.variant.iter().any(|variant| variant.name == name);
        if built_in.name == config.name
            && built_in.task == config.task
            && config.variant.iter().all(|variant| has_camera(&variant.name))
            && is_same_lens(&lens, &built_in.lens, library).unwrap_or(false)
        {
            return Ok(Some(table.clone()));
        }
    }
    Ok(None)
}

fn comparison(runs: &[Finished], paper: Option<PaperTable>) -> Comparison {
    let first = &runs[0];
    let rows = &first.metrics.rows;
    // A score for which a camera has nothing to find has no column.
    let is_everywhere = |score: &&ScoreDescription| {
        runs.iter().flat_map(|run| &run.metrics.rows).all(|row| row.scores.contains_key(&score.name))
    };
    let scores: Vec<ScoreDescription> = first.metrics.scores.iter().filter(is_everywhere).cloned().collect();
    let of = |camera: &str| -> Vec<&CameraMetrics> {
        runs.iter().filter_map(|run| run.metrics.rows.iter().find(|row| row.camera == camera)).collect()
    };
    let value = |row: &CameraMetrics, score: &ScoreDescription| {
        row.scores.get(&score.name).copied().unwrap_or(f64::NAN)
    };
    let baseline = rows.iter().find(|row| !row.is_ceiling);
    let ceiling = rows.iter().rfind(|row| row.is_ceiling);
    let cameras = rows.iter().map(|row| {
        let seen = of(&row.camera);
        let gap_closed = |score: &ScoreDescription| {
            let from = of(&baseline?.camera);
            let way = |to: &[&CameraMetrics]| -> Vec<f64> {
                to.iter().zip(&from).map(|(to, from)| value(to, score) - value(from, score)).collect()
            };
            let (gap, gone) = (way(&of(&ceiling?.camera)), way(&seen));
            is_gap(&gap, score.higher_is_better).then(|| spread(gone.iter().zip(&gap).map(|(a, b)| a / b)))?
        };
        ComparedCamera {
            name: row.camera.clone(),
            is_ceiling: row.is_ceiling,
            scores: scores.iter().filter_map(|s| spread(seen.iter().map(|row| value(row, s)))).collect(),
            gap_closed: scores.iter().map(gap_closed).collect(),
            rms_spot_um: spread(seen.iter().map(|row| row.rms_spot_um)).unwrap_or_default(),
            efl_mm: spread(seen.iter().map(|row| row.efl_mm)).unwrap_or_default(),
            f_number: spread(seen.iter().map(|row| row.f_number)).unwrap_or_default(),
        }
    });
    let design = rows.iter().rev().find(|row| !row.is_ceiling);
    let others = rows.iter().filter(|row| Some(&row.camera) != design.map(|d| &d.camera) && !row.is_ceiling);
    let difference = |other: &CameraMetrics| {
        let (ours, theirs) = (of(&design?.camera), of(&other.camera));
        let by =
            |s: &ScoreDescription| spread(ours.iter().zip(&theirs).map(|(a, b)| value(a, s) - value(b, s)));
        Some(ComparedDifference {
            camera: design?.camera.clone(),
            against: other.camera.clone(),
            scores: scores.iter().filter_map(by).collect(),
        })
    };
    let ends = || runs.iter().filter_map(|run| run.record.as_ref()?.finished.as_ref());
    Comparison {
        title: first.config.name.clone(),
        runs: runs.iter().map(|run| run.root.clone()).collect(),
        seeds: runs.iter().flat_map(|run| run.metrics.seeds.clone()).collect(),
        steps: rows.iter().map(|row| row.network_steps.max(row.isp_steps)).max().unwrap_or(0),
        hours: ends().map(|end| end.seconds).sum::<f64>() / 3600.0,
        memory_gb: ends().filter_map(|end| end.memory_gb).reduce(f64::max),
        cameras: cameras.collect(),
        differences: others.filter_map(difference).collect(),
        paper,
        differs: Vec::new(),
        scores,
    }
}

/// How many times the spread of the seeds a gap must be, so that shares of it say something.
const SURE: f64 = 2.0;

/// Whether scores of a ceiling less those of a baseline, seed by seed, are a gap that cameras can close.
fn is_gap(differences: &[f64], higher_is_better: bool) -> bool {
    let is_way = |difference: &f64| if higher_is_better { *difference > 0.0 } else { *difference < 0.0 };
    let is_sure = |all: MeanAndDeviation| all.mean.abs() >= SURE * all.deviation;
    differences.iter().all(is_way) && spread(differences.iter().copied()).is_some_and(is_sure)
}

/// Mean and standard deviation; the deviation of one value is 0. `None` without values.
fn spread(values: impl Iterator<Item = f64>) -> Option<MeanAndDeviation> {
    let values: Vec<f64> = values.collect();
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    let deviation = (squares / (count - 1.0).max(1.0)).sqrt();
    (!values.is_empty()).then_some(MeanAndDeviation { mean, deviation })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_are_those_of_samples() {
        let found = spread([1.0, 2.0, 3.0].into_iter()).unwrap();
        assert_eq!(found, MeanAndDeviation { mean: 2.0, deviation: 1.0 });
        assert_eq!(spread([4.0].into_iter()).unwrap(), MeanAndDeviation { mean: 4.0, deviation: 0.0 });
        assert_eq!(spread(std::iter::empty()), None);
    }

    #[test]
    fn a_gap_is_one_way_with_every_seed_and_twice_their_spread() {
        assert!(is_gap(&[0.10, 0.08, 0.12], true));
        assert!(!is_gap(&[0.10, 0.08, 0.12], false), "the ceiling is worse");
        assert!(is_gap(&[-0.10, -0.08, -0.12], false));
        assert!(!is_gap(&[0.10, -0.01, 0.12], true), "not with every seed");
        assert!(!is_gap(&[0.015, 0.023, 0.001], true), "little more than the spread");
        assert!(is_gap(&[0.01], true), "one seed has no spread");
        assert!(!is_gap(&[0.0], true) && !is_gap(&[f64::NAN], true) && !is_gap(&[], true));
    }
}

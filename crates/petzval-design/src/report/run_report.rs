//! From a run folder to its report: what was written during the run is gathered, and each lens traced again.

use std::collections::BTreeMap;
use std::path::Path;

use petzval_base::parameter::Parameter;
use petzval_base::{Cancel, counted, pasted};
use petzval_camera::psf::PsfBank;
use petzval_files::{LensFile, parse_lens};
use petzval_optics::analysis::first_order_table;
use petzval_optics::design_space::Variable;
use petzval_optics::glass::Catalog;
use petzval_optics::lens::Lens;
use petzval_optics::number::Number;
use petzval_optics::psf::FieldPsf;

use crate::error::{DesignError, Result};
use crate::experiment::{BlockName, DetectorInput, LensGoal, SameOf, Variant};
use crate::lens::numbers::{full_name, surface_name, unit_of};
use crate::lens::psf_plan::PsfPlan;
use crate::lens::view;
use crate::made_cameras::LeftOut;
use crate::report::attribution::attribution;
use crate::report::pictures::{frames, held_out, in_order, pictures};
use crate::run::{
    CameraMetrics, Event, Kept, MadeFigures, MadeMetrics, Metrics, RunFolder, RunRecord, SCORE, load_blocks,
    read_events, read_json, read_json_if_there,
};
use crate::run_progress::{self, is_scored, moved_part};
use crate::setup::Setup;
use crate::validation::VALIDATION;
use petzval_learn::score::{ScoreDescription, leading_score};
use petzval_report::design_report::{
    CameraView, Change, LossCurve, MadeCamera, MadeCameras, MadeScore, OneSeed, PsfView, Report, Score,
    ShortRun, TableRow,
};

/// Fields whose PSFs the report shows, as indices into the experiment's fields in quarters of the field.
const SHOWN_QUARTERS: [usize; 5] = [0, 1, 2, 3, 4];

/// Highest frequency of modulation transfer functions, over half a cycle a pixel.
const SHOWN_OF_NYQUIST: f64 = 1.2;

/// Fields of the rays in the layouts and of the modulation transfer functions, as shares of the full field.
const LAYOUT_SHARES: [f64; 3] = [0.0, 0.5, 1.0];

/// The lens of a finished camera.
pub fn camera_lens(run: &RunFolder, camera: &str) -> Result<LensFile> {
    let path = run.camera(camera).join("lens.toml");
    let text = petzval_base::read_text(&path).map_err(DesignError::io(&path))?;
    // A lens that we wrote carries its glasses with it.
    parse_lens(&text, &Catalog::default()).map_err(DesignError::input(&path))
}

/// The figures of a finished run.
pub fn read_metrics(run: &RunFolder) -> Result<Metrics> {
    let path = run.metrics();
    if !path.is_file() {
        let problem =
            format!("the run is not finished; go on with `petzval design --resume {}`", pasted(run.root()));
        return Err(DesignError::Run { path, problem });
    }
    read_json(&path)
}

/// Gathers everything that a report shows.
pub fn report_of_run(setup: &Setup, run: &RunFolder, command_line: &str) -> Result<Report> {
    let metrics = read_metrics(run)?;
    let events = read_events(&run.events())?;
    let mut lenses = Vec::new();
    for variant in &setup.variants {
        lenses.push((variant, camera_lens(run, &variant.name)?.lens));
    }
    let moves_exposure = |variant: &Variant| setup.task_steps(variant, BlockName::Exposure) > 0;
    let exposure = match setup.experiment.exposure.same {
        _ if setup.variants.iter().any(moves_exposure) => "exposures of their own",
        SameOf::Time => "the same exposure time",
        SameOf::Electrons => "the same exposure",
    };
    let subtitle = format!(
        "{} with {exposure} ({} e- of white) and the same order of the data. Scored on {}.",
        cameras_in_words(setup, &events),
        metrics.electrons_of_white(),
        metrics.scored_on()
    );
    let report = gathered(setup, run, &metrics, events, &lenses)?;
    let subtitle = match report.short {
        Some(short) => format!("{subtitle} The run was made short: {}.", short.in_words()),
        None => subtitle,
    };
    let one_seed = match metrics.seeds[..] {
        [seed] => Some(match &setup.study {
            Some(study) => OneSeed::Studied(study.in_scores(&metrics.scores)),
            None => OneSeed::Alone(seed),
        }),
        _ => None,
    };
    Ok(Report { subtitle, command_line: command_line.to_owned(), one_seed, ..report })
}

/// The report of an unfinished run: its finished cameras with their figures, and the lens of the camera at work.
pub fn report_so_far(setup: &Setup, run: &RunFolder, metrics: Metrics) -> Result<Report> {
    let events = if run.events().is_file() { read_events(&run.events())? } else { Vec::new() };
    let at_work = run_progress::at_work(setup, &events);
    // A run that was extended has earlier figures of the camera at work.
    let is_at_work = |camera: &str| at_work.is_some_and(|variant| variant.name == camera);
    let rows = metrics.rows.into_iter().filter(|row| !is_at_work(&row.camera)).collect();
    let metrics = Metrics { rows, ..metrics };
    let mut lenses = Vec::new();
    for variant in &setup.variants {
        if is_scored(&metrics, variant) {
            lenses.push((variant, camera_lens(run, &variant.name)?.lens));
        } else if is_at_work(&variant.name) {
            let lens = run_progress::latest_lens(run, variant, &events)?;
            lenses.extend(lens.map(|lens| (variant, lens)));
        }
    }
    let progress = run_progress::progress(setup, run, &metrics, &events);
    let subtitle = format!("{} of {} cameras are scored.", metrics.rows.len(), setup.variants.len());
    let report = gathered(setup, run, &metrics, events, &lenses)?;
    Ok(Report { subtitle, progress: Some(progress), ..report })
}

/// What a report shows of cameras with these lenses, without what is said above the first section.
fn gathered(
    setup: &Setup,
    run: &RunFolder,
    metrics: &Metrics,
    events: Vec<Event>,
    lenses: &[(&Variant, Lens)],
) -> Result<Report> {
    let record = RunRecord::read(run)?;
    let plan = &setup.fixed_plan;
    let full_rad = plan.field_angles(&setup.nominal().lens_file.lens)?.last().copied().unwrap_or(0.0);
    let layout_fields_deg = LAYOUT_SHARES.map(|share| (share * full_rad).to_degrees());
    // Half a cycle a pixel.
    let nyquist_per_mm = 1e3 / (2.0 * setup.body.sensor.pixel_um);
    let mut cameras = Vec::new();
    for (variant, lens) in lenses {
        cameras.push(CameraView {
            name: variant.name.clone(),
            first_order: first_order_table(lens),
            surfaces: view::surfaces(lens),
            layout: view::section(lens, &layout_fields_deg),
            mtf: view::modulation(
                lens,
                &layout_fields_deg,
                &plan.wavelengths_um,
                SHOWN_OF_NYQUIST * nyquist_per_mm,
            ),
            over_field: view::to_full_field(lens, full_rad, &plan.wavelengths_um),
            psfs: match setup.given_psfs() {
                Some(bank) => given_psf_views(bank, plan, lens),
                None => psf_views(&PsfPlan { perfect_image: variant.perfect_image, ..plan.clone() }, lens)?,
            },
            changes: if variant.moves_lens() {
                changes(&setup.start(variant).lens_file, lens)
            } else {
                Vec::new()
            },
            setting_changes: if is_scored(metrics, variant) {
                setting_changes(setup, variant, run)?
            } else {
                Vec::new()
            },
            attribution: attribution(
                setup.start(variant),
                events.iter().filter(|e| e.camera == variant.name),
            ),
        });
    }
    let e = &setup.experiment;
    let mut of_task = setup.task.report(setup, run, metrics)?;
    let report = Report {
        title: e.name.clone(),
        subtitle: String::new(),
        command_line: String::new(),
        scores: view_of_scores(&metrics.scores),
        table: metrics.rows.iter().map(|m| row(&metrics.scores, m)).collect(),
        cameras,
        layout_fields_deg: layout_fields_deg.to_vec(),
        reference_um: setup.nominal().lens_file.lens.reference_um,
        wavelengths_um: plan.wavelengths_um.to_vec(),
        half_diagonal_mm: setup.corner_mm(),
        nyquist_per_mm,
        held_out: held_out(metrics, &of_task),
        pictures: Vec::new(),
        left_out: None,
        frames: frames(run, &setup.variants)?,
        has_isp: setup.body.chip.is_some(),
        pictures_in_all: metrics.held_out_images * metrics.held_out_places,
        one_seed: None,
        task: std::mem::take(&mut of_task.part),
        short: short_run(setup, record.as_ref()),
        warnings: warnings(setup, metrics),
        progress: None,
        made: MadeMetrics::read(run)?.map(|made| made_view(&metrics.scores, made)),
        losses: loss_curves(events),
        config_toml: match &record {
            Some(record) => record.config.to_toml()?,
            None => petzval_base::read_text(run.config()).map_err(DesignError::io(&run.config()))?,
        },
        environment: [record.map_or_else(Vec::new, |r| r.facts()), environment(&run.environment())?].concat(),
        notes: if metrics.rows.is_empty() { Vec::new() } else { notes(setup, metrics) },
    };
    let pictures = pictures(run, metrics, &of_task, &report);
    Ok(Report { left_out: pictures.left_out(), pictures: pictures.shown, ..report })
}

/// The steps of a run that a request has made shorter than its experiment; none of any other, nor where the run was extended since.
fn short_run(setup: &Setup, record: Option<&RunRecord>) -> Option<ShortRun> {
    let (record, usual) = record.and_then(|record| Some((record, record.usual_steps?)))?;
    let steps = record.config.most_steps(setup.facts.network);
    (steps < usual).then_some(ShortRun { steps, usual })
}

/// What a reader must know beside the table: light that the PSFs cut off, and scores without a value.
fn warnings(setup: &Setup, metrics: &Metrics) -> Vec<String> {
    let lost = metrics.rows.iter().filter_map(|m| lost_light(setup, m));
    let missing = metrics.missing_values().map(|words| format!("The table has {words}."));
    lost.chain(missing).collect()
}

/// The warning of a camera whose PSFs are wider than their grid. Given PSFs are those of a file.
fn lost_light(setup: &Setup, camera: &CameraMetrics) -> Option<String> {
    let lost = setup.experiment.psf.lost_light(camera.psf_captured, None)?;
    Some(format!("{}: {}; a larger psf.pitch_um holds more.", camera.camera, lost.replace(" um ", " µm ")))
}

/// `3 cameras: nominal (800 network steps), ...`, with the steps that were taken.
fn cameras_in_words(setup: &Setup, events: &[Event]) -> String {
    let moved = |block: BlockName| match block {
        BlockName::Network => setup.facts.network_name,
        block => moved_part(block.name()),
    };
    let one = |v: &Variant| {
        let taken = |block: &str| events.iter().filter(|e| e.camera == v.name && e.block == block).count();
        let steps = |block: BlockName| match taken(block.name()) {
            0 => None,
            n => Some(counted(n, &format!("{} step", moved(block)))),
        };
        let alone = LensGoal::ALL.into_iter().filter(|goal| taken(goal.event()) > 0);
        let alone = alone.map(|goal| goal.in_words().to_owned());
        let from = v.from.as_ref().map(|name| format!("from {name}"));
        let sees =
            (v.sees == DetectorInput::Truth).then(|| "sees the scenes without blur and noise".to_owned());
        let own = BlockName::ALL.into_iter().filter_map(steps);
        let all: Vec<String> = from.into_iter().chain(sees).chain(alone).chain(own).collect();
        format!("{} ({})", v.name, all.join(", "))
    };
    let list: Vec<String> = setup.variants.iter().map(one).collect();
    format!("{}: {},", counted(list.len(), "camera"), list.join(", "))
}

/// PSFs at the shown fields, with their RMS radii.
fn psf_views(plan: &PsfPlan, lens: &Lens) -> Result<Vec<PsfView>> {
    let psfs = plan.psfs(lens, &Cancel::default())?;
    let last = psfs.len() - 1;
    let shown = SHOWN_QUARTERS.map(|q| &psfs[(q * last + 2) / 4]);
    let view = |psf: &&FieldPsf| {
        let spot = view::at_fields(lens, &[psf.field_rad], &plan.wavelengths_um);
        PsfView::new(psf, &plan.options, spot.first().map_or(f64::NAN, |s| s.rms_um))
    };
    Ok(shown.iter().filter_map(view).collect())
}

/// PSFs of a file at the shown fields, with their RMS radii; the field angles are those of the lens.
fn given_psf_views(bank: &PsfBank, plan: &PsfPlan, lens: &Lens) -> Vec<PsfView> {
    let (cells, last) = (bank.grid * bank.grid, bank.field_radius_mm.len() - 1);
    let view = |field: usize| {
        let channel = |c: usize| -> Vec<f64> {
            bank.values[(3 * field + c) * cells..][..cells].iter().map(|value| f64::from(*value)).collect()
        };
        let values = [channel(0), channel(1), channel(2)];
        let light = &bank.illumination[3 * field..][..3];
        Some(PsfView {
            field_deg: plan.field_angle(lens, bank.field_radius_mm[field]).ok()?.to_degrees(),
            chief_y_mm: bank.field_radius_mm[field],
            grid: bank.grid,
            pitch_um: bank.pitch_um,
            rms_um: rms_radius_um(&values, bank.grid, bank.pitch_um),
            values,
            illumination: f64::from(light.iter().sum::<f32>()) / 3.0,
        })
    };
    let mut shown: Vec<usize> = SHOWN_QUARTERS.iter().map(|q| (q * last + 2) / 4).collect();
    shown.dedup();
    // The lens as drawn may not reach as far as the PSFs.
    shown.into_iter().filter_map(view).collect()
}

/// RMS radius of PSFs of unit sum about the common centroid of the channels, um.
fn rms_radius_um(channels: &[Vec<f64>; 3], grid: usize, pitch_um: f64) -> f64 {
    let moment = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        let at = |i: usize| (i as f64 - 0.5 * (grid as f64 - 1.0)) * pitch_um;
        let cells = channels.iter().flat_map(|psf| psf.iter().enumerate());
        cells.map(|(i, light)| light * of(at(i % grid), at(i / grid))).sum::<f64>() / 3.0
    };
    let (x, y) = (moment(&|x, _| x), moment(&|_, y| y));
    moment(&|a, b| (a - x).powi(2) + (b - y).powi(2)).sqrt()
}

fn notes(setup: &Setup, metrics: &Metrics) -> Vec<String> {
    let by_camera = |f: &dyn Fn(&CameraMetrics) -> String| {
        metrics.rows.iter().map(|m| format!("{} {}", m.camera, f(m))).collect::<Vec<_>>().join(", ")
    };
    let definitions: Vec<String> =
        metrics.scores.iter().map(|s| format!("{}, {}", s.title, s.definition)).collect();
    vec![
        format!("Scores: {}.", definitions.join("; ")),
        "RMS spot: mean over the fields, all wavelengths together about their common centroid, through the real stop, \
         each ray weighed by its light."
            .to_owned(),
        format!(
            "Field of view: twice the field whose chief ray lands in the sensor's corner. Distortion at the corner: {}.",
            by_camera(&|m| format!("{:+.1} %", m.corner_distortion_percent))
        ),
        format!(
            "Least share of a PSF's light that its grid holds: {}.",
            by_camera(&|m| format!("{:.1} %", 100.0 * m.psf_captured))
        ),
        format!(
            "{}; the noise of scored pictures is exact Poisson and the same for every camera. {}",
            match setup.given_psfs() {
                Some(_) => "Every camera has the PSFs of a file, which take its pictures; RMS spots, MTFs and angles are those of the lens as drawn, traced exactly",
                None => "Lenses are traced exactly",
            },
            if setup.experiment.sees_streets(&setup.facts) { "Streets are seen through the chief rays of each lens, distortion included." } else { "Distortion is not rendered: each place gets the PSF of the field whose chief ray lands there." }
        ),
    ]
}

/// The table of cameras as they are made.
fn made_view(scores: &[ScoreDescription], made: MadeMetrics) -> MadeCameras {
    // A score of objects of which the pictures hold none has no figures.
    let score = |figures: Option<&MadeFigures>| MadeScore {
        drawn: figures.and_then(|f| f.drawn).unwrap_or(f64::NAN),
        mean: figures.and_then(|f| f.mean).unwrap_or(f64::NAN),
        of_90_percent: figures.and_then(|f| f.of_90_percent).unwrap_or(f64::NAN),
        share: figures.map_or(f64::NAN, |f| f.share),
    };
    let rows = made.rows.iter().map(|row| MadeCamera {
        camera: row.camera.clone(),
        failed: row.trials.iter().filter(|trial| trial.is_none()).count(),
        scores: scores.iter().map(|s| score(row.scores.get(&s.name))).collect(),
    });
    let focus = if made.is_refocused { ", focused again" } else { "" };
    let knowledge = if made.is_calibrated {
        "Each is calibrated: development corrects shading and blur by the lens as made."
    } else {
        "None is calibrated: development corrects shading and blur by the lens as drawn."
    };
    let left_out = LeftOut { tolerances: made.left_out, compensators: made.compensators_left_out };
    let left_out = left_out.in_words().map_or_else(String::new, |words| format!(" {words}."));
    let conditions = format!(
        "{} of each design with lenses made at random by their tolerances ({}){focus}, with the network or ISP that was designed for \
         the lens as drawn. {knowledge} Means over {}, for the camera as drawn too, so that they differ from those above. The limit is \
         the score of the first camera as drawn, unless another was given.{left_out}",
        counted(made.trials, "camera"),
        made.tolerances,
        counted(made.pictures, "held-out picture")
    );
    MadeCameras { conditions, limits: in_order(scores, &made.limits), rows: rows.collect() }
}

fn row(scores: &[ScoreDescription], m: &CameraMetrics) -> TableRow {
    TableRow {
        camera: m.camera.clone(),
        scores: in_order(scores, &m.scores),
        is_ceiling: m.is_ceiling,
        restored_error_percent: m.restored_error_percent.unwrap_or(f64::NAN),
        rms_spot_um: m.rms_spot_um,
        efl_mm: m.efl_mm,
        f_number: m.f_number,
        fov_deg: m.fov_deg,
        corner_light_percent: m.corner_light_percent.unwrap_or(f64::NAN),
        steps: m.network_steps.max(m.isp_steps),
    }
}

fn view_of_scores(scores: &[ScoreDescription]) -> Vec<Score> {
    let leading = leading_score(scores.iter().map(|score| score.name.as_str()));
    let score = |(i, of): (usize, &ScoreDescription)| Score {
        title: of.title.clone(),
        unit: of.unit.clone(),
        decimals: of.decimals,
        higher_is_better: of.higher_is_better,
        leads: i == leading,
    };
    scores.iter().enumerate().map(score).collect()
}

/// What moved of a camera's exposure and of its hardware ISP, before and after.
fn setting_changes(setup: &Setup, variant: &Variant, run: &RunFolder) -> Result<Vec<Change>> {
    // Mapping to 0..1 and back rounds: values are compared only for blocks that moved.
    let moves = |block: BlockName| setup.task_steps(variant, block) > 0;
    if ![BlockName::Exposure, BlockName::Isp].into_iter().any(moves) {
        return Ok(Vec::new());
    }
    let mut blocks = setup.blocks(variant)?;
    load_blocks(&run.camera(&variant.name), blocks.all_mut(), Kept::Numbers)?;
    let exposure = blocks.exposure.changes().filter(|_| moves(BlockName::Exposure));
    let exposure = exposure.map(|(about, from, to)| (about.name, about, from, to));
    let isp = blocks.isp.changes().into_iter().filter(|_| moves(BlockName::Isp));
    let isp = isp.map(|(parameter, from, to)| (parameter.name.as_str(), &parameter.about, from, to));
    let change = |(name, about, from, to): (&str, &Parameter, f64, f64)| Change {
        parameter: name.to_owned(),
        from,
        to,
        unit: about.unit.to_owned(),
        min: about.min,
        max: about.max,
    };
    Ok(exposure.chain(isp).filter(|(_, _, from, to)| from != to).map(change).collect())
}

/// The variables, before and after, and the radius that keeps the focal length.
fn changes(nominal: &LensFile, after: &Lens) -> Vec<Change> {
    let (before, variables) = (&nominal.lens, &nominal.variables);
    let change = |v: &Variable| {
        // A surface that may be flat has no bounds of its radius: its curvature has.
        if v.number == Number::Curvature && v.min < 0.0 && v.max > 0.0 {
            return Change {
                parameter: format!("{}: curvature", surface_name(before, v.surface)),
                from: v.number.read(before, v.surface),
                to: v.number.read(after, v.surface),
                unit: "mm^-1".to_owned(),
                min: 1.0 / v.min,
                max: 1.0 / v.max,
            };
        }
        Change {
            parameter: full_name(before, v.surface, v.number),
            from: v.number.read_stated(before, v.surface),
            to: v.number.read_stated(after, v.surface),
            unit: unit_of(v.number),
            min: v.min,
            max: v.max,
        }
    };
    let mut all: Vec<Change> = variables.iter().map(change).collect();
    for (i, (a, b)) in before.surfaces.iter().zip(&after.surfaces).enumerate() {
        let listed = |p| variables.iter().any(|v| v.surface == i && v.number == p);
        for number in [Number::Curvature, Number::Thickness] {
            let (from, to) = (number.read_stated(before, i), number.read_stated(after, i));
            let moved = a.shape.curvature != b.shape.curvature || number == Number::Thickness;
            if moved && from != to && !listed(number) {
                let solved = nominal.solves().curvature();
                let solved = solved.filter(|(surface, _)| *surface == i && number == Number::Curvature);
                let bounds = solved.and_then(|(_, radius_mm)| radius_mm);
                let [min, max] = bounds.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
                all.push(Change {
                    parameter: format!("{} (follows)", full_name(before, i, number)),
                    from,
                    to,
                    unit: unit_of(number),
                    min,
                    max,
                });
            }
        }
    }
    all
}

fn loss_curves(events: Vec<Event>) -> Vec<LossCurve> {
    type Key = (String, String, String);
    let mut curves: BTreeMap<Key, Vec<(u64, f64)>> = BTreeMap::new();
    let mut counts: BTreeMap<(String, String), u64> = BTreeMap::new();
    for event in events {
        if event.block == SCORE {
            continue;
        }
        // Each block counts its own steps, so that cameras can be laid over each other.
        let count = counts.entry((event.camera.clone(), event.block.clone())).or_default();
        *count += 1;
        for (name, value) in event.losses {
            let key = (event.camera.clone(), event.block.clone(), name);
            curves.entry(key).or_default().push((*count, value));
        }
    }
    curves
        .into_iter()
        // A penalty that was never due is no curve.
        .filter(|(_, points)| points.iter().any(|(_, value)| *value != 0.0))
        .map(|((camera, block, name), points)| LossCurve {
            camera,
            block: moved_part(&block).to_owned(),
            label: loss_in_words(&name),
            points,
        })
        .collect()
}

/// The name of a loss as an axis has it, with its unit.
fn loss_in_words(name: &str) -> String {
    match name {
        "total" => "loss, sum of all terms".to_owned(),
        "l1" => "L1 distance".to_owned(),
        "lpips" => "LPIPS".to_owned(),
        "class" => "loss of the classes".to_owned(),
        "box" => "loss of the boxes".to_owned(),
        "proposal_box" => "loss of the proposed boxes".to_owned(),
        "objectness" => "loss of the proposals".to_owned(),
        "centredness" => "loss of the centredness".to_owned(),
        VALIDATION => "loss of the validation".to_owned(),
        "penalty_mm2" => "violation of the requirements, mm²".to_owned(),
        "rms_spot_um" => "RMS spot radius, µm".to_owned(),
        "restored_error_percent" => "error after restoration, % of white".to_owned(),
        "imitation_error" => "error of the network that imitates the ISP".to_owned(),
        "imitation_psnr_db" => "PSNR of that network against the ISP, dB".to_owned(),
        "imitation_gradient_cosine" => {
            "cosine between the gradients of ISP and network, a tenth of every range beside the parameters"
                .to_owned()
        }
        other => match other.strip_prefix("imitation_gap_") {
            Some(score) => format!("score of the ISP less that of the network: {}", score.replace('_', " ")),
            None => other.replace('_', " "),
        },
    }
}

fn environment(path: &Path) -> Result<Vec<(String, String)>> {
    let values: Option<BTreeMap<String, serde_json::Value>> = read_json_if_there(path)?;
    let plain = |v: serde_json::Value| match v {
        serde_json::Value::String(s) => s,
        other => other.to_string(),
    };
    Ok(values.unwrap_or_default().into_iter().map(|(k, v)| (k, plain(v))).collect())
}

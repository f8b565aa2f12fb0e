//! Lens and glass jobs called as a program other than the command calls them.

use std::fmt::Debug;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use petzval_base::Cancel;
use petzval_jobs::lens::{FocusAt, convert, optimize, show, tolerance, trace};
use petzval_jobs::{Context, Event, Fault, JobError, Silent, Watcher, built_in_assets, glass};
use petzval_optics::psf::PsfKind;
use serde::Serialize;
use serde::de::DeserializeOwned;

const LENS: &str = "cooke-triplet-nominal";

/// A window: a lens without focal length, f-number and paraxial image.
const AFOCAL: &str = r#"
name = "window"
source = "a test"
units = "mm"
[aperture]
entrance_pupil_diameter_mm = 10.0
[object]
distance_mm = inf
[wavelengths]
um = [0.55]
reference_um = 0.55
[fields]
angle_deg = [0.0, 1.0]
[[surface]]
label = "front"
stop = true
glass = "N-BK7"
radius_mm = inf
thickness_mm = 3.0
semi_diameter_mm = 5.5
[[surface]]
label = "back"
radius_mm = inf
thickness_mm = 20.0
semi_diameter_mm = 6.0
"#;

fn context() -> Context {
    Context::new(built_in_assets(), Arc::new(Silent))
}

/// Writes a value as JSON, reads it again, and compares.
fn survives_json<T: Serialize + DeserializeOwned + PartialEq + Debug>(value: &T) {
    let text = serde_json::to_string(value).unwrap();
    assert_eq!(serde_json::from_str::<T>(&text).unwrap(), *value);
}

/// Requests and responses of a job, both through JSON.
fn run<Request, Response>(
    job: impl Fn(&Request, &Context) -> Result<Response, JobError>,
    request: Request,
) -> Response
where
    Request: Serialize + DeserializeOwned + PartialEq + Debug,
    Response: Serialize + DeserializeOwned + PartialEq + Debug,
{
    survives_json(&request);
    let response = job(&request, &context()).unwrap();
    survives_json(&response);
    response
}

fn optimize_request(folder: &std::path::Path, global: bool) -> optimize::Request {
    optimize::Request {
        start: optimize::Start::New {
            lens: LENS.into(),
            out: folder.join("run"),
            goal: Box::new(optimize::Goal { wavelengths: vec![0.5876], ..optimize::Goal::default() }),
            global,
            seed: 1,
        },
        iterations: (!global).then_some(3),
        rounds: global.then_some(1000),
        seconds: None,
        trade: false,
    }
}

fn tolerance_request(folder: &std::path::Path) -> tolerance::Request {
    tolerance::Request {
        lens: LENS.into(),
        tolerances: None,
        grade: Some(tolerance::Grade::Commercial),
        merit: tolerance::Merit::Rms,
        frequency: 40.0,
        kind: PsfKind::Geometric,
        trials: 5,
        part: None,
        compensate: tolerance::Compensate::Focus,
        limit: Some(14.0),
        inverse: None,
        seed: 1,
        list_trials: true,
        worst: 1,
        out: Some(folder.join("made")),
    }
}

#[test]
fn requests_and_responses_survive_json() {
    let folder = tempfile::tempdir().unwrap();
    let window = folder.path().join("window.toml");
    std::fs::write(&window, AFOCAL).unwrap();
    for lens in [LENS.to_owned(), window.display().to_string()] {
        let shown = run(show::run, show::Request { lens: lens.into(), focus: FocusAt::File });
        assert_eq!(shown.figures.efl_mm.is_some(), shown.figures.name != "window");
    }
    // A ray that arrives and one that is lost.
    for py in [0.5, 9.0] {
        let pupil = vec![0.0, py];
        let request =
            trace::Request { lens: LENS.into(), field: 5.0, wavelength: 0.55, pupil, aim: trace::Aim::Real };
        assert_eq!(run(trace::run, request).image.is_some(), py < 1.0);
    }
    let to = folder.path().join("triplet.zmx");
    let converted = run(convert::run, convert::Request { from: LENS.into(), to: to.clone() });
    assert!(to.is_file() && !converted.losses_of_writing.is_empty());

    let descent = run(optimize::run, optimize_request(folder.path(), false));
    assert!(descent.found.lens.is_file());
    let made = run(tolerance::run, tolerance_request(folder.path()));
    // Figures, tolerances, a page, two tables, two pictures, and the worst lens.
    assert_eq!(made.files.len(), 8);
    assert!(made.files.iter().all(|file| file.is_file()));

    // AIR has no Abbe number.
    for name in ["N-BK7", "AIR"] {
        let request = glass::show::Request { name: name.to_owned(), temperature: None, pressure: None };
        assert_eq!(run(glass::show::run, request).glass.vd.is_some(), name != "AIR");
    }
    run(glass::list::run, glass::list::Request { maker: None });
    let near = glass::find::Request { nd: 1.5168, vd: 64.17, count: 3, maker: None, obsolete: false };
    assert_eq!(run(glass::find::run, near).glasses.len(), 3);
}

#[test]
fn a_random_lens_is_listed_and_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let request = tolerance_request(folder.path());
    let found = tolerance::run(&request, &context()).unwrap();
    let trials = found.trials.unwrap();
    assert_eq!((trials.lenses.len(), trials.compensators.len()), (5, 1));
    assert!(trials.lenses.iter().all(|lens| lens.errors.len() == trials.errors.len()));
    let random = found.report.monte_carlo.unwrap();
    let worst = &random.worst[0];
    assert_eq!(trials.lenses[worst.trial].merit, worst.merit);
    let lens = tolerance::lens_of_trial(&request, worst.trial, &context()).unwrap();
    let written =
        std::fs::read_to_string(folder.path().join(format!("made/lens-{:05}.toml", worst.trial))).unwrap();
    assert_eq!(petzval_files::write_lens(&lens), written);
    assert!(tolerance::lens_of_trial(&request, 5, &context()).is_err());
    let unlisted = tolerance::Request { list_trials: false, out: None, ..request };
    assert_eq!(tolerance::run(&unlisted, &context()).unwrap().trials, None);
}

#[test]
fn lenses_that_cannot_be_built_are_the_same_in_parts() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("thick.toml");
    let text = "distribution = \"uniform\"\n\n[[tolerance]]\nsurface = 1\nthickness_mm = 8.0\n";
    std::fs::write(&file, text).unwrap();
    let whole = tolerance::Request {
        tolerances: Some(file),
        grade: None,
        trials: 12,
        list_trials: false,
        out: None,
        ..tolerance_request(folder.path())
    };
    let found = tolerance::run(&whole, &context()).unwrap();
    let random = found.report.monte_carlo.as_ref().unwrap();
    assert!(
        random.unbuildable > 0 && random.unbuildable <= random.failed && random.failed < 12,
        "{random:?}"
    );
    let parts = [(0, 5), (5, 12)].map(|(from, to)| {
        let part = Some(tolerance::Part { from, to });
        tolerance::run(&tolerance::Request { part, ..whole.clone() }, &context()).unwrap()
    });
    assert_eq!(tolerance::join(&whole, &parts, &context()).unwrap(), found);
}

/// Keeps the last progress, and cancels the job at some unit of its work.
struct Canceller {
    at: u64,
    last: AtomicU64,
    cancel: Cancel,
}

impl Watcher for Canceller {
    fn event(&self, event: &Event) {
        let Event::Progress { done, .. } = event else { return };
        self.last.store(*done, Ordering::Relaxed);
        if *done == self.at {
            self.cancel.set();
        }
    }
}

/// The formula of germanium holds from 2 um on: it has no index at the d line.
#[test]
fn a_glass_has_no_figures_at_lines_beyond_its_formula() {
    let show = |name: &str| {
        let request = glass::show::Request { name: name.to_owned(), temperature: None, pressure: None };
        run(glass::show::run, request).glass
    };
    let germanium = show("GERMANIUM");
    assert!(germanium.range_um.unwrap()[0] > 1.0);
    assert_eq!(
        [germanium.nd, germanium.vd, germanium.n_f, germanium.n_c, germanium.p_gf, germanium.p_gf_anomaly],
        [None; 6]
    );
    let listed = run(glass::list::run, glass::list::Request { maker: None }).glasses;
    let [infrared, crown] =
        ["GERMANIUM", "N-BK7"].map(|name| listed.iter().find(|g| g.name == name).unwrap());
    assert_eq!((infrared.nd, infrared.vd, infrared.agrees_with_print), (None, None, None));
    assert!((crown.nd.unwrap() - 1.5168).abs() < 1e-5 && (crown.vd.unwrap() - 64.17).abs() < 0.01);
}

/// Keeps the notes that have figures, as the line and as JSON.
#[derive(Default)]
struct Figures(Mutex<Vec<(String, serde_json::Value)>>);

impl Watcher for Figures {
    fn event(&self, event: &Event) {
        if let Event::Note { figures, .. } = event
            && !figures.is_empty()
        {
            self.0.lock().unwrap().push((event.to_string(), serde_json::to_value(event).unwrap()));
        }
    }
}

#[test]
fn the_notes_of_an_optimisation_have_the_figures_of_their_lines_as_numbers() {
    for (is_global, count) in [(false, "iteration"), (true, "round")] {
        let folder = tempfile::tempdir().unwrap();
        let kept = Arc::new(Figures::default());
        // Programs that call jobs get events with keys in place of flags: the figures stay.
        let context = Context::new(built_in_assets(), kept.clone()).in_keys();
        let request = optimize_request(folder.path(), is_global);
        let request = optimize::Request { rounds: is_global.then_some(2), ..request };
        optimize::run(&request, &context).unwrap();
        let notes = kept.0.lock().unwrap();
        assert!(!notes.is_empty());
        for (i, (line, event)) in notes.iter().enumerate() {
            let figures = &event["figures"];
            let number = |name: &str| figures[name].as_f64().unwrap_or_else(|| panic!("{name}: {event}"));
            // A search begins with the lens at the start.
            let what = if is_global && i == 0 {
                assert!(figures[count].is_null(), "{event}");
                "start".to_owned()
            } else {
                format!("{count} {}", number(count))
            };
            let fields =
                figures.as_object().unwrap().keys().filter(|name| name.starts_with("rms_um_")).count();
            let spots: Vec<String> =
                (1..=fields).map(|field| format!("{:.2}", number(&format!("rms_um_{field}")))).collect();
            let (seconds, merit, mean) = (number("seconds"), number("merit_um"), number("mean_rms_um"));
            let whole = format!(
                "{seconds:8.2} s  {what:<14} merit {merit:8.3} um  spots {mean:.3} um ({})",
                spots.join(" ")
            );
            assert!(fields > 1 && line.starts_with(&whole), "{line}\n{whole}");
            assert_eq!(number("violations") > 0.0, line.contains("; not kept: "), "{line}");
        }
    }
}

#[test]
fn a_cancelled_search_stops_after_its_round_with_what_it_found() {
    let folder = tempfile::tempdir().unwrap();
    let cancel = Cancel::default();
    let canceller = Arc::new(Canceller { at: 1, last: AtomicU64::new(0), cancel: cancel.clone() });
    let context = Context::new(built_in_assets(), canceller.clone()).with_cancellation(cancel);
    let error = optimize::run(&optimize_request(folder.path(), true), &context).unwrap_err();
    let JobError::Stopped(stopped) = error else { panic!("{error}") };
    let response: optimize::Response = serde_json::from_value(stopped.response.unwrap()).unwrap();
    assert!(response.found.steps > 0 && response.found.page.is_file());
    assert!(stopped.kept.contains(&response.found.lens), "{:?}", stopped.kept);
    assert_eq!(canceller.last.load(Ordering::Relaxed), 1);
    // What was cancelled can be continued.
    let request: optimize::Request = serde_json::from_value(stopped.resume.unwrap()).unwrap();
    let request = optimize::Request { rounds: Some(1), ..request };
    let continued = optimize::run(&request, &self::context()).unwrap();
    assert!(continued.found.best.mean_rms_spot_um <= 1.001 * response.found.best.mean_rms_spot_um);
}

#[test]
fn a_cancelled_tolerance_analysis_fails_as_a_job() {
    let folder = tempfile::tempdir().unwrap();
    let context = context();
    context.cancel().set();
    let error = tolerance::run(&tolerance_request(folder.path()), &context).unwrap_err();
    assert_eq!(error.fault(), Fault::Job);
    assert!(matches!(error, JobError::Stopped(_)) && error.to_string().contains("cancelled"), "{error}");
}

#[test]
fn wrong_settings_are_named_by_their_key() {
    let key = |error: JobError| match error {
        JobError::Setting { key, .. } => key,
        other => panic!("{other:?}"),
    };
    let glass = |temperature, pressure| {
        let request = glass::show::Request { name: "N-BK7".to_owned(), temperature, pressure };
        key(glass::show::run(&request, &context()).unwrap_err())
    };
    assert_eq!(glass(Some(1e9), None), "temperature");
    assert_eq!(glass(Some(20.0), Some(-1.0)), "pressure");
    assert_eq!(glass(None, Some(1.0)), "pressure");
    let folder = tempfile::tempdir().unwrap();
    let request = optimize::Request { rounds: Some(0), ..optimize_request(folder.path(), true) };
    assert_eq!(key(optimize::run(&request, &context()).unwrap_err()), "rounds");
    let request = tolerance::Request { trials: 2_000_000, ..tolerance_request(folder.path()) };
    assert_eq!(key(tolerance::run(&request, &context()).unwrap_err()), "trials");
}

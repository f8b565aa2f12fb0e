//! Random edits of a lens: none makes a job panic, and each state is a text that gives the same lens to the last bit.

use std::sync::Arc;

use petzval_jobs::{Call, Context, JobError, Silent, built_in_assets};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use serde_json::{Value, json};

/// Edits that are tried: ten thousand where other readers are fed many damaged files as well, in `cargo xtask full`.
fn edits() -> usize {
    if std::env::var_os("PETZVAL_MUTATIONS").is_some() { 10_000 } else { 1_000 }
}

/// Of so many states one is looked at, with its spots and its layout.
const LOOKED_AT: usize = 100;

fn context() -> Context {
    let context = Context::new(built_in_assets(), Arc::new(Silent));
    context.assets.catalog().unwrap();
    context
}

/// A number that a person may type: near a usual one, or far from any sense.
fn number(random: &mut StdRng, usual: f64) -> f64 {
    match random.random_range(0..12) {
        0 => 0.0,
        1 => -usual,
        2 => usual * 1e6,
        3 => usual * 1e-6,
        4 => [1e308, -1e308, 5e-324, f64::MAX, f64::EPSILON][random.random_range(0..5)],
        _ => usual * random.random_range(0.3..2.0),
    }
}

/// An edit of a lens with so many surfaces.
fn edit(random: &mut StdRng, surfaces: usize) -> Value {
    let surface = random.random_range(0..surfaces + 2);
    let flips = random.random_range(0..2) == 0;
    let parameter = ["radius_mm", "thickness_mm", "conic", "a4", "semi_diameter_mm", "", "tilt_x_deg"];
    let parameter = parameter[random.random_range(0..parameter.len())];
    let glass = ["N-BK7", "SF5", "AIR", "", "SCHOTT:N-SK16", "nothing", "N-LASF9"][random.random_range(0..7)];
    let n = |random: &mut StdRng, usual: f64| number(random, usual);
    match random.random_range(0..22) {
        0 => json!({"edit": "radius", "surface": surface, "radius_mm": n(random, 30.0)}),
        1 => json!({"edit": "radius", "surface": surface, "radius_mm": null}),
        2 => json!({"edit": "curvature", "surface": surface, "curvature_per_mm": n(random, 0.02)}),
        3 => {
            json!({"edit": "sag", "surface": surface, "height_mm": n(random, 8.0), "sag_mm": n(random, 1.0)})
        }
        4 => json!({"edit": "bend", "surface": surface, "by_per_mm": n(random, 0.003)}),
        5 => json!({"edit": "conic", "surface": surface, "conic": n(random, 0.5)}),
        6 => {
            let power = random.random_range(0..20);
            json!({"edit": "asphere", "surface": surface, "power": power, "value": n(random, 1e-6)})
        }
        7 | 8 => json!({"edit": "thickness", "surface": surface, "thickness_mm": n(random, 4.0)}),
        9 => json!({"edit": "semi-diameter", "surface": surface, "semi_diameter_mm": n(random, 8.0)}),
        10 => json!({"edit": "glass", "surface": surface, "glass": glass}),
        11 => json!({"edit": "label", "surface": surface, "label": "π \" \\ \n x"}),
        12 => json!({"edit": "stop", "surface": surface}),
        13 => json!({"edit": "insert", "before": surface}),
        14 => json!({"edit": "delete", "surface": surface}),
        15 => json!({"edit": "aperture", "entrance_pupil_mm": n(random, 10.0)}),
        16 => json!({"edit": "fields", "fields_deg": [n(random, 20.0), 0.0, n(random, 14.0)]}),
        17 => {
            let um = [n(random, 0.5), n(random, 0.6)];
            json!({"edit": "wavelengths", "wavelengths_um": um, "reference_um": um[usize::from(flips)]})
        }
        18 => {
            json!({"edit": "object", "distance_mm": if flips { json!(null) } else { json!(n(random, 1e3)) }})
        }
        19 => {
            let at = ["paraxial", "best"][usize::from(flips)];
            if random.random_range(0..3) == 0 {
                json!({"edit": "scale-to", "efl_mm": n(random, 50.0)})
            } else {
                json!({"edit": "focus", "at": at})
            }
        }
        20 if flips => {
            json!({"edit": "vary", "surface": surface, "parameter": parameter, "min": n(random, 10.0), "max": n(random, 90.0)})
        }
        20 => json!({"edit": "vary", "surface": surface, "parameter": parameter}),
        _ if flips => json!({"edit": "hold", "surface": surface, "parameter": parameter}),
        _ => json!({"edit": "solve-efl", "surface": if surface == 0 { json!(null) } else { json!(surface) }}),
    }
}

/// Runs a job that may refuse, and must not panic.
fn run(context: &Context, job: &str, request: &Value) -> Result<Value, JobError> {
    let result = Call::new(job, request.clone()).run(context);
    if let Err(error @ JobError::Panic { .. }) = &result {
        panic!("{error}\n{job} {request}");
    }
    result
}

#[test]
fn mutations_of_a_lens_never_panic_and_every_state_is_its_text_to_the_bit() {
    let tried = edits();
    let context = context();
    let read = |lens: Value| {
        run(&context, "lens-edit", &json!({"lens": lens})).unwrap()["text"].as_str().unwrap().to_owned()
    };
    let first = read(json!("cooke-triplet-nominal"));
    let mut states = vec![first.clone()];
    let mut random = StdRng::seed_from_u64(7);
    let (mut taken, mut looked) = (0, 0);
    for i in 0..tried {
        let present = states.last().unwrap();
        let surfaces = present.matches("[[surface]]").count();
        let edits: Vec<Value> = (0..random.random_range(1..3)).map(|_| edit(&mut random, surfaces)).collect();
        let request = json!({"lens": {"toml": present}, "edits": edits});
        match run(&context, "lens-edit", &request) {
            Ok(response) => {
                let text = response["text"].as_str().unwrap().to_owned();
                // Reading a state and writing it again gives its text: undo to a text is undo to the bit.
                assert_eq!(read(json!({"toml": text})), text, "{request}");
                states.push(text);
                taken += 1;
            }
            Err(error) => {
                let report = error.report();
                assert!(!report.message.is_empty() && report.kind != "failed", "{request}: {error}");
            }
        }
        if i % LOOKED_AT == 0 {
            let request =
                json!({"lens": {"toml": states.last().unwrap()}, "quick": true, "max_frequency": 50});
            looked += usize::from(run(&context, "lens-view", &request).is_ok());
        }
        // A lens that has become absurd refuses nearly everything: go back, as a person would.
        if random.random_range(0..6) == 0 {
            let back = random.random_range(1..8).min(states.len() - 1);
            states.truncate(states.len() - back);
        }
    }
    assert!(taken > tried / 4 && looked > tried / LOOKED_AT / 2, "{taken} edits taken, {looked} looks");
    while states.len() > 1 {
        states.pop();
    }
    assert_eq!(read(json!({"toml": states.pop().unwrap()})), first);
}

#[test]
fn a_view_of_an_edit_is_the_view_of_the_edited_lens() {
    let context = context();
    let edits = json!([
        {"edit": "radius", "surface": 1, "radius_mm": 24.0},
        {"edit": "insert", "before": 3},
        {"edit": "vary", "surface": 1, "parameter": "radius_mm"},
        {"edit": "focus", "at": "best"},
    ]);
    let lens = "cooke-triplet-nominal";
    let at_once = run(&context, "lens-view", &json!({"lens": lens, "edits": edits})).unwrap();
    let edited = run(&context, "lens-edit", &json!({"lens": lens, "edits": edits})).unwrap();
    let mut later = run(&context, "lens-view", &json!({"lens": {"toml": edited["text"]}})).unwrap();
    assert_eq!(at_once["toml"], edited["text"]);
    later["losses_of_reading"] = at_once["losses_of_reading"].clone();
    assert_eq!(at_once, later);
    let surfaces = at_once["surfaces"].as_array().unwrap();
    assert_eq!(surfaces[0]["radius_mm"], 24.0);
    let varies = surfaces[0]["varies"].as_array().unwrap();
    assert!(varies.iter().any(|one| one["parameter"] == "radius_mm"), "{varies:?}");
    // The inserted plane halves the gap, and the other surfaces stay in place.
    assert_eq!(surfaces[1]["thickness_mm"], surfaces[2]["thickness_mm"]);
    assert!(surfaces[2]["radius_mm"].is_null());
}

#[test]
fn solves_follow_and_limits_are_named() {
    let context = context();
    let lens = "cooke-triplet-nominal";
    let before = run(&context, "lens-view", &json!({"lens": lens, "parts": ["layout"]})).unwrap();
    let last = before["surfaces"].as_array().unwrap().len();
    let edits = json!([
        {"edit": "solve-efl", "surface": last},
        {"edit": "curvature", "surface": 1, "curvature_per_mm": 0.05},
    ]);
    let after =
        run(&context, "lens-view", &json!({"lens": lens, "edits": edits, "parts": ["layout"]})).unwrap();
    let efl = |view: &Value| view["first_order"]["efl_mm"].as_f64().unwrap();
    assert!((efl(&after) / efl(&before) - 1.0).abs() < 1e-9);
    assert_eq!(after["surfaces"][last - 1]["settled"], json!(["radius_mm"]));
    assert!(after["spots"].as_array().unwrap().is_empty());
    let goal = json!({"track": 10.0});
    let limited =
        run(&context, "lens-view", &json!({"lens": lens, "goal": goal, "parts": ["layout"]})).unwrap();
    let named = limited["violations"].as_array().unwrap();
    assert!(
        named.iter().any(|v| v["what"] == "track" && v["excess_mm"].as_f64().unwrap() > 1.0),
        "{named:?}"
    );
}

#[test]
fn quick_and_exact_pictures_are_of_the_same_window_and_nearly_the_same() {
    let context = context();
    let request = |quick: bool| json!({"lens": "cooke-triplet-nominal", "size": [128, 128], "at": [0.7, 0.5], "quick": quick, "no_noise": true, "raw": true});
    let [quick, exact] = [true, false].map(|quick| run(&context, "camera-view", &request(quick)).unwrap());
    for key in ["height", "width", "placement", "array", "white_e"] {
        assert_eq!(quick[key], exact[key], "{key}");
    }
    let bytes = |view: &Value, key: &str| {
        use base64::Engine;
        base64::engine::general_purpose::STANDARD.decode(view[key].as_str().unwrap()).unwrap()
    };
    let (a, b) = (bytes(&quick, "rgb"), bytes(&exact, "rgb"));
    assert_eq!((a.len(), bytes(&exact, "raw").len()), (128 * 128 * 3, 128 * 128));
    let square = |(a, b): (&u8, &u8)| (f64::from(*a) - f64::from(*b)).powi(2);
    let rms = (a.iter().zip(&b).map(square).sum::<f64>() / a.len() as f64).sqrt();
    assert!(rms > 0.0 && rms < 6.0, "the quick picture differs by {rms}");
    // What is kept from call to call changes nothing.
    assert_eq!(run(&context, "camera-view", &request(false)).unwrap(), exact);
}

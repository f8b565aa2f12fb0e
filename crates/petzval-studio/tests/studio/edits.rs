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
    match random.random_range(0..26) {
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
        21 => {
            let of = random.random_range(0..surfaces + 2);
            let (scale, offset) = (n(random, 1.0), if flips { json!(null) } else { json!(n(random, 0.01)) });
            json!({"edit": "pickup", "surface": surface, "parameter": parameter, "of": of, "scale": scale, "offset": offset})
        }
        22 => json!({"edit": "field-weights", "weights": [n(random, 1.0), n(random, 2.0), n(random, 3.0)]}),
        23 if flips => json!({"edit": "solve-length", "surface": surface, "length_mm": n(random, 20.0)}),
        23 => json!({"edit": "solve-magnification", "surface": surface, "magnification": n(random, -0.1)}),
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
    assert_eq!(after["surfaces"][last - 1]["settled"][0]["parameter"], json!("radius_mm"));
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

/// The prescription after edits of the nominal triplet, and its text.
fn edited(context: &Context, edits: &Value) -> Result<Value, JobError> {
    let request = json!({"lens": "cooke-triplet-nominal", "edits": edits, "parts": ["layout"]});
    run(context, "lens-view", &request)
}

#[test]
fn pickups_and_solves_follow_every_edit_and_stay_in_the_text() {
    let context = context();
    let view = edited(
        &context,
        &json!([
            {"edit": "pickup", "surface": 4, "parameter": "radius_mm", "of": 3, "scale": -0.5, "offset": 0.001},
            {"edit": "solve-length", "surface": 4},
            {"edit": "curvature", "surface": 3, "curvature_per_mm": -0.03125},
            {"edit": "thickness", "surface": 2, "thickness_mm": 7.5},
        ]),
    )
    .unwrap();
    let rows = view["surfaces"].as_array().unwrap();
    let pickup =
        json!({"parameter": "radius_mm", "by": {"pickup": {"of": 3, "scale": -0.5, "offset": 0.001}}});
    assert_eq!(rows[3]["settled"][0], pickup);
    assert!((rows[3]["curvature_per_mm"].as_f64().unwrap() - 0.016625).abs() < 1e-15);
    // The followed radius varies from now on, and its bounds enclose the lens.
    let varies =
        rows[2]["varies"].as_array().unwrap().iter().find(|v| v["parameter"] == "radius_mm").unwrap();
    let [min, max] = ["min", "max"].map(|key| varies[key].as_f64().unwrap());
    assert!((min..=max).contains(&-32.0) && (min..=max).contains(&-39.57), "{min} {max}");
    // The length between the vertices is that of the lens before, and so is the focal length, which the file solves for.
    let track = |view: &Value| -> f64 {
        let rows = view["surfaces"].as_array().unwrap();
        rows[..rows.len() - 1].iter().map(|row| row["thickness_mm"].as_f64().unwrap()).sum()
    };
    let before = edited(&context, &json!([])).unwrap();
    assert!((track(&view) - track(&before)).abs() < 1e-12);
    assert_eq!(rows[3]["settled"][1]["parameter"], "thickness_mm");
    let length_mm = rows[3]["settled"][1]["by"]["length"]["length_mm"].as_f64().unwrap();
    assert!((length_mm - track(&before)).abs() < 1e-12);
    let efl_mm = before["surfaces"][6]["settled"][0]["by"]["efl"]["efl_mm"].as_f64().unwrap();
    assert!((view["first_order"]["efl_mm"].as_f64().unwrap() - efl_mm).abs() < 1e-9);
    // The text holds all of it: what is read again is the same, and a number that is held follows nothing.
    let toml = &view["toml"];
    let again = run(&context, "lens-view", &json!({"lens": {"toml": toml}, "parts": ["layout"]})).unwrap();
    assert_eq!((&again["toml"], &again["surfaces"]), (toml, &view["surfaces"]));
    let held = json!([
        {"edit": "hold", "surface": 4, "parameter": "radius_mm"},
        {"edit": "solve-length", "surface": null},
        {"edit": "solve-efl", "surface": null},
        {"edit": "curvature", "surface": 3, "curvature_per_mm": -0.03},
    ]);
    let request = json!({"lens": {"toml": toml}, "edits": held, "parts": ["layout"]});
    let held = run(&context, "lens-view", &request).unwrap();
    assert_eq!(held["surfaces"][3]["curvature_per_mm"], rows[3]["curvature_per_mm"]);
    assert!(held["surfaces"].as_array().unwrap().iter().all(|row| row["settled"] == json!([])));
    // A near object has a magnification to hold.
    let near = json!([
        {"edit": "object", "distance_mm": 400.0},
        {"edit": "solve-magnification", "surface": 7, "magnification": -0.07},
        {"edit": "curvature", "surface": 6, "curvature_per_mm": 0.064},
    ]);
    let near = edited(&context, &near).unwrap();
    assert!((near["first_order"]["magnification"].as_f64().unwrap() + 0.07).abs() < 1e-9);
    assert_eq!(near["surfaces"][6]["settled"][0]["by"]["magnification"]["magnification"], -0.07);
    // The offset of a tilt is stated in degrees, and comes back so: 1 and 0.5 are 1.5 degrees.
    let mut tilted = before["toml"].as_str().unwrap().to_owned();
    for label in ["label = \"V2 front\"\n", "label = \"V2 rear\"\n"] {
        tilted = tilted.replace(label, &format!("{label}placement = {{ tilt_deg = [1.0, 0.0, 0.0] }}\n"));
    }
    let pickup = json!([{"edit": "pickup", "surface": 4, "parameter": "tilt_x_deg", "of": 3, "offset": 0.5}]);
    let request = json!({"lens": {"toml": tilted}, "edits": pickup, "parts": ["layout"]});
    let row = run(&context, "lens-view", &request).unwrap()["surfaces"][3].clone();
    assert!(row["special"][0].as_str().unwrap().contains("tilt_deg = [1.5, 0.0, 0.0]"), "{row}");
    let offset_deg = row["settled"][0]["by"]["pickup"]["offset"].as_f64().unwrap();
    assert!((offset_deg - 0.5).abs() < 1e-15, "{offset_deg}");
}

#[test]
fn pickups_solves_and_weights_that_make_no_sense_are_refused() {
    let context = context();
    let pickup = |surface: usize, parameter: &str, of: usize| json!([{"edit": "pickup", "surface": surface, "parameter": parameter, "of": of}]);
    for (edits, said) in [
        (pickup(2, "radius_mm", 2), "cannot follow surface 2"),
        (pickup(7, "thickness_mm", 1), "last thickness"),
        (pickup(2, "radius_mm", 9), "no such surface"),
        (pickup(2, "radius_mm", 7), "radius_mm of surface 7 follows another or is solved for"),
        (json!([{"edit": "solve-length", "surface": 7}]), "length is that between the vertices"),
        (json!([{"edit": "solve-length", "surface": 2, "length_mm": 1.0}]), "thickness"),
        (json!([{"edit": "solve-magnification", "surface": 7}]), "no near object"),
        (json!([{"edit": "field-weights", "weights": [1, 2]}]), "the lens has 4 fields"),
        (json!([{"edit": "field-weights", "weights": [1, 2, -1, 1]}]), "a weight lies between 0 and 1000000"),
        (json!([{"edit": "field-weights", "weights": [0, 0, 0, 0]}]), "no field would count"),
    ] {
        let report = edited(&context, &edits).unwrap_err().report();
        assert!(report.message.contains(said) && !report.hint.is_empty(), "{edits}: {report:?}");
    }
}

#[test]
fn an_optimisation_keeps_pickups_bounds_and_weights_of_the_text() {
    let (folder, context) = (tempfile::tempdir().unwrap(), context());
    let optimised = |name: &str, edits: Value| -> (Value, String) {
        let text =
            run(&context, "lens-edit", &json!({"lens": "cooke-triplet-nominal", "edits": edits})).unwrap();
        let out = folder.path().join(name);
        let new = json!({"lens": {"toml": text["text"]}, "out": out});
        let request = json!({"start": {"new": new}, "iterations": 30});
        let response = run(&context, "lens-optimize", &request).unwrap();
        (response, std::fs::read_to_string(out.join("best.toml")).unwrap())
    };
    let rms = |response: &Value| -> Vec<f64> {
        let all = response["found"]["best"]["rms_spot_um"].as_array().unwrap();
        all.iter().map(|v| v.as_f64().unwrap()).collect()
    };
    let weights = |weights: [f64; 4]| json!([{"edit": "field-weights", "weights": weights}]);
    // Weights that are all the same change no digit.
    let (even, text) = optimised("even", json!([{"edit": "name", "name": "even"}]));
    assert!(!text.contains("weight"));
    assert_eq!(rms(&optimised("same", weights([2.0; 4])).0), rms(&even));
    // The axis alone: its spot is smaller, and the others pay.
    let (axis, text) = optimised("axis", weights([1.0, 0.0, 0.0, 0.0]));
    assert!(rms(&axis)[0] < 0.8 * rms(&even)[0], "{:?} {:?}", rms(&axis), rms(&even));
    assert!(rms(&axis)[3] > 1.05 * rms(&even)[3], "{:?} {:?}", rms(&axis), rms(&even));
    assert!(text.contains("weight = [1.0, 0.0, 0.0, 0.0]"), "{text}");
    // A pickup and bounds hold in the best lens.
    let (_, text) = optimised(
        "tied",
        json!([
            {"edit": "pickup", "surface": 4, "parameter": "radius_mm", "of": 3, "scale": -1.0},
            {"edit": "vary", "surface": 1, "parameter": "radius_mm", "min": 11.3, "max": 11.4},
        ]),
    );
    let best = run(&context, "lens-view", &json!({"lens": {"toml": text}, "parts": ["layout"]})).unwrap();
    let row = |surface: usize| &best["surfaces"][surface - 1];
    let curvature = |surface: usize| row(surface)["curvature_per_mm"].as_f64().unwrap();
    assert_eq!(curvature(4), -curvature(3));
    assert_ne!(curvature(3), -1.0 / 39.57, "it varies");
    assert_eq!(row(4)["settled"][0]["by"]["pickup"]["of"], 3);
    let varies = row(1)["varies"].as_array().unwrap().iter().find(|v| v["parameter"] == "radius_mm").unwrap();
    assert_eq!((&varies["min"], &varies["max"]), (&json!(11.3), &json!(11.4)));
    assert!((11.3..=11.4).contains(&(1.0 / curvature(1))), "{}", 1.0 / curvature(1));
}

#[test]
fn fields_that_stay_keep_their_weights() {
    let context = context();
    let weighted = json!([
        {"edit": "field-weights", "weights": [1, 2, 3, 4]},
        {"edit": "fields", "fields_deg": [15.0, 7.0, 5.0]},
    ]);
    let view = edited(&context, &weighted).unwrap();
    assert_eq!(view["stated_fields_deg"], json!([5.0, 7.0, 15.0]));
    assert_eq!(view["field_weights"], json!([2.0, 1.0, 4.0]));
    let even =
        json!([{"edit": "field-weights", "weights": [1, 2, 3, 4]}, {"edit": "field-weights", "weights": []}]);
    let view = edited(&context, &even).unwrap();
    assert_eq!(view["field_weights"], json!([]));
    assert!(!view["toml"].as_str().unwrap().contains("weight"));
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

/// The nominal triplet whose second surface stands off its place.
fn misplaced(context: &Context, placement: &str) -> Value {
    let text = run(context, "lens-edit", &json!({"lens": "cooke-triplet-nominal"})).unwrap();
    let text = text["text"].as_str().unwrap();
    let gap = "thickness_mm = 8.11\n";
    assert!(text.contains(gap));
    json!({"toml": text.replacen(gap, &format!("placement = {{ {placement}, axis = \"returns\" }}\n{gap}"), 1)})
}

#[test]
fn a_lens_without_symmetry_has_its_picture() {
    use base64::Engine;
    let context = context();
    let picture = |lens: &Value, quick: bool, at: [f64; 2]| -> (Value, Vec<u8>) {
        let request = json!({"lens": lens, "size": [96, 96], "at": at, "quick": quick, "no_noise": true, "array": [1200, 1920]});
        let view = run(&context, "camera-view", &request).unwrap();
        let bytes = base64::engine::general_purpose::STANDARD.decode(view["rgb"].as_str().unwrap()).unwrap();
        (view, bytes)
    };
    let rms = |a: &[u8], b: &[u8]| -> f64 {
        let square = |(a, b): (&u8, &u8)| (f64::from(*a) - f64::from(*b)).powi(2);
        (a.iter().zip(b).map(square).sum::<f64>() / a.len() as f64).sqrt()
    };
    // A tilt of a billionth of a degree leaves the picture of the symmetric lens, by the other way.
    let symmetric = json!("cooke-triplet-nominal");
    let hardly = misplaced(&context, "tilt_deg = [1e-9, 0.0, 0.0]");
    for at in [[0.5, 0.5], [0.75, 0.3], [0.2, 0.6]] {
        let ((one, a), (other, b)) = (picture(&symmetric, false, at), picture(&hardly, false, at));
        assert!(rms(&a, &b) < 1.5, "{at:?}: {}", rms(&a, &b));
        for key in ["placement", "array", "white_e", "image_radius_mm"] {
            assert_eq!(one[key], other[key], "{key}");
        }
    }
    // A decentre of 0.1 mm shows; the quick picture is near the exact one, which is the same at every call.
    let decentred = misplaced(&context, "decenter_mm = [0.07, 0.07]");
    let (_, centred) = picture(&symmetric, false, [0.5, 0.5]);
    let (view, exact) = picture(&decentred, false, [0.5, 0.5]);
    assert!(rms(&centred, &exact) > 3.0, "{}", rms(&centred, &exact));
    let (_, quick) = picture(&decentred, true, [0.5, 0.5]);
    assert!(rms(&quick, &exact) < 8.0, "{}", rms(&quick, &exact));
    assert_eq!(picture(&decentred, false, [0.5, 0.5]).0, view);
    assert!(view["psf_fields"].as_u64().unwrap() >= 4);
    // Far outside of the image no ray lands, and the error says so.
    let request = json!({"lens": decentred, "size": [96, 96], "at": [0.0, 0.0], "array": [6000, 9600]});
    let report = run(&context, "camera-view", &request).unwrap_err().report();
    assert!(report.message.contains("no chief ray lands"), "{report:?}");
}

#[test]
fn a_slanted_edge_of_a_window_is_measured_where_it_is_named() {
    let context = context();
    let view = |region: Value, isp: Value| {
        let request = json!({"lens": "cooke-triplet-nominal", "photo": "scene:slanted-edge", "size": [128, 128], "edges": [region], "isp": isp});
        run(&context, "camera-view", &request)
    };
    let region = json!({"row": 24, "col": 34, "height": 80, "width": 60});
    let mtf50 = |found: &Value| -> f64 {
        assert_eq!(found["edges"][0]["region"], region);
        let channel = &found["edges"][0]["channels"][0];
        assert_eq!((&channel["channel"], &channel["is_upright"]), (&json!("luminance"), &json!(true)));
        assert!((channel["angle_deg"].as_f64().unwrap() - 5.0).abs() < 0.3, "{channel}");
        channel["mtf50_per_px"].as_f64().unwrap()
    };
    let linear = mtf50(&view(region.clone(), json!(null)).unwrap());
    assert!((0.1..0.6).contains(&linear), "{linear}");
    // An ISP sharpens: its own picture is measured, behind its sRGB curve.
    let neutral = mtf50(&view(region.clone(), json!("neutral")).unwrap());
    assert!((1.2..3.0).contains(&(neutral / linear)), "{neutral} {linear}");
    let report =
        view(json!({"row": 0, "col": 0, "height": 20, "width": 20}), json!(null)).unwrap_err().report();
    assert!(report.hint.contains("one straight edge"), "{}", report.message);
    let report =
        view(json!({"row": 100, "col": 0, "height": 80, "width": 20}), json!(null)).unwrap_err().report();
    assert!(report.message.contains("128 rows and 128 columns"), "{}", report.message);
}

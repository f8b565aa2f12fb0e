//! What views say of a lens beside its figures and pictures: a reader of the page sees no terminal.

use std::sync::{Arc, Mutex};

use petzval_jobs::{Call, Context, Event, Silent, Watcher, built_in_assets};
use serde_json::{Value, json};

const LENS: &str = "cooke-triplet-nominal";

/// Two mirrors of a Cassegrain telescope, EFL 300 mm.
const CASSEGRAIN: &str = "MODE SEQ
UNIT MM X W X CM MR CPMM
ENPD 25
FTYP 0 0 2 1 0 0 0
XFLN 0 0
YFLN 0 0.5
WAVM 1 0.5876 1
PWAV 1
SURF 0
  TYPE STANDARD
  CURV 0
  DISZ INFINITY
SURF 1
  STOP
  TYPE STANDARD
  CURV -0.005
  CONI -1
  DISZ -70
  GLAS MIRROR 0 0 1.5 40
  DIAM 12.5 1 0 0 1 \"\"
SURF 2
  TYPE STANDARD
  CURV -0.011111111111111112
  CONI -4
  DISZ 90
  GLAS MIRROR 0 0 1.5 40
  DIAM 5 1 0 0 1 \"\"
SURF 3
  TYPE STANDARD
  CURV 0
  DISZ 0
";

/// Keeps the warnings of calls.
#[derive(Default)]
struct Warnings(Mutex<Vec<String>>);

impl Watcher for Warnings {
    fn event(&self, event: &Event) {
        if let Event::Warning { text, .. } = event {
            self.0.lock().unwrap().push(text.clone());
        }
    }
}

/// The response of a job, and its warnings. What the context keeps from call to call it keeps here as well.
fn said(context: &Context, job: &str, request: Value) -> (Value, Vec<String>) {
    let heard = Arc::new(Warnings::default());
    let response = Call::new(job, request).run(&context.watched_by(heard.clone())).unwrap();
    let warnings = heard.0.lock().unwrap().clone();
    (response, warnings)
}

fn context() -> Context {
    Context::new(built_in_assets(), Arc::new(Silent))
}

/// The triplet with its image plane so much further away.
fn moved(context: &Context, by_mm: f64) -> Value {
    let (view, _) = said(context, "lens-view", json!({"lens": LENS, "quick": true}));
    let last = view["surfaces"].as_array().unwrap().last().unwrap().clone();
    let thickness_mm = last["thickness_mm"].as_f64().unwrap() + by_mm;
    json!([{"edit": "thickness", "surface": last["surface"], "thickness_mm": thickness_mm}])
}

#[test]
fn each_picture_of_a_camera_says_what_its_psfs_lose() {
    let context = context();
    let edits = moved(&context, 1.0);
    // The second picture is of a camera that is kept.
    for quick in [true, false] {
        for at in [[0.5, 0.5], [0.6, 0.5]] {
            let request = json!({"lens": LENS, "edits": edits, "size": [32, 32], "at": at, "quick": quick});
            let (_, warnings) = said(&context, "camera-view", request);
            let lost = warnings.iter().filter(|text| text.contains("cuts off")).count();
            assert_eq!(lost, 1, "quick {quick} at {at:?}: {warnings:?}");
        }
        let request = json!({"lens": LENS, "size": [32, 32], "quick": quick});
        let (_, warnings) = said(&context, "camera-view", request);
        assert!(!warnings.iter().any(|text| text.contains("cuts off")), "{warnings:?}");
    }
}

#[test]
fn a_view_says_how_far_the_lens_is_out_of_focus() {
    let context = context();
    let by_mm = 1.0;
    let edits = moved(&context, by_mm);
    let (sharp, _) = said(&context, "lens-view", json!({"lens": LENS, "parts": ["spots"]}));
    assert!(sharp["out_of_focus"].is_null(), "{}", sharp["out_of_focus"]);
    let request = json!({"lens": LENS, "edits": edits, "parts": ["spots"]});
    let (blurred, _) = said(&context, "lens-view", request);
    let found = |key: &str| blurred["out_of_focus"][key].as_f64().unwrap();
    // The best focus stays where it is.
    let (focus, _) = said(&context, "lens-focus", json!({"lens": LENS}));
    let of = |key: &str| focus[key].as_f64().unwrap();
    let wanted = of("image_distance_mm") - of("image_distance_before_mm") - by_mm;
    assert!((found("moved_mm") - wanted).abs() < 1e-9, "{} {wanted}", found("moved_mm"));
    assert!((found("best_rms_spot_um") / of("rms_spot_um") - 1.0).abs() < 1e-9);
    assert!(found("rms_spot_um") > 5.0 * found("best_rms_spot_um"));
    // A drag waits for no search of the focus.
    let request = json!({"lens": LENS, "edits": edits, "parts": ["spots"], "quick": true});
    assert!(said(&context, "lens-view", request).0["out_of_focus"].is_null());
}

#[test]
fn a_view_says_what_its_figures_leave_out() {
    let context = context();
    let of = |text: &str| {
        let lens = json!({"text": text, "format": "zmx"});
        let (view, _) = said(&context, "lens-view", json!({"lens": lens, "parts": ["spots"], "quick": true}));
        view["problems"].to_string()
    };
    assert!(of(CASSEGRAIN).contains("no obscurations"), "{}", of(CASSEGRAIN));
    let biconic = CASSEGRAIN.replacen(
        "TYPE STANDARD\n  CURV -0.005\n  CONI -1",
        "TYPE BICONICX\n  CURV -0.005\n  CONI -1\n  PARM 1 -210\n  PARM 2 -1",
        1,
    );
    assert_ne!(biconic, CASSEGRAIN);
    assert!(of(&biconic).contains("not rotationally symmetric"), "{}", of(&biconic));
}

/// A form that writes a list back has all of it.
#[test]
fn a_view_of_many_fields_shows_some_and_states_all() {
    let fields: Vec<f64> = (0..25).map(|i| 0.5 * f64::from(i)).collect();
    let edit = json!([{"edit": "fields", "fields_deg": fields}]);
    let request = json!({"lens": LENS, "edits": edit, "parts": ["spots"], "quick": true});
    let (view, _) = said(&context(), "lens-view", request);
    assert_eq!(view["stated_fields_deg"], json!(fields));
    assert_eq!(view["fields_deg"].as_array().unwrap().len(), 12);
    assert_eq!(view["spots"].as_array().unwrap().len(), 12);
    assert_eq!(view["stated_wavelengths_um"], view["wavelengths_um"]);
    assert!(view["problems"].to_string().contains("of 25 fields, 12 are shown"), "{}", view["problems"]);
}

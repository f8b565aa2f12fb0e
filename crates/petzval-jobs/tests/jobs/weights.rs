//! Weights by name: listed, written, and read again.

use std::path::Path;
use std::sync::Arc;

use petzval_jobs::weights::{self, Request, Response, WeightNames};
use petzval_jobs::{Context, JobError, Silent, built_in_assets};

fn run(request: &Request) -> Result<Response, JobError> {
    weights::run(request, &Context::new(built_in_assets(), Arc::new(Silent)))
}

/// What is wrong and what to do, on one line.
fn refused(request: &Request) -> String {
    let report = run(request).unwrap_err().report();
    format!("{} {}", report.message, report.hint)
}

fn of(weights: impl AsRef<Path>) -> Request {
    Request { weights: weights.as_ref().to_owned(), ..Request::default() }
}

#[test]
fn weights_are_listed_by_name_and_written_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let run_folder = folder.path().join("run");
    let camera = run_folder.join("cameras/nominal");
    std::fs::create_dir_all(&camera).unwrap();
    let to = camera.join("network.safetensors");

    let built_in = run(&Request { to: Some(to.clone()), ..of("restoration_naf") }).unwrap();
    assert_eq!((built_in.kind.as_str(), &built_in.to), ("restoration-naf", &Some(to.clone())));
    assert_eq!(built_in.settings, serde_json::json!({"base_channels": 16, "levels": 3}));
    assert_eq!(built_in.weights.len(), 101);
    assert_eq!(built_in.weights.iter().map(|w| w.shape.iter().product::<usize>()).sum::<usize>(), 282_584);
    let curves = &built_in.weights[0];
    assert_eq!((curves.name.as_str(), &curves.shape[..]), ("curves", &[3, 6][..]));
    assert!((curves.rms - 0.327_879_837_935).abs() < 1e-9, "{}", curves.rms);
    let own = built_in_assets().bytes("weights/restoration_naf.safetensors").unwrap().to_vec();
    assert!(std::fs::read(&to).unwrap() == own);

    // The same from the run, from its camera and from the file.
    let same = Response { to: None, ..built_in };
    let named = Request { camera: Some("nominal".to_owned()), ..of(&run_folder) };
    for request in [of(&run_folder), named, of(&camera), of(&to)] {
        assert_eq!(run(&request).unwrap(), same);
    }
}

#[test]
fn what_holds_no_weights_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let to = |name: &str| Some(folder.path().join(name));
    for name in ["a", "b"] {
        let camera = folder.path().join("run/cameras").join(name);
        std::fs::create_dir_all(&camera).unwrap();
        run(&Request { to: Some(camera.join("network.safetensors")), ..of("restoration_naf") }).unwrap();
    }
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    let (runs, built_in) = (of(folder.path().join("run")), of("restoration_naf"));
    let camera = Some("c".to_owned());
    for (request, says) in [
        (of("nowhere"), "no built-in weights have this name"),
        (of(folder.path().join("empty")), "network.safetensors or weights.safetensors"),
        (runs.clone(), "which camera? cameras with weights of a network of Petzval are: a, b;"),
        (Request { camera: camera.clone(), ..runs }, "there are no weights of a camera of this name"),
        (Request { camera, ..of(folder.path().join("empty")) }, "is not the folder of a run"),
        (Request { to: to("x.npz"), ..built_in.clone() }, "numpy.savez"),
        (
            Request { to: to("run/cameras/a/network.safetensors"), ..built_in.clone() },
            "exists already --force replaces it",
        ),
        (
            Request { to: to("x.safetensors"), names: WeightNames::Torchvision, ..built_in },
            "torchvision has no such network",
        ),
        (of("lpips_alex_f16"), "lpips_alex_f16: "),
    ] {
        let found = refused(&request);
        assert!(found.contains(says), "{found}");
    }
    assert!(!folder.path().join("x.safetensors").exists());
}

//! `petzval doctor`, `petzval bench`, and the behaviour of the command in a shell.

use std::io::{Read, Write};
use std::process::Stdio;

use serde_json::Value;

use crate::common::{outcome, petzval, run, run_fails, run_ok};

#[test]
fn doctor_describes_the_machine() {
    let folder = tempfile::tempdir().unwrap();
    let found = run_ok(folder.path(), &["doctor", "--json", "--threads", "3"]).json();
    assert_eq!(found["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(found["os"], std::env::consts::OS);
    assert_eq!(found["threads"], 3);
    assert!(found["cores"].as_u64().unwrap() >= 1);
    let simd = found["simd"].as_str().unwrap();
    assert!(["avx512", "avx2", "sse2", "neon", "scalar"].contains(&simd), "{simd}");
    for (key, name) in [
        ("devices", "cpu"),
        ("lenses", "cooke-triplet-nominal"),
        ("sensors", "imx249-fitted"),
        ("experiments", "cooke-triplet-image-quality"),
    ] {
        let list = found[key].as_array().unwrap_or_else(|| panic!("no {key}"));
        assert!(list.iter().any(|v| v == name), "{name} is not among the {key}: {list:?}");
    }
    let text = run_ok(folder.path(), &["doctor"]).stdout;
    assert!(text.contains("built-in files: all readable"), "{text}");
}

#[test]
fn doctor_checks_a_device_for_as_long_as_it_may() {
    let folder = tempfile::tempdir().unwrap();
    let found = run_ok(folder.path(), &["doctor", "--device", "cpu", "--seconds", "1", "--json"]).json();
    let check = &found["check"];
    assert_eq!([&check["device"], &check["verdict"]], ["cpu", "unfinished"]);
    let tried = check["convolutions"].as_array().unwrap();
    assert!(!tried.is_empty() && tried.iter().all(|one| one["problem"].is_null()), "{tried:?}");
    let largest = |one: &Value| one["errors"]["by_weights"].as_f64().unwrap();
    assert!(tried.iter().all(|one| largest(one) < 1e-5), "{tried:?}");
    assert!(!check["networks_left_out"].as_array().unwrap().is_empty());
    // Without a device nothing is checked.
    assert!(run_ok(folder.path(), &["doctor", "--json"]).json().get("check").is_none());
    #[cfg(not(feature = "wgpu"))]
    run_fails(
        folder.path(),
        &["doctor", "--device", "wgpu"],
        2,
        &["not in this build", "cargo install --locked --path crates/petzval --features wgpu"],
    );
}

#[test]
fn a_batch_system_says_how_many_threads_there_are() {
    let folder = tempfile::tempdir().unwrap();
    let doctor = |words: &[&str], name, value: &str| {
        let mut command = petzval(folder.path());
        command.args(["doctor", "--threads"]).args(words).env_remove("RAYON_NUM_THREADS");
        outcome(command.env(name, value).output().unwrap())
    };
    let said = doctor(&["0"], "SLURM_CPUS_PER_TASK", "3");
    assert!(
        said.stdout.contains("threads      3 of ") && said.stdout.contains("by SLURM_CPUS_PER_TASK"),
        "{said:?}"
    );
    assert!(doctor(&["2"], "SLURM_CPUS_PER_TASK", "3").stdout.contains("threads      2 of "));
    let refused = doctor(&["0"], "HQ_CPUS", "all");
    assert_eq!(refused.code, Some(2));
    assert!(refused.says("HQ_CPUS=all") && refused.says("--threads"), "{refused:?}");
}

/// Every workload name that programs may rely on; they arrive with their stages.
const WORKLOADS: [&str; 31] = [
    "psf_rgb",
    "psf_rgb_gradient",
    "psf_13_fields",
    "joint_psfs",
    "joint_psfs_waves",
    "trace",
    "trace_all_aspheres",
    "trace_adjoint",
    "spot_gradient_same_rays",
    "spot_gradient",
    "lm_iteration",
    "triplet_recovery",
    "tolerance_1000",
    "lens_analyze",
    "render_1200x1920",
    "sensor_1200x1920",
    "malvar_1200x1920",
    "rcd_1200x1920",
    "menon_1200x1920",
    "isp_1200x1920",
    "isp_quality_1200x1920",
    "network_step",
    "isp_step",
    "joint_step",
    "joint_render",
    "joint_sensor",
    "joint_development",
    "joint_network",
    "joint_loss",
    "detector_step",
    "detector_lens_step",
];

#[test]
fn bench_lists_its_workloads_and_measures_one() {
    let folder = tempfile::tempdir().unwrap();
    let list = run_ok(folder.path(), &["bench", "--list"]).stdout;
    let names: Vec<&str> = list.lines().collect();
    assert!(names.len() >= 12, "{names:?}");
    assert!(names.iter().all(|name| WORKLOADS.contains(name)), "{names:?}");

    let measured = ["trace", "psf_rgb", "joint_sensor"];
    let only = measured.map(|name| ["--only", name]);
    let args = [&["bench", "--seconds", "0.1", "--json"][..], only.as_flattened()].concat();
    let results = run_ok(folder.path(), &args).json();
    let results = results.as_array().unwrap();
    assert_eq!(results.len(), measured.len());
    for (result, name) in results.iter().zip(measured) {
        assert_eq!(result["name"], name);
        for key in ["cpu_s", "wall_s"] {
            let seconds = result[key].as_f64().unwrap();
            assert!(seconds > 1e-7 && seconds < 10.0, "{name}: {key} is {seconds}");
        }
        assert!(result["threads"].as_u64().unwrap() >= 1);
        assert!(result["simd"].is_string());
        assert!(!result["work"].as_str().unwrap().is_empty());
    }
    assert!(results[0]["work"].as_str().unwrap().contains("M surface intersections per CPU second"));
    assert!(results[2]["work"].as_str().unwrap().contains("a part of joint_step"));
    // Nothing is left behind.
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn bench_compares_numbers_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["bench", "--only", "spot_gradient", "--seconds", "0.01", "--threads", "2,1,3", "--json"];
    let result = run_ok(folder.path(), &args).json()[0].clone();
    let curve = result["curve"].as_array().unwrap();
    assert_eq!(curve.iter().map(|at| at["threads"].as_u64().unwrap()).collect::<Vec<_>>(), [2, 1, 3]);
    assert_eq!((&result["threads"], &curve[0]["speedup"]), (&2.into(), &1.0.into()));
    for at in curve {
        let [wall, speedup] = ["wall_s", "speedup"].map(|key| at[key].as_f64().unwrap());
        assert!((wall * speedup / result["wall_s"].as_f64().unwrap() - 1.0).abs() < 1e-9, "{result}");
        assert!(at["cpu_s"].as_f64().unwrap() > 0.0);
    }
    let printed = run_ok(folder.path(), &args[..7]).stdout;
    assert_eq!(printed.lines().filter(|line| line.contains(" threads ")).count(), 3, "{printed}");
}

#[test]
fn usage_errors_exit_with_2() {
    let folder = tempfile::tempdir().unwrap();
    for (args, needles) in [
        (&["bench", "--only", "nothing"][..], ["--only nothing: no such workload", "psf_rgb"]),
        (&["bench", "--seconds", "0"], ["--seconds", "0"]),
        (&["design", "--device", "abacus"], ["--device abacus: not in this build", "this build has cpu"]),
        (&["doctor", "--threads", "100000"], ["--threads 100000", "0 means one per core"]),
        (&["lens", "list", "--threads", "1,2"], ["--threads 1,2: one number", "petzval bench"]),
        (&["bench", "--only", "trace", "--threads", "1,0"], ["--threads 0: out of range", "1 to 1024"]),
        (&["polish"], ["unrecognized subcommand", "polish"]),
        (&["lens", "show"], ["LENS", "Usage"]),
        (&[], ["Usage", "design"]),
    ] {
        run_fails(folder.path(), args, 2, &needles);
    }
}

#[test]
fn every_verb_has_help() {
    let folder = tempfile::tempdir().unwrap();
    let help = run_ok(folder.path(), &["--help"]).stdout;
    for verb in ["design", "report", "evaluate", "lens", "psf", "simulate", "bench", "doctor"] {
        assert!(help.contains(&format!("\n  {verb} ")), "{verb} is not in the help:\n{help}");
        assert!(run_ok(folder.path(), &[verb, "--help"]).stdout.contains("Usage: petzval"));
    }
    assert!(run_ok(folder.path(), &["--version"]).stdout.contains(env!("CARGO_PKG_VERSION")));
    // The help of a verb says what it does and writes, not only its name.
    for (verb, words) in [
        (&["design"][..], "report.html"),
        (&["compare"], "Markdown"),
        (&["simulate"], "NAME-raw.tiff"),
        (&["lens", "optimize"], "best.toml"),
        (&["isp", "tune"], "tuned.toml"),
        (&["train", "isp-proxy"], "proxy.toml"),
        (&["train", "optics-proxy"], "proxy.html"),
        (&["experiment", "run-all"], "goes on with the"),
    ] {
        let help = run_ok(folder.path(), &[verb, &["--help"]].concat()).stdout;
        assert!(help.contains(words), "{verb:?} does not say {words:?}:\n{help}");
    }
}

#[cfg(unix)]
#[test]
fn a_closed_pipe_ends_the_command_quietly() {
    let folder = tempfile::tempdir().unwrap();
    for args in [&["bench", "--list"][..], &["lens", "show", "cooke-triplet-nominal"], &["doctor", "--json"]]
    {
        let mut command = petzval(folder.path());
        let mut child = command.args(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        // As `| head` does, only sooner.
        drop(child.stdout.take());
        let mut said = String::new();
        child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        child.wait().unwrap();
        assert_eq!(said, "", "{args:?}");
    }
}

/// Every number of a JSON value, in order.
fn numbers(value: &serde_json::Value, found: &mut Vec<f64>) {
    match value {
        serde_json::Value::Number(n) => found.extend(n.as_f64()),
        serde_json::Value::Array(list) => list.iter().for_each(|v| numbers(v, found)),
        serde_json::Value::Object(map) => map.values().for_each(|v| numbers(v, found)),
        _ => {}
    }
}

#[test]
fn the_requested_instruction_set_is_named_and_gives_the_same_frame() {
    let folder = tempfile::tempdir().unwrap();
    let at = |level: &str, args: &[&str]| {
        let output = petzval(folder.path()).args(args).env("PETZVAL_SIMD", level).output().unwrap();
        assert!(output.status.success(), "{level} {args:?}");
        output.stdout
    };
    let json = |level: &str, args: &[&str]| -> serde_json::Value {
        serde_json::from_slice(&at(level, args)).unwrap()
    };
    let bench = ["bench", "--only", "sensor_1200x1920", "--only", "trace", "--seconds", "0.05", "--json"];
    for result in json("scalar", &bench).as_array().unwrap() {
        assert_eq!(result["simd"], "scalar", "{}", result["name"]);
    }
    let doctor = json("scalar", &["doctor", "--json"]);
    assert_eq!(doctor["simd_used"], "scalar");
    if doctor["simd"] != "scalar" {
        let text = String::from_utf8(at("scalar", &["doctor"])).unwrap();
        assert!(text.contains("; scalar used"), "{text}");
    }

    image::RgbImage::from_fn(96, 60, |x, y| image::Rgb([(2 * x) as u8, (4 * y) as u8, 90]))
        .save(folder.path().join("ramp.png"))
        .unwrap();
    // Rays differ in their last bits, and with them the light: a draw at the edge of two counts may fall to either side.
    let frame = |level: &str| {
        at(level, &["simulate", "ramp.png", "--out", level]);
        image::open(folder.path().join(level).join("ramp-raw.tiff")).unwrap().into_luma16().into_raw()
    };
    let (widest, scalar) = (frame("best"), frame("scalar"));
    let differing = widest.iter().zip(&scalar).filter(|(a, b)| a != b).count();
    assert!(differing * 1000 < widest.len(), "{differing} of {} pixels differ", widest.len());
}

#[test]
fn every_instruction_set_gives_the_same_lens_figures() {
    let folder = tempfile::tempdir().unwrap();
    let figures = |level: &str, lens: &str| {
        let mut command = petzval(folder.path());
        command.args(["lens", "show", lens, "--json"]).env("PETZVAL_SIMD", level);
        let output = command.output().unwrap();
        assert!(output.status.success());
        let mut found = Vec::new();
        numbers(&serde_json::from_slice(&output.stdout).unwrap(), &mut found);
        found
    };
    for lens in ["cooke-triplet-nominal", "eight-element-achromat"] {
        let widest = figures("", lens);
        for level in ["avx2", "scalar"] {
            for (a, b) in widest.iter().zip(figures(level, lens)) {
                assert!((a - b).abs() <= 1e-9 * (1.0 + a.abs()), "{lens} {level}: {a} {b}");
            }
        }
    }
}

#[test]
fn events_of_a_call_are_json_lines_and_the_last_one_is_the_error() {
    let folder = tempfile::tempdir().unwrap();
    let events = |call: &str, code: i32| -> (String, Vec<Value>) {
        let mut command = petzval(folder.path());
        command.args(["call", "-", "--events"]);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        child.stdin.take().unwrap().write_all(call.as_bytes()).unwrap();
        let ended = outcome(child.wait_with_output().unwrap());
        assert_eq!(ended.code, Some(code), "{}", ended.stderr);
        let parsed = |line: &str| serde_json::from_str(line).unwrap_or_else(|e| panic!("{line}: {e}"));
        (ended.stdout, ended.stderr.lines().map(parsed).collect())
    };
    let request = r#"{"lens": "cooke-triplet-nominal", "out": "analysis", "only": ["layout", "json"]}"#;
    let call = format!(r#"{{"format": 1, "job": "lens-analyze", "request": {request}}}"#);
    let (response, said) = events(&call, 0);
    assert!(response.contains("analysis.json"), "{response}");
    let of_kind = |kind: &str| said.iter().filter(|event| event["event"] == kind).collect::<Vec<_>>();
    assert!(of_kind("progress").iter().all(|event| event["total"].as_u64() > Some(0)));
    let files: Vec<&str> = of_kind("file").iter().filter_map(|event| event["path"].as_str()).collect();
    assert_eq!(files, ["analysis/layout.svg", "analysis/analysis.json"]);

    // The second time the files are there: the message names the key of the call, not the flag of the command.
    let (response, said) = events(&call, 2);
    let error = said.last().unwrap();
    assert_eq!((response.as_str(), &error["event"], &error["kind"]), ("", &"error".into(), &"input".into()));
    assert!(error["hint"].as_str().unwrap().starts_with("\"overwrite\": true replaces it"), "{error}");
    let whole = format!(r#"{{"format": 1, "job": "lens-analyze", "request": {request}, "overwrite": true}}"#);
    assert!(events(&whole, 0).0.contains("analysis.json"));

    // What an optimisation says of a better lens has its figures as numbers, beside the line for people.
    let request = r#"{"start": {"new": {"lens": "cooke-triplet-nominal", "out": "run"}}, "iterations": 1}"#;
    let (_, said) = events(&format!(r#"{{"format": 1, "job": "lens-optimize", "request": {request}}}"#), 0);
    let better = said.iter().find(|event| event["figures"]["iteration"] == 0.0).unwrap();
    let (merit, line) = (better["figures"]["merit_um"].as_f64().unwrap(), better["text"].as_str().unwrap());
    assert!(line.contains(&format!(" s  iteration 0    merit {merit:8.3} um  spots ")), "{line}");

    // What cannot be read as a call ends with JSON, too.
    let (_, said) = events("{\n", 2);
    assert_eq!((said.len(), &said[0]["event"], &said[0]["place"]["line"]), (1, &"error".into(), &2.into()));
    let (_, said) = events(r#"{"format": 1, "job": "data-check", "request": {"data": 5}}"#, 2);
    assert_eq!(said[0]["place"], serde_json::json!({"key": "data", "value": "5"}));
    let none = run(folder.path(), &["call", "none.json", "--events"]);
    let error: Value = serde_json::from_str(&none.stderr).unwrap();
    assert_eq!((none.code, &error["place"]["path"]), (Some(2), &"none.json".into()), "{none:?}");
}

//! `cargo xtask devices`: tensors on a GPU, proved on one that every machine can have: a program that is a Vulkan device on the CPU (Mesa's
//! lavapipe). The command is built with the feature `wgpu`, and its check of the device must find no fault. A short design on it must begin with
//! the loss of the CPU's, and a camera must have the scores that it has on the CPU. The tests of our own kernels for devices must pass.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::ended::Ended;

/// Where Mesa's packages put the description of the driver.
const DRIVERS: [&str; 3] = ["/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d"];

/// How to get it.
const NOT_TESTED: &str = "no Vulkan device on the CPU; Debian and Ubuntu: apt install mesa-vulkan-drivers";

/// Seconds for the check of the device.
const SECONDS: &str = "900";

/// Steps of the design.
const STEPS: &str = "2";

/// By how much the scores of one camera may differ on the two devices: 1 - LPIPS, and PSNR in dB.
const LARGEST: [(&str, f64); 2] = [("one_minus_lpips", 1e-5), ("psnr_db", 1e-3)];

/// By how much the losses of the first step may differ, as a share. Exposure counts in 32 bits on a device: single digital numbers differ.
const LARGEST_OF_LOSSES: f64 = 1e-4;

/// The tests of kernels for devices: a crate, the flags of their program, and the beginning of their names.
const KERNELS: [(&str, &[&str], &str); 2] =
    [("petzval-camera", &["--test", "device"], ""), ("petzval-learn", &["--lib"], "network::device::")];

/// Set for them: they fail where there is no device. Without it they say so and pass.
const REQUIRED: &str = "PETZVAL_DEVICE_REQUIRED";

/// How the chore is called.
pub const USAGE: &str = "cargo xtask devices [--petzval PROGRAM]; the program must have the feature `wgpu`";

/// Runs the check by its words.
pub fn check(words: &[String]) -> Result<String, Vec<String>> {
    let petzval = match words {
        [] => None,
        [flag, path] if flag == "--petzval" => Some(PathBuf::from(path)),
        _ => return Err(vec![USAGE.to_owned()]),
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    run(&root, petzval).map(|ended| ended.to_string()).map_err(|problem| vec![problem])
}

/// Runs it as a part of `cargo xtask full`: builds the command first, if none is given.
pub fn run(root: &Path, petzval: Option<PathBuf>) -> Result<Ended, String> {
    let Some(driver) = driver() else { return Ok(Ended::NotRun(NOT_TESTED.to_owned())) };
    let petzval = petzval.map_or_else(|| built(root), Ok)?;
    let petzval = std::path::absolute(petzval).map_err(|e| e.to_string())?;
    let folder = std::env::temp_dir().join(format!("petzval-devices-{}", std::process::id()));
    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let ended = on_software(&petzval, &driver, &folder).and_then(|found| {
        let tests = kernels(root, &driver)?;
        Ok(Ended::Passed(format!("{found}; {tests} tests of kernels pass")))
    });
    // What is left of a failure may be looked at.
    if ended.is_ok() {
        let _ = std::fs::remove_dir_all(&folder);
    }
    ended
}

/// The description of lavapipe, if the machine has it.
fn driver() -> Option<PathBuf> {
    let files = DRIVERS.iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten().flatten();
    let is_lavapipe = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        name.starts_with("lvp_icd") && name.ends_with(".json")
    };
    files.map(|entry| entry.path()).find(is_lavapipe)
}

/// The command with the feature.
fn built(root: &Path) -> Result<PathBuf, String> {
    let words =
        ["build", "--release", "--package", "petzval", "--features", "wgpu", "--message-format", "json"];
    let output =
        Command::new(env!("CARGO")).args(words).current_dir(root).output().map_err(|e| e.to_string())?;
    if !output.status.success() {
        return Err(format!("the build with `wgpu` failed: {}", String::from_utf8_lossy(&output.stderr)));
    }
    let lines = String::from_utf8_lossy(&output.stdout).into_owned();
    let mut program = lines.lines().filter_map(|line| {
        let message: Value = serde_json::from_str(line).ok()?;
        let is_ours = message["target"]["name"] == "petzval";
        message["executable"].as_str().filter(|_| is_ours).map(PathBuf::from)
    });
    program.next_back().ok_or_else(|| "cargo names no program `petzval`".to_owned())
}

/// The program of this name, with the one Vulkan device.
fn with_device(program: impl AsRef<OsStr>, driver: &Path) -> Command {
    let mut command = Command::new(program);
    // The newer name and the older one of the loader's list of drivers.
    command.env("VK_DRIVER_FILES", driver).env("VK_ICD_FILENAMES", driver);
    command
}

/// Runs the tests of our kernels on the device; how many there are.
fn kernels(root: &Path, driver: &Path) -> Result<usize, String> {
    let mut passed = 0;
    for (package, program, names) in KERNELS {
        let words =
            [&["test", "--release", "--package", package, "--features", "wgpu"], program, &[names]].concat();
        println!("cargo {}", words.join(" "));
        let output = with_device(env!("CARGO"), driver)
            .args(&words)
            .current_dir(root)
            .env(REQUIRED, "1")
            .output()
            .map_err(|e| e.to_string())?;
        let stdout = String::from_utf8_lossy(&output.stdout);
        if !output.status.success() {
            return Err(format!("{package}: {stdout}{}", String::from_utf8_lossy(&output.stderr)));
        }
        passed += passed_tests(&stdout).ok_or_else(|| format!("{package}: no tests `{names}`: {stdout}"))?;
    }
    Ok(passed)
}

/// How many tests passed by the last line of their program; none if there were none.
fn passed_tests(text: &str) -> Option<usize> {
    let line = text.lines().rev().find_map(|line| line.strip_prefix("test result: ok. "))?;
    line.split_whitespace().next()?.parse().ok().filter(|passed| *passed > 0)
}

fn on_software(petzval: &Path, driver: &Path, folder: &Path) -> Result<String, String> {
    let call = |words: &[&str]| -> Result<String, String> {
        println!("petzval {}", words.join(" "));
        let output = with_device(petzval, driver)
            .args(words)
            .current_dir(folder)
            .output()
            .map_err(|e| format!("{}: {e}", petzval.display()))?;
        let (stdout, stderr) =
            (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        match output.status.code() {
            Some(0) => Ok(stdout.into_owned()),
            code => Err(format!("petzval {} ends with {code:?}:\n{stdout}{stderr}", words.join(" "))),
        }
    };

    // The check of the device.
    let text = call(&["doctor", "--device", "wgpu", "--seconds", SECONDS, "--json"])?;
    let found: Value = serde_json::from_str(&text).map_err(|e| format!("doctor: {e}"))?;
    let check = &found["check"];
    let tried = check["convolutions"].as_array().map_or(0, Vec::len);
    let left_out = check["left_out"].as_array().map_or(0, Vec::len);
    if tried == 0 || check["is_software"] != true {
        return Err(format!("the device is not the one of Mesa, or nothing was tried on it: {check}"));
    }
    let errors = |pass: &str| {
        let all = check["convolutions"].as_array().into_iter().flatten();
        all.filter_map(|one| one["errors"][pass].as_f64()).fold(0.0, f64::max)
    };
    let [forward, by_input, by_weights] = ["forward", "by_input", "by_weights"].map(errors);

    // The same short design on both devices.
    let design = |device: &str, more: &[&str]| {
        let words = ["design", "--variant", "nominal", "--device", device, "--out", device];
        call(&[&words[..], more].concat())
    };
    design("cpu", &["--steps", STEPS])?;
    design("wgpu", &["--steps", STEPS])?;
    let loss = |device: &str| -> Result<f64, String> {
        let path = folder.join(device).join("events.jsonl");
        let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        let events = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        let first = events.into_iter().find_map(|event| event["losses"]["total"].as_f64());
        first.ok_or(format!("{device}: no losses of a step"))
    };
    let (of_cpu, of_wgpu) = (loss("cpu")?, loss("wgpu")?);
    let apart = (of_wgpu / of_cpu - 1.0).abs();
    if apart.is_nan() || apart > LARGEST_OF_LOSSES {
        return Err(format!("the first step's loss is {of_cpu} on the CPU, {of_wgpu} on wgpu"));
    }

    // The CPU's camera, scored on both. Two trainings are no such test: the first step of Adam turns the sign of a slope near zero into a weight.
    let scores = |device: &str| -> Result<[f64; 2], String> {
        let text = call(&["evaluate", "cpu", "--device", device, "--json"])?;
        let found: Value = serde_json::from_str(&text).map_err(|e| format!("evaluate: {e}"))?;
        let score =
            |name: &str| found["metrics"]["rows"][0][name].as_f64().ok_or(format!("{device}: no {name}"));
        Ok([score(LARGEST[0].0)?, score(LARGEST[1].0)?])
    };
    let (cpu, wgpu) = (scores("cpu")?, scores("wgpu")?);
    for (i, (name, largest)) in LARGEST.iter().enumerate() {
        if (cpu[i] - wgpu[i]).abs() > *largest {
            return Err(format!("{name}: {} on the CPU, {} on wgpu; {largest} is allowed", cpu[i], wgpu[i]));
        }
    }

    // The run keeps its verdict and its tuning.
    let run = folder.join("wgpu");
    let verdict =
        std::fs::read_to_string(run.join("device.json")).map_err(|e| format!("device.json: {e}"))?;
    let verdict: Value = serde_json::from_str(&verdict).map_err(|e| e.to_string())?;
    let tuned = std::fs::read_dir(run.join("tuning")).map(Iterator::count).unwrap_or(0);
    if verdict["verdict"] != "passed" || tuned == 0 {
        return Err(format!("the run has {tuned} files of tuning, and the verdict {}", verdict["verdict"]));
    }
    Ok(format!(
        "{}: {tried} convolutions agree within {forward:.1e} forward, {by_input:.1e} and {by_weights:.1e} back ({left_out} left out); \
         the first step's losses differ by {apart:.1e}; a camera has {:.7} and {:.5} dB, {:.7} and {:.5} dB on the CPU",
        check["name"].as_str().unwrap_or_default(),
        wgpu[0],
        wgpu[1],
        cpu[0],
        cpu[1]
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_that_mean_nothing_are_refused() {
        assert_eq!(check(&["--device".to_owned()]).unwrap_err(), [USAGE]);
    }

    #[test]
    fn tests_that_did_not_run_are_no_tests() {
        let line = |passed: usize| {
            format!(
                "running {passed} tests\ntest a ... ok\n\ntest result: ok. {passed} passed; 0 failed; 3 ignored\n\n"
            )
        };
        assert_eq!(passed_tests(&line(4)), Some(4));
        assert_eq!(passed_tests(&line(0)), None);
        assert_eq!(passed_tests("test result: FAILED. 3 passed; 1 failed"), None);
    }

    #[test]
    fn a_program_that_is_no_command_is_an_error_where_the_driver_is_there() {
        let ended = run(Path::new("/"), Some(PathBuf::from("/nowhere/petzval")));
        match driver() {
            Some(_) => assert!(ended.unwrap_err().contains("/nowhere/petzval")),
            None => assert_eq!(ended.unwrap(), Ended::NotRun(NOT_TESTED.to_owned())),
        }
    }
}

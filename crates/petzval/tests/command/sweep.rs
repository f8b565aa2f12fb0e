//! Sweeps: what is refused before anything runs, and small ones from the first unit to the table.

use std::path::Path;

use serde_json::{Value, json};

use crate::common::*;

/// A sweep of a job that takes no time.
const LENSES: &str = "job = \"lens-show\"\n[grid]\nlens = [\"cooke-triplet-nominal\", \"single.toml\"]\n";

/// A lens that is not built in.
const SINGLE: &str = "name = \"single\"\nunits = \"mm\"\n[aperture]\nentrance_pupil_diameter_mm = 5.0\n[object]\ndistance_mm = inf\n\
    [wavelengths]\num = [0.55]\nreference_um = 0.55\n[fields]\nangle_deg = [0.0, 5.0]\n[glass.M15]\nn = 1.5\n\
    [[surface]]\nstop = true\nradius_mm = 50.0\nthickness_mm = 3.0\nglass = \"M15\"\nsemi_diameter_mm = 5.0\n\
    [[surface]]\nradius_mm = -50.0\nthickness_mm = 49.5\nsemi_diameter_mm = 5.0\n";

fn write(folder: &Path, name: &str, text: &str) {
    std::fs::write(folder.join(name), text).unwrap();
}

#[test]
fn what_is_wrong_is_refused_with_its_place_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "tiny.toml", &tiny_experiment());
    write(folder.path(), "broken.toml", "name = \"broken\"\nunits = 4\n");
    let many = "experiment = \"tiny.toml\"\n[grid]\nvalidation.every = [2, 0]\n[list]\nvalidation.patience = [0, 5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]\n\
        training.batch = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15]\n";
    for (text, needles) in [
        (
            "experiment = \"tiny.toml\"\n[grid]\npsf.gird = [64]\n",
            &[
                "s.toml:3:13: `psf.gird = 64`: unit `gird=64` (1 of 1)",
                "no such key here",
                "did you mean `grid`?",
            ][..],
        ),
        ("experiment = \"tiny.toml\"\nsteps = 3\nsteps = 4\n", &["s.toml:3:", "duplicate key"]),
        ("experiment = \"tiny.toml\"\n[grid]\npsf.grid = []\n", &["s.toml:3:12:", "the list is empty"]),
        (
            "experiment = \"tiny.toml\"\nseed = [1]\n",
            &["s.toml:2:1: `seed = [1]`: no such key here", "did you mean `seeds`?"],
        ),
        // The seventeenth of thirty units: its keys do not fit each other.
        (
            many,
            &[
                "s.toml:5:27: `validation.patience = 5`: unit `every=0,batch=2,patience=5` (17 of 30): there are no validations",
                "validation.every",
            ],
        ),
        (
            "experiment = \"tiny.toml\"\n[grid]\npsf.grid = [48, 47]\n",
            &["s.toml:3:17: `psf.grid = 47`: unit `grid=47` (2 of 2): must be even", "take 48"],
        ),
        (
            "experiment = \"tiny.toml\"\nvariants = [\"nominal\", \"best\"]\n",
            &["s.toml:2:24: `variants = \"best\"`", "no such variant", "spot-optimised"],
        ),
        (
            "experiment = \"tiny.toml\"\n[grid]\nloss.l1_weight = [1, 1.0]\n",
            &["stands twice", "give every value once"],
        ),
        (
            "experiment = \"tiny.toml\"\njob = \"lens-show\"\n",
            &["s.toml:2:7:", "an experiment is named as well"],
        ),
        ("[grid]\npsf.grid = [64]\n", &["neither an experiment nor a job"]),
        ("experiment = \"tiny.toml\"\nseeds = []\n", &["s.toml:2:9: `seeds = []`: the list is empty"]),
        (
            "experiment = \"tiny.toml\"\ndevice = \"cudaa\"\n",
            &["s.toml:2:10: `device = \"cudaa\"`: there is no such device", "cpu, wgpu, cuda"],
        ),
        ("job = \"runs\"\n", &["s.toml:1:7:", "the job `runs` looks at runs or units", "petzval call"]),
        ("job = \"lens-shw\"\n", &["s.toml:1:7:", "there is no job `lens-shw`", "did you mean `lens-show`?"]),
        (
            "job = \"lens-show\"\n[grid]\nlenz = [\"cooke-triplet-nominal\"]\n[request]\nlens = \"cooke-triplet-nominal\"\n",
            &["s.toml:3:9: `lenz = \"cooke-triplet-nominal\"`", "no such key here", "did you mean `lens`?"],
        ),
        (
            "experiment = \"cooke-triplet-nominal\"\n",
            &["s.toml:1:14:", "a lens and not an experiment", "petzval init --lens"],
        ),
        (
            "seeds = [1, 2]\nexperiment = \"none.toml\"\n",
            &[
                "s.toml:2:14: `experiment = \"none.toml\"`: no experiment called `none.toml`",
                "the folder of the sweep",
            ],
        ),
        // What every unit has, in the table of its own.
        (
            "experiment = \"tiny.toml\"\n[set]\npsf.gird = 64\n[grid]\nseed = [1, 2]\n",
            &["s.toml:3:12: `gird = 64`: ", "no such key here", "did you mean `grid`?"],
        ),
        // Inputs of a job, the same for every unit and of one unit alone.
        (
            "job = \"lens-tolerance\"\n[request]\nlens = \"none.toml\"\n[grid]\nseed = [1, 2]\n",
            &[
                "s.toml:3:8: `lens = \"none.toml\"`",
                "neither a file nor one of the built-in ones",
                "the folder of the sweep",
            ],
        ),
        (
            "job = \"lens-show\"\n[grid]\nlens = [\"cooke-triplet-nominal\", \"cooke-triplet-nomnal\"]\n",
            &[
                "s.toml:3:34: `lens = \"cooke-triplet-nomnal\"`: unit ",
                "did you mean `cooke-triplet-nominal`?",
            ],
        ),
        (
            "job = \"lens-show\"\n[grid]\nlens = [\"cooke-triplet-nominal\", \"broken.toml\"]\n",
            &["broken.toml:2:"],
        ),
        (
            "job = \"raw-show\"\n[grid]\nfile = [\"none.tif\"]\n",
            &["s.toml:3:9: `file = \"none.tif\"`: unit ", "no such file"],
        ),
        (
            "experiment = \"tiny.toml\"\nthreads = 100000\n",
            &["s.toml:2:11: `threads = 100000`: more than 1024"],
        ),
        // Numbers of a job outside their ranges: one that varies, and one of every unit.
        (
            "job = \"lens-tolerance\"\n[request]\nlens = \"cooke-triplet-nominal\"\n[grid]\ntrials = [10, 5000000]\n",
            &["s.toml:5:15: `trials = 5000000`: unit ", "must lie between 0 and 1000000"],
        ),
        (
            "job = \"lens-trace\"\n[request]\nlens = \"cooke-triplet-nominal\"\nwavelength = 550\npupil = [0, 1]\n[grid]\nfield = [1, 2]\n",
            &["s.toml:4:14: `wavelength = 550`: must lie between 0.2 and 20", "did you mean 0.55?"],
        ),
        // Numbers that JSON cannot hold: they would count as left out.
        (
            "job = \"lens-optimize\"\n[request]\nseconds = inf\nstart.new = {lens = \"cooke-triplet-nominal\"}\n[grid]\niterations = [1, 2]\n",
            &["s.toml:3:11: `seconds = inf`: not a finite number", "neither nan nor inf"],
        ),
        (
            "job = \"lens-trace\"\n[request]\nlens = \"cooke-triplet-nominal\"\nwavelength = 0.5\npupil = [0, nan]\n[grid]\nfield = [1, 2]\n",
            &["s.toml:5:13: `pupil = nan`: not a finite number"],
        ),
        (
            "experiment = \"tiny.toml\"\n[set]\npsf.pitch_um = nan\n[grid]\nseed = [1, 2]\n",
            &["s.toml:3:16: `pitch_um = nan`: not a finite number"],
        ),
        // Values of another kind, and keys that are missing.
        (
            "job = \"lens-trace\"\n[request]\nlens = \"cooke-triplet-nominal\"\nwavelength = 0.5\npupil = [0, \"x\"]\n[grid]\nfield = [1, 2]\n",
            &[
                "s.toml:5:13: `pupil = \"x\"`: expected a number, found a text",
                "petzval schema job lens-trace",
            ],
        ),
        (
            "job = \"lens-trace\"\n[request]\nlens = \"cooke-triplet-nominal\"\nwavelength = 0.5\n[grid]\nfield = [1, 2]\n",
            &["s.toml:2:1: `pupil`: the key is missing"],
        ),
        (
            "job = \"lens-trace\"\n[grid]\nlens = [\"cooke-triplet-nominal\"]\nfield = [1, 2]\n",
            &["s.toml:1:7: `wavelength`: the key is missing"],
        ),
        // What the request of the job has no key for.
        (
            "job = \"lens-show\"\nseeds = [1, 2]\n[grid]\nlens = [\"cooke-triplet-nominal\"]\n",
            &[
                "s.toml:2:9: `seeds = [1, 2]`: the request of the job `lens-show` has no key `seed`",
                "leave `seeds` out",
            ],
        ),
        (
            "job = \"lens-show\"\ndevice = \"cpu\"\n[grid]\nlens = [\"cooke-triplet-nominal\"]\n",
            &["s.toml:2:10: `device = \"cpu\"`: the request of the job `lens-show` has no key `device`"],
        ),
    ] {
        write(folder.path(), "s.toml", text);
        run_fails(folder.path(), &["sweep", "s.toml", "--store", "store"], 2, needles);
    }
    write(folder.path(), "s.toml", LENSES);
    write(folder.path(), "single.toml", SINGLE);
    run_fails(
        folder.path(),
        &["sweep", "s.toml", "--retry", "lens=singel"],
        2,
        &["no unit of this name", "did you mean `lens=single`?"],
    );
    run_fails(folder.path(), &["sweep", "status", "store"], 2, &["store: no sweep is kept here"]);
    run_fails(folder.path(), &["sweep", "gather", "."], 2, &["no sweep is kept here"]);
    std::fs::create_dir(folder.path().join("full")).unwrap();
    write(folder.path(), "full/notes.txt", "mine");
    run_fails(
        folder.path(),
        &["sweep", "s.toml", "--store", "full"],
        2,
        &["holds something else than a store"],
    );
    std::fs::create_dir(folder.path().join("other")).unwrap();
    write(folder.path(), "other/store.json", "{\"format\": 1, \"program\": \"0.0.1\"}");
    run_fails(folder.path(), &["sweep", "s.toml", "--store", "other"], 2, &["store is of Petzval 0.0.1"]);
    let listed = run_ok(folder.path(), &["runs", "other"]).stdout;
    assert!(listed.contains("damaged") && listed.contains("\nother: "), "{listed}");
    assert!(listed.contains("store is of Petzval 0.0.1") && !listed.contains(": :"), "{listed}");
}

#[test]
fn a_sweep_of_a_job_is_run_here_gathered_and_a_failed_unit_run_again() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "single.toml", SINGLE);
    write(folder.path(), "s.toml", LENSES);
    let dry = run_ok(folder.path(), &["sweep", "s.toml", "--dry-run"]);
    assert!(
        dry.stdout.starts_with("2 units\n  lens=cooke-triplet-nominal\n  lens=single\n"),
        "{}",
        dry.stdout
    );
    assert!(dry.stdout.contains("\nCPU time: "), "{}", dry.stdout);
    assert!(
        dry.stdout.contains(", by the unit `lens=cooke-triplet-nominal`, timed here\ndisk: "),
        "{}",
        dry.stdout
    );
    assert!(!folder.path().join("sweeps").exists());
    let print = run_ok(folder.path(), &["sweep", "s.toml", "--submit", "print", "--option=--partition=long"]);
    assert!(
        print.stdout.contains("#SBATCH --array=0-1\n") && print.stdout.contains("#SBATCH --partition=long\n")
    );
    let here = run_ok(folder.path(), &["sweep", "s.toml", "--submit", "here", "--jobs", "2"]);
    assert!(here.stdout.starts_with("2 done\n"), "{}", here.stdout);
    // The lens stays what it was when the units were made; the same command passes finished units over.
    let again = run_ok(folder.path(), &["sweep", "s.toml", "--submit", "here"]);
    assert!(again.stdout.starts_with("2 done\n"), "{}", again.stdout);
    let status = run_ok(folder.path(), &["sweep", "status", "sweeps/s", "--json"]).json();
    assert_eq!(status["units"][1]["attempt"], 1);
    let gathered =
        run_ok(folder.path(), &["sweep", "gather", "sweeps/s", "--x", "efl_mm", "--y", "f_number"]);
    assert!(gathered.stdout.contains("sweep.html"), "{}", gathered.stdout);
    let table = read(&folder.path().join("sweeps/s/table.csv"));
    let lines: Vec<&str> = table.lines().collect();
    assert!(
        lines[0].starts_with("lens,camera,units,") && lines[0].contains("figures.efl_mm_mean"),
        "{table}"
    );
    assert_eq!(lines.len(), 3);
    assert!(read(&folder.path().join("sweeps/s/sweep.html")).contains("class=\"points\""));
    // By default the lenses stand to the right, by their names.
    let gathered = run_ok(folder.path(), &["sweep", "gather", "sweeps/s", "--json"]).json();
    assert!(!gathered["units"][0]["widest_simd"].as_str().unwrap().is_empty(), "{gathered}");
    let page = read(&folder.path().join("sweeps/s/sweep.html"));
    assert!(page.contains(">key lens</text>") && page.contains(">single.toml</text>"), "{page}");
    assert!(page.contains("class=\"lead\"") && page.contains("; largest: lens "), "{page}");
    run_fails(
        folder.path(),
        &["sweep", "gather", "sweeps/s", "--x", "elf_mm"],
        2,
        &["--x elf_mm: no unit has such a figure", "did you mean `efl_mm`?"],
    );
    run_fails(
        folder.path(),
        &["sweep", "gather", "sweeps/s", "--y", "lens"],
        2,
        &["--y lens: the values of this key are no numbers"],
    );

    // What a retry of one unit ends with is that unit's, whatever the others do.
    let retry = ["sweep", "s.toml", "--store", "one", "--retry", "lens=single"];
    let one = run_ok(folder.path(), &retry);
    assert!(one.stdout.starts_with("1 done, 1 waiting\n") && !one.says("has a result"), "{one:?}");
    let again = run_ok(folder.path(), &retry);
    assert!(again.says("lens=single: has a result already"), "{again:?}");
    assert!(again.stdout.starts_with("1 done, 1 waiting\n"), "{again:?}");

    // Each unit has a folder of its own: the sweep names none.
    let psfs = "job = \"psf\"\n[request]\nlens = \"cooke-triplet-nominal\"\n[grid]\ngrid = [16, 32]\n";
    write(folder.path(), "p.toml", psfs);
    let dry = run_ok(folder.path(), &["sweep", "p.toml", "--dry-run"]);
    assert!(dry.stdout.starts_with("2 units\n  grid=16\n  grid=32\n"), "{}", dry.stdout);

    // A ray at a field that the lens cannot take fails, and nothing else does.
    let trace = "job = \"lens-trace\"\n[request]\nlens = \"cooke-triplet-nominal\"\nwavelength = 0.55\npupil = [0.0, 0.5]\n[grid]\nfield = [5.0, 180.0]\n";
    write(folder.path(), "t.toml", trace);
    let failed = run(folder.path(), &["sweep", "t.toml", "--submit", "here"]);
    assert_eq!(failed.code, Some(1), "{failed:?}");
    let why = "  field=180.0: `field = 180`: not within 180 degrees";
    assert!(failed.stdout.starts_with(&format!("1 done, 1 failed\n{why}")), "{}", failed.stdout);
    let retried = run(folder.path(), &["sweep", "t.toml", "--retry", "field=180.0"]);
    assert_eq!(retried.code, Some(1), "{retried:?}");
    let status = run_ok(folder.path(), &["sweep", "status", "sweeps/t", "--json"]).json();
    assert_eq!((&status["units"][1]["state"], &status["units"][1]["attempt"]), (&"failed".into(), &2.into()));
    let page = run_ok(folder.path(), &["sweep", "gather", "sweeps/t"]).stdout;
    assert!(page.contains("1 of 2 units: 1 done, 1 failed\n") && page.contains("\nfield=180.0: "), "{page}");
    let html = read(&folder.path().join("sweeps/t/sweep.html"));
    // Units of seconds are no hundredth of an hour.
    assert!(html.contains("CPU time so far: ") && !html.contains("0.00 hours"), "{html}");
    assert!(
        html.contains("Failed units") && html.contains("--retry &#39;field=180.0&#39;")
            || html.contains("--retry 'field=180.0'"),
        "{html}"
    );

    // Two sweeps in one store: the file of units is that of the last one.
    for (file, held) in [("t.toml", Some("held the sweep \"s\" with 2 units")), ("t.toml", None)] {
        let kept = run_ok(folder.path(), &["sweep", file, "--store", "sweeps/s"]);
        assert_eq!(kept.says("held the sweep"), held.is_some(), "{}", kept.stderr);
        assert!(
            held.is_none_or(|held| kept.says(held) && kept.says("run units of \"t\"")),
            "{}",
            kept.stderr
        );
    }
    let again = run_ok(folder.path(), &["sweep", "s.toml", "--submit", "here"]);
    assert!(again.says("held the sweep \"t\"") && again.stdout.starts_with("2 done\n"), "{again:?}");

    // A task that begins after a lens was edited would make a result that the sweep does not know.
    write(folder.path(), "single.toml", &SINGLE.replacen("radius_mm = 50.0", "radius_mm = 51.0", 1));
    let units = ["unit", "run", "sweeps/s/units.jsonl", "--store", "sweeps/s"];
    run_fails(folder.path(), &units, 2, &["unit \"lens=single\"", "have changed since", "single.toml"]);
    let anew = run_ok(folder.path(), &["sweep", "s.toml", "--submit", "here"]);
    assert!(anew.stdout.contains("2 done\n"), "{anew:?}");
    assert!(run_ok(folder.path(), &units).stdout.contains("0 done, 2 done before"));

    // Tables that cannot be written there can be written elsewhere.
    std::fs::remove_file(folder.path().join("sweeps/t/table.csv")).unwrap();
    std::fs::create_dir(folder.path().join("sweeps/t/table.csv")).unwrap();
    run_fails(folder.path(), &["sweep", "gather", "sweeps/t"], 2, &["table.csv: ", "with --out"]);
}

#[test]
fn a_call_starts_the_verbs_of_runs_and_sweeps() {
    let folder = tempfile::tempdir().unwrap();
    let written = |job: &str, request: Value| {
        write(folder.path(), "call.json", &json!({"format": 1, "job": job, "request": request}).to_string());
        ["call", "call.json"]
    };
    let called = |job: &str, request: Value| run_ok(folder.path(), &written(job, request)).json();
    assert_eq!(called("runs", json!({"folder": "."})), json!({"runs": [], "units": []}));
    run_fails(folder.path(), &written("runs", json!({})), 2, &["runs: there is no such folder"]);
    let none = json!({"store": "sweeps/s"});
    run_fails(folder.path(), &written("sweep-gather", none), 2, &["no sweep is kept here"]);

    write(folder.path(), "s.toml", "job = \"lens-show\"\n[grid]\nlens = [\"cooke-triplet-nominal\"]\n");
    run_ok(folder.path(), &["sweep", "s.toml", "--submit", "here"]);
    let gathered = called("sweep-gather", json!({"store": "sweeps/s", "out": "tables"}));
    assert_eq!(gathered["status"]["units"][0]["state"], "done");
    assert!(folder.path().join("tables/sweep.html").is_file());
    // The tables of the store itself are made anew, however it is spelled.
    for _ in 0..2 {
        called("sweep-gather", json!({"store": "sweeps/s", "out": "./sweeps/../sweeps/s"}));
    }
    run_fails(
        folder.path(),
        &written("sweep-gather", json!({"store": "sweeps/s", "out": "tables"})),
        2,
        &["is there already"],
    );
    // The verb is the same job.
    let verb = run_ok(folder.path(), &["sweep", "gather", "sweeps/s", "--out", "other", "--json"]).json();
    assert_eq!((&verb["rows"], &verb["figures"]), (&gathered["rows"], &gathered["figures"]));
    assert_eq!(called("sweep-status", json!({"store": "sweeps/s"})), gathered["status"]);

    assert!(run_ok(folder.path(), &["jobs"]).stdout.contains("\nsweep-gather "));
    let schema = run_ok(folder.path(), &["schema", "job", "sweep-gather"]).json();
    assert_eq!(schema["required"], json!(["store"]));
    run_ok(folder.path(), &["schema", "job", "runs", "--response"]);
    run_fails(folder.path(), &["schema", "job", "sweep-gathr"], 2, &["did you mean `sweep-gather`?"]);
}

#[test]
fn settings_of_the_command_line_are_those_of_the_printed_experiment() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "tiny.toml", &tiny_experiment());
    let with = |more: &[&str]| {
        run_ok(folder.path(), &[&["design", "tiny.toml", "--print-config"], more].concat()).stdout
    };
    let set = with(&[
        "--set",
        "psf.grid=48",
        "--set",
        "psf.kind=diffraction",
        "--set",
        "variant.end-to-end.noise=off",
        "--set",
        "training.steps = 7",
    ]);
    let read_back: toml::Table = set.parse().unwrap();
    assert_eq!(read_back["psf"]["grid"].as_integer(), Some(48));
    assert_eq!(read_back["psf"]["kind"].as_str(), Some("diffraction"));
    assert_eq!(read_back["training"]["steps"].as_integer(), Some(7));
    assert_eq!(read_back["variant"][2]["noise"].as_str(), Some("off"));
    // Nothing else differs, and what is set to its value changes nothing.
    let plain: toml::Table = with(&[]).parse().unwrap();
    assert_eq!(plain["optics"], read_back["optics"]);
    assert_eq!(with(&["--set", "seed=1"]), with(&[]));
    for (set, needles) in [
        (
            &["psf.gird=48"][..],
            &["--set psf.gird=48: `psf.gird`: no such key here", "did you mean `grid`?"][..],
        ),
        (&["steps=48"], &["--set steps=48: `steps`: no such key here", "`training.steps`"]),
        (&["psf.grid=47"], &["--set psf.grid=47: must be even", "take 48"]),
        (
            &["training.batch=many"],
            &["--set training.batch=many: `training.batch`: expected a number from 0"],
        ),
        (&["training.batch=0"], &["--set training.batch=0: must lie between 1 and 1024"]),
        (
            &["lens=cooke-triplet-nominl"],
            &[
                "--set lens=cooke-triplet-nominl: neither a file nor built in",
                "did you mean \"cooke-triplet-nominal\"?",
            ],
        ),
        (&["psf.grid"], &["--set psf.grid: there is no `=`", "training.steps=400"]),
        (&["psf.grid=48", "--set", "psf.grid=64"], &["this key is set twice"]),
        (&["training.steps=5", "--steps", "4"], &["--set training.steps=5: --steps decides that as well"]),
        (
            &["variant.best.noise=off"],
            &["there is no `best` in this list", "nominal, spot-optimised, end-to-end"],
        ),
    ] {
        let args = [&["design", "tiny.toml", "--print-config", "--set"][..], set].concat();
        run_fails(folder.path(), &args, 2, needles);
    }
    // What the file itself has wrong is shown there.
    write(folder.path(), "wrong.toml", &tiny_experiment().replace("batch = 1\n", "batch = 0\n"));
    run_fails(
        folder.path(),
        &["design", "wrong.toml", "--print-config", "--set", "psf.grid=48"],
        2,
        &["wrong.toml:", "`batch = 0`: must lie between"],
    );
}

//! `petzval glass`, and catalogues that the user chose.

use std::path::Path;

use crate::common::{data, outcome, petzval, read, run_fails, run_ok};
use serde_json::Value;

const LENS: &str = "cooke-triplet-nominal";

/// N-SF11 with an index that no other glass has.
const AGF: &str = "CC test\nNM N-SF11 2 785257 1.98216 25.68 0 1\n\
    CD 2.46 1.34282066E-02 3.08177248E-01 5.95e-2 1.48746e0 1.74e2\nLD 0.37 0.6\n\
    NM ONLY-HERE 1 0 1.5168 64.2 0 0\n\
    CD 2.2702566 -0.0091988101 0.011609706 -7.6123911e-05 2.8558727e-05 -1.2566486e-06\n\
    IT 0.4 0.99 10\nIT 0.5 what 10\n";

fn write(folder: &Path, name: &str, text: &str) {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, text).unwrap();
}

fn flint_nd(shown: &Value) -> f64 {
    shown["surfaces"][2]["nd"].as_f64().unwrap()
}

#[test]
fn find_gives_the_nearest_glasses_first() {
    let folder = tempfile::tempdir().unwrap();
    let found = run_ok(
        folder.path(),
        &["glass", "find", "--nd", "1.5168", "--vd", "64.17", "--maker", "schott", "--json"],
    );
    let found = found.json();
    let found = found.as_array().unwrap();
    assert_eq!((found.len(), &found[0]["name"]), (10, &Value::from("N-BK7")));
    let distance: Vec<f64> = found.iter().map(|g| g["distance"].as_f64().unwrap()).collect();
    assert!(distance[0] < 0.01 && distance.is_sorted(), "{distance:?}");
    for glass in found {
        let (nd, vd) = (glass["nd"].as_f64().unwrap(), glass["vd"].as_f64().unwrap());
        let by_hand = ((nd - 1.5168) / 0.01).hypot(vd - 64.17);
        assert!((by_hand - glass["distance"].as_f64().unwrap()).abs() < 1e-12);
        assert_eq!(glass["maker"], "Schott");
    }
    let few = run_ok(folder.path(), &["glass", "find", "--nd", "1.6", "--vd", "50", "--count", "3"]);
    assert_eq!(few.stdout.lines().count(), 4, "{}", few.stdout);
    let refused = [
        ("0.5", "50", "--nd 0.5: must lie between 1 and 5"),
        ("1.5", "-5", "--vd -5: must lie between 1 and"),
    ];
    for (nd, vd, says) in refused {
        run_fails(folder.path(), &["glass", "find", "--nd", nd, "--vd", vd], 2, &[says]);
    }
    run_ok(folder.path(), &["glass", "find", "--nd", "5", "--vd", "50"]);
    run_fails(folder.path(), &["glass", "find", "--nd", "1.5", "--vd", "nan"], 2, &["--vd"]);
    run_fails(
        folder.path(),
        &["glass", "find", "--nd", "1.5", "--vd", "50", "--maker", "Nobody"],
        2,
        &["no such glass"],
    );
}

#[test]
fn show_agrees_with_the_data_sheet() {
    let folder = tempfile::tempdir().unwrap();
    let shown = run_ok(folder.path(), &["glass", "show", "n-bk7", "--json"]).json();
    let number = |key: &str| shown[key].as_f64().unwrap();
    // Schott's data sheet: n_F, n_C, P_gF and its anomaly, expansion, dn/dT relative 20 to 40 C at g, internal transmittance at h.
    for (key, printed, half) in [
        ("n_f", 1.52238, 5e-6),
        ("n_c", 1.51432, 5e-6),
        ("p_gf", 0.5349, 5e-5),
        ("p_gf_anomaly", -0.0009, 5e-5),
    ] {
        assert!((number(key) - printed).abs() <= half, "{key} {}", number(key));
    }
    assert_eq!(shown["expansion"][0]["per_k"], 7.1e-6);
    let lines = shown["lines"].as_array().unwrap();
    let line = |name: &str| lines.iter().find(|l| l["line"] == name).unwrap();
    assert!((line("g")["dn_dt_per_k"].as_f64().unwrap() - 3.5e-6).abs() < 0.051e-6);
    assert!((line("h")["transmission_10_mm"].as_f64().unwrap() - 0.997).abs() < 6e-4);
    let text =
        run_ok(folder.path(), &["glass", "show", "N-BK7", "--temperature", "-40", "--pressure", "0"]).stdout;
    assert!(
        text.contains("sellmeier = {")
            && text.contains("mean from 20 to 40 C")
            && text.contains("-40 C, 0 atm")
            && !text.contains("extinction"),
        "{text}"
    );
    run_fails(
        folder.path(),
        &["glass", "show", "NBK7"],
        2,
        &["no glass is called `NBK7`", "names are N-BK7"],
    );
    let far = run_fails(folder.path(), &["glass", "show", "KRYPTONITE"], 2, &["glass list"]);
    assert!(!far.says("AIR"), "{}", far.stderr);
    let air = run_ok(folder.path(), &["glass", "show", "AIR"]).stdout;
    assert!(air.contains("PgF                -\n") && !air.contains("NaN") && !air.contains("inf"), "{air}");
    run_fails(
        folder.path(),
        &["glass", "show", "SILICA", "--temperature", "30"],
        2,
        &["does not say how SILICA changes"],
    );
    run_fails(folder.path(), &["glass", "show", "N-BK7", "--temperature", "1e9"], 2, &["--temperature"]);
}

#[test]
fn equal_names_of_several_makers_are_distinguished_and_reported() {
    let folder = tempfile::tempdir().unwrap();
    // The user's own catalogue has an N-SF11 too, which takes precedence; Schott's needs its maker.
    write(folder.path(), "mine/Own.agf", AGF);
    let warned = run_ok(folder.path(), &["--glasses", "mine", "lens", "show", LENS, "--json"]);
    let warnings = warned.json()["warnings"].to_string();
    assert!(
        warnings.contains("N-SF11 is that of Own; Schott has another") && warnings.contains("Schott:N-SF11"),
        "{warnings}"
    );
    // The formula of that catalogue ends at 0.6 um, the lens is used up to 0.62 um.
    assert!(
        warnings.contains("the formula of N-SF11 holds from 0.37 to 0.6 um, not at 0.62 um"),
        "{warnings}"
    );
    // Every verb that reads a lens reports this once, and not on stdout.
    for args in [
        &["lens", "show", LENS][..],
        &["lens", "show", LENS, "--json"],
        &["lens", "analyze", LENS, "--out", "analysis", "--json"],
        &["lens", "tolerance", LENS, "--trials", "0", "--json"],
        &["lens", "optimize", LENS, "--out", "better", "--iterations", "1"],
        &["psf", LENS, "--out", "psf", "--fields", "2", "--pupil-cells", "32", "--json"],
    ] {
        let done = run_ok(folder.path(), &[&["--glasses", "mine"], args].concat());
        for once in ["N-SF11 is that of Own", "the formula of N-SF11 holds"] {
            assert_eq!(done.stderr.matches(once).count(), 1, "{args:?}\n{}", done.stderr);
            assert!(args.contains(&"--json") || !done.stdout.contains(once), "{}", done.stdout);
        }
        if args.contains(&"--json") {
            done.json();
        }
    }
    let shown = run_ok(folder.path(), &["--glasses", "mine", "glass", "show", "N-SF11", "--json"]).json();
    assert_eq!(
        (&shown["maker"], &shown["others_of_this_name"][0]),
        (&Value::from("Own"), &Value::from("SCHOTT:N-SF11"))
    );
    let lens = read(&data(&format!("lenses/{LENS}.toml"))).replace("\"N-SF11\"", "\"schott:N-SF11\"");
    write(folder.path(), "lens.toml", &lens);
    let shown = run_ok(folder.path(), &["--glasses", "mine", "lens", "show", "lens.toml", "--json"]).json();
    assert!((flint_nd(&shown) - 1.78472).abs() < 1e-5, "{}", flint_nd(&shown));
    assert!(!shown["warnings"].to_string().contains("N-SF11"), "{}", shown["warnings"]);
}

#[test]
fn chosen_catalogues_take_precedence_in_every_verb_and_later_ones_over_earlier() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "first.agf", AGF);
    write(folder.path(), "second.toml", "[glass.N-SF11]\nn = 1.9\n[glass.MINE]\nnd = 1.6\nvd = 50.0\n");
    let nd = |args: &[&str]| {
        flint_nd(&run_ok(folder.path(), &[args, &["lens", "show", LENS, "--json"]].concat()).json())
    };
    let built_in = nd(&[]);
    assert!((built_in - 1.78472).abs() < 1e-5);
    let first = nd(&["--glasses", "first.agf"]);
    assert!(first > 1.9, "{first}");
    assert_eq!(nd(&["--glasses", "first.agf", "--glasses", "second.toml"]), 1.9);
    assert_eq!(nd(&["--glasses", "second.toml", "--glasses", "first.agf"]), first);

    let environment = |list: &str, args: &[&str]| {
        let mut command = petzval(folder.path());
        let output =
            command.env("PETZVAL_GLASSES", list).args(args).args(["lens", "show", LENS, "--json"]).output();
        flint_nd(&outcome(output.unwrap()).json())
    };
    let list = std::env::join_paths(["second.toml", "first.agf"]).unwrap().into_string().unwrap();
    assert_eq!(environment(&list, &[]), first);
    assert_eq!(environment(&list, &["--glasses", "second.toml"]), 1.9);
    assert_eq!(environment("", &[]), built_in);

    // A single ray is traced through the chosen glass too; the option may follow the verb.
    let ray = ["lens", "trace", LENS, "--field", "5", "--wavelength", "0.55", "--pupil", "0,0.5", "--json"];
    let y = |args: &[&str]| {
        run_ok(folder.path(), &[&ray, args].concat()).json()["image"]["y_mm"].as_f64().unwrap()
    };
    assert_ne!(y(&[]), y(&["--glasses", "first.agf"]));

    let found =
        ["glass", "find", "--nd", "1.6", "--vd", "50", "--count", "1", "--json", "--glasses", "second.toml"];
    assert_eq!(run_ok(folder.path(), &found).json()[0]["name"], "MINE");
    let listed = run_ok(folder.path(), &["glass", "list", "--glasses", "first.agf", "--maker", "first"]);
    assert!(
        listed.stdout.contains("ONLY-HERE") && listed.says("first.agf: line 8: `IT 0.5 what 10`"),
        "{listed:?}"
    );
}

#[test]
fn pages_of_refractiveindex_info_are_named_after_their_path() {
    let folder = tempfile::tempdir().unwrap();
    let page = "DATA:\n  - type: formula 1\n    wavelength_range: 0.21 6.7\n    coefficients: 0 0.6961663 0.0684043 0.4079426 0.1162414 0.8974794 9.896161\n";
    write(folder.path(), "rii/main/SiO2/nk/Malitson.yml", page);
    write(folder.path(), "rii/specs/corning/Glass.yml", page);
    write(folder.path(), "rii/specs/corning/about.yml", "NAMES:\n  - Corning\n");
    write(
        folder.path(),
        "rii/main/Au/nk/K-only.yml",
        "DATA:\n  - type: tabulated k\n    data: |\n        0.5 1.0\n",
    );
    let show = |name: &str| run_ok(folder.path(), &["--glasses", "rii", "glass", "show", name, "--json"]);
    let silica = show("SiO2-Malitson");
    assert!((silica.json()["nd"].as_f64().unwrap() - 1.458464).abs() < 1e-6);
    assert!(silica.says("K-only.yml") && silica.says("no refractive index"), "{}", silica.stderr);
    assert_eq!(show("Glass").json()["maker"], "corning");
    // By itself, a page that cannot be read is an error.
    let args = ["--glasses", "rii/main/Au/nk/K-only.yml", "glass", "list"];
    run_fails(folder.path(), &args, 2, &["K-only.yml:2", "no refractive index"]);
}

#[test]
fn a_folder_may_hold_other_files_and_invalid_glasses() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "mine/Own.agf", &("NM NOTHING 2 0 1.6 50 0 0\nCD 0 0 0 0 0 0\n".to_owned() + AGF));
    write(folder.path(), "mine/lens.toml", &read(&data(&format!("lenses/{LENS}.toml"))));
    write(folder.path(), "mine/prose.agf", "nothing but words\n");
    let listed = ["--glasses", "mine", "glass", "list", "--maker", "own"];
    let done = run_ok(folder.path(), &listed);
    assert!(done.stdout.contains("ONLY-HERE") && !done.stdout.contains("NOTHING"), "{}", done.stdout);
    for says in [
        "Own.agf: line 2: `CD 0 0 0 0 0 0`: the formula of `NOTHING` has no term: the glass is left out",
        "lens.toml: line",
        "no such key here: the file is left out",
        "prose.agf: line 1: there is no glass in this file: the file is left out",
    ] {
        assert!(done.says(says), "{says}\n{}", done.stderr);
    }
    // By itself such a file is an error, and so is a catalogue with a mistake in it anywhere.
    let alone = ["--glasses", "mine/lens.toml", "glass", "list"];
    run_fails(folder.path(), &alone, 2, &["lens.toml", "no such key here"]);
    write(folder.path(), "mine/bad.toml", "[glass.A]\nnd = 1.5\n");
    run_fails(folder.path(), &listed, 2, &["bad.toml", "glass `A` has no formula"]);
}

#[test]
fn a_misprinted_glass_is_refused_wherever_it_is_named() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "mine.agf", &AGF.replace("ONLY-HERE 1 0 1.5168 64.2", "ONLY-HERE 1 0 1.6 50"));
    let lens = read(&data(&format!("lenses/{LENS}.toml"))).replace("\"N-SF11\"", "\"ONLY-HERE\"");
    write(folder.path(), "lens.toml", &lens);
    let both = "`ONLY-HERE` was left out: the formula gives nd = 1.51680, and 1.6 is printed";
    for args in [&["lens", "show", "lens.toml"][..], &["glass", "show", "ONLY-HERE"]] {
        run_fails(folder.path(), &[&["--glasses", "mine.agf"], args].concat(), 2, &[both]);
    }
    // Glasses that are right can be used beside it.
    run_ok(folder.path(), &["--glasses", "mine.agf", "glass", "show", "N-SF11"]);
}

#[test]
fn no_built_in_glass_stands_in_for_one_that_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let others: String =
        (0..3).map(|i| format!("NM X{i} 1 0 1.7 64.2 0 0\nCD 2.27 -0.0092 0.0116\n")).collect();
    write(folder.path(), "mine.agf", &(others + &AGF.replace("1.98216 25.68", "1.7 25.68")));
    for args in [["lens", "show", LENS], ["glass", "show", "N-SF11"]] {
        let says =
            ["`N-SF11` was left out: the formula gives nd = 1.98", "and 1.7 is printed", "SCHOTT:N-SF11"];
        run_fails(folder.path(), &[&["--glasses", "mine.agf"][..], &args].concat(), 2, &says);
    }
    // The built-in glass has to be named with its maker.
    let lens = read(&data(&format!("lenses/{LENS}.toml"))).replace("\"N-SF11\"", "\"SCHOTT:N-SF11\"");
    write(folder.path(), "lens.toml", &lens);
    let shown = run_ok(folder.path(), &["lens", "show", "lens.toml", "--json", "--glasses", "mine.agf"]);
    assert!((flint_nd(&shown.json()) - 1.78472).abs() < 1e-5);
    // A broken page of refractiveindex.info in a folder is refused by its name, too.
    write(
        folder.path(),
        "rii/specs/schott/N-SF11.yml",
        "DATA:\n  - type: tabulated k\n    data: |\n        0.5 1.0\n",
    );
    let page = "DATA:\n  - type: formula 1\n    wavelength_range: 0.21 6.7\n    coefficients: 0 0.6961663 0.0684043 0.4079426 0.1162414 0.8974794 9.896161\n";
    write(folder.path(), "rii/specs/schott/OTHER.yml", page);
    run_fails(
        folder.path(),
        &["--glasses", "rii", "lens", "show", LENS],
        2,
        &["`N-SF11` was left out", "no refractive index"],
    );
}

#[test]
fn every_kind_of_warning_about_a_catalogue_is_said_and_its_repeats_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let text = "words\n".repeat(2000) + AGF + "NM LATE 1 0 1.7 64.2 0 0\nCD 2.27 -0.0092 0.0116\n";
    write(folder.path(), "mine.agf", &text);
    let shown = run_ok(folder.path(), &["lens", "show", LENS, "--glasses", "mine.agf"]);
    for says in [
        "(and 1999 more like it)",
        "line 2008: `IT 0.5 what 10`: the numbers do not fit the record: left out",
        "line 2009: `LATE`: the formula gives nd = 1.5",
        "`petzval glass list` shows every line",
    ] {
        assert!(shown.says(says), "{says}\n{}", shown.stderr);
    }
    assert_eq!(shown.stderr.matches("mine.agf: ").count(), 3, "{}", shown.stderr);
    let all = run_ok(folder.path(), &["glass", "list", "--glasses", "mine.agf"]);
    assert_eq!(all.stderr.matches("mine.agf: ").count(), 2002, "{}", all.stderr);
}

#[test]
fn an_unreadable_catalogue_is_reported_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bad.agf", "NM A 2 0 1.5 60 0 0\nCD 1.0 x\n");
    write(folder.path(), "bad.toml", "[glass.A]\nnd = 1.5\n");
    write(folder.path(), "bad.yml", "DATA: [\n");
    write(folder.path(), "glass.txt", "A");
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    for (path, says) in [
        ("bad.agf", "bad.agf:2: `CD 1.0 x`: these are not coefficients of `A`"),
        ("bad.toml", "glass `A` has no formula"),
        ("bad.yml", "this is not YAML"),
        ("glass.txt", "this is no glass catalogue"),
        ("empty", "there is no glass in this folder"),
        ("nowhere.agf", "there is no such file or folder"),
    ] {
        run_fails(folder.path(), &["lens", "show", LENS, "--glasses", path], 2, &[path, says]);
    }
}

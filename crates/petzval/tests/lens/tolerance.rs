//! `petzval lens tolerance`: sensitivities and random lenses of the nominal triplet, files, and wrong input.

use crate::common::{self, read, read_json, run, run_fails, run_ok};
use serde_json::Value;

const LENS: &str = "cooke-triplet-nominal";

fn number(v: &Value) -> f64 {
    v.as_f64().unwrap_or_else(|| panic!("no number: {v}"))
}

#[test]
fn the_table_lists_the_greatest_effects_and_random_lenses_agree() {
    let folder = tempfile::tempdir().unwrap();
    let all = ["lens", "tolerance", LENS, "--trials", "300", "--limit", "13.4", "--json"];
    let found = run_ok(folder.path(), &all).json();
    assert_eq!(
        (&found["merit"], &found["unit"], &found["better"]),
        (&"RMS spot (root mean square over the fields)".into(), &"um".into(), &"lower".into())
    );
    let nominal = number(&found["nominal"]);
    assert!((nominal - 13.15).abs() < 0.05, "{nominal}");
    let rows = found["sensitivities"].as_array().unwrap();
    let loss = |row: &Value| number(&row["merit_at_plus"]).max(number(&row["merit_at_minus"])) - nominal;
    assert!(rows.windows(2).all(|w| loss(&w[0]) >= loss(&w[1]) - 1e-12), "sorted by effect");
    // Decentres and tilts of a symmetric lens: no slope, and as much at either end.
    let moved =
        rows.iter().find(|r| r["name"] == "surfaces 6-7 decentre y").expect("an element that is decentred");
    assert!(number(&moved["derivative"]).abs() < 1e-9);
    assert!((number(&moved["merit_at_plus"]) - number(&moved["merit_at_minus"])).abs() < 1e-6);
    // A thickness: slope times tolerance is the change at its end, nearly.
    let thick = rows.iter().find(|r| r["name"] == "surface 1 thickness").unwrap();
    let change = 0.5 * (number(&thick["merit_at_plus"]) - number(&thick["merit_at_minus"]));
    assert!((number(&thick["derivative"]) * number(&thick["tolerance"]) / change - 1.0).abs() < 0.02);

    let random = &found["monte_carlo"];
    assert_eq!((&random["trials"], &random["failed"]), (&300.into(), &0.into()));
    let estimate = &found["estimate"];
    let spread = number(&random["standard_deviation"]) / number(&estimate["standard_deviation"]);
    assert!((spread - 1.0).abs() < 0.2, "{spread}");
    assert!((number(&random["mean"]) - number(&estimate["mean"])).abs() < 0.05);
    let percentiles: Vec<f64> =
        random["percentiles"].as_array().unwrap().iter().map(|p| number(&p["merit"])).collect();
    assert!(percentiles.windows(2).all(|w| w[0] <= w[1]));
    let curve = random["yield_curve"].as_array().unwrap();
    let met = curve.iter().filter(|p| number(&p[0]) <= 13.4).count() as f64 / 300.0;
    assert!((number(&random["yield_at_limit"]) - met).abs() < 1e-12);
    // The same seed gives the same lenses on any number of threads, another one others.
    let again = run_ok(folder.path(), &[&all[..], &["--threads", "1"]].concat()).json();
    assert_eq!(found, again);
    let other = run_ok(folder.path(), &[&all[..], &["--seed", "2"]].concat()).json();
    assert_ne!(found["monte_carlo"]["mean"], other["monte_carlo"]["mean"]);
}

#[test]
fn the_folder_holds_figures_pictures_and_the_worst_lenses() {
    let folder = tempfile::tempdir().unwrap();
    let args = [
        "lens",
        "tolerance",
        LENS,
        "--grade",
        "commercial",
        "--trials",
        "40",
        "--worst",
        "2",
        "--out",
        "made",
    ];
    let shown = run_ok(folder.path(), &args);
    assert!(shown.stdout.contains("40 lenses at random") && shown.stdout.contains("root sum square"));
    let out = folder.path().join("made");
    let figures = read_json(&out.join("tolerance.json"));
    let worst = figures["monte_carlo"]["worst"].as_array().unwrap();
    assert_eq!(worst.len(), 2);
    for w in worst {
        // Read again, the written lens has about this merit, which here counts one side of the field only.
        let name = format!("made/lens-{:05}.toml", w["trial"].as_u64().unwrap());
        let lens = run_ok(folder.path(), &["lens", "show", &name, "--json"]).json();
        let one_side: Vec<f64> =
            lens["rms_spot_poly_real_stop_um"].as_array().unwrap().iter().map(number).collect();
        let rms = (one_side.iter().map(|r| r * r).sum::<f64>() / one_side.len() as f64).sqrt();
        assert!((rms / number(&w["merit"]) - 1.0).abs() < 0.2, "{rms} {w}");
        assert!(read(&folder.path().join(&name)).contains("placement"));
    }
    let trials = read(&out.join("trials.csv"));
    assert_eq!(trials.lines().count(), 41);
    let columns = trials.lines().next().unwrap().split(',').count();
    assert!(trials.lines().all(|l| l.split(',').count() == columns) && columns > 40);
    assert!(read(&out.join("sensitivities.csv")).starts_with("quantity,first_surface"));
    for picture in ["yield.svg", "sensitivity.svg"] {
        let svg = read(&out.join(picture));
        assert!(svg.starts_with("<svg") && svg.contains("RMS spot"), "{picture}");
    }
    // The page has its sections, the figures of the data, and the worst lenses.
    let page = read(&out.join("tolerance.html"));
    for part in ["Summary", "Lenses made at random", "What each tolerance costs", "The worst lenses"] {
        assert!(page.contains(&format!("<h2>{part}</h2>")), "{part}");
    }
    assert!(page.contains(&format!("{:.3}\u{a0}µm", number(&figures["nominal"]))));
    for w in worst {
        assert!(page.contains(&format!("<th scope=\"row\">{}</th>", w["trial"])), "{w}");
    }
    assert_eq!(page.matches("class=\"steps\"").count(), 1, "a histogram");
    // The tolerances as a file give the same lenses.
    let again = [
        "lens",
        "tolerance",
        LENS,
        "--tolerances",
        "made/tolerances.toml",
        "--trials",
        "40",
        "--worst",
        "2",
        "--json",
    ];
    assert_eq!(run_ok(folder.path(), &again).json(), figures);
}

#[test]
fn contrast_inverse_tolerances_and_other_compensators() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("few.toml"),
        "distribution = \"uniform\"\n\n[[tolerance]]\nsurface = 1\nradius_percent = 0.1\n\n\
         [[tolerance]]\nelement = [3, 4]\ndecenter_y_mm = 0.05\nform_um = {}\n\n\
         [[compensator]]\nelement = [6, 7]\nparameter = \"decenter_y_mm\"\ntravel = 0.2\n",
    )
    .unwrap();
    let few = ["lens", "tolerance", LENS, "--tolerances", "few.toml", "--trials", "4", "--json"];
    let mtf = [&few[..], &["--merit", "mtf", "--frequency", "20", "--inverse", "0.05"]].concat();
    let found = run_ok(folder.path(), &mtf).json();
    assert_eq!((&found["merit"], &found["better"]), (&"MTF at 20/mm".into(), &"higher".into()));
    let nominal = number(&found["nominal"]);
    assert!(nominal > 0.3 && nominal < 1.0, "{nominal}");
    assert_eq!(found["sensitivities"].as_array().unwrap().len(), 2);
    for row in found["sensitivities"].as_array().unwrap() {
        assert!(number(&row["inverse_tolerance"]) > 0.0);
        assert_eq!(row["distribution"], "uniform");
    }
    let set = found["monte_carlo"]["compensators"].as_array().unwrap();
    assert_eq!(set.len(), 2);
    assert!(number(&set[1]["least"]) >= -0.2 && number(&set[1]["greatest"]) <= 0.2);
    // A number as wide as its column stands apart from the one before.
    std::fs::write(
        folder.path().join("one.toml"),
        "[[tolerance]]\nsurface = 7\nirregularity_fringes = 0.5\n",
    )
    .unwrap();
    let one =
        ["lens", "tolerance", LENS, "--tolerances", "one.toml", "--trials", "0", "--inverse", "0.000001"];
    let row = run_ok(folder.path(), &one).stdout;
    let row: Vec<&str> =
        row.lines().find(|line| line.starts_with("surface 7")).unwrap().split_whitespace().collect();
    assert_eq!((row.len(), row.last()), (10, Some(&"fringes")), "{row:?}");
    // No compensators and no random lenses.
    let still = ["lens", "tolerance", LENS, "--compensate", "none", "--trials", "0", "--json"];
    let found = run_ok(folder.path(), &still).json();
    assert_eq!(found["monte_carlo"], Value::Null);
    assert!(found["sensitivities"].as_array().unwrap().iter().any(|r| r["name"] == "surface 7 thickness"));
}

#[test]
fn lenses_that_cannot_be_built_are_counted_and_their_tolerance_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let text = "distribution = \"uniform\"\n\n[[tolerance]]\nsurface = 1\nthickness_mm = 8.0\n";
    std::fs::write(folder.path().join("thick.toml"), text).unwrap();
    let args = ["lens", "tolerance", LENS, "--tolerances", "thick.toml", "--trials", "12", "--worst", "12"];
    let said = run_ok(folder.path(), &[&args[..], &["--out", "made"]].concat());
    assert!(said.says("thick.toml:5: `thickness_mm = 8.0`: wider than the 4.0140 mm"), "{}", said.stderr);
    for words in ["cannot be built", "not built", "no estimate"] {
        assert!(said.stdout.contains(words), "{words}: {}", said.stdout);
    }
    // Each of the worst lenses with a merit is written, and can be read.
    let figures = read_json(&folder.path().join("made/tolerance.json"));
    let random = &figures["monte_carlo"];
    let worst = random["worst"].as_array().unwrap();
    assert_eq!(worst.len() as u64, 12 - random["unbuildable"].as_u64().unwrap());
    for lens in worst.iter().filter(|lens| !lens["merit"].is_null()) {
        let name = format!("made/lens-{:05}.toml", lens["trial"].as_u64().unwrap());
        run_ok(folder.path(), &["lens", "show", &name]);
    }
}

#[test]
fn every_built_in_lens_has_tolerances() {
    let folder = tempfile::tempdir().unwrap();
    for lens in
        ["eight-element-achromat", "cooke-triplet-spot-monochromatic", "cooke-triplet-large-fov-hardware-isp"]
    {
        let found =
            run_ok(folder.path(), &["lens", "tolerance", lens, "--grade", "high", "--trials", "6", "--json"])
                .json();
        assert_eq!(found["monte_carlo"]["failed"], 0, "{lens}");
        assert!(number(&found["estimate"]["mean"]) > 0.0);
    }
}

#[test]
fn wrong_input_is_refused_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    for (args, needles) in [
        (&["--trials", "2000000"][..], &["--trials", "at most 1000000"][..]),
        (&["--merit", "mtf", "--frequency", "0"], &["--frequency", "cycles per mm"]),
        (&["--merit", "mtf", "--frequency", "500"], &["--frequency 500", "resolves nothing beyond 383"]),
        (&["--limit", "-1"], &["--limit", "um for the RMS spot"]),
        (&["--merit", "mtf", "--limit", "1.5"], &["--limit 1.5: no MTF is above 1", "between 0 and 1"]),
        (&["--inverse", "nan"], &["--inverse", "above 0"]),
        (&["--tolerances", "absent.toml"], &["absent.toml", "takes a TOML file"]),
        (&["--merit", "wavefront"], &["wavefront", "rms, mtf"]),
    ] {
        run_fails(folder.path(), &[&["lens", "tolerance", LENS][..], args].concat(), 2, needles);
    }
    run_fails(folder.path(), &["lens", "tolerance", "no-such-lens"], 2, &["no-such-lens"]);
    let table = |text: &str| format!("# a tolerance file\n[[tolerance]]\n{text}\n");
    for (text, needles) in [
        (table("surface = 9\nconic = 0.1"), &["t.toml:3", "surface 9 does not exist", "1 to 7"][..]),
        (
            table("surface = 1\nradius_mm = -0.1"),
            &["t.toml:4", "`radius_mm = -0.1`", "a finite number from 0"],
        ),
        (table("surface = 1\nradius_mm = nan"), &["t.toml:4", "a finite number from 0"]),
        (table("surface = 5\nradius_mm = 0.1"), &["t.toml:4", "surface 5 has no radius"]),
        (table("surface = 2\nindex = 0.001"), &["t.toml:4", "surface 2 has no glass behind it"]),
        (
            table("surface = 1\nradius_um = 0.1"),
            &["t.toml:4", "`radius_um = 0.1`", "no such key here", "radius_mm"],
        ),
        (table("surface = 1\ntilt_arcmin = \"a lot\""), &["t.toml:4", "tilt_arcmin"]),
        (table("surface = 1"), &["t.toml:2", "this table gives no tolerance"]),
        (table("tilt_arcmin = 1.0"), &["t.toml:2", "no surface is named", "element = [1, 2]"]),
        (table("element = [1]\ntilt_arcmin = 1.0"), &["t.toml:3", "its first and its last surface"]),
        (table("element = [4, 3]\ntilt_arcmin = 1.0"), &["t.toml:3", "comes before the first"]),
        (table("element = [1, 2]\nindex = 0.001"), &["t.toml:4", "can only be moved"]),
        (table("surface = 1\nelement = [1, 2]\ntilt_arcmin = 1.0"), &["t.toml:4", "keep one of"]),
        (table("surface = 1\nform_um = { r5 = 0.1 }"), &["t.toml:4", "no form error `r5`", "even orders"]),
        (
            table("surface = 1\nconic = 0.1\ndistribution = \"gauss\""),
            &["t.toml:5", "gauss", "\"parabolic\""],
        ),
        (
            table("surface = 1\nconic = 0.1\n[[tolerance]]\nsurface = 1\nconic = 0.2"),
            &["t.toml:7", "already"],
        ),
        (
            table("surface = 1\nradius_mm = 0.1\npower_fringes = 2"),
            &["t.toml:5", "`power_fringes = 2`", "already"],
        ),
        (
            table("surface = 1\nradius_percent = 0.1\n[[tolerance]]\nsurface = 1\nradius_mm = 0.1"),
            &["t.toml:7", "already"],
        ),
        ("grade = \"good\"".to_owned(), &["t.toml:1", "no grade `good`", "\"precision\""]),
        (
            "[[compensator]]\nsurface = 1\nparameter = \"index\"".to_owned(),
            &["t.toml:3", "cannot be adjusted", "thickness_mm"],
        ),
        (
            "[[compensator]]\nsurface = 1\nparameter = \"shift_mm\"\ntravel = 0".to_owned(),
            &["t.toml:4", "a finite number above 0"],
        ),
        ("[[tolerance]\nsurface = 1".to_owned(), &["t.toml:1"]),
        (String::new(), &["nothing is off", "--grade"]),
    ] {
        std::fs::write(folder.path().join("t.toml"), &text).unwrap();
        run_fails(folder.path(), &["lens", "tolerance", LENS, "--tolerances", "t.toml"], 2, needles);
    }
    // A lens without light in its outermost field.
    let lens = read(&common::data("lenses/cooke-triplet-nominal.toml"));
    let wide = lens.replace("angle_deg = [0.0, 5.0, 10.0, 15.0]", "angle_deg = [0.0, 5.0, 10.0, 60.0]");
    std::fs::write(folder.path().join("wide.toml"), wide).unwrap();
    let outcome = run(folder.path(), &["lens", "tolerance", "wide.toml"]);
    assert!(outcome.code == Some(2) && outcome.says("brings no light"), "{outcome:?}");
}

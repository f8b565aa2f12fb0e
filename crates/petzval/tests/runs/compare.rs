//! `petzval compare` and `experiment run-all`, on runs that take about a second each; and networks in place of ray tracing, in such a run.

use crate::common::*;

#[test]
fn all_experiments_are_run_with_every_seed_and_compared_and_the_same_command_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    write_tiny(folder.path());
    let other = tiny_experiment().replace("white_e = 16000", "white_e = 8000");
    std::fs::write(folder.path().join("dim.toml"), other.replace("name = \"Cooke", "name = \"Dim Cooke"))
        .unwrap();
    let all = ["experiment", "run-all", "--only", "tiny.toml,dim.toml", "--seeds", "1,2", "--out", "all"];
    let said = run_ok(folder.path(), &all);
    for run in ["tiny-seed-1", "tiny-seed-2", "dim-seed-1", "dim-seed-2"] {
        assert!(folder.path().join("all").join(run).join("metrics.json").is_file(), "{run}");
    }
    let text = &said.stdout;
    assert_eq!(text.matches("\n## ").count(), 2, "{text}");
    assert!(text.contains("Seeds 1, 2; 4 steps") && text.contains("| against |"), "{text}");
    // Means and deviations are those of the runs.
    let psnr = |run: &str| {
        let rows = read_json(&folder.path().join("all").join(run).join("metrics.json"))["rows"].clone();
        rows[0]["psnr_db"].as_f64().unwrap()
    };
    let (a, b) = (psnr("tiny-seed-1"), psnr("tiny-seed-2"));
    let wanted = petzval_report::with_error(0.5 * (a + b), (a - b).abs() / 2.0_f64.sqrt(), 2);
    assert!(text.contains(&format!(" {wanted} |")), "{wanted} in {text}");
    assert!(text.contains("End-to-end over 2 seeds, against nominal: "), "{text}");
    let page = read(&folder.path().join("all/comparison.html"));
    assert!(page.contains("Runs compared") && page.contains("Dim Cooke") && page.contains("<img"));
    // What differs between the experiments has columns of its own.
    let head = "| experiment | seeds | exposure.white_e | camera |";
    assert!(text.starts_with("What differs between the runs") && text.contains(head), "{text}");
    let row = "| Dim Cooke triplet for image quality, with a software ISP | 1 2 | 8000";
    assert!(text.contains(row) && page.contains("exposure.white_e"), "{text}");

    // Finished runs are kept as they are; what is missing is made.
    let before = snapshot(&folder.path().join("all/tiny-seed-1"));
    std::fs::remove_dir_all(folder.path().join("all/dim-seed-2")).unwrap();
    let said = run_ok(folder.path(), &all);
    assert!(said.says("dim.toml, seed 2") && !said.says("tiny.toml, seed"), "{}", said.stderr);
    assert_same_files(&before, &snapshot(&folder.path().join("all/tiny-seed-1")));

    // Runs with another budget, or twice the same sample, would be taken for what they are not.
    run_fails(folder.path(), &[&all[..], &["--steps", "3"]].concat(), 2, &["training.steps is 4", "--out"]);
    // So would runs of a file whose lens or sensor became another since, by name or by content.
    let dim = read(&folder.path().join("dim.toml"));
    for (key, other, said) in [
        ("lens", "cooke-triplet-spot", "another lens than cooke-triplet-spot"),
        ("sensor", "imx249-calibrated", "not those that this run began with: the sensor"),
    ] {
        let mut changed: toml::Table = dim.parse().unwrap();
        changed.insert(key.to_owned(), toml::Value::String(other.to_owned()));
        std::fs::write(folder.path().join("dim.toml"), changed.to_string()).unwrap();
        run_fails(folder.path(), &all, 2, &["dim-seed-1", said, "--out"]);
    }
    std::fs::write(folder.path().join("dim.toml"), &dim).unwrap();
    run_fails(folder.path(), &["compare", "all/dim-seed-1", "all/dim-seed-1"], 2, &["same seed"]);
    let json = run_ok(folder.path(), &["compare", "all/dim-seed-1", "all/dim-seed-2", "--json"]).json();
    assert_eq!(
        (&json[0]["seeds"], &json[0]["differs"]),
        (&serde_json::json!([1, 2]), &serde_json::json!([]))
    );
    assert!(folder.path().join("comparison.html").is_file());

    // The same figures as comma-separated values: of both seeds together, and of one without a deviation.
    let csv = |runs: &[&str]| -> Vec<Vec<String>> {
        let args = [&["compare"], runs, &["--csv", "figures.csv", "--force"]].concat();
        assert!(run_ok(folder.path(), &args).stdout.contains("figures: figures.csv"));
        // The title holds a comma, and is quoted.
        let text = read(&folder.path().join("figures.csv"));
        let text = text.replace("\"Cooke triplet for image quality, with a software ISP\"", "Cooke triplet");
        text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
    };
    let (both, one) = (csv(&["all/tiny-seed-1", "all/tiny-seed-2"]), csv(&["all/tiny-seed-1"]));
    let at = |table: &[Vec<String>], row: usize, name: &str| {
        let column =
            table[0].iter().position(|head| head == name).unwrap_or_else(|| panic!("{name}: {table:?}"));
        table[row][column].clone()
    };
    assert_eq!((both.len(), at(&both, 1, "seeds")), (4, "1 2".to_owned()), "{both:?}");
    assert!((at(&both, 1, "psnr_db_mean").parse::<f64>().unwrap() - 0.5 * (a + b)).abs() < 1e-9);
    let deviation = at(&both, 1, "psnr_db_deviation").parse::<f64>().unwrap();
    assert!((deviation - (a - b).abs() / 2.0_f64.sqrt()).abs() < 1e-9);
    assert_eq!(
        (at(&one, 1, "psnr_db_mean"), at(&one, 1, "psnr_db_deviation")),
        (a.to_string(), String::new())
    );
    let apart = csv(&["all/tiny-seed-1", "all/dim-seed-1"]);
    assert_eq!((apart.len(), at(&apart, 1, "exposure.white_e")), (7, "16000.0".to_owned()));
    let rows = read_json(&folder.path().join("all/tiny-seed-1/metrics.json"))["rows"].clone();
    assert_eq!(at(&one, 1, "efl_mm_mean"), rows[0]["efl_mm"].as_f64().unwrap().to_string());
    run_fails(
        folder.path(),
        &["compare", "all/tiny-seed-1", "--out", "new.html", "--csv", "figures.csv"],
        2,
        &["figures.csv: exists already"],
    );
    run_fails(folder.path(), &["compare", "all"], 2, &["not a run folder"]);
    // Names say what the files hold.
    for (more, needles) in [
        (["--out", "page.csv"], ["--out page.csv", "the page is HTML", "--csv page.csv"]),
        (["--out", "page.json"], ["--out page.json", "the page is HTML", "--json"]),
        (["--out", "page"], ["--out page", "the page is HTML", "page.html"]),
        (["--csv", "page.html"], ["--csv page.html", "the figures are CSV", "page.csv"]),
    ] {
        run_fails(folder.path(), &[&["compare", "all/tiny-seed-1"], &more[..]].concat(), 2, &needles);
    }
    run_fails(folder.path(), &["experiment", "run-all", "--only", "nowhere", "--out", "x"], 2, &["nowhere"]);
    let below_a_file = ["experiment", "run-all", "--only", "tiny.toml", "--out", "tiny.toml/below"];
    run_fails(folder.path(), &below_a_file, 2, &["tiny.toml/below: nothing can be written there"]);
    let none = ["experiment", "run-all", "--only", "tiny.toml", "--steps", "0", "--out", "x"];
    run_fails(folder.path(), &none, 2, &["--steps 0", "help:"]);
    assert!(!folder.path().join("x").exists());
}

#[test]
fn the_full_size_differs_in_its_budget_alone() {
    let folder = tempfile::tempdir().unwrap();
    let config = |more: &[&str]| -> toml::Table {
        let args = [&["design", "--print-config"], more].concat();
        run_ok(folder.path(), &args).stdout.parse().unwrap()
    };
    let (mut quick, mut full) = (config(&[]), config(&["--full"]));
    assert_eq!(full["training"]["steps"].as_integer(), Some(40_000));
    assert_eq!(full["optics"]["steps"].as_integer(), Some(15_000));
    // Both have a limit to their gradients.
    assert_eq!(quick["training"]["largest_gradient"].as_float(), Some(0.05));
    assert_eq!(full["training"]["largest_gradient"].as_float(), Some(0.05));
    for table in [&mut quick, &mut full] {
        for (section, key) in [
            ("training", "steps"),
            ("training", "batch"),
            ("training", "largest_gradient"),
            ("optics", "steps"),
            ("network", "base_channels"),
            ("checkpoint", "every"),
        ] {
            table[section].as_table_mut().unwrap().remove(key).unwrap();
        }
    }
    assert_eq!(quick, full);

    // A detector is trained once, and then tuned behind each lens: both share the budget.
    let full = config(&["pedestrian-vehicle", "--full"]);
    let tuned = full["training"]["steps"].as_integer().unwrap();
    let trained = &full["variant"][0]["stage"][0]["schedule"]["network"]["steps"];
    assert_eq!((trained.as_integer(), tuned), (Some(36_370), 3637));
}

#[test]
#[ignore = "trains a network for half a minute; `cargo xtask full` runs it"]
fn a_network_in_place_of_tracing_is_trained_described_and_leads_a_lens() {
    let folder = tempfile::tempdir().unwrap();
    let tiny = tiny_experiment().replace("grid = 64", "grid = 128");
    std::fs::write(folder.path().join("tiny.toml"), &tiny).unwrap();
    let train = [
        "train",
        "optics-proxy",
        "tiny.toml",
        "--steps",
        "6",
        "--batch",
        "2",
        "--hidden",
        "8",
        "--channels",
        "8",
    ];
    let done = run_ok(folder.path(), &[&train[..], &["--out", "proxy", "--json"]].concat()).json();
    assert_eq!((done["steps"].as_u64(), done["gap"]["lenses"].as_u64()), (Some(6), Some(50)));
    let description: toml::Table = read(&folder.path().join("proxy/proxy.toml")).parse().unwrap();
    assert_eq!(description["gap"]["l1"].as_float(), done["gap"]["l1"].as_f64());
    let page = read(&folder.path().join("proxy/proxy.html"));
    assert_eq!(page.matches("<img").count(), 6);
    // A finished training stays as it is, another does not overwrite it, and it is not continued for other PSFs.
    std::fs::write(folder.path().join("tiny.toml"), tiny.replace("pitch_um = 1.0", "pitch_um = 1.5"))
        .unwrap();
    run_fails(folder.path(), &["train", "optics-proxy", "--resume", "proxy"], 2, &["no longer", "tiny.toml"]);
    std::fs::write(folder.path().join("tiny.toml"), &tiny).unwrap();
    let again = run_ok(folder.path(), &["train", "optics-proxy", "--resume", "proxy", "--json"]).json();
    assert_eq!(again["gap"]["l1"], done["gap"]["l1"]);
    run_fails(folder.path(), &[&train[..], &["--out", "proxy"]].concat(), 2, &["already holds a training"]);

    // A lens is led by it, and scored by exact tracing.
    let variant = "[[variant]]\nname = \"through-network\"\noptics_proxy = \"proxy/proxy.toml\"\n\
                   [[variant.stage]]\nmoves = [\"optics\", \"network\"]\n";
    let mut table: toml::Table = tiny.parse().unwrap();
    table.remove("variant");
    let mine = toml::to_string(&table).unwrap() + variant;
    std::fs::write(folder.path().join("mine.toml"), &mine).unwrap();
    run_ok(folder.path(), &["design", "mine.toml", "--out", "run"]);
    let exact = mine.replace("optics_proxy = \"proxy/proxy.toml\"\n", "");
    std::fs::write(folder.path().join("exact.toml"), exact).unwrap();
    run_ok(folder.path(), &["design", "exact.toml", "--out", "exact"]);
    let lens = |run: &str| read(&folder.path().join(run).join("cameras/through-network/lens.toml"));
    assert_ne!(lens("run"), lens("exact"));
    // The run stands on its own, and its camera is the same by exact tracing alone.
    std::fs::remove_dir_all(folder.path().join("proxy")).unwrap();
    let again = run_ok(folder.path(), &["evaluate", "run"]);
    assert!(again.stdout.contains("own figures: 0.000e0"), "{}", again.stdout);
    run_fails(
        folder.path(),
        &["design", "mine.toml", "--out", "none"],
        2,
        &["optics_proxy", "train optics-proxy"],
    );
    let resting = mine.replace("[\"optics\", \"network\"]", "[\"network\"]");
    std::fs::write(folder.path().join("resting.toml"), resting).unwrap();
    run_fails(
        folder.path(),
        &["design", "resting.toml", "--out", "none"],
        2,
        &["does not move for the task"],
    );
    // One for another lens, other bounds or other PSFs is refused.
    let kept = folder.path().join("run/inputs/through-network-optics-proxy");
    copy_folder(&kept, &folder.path().join("proxy"));
    for (from, to, wanted) in [
        ("pitch_um = 1.0", "pitch_um = 1.5", "other PSFs"),
        ("defocus_mm = 0.5", "defocus_mm = 0.4", "defocus"),
        ("grid = 128", "grid = 64", "psf.grid"),
        ("lens = \"cooke-triplet-nominal\"", "lens = \"cooke-triplet-old-baseline\"", "another lens"),
    ] {
        let other = mine.replace(from, to);
        assert_ne!(other, mine, "{from}");
        std::fs::write(folder.path().join("other.toml"), other).unwrap();
        run_fails(folder.path(), &["design", "other.toml", "--out", "none"], 2, &[wanted]);
    }
    assert!(!folder.path().join("none").exists());
}

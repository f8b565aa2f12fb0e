//! Files that are there already, and files that have no end.

use crate::common::{self, data, run_fails, run_ok};

#[test]
fn results_are_overwritten_only_by_force() {
    let folder = tempfile::tempdir().unwrap();
    let photo = data("photos/coffee.png").display().to_string();
    let list = run_ok(folder.path(), &["lens", "list"]).stdout;
    assert!(list.contains("cooke-triplet-nominal") && list.contains("25.04"), "{list}");
    for (args, file) in [
        (&["lens", "convert", "cooke-triplet-nominal", "a.zmx"][..], "a.zmx"),
        (
            &["lens", "analyze", "cooke-triplet-nominal", "--only", "layout", "--out", "sheet"],
            "sheet/layout.svg",
        ),
        (
            &["lens", "tolerance", "cooke-triplet-nominal", "--trials", "2", "--out", "off"],
            "off/tolerance.html",
        ),
        (&["psf", "cooke-triplet-nominal", "--fields", "2", "--grid", "32", "--out", "psf"], "psf/psf.npy"),
        (&["simulate", &photo, "--size", "64x96", "--out", "taken"], "taken/coffee-developed.png"),
        (&["raw", "convert", "taken/coffee-raw.tiff", "b.png"], "b.png"),
        (&["isp", "develop", "taken/coffee-raw.tiff", "--out", "done"], "done/coffee-raw.png"),
        (
            &["sensor", "capture", "imx249-fitted", "--size", "32x32", "--out", "series"],
            "series/captures.toml",
        ),
        (&["sensor", "characterize", "series", "--out", "found"], "found/results.json"),
    ] {
        run_ok(folder.path(), args);
        let path = folder.path().join(file);
        assert!(path.is_file(), "{args:?}");
        if args[1] == "capture" {
            // An interrupted series goes on: the same command is no mistake.
            continue;
        }
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        run_fails(folder.path(), args, 2, &[&name, "exists already", "--force replaces it"]);
        run_ok(folder.path(), &[args, &["--force"]].concat());
    }
    // What lies beside the named results is kept as well.
    std::fs::remove_file(folder.path().join("taken/coffee-developed.png")).unwrap();
    let again = ["simulate", &photo, "--size", "64x96", "--out", "taken"];
    run_fails(folder.path(), &again, 2, &["coffee-raw.tiff", "exists already"]);
}

#[test]
fn places_that_cannot_be_written_are_named_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("file"), "").unwrap();
    run_fails(
        folder.path(),
        &["psf", "cooke-triplet-nominal", "--out", "file"],
        2,
        &["file: this is a file"],
    );
    let below = ["psf", "cooke-triplet-nominal", "--out", "file/below"];
    run_fails(folder.path(), &below, 2, &["file/below: nothing can be written there"]);
    let missing = ["lens", "convert", "cooke-triplet-nominal", "none/a.zmx"];
    run_fails(folder.path(), &missing, 2, &["none/a.zmx: nothing can be written there"]);
}

#[cfg(unix)]
#[test]
fn what_has_no_end_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    for (name, args) in [
        ("a.png", &["simulate", "a.png", "--out", "out"][..]),
        ("a.toml", &["lens", "show", "a.toml"]),
        ("a.agf", &["glass", "list", "--glasses", "a.agf"]),
        ("a.tiff", &["raw", "show", "a.tiff"]),
        ("b.toml", &["design", "b.toml", "--out", "out"]),
        ("c.toml", &["sensor", "show", "c.toml"]),
    ] {
        std::os::unix::fs::symlink("/dev/zero", folder.path().join(name)).unwrap();
        let outcome = common::run(folder.path(), args);
        assert_eq!(outcome.code, Some(2), "{args:?}: {outcome:?}");
        assert!(outcome.says("this is a pipe or a device"), "{args:?}: {outcome:?}");
        std::fs::remove_file(folder.path().join(name)).unwrap();
    }
}

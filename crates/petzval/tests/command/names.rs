//! Names of files and folders that are not UTF-8, that hold control characters, or that are too long.

#![cfg(unix)]

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use crate::common::{self, *};

/// Runs the command with arguments of any bytes.
fn run_bytes(folder: &Path, args: &[&[u8]]) -> Outcome {
    outcome(petzval(folder).args(args.iter().map(|arg| OsStr::from_bytes(arg))).output().unwrap())
}

/// A folder whose path is not text is refused with a hint: a run could not find it again.
#[test]
fn folders_that_are_not_text_are_refused_before_a_run_keeps_them() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_tiny(root);
    copy_folder(&data("photos"), &root.join(OsStr::from_bytes(b"ph\xffotos")));
    let before = snapshot(root);
    for args in [
        &[&b"design"[..], b"tiny.toml", b"--photos", b"ph\xffotos", b"--out", b"run"][..],
        &[b"design", b"tiny.toml", b"--photos", b"ph\xffotos", b"--check"],
        &[b"design", b"tiny.toml", b"--out", b"r\xffun"],
        &[b"design", b"tiny.toml", b"--out", b"r\xffun", b"--check"],
        &[b"lens", b"optimize", b"cooke-triplet-nominal", b"--out", b"r\xffun"],
        &[b"isp", b"tune", b"r\xffaws", b"--reference", b"refs", b"--out", b"run"],
        &[b"isp", b"tune", b"raws", b"--reference", b"r\xffefs", b"--out", b"run"],
    ] {
        let refused = run_bytes(root, args);
        assert_eq!(refused.code, Some(2), "{}", refused.stderr);
        assert!(refused.says("\u{fffd}") && refused.says("the path is not UTF-8"), "{}", refused.stderr);
        assert!(
            refused.says("help: rename it, or the folders above it; a run can also be opened"),
            "{}",
            refused.stderr
        );
    }
    assert_same_files(&before, &snapshot(root));
    // The way that the hint names.
    let run = root.join(OsStr::from_bytes(b"r\xffun"));
    std::fs::create_dir(&run).unwrap();
    run_ok(&run, &["design", "../tiny.toml", "--variant", "nominal", "--out", "."]);
    run_ok(&run, &["report", "."]);
}

/// Files of results may have any name: bytes that are no text are U+FFFD in JSON.
#[test]
fn results_name_files_that_are_not_text() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    finished_run(root);
    let lens = [&b"lens"[..], b"focus", b"cooke-triplet-nominal", b"l\xffens.toml", b"--json"];
    let focused = run_bytes(root, &lens);
    assert_eq!(focused.code, Some(0), "{}", focused.stderr);
    assert_eq!(focused.json()["to"], "l\u{fffd}ens.toml");
    assert!(root.join(OsStr::from_bytes(b"l\xffens.toml")).is_file());
    let photo = data("photos/coffee.png");
    let photo = photo.as_os_str().as_bytes();
    let applied = run_bytes(root, &[b"apply", b"run", photo, b"--out", b"o\xffut", b"--json"]);
    assert_eq!(applied.code, Some(0), "{}", applied.stderr);
    assert_eq!(applied.json()["pages"][0], "o\u{fffd}ut/coffee-side-by-side.html");
}

/// Only the argument that is refused is named: a folder may have any name.
#[test]
fn an_argument_that_is_not_text_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for args in [
        &[&b"lens"[..], b"show", b"len\xffs.zmx"][..],
        &[b"psf", b"len\xffs.zmx", b"--out", b"o\xfeut"],
        &[b"isp", b"develop", b"r\xfeaw.tiff", b"--isp", b"len\xffs.zmx"],
    ] {
        let refused = run_bytes(folder.path(), args);
        assert_eq!(refused.code, Some(2), "{}", refused.stderr);
        assert!(
            refused.says("len\u{fffd}s.zmx: this argument is not UTF-8") && refused.says("help: rename"),
            "{}",
            refused.stderr
        );
    }
}

/// A line break of a name begins no line of the terminal, and no other control character of it gets there.
#[test]
fn line_breaks_of_names_stay_in_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_tiny(root);
    let name = "a\nwarning: b\t\u{1b}[31m";
    let shown = r"a\nwarning: b\t\u{1b}[31m";
    copy_folder(&data("photos"), &root.join(name));
    std::fs::write(root.join(name).join("bad\n.png"), "no picture").unwrap();
    let lens = common::read(&data("lenses/cooke-triplet-nominal.toml")).replacen(
        "distance_mm = inf",
        "distance_mn = inf",
        1,
    );
    std::fs::write(root.join(format!("{name}.toml")), lens).unwrap();
    let file = format!("{name}.toml");
    let file_of_lens = data("lenses/cooke-triplet-nominal.toml").display().to_string();
    for (args, code, needle) in [
        (&["lens", "show", "none\n.zmx"][..], 2, r"none\n.zmx"),
        (&["lens", "show", &file], 2, shown),
        (&["design", "none\n.toml"], 2, r"none\n.toml"),
        (&["design", "tiny.toml", "--photos", name, "--out", "run"], 0, r"bad\n.png"),
        (&["psf", "cooke-triplet-nominal", "--fields", "2", "--grid", "32", "--out", name], 0, shown),
        (
            &["init", &format!("{name}/i")],
            0,
            r"petzval design $'a\x0awarning: b\x09\x1b[31m/i/experiment.toml'",
        ),
        (&["data", "check", name], 2, shown),
        (&["apply", name, "x.png"], 2, shown),
        (&["lens", "convert", &file_of_lens, "c\n.zmx"], 0, r"c\n.zmx"),
    ] {
        let outcome = run(root, args);
        let all = outcome.stdout.clone() + &outcome.stderr;
        assert_eq!(outcome.code, Some(code), "{args:?}\n{all}");
        assert!(all.contains(needle), "{args:?}\n{all}");
        assert!(all.lines().all(|line| !line.contains(char::is_control)), "{all}");
        assert!(
            !all.contains("\nwarning: b") && !all.contains("\n.") && !all.contains('\u{1b}'),
            "{args:?}\n{all}"
        );
    }
}

/// What `design` refuses before its first step, `design --check` refuses as well.
#[test]
fn a_check_refuses_the_folders_that_a_run_refuses() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    finished_run(root);
    std::fs::write(root.join("taken"), "a file").unwrap();
    let (long, deep) = ("x".repeat(300), "y/".repeat(2500));
    for (out, needle) in [
        (&long[..], "a name of 300 bytes is too long"),
        (&deep, "the path of"),
        ("run", "already holds a run"),
        ("taken", "this is a file"),
        ("taken/run", "nothing can be written there"),
        ("run.html", "this is the name of a file"),
    ] {
        for check in [&[][..], &["--check"]] {
            let args = [&["design", "tiny.toml", "--out", out], check].concat();
            run_fails(root, &args, 2, &[needle]);
        }
    }
    run_ok(root, &["design", "tiny.toml", "--out", "another", "--check"]);
    assert!(!root.join("another").exists());
}

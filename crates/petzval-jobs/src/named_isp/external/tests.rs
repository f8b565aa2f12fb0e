use std::path::Path;
use std::time::Instant;

use petzval_camera::isp::{FrameData, Isp, IspError, NoiseProfile, RawInput};
use petzval_camera::sensor::CfaPattern;
use petzval_files::isp_file::parse_external_isp;

use super::*;

/// The script of the manual: the green pixel of each block of four, with black level, gain and gamma.
const SCRIPT: &str = include_str!("../../../../../book/src/examples/external-isp.sh");
const DESCRIPTION: &str = include_str!("../../../../../book/src/examples/external-isp.toml");

fn frame() -> RawInput {
    RawInput {
        height: 16,
        width: 20,
        dn: (0..320).map(|i| 64 + i * 3).collect(),
        bits: 12,
        cfa: CfaPattern::RGGB,
        about: FrameData {
            black_dn: 64.0,
            white_dn: 1064.0,
            response: [1.0; 3],
            saturation: 2.0,
            noise: NoiseProfile { shot: 1e-4, read: 1e-6 },
            gain_ev: 0.0,
            colour_matrix: None,
            companding: None,
            shading: None,
            warp: None,
        },
    }
}

/// An ISP of a shell script, with more lines for its description.
fn isp(folder: &Path, script: &str, settings: &str) -> ExternalIsp {
    std::fs::write(folder.join("external-isp.sh"), script).unwrap();
    let (head, rest) = DESCRIPTION.split_once("\n\n").unwrap();
    let kept: Vec<&str> = head
        .lines()
        .filter(|line| !settings.lines().any(|new| new.split(' ').next() == line.split(' ').next()))
        .collect();
    let text = format!("{}\n{settings}\n\n{rest}", kept.join("\n"));
    ExternalIsp::new(parse_external_isp(&text).unwrap(), folder, Cancel::default()).unwrap()
}

/// A script that starts a process, writes its number and the folder of the call into files, and never ends.
const HANGING: &str =
    "echo waiting for the camera >&2\nsleep 61 & echo $! > child\necho $1 > call\nsleep 62\n";

/// Checks that the process which the hanging script started is gone, or waits for its parent to notice, and its folder too.
fn check_nothing_is_left(folder: &Path) {
    let written = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap().trim().to_owned();
    let state = || std::fs::read_to_string(format!("/proc/{}/stat", written("child")));
    let is_gone = || state().map_or(true, |stat| stat.contains(") Z "));
    let ended = (0..200).any(|_| {
        std::thread::sleep(Duration::from_millis(10));
        is_gone()
    });
    assert!(ended || !Path::new("/proc").exists(), "{:?}", state());
    assert!(!Path::new(&written("call")).exists());
}

fn message(result: Result<RgbPicture, IspError>) -> String {
    match result.unwrap_err() {
        IspError::External(message) => message,
        other => panic!("{other}"),
    }
}

#[test]
fn the_script_of_the_manual_develops_a_frame() {
    let page = include_str!("../../../../../book/src/light-path/isp.md");
    assert!(page.contains(SCRIPT) && page.contains(DESCRIPTION));
    let folder = tempfile::tempdir().unwrap();
    let isp = isp(folder.path(), SCRIPT, "");
    assert_eq!(isp.name(), "Ten-line ISP");
    let frame = frame();
    let picture = isp.develop(&frame, &[2.0, 2.0]).unwrap();
    assert_eq!((picture.height, picture.width), (16, 20));
    for row in 0..16 {
        for col in 0..20 {
            // The green pixel at the top right of its block.
            let light = f64::from(frame.dn[row / 2 * 2 * 20 + col / 2 * 2 + 1] - 64) / 1000.0;
            let want = (2.0 * light).min(1.0).powf(1.0 / 2.0);
            let got = f64::from(picture.data[row * 20 + col]) / 255.0;
            assert!((got - want).abs() < 0.003, "{row} {col}: {got} {want}");
        }
    }
    // Values and frames are checked before anything runs.
    assert!(matches!(isp.develop(&frame, &[2.0, 9.0]), Err(IspError::Parameter { .. })));
    assert!(matches!(isp.develop(&frame, &[2.0]), Err(IspError::Count { .. })));
}

#[test]
fn one_that_hangs_is_stopped_with_all_its_processes() {
    let folder = tempfile::tempdir().unwrap();
    let isp = isp(folder.path(), HANGING, "timeout_s = 0.5\nretries = 1");
    let start = Instant::now();
    let text = message(isp.develop(&frame(), &[1.0, 2.2]));
    assert!(start.elapsed().as_secs_f64() < 20.0);
    for words in ["Ten-line ISP, 2 times", "no picture after 0.5 s", "waiting for the camera"] {
        assert!(text.contains(words), "{text}");
    }
    check_nothing_is_left(folder.path());
}

#[test]
fn a_cancelled_job_stops_the_command_at_once_and_those_that_wait() {
    let folder = tempfile::tempdir().unwrap();
    let isp = isp(folder.path(), HANGING, "timeout_s = 60.0\nretries = 3\nparallel = 1");
    std::thread::scope(|scope| {
        // The second and the third call wait for the first.
        let calls: Vec<_> = (0..3).map(|_| scope.spawn(|| isp.develop(&frame(), &[1.0, 2.2]))).collect();
        while !folder.path().join("call").exists() {
            std::thread::sleep(Duration::from_millis(5));
        }
        // The script has written its last file.
        std::thread::sleep(Duration::from_millis(100));
        let start = Instant::now();
        isp.cancel.set();
        for call in calls {
            let error = call.join().unwrap().unwrap_err();
            assert_eq!(error, IspError::Stopped("Ten-line ISP".to_owned()));
            assert!(error.to_string().contains("Ten-line ISP was stopped"), "{error}");
        }
        assert!(start.elapsed().as_secs_f64() < 5.0, "{:?}", start.elapsed());
    });
    check_nothing_is_left(folder.path());
    // A job that was cancelled before starts nothing.
    std::fs::remove_file(folder.path().join("call")).unwrap();
    assert!(matches!(isp.develop(&frame(), &[1.0, 2.2]), Err(IspError::Stopped(_))));
    assert!(!folder.path().join("call").exists());
}

#[test]
fn one_that_crashes_shows_its_exit_code_and_what_it_wrote() {
    let folder = tempfile::tempdir().unwrap();
    let isp = isp(folder.path(), "echo no device found >&2\nexit 3\n", "");
    let text = message(isp.develop(&frame(), &[1.0, 2.2]));
    assert!(text.contains("exit status: 3") && text.contains("no device found"), "{text}");
}

#[test]
fn garbage_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let nan = "{'descr': '<f4', 'fortran_order': False, 'shape': (16, 20, 3), }";
    let nan = format!(
        "printf '\\223NUMPY\\001\\000\\166\\000%-117s\\n' \"{nan}\" > $1/rgb.npy\nhead -c 3840 /dev/zero | tr '\\000' '\\377' >> $1/rgb.npy\n"
    );
    for (script, says) in [
        ("true\n", "left no picture"),
        ("echo hello > $1/rgb.png\n", "rgb.png: "),
        ("printf 'P3 1 1 255 1 2 3' > $1/rgb.ppm\n", "1 x 1 pixels; the frame has 20 x 16"),
        ("head -c 99999 /dev/zero > $1/rgb.npy\n", "more than any picture"),
        (&nan, "NaN"),
    ] {
        let isp = isp(folder.path(), script, "");
        let text = message(isp.develop(&frame(), &[1.0, 2.2]));
        assert!(text.contains(says), "{script}: {text}");
    }
}

#[test]
fn a_failure_is_tried_again_and_a_picture_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    // The first call fails; every call leaves a line.
    let script = format!("echo call >> calls\n[ $(wc -l < calls) -gt 1 ] || exit 1\n{SCRIPT}");
    let isp = isp(folder.path(), &script, "retries = 2\ncache = \"kept/pictures\"");
    let calls = || std::fs::read_to_string(folder.path().join("calls")).unwrap().lines().count();
    let first = isp.develop(&frame(), &[1.0, 2.2]).unwrap();
    assert_eq!(calls(), 2);
    assert_eq!(isp.develop(&frame(), &[1.0, 2.2]).unwrap(), first);
    assert_eq!(calls(), 2);

    // Another value, another frame, another version are other pictures.
    assert_ne!(isp.develop(&frame(), &[1.0, 2.3]).unwrap(), first);
    let mut brighter = frame();
    brighter.dn[1] += 1;
    isp.develop(&brighter, &[1.0, 2.2]).unwrap();
    let mut newer = ExternalIsp::new(isp.about.clone(), folder.path(), Cancel::default()).unwrap();
    newer.about.version = "2".to_owned();
    newer.develop(&frame(), &[1.0, 2.2]).unwrap();
    assert_eq!(calls(), 5);

    // A damaged file is made again.
    let kept = std::fs::read_dir(folder.path().join("kept/pictures")).unwrap();
    kept.for_each(|file| std::fs::write(file.unwrap().path(), b"P3 cut").unwrap());
    assert_eq!(isp.develop(&frame(), &[1.0, 2.2]).unwrap(), first);
    assert_eq!(calls(), 6);
}

#[test]
fn a_program_that_does_not_exist_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let isp = isp(folder.path(), "", "command = [\"./no-such-program\"]");
    let text = message(isp.develop(&frame(), &[1.0, 2.2]));
    assert!(text.contains("no-such-program") && text.contains("cannot be run"), "{text}");
}

#[test]
fn no_more_commands_run_at_once_than_the_description_permits() {
    let folder = tempfile::tempdir().unwrap();
    // A second command at the same time finds the folder of the first.
    let script = format!("mkdir busy || exit 9\nsleep 0.05\n{SCRIPT}\nrmdir busy\n");
    let isp = isp(folder.path(), &script, "parallel = 1");
    std::thread::scope(|scope| {
        let calls: Vec<_> = (0..4).map(|_| scope.spawn(|| isp.develop(&frame(), &[1.0, 2.2]))).collect();
        for call in calls {
            call.join().unwrap().unwrap();
        }
    });
}

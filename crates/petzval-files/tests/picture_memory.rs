//! The memory that reading a picture takes is what the manual states. Alone in its program: the peak is that of the process.

#![cfg(target_os = "linux")]

use petzval_files::load_image;

/// Most memory that the process has had so far, bytes.
fn peak_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    1024 * line.split_whitespace().next().unwrap().parse::<u64>().unwrap()
}

#[test]
fn a_gray_picture_takes_its_samples_and_its_light() {
    const SIDE: u32 = 4000;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gray.png");
    image::GrayImage::from_pixel(SIDE, SIDE, image::Luma([90])).save(&path).unwrap();
    let file = path.metadata().unwrap().len();
    let before = peak_bytes();
    let picture = load_image(&path).unwrap();
    assert_eq!(picture.light.data.len(), 3 * (SIDE * SIDE) as usize);
    let pixels = u64::from(SIDE) * u64::from(SIDE);
    let stated = 2 * file + pixels + 12 * pixels;
    // The rest is one strip of pixels, and the allocator's own.
    let taken = peak_bytes() - before;
    assert!(taken < stated + 20_000_000, "{taken} bytes, stated {stated}");
}

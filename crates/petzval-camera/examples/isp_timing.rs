//! Time of every stage of the automotive ISP on a frame of 1920 x 1200 pixels.
use petzval_camera::isp::*;
use petzval_camera::sensor::CfaPattern;
use std::time::Instant;
fn main() {
    let (height, width) = (1200, 1920);
    let mut state = 1_u64;
    let dn = (0..height * width)
        .map(|i| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let base = 200.0
                + 3000.0
                    * ((i % width) as f64 / width as f64)
                    * (0.6 + 0.4 * ((i / width) as f64 * 0.05).sin());
            (base + ((state >> 40) as f64 / (1u64 << 24) as f64 - 0.5) * 2.0 * base.sqrt()) as u32
        })
        .collect();
    let about = FrameData {
        black_dn: 100.0,
        white_dn: 3900.0,
        response: [0.6, 1.0, 0.8],
        saturation: 1.0,
        noise: NoiseProfile { shot: 1e-4, read: 1e-6 },
        gain_ev: 0.0,
        colour_matrix: Some([[1.6, -0.4, -0.2], [-0.2, 1.5, -0.3], [0.0, -0.6, 1.6]]),
        companding: None,
        shading: Some(Mesh { rows: 33, cols: 33, planes: vec![vec![0.8; 33 * 33]; 3] }),
        warp: Some(Mesh { rows: 33, cols: 33, planes: vec![vec![1.3; 33 * 33], vec![-2.7; 33 * 33]] }),
    };
    let frame = RawInput { height, width, dn, bits: 12, cfa: CfaPattern::RGGB, about };
    let mut set = IspSettings::default();
    set.tone_map.strength = 0.5;
    set.purple_fringe.strength = 0.5;
    for demosaic in [Demosaic::Malvar, Demosaic::Menon] {
        let isp = HardwareIsp { settings: IspSettings { demosaic, ..set.clone() } };
        let mut best = f64::INFINITY;
        for _ in 0..7 {
            let start = Instant::now();
            let out = isp.develop_as_set(&frame).unwrap();
            best = best.min(start.elapsed().as_secs_f64());
            std::hint::black_box(out);
        }
        println!("{demosaic:?}: {:.1} ms", best * 1e3);
    }
}

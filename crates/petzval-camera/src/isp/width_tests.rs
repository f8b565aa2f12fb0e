//! Every stage at the ends of its range. Inputs are the least and the greatest values of a format, and every parameter is at the ends of
//! its own range. No stage may make a value outside the format that it declares.
//!
//! A sum too wide for its intermediate wraps silently in a release build and may end inside the format. Where a stage is a formula of one
//! pixel, it is compared with the same in 64 bits; the others with what constant frames must give. `cargo widths` runs these tests with
//! the overflow checks of this crate, which notice every such sum.

use petzval_base::parameter::Parameter;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::fixed::{ENCODED, Format, GAIN, Grid, LINEAR, LOG2, ROOT, WEIGHT, shift_round_wide};
use super::stage::gain::amplified;
use super::stage::stabilise::Stable;
use super::stage::tone_map::ToneMap;
use super::stage::{colour, colour_denoise, demosaic};
use super::*;
use crate::develop::{Demosaic, Domain};
use crate::sensor::CfaPattern;

/// Wider than the blocks in which rows are computed.
const HEIGHT: usize = 20;
const WIDTH: usize = 150;

/// Which pixels hold the greatest value; the others hold the least.
type Pattern = fn(usize, usize) -> bool;

const PATTERNS: [(&str, Pattern); 9] = [
    ("the least everywhere", |_, _| false),
    ("the greatest everywhere", |_, _| true),
    ("a checkerboard", |row, col| (row + col) % 2 == 0),
    ("a checkerboard of tiles of the array", |row, col| (row / 2 + col / 2) % 2 == 0),
    ("rows", |row, _| row % 2 == 0),
    ("columns of tiles", |_, col| col / 2 % 2 == 0),
    ("one colour of the array", |row, col| row % 2 == 0 && col % 2 == 0),
    ("a bright pixel", |row, col| (row, col) == (9, 130)),
    ("a dark pixel", |row, col| (row, col) != (9, 130)),
];

/// Which extreme red, green and blue take at a place that is marked or not.
type Colouring = [fn(bool) -> bool; 3];

/// Of a pattern, what the three colours of a picture hold.
const COLOURINGS: [(&str, Colouring); 5] = [
    ("gray", [|v| v, |v| v, |v| v]),
    ("green against red and blue", [|v| v, |v| !v, |v| v]),
    ("red alone", [|v| v, |_| false, |_| false]),
    ("all but blue", [|_| true, |v| v, |_| false]),
    ("blue against the others", [|v| !v, |v| !v, |v| v]),
];

fn extreme(format: Format, is_high: bool) -> i32 {
    if is_high { format.max } else { format.min }
}

/// A mosaic of the ends of a format of 16 bits.
fn mosaic(format: Format, pattern: Pattern) -> Grid<i16> {
    Grid::from_rows([HEIGHT, WIDTH], |row, out| {
        (0..WIDTH).for_each(|col| out[col] = extreme(format, pattern(row, col)) as i16);
    })
}

fn colours(format: Format, pattern: Pattern, of: [fn(bool) -> bool; 3]) -> [Grid<i16>; 3] {
    of.map(|of| {
        Grid::from_rows([HEIGHT, WIDTH], |row, out| {
            (0..WIDTH).for_each(|col| out[col] = extreme(format, of(pattern(row, col))) as i16);
        })
    })
}

/// Fails if a value lies outside its format.
#[track_caller]
fn check(stage: &str, given: &str, format: Format, values: impl IntoIterator<Item = i32>) {
    for value in values {
        assert!((format.min..=format.max).contains(&value), "{stage}, {given}: {value} is not in {format:?}");
    }
}

fn values(grid: &Grid<i16>) -> impl Iterator<Item = i32> {
    (0..grid.height).flat_map(|row| grid.row(row)).map(|v| i32::from(*v))
}

/// [`check`], and a frame of one value keeps it within a rounding.
#[track_caller]
fn check_flat(stage: &str, given: &str, format: Format, grid: &Grid<i16>, kept: Option<i32>) {
    check(stage, given, format, values(grid));
    if let Some(kept) = kept {
        let far = values(grid).map(|v| (v - kept).abs()).max().unwrap_or(0);
        assert!(far <= 1, "{stage}, {given}: {far} from the constant {kept}");
    }
}

/// The settings with all numbers in the middle of their ranges, where every stage is at work, and from there each number at either end; all
/// numbers at one end; and each at an end drawn by lot.
fn settings() -> Vec<IspSettings> {
    let parameters = IspSettings::parameters();
    let middle: Vec<f64> = parameters.iter().map(|p| p.about.value_at(0.5)).collect();
    let mut lists = vec![middle.clone(), IspSettings::default().values()];
    let ends: [fn(&Parameter) -> f64; 2] = [|p| p.min, |p| p.max];
    for of in ends {
        lists.push(parameters.iter().map(|p| of(&p.about)).collect());
        for (i, p) in parameters.iter().enumerate() {
            let mut list = middle.clone();
            list[i] = of(&p.about);
            lists.push(list);
        }
    }
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for _ in 0..20 {
        lists.push(parameters.iter().map(|p| ends[usize::from(rng.random_bool(0.5))](&p.about)).collect());
    }
    lists.iter().map(|list| IspSettings::default().with_values(list).unwrap()).collect()
}

/// Noise from none to as much as white light, and the transforms for it at the ends of the digital gain.
fn stabilisers(set: &IspSettings) -> Vec<Stable> {
    let profiles = [(0.0, 0.0), (1e-4, 1e-7), (1.0, 1.0), (1e-9, 1.0), (1.0, 0.0)];
    profiles.map(|(shot, read)| set.stabilise.stable(&NoiseProfile { shot, read }, set.gain.factor())).into()
}

#[test]
fn black_level_saturates() {
    for set in settings() {
        for bits in [8, 12, 16, 24] {
            let most = (1_u32 << bits) - 1;
            for (black_dn, range_dn) in [(0.0, 1.0), (64.0, 100.0), (0.0, most.into()), (most.into(), 1e6)] {
                let frame = raw(bits, (black_dn, range_dn), |_, _| false);
                let registers = set.black_level.registers(&frame);
                for dn in [0, 1, most / 2, most] {
                    let mut out = [0; 2];
                    for row in 0..2 {
                        registers.row(row, |_| dn, &mut out);
                        let given = format!("{bits} bits, {dn} DN, black {black_dn}, range {range_dn}");
                        check("black_level", &given, LINEAR, out);
                        for (col, found) in out.into_iter().enumerate() {
                            let black = black_dn + set.black_level.offset_dn[2 * row + col];
                            let wanted = (f64::from(dn) - black) / range_dn;
                            let wanted = wanted.clamp(LINEAR.value(LINEAR.min), LINEAR.value(LINEAR.max));
                            // The black level has 8 bits behind the point, the scale 24 or 25 altogether, light 20.
                            let far = (LINEAR.value(found) - wanted).abs();
                            assert!(far < 2e-3 / range_dn + 1e-7 * wanted.abs() + 1e-6, "{given}: {far}");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn gains_of_light_saturate() {
    for set in settings() {
        let cap = Mesh { rows: 2, cols: 2, planes: vec![vec![0.0, 1.0, 1e-9, 1e9]; 3] };
        let shades = set.shading.registers(Some(&cap), (HEIGHT, WIDTH));
        let shades: Vec<i32> = shades.map_or(Vec::new(), |shades| shades.row(1, HEIGHT / 2));
        check("shading", "a mesh of 0 to 1e9", GAIN, shades.iter().copied());
        let about = FrameData { response: [0.01, 1.0, 100.0], ..raw(12, (0.0, 1.0), |_, _| false).about };
        let balance = set.white_balance.registers(&about);
        check("white_balance", "responses of 0.01 to 100", GAIN, balance);
        check("gain", "", GAIN, [set.gain.register()]);
        let factors = shades.into_iter().chain(balance).chain([set.gain.register(), GAIN.min, GAIN.max]);
        for (factor, light) in factors.flat_map(|f| [LINEAR.min, -1, 0, 1, LINEAR.max].map(|l| (f, l))) {
            let wide = shift_round_wide(i64::from(light) * i64::from(factor), 12);
            assert_eq!(amplified(light, factor), LINEAR.narrow(wide), "{light} times {factor}");
        }
    }
}

#[test]
fn the_root_and_its_inverse_saturate() {
    for set in settings() {
        for stable in stabilisers(&set) {
            let given = format!("offset {}, sigma {}", stable.offset, stable.sigma);
            let lights = || (LINEAR.min..=LINEAR.max).step_by(99_991).chain([-1, 0, 1, LINEAR.max]);
            check("stabilise", &given, ROOT, lights().map(|light| stable.root(light)));
            assert!(
                lights().take(169).map(|light| stable.root(light)).is_sorted(),
                "{given}: the root falls somewhere"
            );
            let roots = || (ROOT.min..=ROOT.max).step_by(211).chain([ROOT.max]);
            for bias in [0, stable.bias(1.0), LINEAR.max] {
                check("stabilise, light", &given, LINEAR, roots().map(|root| stable.light(root, bias)));
                assert!(
                    roots().map(|root| stable.light(root, bias)).is_sorted(),
                    "{given}: the light falls somewhere"
                );
            }
        }
    }
}

#[test]
fn stages_of_the_mosaic_saturate() {
    for set in settings() {
        for stable in stabilisers(&set) {
            for (k, (name, pattern)) in PATTERNS.into_iter().enumerate() {
                let kept = (k < 2).then(|| extreme(ROOT, k == 1));
                let given = || mosaic(ROOT, pattern);
                let cfa = [CfaPattern::RGGB, CfaPattern::GRBG, CfaPattern::GBRG][k % 3];
                let balanced = set.green_balance.fixed(given(), cfa, stable.sigma);
                check_flat("green_balance", name, ROOT, &balanced, kept);
                check_flat("defects", name, ROOT, &set.defects.fixed(given()), kept);
                let denoised = set.bayer_denoise.fixed(given(), stable.sigma);
                check_flat("bayer_denoise", name, ROOT, &denoised, kept);
            }
        }
    }
}

#[test]
fn demosaicing_saturates() {
    for method in Demosaic::ALL {
        for cfa in [CfaPattern::RGGB, CfaPattern::GRBG, CfaPattern::GBRG, CfaPattern::BGGR] {
            for (k, (name, pattern)) in PATTERNS.into_iter().enumerate() {
                let kept = (k < 2).then(|| extreme(ROOT, k == 1));
                for plane in demosaic::fixed(method, &mosaic(ROOT, pattern), cfa) {
                    check_flat(method.name(), name, ROOT, &plane, kept);
                }
            }
        }
    }
}

#[test]
fn local_tone_mapping_saturates() {
    for set in settings() {
        for (name, pattern) in PATTERNS {
            let light = Grid::from_rows([HEIGHT, WIDTH], |row, out: &mut [i32]| {
                (0..WIDTH).for_each(|col| out[col] = extreme(LINEAR, pattern(row, col)));
            });
            let local = ToneMap::local_light(&light);
            check("tone_map, local light", name, LOG2, values(&local));
            let whole = [mosaic(LOG2, pattern), local];
            for local in whole {
                let tones = set.tone_map.registers(&local);
                for row in 0..HEIGHT {
                    let [slope, offset] = tones.row(row);
                    check("tone_map, slope", name, Format { max: 4096, ..GAIN }, slope.iter().copied());
                    check("tone_map, offset", name, LOG2, offset.iter().copied());
                    for (at, l) in slope.into_iter().zip(offset).zip(local.row(row)) {
                        check("tone_map", name, GAIN, [tones.gain(at, (*l).into())]);
                    }
                }
                // Whatever base and local light are: every combination of their ends.
                for (slope, offset, l) in [0, 4096].into_iter().flat_map(|slope| {
                    [(false, false), (false, true), (true, false), (true, true)]
                        .map(|(b, l)| (slope, extreme(LOG2, b), extreme(LOG2, l)))
                }) {
                    check("tone_map", "the ends of base and light", GAIN, [tones.gain((slope, offset), l)]);
                }
            }
        }
    }
}

#[test]
fn stages_of_three_colours_saturate() {
    for set in settings() {
        for (k, (name, pattern)) in PATTERNS.into_iter().enumerate() {
            for (coloured, of) in COLOURINGS {
                let given = format!("{name}, {coloured}");
                let kept = of.map(|of| (k < 2).then(|| of(k == 1)));
                let kept = |format: Format, c: usize| kept[c].map(|is_high| extreme(format, is_high));
                let roots = || colours(ROOT, pattern, of);
                for (c, plane) in set.false_colour.fixed(roots()).iter().enumerate() {
                    check_flat("false_colour", &given, ROOT, plane, kept(ROOT, c));
                }
                for (c, plane) in set.purple_fringe.fixed(roots()).iter().enumerate() {
                    check_flat("purple_fringe", &given, ROOT, plane, kept(ROOT, c));
                }
                for stable in stabilisers(&set) {
                    let (luma, chroma) = (&set.luma_denoise, &set.chroma_denoise);
                    for plane in colour_denoise::fixed(luma, chroma, roots(), stable.sigma) {
                        check("chroma_denoise and luma_denoise", &given, ROOT, values(&plane));
                    }
                }
                let encoded = || colours(ENCODED, pattern, of);
                for (c, plane) in set.sharpen.fixed(encoded()).iter().enumerate() {
                    check_flat("sharpen", &given, ENCODED, plane, kept(ENCODED, c));
                }
                for mesh in warps() {
                    for (c, plane) in set.dewarp.fixed(encoded(), Some(&mesh)).iter().enumerate() {
                        check_flat("dewarp", &given, ENCODED, plane, kept(ENCODED, c));
                    }
                }
                for bits in [8, 10, 16] {
                    let white = (1 << bits) - 1;
                    let codes = Format { fraction: 0, min: 0, max: white };
                    let data = set.output.fixed(&encoded(), bits);
                    check("output", &given, codes, data.iter().map(|v| i32::from(*v)));
                    // Both ends lie so far outside black and white that no contrast brings them back.
                    if k < 2 && coloured == "gray" && set.output.brightness == 0.0 {
                        assert!(data.iter().all(|v| i32::from(*v) == if k == 1 { white } else { 0 }));
                    }
                }
            }
        }
    }
}

/// Displacements by the whole picture and more, to all sides.
fn warps() -> [Mesh; 2] {
    let mesh = |planes: [[f32; 4]; 2]| Mesh { rows: 2, cols: 2, planes: planes.map(Vec::from).into() };
    [mesh([[1e9, -1e9, 1e9, -1e9]; 2]), mesh([[0.4, -3.3, 7.7, -0.6], [-200.0, 0.5, 1000.0, 3.3]])]
}

#[test]
fn the_colour_matrix_and_the_curve_saturate() {
    for set in settings() {
        for calibrated in [None, Some([[10.0, -10.0, 10.0]; 3]), Some([[-8.0, 8.0, 7.999]; 3])] {
            let matrix = set.colours.registers(calibrated);
            check("colours", "the matrix", WEIGHT, matrix.into_iter().flatten());
            let curve = set.gamma.table();
            for corner in 0..27 {
                let rgb =
                    [1, 3, 9].map(|place| [LINEAR.min, LINEAR.one() - 1, LINEAR.max][corner / place % 3]);
                let mixed = colour::mixed(&matrix, rgb);
                for (row, found) in matrix.iter().zip(mixed) {
                    let sum: i64 = row.iter().zip(rgb).map(|(w, v)| i64::from(*w) * i64::from(v)).sum();
                    let wide = LINEAR.narrow(shift_round_wide(sum, WEIGHT.fraction));
                    assert_eq!(found, wide, "{row:?} times {rgb:?}");
                    let encoded = curve.at(found.clamp(0, LINEAR.one()));
                    check("gamma", &format!("light {found}"), ENCODED, [encoded]);
                    assert!((0..=ENCODED.one() + 1).contains(&encoded), "{encoded}");
                }
            }
        }
    }
}

/// A frame of the least and the greatest digital numbers, with extreme calibrations.
fn raw(bits: u32, (black_dn, range_dn): (f64, f64), pattern: Pattern) -> RawInput {
    let most = (1_u32 << bits) - 1;
    let dn = (0..HEIGHT * WIDTH).map(|i| if pattern(i / WIDTH, i % WIDTH) { most } else { 0 }).collect();
    let about = FrameData {
        black_dn,
        white_dn: black_dn + range_dn,
        response: [1.0; 3],
        saturation: 16.0,
        noise: NoiseProfile { shot: 1e-4, read: 1e-7 },
        gain_ev: 0.0,
        colour_matrix: None,
        companding: None,
        shading: None,
        warp: None,
    };
    RawInput { height: HEIGHT, width: WIDTH, dn, bits, cfa: CfaPattern::RGGB, about }
}

#[test]
fn whole_developments_keep_to_the_codes_of_the_picture() {
    for (k, set) in settings().into_iter().enumerate() {
        for (j, (name, pattern)) in PATTERNS.into_iter().enumerate() {
            let depth = [8, 12, 16, 24][(k + j) % 4];
            let mut frame = raw(depth, [(0.0, 1.0), (16.0, 200.0), (0.0, 1e6)][(k + j / 4) % 3], pattern);
            if k % 2 == 1 {
                let illumination = vec![0.0, 1.0, 1e-3, 0.3];
                frame.about.shading = Some(Mesh { rows: 2, cols: 2, planes: vec![illumination; 3] });
                frame.about.warp = Some(warps()[k / 2 % 2].clone());
                frame.about.colour_matrix = Some([[8.0, -8.0, 1.0], [-8.0, 8.0, 1.0], [1.0, 8.0, -8.0]]);
                frame.about.response = [0.01, 1.0, 100.0];
                frame.about.noise = NoiseProfile { shot: 1.0, read: 1.0 };
            }
            let settings = IspSettings {
                bits: [8, 10, 16][(k + j) % 3],
                demosaic: Demosaic::ALL[(k + j / 2) % 4],
                domain: [Domain::Stabilised, Domain::Linear][(k + j / 3) % 2],
                ..set.clone()
            };
            let codes = Format { fraction: 0, min: 0, max: (1 << settings.bits) - 1 };
            let picture = HardwareIsp { settings }.develop_as_set(&frame).unwrap();
            assert_eq!(picture.data.len(), 3 * HEIGHT * WIDTH);
            check("the picture", name, codes, picture.data.iter().map(|v| i32::from(*v)));
        }
    }
}

#[test]
fn differences_of_roots_are_cut_off_in_order() {
    let least = Grid::from_rows([HEIGHT, WIDTH], |_, out: &mut [i16]| out.fill(ROOT.min as i16));
    let most = || Grid::from_rows([HEIGHT, WIDTH], |_, out: &mut [i16]| out.fill(ROOT.max as i16));
    let set = IspSettings::default();
    // Red and blue as far above green as can be: the differences do not fit their 16 bits. They are cut off, so that the order stays.
    let [r, g, b] =
        colour_denoise::fixed(&set.luma_denoise, &set.chroma_denoise, [most(), least, most()], 0.01);
    assert!(values(&r).zip(values(&g)).all(|(r, g)| r > g) && values(&b).zip(values(&g)).all(|(b, g)| b > g));
}

//! The automotive ISP as a chip runs it: every stage in whole numbers.
//!
//! ```text
//! raw -> black level -> gain -> root of light -> green equalisation -> defect pixels -> denoise (mosaic)
//!     -> light -> shading -> white balance -> local tone map -> root of light -> demosaic -> false colours
//!     -> purple fringes -> denoise (colours, luma) -> light -> colour matrix -> gamma -> sharpen -> dewarp -> output
//! ```

use std::time::Instant;

use super::fixed::{BLOCK, GAIN, Grid, LINEAR, ROOT, by_blocks, release_spare_memory};
use super::settings::IspSettings;
use super::stage::black_level::Registers as Levels;
use super::stage::colour::mixed;
use super::stage::gain::amplified;
use super::stage::shading::Registers as Shades;
use super::stage::stabilise::Stable;
use super::stage::tone_map::ToneMap;
use super::stage::{colour_denoise, demosaic, gamma, white_balance};
use super::{Domain, Isp, IspError, IspParameter, RawInput, RgbPicture};
use crate::sensor::CfaPattern;

/// The automotive ISP in fixed-point arithmetic.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HardwareIsp {
    /// Methods and the bits of the picture; its numbers are what [`HardwareIsp::develop_as_set`] develops with.
    pub settings: IspSettings,
}

/// Someone who looks at the picture after every stage: the stage's name, and the picture as a display would show it.
pub type Watch<'w> = &'w mut dyn FnMut(&'static str, RgbPicture);

/// What is noted after every stage.
enum Notes<'w> {
    /// Nothing.
    Nothing,
    /// The picture.
    Pictures(Watch<'w>),
    /// The time since the stage before, s.
    Times { clock: Instant, times: Vec<(&'static str, f64)> },
}

impl Isp for HardwareIsp {
    fn name(&self) -> &str {
        "petzval automotive ISP, fixed-point"
    }

    fn parameters(&self) -> Vec<IspParameter> {
        IspSettings::parameters()
    }

    fn develop(&self, frame: &RawInput, values: &[f64]) -> Result<RgbPicture, IspError> {
        Self { settings: self.settings.with_values(values)? }.develop_as_set(frame)
    }
}

impl HardwareIsp {
    /// Develops a frame with the settings' own numbers.
    pub fn develop_as_set(&self, frame: &RawInput) -> Result<RgbPicture, IspError> {
        self.run(frame, &mut Notes::Nothing)
    }

    /// The same, and `watch` sees the picture after every stage.
    pub fn develop_steps(&self, frame: &RawInput, watch: Watch) -> Result<RgbPicture, IspError> {
        self.run(frame, &mut Notes::Pictures(watch))
    }

    /// How long each stage takes on a frame, s, in their order.
    pub fn stage_times(&self, frame: &RawInput) -> Result<Vec<(&'static str, f64)>, IspError> {
        let mut notes = Notes::Times { clock: Instant::now(), times: Vec::new() };
        self.run(frame, &mut notes)?;
        Ok(match notes {
            Notes::Times { times, .. } => times,
            _ => Vec::new(),
        })
    }

    fn run(&self, frame: &RawInput, notes: &mut Notes) -> Result<RgbPicture, IspError> {
        frame.validate()?;
        let set = &self.settings;
        super::check_values(&IspSettings::parameters(), &set.values())?;
        if ![8, 10, 16].contains(&set.bits) {
            let (what, got) = ("bits of the picture", set.bits.to_string());
            return Err(IspError::Input { what, got, need: "8, 10 or 16" });
        }
        let (height, width, about, cfa) = (frame.height, frame.width, &frame.about, frame.cfa);
        let stable = set.stabilise.stable(&about.noise, set.gain.factor());
        let look = Look { stable: &stable, cfa, set };

        // The raw frame becomes light, is amplified, and its root taken.
        let levels = set.black_level.registers(frame);
        let mut mosaic = expand_and_root(frame, &levels, set.gain.register(), &stable);
        look.at_mosaic(notes, "gain", &mosaic);
        mosaic = set.green_balance.fixed(mosaic, cfa, stable.sigma);
        look.at_mosaic(notes, "green_balance", &mosaic);
        mosaic = set.defects.fixed(mosaic);
        look.at_mosaic(notes, "defects", &mosaic);
        mosaic = set.bayer_denoise.fixed(mosaic, stable.sigma);
        look.at_mosaic(notes, "bayer_denoise", &mosaic);

        // Back to light; the lens's shading and the sensor's colours are balanced there.
        let averaged = if set.bayer_denoise.strength > 0.0 { set.bayer_denoise.averaged() } else { 0.0 };
        let balance = Balance {
            stable: &stable,
            bias: stable.bias(averaged),
            shading: set.shading.registers(about.shading.as_ref(), (height, width)),
            gains: set.white_balance.registers(about),
            highest: LINEAR.of(white_balance::highest(about, set.gain.factor())),
            cfa,
        };
        let light = Grid::from_rows(
            height,
            width,
            #[inline(always)]
            |row, out| balance.row(&mosaic, row, out),
        );
        // The values that are demosaiced: the root of light, or, for comparison, light itself.
        let roots = Roots { stable: &stable, domain: set.domain };
        let mosaic = if set.tone_map.is_off() {
            rooted(
                &light,
                #[inline(always)]
                |light| roots.root(light),
            )
        } else {
            let local = ToneMap::local_light(&light);
            let tones = set.tone_map.registers(&local);
            Grid::from_rows(
                height,
                width,
                #[inline(always)]
                |row, out| {
                    let [slope, offset] = tones.row(row);
                    let (light, local) = (light.row(row), local.row(row));
                    by_blocks(
                        [out],
                        #[inline(always)]
                        |pixels, [block]| {
                            let [slope, offset] = [&slope, &offset].map(|row| &row[pixels.clone()]);
                            let (light, local) = (&light[pixels.clone()], &local[pixels]);
                            for c in 0..slope.len().min(BLOCK) {
                                let gain = tones.gain((slope[c], offset[c]), local[c].into());
                                block[c] = roots.root(amplified(light[c], gain));
                            }
                        },
                    );
                },
            )
        };
        drop(light);
        look.at_mosaic(notes, "tone_map", &mosaic);

        // Three colours at every pixel, and what demosaicing and noise did to them taken out.
        let mut rgb = demosaic::fixed(set.demosaic, &mosaic, cfa);
        drop(mosaic);
        look.at_colours(notes, "demosaic", &rgb);
        rgb = set.false_colour.fixed(rgb);
        look.at_colours(notes, "false_colour", &rgb);
        rgb = set.purple_fringe.fixed(rgb);
        look.at_colours(notes, "purple_fringe", &rgb);
        rgb = colour_denoise::fixed(&set.luma_denoise, &set.chroma_denoise, rgb, stable.sigma);
        look.at_colours(notes, "luma_denoise", &rgb);

        // Light of the display's colours, encoded.
        let (matrix, curve) = (set.colours.registers(about.colour_matrix), set.gamma.table());
        rgb = Grid::several_from_rows(
            height,
            width,
            #[inline(always)]
            |row, [r, g, b]| {
                let from = rgb.each_ref().map(|grid| grid.row(row));
                by_blocks(
                    [r, g, b],
                    #[inline(always)]
                    |pixels, [r, g, b]| {
                        let [from_r, from_g, from_b] = from.map(|row| &row[pixels.clone()]);
                        for c in 0..from_r.len().min(BLOCK) {
                            let lights = [from_r[c], from_g[c], from_b[c]].map(|root| roots.light(root));
                            let encoded = mixed(&matrix, lights).map(|v| curve.at(v.clamp(0, LINEAR.one())));
                            [r[c], g[c], b[c]] = encoded;
                        }
                    },
                );
            },
        );
        look.at_encoded(notes, "gamma", &rgb);
        rgb = set.sharpen.fixed(rgb);
        look.at_encoded(notes, "sharpen", &rgb);
        rgb = set.dewarp.fixed(rgb, about.warp.as_ref());
        look.at_encoded(notes, "dewarp", &rgb);
        let data = set.output.fixed(&rgb, set.bits);
        notes.time("output");
        drop(rgb);
        release_spare_memory();
        Ok(RgbPicture { height, width, bits: set.bits, data })
    }
}

/// Roots of the light of a raw frame's pixels.
fn expand_and_root(frame: &RawInput, levels: &Levels, gain: i32, stable: &Stable) -> Grid<i16> {
    let light = Grid::from_rows(
        frame.height,
        frame.width,
        #[inline(always)]
        |row, out: &mut [i32]| {
            let line = &frame.dn[row * frame.width..][..out.len()];
            match &frame.about.companding {
                None => levels.row(row, |c| line[c], out),
                Some(companding) => levels.row(row, |c| companding.expand(line[c]), out),
            }
            if gain != GAIN.one() {
                out.iter_mut().for_each(|v| *v = amplified(*v, gain));
            }
        },
    );
    rooted(
        &light,
        #[inline(always)]
        |light| stable.root(light),
    )
}

/// What is made of every pixel's light by `root`.
fn rooted(light: &Grid<i32>, root: impl Fn(i32) -> i32 + Sync) -> Grid<i16> {
    Grid::from_rows(
        light.height,
        light.width,
        #[inline(always)]
        |row, out| {
            let light = light.row(row);
            by_blocks(
                [out],
                #[inline(always)]
                |pixels, [block]| {
                    block.iter_mut().zip(&light[pixels]).for_each(|(out, v)| *out = root(*v));
                },
            );
        },
    )
}

/// What a driver sets for the way from denoised roots to balanced light.
struct Balance<'a> {
    stable: &'a Stable,
    bias: i32,
    shading: Option<Shades>,
    /// Gains of red, green and blue.
    gains: [i32; 3],
    highest: i32,
    cfa: CfaPattern,
}

impl Balance<'_> {
    /// The balanced light of a row of roots.
    #[inline(always)]
    fn row(&self, mosaic: &Grid<i16>, row: usize, out: &mut [i32]) {
        // Colours alternate along a row, and blocks are even.
        let planes = [0, 1].map(|col| self.cfa.colour(row, col).plane().unwrap_or(1));
        let shades = self.shading.as_ref().map(|shading| planes.map(|plane| shading.row(plane, row)));
        let gains = planes.map(|plane| self.gains[plane]);
        let roots = mosaic.around(row, out.len());
        by_blocks(
            [out],
            #[inline(always)]
            |pixels, [block]| {
                let roots = roots.block(0, 0, pixels.start);
                for c in 0..BLOCK {
                    block[c] = self.stable.light(roots[c].into(), self.bias);
                }
                if let Some([even, odd]) = &shades {
                    let (even, odd) = (&even[pixels.clone()], &odd[pixels]);
                    for c in 0..even.len().min(odd.len()).min(BLOCK) {
                        block[c] = amplified(block[c], if c % 2 == 0 { even[c] } else { odd[c] });
                    }
                }
                for c in 0..BLOCK {
                    let gain = if c % 2 == 0 { gains[0] } else { gains[1] };
                    block[c] = amplified(block[c], gain).min(self.highest);
                }
            },
        );
    }
}

/// The values between which colours are interpolated.
struct Roots<'a> {
    stable: &'a Stable,
    domain: Domain,
}

impl Roots<'_> {
    #[inline(always)]
    fn root(&self, light: i32) -> i32 {
        match self.domain {
            Domain::Stabilised => self.stable.root(light),
            Domain::Linear => ROOT.clamp(light >> (LINEAR.fraction - ROOT.fraction)),
        }
    }

    #[inline(always)]
    fn light(&self, root: i16) -> i32 {
        match self.domain {
            Domain::Stabilised => self.stable.light(root.into(), 0),
            Domain::Linear => LINEAR.clamp(i32::from(root) << (LINEAR.fraction - ROOT.fraction)),
        }
    }
}

/// How pictures between stages are shown: the missing steps in their simplest form.
struct Look<'a> {
    stable: &'a Stable,
    cfa: CfaPattern,
    set: &'a IspSettings,
}

impl Notes<'_> {
    /// Notes the time of a stage, if times are noted.
    fn time(&mut self, stage: &'static str) {
        if let Self::Times { clock, times } = self {
            times.push((stage, clock.elapsed().as_secs_f64()));
            *clock = Instant::now();
        }
    }
}

impl Look<'_> {
    fn at_mosaic(&self, notes: &mut Notes, stage: &'static str, mosaic: &Grid<i16>) {
        notes.time(stage);
        if matches!(notes, Notes::Pictures(_)) {
            let rgb = demosaic::fixed(crate::isp::Demosaic::Bilinear, mosaic, self.cfa);
            self.at_colours(notes, stage, &rgb);
        }
    }

    fn at_colours(&self, notes: &mut Notes, stage: &'static str, rgb: &[Grid<i16>; 3]) {
        notes.time(stage);
        if matches!(notes, Notes::Pictures(_)) {
            let curve = gamma::Gamma::default().table();
            let is_light = self.set.domain == Domain::Linear && Self::is_behind_tone_map(stage);
            let encoded = rgb.each_ref().map(|grid| {
                Grid::from_rows(
                    grid.height,
                    grid.width,
                    #[inline(always)]
                    |row, out| {
                        for (out, root) in out.iter_mut().zip(grid.row(row)) {
                            let light = match is_light {
                                true => i32::from(*root) << (LINEAR.fraction - ROOT.fraction),
                                false => self.stable.light((*root).into(), 0),
                            };
                            *out = curve.at(light.clamp(0, LINEAR.one())) as i16;
                        }
                    },
                )
            });
            self.at_encoded(notes, stage, &encoded);
        }
    }

    fn is_behind_tone_map(stage: &str) -> bool {
        ["tone_map", "demosaic", "false_colour", "purple_fringe", "luma_denoise"].contains(&stage)
    }

    fn at_encoded(&self, notes: &mut Notes, stage: &'static str, rgb: &[Grid<i16>; 3]) {
        notes.time(stage);
        if let Notes::Pictures(watch) = notes {
            let (height, width, bits) = (rgb[0].height, rgb[0].width, self.set.bits);
            let data = super::stage::output::Output::default().fixed(rgb, bits);
            watch(stage, RgbPicture { height, width, bits, data });
        }
    }
}

//! The automotive ISP as a chip runs it: every stage in whole numbers.
//!
//! ```text
//! raw -> black level -> gain -> root of light -> green equalisation -> defect pixels -> denoise (mosaic)
//!     -> light -> shading -> white balance -> local tone map -> root of light -> demosaic -> false colours
//!     -> purple fringes -> denoise (colours, luma) -> light -> colour matrix -> gamma -> sharpen -> dewarp -> output
//! ```

use petzval_base::statistics::median;

use super::fixed::{BLOCK, ENCODED, GAIN, Grid, LINEAR, ROOT, by_blocks, release_spare_memory};
use super::notes::{Look, Notes, Watch};
use super::settings::IspSettings;
use super::stage::black_level::Registers as Levels;
use super::stage::colour::mixed;
use super::stage::colour_denoise::LumaDenoise;
use super::stage::gain::amplified;
use super::stage::gamma::Gamma;
use super::stage::shading::Registers as Shades;
use super::stage::stabilise::{Stable, rooted};
use super::stage::tone_map::ToneMap;
use super::stage::{colour_denoise, demosaic, white_balance};
use super::{Isp, IspError, IspParameter, RawInput, RgbPicture};
use crate::develop::Domain;
use crate::sensor::CfaPattern;

/// Bits that [`LINEAR`] has behind the point beyond those of [`ENCODED`].
const TO_ENCODED: u32 = LINEAR.fraction - ENCODED.fraction;

/// The automotive ISP in fixed-point arithmetic.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HardwareIsp {
    /// Methods and the bits of the picture; its numbers are what [`HardwareIsp::develop_as_set`] develops with.
    pub settings: IspSettings,
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
    /// Stages without a picture of their own, which change what the numbers stand for; beside each the stage whose picture is theirs too.
    pub const WITHOUT_PICTURE: [(&'static str, &'static str); 1] = [("stabilise", "gain")];

    /// Develops a frame with the settings' own numbers.
    pub fn develop_as_set(&self, frame: &RawInput) -> Result<RgbPicture, IspError> {
        self.run(frame, &mut Notes::Nothing)
    }

    /// The same, and `watch` sees the picture after every stage.
    pub fn develop_steps(&self, frame: &RawInput, watch: Watch) -> Result<RgbPicture, IspError> {
        self.run(frame, &mut Notes::Pictures(watch))
    }

    /// How long each stage takes on a frame, s, in their order: medians of `runs`, with memory that an earlier run has left.
    ///
    /// Of two stages in one pass over the frame, the first has the time of a pass without the second, and the second the rest. The ways
    /// from roots back to light count to `shading` and to `colours`, and that to roots between them to `tone_map`.
    pub fn stage_times(&self, frame: &RawInput, runs: usize) -> Result<Vec<(&'static str, f64)>, IspError> {
        let once = || {
            let mut notes = Notes::times();
            self.run(frame, &mut notes).map(|_| notes.into_times())
        };
        let (first, all) = (once()?, (0..runs).map(|_| once()).collect::<Result<Vec<_>, _>>()?);
        release_spare_memory();
        let median_of = |k: usize| median(all.iter().map(|times| times[k].1));
        Ok(first.iter().enumerate().map(|(k, (stage, _))| (*stage, median_of(k))).collect())
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
        let look = Look { stable: &stable, cfa, bits: set.bits };

        // The raw frame becomes light, is amplified, and its root taken. Whoever watches sees passes of two stages in part first.
        let levels = set.black_level.registers(frame);
        if notes.is_watching() {
            let part = expanded(frame, &levels, GAIN.one());
            look.at_light(notes, "black_level", &part);
        }
        let light = expanded(frame, &levels, set.gain.register());
        look.at_light(notes, "gain", &light);
        let mut mosaic = rooted(
            &light,
            #[inline(always)]
            |light| stable.root(light),
        );
        drop(light);
        notes.time("stabilise");
        mosaic = set.green_balance.fixed(mosaic, cfa, stable.sigma);
        look.at_mosaic(notes, "green_balance", &mosaic, Domain::Stabilised);
        mosaic = set.defects.fixed(mosaic);
        look.at_mosaic(notes, "defects", &mosaic, Domain::Stabilised);
        mosaic = set.bayer_denoise.fixed(mosaic, stable.sigma);
        look.at_mosaic(notes, "bayer_denoise", &mosaic, Domain::Stabilised);

        // Back to light; the lens's shading and the sensor's colours are balanced there.
        let averaged = if set.bayer_denoise.strength > 0.0 { set.bayer_denoise.averaged() } else { 0.0 };
        let shading = Balance {
            stable: &stable,
            bias: stable.bias(averaged),
            shading: set.shading.registers(about.shading.as_ref(), (height, width)),
            white: None,
            cfa,
        };
        if notes.is_watching() {
            let part = shading.of(&mosaic);
            look.at_light(notes, "shading", &part);
        }
        let highest = LINEAR.of(white_balance::highest(about, set.gain.factor()));
        let balance = Balance { white: Some((set.white_balance.registers(about), highest)), ..shading };
        let light = balance.of(&mosaic);
        look.at_light(notes, "white_balance", &light);
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
                [height, width],
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
        look.at_mosaic(notes, "tone_map", &mosaic, set.domain);

        // Three colours at every pixel, and what demosaicing and noise did to them taken out.
        let mut rgb = demosaic::fixed(set.demosaic, &mosaic, cfa);
        drop(mosaic);
        look.at_colours(notes, "demosaic", &rgb, set.domain);
        rgb = set.false_colour.fixed(rgb);
        look.at_colours(notes, "false_colour", &rgb, set.domain);
        rgb = set.purple_fringe.fixed(rgb);
        look.at_colours(notes, "purple_fringe", &rgb, set.domain);
        if notes.is_watching() {
            let whole = rgb.each_ref().map(Grid::copied);
            notes.restart();
            let none = LumaDenoise { strength: 0.0, ..set.luma_denoise };
            let part = colour_denoise::fixed(&none, &set.chroma_denoise, whole, stable.sigma);
            look.at_colours(notes, "chroma_denoise", &part, set.domain);
        }
        rgb = colour_denoise::fixed(&set.luma_denoise, &set.chroma_denoise, rgb, stable.sigma);
        look.at_colours(notes, "luma_denoise", &rgb, set.domain);

        // Light of the display's colours, encoded.
        let (matrix, curve) = (set.colours.registers(about.colour_matrix), set.gamma.table());
        match notes {
            Notes::Nothing => {}
            Notes::Pictures(_) => {
                let curve = Gamma::default().table();
                let part = encoded(
                    &rgb,
                    &roots,
                    #[inline(always)]
                    |light| mixed(&matrix, light).map(|v| curve.at(v.clamp(0, LINEAR.one()))),
                );
                look.at_encoded(notes, "colours", &part);
            }
            Notes::Times { .. } => {
                drop(encoded(
                    &rgb,
                    &roots,
                    #[inline(always)]
                    |light| mixed(&matrix, light).map(|v| v.clamp(0, LINEAR.one()) >> TO_ENCODED),
                ));
                notes.time("colours");
            }
        }
        rgb = encoded(
            &rgb,
            &roots,
            #[inline(always)]
            |light| mixed(&matrix, light).map(|v| curve.at(v.clamp(0, LINEAR.one()))),
        );
        look.at_encoded(notes, "gamma", &rgb);
        rgb = set.sharpen.fixed(rgb);
        look.at_encoded(notes, "sharpen", &rgb);
        rgb = set.dewarp.fixed(rgb, about.warp.as_ref());
        look.at_encoded(notes, "dewarp", &rgb);
        let data = set.output.fixed(&rgb, set.bits);
        notes.time("output");
        drop(rgb);
        if !notes.is_timing() {
            release_spare_memory();
        }
        Ok(RgbPicture { height, width, bits: set.bits, data })
    }
}

/// The light of a raw frame's pixels, amplified.
fn expanded(frame: &RawInput, levels: &Levels, gain: i32) -> Grid<i32> {
    Grid::from_rows(
        [frame.height, frame.width],
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
    )
}

/// Encoded values of roots of the three colours: what `of` makes of their light.
fn encoded(rgb: &[Grid<i16>; 3], roots: &Roots, of: impl Fn([i32; 3]) -> [i32; 3] + Sync) -> [Grid<i16>; 3] {
    Grid::several_from_rows(
        rgb[0].size(),
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
                        [r[c], g[c], b[c]] = of(lights);
                    }
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
    /// Gains of red, green and blue, and where highlights end.
    white: Option<([i32; 3], i32)>,
    cfa: CfaPattern,
}

impl Balance<'_> {
    /// The balanced light of the roots of a mosaic.
    fn of(&self, mosaic: &Grid<i16>) -> Grid<i32> {
        Grid::from_rows(
            mosaic.size(),
            #[inline(always)]
            |row, out| self.row(mosaic, row, out),
        )
    }

    /// The balanced light of a row of roots.
    #[inline(always)]
    fn row(&self, mosaic: &Grid<i16>, row: usize, out: &mut [i32]) {
        // Colours alternate along a row, and blocks are even.
        let planes = [0, 1].map(|col| self.cfa.colour(row, col).plane().unwrap_or(1));
        let shades = self.shading.as_ref().map(|shading| planes.map(|plane| shading.row(plane, row)));
        let white = self.white.map(|(gains, highest)| (planes.map(|plane| gains[plane]), highest));
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
                if let Some((gains, highest)) = white {
                    for c in 0..BLOCK {
                        let gain = if c % 2 == 0 { gains[0] } else { gains[1] };
                        block[c] = amplified(block[c], gain).min(highest);
                    }
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

//! What is noted after every stage of the automotive ISP: the picture, or the time.

use std::time::Instant;

use super::RgbPicture;
use super::fixed::{Grid, LINEAR, ROOT};
use super::stage::demosaic;
use super::stage::gamma::Gamma;
use super::stage::output::Output;
use super::stage::stabilise::{Stable, rooted};
use crate::develop::{Demosaic, Domain};
use crate::sensor::CfaPattern;

/// Someone who looks at the picture after every stage: the stage's name, and the picture as a display would show it.
pub type Watch<'w> = &'w mut dyn FnMut(&'static str, RgbPicture);

/// Stages of one pass over the frame. Where something is noted, the first also has a pass of its own.
const SAME_PASS: [(&str, &str); 4] = [
    ("black_level", "gain"),
    ("shading", "white_balance"),
    ("chroma_denoise", "luma_denoise"),
    ("colours", "gamma"),
];

/// What is noted after every stage.
pub(super) enum Notes<'w> {
    /// Nothing.
    Nothing,
    /// The picture.
    Pictures(Watch<'w>),
    /// The time since the stage before, s.
    Times { clock: Instant, times: Vec<(&'static str, f64)> },
}

impl Notes<'_> {
    /// Notes of times.
    pub fn times() -> Self {
        Self::Times { clock: Instant::now(), times: Vec::new() }
    }

    /// The times, if they were noted.
    pub fn into_times(self) -> Vec<(&'static str, f64)> {
        match self {
            Self::Times { times, .. } => times,
            Self::Nothing | Self::Pictures(_) => Vec::new(),
        }
    }

    /// Whether anything is noted.
    pub fn is_watching(&self) -> bool {
        !matches!(self, Self::Nothing)
    }

    /// Leaves out the time since the stage before.
    pub fn restart(&mut self) {
        if let Self::Times { clock, .. } = self {
            *clock = Instant::now();
        }
    }

    /// Whether times are noted.
    pub fn is_timing(&self) -> bool {
        matches!(self, Self::Times { .. })
    }

    /// Notes the time of a stage: of one behind another in the same pass, what the pass took beyond the other.
    pub fn time(&mut self, stage: &'static str) {
        let Self::Times { clock, times } = self else { return };
        let of_pass = clock.elapsed().as_secs_f64();
        let first = SAME_PASS.iter().find(|(_, behind)| *behind == stage).map(|(first, _)| *first);
        let of_first = times.iter().find(|(name, _)| Some(*name) == first).map_or(0.0, |(_, s)| *s);
        times.push((stage, (of_pass - of_first).max(0.0)));
        *clock = Instant::now();
    }
}

/// How pictures between stages are shown: the missing steps in their simplest form.
pub(super) struct Look<'a> {
    pub stable: &'a Stable,
    pub cfa: CfaPattern,
    pub bits: u32,
}

impl Look<'_> {
    /// The picture of a mosaic of light.
    pub fn at_light(&self, notes: &mut Notes, stage: &'static str, light: &Grid<i32>) {
        notes.time(stage);
        if matches!(notes, Notes::Pictures(_)) {
            let roots = rooted(
                light,
                #[inline(always)]
                |light| self.stable.root(light),
            );
            self.at_mosaic(notes, stage, &roots, Domain::Stabilised);
        }
    }

    /// The picture of a mosaic of values of a domain.
    pub fn at_mosaic(&self, notes: &mut Notes, stage: &'static str, mosaic: &Grid<i16>, domain: Domain) {
        notes.time(stage);
        if matches!(notes, Notes::Pictures(_)) {
            let rgb = demosaic::fixed(Demosaic::Bilinear, mosaic, self.cfa);
            self.at_colours(notes, stage, &rgb, domain);
        }
    }

    /// The picture of three colours in values of a domain.
    pub fn at_colours(&self, notes: &mut Notes, stage: &'static str, rgb: &[Grid<i16>; 3], domain: Domain) {
        notes.time(stage);
        if matches!(notes, Notes::Pictures(_)) {
            let curve = Gamma::default().table();
            let encoded = rgb.each_ref().map(|grid| {
                Grid::from_rows(
                    grid.size(),
                    #[inline(always)]
                    |row, out| {
                        for (out, root) in out.iter_mut().zip(grid.row(row)) {
                            let light = match domain {
                                Domain::Linear => i32::from(*root) << (LINEAR.fraction - ROOT.fraction),
                                Domain::Stabilised => self.stable.light((*root).into(), 0),
                            };
                            *out = curve.at(light.clamp(0, LINEAR.one())) as i16;
                        }
                    },
                )
            });
            self.at_encoded(notes, stage, &encoded);
        }
    }

    /// The picture of encoded values.
    pub fn at_encoded(&self, notes: &mut Notes, stage: &'static str, rgb: &[Grid<i16>; 3]) {
        notes.time(stage);
        if let Notes::Pictures(watch) = notes {
            let (height, width) = (rgb[0].height, rgb[0].width);
            let data = Output::default().fixed(rgb, self.bits);
            watch(stage, RgbPicture { height, width, bits: self.bits, data });
        }
    }
}

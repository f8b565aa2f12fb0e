//! The operating point of the pictures.

use petzval_lab::emva::{ChannelResult, Characterization, GainResult};

use super::style::{Around, colour_name, marker_of, sheet};
use crate::palette;
use crate::plot::{Key, KeyLine, Panel, Sheet};

/// The operating point that the pictures of EMVA 1288 show: the gain with the most complete captures.
pub(super) struct Shown<'a> {
    pub all: &'a Characterization,
    pub gain: &'a GainResult,
}

impl<'a> Shown<'a> {
    /// The gain with non-uniformity, else that with most flat points; of several the one nearest to 1. `None` without
    /// gains.
    pub fn choose(all: &'a Characterization) -> Option<Self> {
        let rank = |g: &&GainResult| {
            let spatial = g.channels.iter().any(|c| c.spatial.is_some());
            let points = g.channels.iter().map(|c| c.points.len()).max().unwrap_or(0);
            (spatial, points, std::cmp::Reverse((g.linear_gain.ln().abs() * 1e6) as u64))
        };
        all.gains.iter().max_by_key(rank).map(|gain| Self { all, gain })
    }

    pub fn channels(&self) -> &'a [ChannelResult] {
        &self.gain.channels
    }

    /// A key of the colours of the mosaic.
    pub fn colour_keys(&self) -> Vec<Key> {
        let marker =
            |colour| KeyLine::Marker(palette::mosaic(Some(colour)).to_owned(), marker_of(Some(colour)));
        let entry = |colour| Key { line: marker(colour), name: colour_name(colour).to_owned() };
        self.channels().iter().map(|channel| entry(channel.colour)).collect()
    }

    /// A sheet of one panel, or of several in two columns, at this gain.
    pub fn sheet(
        &self,
        [class, title]: [&'static str; 2],
        remark: impl Into<String>,
        keys: Vec<Key>,
        panels: &[Panel],
        frame_height: f64,
    ) -> Sheet {
        let linear_gain = Some(self.gain.linear_gain);
        let around = Around { class, title, remark: remark.into(), keys, linear_gain };
        sheet(self.all, around, panels, panels.len().min(2), frame_height)
    }
}

//! Boxes as offsets from other boxes: what a network predicts.

use super::BBox;

/// Largest predicted logarithm of a ratio of sizes, `ln(1000 / 16)`: a wild prediction stays finite.
const LARGEST_LOG: f32 = 4.135_166_6;

/// Boxes relative to proposals (Girshick 2015): with centres `c` and sizes `s` of box and proposal `p`,
///
/// ```text
/// dx = w_x (c_x - p.c_x) / p.s_x    dw = w_w ln(s_x / p.s_x)    and the same for y
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxCoder {
    /// The weights `[w_x, w_y, w_w, w_h]`, which bring the offsets to a spread of about 1.
    pub weights: [f32; 4],
}

impl BoxCoder {
    /// The weights for proposals from anchors.
    pub const PROPOSALS: Self = Self { weights: [1.0; 4] };
    /// The weights for boxes from proposals.
    pub const BOXES: Self = Self { weights: [10.0, 10.0, 5.0, 5.0] };

    /// The offsets `[dx, dy, dw, dh]` of a box from a proposal; both have an area.
    pub fn encode(&self, bbox: &BBox, proposal: &BBox) -> [f32; 4] {
        let ([x, y], [px, py]) = (bbox.centre(), proposal.centre());
        let [wx, wy, ww, wh] = self.weights;
        [
            wx * (x - px) / proposal.width(),
            wy * (y - py) / proposal.height(),
            ww * (bbox.width() / proposal.width()).ln(),
            wh * (bbox.height() / proposal.height()).ln(),
        ]
    }

    /// The box at these offsets from a proposal.
    pub fn decode(&self, offsets: [f32; 4], proposal: &BBox) -> BBox {
        let [dx, dy, dw, dh] = std::array::from_fn(|i| offsets[i] / self.weights[i]);
        let [px, py] = proposal.centre();
        let (x, y) = (px + dx * proposal.width(), py + dy * proposal.height());
        let half_width = 0.5 * proposal.width() * dw.min(LARGEST_LOG).exp();
        let half_height = 0.5 * proposal.height() * dh.min(LARGEST_LOG).exp();
        BBox::new(x - half_width, y - half_height, x + half_width, y + half_height)
    }
}

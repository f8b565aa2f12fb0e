//! Curves of a frame, and pens, which are their style.

use super::Marker;

/// Colour, dashes, width and markers of a curve.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pen {
    /// `#rrggbb`.
    pub colour: String,
    /// Whether the line is dashed.
    pub is_dashed: bool,
    /// px.
    pub width: f64,
    /// From 0, invisible, to 1.
    pub opacity: f64,
    /// Shape of the markers on the curve.
    pub marker: Option<Marker>,
}

impl Pen {
    /// A solid line with markers.
    pub fn marked(colour: &str, marker: Marker) -> Self {
        Self { colour: colour.into(), is_dashed: false, width: 1.7, opacity: 1.0, marker: Some(marker) }
    }

    /// A thin solid line without markers.
    pub fn thin(colour: &str) -> Self {
        Self { colour: colour.into(), is_dashed: false, width: 1.2, opacity: 1.0, marker: None }
    }

    /// The same, dashed.
    pub fn dashed(mut self) -> Self {
        self.is_dashed = true;
        self
    }

    /// The same without markers.
    pub fn unmarked(mut self) -> Self {
        self.marker = None;
        self
    }

    /// The dashes as SVG has them.
    pub fn dashes(&self) -> Option<&'static str> {
        self.is_dashed.then_some("6 4")
    }
}

/// A line through points; where one is missing the line is broken.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    /// Style.
    pub pen: Pen,
    /// Points (x, y) in the values of the axes.
    pub points: Vec<Option<[f64; 2]>>,
    /// Index among the curves of a frame: markers of different curves are at different points.
    pub index: usize,
}

impl Curve {
    /// Values on the vertical axis over positions on the horizontal one.
    pub fn over(pen: Pen, index: usize, x: &[f64], y: impl IntoIterator<Item = Option<f64>>) -> Self {
        let point =
            |(x, y): (&f64, Option<f64>)| y.map(|y| [*x, y]).filter(|p| p.iter().all(|v| v.is_finite()));
        Self { pen, index, points: x.iter().zip(y).map(point).collect() }
    }

    /// Values on the horizontal axis over positions on the vertical one, as for curves over the field.
    pub fn beside(pen: Pen, index: usize, y: &[f64], x: impl IntoIterator<Item = Option<f64>>) -> Self {
        let upright = Self::over(pen, index, y, x);
        Self { points: upright.points.into_iter().map(|p| p.map(|[y, x]| [x, y])).collect(), ..upright }
    }

    /// Its values along an axis: 0 horizontal, 1 vertical.
    pub fn values(&self, along: usize) -> impl Iterator<Item = f64> + '_ {
        self.points.iter().flatten().map(move |p| p[along])
    }
}

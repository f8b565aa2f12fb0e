//! Markers: small shapes that distinguish curves without colour.

use std::fmt::Write;

/// The shape of a marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Marker {
    Circle,
    Square,
    Triangle,
    Diamond,
    Plus,
    Cross,
    Wedge,
}

/// All shapes, in the order of their use.
const ALL: [Marker; 7] = [
    Marker::Circle,
    Marker::Square,
    Marker::Triangle,
    Marker::Diamond,
    Marker::Cross,
    Marker::Plus,
    Marker::Wedge,
];

impl Marker {
    /// The i-th shape.
    pub fn nth(i: usize) -> Self {
        ALL[i % ALL.len()]
    }

    /// Whether it is drawn by lines rather than filled.
    pub fn is_open(self) -> bool {
        matches!(self, Self::Plus | Self::Cross)
    }

    /// Adds the shape about a point to a path; all shapes of one radius look equally large.
    pub fn add(self, path: &mut String, [x, y]: [f64; 2], radius: f64) {
        let p = super::px;
        let r = radius;
        // Writing to a string cannot fail.
        let _ = match self {
            Self::Circle => {
                write!(
                    path,
                    "M{} {}a{r} {r} 0 1 0 {d} 0a{r} {r} 0 1 0 -{d} 0z",
                    p(x - r),
                    p(y),
                    r = p(r),
                    d = p(2.0 * r)
                )
            }
            Self::Square => {
                let s = 1.78 * r;
                write!(path, "M{} {}h{s}v{s}h-{s}z", p(x - 0.5 * s), p(y - 0.5 * s), s = p(s))
            }
            Self::Triangle => {
                let (w, h) = (2.3 * r, 2.1 * r);
                write!(path, "M{} {}l{} {}h-{}z", p(x), p(y - 0.6 * h), p(0.5 * w), p(h), p(w))
            }
            Self::Wedge => {
                let (w, h) = (2.3 * r, 2.1 * r);
                write!(path, "M{} {}l{} -{}h-{}z", p(x), p(y + 0.6 * h), p(0.5 * w), p(h), p(w))
            }
            Self::Diamond => {
                let s = 1.3 * r;
                write!(path, "M{} {}l{s} {s}l-{s} {s}l-{s} -{s}z", p(x), p(y - s), s = p(s))
            }
            Self::Plus => {
                let s = 1.2 * r;
                write!(path, "M{} {}h{d}M{} {}v{d}", p(x - s), p(y), p(x), p(y - s), d = p(2.0 * s))
            }
            Self::Cross => {
                let s = 0.95 * r;
                write!(path, "M{} {}l{d} {d}m-{d} 0l{d} -{d}", p(x - s), p(y - s), d = p(2.0 * s))
            }
        };
    }

    /// The shapes about many points as one path.
    pub fn path(self, places: impl IntoIterator<Item = [f64; 2]>, radius: f64) -> String {
        let mut path = String::new();
        places.into_iter().for_each(|at| self.add(&mut path, at, radius));
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shape_is_its_own_path() {
        let paths: Vec<String> = (0..ALL.len()).map(|i| Marker::nth(i).path([[10.0, 20.0]], 2.0)).collect();
        for (i, a) in paths.iter().enumerate() {
            assert!(a.starts_with('M') && !a.contains("--") && !a.contains("NaN"), "{a}");
            assert!(paths[..i].iter().all(|b| b != a));
        }
        assert_eq!(Marker::Square.path([[0.0, 0.0], [5.0, 5.0]], 2.0).matches('z').count(), 2);
    }
}

//! A scatter plot: a point for every unit, of the colour and shape of its camera.

use crate::palette;
use crate::plot::{Axis, Key, KeyLine, Marker, Panel, Points, Sheet, WIDTH_PX, grid, span};

/// Height of the frame, px.
const HEIGHT_PX: f64 = 320.0;

/// Width of a character of the words along an axis with the space around a word, px.
const CHARACTER_PX: f64 = 8.0;

/// Ticks of an axis.
const TICKS: usize = 6;

/// Space between the outermost points and the frame, as a share of the range.
const MARGIN: f64 = 0.05;

/// An axis whose positive values span more than this ratio, and whose least is far below the middle, has equal ratios.
const WIDE_RATIO: f64 = 30.0;

/// Two quantities of every unit against each other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scatter {
    /// Names of the axes, with units.
    pub names: [String; 2],
    /// Words along the axis to the right, the first at 0 and the next at 1; empty where numbers stand.
    pub x_words: Vec<String>,
    /// The points by camera.
    pub groups: Vec<ScatterGroup>,
}

/// Points of one camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScatterGroup {
    /// The camera; empty where units make none.
    pub name: String,
    /// Places of the points.
    pub at: Vec<[f64; 2]>,
}

impl Scatter {
    /// The plot as SVG.
    pub fn svg(&self) -> String {
        let all = |k: usize| self.groups.iter().flat_map(move |group| group.at.iter().map(move |at| at[k]));
        let axis = |k: usize| axis(span(all(k)));
        let x = if self.x_words.is_empty() { axis(0) } else { Axis::of_names(&self.words()) };
        let [x_name, y_name] = &self.names;
        let points = self.groups.iter().enumerate().map(|(i, group)| Points {
            colour: palette::camera(i).to_owned(),
            marker: Marker::nth(i),
            is_hollow: false,
            at: group.at.iter().map(|[x, y]| (*x, *y, 0.0)).collect(),
        });
        let panel = Panel { points: points.collect(), ..Panel::new("", [x_name, y_name], x, axis(1)) };
        let (body, height) = grid(&[panel], 1, WIDTH_PX, HEIGHT_PX);
        let key = |(i, group): (usize, &ScatterGroup)| Key {
            line: KeyLine::Marker(palette::camera(i).to_owned(), Marker::nth(i)),
            name: group.name.clone(),
        };
        Sheet {
            class: "scatter",
            keys: self
                .groups
                .iter()
                .enumerate()
                .filter(|(_, group)| !group.name.is_empty())
                .map(key)
                .collect(),
            alt: format!("{y_name} over {x_name}, a point for every unit"),
            width: WIDTH_PX,
            height,
            body,
            ..Sheet::default()
        }
        .svg()
    }

    /// The words along the axis, cut so that neighbours do not overlap.
    fn words(&self) -> Vec<String> {
        let most = (WIDTH_PX / self.x_words.len() as f64 / CHARACTER_PX) as usize;
        let cut = |word: &String| match word.char_indices().nth(most.max(2)) {
            Some(_) => word.chars().take(most.max(2) - 1).chain(['…']).collect(),
            None => word.clone(),
        };
        self.x_words.iter().map(cut).collect()
    }
}

/// An axis around values: by equal ratios where they span many, as learning rates do.
fn axis(range: Option<(f64, f64)>) -> Axis {
    let Some((low, high)) = range else { return Axis::between(0.0, 1.0, TICKS) };
    if low > 0.0 && high / low > WIDE_RATIO {
        let margin = (high / low).powf(MARGIN);
        return Axis::ratios(low / margin, high * margin);
    }
    // Equal values get a range of their own size.
    let reach = if high > low { MARGIN * (high - low) } else { 0.1 * high.abs().max(1e-6) };
    Axis::between(low - reach, high + reach, TICKS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_along_the_axis_are_cut_where_they_are_long() {
        let words =
            |count: usize| Scatter { x_words: vec!["commercial".repeat(3); count], ..Scatter::default() };
        assert_eq!(words(2).words(), vec!["commercial".repeat(3); 2]);
        let cut = words(9).words();
        assert!(
            cut[0].starts_with("commercial") && cut[0].ends_with('…') && cut[0].chars().count() < 16,
            "{cut:?}"
        );
        let svg = Scatter {
            x_words: vec!["fine".into(), "coarse".into()],
            groups: vec![ScatterGroup { name: String::new(), at: vec![[0.0, 3.0], [1.0, 4.0]] }],
            ..Scatter::default()
        }
        .svg();
        assert!(svg.contains("fine</text>") && svg.contains("coarse</text>"), "{svg}");
    }

    #[test]
    fn an_axis_holds_all_values_and_is_logarithmic_for_rates() {
        for (low, high, is_log) in [
            (1e-4, 1e-1, true),
            (64.0, 128.0, false),
            (3.0, 3.0, false),
            (-1.0, 2.0, false),
            (0.0, 0.0, false),
        ] {
            let axis = axis(Some((low, high)));
            assert!(axis.low < low && axis.high > high, "{low} {high}");
            assert_eq!(axis.is_logarithmic(), is_log);
        }
    }
}

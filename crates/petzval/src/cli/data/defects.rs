//! The tables of `petzval data`.

use crate::base::counted;
use crate::jobs::data::{Defect, Severity, Statistics};

/// Pictures, classes and defects.
pub fn table(statistics: &Statistics, defects: &[Defect]) -> String {
    let boxes = if statistics.boxes == 1 { "box" } else { "boxes" };
    let mut text = format!("{}, {} {boxes}, ", counted(statistics.images, "picture"), statistics.boxes);
    text += &format!("{} at most in one\n", statistics.most_boxes);
    let list = |pairs: Vec<String>| pairs.join(", ");
    if !statistics.images_by_split.is_empty() {
        let splits = statistics.images_by_split.iter().map(|(name, n)| format!("{name} {n}"));
        let unnamed = match statistics.images_without_split {
            0 => String::new(),
            n => format!(", without a part {n}"),
        };
        text += &format!("parts  {}{unnamed}\n", list(splits.collect()));
    }
    if statistics.sequences > 0 {
        text += &format!("sequences  {}\n", statistics.sequences);
    }
    let sizes = statistics.sizes.iter().map(|(width, height, n)| format!("{width} x {height} ({n})"));
    text += &format!("sizes, px  {}\n", list(sizes.collect()));

    let width =
        statistics.classes.iter().map(|class| class.name.chars().count()).max().unwrap_or(0).clamp(5, 40);
    text += &format!(
        "\n{:<width$}  {:>8}  {:>8}  {:>8}  {:>8}  {:>8}  {:>8}  side px: 5 %  50 %  95 %\n",
        "class", "boxes", "pictures", "ignored", "small", "medium", "large"
    );
    for class in &statistics.classes {
        let [low, middle, high] = class.side_px;
        text += &format!(
            "{:<width$}  {:>8}  {:>8}  {:>8}  {:>8}  {:>8}  {:>8}  {low:>12.0}  {middle:>4.0}  {high:>4.0}\n",
            class.name, class.boxes, class.images, class.ignored, class.small, class.medium, class.large
        );
        if !class.states.is_empty() {
            let states = class.states.iter().map(|(state, n)| format!("{state} {n}"));
            text += &format!("{:<width$}    {}\n", "", list(states.collect()));
        }
    }
    if !statistics.classes.is_empty() {
        text +=
            "side px: the square root of the area of a box; 5, 50 and 95 % of the boxes have a smaller one\n";
    }
    for defect in defects {
        let kind = match defect.severity {
            Severity::Error => "error",
            Severity::Warning => "note",
        };
        text += &format!("\n{kind}, {}: {}\n", defect.times(), defect.kind.sentence());
        text += &format!("  hint: {}\n", defect.kind.hint());
        defect.worst.iter().for_each(|worst| text += &format!("  worst: {worst}\n"));
        defect.first.iter().for_each(|first| text += &format!("  {first}\n"));
    }
    text
}

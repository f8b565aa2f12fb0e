//! What the classes of an experiment must be.

use petzval_base::FileError;
use petzval_files::coco::LIGHT_STATES;

use super::checked::Checked;
use crate::experiment::variants;

/// Refuses classes that a task cannot have, that have no name or the same one, and lights that show what no light shows.
pub(super) fn fit_the_task(c: &Checked) -> Result<(), FileError> {
    let wrong = |i: usize, key: &str, message: String, hint: &str| {
        Err(variants::at(c.text, &["class", &i.to_string(), key], message).hint(hint))
    };
    if !c.facts.has_classes && !c.experiment.class.is_empty() {
        let message = format!("the task `{}` has no classes", c.experiment.task);
        return wrong(0, "name", message, "leave [[class]] out, or name a task that has classes");
    }
    if c.facts.has_classes && c.experiment.class.is_empty() {
        let message = format!("the task `{}` needs classes", c.experiment.task);
        let hint = "add a table [[class]] with a name for each of them";
        return Err(FileError::at_key(c.text, &["task"], message).hint(hint));
    }
    for (i, class) in c.experiment.class.iter().enumerate() {
        let name = &class.name;
        if name.is_empty() || !name.chars().all(|c| c.is_alphanumeric() || "-_".contains(c)) {
            let message = format!("`{name}` is no name of a class");
            let hint = "letters, digits, - and _: it stands in the names of scores, such as ap50_car";
            return wrong(i, "name", message, hint);
        }
        if c.experiment.class[..i].iter().any(|other| other.name == *name) {
            return wrong(i, "name", format!("`{name}` is named twice"), "name each class once");
        }
        if let Some(number) = class.coco.filter(|number| !(1..=90).contains(number)) {
            let message = format!("COCO has no class {number}");
            return wrong(i, "coco", message, "1 to 90; a person is 1, a car is 3");
        }
        let state = class.state.as_ref().filter(|state| !LIGHT_STATES.contains(&state.as_str()));
        if let Some(state) = state {
            let message = format!("`{state}` is no state of a traffic light");
            return wrong(i, "state", message, "red, yellow, green or off");
        }
    }
    Ok(())
}

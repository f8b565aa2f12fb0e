//! What classes of a user in Python need of an experiment.

use petzval_base::FileError;
use petzval_learn::guest::GuestClass;

use super::checked::Checked;
use crate::experiment::python::TIMEOUTS_S;
use crate::experiment::{BlockName, NetworkKind, Stage};

/// Refuses a class that nothing uses, a use without a class, and what a class cannot do.
pub(super) fn classes_and_uses(c: &Checked) -> Result<(), FileError> {
    let (network, task) =
        c.experiment.python.as_ref().map_or((None, None), |p| (p.network.as_ref(), p.task.as_ref()));
    let is_used = c.experiment.network.kind == NetworkKind::Python;
    if is_used && !c.experiment.has_picture_network(c.facts.network) {
        let error = c.at(&["network", "kind"], "there is no network for pictures that could be a class");
        return Err(error.hint("leave it out"));
    }
    of(c, "network", network, is_used, "network.kind", &["network", "kind"])?;
    of(c, "task", task, c.facts.has_python_class, "task", &["task"])?;
    if let Some(python) = c.experiment.python.as_ref().filter(|p| !TIMEOUTS_S.contains(&p.timeout_s)) {
        let message = format!("{} s lies outside 0.1 to 1000000", python.timeout_s);
        return Err(c.at(&["python", "timeout_s"], message).hint("600"));
    }
    let variants = c.experiment.variants();
    let pulls = |stage: &Stage| match stage {
        Stage::Task(moves) => moves.get(&BlockName::Network).is_some_and(|s| s.proximal > 0.0),
        Stage::Lens { .. } => false,
    };
    if is_used && variants.iter().any(|variant| variant.stages.iter().any(pulls)) {
        let message = "a class has an optimiser of its own, which no proximal term pulls back";
        return Err(c.at(&["network", "kind"], message).hint("write 0 for proximal, and pull in its `step`"));
    }
    Ok(())
}

/// Checks one use of a class.
fn of(
    c: &Checked,
    table: &str,
    class: Option<&GuestClass>,
    is_used: bool,
    key: &str,
    path: &[&str],
) -> Result<(), FileError> {
    let Some(class) = class else {
        if !is_used {
            return Ok(());
        }
        let error = c.at(path, format!("names no class: `python.{table}` is missing"));
        return Err(error.hint(format!("write [python.{table}] with class = \"my_module:MyClass\"")));
    };
    let place = ["python", table, "class"];
    if !is_used {
        let error = c.at(&place, "nothing uses this class");
        return Err(error.hint(format!("write \"python\" for {key}, or leave it out")));
    }
    let is_name = |name: &str| {
        let parts = || name.split('.');
        parts().all(|part| {
            part.chars().all(|c| c.is_alphanumeric() || c == '_')
                && !part.starts_with(|c: char| c.is_numeric())
        }) && parts().all(|part| !part.is_empty())
    };
    match class.class.split_once(':') {
        Some((module, name)) if is_name(module) && is_name(name) => Ok(()),
        _ => Err(c.at(&place, "is no module with a class").hint("write \"my_module:MyClass\"")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::{Experiment, TaskFacts};
    use crate::task::Task;
    use crate::task::pictures::Pictures;

    #[test]
    fn a_task_uses_a_class_by_its_facts_and_not_by_its_name() {
        let check = |text: &str, facts: &TaskFacts| {
            let experiment = Experiment::read(text).unwrap();
            classes_and_uses(&Checked { experiment: &experiment, text, facts })
        };
        let with_class = "[python.task]\nclass = \"my_module:MyLoss\"\n";
        let of_class = TaskFacts { name: "loss-of-ones-own", has_python_class: true, ..Pictures.facts() };
        assert_eq!(check(with_class, &of_class), Ok(()));
        assert!(check("", &of_class).unwrap_err().message.contains("`python.task` is missing"));
        assert_eq!(check("", &Pictures.facts()), Ok(()));
        assert!(
            check(with_class, &Pictures.facts()).unwrap_err().message.contains("nothing uses this class")
        );
    }
}

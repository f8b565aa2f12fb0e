//! All tasks, by name. A preset is a task with classes under a name of its own, from the crate `petzval-data`.

use std::sync::Arc;

use petzval_base::{FileError, nearest};
use petzval_learn::dataset::Classes;
use serde::Deserialize;

use super::Task;
use super::objects::Objects;
use super::pictures::Pictures;
use super::python::PythonTask;
use super::segments::Segments;
use crate::error::{DesignError, Result};
use crate::experiment::Experiment;

/// The tasks that experiments may name. Cheap to clone.
#[derive(Clone)]
pub struct Tasks {
    rows: Vec<Arc<dyn Task>>,
    presets: Vec<Preset>,
}

/// A task with its classes.
#[derive(Clone)]
struct Preset {
    name: String,
    task: String,
    classes: Classes,
}

/// What a preset states beside its classes.
#[derive(Deserialize)]
struct PresetFile {
    task: String,
}

impl Default for Tasks {
    fn default() -> Self {
        Self::built_in()
    }
}

impl Tasks {
    /// Those of this program: one row a task.
    pub fn built_in() -> Self {
        let none = Self { rows: Vec::new(), presets: Vec::new() };
        let rows = none.with(Pictures).with(Objects).with(Segments).with(PythonTask);
        petzval_data::tasks::PRESETS.into_iter().fold(rows, |tasks, (name, text)| {
            tasks.with_preset(name, text).expect("the presets of this program are read by its tests")
        })
    }

    /// The same with another task, which takes the place of one of the same name.
    pub fn with(mut self, task: impl Task + 'static) -> Self {
        self.rows.retain(|row| row.facts().name != task.facts().name);
        self.rows.push(Arc::new(task));
        self
    }

    /// The same with a preset: a text with `task = "NAME"` and tables `[[class]]`.
    pub fn with_preset(mut self, name: &str, text: &str) -> Result<Self, FileError> {
        let PresetFile { task } = FileError::read_toml(text)?;
        self.presets.retain(|preset| preset.name != name);
        self.presets.push(Preset { name: name.to_owned(), task, classes: Classes::parse(text)? });
        Ok(self)
    }

    /// The names that an experiment may give as its task.
    pub fn names(&self) -> Vec<&str> {
        let rows = self.rows.iter().map(|row| row.facts().name);
        rows.chain(self.presets.iter().map(|preset| preset.name.as_str())).collect()
    }

    /// The task of an experiment.
    pub fn of(&self, experiment: &Experiment) -> Result<Arc<dyn Task>> {
        self.named(&experiment.task).ok_or_else(|| DesignError::Unknown {
            kind: "task",
            name: experiment.task.clone(),
            near: nearest(&experiment.task, &self.names()).map(str::to_owned),
            known: self.names().join(", "),
        })
    }

    fn named(&self, name: &str) -> Option<Arc<dyn Task>> {
        let preset = self.presets.iter().find(|preset| preset.name == name);
        let name = preset.map_or(name, |preset| &preset.task);
        self.rows.iter().find(|row| row.facts().name == name).cloned()
    }

    /// Gives an experiment the classes of its preset if it states none.
    pub fn complete(&self, experiment: &mut Experiment) {
        let preset = self.presets.iter().find(|preset| preset.name == experiment.task);
        if let Some(preset) = preset.filter(|_| experiment.class.is_empty()) {
            experiment.class = preset.classes.to_vec();
        }
    }

    /// Reads and checks an experiment, but for what runs of earlier versions may have: see [`Tasks::check_new`]. Errors name line, key, value and a hint.
    pub fn parse(&self, text: &str) -> Result<Experiment, FileError> {
        let mut experiment = Experiment::read(text)?;
        let Some(task) = self.named(&experiment.task) else {
            let name = &experiment.task;
            let error = FileError::at_key(text, &["task"], format!("`{name}` is no task"));
            let known = self.names();
            let near = nearest(name, &known).map(|near| format!("did you mean \"{near}\"? "));
            return Err(error.hint(format!("{}tasks are {}", near.unwrap_or_default(), known.join(", "))));
        };
        self.complete(&mut experiment);
        let facts = task.facts();
        let experiment = experiment.with_default_scores(text, &facts);
        experiment.check(text, &facts)?;
        task.check(&experiment, text)?;
        Ok(experiment)
    }

    /// Checks of an experiment that is no run yet what its task alone demands of it, and that its task knows its scores. One who scores by others
    /// leaves this out.
    pub fn check_new(&self, experiment: &Experiment, text: &str) -> Result<(), FileError> {
        let Some(task) = self.named(&experiment.task) else { return Ok(()) };
        task.check_new(experiment, text)?;
        experiment.check_scores(text, &task.scores(experiment), &task.facts())
    }

    /// [`Tasks::parse`] for the `config.toml` of a run, which must hold every key that `complete`, its record, holds.
    pub fn parse_complete(&self, text: &str, complete: &serde_json::Value) -> Result<Experiment, FileError> {
        let experiment = self.parse(text)?;
        Experiment::check_complete(text, complete)?;
        Ok(experiment)
    }
}

impl Experiment {
    /// [`Tasks::parse`] with the tasks of this program.
    pub fn parse(text: &str) -> Result<Self, FileError> {
        Tasks::built_in().parse(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::NetworkRole;

    #[test]
    fn presets_are_tasks_with_classes_and_ones_own_classes_win() {
        let tasks = Tasks::built_in();
        let names = [
            "image-quality",
            "objects",
            "segments",
            "python",
            "pedestrian-vehicle",
            "traffic-light",
            "street-segmentation",
        ];
        assert_eq!(tasks.names(), names);
        let preset = tasks.parse("task = \"pedestrian-vehicle\"\n").unwrap();
        assert_eq!(preset.classes().names(), ["pedestrian", "vehicle"]);
        assert_eq!(preset.scoring.scores, ["ap50", "ap", "ap75"]);
        assert_eq!(tasks.of(&preset).unwrap().facts().network, NetworkRole::Reads);
        let own = "task = \"objects\"\ndata = \"faces\"\n[[class]]\nname = \"face\"\n";
        assert_eq!(tasks.parse(own).unwrap().classes().names(), ["face"]);
        // A few classes of one's own have a score each, unless the file names others.
        assert_eq!(tasks.parse(own).unwrap().scoring.scores, ["ap50", "ap", "ap75", "ap50_face"]);
        let named = tasks.parse(&format!("{own}[scoring]\nscores = [\"ap\"]\n")).unwrap();
        assert_eq!(named.scoring.scores, ["ap"]);
        let many: String = (0..9).map(|i| format!("[[class]]\nname = \"face-{i}\"\n")).collect();
        let many = tasks.parse(&format!("task = \"objects\"\ndata = \"faces\"\n{many}")).unwrap();
        assert_eq!(many.scoring.scores, ["ap50", "ap", "ap75"]);
        let own = own.replace("objects", "traffic-light");
        assert_eq!(tasks.parse(&own).unwrap().classes().names(), ["face"]);
        // Written and read back it is the same.
        assert_eq!(tasks.parse(&preset.to_toml().unwrap()).unwrap(), preset);
    }

    #[test]
    fn tasks_and_classes_that_cannot_be_are_refused_with_their_place() {
        let refused = |text: &str| Tasks::built_in().parse(text).unwrap_err().to_string();
        let unknown = refused("seed = 1\ntask = \"object\"\n");
        assert!(unknown.contains("line 2") && unknown.contains("did you mean \"objects\"?"), "{unknown}");
        assert!(refused("task = \"objects\"\n").contains("needs classes"));
        assert!(refused("[[class]]\nname = \"face\"\n").contains("`image-quality` has no classes"));
        let class = |more: &str| refused(&format!("task = \"objects\"\n[[class]]\n{more}"));
        assert!(class("name = \"a\"\n[[class]]\nname = \"a\"\n").contains("`a` is named twice"));
        let group = class("name = \"car\"\n[[class]]\nname = \"edge\"\n");
        assert!(group.contains("line 5") && group.contains("`ap50_edge` is the score of a group"), "{group}");
        assert!(class("name = \"a b\"\n").contains("no name of a class"));
        assert!(class("name = \"red\"\nstate = \"blue\"\n").contains("red, yellow, green or off"));
        assert!(class("name = \"a\"\nfrm = [\"b\"]\n").contains("frm"));
        // The example of a score is one of the task.
        let unscored = class("name = \"a\"\n[scoring]\nscores = []\n");
        assert!(unscored.contains("for example [\"ap50\"]"), "{unscored}");
    }

    /// A run of an earlier version may have such classes.
    #[test]
    fn a_category_of_two_classes_is_refused_of_new_experiments() {
        let tasks = Tasks::built_in();
        let classes =
            "[[class]]\nname = \"a\"\ncategories = [3]\n[[class]]\nname = \"b\"\ncategories = [3]\n";
        let text = format!("task = \"objects\"\ndata = \"faces\"\n{classes}");
        let twice = tasks.check_new(&tasks.parse(&text).unwrap(), &text).unwrap_err().to_string();
        assert!(twice.contains("line 8") && twice.contains("category 3 is of the class `a`, too"), "{twice}");
    }

    /// Of a new experiment: a run of an earlier version may have the key.
    #[test]
    fn pictures_are_counted_where_photographs_are_scored() {
        let tasks = Tasks::built_in();
        let checked = |text: &str| tasks.check_new(&tasks.parse(text).unwrap(), text);
        let counted = "seed = 1\n[scoring]\npictures = 5\n";
        checked(counted).unwrap();
        let scenes = checked(&format!("task = \"traffic-light\"\n{counted}")).unwrap_err().to_string();
        assert!(scenes.contains("line 4") && scenes.contains("`pictures = 5`"), "{scenes}");
        assert!(scenes.contains("hint: leave it out") && scenes.contains("`street.held_out`"), "{scenes}");
    }
}

//! Scripts that hand the units of a sweep to a scheduler. The truth is the store: a task that is lost, or runs twice, does no harm.

use std::num::NonZero;
use std::path::{Path, PathBuf};

use super::file::Level;

/// Longest time of a task where none is named, as Slurm writes it.
pub const USUAL_TIME: &str = "04:00:00";

/// Processes of a sweep on one machine where none are named.
pub const USUAL_JOBS: NonZero<usize> = NonZero::<usize>::MIN;

/// A scheduler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engine {
    /// Slurm: an array of jobs.
    Slurm,
    /// HyperQueue: an array of tasks.
    Hq,
    /// Ray: tasks of the Python package.
    Ray,
}

/// What a script runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Submission {
    /// Name of the job.
    pub name: String,
    /// The program.
    pub program: PathBuf,
    /// The file of the units.
    pub units: PathBuf,
    /// The store.
    pub store: PathBuf,
    /// Number of units.
    pub count: usize,
    /// Tasks among which the units are shared out; each takes every so many-th unit.
    pub tasks: usize,
    /// Threads of a task.
    pub threads: usize,
    /// Instruction set of every unit.
    pub simd: Level,
    /// Longest time of a task, as Slurm writes it: `04:00:00`.
    pub time: String,
    /// Further options of the scheduler, one a line: `--partition=long`.
    pub options: Vec<String>,
}

impl Engine {
    /// Name of the file of its script.
    pub fn file(self) -> &'static str {
        match self {
            Self::Slurm => "slurm.sh",
            Self::Hq => "hq.sh",
            Self::Ray => "ray_sweep.py",
        }
    }

    /// The program that takes the script, with the words before it.
    pub fn command(self) -> &'static [&'static str] {
        match self {
            Self::Slurm => &["sbatch"],
            Self::Hq => &["sh"],
            Self::Ray => &["python3"],
        }
    }

    /// The program that must be there before the script is handed over.
    pub fn needs(self) -> &'static str {
        match self {
            Self::Slurm => "sbatch",
            Self::Hq => "hq",
            Self::Ray => "python3",
        }
    }

    /// The script.
    pub fn script(self, of: &Submission) -> String {
        match self {
            Self::Slurm => slurm(of),
            Self::Hq => hq(of),
            Self::Ray => ray(of),
        }
    }
}

/// A path as a word of a shell.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.to_string_lossy().replace('\'', "'\\''"))
}

/// A folder within a quoted word of a directive of Slurm, where a percent sign begins a pattern and a backslash takes the meaning from a quote.
fn in_directive(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "\\\\").replace('"', "\\\"").replace('%', "%%")
}

/// The array of Slurm. The shell stays: it passes on the signals of a preemption or of the end of the time. It also puts a task back into the queue
/// that has ended with a checkpoint (exit code 75) or could not reach its store (74). Slurm itself does not.
fn slurm(of: &Submission) -> String {
    let Submission { name, tasks, threads, simd, time, options, .. } = of;
    let options: String = options.iter().map(|option| format!("#SBATCH {option}\n")).collect();
    let (program, units, store) = (quoted(&of.program), quoted(&of.units), quoted(&of.store));
    let last = tasks - 1;
    let logs = in_directive(&of.store.join("logs"));
    format!(
        r#"#!/bin/bash
#SBATCH --job-name={name}
#SBATCH --array=0-{last}
#SBATCH --cpus-per-task={threads}
#SBATCH --time={time}
#SBATCH --signal=B:USR2@120
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output="{logs}/%a.log"
{options}
# Every task takes its share of the units: those that are finished are passed over, one with a checkpoint goes on.
export PETZVAL_SIMD={simd}
{program} unit run {units} --store {store} --shard "$SLURM_ARRAY_TASK_ID/{tasks}" &
p=$!
# No exec: signals reach the shell alone, which passes them on and waits until the checkpoint is written.
trap 'kill -TERM $p 2>/dev/null' USR1 USR2 TERM
while kill -0 $p 2>/dev/null; do wait $p; done
wait $p; rc=$?
# 75: stopped after a checkpoint; 74: the store is full or cannot be reached, which may last. Back into the queue, unless Slurm is ending the task
# itself: it was cancelled, or Slurm requeues it.
me="${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID"
if [ $rc = 74 ]; then
  if [ "${{SLURM_RESTART_COUNT:-0}}" -ge 20 ]; then echo "the store is still full or cannot be reached: not requeued" >&2; exit 74; fi
  sleep 60
fi
if {{ [ $rc = 75 ] || [ $rc = 74 ]; }} && [ "$(squeue -h -j $me -o %T)" != COMPLETING ]; then trap - TERM; scontrol requeue $me; sleep 60; fi
exit $rc
"#,
        simd = simd.variable()
    )
}

/// The tasks of HyperQueue, which starts those of a lost worker again. A task that it cancels ends with 75 after a checkpoint, which it takes for a
/// failure: the same script goes on.
fn hq(of: &Submission) -> String {
    let Submission { name, tasks, threads, simd, options, .. } = of;
    let (program, units, store) = (quoted(&of.program), quoted(&of.units), quoted(&of.store));
    let last = tasks - 1;
    let logs = quoted(&of.store.join("logs"));
    let options: String = options.iter().map(|option| format!(" {option}")).collect();
    format!(
        r#"#!/bin/sh
# Every task takes its share of the units: those that are finished are passed over, one with a checkpoint goes on.
mkdir -p {logs}
exec hq submit --name={name} --array=0-{last} --cpus={threads} --crash-limit=100{options} \
    --stdout={logs}/'%{{TASK_ID}}.out' --stderr={logs}/'%{{TASK_ID}}.log' \
    --env=PETZVAL_SIMD={simd} \
    -- sh -c 'exec "$1" unit run "$2" --store "$3" --shard "$HQ_TASK_ID/{tasks}"' petzval {program} {units} {store}
"#,
        simd = simd.variable()
    )
}

/// The tasks of Ray, by the Python package.
fn ray(of: &Submission) -> String {
    let text = |path: &Path| serde_json::Value::from(path.to_string_lossy()).to_string();
    let Submission { tasks, threads, .. } = of;
    format!(
        r#"# Every task takes its share of the units: those that are finished are passed over, one with a checkpoint goes on.
# RAY_ADDRESS names the cluster; without it Ray starts on this machine.
import sys

try:
    import petzval.ray
except ModuleNotFoundError as error:
    sys.exit(f"{{error}}: install ray and petzval for {{sys.executable}}, or run the units with --submit here")

results = petzval.ray.run_units({units}, store={store}, tasks={tasks}, num_cpus={threads})
failed = [result for result in results if result.error is not None]
for result in failed:
    print(f"{{result.name}}: {{result.error}}", file=sys.stderr)
print(len(results) - len(failed), "units have a result")
sys.exit(1 if failed else 0)
"#,
        units = text(&of.units),
        store = text(&of.store)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn submission() -> Submission {
        Submission {
            name: "night".to_owned(),
            program: "/opt/it's/petzval".into(),
            units: "/s/units.jsonl".into(),
            store: "/s".into(),
            count: 30,
            tasks: 10,
            threads: 2,
            simd: Level::Avx2,
            time: "04:00:00".to_owned(),
            options: vec!["--partition=long".to_owned()],
        }
    }

    #[test]
    fn scripts_run_their_share_of_the_units_and_shells_take_them() {
        for engine in [Engine::Slurm, Engine::Hq] {
            let script = engine.script(&submission());
            for part in [
                "0-9",
                "'/opt/it'\\''s/petzval'",
                "'/s/units.jsonl'",
                "PETZVAL_SIMD=avx2",
                "--partition=long",
                "/10\"",
            ] {
                assert!(script.contains(part), "{part}: {script}");
            }
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(engine.file());
            std::fs::write(&path, &script).unwrap();
            let checked = std::process::Command::new("bash").arg("-n").arg(&path).output().unwrap();
            assert!(checked.status.success(), "{}", String::from_utf8_lossy(&checked.stderr));
        }
        let slurm = Engine::Slurm.script(&submission());
        assert!(
            slurm.contains("#SBATCH --time=04:00:00\n")
                && slurm.contains("trap 'kill -TERM $p 2>/dev/null' USR1 USR2 TERM")
        );
        assert!(!slurm.contains("exec "));
        assert!(slurm.contains("if { [ $rc = 75 ] || [ $rc = 74 ]; } && ["), "{slurm}");
        assert!(slurm.contains("#SBATCH --output=\"/s/logs/%a.log\"\n"));
        let odd = Engine::Slurm.script(&Submission { store: "/st%j b\"4".into(), ..submission() });
        assert!(odd.contains("#SBATCH --output=\"/st%%j b\\\"4/logs/%a.log\"\n"), "{odd}");
    }

    #[test]
    fn the_script_of_ray_names_the_units_as_texts_of_python() {
        let of = Submission { units: "/a \"b\"/units.jsonl".into(), ..submission() };
        let script = Engine::Ray.script(&of);
        assert!(
            script.contains(r#"run_units("/a \"b\"/units.jsonl","#) && script.contains("num_cpus=2"),
            "{script}"
        );
        // Where a package is missing, a sentence and not a traceback.
        assert!(
            script.contains(r#"sys.exit(f"{error}: install ray and petzval for {sys.executable}"#),
            "{script}"
        );
    }
}

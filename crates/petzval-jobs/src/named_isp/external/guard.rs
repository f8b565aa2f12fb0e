//! Ends a command whose master has died without a word, as by SIGKILL.
//!
//! The guard is a shell that reads from a pipe which only this process holds open. The end of the pipe is the death of this process,
//! whatever its cause: the guard then kills the command's group and removes its folder.

use std::io::{self, Write};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// Reads the number of the group, then waits for the word that all is over. Signals that end the master leave the guard alive: it has
/// still to work.
const SCRIPT: &str = r#"trap '' HUP INT QUIT TERM USR1 USR2
group=
read -r group
if read -r over; then exit 0; fi
if [ -n "$group" ]; then kill -s KILL -- "-$group"; fi
rm -rf -- "$1" || { sleep 1; rm -rf -- "$1"; }"#;

/// Guards one folder and the command that works in it. It is dropped after the folder is removed.
pub(super) struct Guard(Child);

impl Guard {
    /// Starts to guard a folder, in a group of its own that no signal from a terminal reaches.
    pub fn of(folder: &Path) -> io::Result<Self> {
        let mut shell = Command::new("/bin/sh");
        shell.args(["-c", SCRIPT, "petzval-guard"]).arg(folder).current_dir("/").process_group(0);
        // It holds no other file open: otherwise a reader of the master's output would never see its end.
        shell.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
        Ok(Self(shell.spawn()?))
    }

    /// Says which group of processes works in the folder.
    pub fn watch(&mut self, group: u32) -> io::Result<()> {
        self.say(&group.to_string())
    }

    fn say(&mut self, line: &str) -> io::Result<()> {
        match &mut self.0.stdin {
            Some(pipe) => pipe.write_all(format!("{line}\n").as_bytes()),
            None => Ok(()),
        }
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        // Where there was no group yet, its line is empty. A guard that is gone needs no word.
        let _gone = self.say("\nover");
        drop(self.0.stdin.take());
        let _gone = self.0.wait();
    }
}

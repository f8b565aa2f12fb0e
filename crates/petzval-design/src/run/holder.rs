//! Who works on a run or on a unit of a sweep: a process of a machine.

use std::fs;
use std::sync::OnceLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A process that works on a run, or on a unit of a sweep.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Holder {
    /// Name of the machine.
    pub host: String,
    /// Number of the process.
    pub pid: u32,
    /// When the process began, in clock ticks since the machine started; 0 if the system does not say so.
    pub process_start: u64,
    /// What distinguishes machines and containers of one name: the start of the system and the space of process numbers; may be empty.
    pub system: String,
}

impl Holder {
    /// This process.
    pub fn own() -> &'static Self {
        static OWN: OnceLock<Holder> = OnceLock::new();
        OWN.get_or_init(|| Self {
            host: host(),
            pid: std::process::id(),
            process_start: start_of(std::process::id()).unwrap_or(0),
            system: system(),
        })
    }

    /// A few digits for names of files, which differ between machines.
    pub fn mark(&self) -> String {
        use sha2::{Digest, Sha256};
        let hash = Sha256::new_with_prefix(format!("{} {}", self.host, self.system)).finalize();
        petzval_base::hex(&hash[..4])
    }

    /// Whether the process belongs to this machine, whose system knows its number.
    pub fn is_here(&self) -> bool {
        let own = Self::own();
        self.host == own.host && self.system == own.system && !self.system.is_empty()
    }

    /// Whether the process is known to be gone. Only a process of this machine can be looked up.
    pub fn is_gone(&self) -> bool {
        self.is_here() && self.process_start != 0 && start_of(self.pid) != Some(self.process_start)
    }
}

impl std::fmt::Display for Holder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "process {} on {}", self.pid, self.host)
    }
}

fn host() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name = name.or_else(|| std::env::var("HOSTNAME").ok()).unwrap_or_default();
    if name.trim().is_empty() { "unknown".to_owned() } else { name.trim().to_owned() }
}

fn system() -> String {
    let boot = fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    let space = fs::read_link("/proc/self/ns/pid").map(|link| link.display().to_string()).unwrap_or_default();
    match (boot.trim(), space.as_str()) {
        ("", _) | (_, "") => String::new(),
        (boot, space) => format!("{boot} {space}"),
    }
}

/// When a process of this machine began; none if there is none of this number. A process that has ended and waits for its parent counts as none.
fn start_of(pid: u32) -> Option<u64> {
    let text = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The name of the program may hold anything, also brackets: fields are counted behind the last one.
    let mut fields = text.rsplit_once(") ")?.1.split_whitespace();
    let state = fields.next()?;
    if state == "Z" || state == "X" {
        return None;
    }
    // Field 22 of proc(5); the state is field 3.
    fields.nth(18)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn a_process_that_has_ended_is_gone_and_one_elsewhere_is_not_known() {
        let own = Holder::own();
        assert!(!own.is_gone() && own.process_start > 0);
        let mut child = std::process::Command::new("sleep").arg("60").spawn().unwrap();
        let holder = Holder { pid: child.id(), process_start: start_of(child.id()).unwrap(), ..own.clone() };
        assert!(!holder.is_gone());
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(holder.is_gone());
        // Another process has taken the number.
        assert!(Holder { process_start: own.process_start + 1, ..own.clone() }.is_gone());
        assert!(!Holder { host: "elsewhere".to_owned(), ..holder }.is_gone());
    }
}

//! A cluster of Slurm with one node, this machine, that belongs to whoever runs it: its own keys, ports, files and daemons, on 127.0.0.1 alone.

use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use super::wait::until;

/// The programs, in the order in which they are started. Debian has them in `munge slurmctld slurmd slurm-client`.
const DAEMONS: [&str; 3] = ["munged", "slurmctld", "slurmd"];

/// Seconds between the warning of a preemption and its end.
const GRACE: u32 = 10;

/// Seconds for which Slurm holds a job that it has requeued. Slurm's own default is 120.
const HOLD: u32 = 5;

/// A cluster that runs. It ends with this value.
pub struct Cluster {
    folder: PathBuf,
    running: Vec<(&'static str, Child)>,
}

/// The programs that are missing here.
pub fn missing() -> Vec<&'static str> {
    let all = DAEMONS.into_iter().chain(["sbatch", "scontrol", "squeue", "scancel", "sinfo"]);
    all.filter(|name| program(name).is_none()).collect()
}

/// A program on the path, or where systems keep daemons.
fn program(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::env::split_paths(&path).chain(["/usr/sbin", "/usr/local/sbin"].map(PathBuf::from));
    folders.map(|folder| folder.join(name)).find(|path| path.is_file())
}

impl Cluster {
    /// Starts a node with so many CPUs, whose partition `high` preempts jobs of `low`.
    ///
    /// `warned`: whether a preempted job first gets the signal that it has chosen, at once; else SIGTERM at the end of the grace time.
    pub fn start(folder: &Path, cpus: usize, warned: bool) -> Result<Self, String> {
        let cluster =
            Self::prepared(folder, cpus, warned).map_err(|e| format!("{}: {e}", folder.display()))?;
        cluster.started()
    }

    /// Writes keys and configuration.
    fn prepared(folder: &Path, cpus: usize, warned: bool) -> std::io::Result<Self> {
        fs::create_dir_all(folder.join("state"))?;
        fs::create_dir_all(folder.join("spool"))?;
        // The daemons refuse folders that others may write to, and a key that others may read.
        mode("755", folder)?;
        let mut key = vec![0; 128];
        std::io::Read::read_exact(&mut fs::File::open("/dev/urandom")?, &mut key)?;
        fs::write(folder.join("munge.key"), key)?;
        mode("600", &folder.join("munge.key"))?;
        fs::write(folder.join("slurm.conf"), configuration(folder, cpus, warned)?)?;
        Ok(Self { folder: folder.to_path_buf(), running: Vec::new() })
    }

    /// Starts the daemons, and waits until the node is ready.
    fn started(mut self) -> Result<Self, String> {
        let file = |name: &str| self.folder.join(name).display().to_string();
        let key = format!("--key-file={}", file("munge.key"));
        let socket = format!("--socket={}", file("munge.socket"));
        let pid = format!("--pid-file={}", file("munged.pid"));
        let seed = format!("--seed-file={}", file("munge.seed"));
        let words: [&[&str]; 3] =
            [&["--foreground", &key, &socket, &pid, &seed], &["-D"], &["-D", "-N", "localhost"]];
        for (name, words) in DAEMONS.into_iter().zip(words) {
            let log = fs::File::create(self.folder.join(format!("{name}.out"))).map_err(|e| e.to_string())?;
            let again = log.try_clone().map_err(|e| e.to_string())?;
            let mut command = self.command(name)?;
            command.args(words).stdin(Stdio::null()).stdout(log).stderr(again);
            let child = command.spawn().map_err(|e| format!("{name}: {e}"))?;
            self.running.push((name, child));
            let socket = self.folder.join("munge.socket");
            until("the socket of munge", Duration::from_secs(20), || Ok(socket.exists()))?;
        }
        let ready = until("a node that is ready", Duration::from_secs(60), || {
            Ok(self.says("sinfo", &["--noheader", "--format=%T"]).is_ok_and(|state| state.contains("idle")))
        });
        ready.map_err(|problem| format!("{problem}\n{}", self.last_lines()))?;
        Ok(self)
    }

    /// A program of Slurm that speaks to this cluster.
    pub fn command(&self, name: &str) -> Result<Command, String> {
        let mut command = Command::new(program(name).ok_or(format!("there is no program {name}"))?);
        command.env("SLURM_CONF", self.folder.join("slurm.conf"));
        Ok(command)
    }

    /// What a program of Slurm prints.
    pub fn says(&self, name: &str, words: &[&str]) -> Result<String, String> {
        let output = self.command(name)?.args(words).output().map_err(|e| format!("{name}: {e}"))?;
        if output.status.success() {
            return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
        }
        Err(format!("{name} {}: {}", words.join(" "), String::from_utf8_lossy(&output.stderr)))
    }

    /// Hands a script over; returns the number of the job.
    pub fn submit(&self, words: &[&str]) -> Result<String, String> {
        let printed = self.says("sbatch", &[&["--parsable"], words].concat())?;
        Ok(printed.trim().to_owned())
    }

    /// Waits until no job is left.
    pub fn wait_for_all(&self, patience: Duration) -> Result<(), String> {
        until("the end of all jobs", patience, || Ok(self.says("squeue", &["--noheader"])?.trim().is_empty()))
            .map_err(|problem| format!("{problem}\n{}", self.last_lines()))
    }

    /// The ends of the logs of the daemons.
    fn last_lines(&self) -> String {
        let mut all = String::new();
        for name in DAEMONS {
            let text = fs::read_to_string(self.folder.join(format!("{name}.out"))).unwrap_or_default();
            let lines: Vec<&str> = text.lines().collect();
            all += &format!("-- {name}\n{}\n", lines[lines.len().saturating_sub(12)..].join("\n"));
        }
        all
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        // A daemon that gets SIGTERM ends its jobs first.
        for (_, child) in self.running.iter_mut().rev() {
            let _ = Command::new("kill").args(["-s", "TERM", &child.id().to_string()]).status();
            let gone = until("", Duration::from_secs(10), || {
                Ok(child.try_wait().is_ok_and(|ended| ended.is_some()))
            });
            if gone.is_err() {
                let _ = child.kill();
                let _ = child.wait();
            }
        }
    }
}

/// Sets the permissions of a file or folder.
fn mode(octal: &str, path: &Path) -> std::io::Result<()> {
    Command::new("chmod").arg(octal).arg(path).status().map(|_| ())
}

/// Ports that are free at this moment.
fn free_ports() -> std::io::Result<[u16; 2]> {
    let listeners = [TcpListener::bind("127.0.0.1:0")?, TcpListener::bind("127.0.0.1:0")?];
    Ok([listeners[0].local_addr()?.port(), listeners[1].local_addr()?.port()])
}

fn configuration(folder: &Path, cpus: usize, warned: bool) -> std::io::Result<String> {
    let [controller, node] = free_ports()?;
    let output = Command::new("id").arg("-un").output()?;
    let user = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    let folder = folder.display();
    let warned = if warned { "SlurmctldParameters=preempt_send_user_signal\n" } else { "" };
    Ok(format!(
        "ClusterName=petzval
SlurmctldHost=localhost(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
SlurmctldPort={controller}
SlurmdPort={node}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket,cred_expire={HOLD}
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
{warned}SchedulerParameters=sched_interval=2,batch_sched_delay=1,sched_min_interval=0
MinJobAge=300
ReturnToService=2
SlurmdParameters=config_overrides
KillWait=20
NodeName=localhost NodeAddr=127.0.0.1 CPUs={cpus} State=UNKNOWN
PartitionName=low Nodes=localhost Default=YES PriorityTier=1 PreemptMode=REQUEUE GraceTime={GRACE} State=UP MaxTime=INFINITE
PartitionName=high Nodes=localhost PriorityTier=10 PreemptMode=OFF State=UP MaxTime=INFINITE
"
    ))
}

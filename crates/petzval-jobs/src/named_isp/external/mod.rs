//! An external ISP: a command that develops one frame for each call, behind the interface of every ISP.
//!
//! A call writes the frame into a new temporary folder (`frame.toml`, `raw.bin`), runs the command with that folder as its last
//! argument, and reads the picture that the command leaves there (`rgb.npy`, `rgb.png` or `rgb.ppm`). A call that takes too long, fails,
//! or leaves no picture of the frame is repeated as often as the description says, then fails with the end of what the command wrote to
//! standard error. A job that is cancelled stops the command with all its processes, and so does the death
//! of this process, by whatever cause (where there is a POSIX shell). Pictures are kept by the hash of all that they depend on, if the description names a folder for them.

mod cache;
#[cfg_attr(not(unix), path = "no_guard.rs")]
mod guard;
pub(crate) mod process;
pub(crate) mod workplace;

use std::path::{Path, PathBuf};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

use petzval_base::Cancel;
use petzval_camera::isp::{Isp, IspError, IspParameter, RawInput, RgbPicture, check_values};
use petzval_files::isp_file::{
    ExternalIspFile, FRAME_FILE, PICTURE_FILES, RAW_FILE, decode_picture, frame_toml, raw_bytes,
};

use self::cache::Cache;
use self::process::{End, run_within};
use self::workplace::Workplace;
use crate::temporary_folder::TemporaryFolder;

/// Longest picture file that is read: three values of eight bytes for each pixel, text of as many characters, and a header.
const MOST_BYTES_PER_PIXEL: u64 = 32;
const MOST_HEADER_BYTES: u64 = 1 << 16;

/// An ISP outside this program.
pub struct ExternalIsp {
    about: ExternalIspFile,
    /// Folder of the description, in which the command runs.
    home: PathBuf,
    cache: Option<Cache>,
    places: Places,
    /// Set when the job is cancelled.
    cancel: Cancel,
}

/// Why one attempt gave no picture.
enum NoPicture {
    /// The attempt failed; another may succeed.
    Failed(String),
    /// The job was cancelled.
    Cancelled,
}

impl From<String> for NoPicture {
    fn from(reason: String) -> Self {
        Self::Failed(reason)
    }
}

impl ExternalIsp {
    /// The ISP of a description, which lies in the folder `home`, until `cancel` is set. Makes the folder of its cache.
    pub fn new(about: ExternalIspFile, home: &Path, cancel: Cancel) -> std::io::Result<Self> {
        // A command runs in its own folder, where a relative path would have another meaning.
        let home = std::path::absolute(home)?;
        TemporaryFolder::sweep_left();
        let cache = about.cache.as_ref().map(|folder| Cache::open(&home.join(folder))).transpose()?;
        let places = Places::new(about.parallel);
        Ok(Self { about, home, cache, places, cancel })
    }

    /// The program of the command: a path below the folder of the description, or a name that the system looks up.
    fn program(&self) -> PathBuf {
        let program = Path::new(&self.about.command[0]);
        match program.components().count() {
            1 if !self.about.command[0].starts_with('.') => program.to_owned(),
            _ => self.home.join(program),
        }
    }

    /// Runs the command once. Returns the name and the bytes of the picture file beside the picture.
    fn attempt(
        &self,
        frame: &RawInput,
        text: &str,
        raw: &[u8],
    ) -> Result<(&'static str, Vec<u8>, RgbPicture), NoPicture> {
        let system = |what: &str, error: std::io::Error| format!("{what}: {error}");
        let workplace = Workplace::new().map_err(|e| system("folder", e))?;
        let folder_path = workplace.folder();
        std::fs::write(folder_path.join(FRAME_FILE), text).map_err(|e| system(FRAME_FILE, e))?;
        std::fs::write(folder_path.join(RAW_FILE), raw).map_err(|e| system(RAW_FILE, e))?;

        let _place = self.places.take();
        if self.cancel.is_set() {
            return Err(NoPicture::Cancelled);
        }
        let mut command = std::process::Command::new(self.program());
        command.args(&self.about.command[1..]).arg(folder_path).current_dir(&self.home);
        let limit = Duration::from_secs_f64(self.about.timeout_s);
        let ended = run_within(command, &workplace, limit, &self.cancel)
            .map_err(|error| format!("the command {} cannot be run: {error}", self.program().display()))?;
        match ended.end {
            End::TimedOut => {
                let seconds = self.about.timeout_s;
                let message =
                    format!("no picture after {seconds} s; the command was stopped{}", ended.said());
                return Err(message.into());
            }
            End::Cancelled => return Err(NoPicture::Cancelled),
            End::Exited(status) if !status.success() => {
                return Err(format!("the command ended with {status}{}", ended.said()).into());
            }
            End::Exited(_) => {}
        }

        let Some(name) = PICTURE_FILES.into_iter().find(|name| folder_path.join(name).is_file()) else {
            let names = PICTURE_FILES.join(", ");
            return Err(format!("the command left no picture ({names}){}", ended.said()).into());
        };
        let path = folder_path.join(name);
        let length = path.metadata().map_err(|e| system(name, e))?.len();
        let most = MOST_BYTES_PER_PIXEL * (frame.height * frame.width) as u64 + MOST_HEADER_BYTES;
        if length > most {
            return Err(format!("{name} has {length} bytes, more than any picture of the frame").into());
        }
        let bytes = petzval_base::read_whole(&path).map_err(|e| system(name, e))?;
        let picture = decode_picture(name, &bytes, (frame.height, frame.width))
            .map_err(|reason| format!("{name}: {reason}{}", ended.said()))?;
        Ok((name, bytes, picture))
    }
}

impl Isp for ExternalIsp {
    fn name(&self) -> &str {
        &self.about.name
    }

    fn parameters(&self) -> Vec<IspParameter> {
        self.about.parameters.clone()
    }

    fn develop(&self, frame: &RawInput, values: &[f64]) -> Result<RgbPicture, IspError> {
        frame.validate()?;
        check_values(&self.about.parameters, values)?;
        let text = frame_toml(frame, &self.about.parameters, values);
        let raw = raw_bytes(frame);
        let key = self.cache.as_ref().map(|cache| (cache, Cache::key(&self.about, &text, &raw)));
        if let Some((cache, key)) = &key
            && let Some(picture) = cache.find(key, (frame.height, frame.width))
        {
            return Ok(picture);
        }
        let attempts = self.about.retries + 1;
        let mut reason = String::new();
        for _ in 0..attempts {
            match self.attempt(frame, &text, &raw) {
                Ok((name, bytes, picture)) => {
                    if let Some((cache, key)) = &key {
                        cache.keep(key, name, &bytes).map_err(IspError::External)?;
                    }
                    return Ok(picture);
                }
                Err(NoPicture::Failed(last)) => reason = last,
                Err(NoPicture::Cancelled) => return Err(IspError::Stopped(self.about.name.clone())),
            }
        }
        let times = if attempts == 1 { String::new() } else { format!(", {attempts} times") };
        Err(IspError::External(format!("{}{times}: {reason}", self.about.name)))
    }
}

/// Counts the commands that may run at the same time.
struct Places {
    free: Mutex<usize>,
    freed: Condvar,
}

/// One running command.
struct Place<'a>(&'a Places);

impl Places {
    fn new(count: usize) -> Self {
        Self { free: Mutex::new(count), freed: Condvar::new() }
    }

    /// Waits for a free place and holds it until the result is dropped.
    fn take(&self) -> Place<'_> {
        // A count is valid even if a thread has panicked while it held the lock.
        let free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let mut free = self.freed.wait_while(free, |free| *free == 0).unwrap_or_else(PoisonError::into_inner);
        *free -= 1;
        Place(self)
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        *self.0.free.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        self.0.freed.notify_one();
    }
}

#[cfg(all(test, unix))]
mod tests;

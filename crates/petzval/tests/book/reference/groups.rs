//! Verbs and jobs in groups: one page each.

/// A group of verbs.
pub struct Group {
    /// Name of its pages, without the ending.
    pub page: &'static str,
    /// Title of its pages.
    pub title: &'static str,
    /// First words of its verbs, in the order of the page; a group of jobs alone has none.
    pub verbs: &'static [&'static str],
    /// Jobs that no verb has the name of.
    pub more_jobs: &'static [&'static str],
}

/// All groups, in the order of the book.
pub static GROUPS: &[Group] = &[
    Group {
        page: "design",
        title: "Experiments and runs",
        verbs: &["design", "init", "experiment", "evaluate", "report", "compare", "apply", "weights"],
        more_jobs: &[],
    },
    Group { page: "lens", title: "Lenses", verbs: &["lens"], more_jobs: &[] },
    Group {
        page: "lens-edit",
        title: "Lenses while they are edited",
        verbs: &[],
        more_jobs: &["lens-view", "lens-edit"],
    },
    Group {
        page: "psf",
        title: "Glasses and point-spread functions",
        verbs: &["glass", "psf", "psf-calibrate", "psf-capture"],
        more_jobs: &[],
    },
    Group {
        page: "sensor",
        title: "Sensors, frames and pictures",
        verbs: &["sensor", "simulate", "raw"],
        more_jobs: &[],
    },
    Group {
        page: "isp",
        title: "Image signal processors and stand-ins",
        verbs: &["isp", "train"],
        more_jobs: &[],
    },
    Group { page: "detection", title: "Detection and data sets", verbs: &["detect", "data"], more_jobs: &[] },
    Group {
        page: "many",
        title: "Sweeps, units and calls",
        verbs: &["sweep", "runs", "unit", "call", "jobs", "schema"],
        more_jobs: &[],
    },
    Group {
        page: "machine",
        title: "Studio and machine",
        verbs: &["studio", "bench", "doctor"],
        // What the studio looks at.
        more_jobs: &["camera-view", "photo-list", "run-view", "task-view"],
    },
];

impl Group {
    /// Whether a job belongs here: its name is a verb, or begins with one and a hyphen, and no other verb fits better.
    fn fits(&self, job: &str) -> usize {
        let of_verb = |verb: &&&str| {
            job == **verb || job.strip_prefix(**verb).is_some_and(|rest| rest.starts_with('-'))
        };
        let by_verb = self.verbs.iter().filter(of_verb).map(|verb| verb.len()).max();
        if self.more_jobs.contains(&job) { job.len() } else { by_verb.unwrap_or(0) }
    }
}

/// The group of a job.
pub fn group_of(job: &str) -> &'static Group {
    let best = GROUPS.iter().max_by_key(|group| group.fits(job)).expect("groups");
    assert!(best.fits(job) > 0, "the job {job} is in no group of the reference");
    best
}

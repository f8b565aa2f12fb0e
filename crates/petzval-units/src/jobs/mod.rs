//! The verbs of runs, sweeps and units as rows of the table of jobs. They look at many jobs, and are no units of work themselves.

pub mod runs;
pub mod sweep_gather;
pub mod sweep_plan;
pub mod sweep_status;
pub mod unit_gather;
pub mod unit_list;
pub mod unit_status;

use petzval_jobs::{Row, Table, table_of_jobs};

table_of_jobs! {
    SweepPlan "sweep-plan" ["file"]
        "Checks every unit of a sweep, and estimates what it costs; writes nothing."
        sweep_plan::Request => sweep_plan::Response, sweep_plan::run;
    SweepStatus "sweep-status" ["store"]
        "Says how the units of a sweep stand."
        sweep_status::Request => crate::sweep::SweepStatus, sweep_status::run;
    SweepGather "sweep-gather" ["store"]
        "Gathers the results of a sweep so far, and writes tables and a page."
        sweep_gather::Request => sweep_gather::Response, sweep_gather::run;
    Runs "runs" []
        "Lists all runs below a folder, and the units of the stores there."
        runs::Request => crate::runs::Runs, runs::run;
    UnitStatus "unit-status" ["store"]
        "Says where the units of a store stand."
        unit_status::Request => Vec<unit_status::Entry>, unit_status::run;
    UnitList "unit-list" ["units"]
        "Checks units of work, and gives their keys; runs nothing."
        unit_list::Request => Vec<unit_list::Entry>, unit_list::run;
    UnitGather "unit-gather" ["units", "store"]
        "Joins the random lenses of tolerance analyses that were made in parts."
        unit_gather::Request => Vec<unit_gather::Analysis>, unit_gather::run;
}

/// The jobs of this crate.
pub fn rows() -> &'static [Row] {
    TABLE
}

/// Every job: those of petzval-jobs, then those of this crate.
pub fn table() -> Table {
    Table::built_in().with(rows())
}

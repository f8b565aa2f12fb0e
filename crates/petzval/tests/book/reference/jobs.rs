//! The pages of the jobs: each with its request and its response.

use petzval::jobs::Call;
use petzval::units::table as all_jobs;
use serde_json::Value;

use super::Page;
use super::groups::{GROUPS, group_of};
use super::markdown::{code, sentence, table};
use super::schema_rows::{Schema, as_table, as_table_of_response};

/// A call of each job with its smallest request, as the tests of the jobs keep it.
const CALLS: [&str; 2] = [
    include_str!("../../../../petzval-jobs/tests/calls.json"),
    include_str!("../../../../petzval-units/tests/calls.json"),
];

/// The table of all jobs, and a page for each group.
pub fn pages() -> Vec<Page> {
    let calls = CALLS.map(|text| serde_json::from_str::<Vec<Value>>(text).expect("calls")).concat();
    let jobs = all_jobs();
    let call = Call::schema();
    let mut all = format!("## A call\n\n{}\n## The jobs\n\n", as_table(&Schema(&call).rows(1)));
    let mut pages = Vec::new();
    for group in GROUPS {
        let own: Vec<_> = jobs.rows().iter().filter(|row| group_of(row.name).page == group.page).collect();
        if own.is_empty() {
            continue;
        }
        let rows = own.iter().map(|row| {
            vec![format!("[{}](jobs/{}.md#{})", code(row.name), group.page, row.name), sentence(row.about)]
        });
        all += &format!("**{}**\n\n{}\n", group.title, table(&["job", "does"], &rows.collect::<Vec<_>>()));
        let mut body = String::new();
        for row in own {
            let example = calls.iter().find(|call| call["job"] == row.name).expect("a stored call");
            body += &format!("## {}\n\n{}\n\n", row.name, sentence(row.about));
            body += &format!("```json\n{}\n```\n\n", serde_json::to_string(example).expect("JSON"));
            let (request, response) = (row.schema(), row.response_schema());
            let keys = Schema(&request).rows(2);
            if !keys.is_empty() {
                body += &format!("Request:\n\n{}\n", as_table(&keys));
            }
            let (kind, keys) = (Schema(&response).kind(), Schema(&response).rows(1));
            body += &format!("Response: {kind}.\n\n");
            if !keys.is_empty() {
                body += &format!("{}\n", as_table_of_response(&keys));
            }
        }
        pages.push(Page {
            path: format!("jobs/{}.md", group.page),
            frame: format!("# {}: jobs\n\nHow a job is called stands in [jobs](../jobs.md).\n", group.title),
            generated: body,
        });
    }
    pages.insert(0, Page { path: "jobs.md".to_owned(), frame: String::new(), generated: all });
    pages
}

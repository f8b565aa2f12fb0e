//! The pages of the command line, from the command tree that parses it.

use std::collections::BTreeMap;

use clap::{Arg, ArgAction, Command, CommandFactory};
use petzval::cli::Cli;

use super::Page;
use super::groups::GROUPS;
use super::markdown::{code, paragraphs, prose, sentence, table};
use super::schema_rows::{Row, Schema};

/// The page of all verbs, and one for each group.
pub fn pages() -> Vec<Page> {
    let mut tree = Cli::command();
    tree.build();
    let first_words: Vec<&str> =
        tree.get_subcommands().map(Command::get_name).filter(|name| *name != "help").collect();
    for word in &first_words {
        assert_eq!(GROUPS.iter().filter(|group| group.verbs.contains(word)).count(), 1, "the verb {word}");
    }
    let mut all = "## The verbs\n\n".to_owned();
    let mut pages = Vec::new();
    for group in GROUPS.iter().filter(|group| !group.verbs.is_empty()) {
        let mut verbs = Vec::new();
        for word in group.verbs {
            let command = tree.find_subcommand(word).unwrap_or_else(|| panic!("there is no verb {word}"));
            add_verbs(command, &format!("petzval {word}"), &mut verbs);
        }
        let place = |verb: &str| format!("command-line/{}.md#{}", group.page, anchor(verb));
        let rows = verbs
            .iter()
            .map(|(name, command)| vec![format!("[{}]({})", code(name), place(name)), about(command)]);
        all += &format!("**{}**\n\n{}\n", group.title, table(&["verb", "does"], &rows.collect::<Vec<_>>()));
        let body: String = verbs.iter().map(|(name, command)| verb_section(name, command)).collect();
        pages.push(Page {
            path: format!("command-line/{}.md", group.page),
            frame: format!(
                "# {}\n\nOptions of every verb stand in [the command line](../command-line.md).\n",
                group.title
            ),
            generated: body,
        });
    }
    all += "## Options of every verb\n\n";
    all += &arguments(tree.get_arguments().collect(), &BTreeMap::new());
    pages.insert(0, Page { path: "command-line.md".to_owned(), frame: String::new(), generated: all });
    pages
}

/// Adds a verb that can be run, and those below it.
fn add_verbs<'a>(command: &'a Command, name: &str, found: &mut Vec<(String, &'a Command)>) {
    if !command.is_subcommand_required_set() {
        found.push((name.to_owned(), command));
    }
    for below in command.get_subcommands().filter(|below| below.get_name() != "help") {
        add_verbs(below, &format!("{name} {}", below.get_name()), found);
    }
}

/// The anchor that mdBook and GitHub give a heading of a verb.
pub fn anchor(verb: &str) -> String {
    verb.replace(' ', "-")
}

fn about(command: &Command) -> String {
    sentence(&command.get_about().map(ToString::to_string).unwrap_or_default())
}

/// A verb: what it does, its usage, its arguments.
fn verb_section(name: &str, command: &Command) -> String {
    let mut out = format!("## {name}\n\n");
    let long = command.get_long_about().map(ToString::to_string).unwrap_or_default();
    let short = command.get_about().map(ToString::to_string).unwrap_or_default();
    // The long text begins with the short one, or goes on where that ends, or has another beginning.
    if !long.starts_with(short.trim_end_matches('.')) {
        out += &format!("{}\n\n", about(command));
    }
    out += &paragraphs(&long);
    let usage = command.clone().render_usage().to_string();
    out += &format!("```text\n{}\n```\n\n", usage.trim_start_matches("Usage: ").replace("\n       ", "\n"));
    let own: Vec<&Arg> =
        command.get_arguments().filter(|arg| !arg.is_global_set() && !arg.is_hide_set()).collect();
    let ranges = ranges_of(&name.trim_start_matches("petzval ").replace(' ', "-"));
    let mut headings: Vec<Option<&str>> = Vec::new();
    for arg in own.iter().filter(|arg| !is_help(arg)) {
        if !headings.contains(&arg.get_help_heading()) {
            headings.push(arg.get_help_heading());
        }
    }
    for heading in headings {
        if let Some(heading) = heading {
            out += &format!("**{heading}**\n\n");
        }
        out += &arguments(
            own.iter().copied().filter(|arg| arg.get_help_heading() == heading).collect(),
            &ranges,
        );
        out.push('\n');
    }
    out
}

fn is_help(arg: &Arg) -> bool {
    matches!(
        arg.get_action(),
        ArgAction::Help | ArgAction::HelpShort | ArgAction::HelpLong | ArgAction::Version
    )
}

/// Arguments as a table.
fn arguments(all: Vec<&Arg>, ranges: &BTreeMap<String, Row>) -> String {
    let rows = all.into_iter().filter(|arg| !is_help(arg)).map(|arg| {
        let values: Vec<String> =
            arg.get_value_names().into_iter().flatten().map(|name| format!("<{name}>")).collect();
        let takes = arg.get_action().takes_values();
        let name = match arg.get_long() {
            Some(long) if takes => format!("--{long} {}", values.join(" ")),
            Some(long) => format!("--{long}"),
            None => values.join(" "),
        };
        let defaults: Vec<String> =
            arg.get_default_values().iter().map(|value| value.to_string_lossy().into_owned()).collect();
        let row = arg.get_long().and_then(|long| range_of(&long.replace('-', "_"), ranges));
        let help = arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default();
        // Values that are no words of this argument, such as true and false of a switch, are not listed.
        let words = arg.get_possible_values().into_iter().filter(|value| takes && !value.is_hide_set());
        let words = words.map(|value| {
            let what = value.get_help().map(ToString::to_string).unwrap_or_default();
            if what.is_empty() {
                format!("{}.", code(value.get_name()))
            } else {
                format!("{}: {}", code(value.get_name()), sentence(&what))
            }
        });
        let meaning = std::iter::once(sentence(&help)).chain(words).collect::<Vec<_>>().join(" ");
        let is_needed = arg.is_required_set();
        vec![
            code(&name),
            if takes && !defaults.is_empty() {
                code(&defaults.join(" "))
            } else if is_needed {
                "must be given".to_owned()
            } else {
                String::new()
            },
            row.map(|row| row.range.clone()).unwrap_or_default(),
            row.map(|row| prose(&row.unit)).unwrap_or_default(),
            meaning,
        ]
    });
    table(&["argument", "default", "range", "unit", "meaning"], &rows.collect::<Vec<_>>())
}

/// The keys of the request of a job that have a range. What parses the command line does not know it: the job checks it.
fn ranges_of(job: &str) -> BTreeMap<String, Row> {
    let jobs = petzval::units::table();
    let Ok(row) = jobs.row(job) else { return BTreeMap::new() };
    let schema = row.schema();
    let rows = Schema(&schema).rows(usize::MAX);
    let last = |key: &str| key.rsplit('.').next().unwrap_or(key).to_owned();
    rows.into_iter().filter(|row| !row.range.is_empty()).map(|row| (last(&row.key), row)).collect()
}

/// The row of an option: its key in the request has the same name, or the same with the unit behind it.
fn range_of<'a>(option: &str, ranges: &'a BTreeMap<String, Row>) -> Option<&'a Row> {
    ranges.get(option).or_else(|| {
        ranges
            .iter()
            .find(|(key, row)| {
                !row.unit.is_empty() && **key == format!("{option}_{}", row.unit.to_lowercase())
            })
            .map(|(_, row)| row)
    })
}

//! From what varies to the combinations that are run: a pure function of the file.

use std::collections::{BTreeMap, HashSet};
use std::hash::Hash;

use petzval_base::FileError;
use petzval_base::random::{Stage, Stream};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::file::SweepFile;
use super::place::at_place;

/// Most units of a sweep.
pub const MOST_UNITS: usize = 100_000;

/// A key that varies.
#[derive(Clone, Debug, PartialEq)]
pub struct SweptKey {
    /// Its key path: `training.steps`.
    pub key: String,
    /// Where it stands in the file: `["grid", "training", "steps"]`.
    pub place: Vec<String>,
}

/// What is run: the values of the keys that vary, a variant and a seed, where the file names any.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Combination {
    /// A value for each key that varies, in their order.
    pub values: Vec<Value>,
    /// The variant.
    pub variant: Option<String>,
    /// The seed.
    pub seed: Option<u64>,
}

/// All combinations of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Expansion {
    /// The keys that vary: those of the grid, of the list, and those that are drawn, each in the order of their names.
    pub keys: Vec<SweptKey>,
    /// The combinations. Those of the first seed come first; then keys vary in their order, the last one fastest.
    pub combinations: Vec<Combination>,
    /// Draws that gave the values of an earlier one, and are left out.
    pub merged: usize,
}

/// Expands a file; `text` is its text, for the places of errors.
///
/// The order depends on names and values alone. A draw depends on the seed of `random`, its number and its key: more draws leave the earlier ones as
/// they are. Drawn numbers have four digits, and in a narrow range as many as tell its places apart. Equal values of a list are refused, equal draws are merged.
pub fn expand(file: &SweepFile, text: &str) -> Result<Expansion, FileError> {
    let wrong = wrong_in(text);
    let grid = lists(&file.grid, "grid", &wrong)?;
    let list = lists(&file.list, "list", &wrong)?;
    let random = Random::of(&file.random, &wrong)?;
    let keys: Vec<SweptKey> = grid
        .iter()
        .chain(&list)
        .map(|(key, _)| key.clone())
        .chain(random.keys.iter().map(|(key, _)| key.clone()))
        .collect();
    check_keys(&keys, file, &wrong)?;
    if let Some(((first, values), (other, others))) =
        list.first().zip(list.iter().find(|(_, others)| others.len() != list[0].1.len()))
    {
        let message = format!("has {} values, and `{}` has {}", others.len(), first.key, values.len());
        return Err(wrong(&other.place, message, "a list has one value of every key for each of its rows"));
    }
    // An empty list runs one unit, as no list does: which of the two is meant, the file has to say.
    let written: toml::Table = text.parse().unwrap_or_default();
    for key in ["seeds", "variants"] {
        if written.get(key).and_then(toml::Value::as_array).is_some_and(Vec::is_empty) {
            return Err(empty(&[key.to_owned()], &wrong));
        }
    }
    for (what, is_twice) in [("seeds", twice(&file.seeds)), ("variants", twice(&file.variants))] {
        if let Some(place) = is_twice {
            return Err(wrong(
                &[what.to_owned(), place.to_string()],
                "stands twice".to_owned(),
                "name each once",
            ));
        }
    }

    // Rows of values: of the grid, times those of the list, times the draws.
    let mut rows: Vec<Vec<Value>> = vec![Vec::new()];
    for (_, values) in &grid {
        rows = product(&rows, values.iter().map(|value| vec![value.clone()]));
        check_number(rows.len(), &wrong)?;
    }
    if let Some((_, first)) = list.first() {
        let row = |i: usize| list.iter().map(|(_, values)| values[i].clone()).collect::<Vec<Value>>();
        let of_list: Vec<Vec<Value>> = (0..first.len()).map(row).collect();
        if let Some(place) = twice(of_list.iter().map(|row| row.iter().map(identity).collect::<Vec<_>>())) {
            let message = "this row of the list stands twice".to_owned();
            let place = [list[0].0.place.clone(), vec![place.to_string()]].concat();
            return Err(wrong(&place, message, "give every row once; for repetitions give seeds"));
        }
        rows = product(&rows, of_list.into_iter());
    }
    let (draws, merged) = random.draws();
    if !random.keys.is_empty() {
        check_number(rows.len() * draws.len(), &wrong)?;
        rows = product(&rows, draws.into_iter());
    }
    let (variants, seeds) = (each_or_none(&file.variants), each_or_none(&file.seeds));
    check_number(rows.len() * variants.len() * seeds.len(), &wrong)?;
    let mut combinations = Vec::new();
    for seed in seeds {
        for values in &rows {
            for variant in &variants {
                combinations.push(Combination { values: values.clone(), variant: variant.clone(), seed });
            }
        }
    }
    Ok(Expansion { keys, combinations, merged })
}

/// How an error at a place of the file is made.
type Wrong<'a> = dyn Fn(&[String], String, &str) -> FileError + 'a;

/// How an error at a place of a text is made.
fn wrong_in(text: &str) -> impl Fn(&[String], String, &str) -> FileError {
    move |place: &[String], message: String, hint: &str| {
        let place: Vec<&str> = place.iter().map(String::as_str).collect();
        at_place(text, &place, message).hint(hint)
    }
}

/// The error of a list without values.
fn empty(place: &[String], wrong: &Wrong) -> FileError {
    wrong(place, "the list is empty".to_owned(), "give at least one value, or leave the key out")
}

fn check_number(units: usize, wrong: &Wrong) -> Result<(), FileError> {
    if units <= MOST_UNITS {
        return Ok(());
    }
    Err(wrong(&[], format!("more than {MOST_UNITS} units"), "draw some at random, or make several sweeps"))
}

/// Every row followed by every one of `others`.
fn product(rows: &[Vec<Value>], others: impl Iterator<Item = Vec<Value>> + Clone) -> Vec<Vec<Value>> {
    rows.iter().flat_map(|row| others.clone().map(move |other| [row.clone(), other].concat())).collect()
}

/// Each element; nothing, once, where there are none.
fn each_or_none<T: Clone>(all: &[T]) -> Vec<Option<T>> {
    if all.is_empty() { vec![None] } else { all.iter().cloned().map(Some).collect() }
}

/// The place of the first element that equals an earlier one.
fn twice<T: Eq + Hash>(all: impl IntoIterator<Item = T>) -> Option<usize> {
    let mut known = HashSet::new();
    all.into_iter().position(|one| !known.insert(one))
}

/// A text that is the same for values that make one request: a whole number and the same with a decimal point.
fn identity(value: &Value) -> String {
    match value {
        Value::Number(number) => match number.as_f64() {
            // Larger ones have no decimal point in a file, or differ by more than one.
            Some(real) if number.is_f64() && real.fract() == 0.0 && real.abs() < 1e15 => {
                (real as i64).to_string()
            }
            _ => number.to_string(),
        },
        Value::Array(values) => {
            format!("[{}]", values.iter().map(|value| identity(value) + ",").collect::<String>())
        }
        other => other.to_string(),
    }
}

/// The keys of a table with their lists of values, by name. Tables in it are parts of key paths.
fn lists(table: &toml::Table, name: &str, wrong: &Wrong) -> Result<Vec<(SweptKey, Vec<Value>)>, FileError> {
    let mut found = Vec::new();
    leaves(table, &[name.to_owned()], &|_| false, &mut found);
    let mut keys = Vec::new();
    for (place, value) in found {
        let key = SweptKey { key: place[1..].join("."), place };
        let toml::Value::Array(values) = value else {
            let message = "expected a list of values".to_owned();
            return Err(wrong(
                &key.place,
                message,
                "write several values in square brackets, such as [1, 2]; what does not vary belongs to [set]",
            ));
        };
        if values.is_empty() {
            return Err(empty(&key.place, wrong));
        }
        let at = |i: usize| [&key.place[..], &[i.to_string()]].concat();
        let values = values.iter().enumerate().map(|(i, value)| json(value, &at(i), wrong));
        let values = values.collect::<Result<Vec<_>, _>>()?;
        // Rows of a list may repeat single values.
        if let Some(place) = twice(values.iter().map(identity)).filter(|_| name == "grid") {
            return Err(wrong(
                &at(place),
                "stands twice".to_owned(),
                "give every value once; for repetitions give seeds",
            ));
        }
        keys.push((key, values));
    }
    keys.sort_by(|a, b| a.0.key.cmp(&b.0.key));
    Ok(keys)
}

/// Every value that is no table, or for which `ends` says that it is a value, with its place.
fn leaves<'t>(
    table: &'t toml::Table,
    place: &[String],
    ends: &dyn Fn(&toml::Table) -> bool,
    found: &mut Vec<(Vec<String>, &'t toml::Value)>,
) {
    for (key, value) in table {
        let below = [place, std::slice::from_ref(key)].concat();
        match value {
            toml::Value::Table(inner) if !ends(inner) => leaves(inner, &below, ends, found),
            value => found.push((below, value)),
        }
    }
}

/// The value at a place of a text as JSON. Fails at a date and at a number that is not finite, which JSON lacks.
pub(super) fn json_at(value: &toml::Value, place: &[String], text: &str) -> Result<Value, FileError> {
    json(value, place, &wrong_in(text))
}

/// A value as JSON.
fn json(value: &toml::Value, place: &[String], wrong: &Wrong) -> Result<Value, FileError> {
    if let Some(NotInJson { below, message, hint }) = not_in_json(value) {
        return Err(wrong(&[place, &below[..]].concat(), message.to_owned(), hint));
    }
    serde_json::to_value(value).map_err(|e| wrong(place, e.to_string(), "give text, a number, true or false"))
}

/// What JSON cannot hold.
struct NotInJson {
    /// Where it lies below a value.
    below: Vec<String>,
    message: &'static str,
    hint: &'static str,
}

/// The first part of a value that JSON cannot hold.
fn not_in_json(value: &toml::Value) -> Option<NotInJson> {
    let wrong = |message, hint| Some(NotInJson { below: Vec::new(), message, hint });
    let below = |key: String, value: &toml::Value| {
        let found = not_in_json(value)?;
        Some(NotInJson { below: [vec![key], found.below].concat(), ..found })
    };
    match value {
        toml::Value::Datetime(_) => {
            wrong("neither text, number, true, false nor a list of them", "write dates in quotes")
        }
        toml::Value::Float(number) if !number.is_finite() => {
            wrong("not a finite number", "give finite numbers: neither nan nor inf")
        }
        toml::Value::Array(values) => {
            values.iter().enumerate().find_map(|(i, value)| below(i.to_string(), value))
        }
        toml::Value::Table(table) => table.iter().find_map(|(key, value)| below(key.clone(), value)),
        _ => None,
    }
}

/// Sees that no key stands twice, or above another.
fn check_keys(keys: &[SweptKey], file: &SweepFile, wrong: &Wrong) -> Result<(), FileError> {
    for (place, key) in keys.iter().enumerate() {
        let clashes = |other: &&SweptKey| {
            other.key == key.key
                || key.key.starts_with(&format!("{}.", other.key))
                || other.key.starts_with(&format!("{}.", key.key))
        };
        if let Some(other) = keys[..place].iter().find(clashes) {
            let message = format!("`{}` varies already, in [{}]", other.key, other.place[0]);
            return Err(wrong(&key.place, message, "let each key vary once"));
        }
        for (field, is_used) in [("seed", !file.seeds.is_empty()), ("variant", !file.variants.is_empty())] {
            if is_used && key.key == field {
                let message = format!("`{field}s` is given as well");
                return Err(wrong(&key.place, message, "leave one of the two out"));
            }
        }
    }
    Ok(())
}

/// What is drawn of a key.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Draw {
    from: Option<toml::Value>,
    to: Option<toml::Value>,
    log: bool,
    choice: Option<Vec<toml::Value>>,
}

/// From what a value is drawn.
enum Range {
    /// Numbers between two, by equal ratios if `log`.
    Numbers { from: f64, to: f64, log: bool },
    /// Whole numbers between two, both included.
    Whole { from: i64, to: i64, log: bool },
    /// One of these.
    Choice(Vec<Value>),
}

/// The table of keys whose values are drawn.
#[derive(Default)]
struct Random {
    n: usize,
    seed: u64,
    keys: Vec<(SweptKey, Range)>,
}

impl Random {
    fn of(table: &toml::Table, wrong: &Wrong) -> Result<Self, FileError> {
        let mut table = table.clone();
        let mut whole = |key: &str, least: i64| match table.remove(key) {
            None => Ok(None),
            Some(toml::Value::Integer(value)) if value >= least => Ok(Some(value)),
            Some(_) => {
                let place = ["random".to_owned(), key.to_owned()];
                Err(wrong(
                    &place,
                    format!("expected a number from {least} without a decimal point"),
                    "such as 20",
                ))
            }
        };
        let (n, seed) = (whole("n", 1)?, whole("seed", 0)?);
        let mut found = Vec::new();
        let ends = |table: &toml::Table| {
            table.is_empty()
                || table.keys().any(|key| ["from", "to", "choice", "log"].contains(&key.as_str()))
        };
        leaves(&table, &["random".to_owned()], &ends, &mut found);
        let mut keys = Vec::new();
        for (place, value) in found {
            let key = SweptKey { key: place[1..].join("."), place };
            if let Some(toml::Value::Array(values)) = value.get("choice") {
                check_choice(values, &[&key.place[..], &["choice".to_owned()]].concat(), wrong)?;
            }
            let range = range(value).map_err(|message| {
                wrong(&key.place, message, "write {from = 1e-4, to = 1e-2, log = true} or {choice = [1, 2]}")
            })?;
            keys.push((key, range));
        }
        keys.sort_by(|a, b| a.0.key.cmp(&b.0.key));
        let place = ["random".to_owned()];
        match (n, keys.is_empty()) {
            (None, false) => Err(wrong(&place, "`n` is missing".to_owned(), "say how many draws: n = 20")),
            (Some(_), true) => Err(wrong(
                &place,
                "no key is drawn".to_owned(),
                "name one: \"training.learning_rate\" = {from = 1e-4, to = 1e-2, log = true}",
            )),
            (n, _) if n.unwrap_or(0) > MOST_UNITS as i64 => Err(wrong(
                &["random".to_owned(), "n".to_owned()],
                format!("more than {MOST_UNITS} draws"),
                "draw fewer",
            )),
            (n, _) => Ok(Self { n: n.unwrap_or(0) as usize, seed: seed.unwrap_or(1) as u64, keys }),
        }
    }

    /// The draws, each different from those before it, and the number of those left out.
    fn draws(&self) -> (Vec<Vec<Value>>, usize) {
        let mut draws: Vec<Vec<Value>> = Vec::new();
        let mut known = HashSet::new();
        for number in 0..self.n {
            let stream = Stream::new(self.seed, number as u64, Stage::Search);
            let draw: Vec<Value> = self
                .keys
                .iter()
                .map(|(key, range)| {
                    let [u, _] = stream.uniforms(place_of(&key.key), 0);
                    range.at(u)
                })
                .collect();
            if known.insert(Value::from(draw.clone()).to_string()) {
                draws.push(draw);
            }
        }
        let merged = self.n - draws.len();
        (draws, merged)
    }
}

/// Sees that every value of a choice is one of a request, and that none stands twice.
fn check_choice(values: &[toml::Value], place: &[String], wrong: &Wrong) -> Result<(), FileError> {
    let at = |i: usize| [place, &[i.to_string()]].concat();
    let values: Vec<Value> = values
        .iter()
        .enumerate()
        .map(|(i, value)| json(value, &at(i), wrong))
        .collect::<Result<_, FileError>>()?;
    match twice(values.iter().map(identity)) {
        Some(i) => Err(wrong(
            &at(i),
            "stands twice".to_owned(),
            "give every value once; 1 and 1.0 are one value, and all are drawn equally often",
        )),
        None => Ok(()),
    }
}

/// A number for a key, by which its draws differ from those of others.
fn place_of(key: &str) -> u32 {
    let digest = Sha256::digest(key);
    u32::from_le_bytes([digest[0], digest[1], digest[2], digest[3]])
}

/// From what a value is drawn; a message where that says nothing.
fn range(value: &toml::Value) -> Result<Range, String> {
    let draw: Draw =
        value.clone().try_into().map_err(|e: toml::de::Error| e.message().trim().replace('\n', ", "))?;
    let range = match draw {
        Draw { choice: Some(choice), from: None, to: None, log: false } => {
            let values: Result<Vec<Value>, _> = choice.iter().map(serde_json::to_value).collect();
            let values = values.map_err(|e| e.to_string())?;
            if values.is_empty() || values.iter().any(Value::is_null) {
                return Err("`choice` is empty, or holds what is no finite value".to_owned());
            }
            Range::Choice(values)
        }
        Draw { choice: None, from: Some(from), to: Some(to), log } => match (from, to) {
            (toml::Value::Integer(from), toml::Value::Integer(to)) => Range::Whole { from, to, log },
            (from, to) => {
                let number =
                    |value: &toml::Value| value.as_float().or_else(|| value.as_integer().map(|v| v as f64));
                match (number(&from), number(&to)) {
                    (Some(from), Some(to)) => Range::Numbers { from, to, log },
                    _ => return Err("`from` and `to` are numbers".to_owned()),
                }
            }
        },
        _ => return Err("expected `from` and `to`, or `choice`".to_owned()),
    };
    let (from, to, log) = match range {
        Range::Numbers { from, to, log } => (from, to, log),
        Range::Whole { from, to, log } => (from as f64, to as f64, log),
        Range::Choice(_) => return Ok(range),
    };
    match () {
        () if !(from < to && (to - from).is_finite()) => {
            Err(format!("`from` = {from} must be less than `to` = {to}"))
        }
        () if log && from <= 0.0 => Err("by equal ratios, `from` must be positive".to_owned()),
        () => Ok(range),
    }
}

impl Range {
    /// The value at a place from 0 to less than 1.
    fn at(&self, u: f64) -> Value {
        match self {
            Self::Choice(values) => {
                values[((u * values.len() as f64) as usize).min(values.len() - 1)].clone()
            }
            Self::Numbers { from, to, log } => {
                let value = if *log { from * (to / from).powf(u) } else { from + u * (to - from) };
                let width = if *log { value * (to / from).ln() } else { to - from };
                let rounded = rounded(value, width);
                // Near its ends, a rounded number may lie outside the range.
                if (*from..=*to).contains(&rounded) { rounded } else { value.clamp(*from, *to) }.into()
            }
            Self::Whole { from, to, log } => {
                let (low, high) = (*from as f64, *to as f64 + 1.0);
                let value = if *log { low * (high / low).powf(u) } else { low + u * (high - low) };
                (value.floor() as i64).clamp(*from, *to).into()
            }
        }
    }
}

/// A number with four digits, or to a thousandth of the order of `width` where four leave fewer than a hundred places in it.
fn rounded(value: f64, width: f64) -> f64 {
    let order = |number: f64| number.abs().log10().floor();
    let orders = order(value) - order(width);
    // Seventeen digits tell any two numbers apart.
    let digits = if orders >= 2.0 { (3.0 + orders).min(16.0) as usize } else { 3 };
    format!("{value:.digits$e}").parse().unwrap_or(value)
}

/// Every value below a table that is no table itself, with its place, which begins with the name of the table.
pub(super) fn leaves_of<'t>(table: &'t toml::Table, name: &str) -> Vec<(Vec<String>, &'t toml::Value)> {
    let mut found = Vec::new();
    leaves(table, &[name.to_owned()], &|_| false, &mut found);
    found
}

/// The values of a combination by key.
pub fn by_key(keys: &[SweptKey], combination: &Combination) -> BTreeMap<String, Value> {
    keys.iter().map(|key| key.key.clone()).zip(combination.values.iter().cloned()).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::sweep::file::parse;

    fn expanded(text: &str) -> Result<Expansion, FileError> {
        expand(&parse(text).unwrap(), text)
    }

    /// The combinations as JSON: values, variant, seed.
    fn all(text: &str) -> Vec<Value> {
        expanded(text).unwrap().combinations.iter().map(|c| json!([c.values, c.variant, c.seed])).collect()
    }

    #[test]
    fn all_combinations_are_made_in_an_order_that_the_file_alone_decides() {
        let text = "seeds = [1, 2]\nvariants = [\"a\", \"b\"]\n[grid]\n\"z.k\" = [3, 4]\n[list]\nx = [5, 5]\ny.w = [\"p\", \"q\"]\n";
        let keys: Vec<String> = expanded(text).unwrap().keys.iter().map(|key| key.key.clone()).collect();
        assert_eq!(keys, ["z.k", "x", "y.w"]);
        let found = all(text);
        assert_eq!(found.len(), 16);
        assert_eq!(
            found[..3],
            [json!([[3, 5, "p"], "a", 1]), json!([[3, 5, "p"], "b", 1]), json!([[3, 5, "q"], "a", 1])]
        );
        assert_eq!(found[15], json!([[4, 5, "q"], "b", 2]));
        // The order of the file's lines is none of it.
        let turned = "variants = [\"a\", \"b\"]\nseeds = [1, 2]\n[list.y]\nw = [\"p\", \"q\"]\n[list]\nx = [5, 5]\n[grid.z]\nk = [3, 4]\n";
        assert_eq!(all(turned), found);
        assert_eq!(all(""), [json!([[], null, null])]);
        assert_eq!(
            all("[grid]\na = [[1, 2], {b = 1}]\n"),
            [json!([[[1, 2]], null, null]), json!([[{"b": 1}], null, null])]
        );
    }

    #[test]
    fn draws_depend_on_their_number_and_key_alone() {
        let text = |n: usize, more: &str| {
            format!("[random]\nn = {n}\nseed = 3\nrate = {{from = 1e-4, to = 1e-2, log = true}}\n{more}")
        };
        let rates =
            |of: &[Value], i: usize| -> Vec<f64> { of.iter().map(|c| c[0][i].as_f64().unwrap()).collect() };
        let ten = rates(&all(&text(10, "")), 0);
        assert_eq!(rates(&all(&text(4, "")), 0), ten[..4]);
        let more = all(&text(10, "kind = {choice = [\"p\", \"q\"]}\nbatch = {from = 1, to = 4}\n"));
        assert_eq!(rates(&more, 2), ten);
        for c in &more {
            let batch = c[0][0].as_i64().unwrap();
            assert!((1..=4).contains(&batch) && ["p", "q"].contains(&c[0][1].as_str().unwrap()));
        }
        // By equal ratios, half of many draws lie below the geometric mean; 3.9 standard deviations are 62 of 1000, of which some are merged.
        let many = rates(&all(&text(1000, "")), 0);
        let below = many.iter().filter(|rate| **rate < 1e-3).count();
        assert!((420..=560).contains(&below), "{below}");
        assert!(many.iter().all(|rate| (1e-4..=1e-2).contains(rate) && rate.to_string().len() <= 9));
        let seven = all(&text(10, "").replace("seed = 3", "seed = 7"));
        assert_ne!(rates(&seven, 0), ten);
    }

    #[test]
    fn draws_fill_narrow_ranges() {
        for range in [
            "{from = 25.040, to = 25.060}",
            "{from = 1e6, to = 1000000.5}",
            "{from = -1.00002, to = -1.00001}",
            "{from = 100.0, to = 100.01, log = true}",
        ] {
            let found = expanded(&format!("[random]\nn = 40\nk = {range}\n")).unwrap();
            // Of a thousand places, 40 draws hit one twice 0.8 times.
            assert!(found.merged <= 4, "{range}: {}", found.merged);
            let table: toml::Table = format!("k = {range}").parse().unwrap();
            let end = |name: &str| table["k"][name].as_float().unwrap();
            let drawn: Vec<f64> = found.combinations.iter().map(|c| c.values[0].as_f64().unwrap()).collect();
            assert!(drawn.iter().all(|k| (end("from")..=end("to")).contains(k)), "{drawn:?}");
            // Forty draws leave one of five parts empty once in 1500 sweeps.
            let part = |k: &f64| (5.0 * (k - end("from")) / (end("to") - end("from"))) as usize;
            let parts: std::collections::BTreeSet<usize> = drawn.iter().map(part).collect();
            assert!(parts.len() >= 4, "{range}: {drawn:?}");
        }
        assert_eq!(rounded(25.041_234_567, 0.02), 25.041_23);
        assert_eq!(rounded(0.012_345_67, 1.0), 0.012_35);
        assert_eq!(rounded(0.0, 1.0), 0.0);
    }

    #[test]
    fn whole_numbers_that_no_double_tells_apart_are_two() {
        let text = "k = {choice = [9007199254740992, 9007199254740993]}\n";
        assert!(expanded(&format!("[random]\nn = 3\n{text}")).is_ok());
        assert_eq!(all("[grid]\nk = [9007199254740992, 9007199254740993]\n").len(), 2);
    }

    #[test]
    fn equal_draws_are_merged_and_counted() {
        let found = expanded("[random]\nn = 50\nk = {choice = [1, 2, 3]}\n").unwrap();
        assert_eq!((found.combinations.len(), found.merged), (3, 47));
        // Both ends of a range of whole numbers are drawn.
        let mut drawn: Vec<Value> = all("[random]\nn = 200\nk = {from = 2, to = 4, log = true}\n")
            .iter()
            .map(|c| c[0][0].clone())
            .collect();
        drawn.sort_by_key(|v| v.as_i64());
        assert_eq!(drawn, [json!(2), json!(3), json!(4)]);
    }

    #[test]
    fn what_cannot_be_expanded_is_refused_with_its_place() {
        for (text, line, says) in [
            ("[grid]\na = []\n", 2, "the list is empty"),
            ("[grid]\na = 4\n", 2, "expected a list of values"),
            ("[grid]\na.b = [1, 2, 1]\n", 2, "stands twice"),
            ("[grid]\na.b = [1, 1.0]\n", 2, "stands twice"),
            ("[list]\na = [1, 1.0]\nb = [2, 2]\n", 2, "this row of the list stands twice"),
            ("[grid]\na = [2026-11-28]\n", 2, "neither text"),
            ("[grid]\na = [1, nan]\n", 2, "`a = nan`: not a finite number"),
            ("[list]\na = [[1, inf]]\n", 2, "neither nan nor inf"),
            ("[grid]\na = [{b = 1}, {b = [\n  2,\n  nan]}]\n", 4, "`b = nan`: not a finite number"),
            ("[random]\nn = 3\nk = {choice = [1, -inf]}\n", 3, "not a finite number"),
            ("[grid]\na = [1]\n[list]\na = [2]\n", 4, "`a` varies already, in [grid]"),
            ("[grid]\na = [1]\n\"a.b\" = [1]\n", 3, "`a` varies already"),
            ("[list]\na = [1, 2]\nb = [1]\n", 3, "has 1 values, and `a` has 2"),
            ("[list]\na = [1, 1]\nb = [2, 2]\n", 2, "this row of the list stands twice"),
            ("seeds = [1]\n[grid]\nseed = [2]\n", 3, "`seeds` is given as well"),
            ("seeds = [1, 1]\n", 1, "stands twice"),
            ("name = \"a\"\nseeds = []\n", 2, "the list is empty"),
            ("seeds = [1]\nvariants = []\n", 2, "the list is empty"),
            ("[random]\nk = {from = 1, to = 2}\n", 1, "`n` is missing"),
            ("[random]\nn = 3\n", 1, "no key is drawn"),
            ("[random]\nn = 0\nk = {from = 1, to = 2}\n", 2, "a number from 1"),
            ("[random]\nn = 3\nk = {from = 2, to = 1}\n", 3, "must be less than"),
            ("[random]\nn = 3\nk = {from = 0, to = 1, log = true}\n", 3, "must be positive"),
            ("[random]\nn = 3\nk = {from = 0}\n", 3, "expected `from` and `to`"),
            ("[random]\nn = 3\nk = {from = 0, upto = 1}\n", 3, "unknown field `upto`"),
            ("[random]\nn = 3\nk = {choice = []}\n", 3, "`choice` is empty"),
            ("[random]\nn = 3\nk = 4\n", 3, "expected"),
            ("[random]\nn = 3\nk = {choice = [0.5, 2026-01-01]}\n", 3, "neither text"),
            ("[random]\nn = 3\n[random.k]\nchoice = [\n  1,\n  1.0]\n", 6, "stands twice"),
        ] {
            let error = expanded(text).unwrap_err();
            assert_eq!(error.line, Some(line), "{text}: {error}");
            assert!(error.to_string().contains(says), "{text}: {error}");
            assert!(error.hint.is_some(), "{text}");
        }
        let many = "[grid]\na = [1,2,3,4,5,6,7,8,9,10]\nb = [1,2,3,4,5,6,7,8,9,10]\nc = [1,2,3,4,5,6,7,8,9,10]\n[random]\nn = 150\nd = {from = 0.0, to = 1.0}\n";
        assert!(expanded(many).unwrap_err().to_string().contains("more than 100000 units"));
    }
}

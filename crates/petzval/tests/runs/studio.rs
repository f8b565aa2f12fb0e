//! The studio on a run: what `report --watch` and `petzval studio RUN` show, and designs as processes of their own.

#![cfg(unix)]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::common::*;
use crate::resume::{killed, started_from};

/// A studio at work. It ends with the test.
struct Studio {
    process: Child,
    address: String,
    token: String,
}

impl Drop for Studio {
    fn drop(&mut self) {
        let _ended = self.process.kill();
        let _ended = self.process.wait();
    }
}

impl Studio {
    fn start(folder: &Path, words: &[&str]) -> Self {
        let mut command = petzval(folder);
        command.args(words).args(["--port", "0", "--no-open"]).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut process = command.spawn().unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let (address, token) = line
            .trim()
            .strip_prefix("http://")
            .unwrap()
            .split_once("/?token=")
            .expect("an address with a token");
        Self { address: address.to_owned(), token: token.to_owned(), process }
    }

    fn cookie(&self) -> String {
        let port = self.address.rsplit_once(':').unwrap().1;
        format!("petzval_studio_{port}={}", self.token)
    }

    /// Status and body of the answer to a request.
    fn get(&self, path: &str) -> (String, String) {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        let cookie = self.cookie();
        write!(
            stream,
            "GET {path} HTTP/1.1\r\nHost: {}\r\nCookie: {cookie}\r\nConnection: close\r\n\r\n",
            self.address
        )
        .unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let text = String::from_utf8_lossy(&answer);
        let (head, body) = text.split_once("\r\n\r\n").unwrap();
        (head.split(' ').nth(1).unwrap().to_owned(), body.to_owned())
    }

    /// The end of a call, by a socket of its own.
    fn call(&self, mut call: Value) -> Value {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        let (address, cookie) = (&self.address, self.cookie());
        write!(
            stream,
            "GET /socket HTTP/1.1\r\nHost: {address}\r\nOrigin: http://{address}\r\nCookie: {cookie}\r\nUpgrade: websocket\r\n\
             Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        )
        .unwrap();
        let (mut head, mut byte) = (Vec::new(), [0]);
        while !head.ends_with(b"\r\n\r\n") {
            stream.read_exact(&mut byte).unwrap();
            head.push(byte[0]);
        }
        assert!(head.starts_with(b"HTTP/1.1 101"));
        call["id"] = 1.into();
        let text = call.to_string();
        // Masked by zeros, as a client may.
        let mut frame = vec![0x81, 0x80 | 127];
        frame.extend((text.len() as u64).to_be_bytes());
        frame.extend([0; 4]);
        frame.extend(text.bytes());
        stream.write_all(&frame).unwrap();
        loop {
            let mut head = [0; 2];
            stream.read_exact(&mut head).unwrap();
            let length = match head[1] {
                126 => {
                    let mut length = [0; 2];
                    stream.read_exact(&mut length).unwrap();
                    usize::from(u16::from_be_bytes(length))
                }
                127 => {
                    let mut length = [0; 8];
                    stream.read_exact(&mut length).unwrap();
                    u64::from_be_bytes(length) as usize
                }
                short => usize::from(short),
            };
            let mut payload = vec![0; length];
            stream.read_exact(&mut payload).unwrap();
            if head[0] & 0x0F != 1 {
                continue;
            }
            let message: Value = serde_json::from_slice(&payload).unwrap();
            if message.get("event").is_none() {
                return message;
            }
        }
    }

    /// The response of a job.
    fn response(&self, job: &str, request: Value) -> Value {
        let mut end = self.call(json!({"job": job, "request": request}));
        assert!(end.get("error").is_none(), "{job}: {end}");
        end["response"].take()
    }
}

/// Waits until something holds.
fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let began = Instant::now();
    while !holds() {
        assert!(began.elapsed() < Duration::from_secs(60), "{what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn the_studio_shows_a_run_at_rest_and_its_report_once_it_is_finished() {
    let folder = tempfile::tempdir().unwrap();
    let run = killed(folder.path(), 7);
    let studio = Studio::start(folder.path(), &["report", "run", "--watch"]);
    let (status, state) = studio.get("/state");
    assert_eq!(status, "200");
    let state: Value = serde_json::from_str(&state).unwrap();
    assert_eq!(
        state["first"],
        json!({"room": "runs", "run": "run", "experiment": null, "sweep": null, "runs": null})
    );
    // Its lens can be opened at once.
    assert_eq!(state["opened"][0]["name"].as_str().unwrap().rsplit('/').next().unwrap(), "lens.toml");
    let view = studio.response("run-view", json!({"run": "run"}));
    assert_eq!((view["row"]["state"].as_str(), view["holder"].is_null()), (Some("stopped"), true));
    let steps = view["steps"].as_array().unwrap();
    assert!(steps.len() >= 7 && steps[0]["step"] == 1);
    assert_eq!(view["variants"][1]["first_step"], NETWORK_STEPS + 2);
    assert_eq!(view["variants"].as_array().unwrap().len(), 3);
    let left = &view["time_left"];
    assert!(left["seconds"].as_f64().unwrap() > 0.0 && left["is_least"].is_boolean(), "{left}");
    let unit_of_psnr = |scores: &Value| {
        let psnr = scores.as_array().unwrap().iter().find(|score| score["name"] == "psnr_db").unwrap();
        psnr["unit"].clone()
    };
    assert_eq!(unit_of_psnr(&view["scores"]), "dB");
    let stages = view["variants"].as_array().unwrap().iter().flat_map(|v| v["stages"].as_array().unwrap());
    for stage in stages {
        assert_eq!(stage["goal"] == "task", stage["iterations"] == 0, "{stage}");
    }
    let later = studio.response("run-view", json!({"run": "run", "after": 5}));
    assert_eq!(later["steps"][0]["step"], 6);
    let page = studio.response("report-so-far", json!({"run": "run"}));
    let html = page["html"].as_str().unwrap();
    for text in ["<h2>At work</h2>", "not begun", "Over the run", "The rest takes "] {
        assert!(html.contains(text), "{text}");
    }
    // Nothing is written for it.
    assert!(!run.join("report.html").exists());
    let port = studio.address.rsplit_once(':').unwrap().1;
    run_fails(
        folder.path(),
        &["report", "run", "--watch", "--no-open", "--port", port],
        2,
        &[port, "--port"],
    );
    run_fails(folder.path(), &["report", "nothing", "--watch"], 2, &["nothing", "not the folder of a run"]);

    run_ok(folder.path(), &["design", "--resume", "run"]);
    let view = studio.response("run-view", json!({"run": "run"}));
    assert_eq!(view["row"]["state"], "finished");
    assert_eq!((&view["time_left"], unit_of_psnr(&view["row"]["scores"])), (&Value::Null, json!("dB")));
    assert_eq!(view["cameras"].as_array().unwrap().len(), 3);
    assert!(
        !view["lenses"].as_array().unwrap().is_empty() && !view["pictures"].as_array().unwrap().is_empty()
    );
    let report = read(&run.join("report.html"));
    assert!(
        studio.response("report-so-far", json!({"run": "run"}))["html"] == *report,
        "another page than the report"
    );
    assert!(studio.get("/files/run/report.html") == ("200".to_owned(), report));
    assert_eq!(studio.get("/files/run/../../x.html").0, "403");
    assert!(studio.get("/sheets").1.contains("run/report.html"));
    let runs = studio.response("runs", json!({"folder": "."}));
    assert_eq!(
        (runs["runs"][0]["run"].as_str(), runs["runs"][0]["state"].as_str()),
        (Some("./run"), Some("finished"))
    );
}

#[test]
fn a_design_outlives_its_studio_and_the_next_one_stops_and_resumes_it() {
    let folder = tempfile::tempdir().unwrap();
    // So long that it is at work when the next studio looks.
    let mut table: toml::Table = tiny_experiment().parse().unwrap();
    table["training"].as_table_mut().unwrap().insert("steps".to_owned(), toml::Value::Integer(5_000));
    std::fs::write(folder.path().join("long.toml"), toml::to_string(&table).unwrap()).unwrap();
    let studio = Studio::start(folder.path(), &["studio", "long.toml"]);
    let first: Value = serde_json::from_str(&studio.get("/state").1).unwrap();
    assert_eq!(first["first"]["experiment"], "long.toml");
    let config = studio.response(
        "design-config",
        json!({"run": {"experiment": "long.toml", "changes": {"set": {"training.batch": 2}}}}),
    );
    assert_eq!(
        (&config["values"]["training"]["batch"], &config["values"]["training"]["steps"]),
        (&json!(2), &json!(5_000))
    );
    assert_eq!(config["is_taken"], false);
    let refused = studio.call(json!({"job": "design-config", "request": {"run": {"experiment": "long.toml", "changes": {"set": {"training.batch": 0}}}}}));
    assert!(refused["error"].to_string().contains("training.batch"), "{refused}");

    let request = json!({"run": {"new": {"experiment": "long.toml", "out": "runs/long"}}});
    let begun = studio.call(json!({"job": "design", "request": request, "process": true}));
    let log = begun["response"]["log"].as_str().unwrap_or_else(|| panic!("{begun}")).to_owned();
    let process = begun["response"]["process"].as_u64().unwrap();
    let events = folder.path().join("runs/long/events.jsonl");
    let taken = || std::fs::read_to_string(&events).unwrap_or_default().lines().count();
    until("the design does not begin", || taken() > 2);
    assert!(studio.get(&format!("/files/{log}")).1.contains("\"event\":\"note\""));
    drop(studio);

    let studio = Studio::start(folder.path(), &["studio", "runs/long"]);
    let before = taken();
    until("the design ended with its studio", || taken() > before + 1);
    let view = studio.response("run-view", json!({"run": "runs/long"}));
    assert_eq!(
        (view["row"]["state"].as_str(), view["holder"]["pid"].as_u64()),
        (Some("running"), Some(process))
    );
    let stopped = studio.response("design-stop", json!({"run": "runs/long"}));
    assert_eq!(stopped["holder"]["pid"], process);
    let state = || studio.response("run-view", json!({"run": "runs/long"}))["row"]["state"].clone();
    until("the design does not stop", || state() == "stopped");
    assert_eq!(studio.response("design-stop", json!({"run": "runs/long"}))["holder"], Value::Null);
    let error = read(&folder.path().join(&log)).lines().last().unwrap().to_owned();
    assert!(error.contains("\"kind\":\"stopped\""), "{error}");
    // It goes on from where it was.
    let step = |view: &Value| view["row"]["step"].as_u64().unwrap();
    let at = step(&studio.response("run-view", json!({"run": "runs/long"})));
    let again = json!({"run": {"resume": {"run": "runs/long"}}});
    studio.call(json!({"job": "design", "request": again, "process": true}));
    until("the design does not go on", || {
        step(&studio.response("run-view", json!({"run": "runs/long"}))) > at + 1
    });
    studio.response("design-stop", json!({"run": "runs/long"}));
    until("the design does not stop again", || state() == "stopped");
}

#[test]
fn a_run_that_this_process_does_not_own_is_stopped_by_a_call() {
    let folder = tempfile::tempdir().unwrap();
    write_tiny(folder.path());
    let (mut child, _) = started_from(folder.path(), 1);
    let call = json!({"format": 1, "job": "design-stop", "request": {"run": "run"}});
    std::fs::write(folder.path().join("call.json"), call.to_string()).unwrap();
    let stopped = run_ok(folder.path(), &["call", "call.json"]).json();
    assert_eq!(stopped["holder"]["pid"], child.id());
    // The end of a design that wrote its checkpoint.
    assert_eq!(child.wait().unwrap().code(), Some(75));
}

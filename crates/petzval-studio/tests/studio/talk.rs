//! Calls over the WebSocket: answers, live channels, cancelling, several pages, slow readers, and what is kept over a restart.

use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use crate::client::Server;

const LENS: &str = "cooke-triplet-nominal";

#[test]
fn calls_are_answered_and_what_cannot_be_read_is_named() {
    let server = Server::start();
    let mut page = server.page();
    let view = page.call("lens-view", json!({"lens": LENS, "quick": true}));
    assert_eq!(view["spots"].as_array().unwrap().len(), view["fields_deg"].as_array().unwrap().len());
    assert!(view["problems"].as_array().unwrap().is_empty());
    for (message, says) in [
        ("{", "message: "),
        ("{\"id\": 5}", "message: the key `job` is missing"),
        ("{\"id\": 5, \"jbo\": \"lens-list\"}", "\"id\":5"),
        ("{\"id\": 5, \"job\": \"lens-vieww\"}", "did you mean `lens-view`?"),
        ("{\"id\": 5, \"job\": \"lens-view\", \"request\": {\"lenz\": 1}}", "missing"),
        ("{\"id\": 5, \"job\": \"lens-edit\", \"request\": {\"lens\": {\"toml\": \"x\"}}}", "lens (inline)"),
    ] {
        page.say(message).unwrap();
        let said = page.hear().to_string();
        assert!(said.contains("\"error\"") && said.contains(says), "{message}: {said}");
    }
    // The page goes on.
    page.call("photo-list", json!({}));
}

#[test]
fn a_live_channel_has_one_call_in_flight() {
    let server = Server::start();
    let mut page = server.page();
    let first = page.send("camera-view", json!({"lens": LENS, "size": [64, 64]}), Some("camera"));
    let second = page.send("lens-view", json!({"lens": LENS, "quick": true}), Some("camera"));
    let other = page.send("lens-view", json!({"lens": LENS, "quick": true}), Some("lens"));
    let mut ends: Vec<Value> = Vec::new();
    while ends.len() < 3 {
        let message = page.hear();
        if message.get("event").is_none() {
            ends.push(message);
        }
    }
    let of = |id: u64| ends.iter().find(|end| end["id"] == id).unwrap();
    assert!(of(second)["error"]["message"].as_str().unwrap().contains("in flight"));
    assert!(of(first)["response"]["rgb"].is_string() && of(other)["response"]["toml"].is_string());
    // The channel is free as soon as the answer is there.
    let next = page.send("lens-view", json!({"lens": LENS, "quick": true}), Some("camera"));
    assert!(page.end_of(next).get("response").is_some());
}

#[test]
fn pictures_come_as_bytes_where_a_call_says_so() {
    let server = Server::start();
    let mut page = server.page();
    let request = json!({"lens": LENS, "size": [32, 64], "quick": true, "raw": true});
    let response = page.call("camera-view", request.clone());
    let decoded = |key: &str| STANDARD.decode(response[key].as_str().unwrap()).unwrap();
    let call = json!({"id": 77, "job": "camera-view", "request": request, "bytes": ["rgb", "raw"]});
    page.say(&call.to_string()).unwrap();
    let payload = loop {
        let (kind, payload) = page.frame().unwrap();
        if kind == 2 {
            break payload;
        }
    };
    let length = u32::from_le_bytes(payload[..4].try_into().unwrap()) as usize;
    let (text, behind) = payload[4..].split_at(length);
    let message: Value = serde_json::from_slice(text).unwrap();
    let (rgb, raw) = (decoded("rgb"), decoded("raw"));
    assert_eq!((message["id"].as_u64(), rgb.len(), raw.len()), (Some(77), 3 * 32 * 64, 32 * 64));
    assert_eq!(message["response"]["rgb"], json!([0, rgb.len()]));
    assert_eq!(message["response"]["raw"], json!([rgb.len(), raw.len()]));
    assert_eq!(behind, [rgb, raw].concat());
}

/// An optimisation that takes minutes.
fn optimisation(out: &str) -> Value {
    let goal = json!({"vary": ["curvature", "air", "thickness"]});
    json!({"start": {"new": {"lens": LENS, "out": out, "goal": goal, "global": true}}, "rounds": 1_000_000})
}

#[test]
fn a_job_is_cancelled_with_its_best_lens_and_others_are_answered_meanwhile() {
    let server = Server::start();
    let mut page = server.page();
    let id = page.send("lens-optimize", optimisation("cancelled"), None);
    // Wait until it is at work.
    while page.hear()["id"] != id {}
    let mut other = server.page();
    other.call("lens-view", json!({"lens": LENS, "quick": true}));
    page.cancel(id);
    let end = page.end_of(id);
    assert_eq!(end["error"]["kind"], "stopped", "{end}");
    let lens = end["error"]["stopped"]["response"]["found"]["lens"].as_str().unwrap().to_owned();
    assert!(page.call("lens-edit", json!({"lens": lens}))["text"].as_str().unwrap().contains("[[surface]]"));
}

#[test]
fn a_page_that_goes_ends_its_jobs() {
    let server = Server::start();
    let mut page = server.page();
    let id = page.send("lens-optimize", optimisation("left"), None);
    while page.hear()["id"] != id {}
    drop(page);
    // Its history no longer grows.
    let size = || {
        std::fs::read_dir(server.folder.join("left"))
            .unwrap()
            .flatten()
            .map(|f| f.metadata().unwrap().len())
            .sum::<u64>()
    };
    let began = Instant::now();
    let mut before = u64::MAX;
    while size() != before {
        assert!(began.elapsed() < Duration::from_secs(60), "the job goes on without its page");
        before = size();
        std::thread::sleep(Duration::from_secs(2));
    }
}

#[test]
fn a_slow_reader_delays_no_other() {
    let server = Server::start();
    let mut slow = server.page();
    // Answers of megabytes, of which nothing is read.
    for _ in 0..8 {
        slow.send("lens-view", json!({"lens": LENS}), None);
    }
    let mut page = server.page();
    for _ in 0..5 {
        page.call("lens-view", json!({"lens": LENS, "quick": true, "parts": ["layout"]}));
    }
    drop(slow);
    page.call("photo-list", json!({}));
}

#[test]
fn what_was_saved_is_there_after_a_restart_under_another_token() {
    let server = Server::start();
    let edits = json!([{"edit": "radius", "surface": 1, "radius_mm": 23.456}]);
    let mut page = server.page();
    let edited = page.call("lens-edit", json!({"lens": LENS, "edits": edits}))["text"].clone();
    page.call("lens-convert", json!({"from": {"toml": edited}, "to": "kept.toml"}));
    let token = server.studio.token().to_owned();
    drop((page, server));
    let server = Server::start();
    assert_ne!(server.studio.token(), token);
    let state = server.answer_to("GET /state", &[("Cookie", &server.cookie())], &[]);
    assert!(state.contains("\"kept.toml\""), "{state}");
    assert_eq!(server.page().call("lens-edit", json!({"lens": "kept.toml"}))["text"], edited);
}

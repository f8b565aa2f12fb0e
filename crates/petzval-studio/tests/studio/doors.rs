//! Who is let in, and what is refused.

use std::io::{Read, Write};
use std::net::TcpStream;

use serde_json::json;

use crate::client::Server;

fn status(answer: &str) -> &str {
    answer.split(' ').nth(1).unwrap_or(answer)
}

#[test]
fn the_token_opens_the_page_and_its_cookie_the_rest() {
    let server = Server::start();
    let page = server.answer_to(&format!("GET /?token={}", server.studio.token()), &[], &[]);
    assert_eq!(status(&page), "200");
    let header =
        |name: &str| page.lines().find(|line| line.to_lowercase().starts_with(name)).unwrap().to_owned();
    let cookie = header("set-cookie");
    assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"), "{cookie}");
    assert!(header("content-security-policy").contains("frame-ancestors 'none'"));
    assert!(page.contains("<div id=\"app\">") && page.contains("Petzval"));
    // Every part that the page names is there.
    let parts: Vec<&str> = page
        .split('"')
        .filter_map(|part| part.strip_prefix("./"))
        .filter(|p| p.starts_with("assets/"))
        .collect();
    assert!(parts.len() >= 2, "{page}");
    let known = server.cookie();
    for part in parts {
        let line = format!("GET /{part}");
        assert_eq!(status(&server.answer_to(&line, &[("Cookie", &known)], &[])), "200", "{part}");
        assert_eq!(status(&server.answer_to(&line, &[], &[])), "403", "{part}");
    }
    let state = server.answer_to("GET /state", &[("Cookie", &known)], &[]);
    let state: serde_json::Value = serde_json::from_str(state.split("\r\n\r\n").nth(1).unwrap()).unwrap();
    assert!(state["opened"][0]["toml"].as_str().unwrap().contains("[[surface]]"));
}

#[test]
fn bad_tokens_foreign_origins_and_hosts_are_refused() {
    let server = Server::start();
    let (known, host) = (server.cookie(), server.host());
    let own = format!("http://{host}");
    for (line, headers) in [
        ("GET /", vec![]),
        ("GET /?token=0000", vec![]),
        ("GET /state", vec![("Cookie", "petzval_studio_1=x")]),
        ("GET /", vec![("Cookie", known.as_str()), ("Host", "studio.example.org")]),
        ("GET /state", vec![("Cookie", &known), ("Origin", "http://example.org")]),
        ("POST /upload", vec![("Cookie", &known)]),
        ("POST /upload", vec![("Cookie", &known), ("Origin", "null")]),
        ("POST /upload", vec![("Origin", &own)]),
    ] {
        assert_eq!(status(&server.answer_to(line, &headers, &[])), "403", "{line} {headers:?}");
    }
    for headers in [
        vec![("Origin", own.as_str())],
        vec![("Cookie", "petzval_studio_1=x"), ("Origin", &own)],
        vec![("Cookie", &known), ("Origin", "http://example.org")],
    ] {
        let refused = server.page_with(&headers).err().unwrap();
        assert!(refused.contains("403"), "{refused}");
    }
    // Nothing but the files of the page is found by their names.
    for name in ["/assets/../../Cargo.toml", "/assets/%2e%2e/index.html", "/Cargo.toml", "/assets/"] {
        let found = server.answer_to(&format!("GET {name}"), &[("Cookie", &known)], &[]);
        assert_eq!(status(&found), "404", "{name}");
    }
    assert_eq!(status(&server.answer_to("DELETE /", &[("Cookie", &known), ("Origin", &own)], &[])), "405");
}

#[test]
fn paths_out_of_the_folder_are_refused_whatever_the_job() {
    let server = Server::start();
    let mut page = server.page();
    let foreign = server.folder.parent().unwrap().join("petzval-foreign.toml");
    for request in [
        json!({"from": "cooke-triplet-nominal", "to": "../out.toml"}),
        json!({"from": "cooke-triplet-nominal", "to": foreign}),
        json!({"from": "/etc/passwd", "to": "x.toml"}),
    ] {
        let id = page.send("lens-convert", request.clone(), None);
        let end = page.end_of(id);
        assert!(end["error"]["message"].as_str().unwrap().contains("out of the folder"), "{request}: {end}");
    }
    assert!(!foreign.exists());
    // Within the folder the same is done, and the file can be read again.
    page.call("lens-convert", json!({"from": "cooke-triplet-nominal", "to": "inside.toml"}));
    assert!(server.folder.join("inside.toml").is_file());
    page.call("lens-edit", json!({"lens": "inside.toml"}));
}

#[test]
fn an_experiment_is_named_and_its_text_is_refused() {
    let server = Server::start();
    let mut page = server.page();
    let text = json!({"toml": "photos = \"/etc\"\n"});
    for (job, request) in [
        ("design-config", json!({"run": {"experiment": text}})),
        ("design-check", json!({"run": {"experiment": {"photos": "pictures"}}})),
        ("task-view", json!({"lens": "cooke-triplet-nominal", "experiment": text})),
        ("init", json!({"folder": "own", "from": text})),
    ] {
        let id = page.send(job, request, None);
        let end = page.end_of(id);
        assert!(end["error"]["message"].as_str().unwrap().contains("by its name alone"), "{job}: {end}");
    }
    page.call("design-config", json!({"run": {"experiment": "cooke-triplet-image-quality"}}));
    // The text of a lens names no files: an experiment is fitted to it.
    let lens = petzval_jobs::built_in_assets().text("lens", "lenses", "cooke-triplet-nominal").unwrap().text;
    let config = page.call("design-config", json!({"run": {"experiment": {"toml": lens}}}));
    assert_eq!(config["values"]["lens"], "lens (fitted)");
}

#[test]
fn files_of_the_folder_are_shown_without_an_origin_and_no_other_is() {
    let server = Server::start();
    std::fs::create_dir_all(server.folder.join("some runs")).unwrap();
    std::fs::write(server.folder.join("some runs/sheet.html"), "<p>a sheet").unwrap();
    let known = server.cookie();
    let get = |path: &str| server.answer_to(&format!("GET {path}"), &[("Cookie", &known)], &[]);
    let sheet = get("/files/some%20runs/sheet.html");
    assert!(status(&sheet) == "200" && sheet.ends_with("<p>a sheet"), "{sheet}");
    assert!(sheet.contains("sandbox allow-scripts") && sheet.contains("frame-ancestors 'self'"), "{sheet}");
    assert_eq!(status(&server.answer_to("GET /files/some%20runs/sheet.html", &[], &[])), "403");
    for outside in
        ["/files/../x.html", "/files/%2e%2e/x.html", "/files//etc/passwd.txt", "/files/a/../../x.html"]
    {
        assert_eq!(status(&get(outside)), "403", "{outside}");
    }
    assert!(get("/sheets").contains("some runs/sheet.html"));
    let mut page = server.page();
    let runs = page.call("runs", json!({"folder": "some runs"}));
    assert_eq!(runs, json!({"runs": [], "units": []}));
    let id = page.send("runs", json!({"folder": "../.."}), None);
    assert!(page.end_of(id)["error"]["message"].as_str().unwrap().contains("out of the folder"));
    let id = page.send("runs", json!({"fold": 1}), None);
    assert!(page.end_of(id)["error"]["message"].as_str().unwrap().contains("`fold`: no such key here"));
    // A studio without a program begins no process, and says so.
    page.say(&json!({"id": 99, "job": "design", "process": true}).to_string()).unwrap();
    let refused = page.end_of(99);
    assert!(refused["error"]["message"].as_str().unwrap().contains("begins no processes"), "{refused}");
    // The name of a job becomes part of a path: one that is none is refused before that.
    page.say(&json!({"id": 100, "job": "../../x", "process": true}).to_string()).unwrap();
    let refused = page.end_of(100);
    assert!(refused["error"]["message"].as_str().unwrap().contains("there is no job `../../x`"), "{refused}");
}

#[test]
fn a_picture_of_100_mb_is_refused_and_a_small_one_is_taken() {
    let server = Server::start();
    let (known, own) = (server.cookie(), format!("http://{}", server.host()));
    let headers = [("Cookie", known.as_str()), ("Origin", own.as_str())];
    let huge = server.answer_to("POST /upload", &headers, &vec![0; 100 << 20]);
    assert!(huge.is_empty() || status(&huge) == "413", "{huge}");
    let photo = include_bytes!("../../../petzval-data/data/photos/astronaut.png");
    let taken = server.answer_to("POST /upload", &headers, photo);
    let name: serde_json::Value = serde_json::from_str(taken.split("\r\n\r\n").nth(1).unwrap()).unwrap();
    let mut page = server.page();
    let request =
        json!({"lens": "cooke-triplet-nominal", "photo": name["photo"], "size": [64, 64], "quick": true});
    let view = page.call("camera-view", request);
    assert_eq!((view["height"].clone(), view["enlarged"].clone()), (json!(64), json!(1.0)));
}

#[test]
fn a_message_of_100_mb_ends_its_page_alone() {
    let server = Server::start();
    let mut other = server.page();
    let mut page = server.page();
    // The server may close while the message is still being sent.
    let _refused = page.say(&"x".repeat(100 << 20));
    // Before the end there may be the frame that says why, unless the sending has failed already: 1009.
    while let Ok((kind, payload)) = page.frame() {
        assert_eq!((kind, payload), (8, 1009_u16.to_be_bytes().to_vec()));
    }
    assert!(!other.call("lens-list", json!({}))["lenses"].as_array().unwrap().is_empty());
}

#[test]
fn a_page_reads_why_its_socket_ends() {
    let server = Server::start();
    for (frame, code) in [
        (&[0x81, 0x01, b'x'][..], 1002_u16),
        (&[0x82, 0x81, 0, 0, 0, 0, b'x'], 1003),
        (&[0x81, 0x81, 0, 0, 0, 0, 0xFF], 1007),
        (&[0x81, 0xFF, 0, 0, 0, 0, 6, 0, 0, 0], 1009),
        (&[0x88, 0x80, 0, 0, 0, 0], 1000),
    ] {
        // Several times: whether the end comes before its frame is a matter of chance. Bytes behind the wrong frame change nothing.
        for _ in 0..10 {
            let mut page = server.page();
            page.stream.write_all(&[frame, &[7; 100_000][..]].concat()).unwrap();
            assert_eq!(page.frame().unwrap(), (8, code.to_be_bytes().to_vec()));
            assert_eq!(page.stream.read(&mut [0; 8]).unwrap(), 0);
        }
    }
}

#[test]
fn those_who_only_hold_connections_keep_nobody_out() {
    let server = Server::start();
    let mut page = server.page();
    let mut held: Vec<TcpStream> = Vec::new();
    for i in 0..1000 {
        // The machine may have fewer descriptors than that.
        let Ok(mut stream) = TcpStream::connect(server.studio.address()) else { break };
        if i % 2 == 0 {
            let _gone = stream.write_all(b"GET / HTTP/1.1\r\nHost: ");
        }
        held.push(stream);
    }
    assert!(held.len() > 200, "only {} connections", held.len());
    assert_eq!(status(&server.answer_to("GET /state", &[("Cookie", &server.cookie())], &[])), "200");
    assert!(page.call("photo-list", json!({}))["photos"].as_array().unwrap().len() > 5);
    // The oldest of them were ended.
    held[0].set_read_timeout(Some(std::time::Duration::from_secs(20))).unwrap();
    assert!(matches!(held[0].read(&mut [0; 8]), Ok(0) | Err(_)));
}

//! `serve`: the page, who may ask for it, and what concurrent, repeated, late and abandoned orders do to a campaign.

use std::io::{Read, Write};
use std::net::Shutdown;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::served::{Answer, PATIENCE, Served};
use crate::support::{copy_of, document, lobestone, program};

/// Four postures, X and Y at the tool; a flexible tool is hidden.
const FLEXIBLE_TOOL: &str = "frf-9114";
/// The same kind, nothing hidden.
const CONTROL: &str = "frf-9112";

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn add(effect: &str, head: &str) -> Value {
    json!({ "do": "add", "side": "structure", "effect": effect, "head": head })
}

fn undo(head: &str) -> Value {
    json!({ "do": "undo", "side": "structure", "head": head })
}

fn labels(dir: &Path) -> Value {
    let history = document(&["history", text(dir)]);
    history["revisions"].as_array().unwrap().last().unwrap()["effects"].clone()
}

#[test]
fn the_page_is_for_its_own_browser_only() {
    let folder = copy_of(CONTROL);
    let served = Served::start(folder.path());
    let page = served.get("/");
    assert_eq!(page.status, 200);
    assert!(page.text().contains("frf-9112"));
    for header in [
        "default-src 'none'",
        "frame-ancestors 'none'",
        "nosniff",
        "cache-control: no-store",
    ] {
        assert!(page.head.contains(header), "{header}: {}", page.head);
    }
    for file in ["/page.js", "/begin.js", "/page.css", "/state", "/status"] {
        assert_eq!(served.get(file).status, 200, "{file}");
    }
    // As an attacker's page would have its visitor's browser ask.
    let token = format!("X-Lobestone-Token: {}\r\n", served.token);
    for request in [
        "GET /KEY/ HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n",
        "GET /KEY/state HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n",
        "GET /KEY/ HTTP/1.0\r\n\r\n",
        "GET http://evil.example/KEY/ HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n",
        "GET /KEY/state HTTP/1.1\r\nHost: HOST\r\nOrigin: http://evil.example\r\nConnection: close\r\n\r\n",
        "GET /KEY/ HTTP/1.1\r\nHost: HOST\r\nSec-Fetch-Site: cross-site\r\nConnection: close\r\n\r\n",
        "GET /REPORT/report HTTP/1.1\r\nHost: HOST\r\nSec-Fetch-Site: same-site\r\nConnection: close\r\n\r\n",
        // As somebody else asks who is logged in on this computer, and does not know the address.
        "GET / HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n",
        "GET /state HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n",
        "GET /00000000000000000000000000000000/ HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n",
        "GET /KEY/report HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n",
        "GET /REPORT/ HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n",
        "GET /REPORT/state HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n",
    ] {
        let request = &request
            .replace("KEY", &served.key)
            .replace("REPORT", &served.report_key);
        let answer = served.raw(request);
        assert_eq!(answer.status, 403, "{request}: {}", answer.text());
        for secret in [&served.token, &served.key, &served.report_key] {
            assert!(!answer.text().contains(secret), "{request}");
        }
    }
    let order = r#"{"do": "diagnose", "side": "structure"}"#;
    for headers in [
        format!("Origin: http://evil.example\r\n{token}"),
        format!("Origin: null\r\n{token}"),
        format!("Origin: http://127.0.0.1:1\r\n{token}"),
        format!("Sec-Fetch-Site: cross-site\r\n{token}"),
        "Origin: http://HOST\r\n".into(),
        "X-Lobestone-Token: 00000000000000000000000000000000\r\n".into(),
        String::new(),
    ] {
        let answer = served.post_with(&headers, order);
        assert_eq!(answer.status, 403, "{headers}: {}", answer.text());
    }
    assert_eq!(served.get("/order").status, 405);
    for path in [
        "/report/../../etc/passwd",
        "/report/..%2f..%2fetc%2fpasswd",
        "/report/%2e%2e/%2e%2e/etc/passwd",
        "/report/%252e%252e%252fetc%252fpasswd",
        "/report/..%5c..%5cetc",
        "/page.html",
        "/report//etc/passwd",
        "/report/%2fetc%2fpasswd",
        "/report/campaign.toml",
        "/campaign.toml",
        "/../Cargo.toml",
        "/report/frf-best.png%00",
        "/report/",
        "/report",
    ] {
        let answer = served.get(path);
        assert_eq!(answer.status, 404, "{path}: {}", answer.text());
    }
    let long = format!("{{\"do\": \"refresh\", \"x\": \"{}\"}}", "x".repeat(40_000));
    for (body, status) in [
        ("", 400),
        ("{}", 400),
        (r#"{"do": "refresh", "dir": "/etc"}"#, 400),
        (r#"{"do": "add", "side": "structure", "effect": "payload"}"#, 400),
        (&long, 413),
    ] {
        assert_eq!(served.post_with(&token, body).status, status, "{body:.60}");
    }
    assert!(
        served.get("/status").json()["last"].is_null(),
        "something was done"
    );
    assert!(!folder.path().join("lobestone").exists() && !folder.path().join("report").exists());
}

/// Whoever says nothing, or much too slowly, is shown the door; and many of them do not keep the page from its owner.
#[test]
fn silence_is_not_waited_for() {
    let folder = copy_of(CONTROL);
    let served = Served::start(folder.path());
    let crowd: Vec<_> = (0..100).map(|_| served.connect()).collect();
    let mut slow = served.connect();
    slow.write_all(b"GET / HTTP/1.1\r\nHost: ").unwrap();
    let begun = Instant::now();
    assert_eq!(served.get("/status").status, 200);
    assert!(begun.elapsed() < Duration::from_secs(30), "{:?}", begun.elapsed());
    let mut rest = Vec::new();
    let _ = slow.read_to_end(&mut rest);
    assert!(begun.elapsed() < Duration::from_secs(50), "{:?}", begun.elapsed());
    drop(crowd);
}

/// A cancelled job really ends, leaves the campaign as it was, and the next one begins at once.
#[test]
fn a_job_can_be_cancelled() {
    let folder = copy_of(FLEXIBLE_TOOL);
    let dir = folder.path();
    let served = Served::start(dir);
    for order in [
        json!({ "do": "diagnose", "side": "structure" }),
        add("tool-flexibility", &served.head()),
    ] {
        let number = served.order(&order).json()["number"].clone();
        std::thread::sleep(Duration::from_millis(300));
        assert_eq!(served.cancel(&json!(99)).status, 409);
        let begun = Instant::now();
        let answer = served.cancel(&number);
        let last = served.wait();
        if answer.status == 409 {
            // It was done already.
            assert_eq!(last["ok"], true, "{last}");
            continue;
        }
        assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());
        assert_eq!(
            (&last["ok"], &last["cancelled"]),
            (&json!(false), &json!(true)),
            "{last}"
        );
        let said = last["text"].as_str().unwrap();
        assert!(said.starts_with("cancelled"), "{said}");
        if said.contains("nothing was recorded") {
            let history = document(&["history", text(dir)]);
            assert_eq!(history["revisions"].as_array().unwrap().len(), 0, "{history}");
        }
    }
    served.done(&json!({ "do": "refresh" }));
    assert!(served.side()["now"]["nrms"].as_f64().unwrap() > 0.0);
}

#[test]
fn of_many_clicks_at_once_one_counts_and_undo_takes_it_back() {
    let folder = copy_of(FLEXIBLE_TOOL);
    let dir = folder.path();
    let served = Served::start(dir);
    served.done(&json!({ "do": "refresh" }));
    let before = served.side()["now"]["nrms"].as_f64().unwrap();
    let report = served.get("/report");
    assert_eq!(report.status, 200);
    assert!(report.head.contains("sandbox") && !report.text().contains("1 + tool-flexibility"));

    let head = served.head();
    let order = add("tool-flexibility", &head);
    let clicks: Vec<Answer> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..8).map(|_| scope.spawn(|| served.order(&order))).collect();
        threads.into_iter().map(|t| t.join().unwrap()).collect()
    });
    let with = |status: u16| clicks.iter().filter(move |a| a.status == status);
    assert_eq!((with(202).count(), with(409).count()), (1, 7));
    for refused in with(409) {
        let why = refused.json()["refused"].as_str().unwrap().to_string();
        assert!(
            why.contains("adding tool-flexibility is still running ("),
            "{why}"
        );
    }
    let last = served.wait();
    assert_eq!(last["ok"], true, "{last}");
    assert!(
        last["text"]
            .as_str()
            .unwrap()
            .contains("revision 1: + tool-flexibility"),
        "{last}"
    );
    assert!(
        !last["text"].as_str().unwrap().contains('\u{1b}'),
        "colours of a terminal"
    );

    // The page and the command tell the same.
    let side = served.side();
    let mut told = document(&["history", text(dir)]);
    told["next_step"] = side["history"]["next_step"].clone();
    assert_eq!(side["history"], told);
    let revisions = told["revisions"].as_array().unwrap();
    assert_eq!(revisions.len(), 2);
    let after = revisions[1]["nrms"].as_f64().unwrap();
    assert!(after < 0.1 * before, "{before} {after}");
    let report = served.get("/report").text();
    assert!(report.contains("1 + tool-flexibility"));
    let (_, link) = report.split_once("class=\"file\" href=\"").unwrap();
    let figure = served.get(&format!("/report/{}", link.split('"').next().unwrap()));
    assert_eq!(figure.status, 200);
    assert!(figure.body.starts_with(b"\x89PNG"));

    // The same click again, from a page that shows the state of before.
    let late = served.order(&add("payload", &head));
    assert_eq!(late.status, 409);
    assert!(
        late.text().contains("changed since this page showed it"),
        "{}",
        late.text()
    );

    served.done(&undo(&served.head()));
    let side = served.side();
    assert_eq!(side["can_undo"], false);
    assert_eq!(side["history"]["revisions"].as_array().unwrap().len(), 1);
    let back = side["now"]["nrms"].as_f64().unwrap();
    assert!((back / before - 1.0).abs() < 1e-3, "{before} {back}");
    assert!(!served.get("/report").text().contains("1 + tool-flexibility"));

    // The model is as it was, but the page of then is still an old one.
    assert_eq!(served.order(&add("tool-flexibility", &head)).status, 409);
    // Changed in a terminal: the stamp tells the page, and what it showed no longer counts.
    let (stamp, head) = (served.get("/status").json()["stamp"].clone(), served.head());
    document(&["add", text(dir), "tool-flexibility"]);
    assert_ne!(served.get("/status").json()["stamp"], stamp);
    assert_eq!(served.order(&add("payload", &head)).status, 409);
    assert_eq!(labels(dir), json!(["tool-flexibility"]));
}

#[test]
fn a_terminal_and_the_page_at_the_same_time_lose_nothing() {
    let folder = copy_of(CONTROL);
    let dir = folder.path();
    let served = Served::start(dir);
    let mut terminal = program()
        .args(["add", text(dir), "payload"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let answer = served.order(&add("time-delay", &served.head()));
    let mut said = String::new();
    terminal.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    let mut done = usize::from(terminal.wait().unwrap().success());
    if done == 0 {
        assert!(said.contains("in the meantime"), "{said}");
    }
    if answer.status == 202 {
        let last = served.wait();
        let why = last["text"].as_str().unwrap();
        assert!(last["ok"] == true || why.contains("in the meantime"), "{last}");
        done += usize::from(last["ok"] == true);
    } else {
        assert_eq!(answer.status, 409);
    }
    assert!(done >= 1);
    assert_eq!(labels(dir).as_array().unwrap().len(), done);
}

#[test]
fn what_goes_wrong_is_said_and_the_page_goes_on() {
    let folder = copy_of(CONTROL);
    let dir = folder.path();
    let served = Served::start(dir);
    let answer = served.order(&add("payloud", &served.head()));
    assert_eq!(answer.status, 202);
    let last = served.wait();
    assert_eq!(last["ok"], false);
    assert!(
        last["text"].as_str().unwrap().contains("did you mean payload?"),
        "{last}"
    );
    let wrong_side = served.order(&add("runout", &served.head()));
    assert_eq!(wrong_side.status, 422, "{}", wrong_side.text());
    let nothing = served.order(&undo(&served.head()));
    assert_eq!(nothing.status, 202);
    assert!(
        served.wait()["text"]
            .as_str()
            .unwrap()
            .contains("nothing to undo")
    );
    assert!(!dir.join("lobestone/revisions.json").exists());

    // A client that leaves before the answer: the job is done all the same.
    let body = add("payload", &served.head()).to_string();
    let mut stream = served.connect();
    let head = format!(
        "POST {} HTTP/1.1\r\nHost: {}\r\nX-Lobestone-Token: {}\r\nContent-Length: {}\r\n\r\n{body}",
        served.path("/order"),
        served.host,
        served.token,
        body.len()
    );
    stream.write_all(head.as_bytes()).unwrap();
    stream.shutdown(Shutdown::Both).unwrap();
    drop(stream);
    let end = Instant::now() + PATIENCE;
    while served.get("/status").json()["last"]["number"] != 3 && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(served.wait()["ok"], true);
    assert_eq!(labels(dir), json!(["payload"]));

    let file = dir.join("campaign.toml");
    let toml = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, toml.replace("joints_deg", "joint_deg")).unwrap();
    let problem = served.get("/state").json()["problem"]
        .as_str()
        .unwrap()
        .to_string();
    assert!(
        problem.contains("campaign.toml") && problem.contains("joint_deg"),
        "{problem}"
    );
    served.order(&json!({ "do": "diagnose", "side": "structure" }));
    assert!(served.wait()["text"].as_str().unwrap().contains("joint_deg"));
    std::fs::write(&file, toml).unwrap();
    served.done(&json!({ "do": "refresh" }));
    assert_eq!(served.side()["history"]["revisions"].as_array().unwrap().len(), 2);
}

#[test]
fn a_kill_during_an_order_leaves_a_campaign_that_loads() {
    let folder = copy_of(CONTROL);
    let dir = folder.path();
    for milliseconds in [30, 200, 500] {
        let mut served = Served::start(dir);
        assert_eq!(served.order(&add("payload", &served.head())).status, 202);
        std::thread::sleep(Duration::from_millis(milliseconds));
        served.child.kill().unwrap();
        drop(served);
        let history = document(&["history", text(dir)]);
        let count = history["revisions"].as_array().unwrap().len();
        assert!(count == 0 || count == 1 || count == 2, "{history}");
        if count == 2 {
            document(&["undo", text(dir)]);
        }
    }
    document(&["add", text(dir), "payload"]);
    let served = Served::start(dir);
    assert_eq!(served.side()["can_undo"], true);
}

/// As Ctrl-C and as the system's own way to end a program; also in the middle of a diagnosis.
#[cfg(unix)]
#[test]
fn it_ends_when_it_is_told_to() {
    let folder = copy_of(CONTROL);
    for (signal, busy) in [("INT", false), ("TERM", true)] {
        let mut served = Served::start(folder.path());
        if busy {
            let order = json!({ "do": "diagnose", "side": "structure" });
            assert_eq!(served.order(&order).status, 202);
        }
        let told = Command::new("kill")
            .args([format!("-{signal}"), served.child.id().to_string()])
            .status()
            .unwrap();
        assert!(told.success());
        let end = Instant::now() + Duration::from_secs(60);
        let status = loop {
            if let Some(status) = served.child.try_wait().unwrap() {
                break status;
            }
            assert!(Instant::now() < end, "it does not end ({signal})");
            std::thread::sleep(Duration::from_millis(20));
        };
        assert_eq!(status.code(), Some(0), "{signal}");
    }
}

#[test]
fn what_cannot_be_served_is_one_clear_error() {
    let folder = copy_of(CONTROL);
    let dir = folder.path();
    let empty = tempfile::tempdir().unwrap();
    let run = lobestone(&["serve", text(empty.path()), "--port", "0"]);
    assert_eq!(run.status, Some(1));
    assert!(
        run.stderr.contains("campaign.toml") && run.stderr.contains("remedy"),
        "{}",
        run.stderr
    );

    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let run = lobestone(&["serve", text(dir), "--port", &port]);
    assert_eq!(run.status, Some(1));
    assert!(
        run.stderr.contains(&port) && run.stderr.contains("--port 0"),
        "{}",
        run.stderr
    );
    assert_eq!(run.stdout, "");

    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(empty.path(), dir.join("lobestone")).unwrap();
        let run = lobestone(&["serve", text(dir), "--port", "0"]);
        assert_eq!(run.status, Some(1));
        assert!(run.stderr.contains("symbolic link"), "{}", run.stderr);
    }
}

/// No terminal after the start: the files come over HTTP, the campaign file is completed and written, and the loop goes on.
#[test]
fn from_nothing_to_a_diagnosis() {
    let measured = copy_of(FLEXIBLE_TOOL);
    let campaign = lobestone::campaign::Campaign::load(measured.path()).unwrap();
    let here = tempfile::tempdir().unwrap();
    let served = Served::from_nothing();
    assert_eq!(served.get("/state").json()["begin"], true);
    let refused = served.order(&json!({ "do": "refresh" }));
    assert_eq!(refused.status, 422, "{}", refused.text());

    let seen = served
        .begin(&json!({ "do": "look", "folder": measured.path() }))
        .json();
    assert_eq!(seen["campaign"], true, "{seen}");
    assert!(
        served
            .begin(&json!({ "do": "look", "folder": "/no/such/folder" }))
            .status
            == 422
    );
    let made = served
        .begin(&json!({ "do": "folder", "parent": here.path(), "name": "cell 9" }))
        .json();
    let dir = std::path::PathBuf::from(made["folder"].as_str().unwrap());
    for frf in &campaign.frfs {
        let path = frf.file.strip_prefix(measured.path()).unwrap();
        let content = std::fs::read(&frf.file).unwrap();
        let sent = served.upload(&dir, &format!("raw/{}", path.to_str().unwrap()), &content);
        assert_eq!(sent.status, 200, "{}", sent.text());
    }

    let mut wish = json!({ "dir": dir });
    let draft = served.begin(&json!({ "do": "draft", "wish": wish })).json();
    assert_eq!(
        draft["frfs"].as_array().unwrap().len(),
        campaign.frfs.len(),
        "{draft}"
    );
    assert_eq!(draft["complete"], false);
    let answer = served.begin(&json!({ "do": "write", "wish": wish }));
    assert_eq!(answer.status, 422, "{}", answer.text());
    assert!(!dir.join("campaign.toml").exists());

    let mut answers = vec![
        json!(["robot", "model", "irb6640"]),
        json!(["frf", "quantity", "receptance"]),
    ];
    for posture in &campaign.postures {
        let angles: Vec<String> = posture.joints_deg.iter().map(f64::to_string).collect();
        answers.push(json!([
            format!("posture {}", posture.id),
            "joints_deg",
            angles.join(" ")
        ]));
    }
    // What is not there (any more) is passed over.
    answers.push(json!(["posture nowhere", "joints_deg", "1 2 3 4 5 6"]));
    wish["answers"] = json!(answers);
    wish["name"] = json!("from nothing");
    let draft = served.begin(&json!({ "do": "draft", "wish": wish })).json();
    assert_eq!(
        (&draft["complete"], &draft["problem"]),
        (&json!(true), &Value::Null),
        "{}",
        draft["missing"]
    );
    let pictures = draft["pictures"].as_object().unwrap();
    assert_eq!(pictures.len(), campaign.postures.len());
    assert!(
        pictures
            .values()
            .all(|svg| svg.as_str().unwrap().starts_with("<svg "))
    );
    assert!(
        draft["guessed"]
            .as_array()
            .unwrap()
            .iter()
            .all(|g| !g["why"].as_str().unwrap().is_empty())
    );

    let written = served.begin(&json!({ "do": "write", "wish": wish }));
    assert_eq!(written.status, 200, "{}", written.text());
    let toml = std::fs::read_to_string(dir.join("campaign.toml")).unwrap();
    // A second time nothing is replaced.
    let again = served.begin(&json!({ "do": "write", "wish": wish }));
    assert_eq!(again.status, 422, "{}", again.text());
    assert!(again.text().contains("is there already"), "{}", again.text());
    assert_eq!(std::fs::read_to_string(dir.join("campaign.toml")).unwrap(), toml);

    served.done(&json!({ "do": "refresh" }));
    assert_eq!(served.get("/report").status, 200);
    served.done(&json!({ "do": "diagnose", "side": "structure" }));
    let side = served.side();
    assert_eq!(
        side["diagnosis"]["effect"], "tool-flexibility",
        "{}",
        side["diagnosis"]["answer"]
    );
    served.done(&add("tool-flexibility", &served.head()));
    served.done(&undo(&served.head()));

    // Back to the beginning, and to another campaign.
    assert_eq!(served.begin(&json!({ "do": "leave" })).status, 200);
    assert_eq!(served.get("/state").json()["begin"], true);
    assert_eq!(
        served
            .begin(&json!({ "do": "open", "dir": measured.path() }))
            .status,
        200
    );
    assert_eq!(served.get("/state").json()["can_leave"], true);
}

#[test]
fn files_from_the_page_replace_nothing_and_stay_where_they_belong() {
    // One folder deeper than the temporary one: what lies next to it is nobody else's.
    let around = tempfile::tempdir().unwrap();
    let here = around.path().join("here");
    std::fs::create_dir(&here).unwrap();
    let served = Served::from_nothing();
    let order = json!({ "do": "folder", "parent": here, "name": "new" });
    for headers in ["", "X-Lobestone-Token: 0\r\n", "Origin: http://evil.example\r\n"] {
        assert_eq!(
            served
                .post_to("/begin", headers, order.to_string().as_bytes())
                .status,
            403,
            "{headers}"
        );
        assert_eq!(
            served.post_to("/upload", headers, b"{}\nx").status,
            403,
            "{headers}"
        );
        assert_eq!(
            served.post_to("/cancel", headers, b"{\"number\": 1}").status,
            403,
            "{headers}"
        );
    }
    assert_eq!(std::fs::read_dir(&here).unwrap().count(), 0);
    let made = served.begin(&order).json();
    let dir = std::path::PathBuf::from(made["folder"].as_str().unwrap());
    assert_eq!(served.begin(&order).status, 422);
    for name in ["..", "a/b", "", "../up", "/tmp/x", ".hidden"] {
        let answer = served.begin(&json!({ "do": "folder", "parent": here, "name": name }));
        assert_eq!(answer.status, 422, "{name}: {}", answer.text());
    }
    assert_eq!(served.upload(&dir, "frf/p1.csv", b"first").status, 200);
    let second = served.upload(&dir, "frf/p1.csv", b"second");
    assert_eq!(second.status, 422);
    assert!(second.text().contains("is there already"), "{}", second.text());
    assert_eq!(std::fs::read(dir.join("frf/p1.csv")).unwrap(), b"first");
    for name in [
        "../x",
        "/etc/x",
        "a/../../x",
        "a\\..\\x",
        ".ssh/x",
        "",
        "frf/",
        "frf/p1.csv/x",
    ] {
        assert_eq!(served.upload(&dir, name, b"x").status, 422, "{name}");
    }
    // Neither a folder that nobody opened on the page, nor one behind a link.
    assert_eq!(served.upload(&here, "x", b"x").status, 422);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&here, dir.join("out")).unwrap();
        assert_eq!(served.upload(&dir, "out/x", b"x").status, 422);
    }
    assert!(!here.join("x").exists() && !around.path().join("x").exists());
    // Too much is refused before it is read.
    let large = format!(
        "POST {} HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\nContent-Length: 300000000\r\nX-Lobestone-Token: {}\r\n\r\n",
        served.path("/upload"),
        served.token
    );
    assert_eq!(served.raw(&large).status, 413);
    for body in ["", "{}", r#"{"do": "look", "file": "x"}"#, r#"{"do": "delete"}"#] {
        assert_eq!(
            served
                .post_to(
                    "/begin",
                    &format!("X-Lobestone-Token: {}\r\n", served.token),
                    body.as_bytes()
                )
                .status,
            400,
            "{body}"
        );
    }
    // A page that was started for one campaign has no beginning.
    let folder = copy_of(CONTROL);
    let one = Served::start(folder.path());
    assert_eq!(one.begin(&json!({ "do": "leave" })).status, 422);
    assert_eq!(one.upload(folder.path(), "x", b"x").status, 422);
}

/// The page in a real browser (tests/browser/serve.py); with LOBESTONE_SCREENSHOTS set to a folder, pictures are put there.
#[test]
fn a_browser_diagnoses_adds_and_takes_back() {
    let folder = copy_of(FLEXIBLE_TOOL);
    let served = Served::start(folder.path());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser/serve.py");
    let mut command = Command::new("python3");
    command
        .arg(script)
        .arg(format!("http://{}{}", served.host, served.path("/")));
    command.args(std::env::var_os("LOBESTONE_SCREENSHOTS"));
    let run = match command.output() {
        Ok(run) => run,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            eprintln!("skipped: no python3 here");
            return;
        }
        Err(e) => panic!("{e}"),
    };
    let said = String::from_utf8_lossy(&run.stdout);
    if run.status.code() == Some(77) {
        eprintln!("{said}");
        return;
    }
    assert!(
        run.status.success(),
        "{said}{}",
        String::from_utf8_lossy(&run.stderr)
    );
    let told: Value = serde_json::from_str(&said).unwrap();
    assert!(
        told["verdict"].as_str().unwrap().contains("tool-flexibility"),
        "{told}"
    );
    // It was added and taken back.
    let history = document(&["history", text(folder.path())]);
    assert_eq!(history["revisions"].as_array().unwrap().len(), 1);
    assert_eq!(history["undone"].as_array().unwrap().len(), 1);
}

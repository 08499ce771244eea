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
    for file in ["/page.js", "/page.css", "/state", "/status"] {
        assert_eq!(served.get(file).status, 200, "{file}");
    }
    // As an attacker's page would have its visitor's browser ask.
    let token = format!("X-Lobestone-Token: {}\r\n", served.token);
    for request in [
        "GET / HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n",
        "GET /state HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n",
        "GET / HTTP/1.0\r\n\r\n",
        "GET http://evil.example/ HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n",
        "GET /state HTTP/1.1\r\nHost: HOST\r\nOrigin: http://evil.example\r\nConnection: close\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: HOST\r\nSec-Fetch-Site: cross-site\r\nConnection: close\r\n\r\n",
        "GET /report HTTP/1.1\r\nHost: HOST\r\nSec-Fetch-Site: same-site\r\nConnection: close\r\n\r\n",
    ] {
        let answer = served.raw(request);
        assert_eq!(answer.status, 403, "{request}: {}", answer.text());
        assert!(!answer.text().contains(&served.token), "{request}");
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
        "POST /order HTTP/1.1\r\nHost: {}\r\nX-Lobestone-Token: {}\r\nContent-Length: {}\r\n\r\n{body}",
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

/// The page in a real browser (tests/browser/serve.py); with LOBESTONE_SCREENSHOTS set to a folder, pictures are put there.
#[test]
fn a_browser_diagnoses_adds_and_takes_back() {
    let folder = copy_of(FLEXIBLE_TOOL);
    let served = Served::start(folder.path());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser/serve.py");
    let mut command = Command::new("python3");
    command.arg(script).arg(format!("http://{}/", served.host));
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

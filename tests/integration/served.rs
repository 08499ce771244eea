//! The program serving a campaign, and a browser of plain sockets.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::program;

/// For a diagnosis on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(300);

/// The program serving a campaign, until this is dropped.
pub struct Served {
    pub child: Child,
    pub host: String,
    /// First part of the page's path.
    pub key: String,
    /// The same of the report's.
    pub report_key: String,
    pub token: String,
    /// What it says on stderr.
    said: tempfile::NamedTempFile,
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub struct Answer {
    pub status: u16,
    /// In small letters.
    pub head: String,
    pub body: Vec<u8>,
}

impl Answer {
    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }

    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|e| panic!("{e}: {}", self.text()))
    }
}

impl Served {
    pub fn start(dir: &Path) -> Served {
        Self::started(&[dir.to_str().unwrap()])
    }

    /// Without a folder.
    pub fn from_nothing() -> Served {
        Self::started(&[])
    }

    fn started(arguments: &[&str]) -> Served {
        let errors = tempfile::NamedTempFile::new().unwrap();
        let mut child = program()
            .arg("serve")
            .args(arguments)
            .args(["--port", "0", "--json"])
            .stdout(Stdio::piped())
            .stderr(errors.reopen().unwrap())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap())
            .read_line(&mut line)
            .unwrap();
        let said: Value = serde_json::from_str(&line).unwrap_or_else(|e| panic!("{e}: {line}"));
        let host = format!("127.0.0.1:{}", said["port"]);
        let url = said["url"].as_str().unwrap();
        let key = url
            .strip_prefix(&format!("http://{host}/"))
            .and_then(|rest| rest.strip_suffix('/'));
        let mut served = Served {
            child,
            key: key.expect("an address with a key").to_string(),
            host,
            report_key: String::new(),
            token: String::new(),
            said: errors,
        };
        let page = served.get("/").text();
        let meta = |name: &str| {
            let (_, rest) = page.split_once(&format!("name=\"{name}\" content=\"")).unwrap();
            rest.split('"').next().unwrap().replace("&#x2f;", "/")
        };
        served.token = meta("token");
        served.report_key = meta("report")
            .trim_matches('/')
            .split('/')
            .next()
            .unwrap()
            .to_string();
        served
    }

    /// What it said on stderr so far.
    pub fn said(&self) -> String {
        std::fs::read_to_string(self.said.path()).unwrap()
    }

    /// Memory of the server in kB, by its name in `/proc/PID/status` (`VmRSS`, `VmHWM`); 0 where the system does not say.
    pub fn memory_kb(&self, name: &str) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap_or_default();
        let line = status
            .lines()
            .find_map(|l| l.strip_prefix(name)?.strip_prefix(':'));
        line.and_then(|l| l.trim().split(' ').next()?.parse().ok())
            .unwrap_or(0)
    }

    /// The whole path of what the page or the report asks for.
    pub fn path(&self, path: &str) -> String {
        let report = path == "/report" || path.starts_with("/report/");
        format!("/{}{path}", if report { &self.report_key } else { &self.key })
    }

    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        stream
    }

    /// Sends `request` as it is (but for `HOST`) and reads the answer to its end.
    pub fn raw(&self, request: &str) -> Answer {
        self.raw_bytes(request.replace("HOST", &self.host).as_bytes())
    }

    fn raw_bytes(&self, request: &[u8]) -> Answer {
        let mut stream = self.connect();
        // A server that refuses a long body closes before it has read it all.
        let _ = stream.write_all(request);
        let mut answer = Vec::new();
        // A server that refuses a long body closes before it has read it all.
        let _ = stream.read_to_end(&mut answer);
        let end = answer.windows(4).position(|w| w == b"\r\n\r\n").expect("a head");
        let head = String::from_utf8_lossy(&answer[..end]).into_owned();
        Answer {
            status: head[9..12].parse().unwrap(),
            head: head.to_lowercase(),
            body: answer[end + 4..].to_vec(),
        }
    }

    pub fn get(&self, path: &str) -> Answer {
        self.raw(&format!(
            "GET {} HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n",
            self.path(path)
        ))
    }

    pub fn post_with(&self, headers: &str, body: &str) -> Answer {
        self.post_to("/order", headers, body.as_bytes())
    }

    pub fn post_to(&self, path: &str, headers: &str, body: &[u8]) -> Answer {
        let head = format!(
            "POST {} HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\nContent-Length: {}\r\n{headers}\r\n",
            self.path(path),
            body.len()
        );
        self.raw_bytes(&[head.replace("HOST", &self.host).as_bytes(), body].concat())
    }

    pub fn own_headers(&self) -> String {
        format!(
            "Origin: http://{}\r\nX-Lobestone-Token: {}\r\n",
            self.host, self.token
        )
    }

    /// As the page asks.
    pub fn begin(&self, request: &Value) -> Answer {
        self.post_to("/begin", &self.own_headers(), request.to_string().as_bytes())
    }

    pub fn upload(&self, folder: &Path, name: &str, content: &[u8]) -> Answer {
        let line = serde_json::json!({ "folder": folder, "name": name }).to_string() + "\n";
        self.post_to(
            "/upload",
            &self.own_headers(),
            &[line.as_bytes(), content].concat(),
        )
    }

    pub fn cancel(&self, number: &Value) -> Answer {
        let body = serde_json::json!({ "number": number }).to_string();
        self.post_to("/cancel", &self.own_headers(), body.as_bytes())
    }

    pub fn order(&self, order: &Value) -> Answer {
        self.post_with(&self.own_headers(), &order.to_string())
    }

    pub fn head(&self) -> String {
        self.side()["head"].as_str().unwrap().to_string()
    }

    pub fn side(&self) -> Value {
        self.get("/state").json()["sides"][0].clone()
    }

    /// What came of the last job, when nothing is being done any more.
    pub fn wait(&self) -> Value {
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            let status = self.get("/status").json();
            if status["job"].is_null() {
                return status["last"].clone();
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        panic!("the job does not end");
    }

    /// An order that must be taken, done to its end.
    pub fn done(&self, order: &Value) -> Value {
        let answer = self.order(order);
        assert_eq!(answer.status, 202, "{order}: {}", answer.text());
        let last = self.wait();
        assert_eq!(last["ok"], true, "{order}: {last}");
        last
    }
}

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
    pub token: String,
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
        let mut child = program()
            .args(["serve", dir.to_str().unwrap(), "--port", "0", "--json"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap())
            .read_line(&mut line)
            .unwrap();
        let said: Value = serde_json::from_str(&line).unwrap_or_else(|e| panic!("{e}: {line}"));
        let host = format!("127.0.0.1:{}", said["port"]);
        assert_eq!(said["url"], format!("http://{host}/"));
        let mut served = Served {
            child,
            host,
            token: String::new(),
        };
        let page = served.get("/").text();
        let (_, rest) = page.split_once("name=\"token\" content=\"").unwrap();
        served.token = rest[..32].to_string();
        served
    }

    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        stream
    }

    /// Sends `request` as it is (but for `HOST`) and reads the answer to its end.
    pub fn raw(&self, request: &str) -> Answer {
        let mut stream = self.connect();
        stream
            .write_all(request.replace("HOST", &self.host).as_bytes())
            .unwrap();
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
            "GET {path} HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n"
        ))
    }

    pub fn post_with(&self, headers: &str, body: &str) -> Answer {
        self.raw(&format!(
            "POST /order HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\nContent-Length: {}\r\n{headers}\r\n{body}",
            body.len()
        ))
    }

    pub fn order(&self, order: &Value) -> Answer {
        let headers = format!(
            "Origin: http://{}\r\nX-Lobestone-Token: {}\r\n",
            self.host, self.token
        );
        self.post_with(&headers, &order.to_string())
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

//! `serve` among crowds: thousands that connect and say nothing, requests that are too large or never end. It goes on answering its own
//! page, and takes no memory for strangers.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::served::{Answer, Served};
use crate::support::copy_of;

const CONTROL: &str = "frf-9112";
/// Connections that stay half open, and what a system must allow for fewer of them.
const CROWD: usize = 5000;
const SMALL_CROWD: usize = 2000;
/// Memory that the server may take for all of them, kB.
const MEMORY_KB: u64 = 32 << 10;
/// In which a good browser is answered while they come.
const ANSWERED: Duration = Duration::from_secs(10);

/// Connections of another process, so that this one does not run out of files. Half of them say nothing, half begin a request.
struct Crowd {
    child: Child,
    done: tempfile::TempDir,
}

impl Crowd {
    /// `None` where the system does not allow so many files.
    fn of(count: usize, host: &str) -> Option<Crowd> {
        let done = tempfile::tempdir().unwrap();
        let script = format!(
            "ulimit -n {} && exec \"$0\" --ignored --exact crowd::connects_and_waits",
            count + 100
        );
        let allowed = Command::new("sh")
            .args(["-c", &format!("ulimit -n {}", count + 100)])
            .status();
        if !allowed.is_ok_and(|status| status.success()) {
            return None;
        }
        let child = Command::new("sh")
            .args(["-c", &script])
            .arg(std::env::current_exe().unwrap())
            .env("CROWD_HOST", host)
            .env("CROWD_COUNT", count.to_string())
            .env("CROWD_DONE", done.path().join("done"))
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        Some(Crowd { child, done })
    }

    fn has_come(&self) -> bool {
        self.done.path().join("done").exists()
    }
}

impl Drop for Crowd {
    fn drop(&mut self) {
        drop(self.child.stdin.take());
        let _ = self.child.wait();
    }
}

/// The crowd itself; run by the test below.
#[test]
#[ignore = "a part of another test"]
fn connects_and_waits() {
    let Ok(host) = std::env::var("CROWD_HOST") else {
        return;
    };
    let count: usize = std::env::var("CROWD_COUNT").unwrap().parse().unwrap();
    let mut open = Vec::new();
    for i in 0..count {
        let mut stream = TcpStream::connect(&host).unwrap();
        if i % 2 == 0 {
            // It may have been shown the door already.
            let _ = stream.write_all(b"GET /state HTTP/1.1\r\nHost: ");
        }
        open.push(stream);
    }
    std::fs::write(std::env::var_os("CROWD_DONE").unwrap(), "").unwrap();
    let _ = std::io::stdin().read_to_end(&mut Vec::new());
}

#[test]
#[cfg(unix)]
fn thousands_of_half_open_connections_keep_nobody_waiting() {
    let folder = copy_of(CONTROL);
    let served = Served::start(folder.path());
    assert_eq!(served.get("/state").status, 200);
    let before = served.memory_kb("VmRSS");
    let crowd = |count: usize| Some((count, Crowd::of(count, &served.host)?));
    let Some((count, crowd)) = [CROWD, SMALL_CROWD].into_iter().find_map(crowd) else {
        eprintln!("skipped: the system allows no {SMALL_CROWD} files");
        return;
    };
    let (mut asked, mut slowest) = (0, Duration::ZERO);
    let deadline = Instant::now() + Duration::from_secs(300);
    let mut once_more = 5;
    while once_more > 0 {
        assert!(Instant::now() < deadline, "the crowd does not come in");
        once_more -= u32::from(crowd.has_come());
        let begun = Instant::now();
        assert_eq!(served.get("/status").status, 200);
        slowest = slowest.max(begun.elapsed());
        asked += 1;
    }
    assert!(slowest < ANSWERED, "{slowest:?}, the slowest of {asked}");
    let grown = served.memory_kb("VmHWM").saturating_sub(before);
    assert!(grown < MEMORY_KB, "{grown} kB");
    // Files: what the server holds open is bounded, too.
    if let Ok(open) = std::fs::read_dir(format!("/proc/{}/fd", served.child.id())) {
        let open = open.count();
        assert!(open < 150, "{open} files are open");
    }
    assert_eq!(served.said(), "");
    println!("{count} half open: {asked} answers, the slowest after {slowest:?}; {grown} kB");
}

/// Requests that are complete and refused do not hold places either: the connection is closed with the answer.
#[test]
fn who_is_refused_takes_no_place() {
    let folder = copy_of(CONTROL);
    let served = Served::start(folder.path());
    let refused: Vec<TcpStream> = (0..200)
        .map(|_| {
            let mut stream = served.connect();
            let request = format!("GET / HTTP/1.1\r\nHost: {}\r\n\r\n", served.host);
            stream.write_all(request.as_bytes()).unwrap();
            stream
        })
        .collect();
    let begun = Instant::now();
    assert_eq!(served.get("/status").status, 200);
    assert!(begun.elapsed() < ANSWERED, "{:?}", begun.elapsed());
    for mut stream in refused {
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 403"), "{answer}");
        assert!(answer.to_lowercase().contains("connection: close"), "{answer}");
    }
}

/// What is sent until the server has heard enough; its answer, where it gave one before it closed.
fn sent_without_end(served: &Served, head: &str, endless: &[u8], most: usize) -> (Option<u16>, usize) {
    let mut stream = served.connect();
    stream
        .write_all(head.replace("HOST", &served.host).as_bytes())
        .unwrap();
    let mut sent = 0;
    while sent < most && stream.write_all(endless).is_ok() {
        sent += endless.len();
    }
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    let status = answer
        .get(9..12)
        .and_then(|s| std::str::from_utf8(s).ok()?.parse().ok());
    (status, sent)
}

#[test]
fn heads_and_bodies_are_bounded() {
    const MOST: usize = 64 << 20;
    let folder = copy_of(CONTROL);
    let served = Served::start(folder.path());
    let before = served.memory_kb("VmHWM");
    let page = served.path("/status");
    let heard = |(status, sent): (Option<u16>, usize), expected: &[u16], what: &str| {
        assert!(sent < MOST, "{what}: {sent} bytes were taken");
        // Closed before all was read, the answer may be lost on the way.
        assert!(status.is_none_or(|s| expected.contains(&s)), "{what}: {status:?}");
    };
    // One header that does not end, headers that do not end, an address that does not end.
    let start = format!("GET {page} HTTP/1.1\r\nHost: HOST\r\n");
    heard(
        sent_without_end(&served, &format!("{start}X-Long: "), &[b'a'; 4096], MOST),
        &[431, 400],
        "a header",
    );
    heard(
        sent_without_end(&served, &start, &b"X-One: more\r\n".repeat(300), MOST),
        &[431, 400],
        "headers",
    );
    heard(
        sent_without_end(&served, "GET /", &[b'a'; 4096], MOST),
        &[414, 431, 400],
        "an address",
    );
    // A little under the limits it is an ordinary request; a little above it is refused with an answer.
    let with = |size: usize| -> Answer {
        served.raw(&format!(
            "{start}X-Long: {}\r\nConnection: close\r\n\r\n",
            "a".repeat(size)
        ))
    };
    assert_eq!(with(8 << 10).status, 200);
    assert_eq!(with(20 << 10).status, 431);
    // Bodies: announced, and without end. Who knows the secret is bounded as well.
    let own = served.own_headers();
    let post = |to: &str| {
        format!(
            "POST {} HTTP/1.1\r\nHost: HOST\r\n{own}Transfer-Encoding: chunked\r\n\r\n",
            served.path(to)
        )
    };
    let piece = [b"8000\r\n".as_slice(), &[b' '; 0x8000], b"\r\n"].concat();
    for to in ["/order", "/cancel", "/begin"] {
        heard(sent_without_end(&served, &post(to), &piece, MOST), &[413], to);
    }
    let announced = format!("{}Content-Length: {}\r\n", own, 300 << 20);
    for to in ["/order", "/begin", "/upload"] {
        let head = format!(
            "POST {} HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n{announced}\r\n",
            served.path(to)
        );
        let (status, _) = sent_without_end(&served, &head, &piece, MOST);
        assert!(status.is_none_or(|s| [413, 422].contains(&s)), "{to}: {status:?}");
    }
    // A stranger's body is not read at all.
    let stranger = "POST /00000000000000000000000000000000/order HTTP/1.1\r\nHost: HOST\r\nTransfer-Encoding: chunked\r\n\r\n";
    heard(
        sent_without_end(&served, stranger, &piece, MOST),
        &[403],
        "a stranger",
    );
    assert_eq!(served.get("/status").status, 200);
    let grown = served.memory_kb("VmHWM").saturating_sub(before);
    assert!(grown < 2 * MEMORY_KB, "{grown} kB");
    assert_eq!(served.said(), "");
}

/// A head or a body that never comes to its end is not waited for.
#[test]
fn what_never_ends_is_given_up() {
    let folder = copy_of(CONTROL);
    let served = Served::start(folder.path());
    let head = format!(
        "POST {} HTTP/1.1\r\nHost: {}\r\n{}Content-Length: 100\r\n\r\n{{\"do\"",
        served.path("/order"),
        served.host,
        served.own_headers()
    );
    let begun = Instant::now();
    let mut waiting: Vec<(TcpStream, &str)> = [
        (head.as_str(), "HTTP/1.1 408"),
        ("GET / HTTP/1.1\r\nHost: ", ""),
        ("", ""),
    ]
    .map(|(begin, expected)| {
        let mut stream = served.connect();
        stream.write_all(begin.as_bytes()).unwrap();
        (stream, expected)
    })
    .into();
    for (stream, expected) in &mut waiting {
        let mut answer = String::new();
        let _ = stream.read_to_string(&mut answer);
        assert!(answer.starts_with(*expected), "{expected}: {answer}");
    }
    assert!(begun.elapsed() < Duration::from_secs(40), "{:?}", begun.elapsed());
    assert_eq!(served.get("/status").status, 200);
    assert!(!Path::new(folder.path()).join("lobestone").exists());
}

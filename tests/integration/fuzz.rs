//! Damaged input: small valid files, mutated from a seed, through every reader, the campaign file, the robot file, the log of
//! revisions, and what browsers ask of `serve`. A run may give an error; it may not panic, take long, take much memory, or give a number that is not finite.
//!
//! The short version runs with the other tests. The long one takes its limits from the environment:
//! `FUZZ_SECONDS=3600 FUZZ_SEED=7 cargo test --release --test integration -- --ignored fuzz_for_long --nocapture`;
//! `FUZZ_CORPUS` names a folder with further files to begin with. What was run is in reports/fuzz.md.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crate::served::Served;
use crate::support::copy_of;

#[path = "../fuzz/promises.rs"]
mod promises;

/// No input of some kilobytes takes so long, even on a busy machine.
const LONGEST: Duration = Duration::from_secs(20);
/// Memory that the process may have above what it began with: the budget of one small file twice, MB.
const MEMORY_MB: u64 = 400;
/// Longest mutated input.
const MOST_BYTES: usize = 1 << 17;

/// SplitMix64 (Steele, Lea and Flood 2014): the same inputs from the same seed on every machine.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Below `n`; 0 for 0.
    fn below(&mut self, n: usize) -> usize {
        if n == 0 {
            0
        } else {
            (self.next() % n as u64) as usize
        }
    }
}

const TOKENS: [&[u8]; 30] = [
    b"nan",
    b"inf",
    b"-1",
    b"    -1\n",
    b"1e308",
    b"-1e300",
    b"1e-320",
    b"0",
    b"99999999999999999999",
    b",",
    b";",
    b"\t",
    b"\n",
    b"\"",
    b"\0",
    b"\xff\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\x00\x00\x00\x80",
    b"time",
    b"frequency_hz",
    b"58b",
    b"2411",
    b"[[frf]]\n",
    b"= 1e300\n",
    b"{\"a\":[",
    b"TREE",
    b"SNOD",
    b"\x1b[2J",
    b"\r",
    b"0x7fffffff",
];

/// One to eight changes of one of the files; one in half of the cases: what is changed little is read further.
fn mutated(random: &mut Random, corpus: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = corpus[random.below(corpus.len())].clone();
    let most = if random.below(2) == 0 { 1 } else { 8 };
    for _ in 0..1 + random.below(most) {
        let at = random.below(bytes.len());
        match random.below(10) {
            0 if !bytes.is_empty() => bytes[at] ^= 1 << random.below(8),
            1 if !bytes.is_empty() => bytes[at] = random.next() as u8,
            2 => bytes.truncate(at),
            3 => {
                let end = (at + 1 + random.below(40)).min(bytes.len());
                bytes.drain(at..end);
            }
            4 => {
                let end = (at + 1 + random.below(200)).min(bytes.len());
                let part = bytes[at..end].to_vec();
                let to = random.below(bytes.len() + 1);
                bytes.splice(to..to, part);
            }
            5 => {
                let token = TOKENS[random.below(TOKENS.len())];
                bytes.splice(at..at, token.iter().copied());
            }
            6 => {
                let token = TOKENS[random.below(TOKENS.len())];
                let end = (at + token.len()).min(bytes.len());
                bytes.splice(at..end, token.iter().copied());
            }
            7 => {
                let other = &corpus[random.below(corpus.len())];
                let from = random.below(other.len());
                let end = (from + random.below(300)).min(other.len());
                bytes.splice(at..at, other[from..end].iter().copied());
            }
            8 if bytes.len() >= at + 8 => {
                // A number that a length or count may be.
                let wide = [1, 2, 4, 8][random.below(4)];
                let value = (1_u64 << random.below(64)).wrapping_sub(random.next() & 1);
                bytes[at..at + wide].copy_from_slice(&value.to_le_bytes()[..wide]);
            }
            _ => {
                // A digit by another one.
                let digit = bytes[at..].iter().position(u8::is_ascii_digit);
                if let Some(k) = digit {
                    bytes[at + k] = b'0' + random.below(10) as u8;
                }
            }
        }
    }
    bytes.truncate(MOST_BYTES);
    bytes
}

/// What is fed with mutated bytes.
#[derive(Clone, Copy, Debug)]
enum Target {
    Reader,
    Campaign,
    Robot,
    Revisions,
    Requests,
}

/// Where inputs are run.
struct Place {
    folder: tempfile::TempDir,
    /// A server of its own, for requests.
    served: Option<Served>,
}

impl Place {
    fn of(target: Target) -> Place {
        let folder = match target {
            Target::Requests => copy_of("frf-9112"),
            _ => tempfile::tempdir().unwrap(),
        };
        if matches!(target, Target::Campaign) {
            // A campaign whose files are missing is not read to its end.
            for toml in corpus_of(target) {
                promises::put_files(folder.path(), &String::from_utf8(toml).unwrap());
            }
        }
        let served = matches!(target, Target::Requests).then(|| Served::start(folder.path()));
        Place { folder, served }
    }

    /// Peak memory, MB: of the server where there is one, else of this process.
    fn peak_mb(&self) -> u64 {
        self.served
            .as_ref()
            .map_or_else(peak_mb, |s| s.memory_kb("VmHWM") / 1024)
    }
}

/// Sends bytes as they are (but for the secrets, which stand in the corpus by their names) and looks at what comes back.
fn asked(served: &Served, bytes: &[u8]) -> bool {
    let mut request = bytes.to_vec();
    for (name, value) in [
        ("HOST", &served.host),
        ("PAGEKEY", &served.key),
        ("REPORTKEY", &served.report_key),
        ("TOKEN", &served.token),
    ] {
        request = replaced(&request, name.as_bytes(), value.as_bytes());
    }
    let mut stream = served.connect();
    // A server that has heard enough closes.
    let _ = stream.write_all(&request);
    let _ = stream.shutdown(std::net::Shutdown::Write);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    if answer.is_empty() {
        return false;
    }
    let shown = || String::from_utf8_lossy(&answer[..answer.len().min(300)]).into_owned();
    assert!(answer.starts_with(b"HTTP/1."), "{}", shown());
    let status = std::str::from_utf8(&answer[9..12])
        .ok()
        .and_then(|s| s.parse::<u16>().ok());
    let status = status.unwrap_or_else(|| panic!("{}", shown()));
    assert!((100..500).contains(&status), "{}", shown());
    (200..300).contains(&status)
}

fn replaced(bytes: &[u8], name: &[u8], value: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len() + value.len());
    let mut rest = bytes;
    while let Some(at) = rest.windows(name.len()).position(|w| w == name) {
        out.extend_from_slice(&rest[..at]);
        out.extend_from_slice(value);
        rest = &rest[at + name.len()..];
    }
    out.extend_from_slice(rest);
    out
}

/// Runs one input; true where it was read.
fn run(target: Target, bytes: &[u8], place: &Place) -> bool {
    let folder = place.folder.path();
    match target {
        Target::Requests => place.served.as_ref().is_some_and(|served| asked(served, bytes)),
        Target::Reader => promises::reads_measurements(bytes),
        Target::Campaign => promises::reads_campaign(folder, bytes),
        Target::Robot => promises::reads_robot(bytes),
        Target::Revisions => promises::reads_revisions(folder, bytes),
    }
}

/// Peak memory of this process, MB; 0 where the system does not say.
fn peak_mb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().split(' ').next()?.parse::<u64>().ok())
        .unwrap_or(0)
        / 1024
}

struct Outcome {
    runs: u64,
    read: u64,
    slowest: Duration,
    memory_mb: u64,
}

/// Runs from `seed` on until `runs` or `time` are over. A panic, a hang or too much memory ends the process with the seed
/// of the run, which repeats it.
fn fuzz(target: Target, corpus: &[Vec<u8>], seed: u64, runs: u64, time: Duration) -> Outcome {
    let place = Place::of(target);
    let (begin, before_mb) = (Instant::now(), place.peak_mb());
    // Milliseconds since the beginning at which the run began, and its number; the watchdog reads them.
    let state = Arc::new((AtomicU64::new(0), AtomicU64::new(0), AtomicU64::new(0)));
    let watched = Arc::clone(&state);
    let watchdog = std::thread::spawn(move || {
        while watched.2.load(Ordering::Relaxed) == 0 {
            std::thread::sleep(Duration::from_millis(200));
            let (number, since) = (
                watched.0.load(Ordering::Relaxed),
                watched.1.load(Ordering::Relaxed),
            );
            let now = begin.elapsed().as_millis() as u64;
            if now.saturating_sub(since) > LONGEST.as_millis() as u64 {
                eprintln!("fuzz {target:?}: seed {} does not end", seed + number);
                std::process::abort();
            }
        }
    });
    let mut outcome = Outcome {
        runs: 0,
        read: 0,
        slowest: Duration::ZERO,
        memory_mb: 0,
    };
    while outcome.runs < runs && begin.elapsed() < time {
        let own = seed + outcome.runs;
        let bytes = mutated(&mut Random(own.wrapping_mul(0x2545_f491_4f6c_dd1d)), corpus);
        state.0.store(outcome.runs, Ordering::Relaxed);
        state
            .1
            .store(begin.elapsed().as_millis() as u64, Ordering::Relaxed);
        let start = Instant::now();
        let caught = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| run(target, &bytes, &place)));
        outcome.slowest = outcome.slowest.max(start.elapsed());
        outcome.runs += 1;
        match caught {
            Ok(read) => outcome.read += u64::from(read),
            Err(_) => {
                let kept = std::env::temp_dir().join(format!("lobestone-fuzz-{target:?}-{own}"));
                let _ = std::fs::write(&kept, &bytes);
                panic!(
                    "fuzz {target:?}: seed {own} panics; its input is {}",
                    kept.display()
                );
            }
        }
        if outcome.runs.is_multiple_of(64) {
            outcome.memory_mb = place.peak_mb().saturating_sub(before_mb);
            assert!(
                outcome.memory_mb < MEMORY_MB,
                "fuzz {target:?}: {} MB by seed {own}",
                outcome.memory_mb
            );
        }
    }
    state.2.store(1, Ordering::Relaxed);
    watchdog.join().unwrap();
    if let Some(served) = &place.served {
        assert_eq!(served.get("/status").status, 200);
        assert_eq!(served.said(), "", "fuzz {target:?}: from seed {seed}");
    }
    outcome
}

/// Small valid files of every format, and the odd ones.
fn measurement_files() -> Vec<Vec<u8>> {
    let mut files: Vec<Vec<u8>> = [
        "time_s,fx_n,fy_n\n0.0,1,2\n0.1,3,4\n0.2,5,6\n0.3,5,6\n",
        "Sampling rate [Hz]:;1000\nTime;Fx;Fy\nms;N;kN\n0,0;1;2\n1,0;3;4\n2,0;5;6\n3,0;7;8\n",
        "Time,Fx,Fy\ns,N,N\n0,000000,0,5,1\n0,000100,0,5,2\n0,000200,0,1,2\n",
        "frequency_hz,re(1X/1X),im(1X/1X),coh(1X/1X)\n1,1,-1,1\n2,2,-2,0.5\n3,3,-3,1\n",
        "frq,amp_real,amp_imag\n0.0,0.07,0.0\n0.3,-0.0002,-0.02\n0.6,-0.002,-0.01\n",
        "\"frequency_hz\";\"magnitude\";\"phase_deg\"\n\"1,5\";\"2\";\"3\"\n\"2\";\"2\";\"3\"\n\"3\";\"2\";\"3\"\n",
        "0.0 2.0e-07 0.0 Freq Hz Real m/N Imag m/N\n0.5 2e-4 -1e-5\n1.0 3e-4 -2e-5\n",
        "0.0 2.04e-03 0.0\n0.5 1e-6 -1e-8\n1.0 2e-6 -2e-8\n",
        "    -1\n   151\nmodel\n    -1\n    -1\n   164\n         1SI\n  1.0D+00  1.0D+00  1.0D+00\n  2.7D+02\n    -1\n    -1\n    58\na\nb\nc\nd\ne\n    4         0    0         0 NONE               1   1 NONE               1   1\n         5         3         1  1.00000e+01  5.00000e-01  0.00000e+00\n        18    0    0    0 Frequency            Hz\n        12    0    0    0 Acc                  m/s^2\n        13    0    0    0 Force                N\n         0    0    0    0 NONE                 NONE\n  1.0e+00 -2.0e+00  3.0e+00 -4.0e+00  5.0e+00 -6.0e+00\n    -1\n",
        "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n***End_of_Header***\t\n\t\nChannels\t2\t\t\nSamples\t3\t3\t\nY_Unit_Label\tN\tg\t\nX_Dimension\tTime\tTime\t\nX0\t0.0E+0\t0.0E+0\t\nDelta_X\t1.0E-3\t1.0E-3\t\n***End_of_Header***\t\t\t\nX_Value\tHammer\tTip\tComment\n0\t1.5\t10\n0.001\t2\t20\n0.002\t3.0\t30\n",
    ]
    .iter()
    .map(|text| text.as_bytes().to_vec())
    .collect();
    let odd = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/odd");
    let mut small: Vec<PathBuf> = std::fs::read_dir(odd)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    small.sort();
    files.extend(
        small
            .iter()
            .map(|p| std::fs::read(p).unwrap())
            .filter(|b| b.len() < 6000),
    );
    for packed in [false, true] {
        let mut builder = hdf5_pure::FileBuilder::new();
        builder
            .create_dataset("f")
            .with_f64_data(&[1.0, 2.0, 3.0, 4.0])
            .with_shape(&[1, 4]);
        let data = builder.create_dataset("H");
        data.with_complex64_data(&[(1.0, -1.0), (2.0, 0.5), (0.5, 1.0), (0.1, 0.0)])
            .with_shape(&[1, 4]);
        if packed {
            data.with_maxshape(&[hdf5_pure::MaxExtent::Fixed(1), hdf5_pure::MaxExtent::Unlimited])
                .with_chunks(&[1, 2])
                .with_deflate(3);
        }
        files.push(builder.finish().unwrap());
    }
    files
}

/// What the other robot files leave out.
const ROBOT_IN_EVERY_WAY: &str = "name = \"arm\"\nguesses = [\"compliances\"]\n[[joint]]\nname = \"lift\"\norigin_m = [0.1, 0.2, 0.3]\n\
     origin_rpy_deg = [90, 0, 0]\naxis = [0, 1, 0]\ncompliance_rad_per_nm = 1e-6\nlimits_deg = [-170, 170]\n[[link]]\n\
     name = \"upper\"\nmass_kg = 2\ninertia_kg_m2 = [1, 1, 1]\nproducts_kg_m2 = [0.1, 0.2, 0.3]\ncom_m = [0.1, 0, 0]\n\
     section_outer_diameter_m = 0.2\nsection_wall_m = 0.01\n[tool]\ntcp_in_flange_m = [0, 0, 0.1]\nrpy_in_flange_deg = [0, 180, 0]\n";

fn text_of(file: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).unwrap()
}

fn corpus_of(target: Target) -> Vec<Vec<u8>> {
    match target {
        Target::Reader => {
            let mut files = measurement_files();
            if let Some(folder) = std::env::var_os("FUZZ_CORPUS") {
                let mut more: Vec<PathBuf> = std::fs::read_dir(folder)
                    .unwrap()
                    .map(|e| e.unwrap().path())
                    .collect();
                more.sort();
                let more = more.iter().filter_map(|p| std::fs::read(p).ok());
                files.extend(more.filter(|b| b.len() <= MOST_BYTES));
            }
            files
        }
        Target::Campaign => vec![
            text_of("tests/data/campaign_full.toml"),
            text_of("tests/data/blind/frf-9112/campaign.toml"),
            text_of("tests/data/blind/force-9400/campaign.toml"),
        ],
        Target::Robot => vec![
            text_of("tests/data/cobot7.toml"),
            text_of("datasets/irb6640/robot.toml"),
            ROBOT_IN_EVERY_WAY.into(),
        ],
        Target::Requests => requests(),
        // Written by `add`, twice, and `undo` on campaigns of tests/data/blind.
        Target::Revisions => vec![
            text_of("tests/data/revisions.json"),
            text_of("tests/data/revisions_cutting.json"),
        ],
    }
}

/// What the page asks for, and orders that are too late to be done: nothing here begins a job.
fn requests() -> Vec<Vec<u8>> {
    let get = |path: &str| format!("GET {path} HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n");
    let post = |path: &str, body: &str| {
        format!(
            "POST /PAGEKEY/{path} HTTP/1.1\r\nHost: HOST\r\nOrigin: http://HOST\r\nX-Lobestone-Token: TOKEN\r\n\
             Content-Type: application/json\r\nContent-Length: {}\r\n\r\n{body}",
            body.len()
        )
    };
    let mut all: Vec<String> = [
        "/PAGEKEY/",
        "/PAGEKEY/page.js",
        "/PAGEKEY/status",
        "/REPORTKEY/report",
        "/REPORTKEY/report/x.png",
        "/",
    ]
    .map(get)
    .to_vec();
    all.extend([
        post(
            "order",
            r#"{"do": "add", "side": "structure", "effect": "payload", "head": "9-9"}"#,
        ),
        post("order", r#"{"do": "undo", "side": "cutting", "head": "9-9"}"#),
        post("cancel", r#"{"number": 99}"#),
        post("begin", r#"{"do": "leave"}"#),
        post("upload", "{\"folder\": \"/nowhere\", \"name\": \"a/b.uff\"}\nx"),
    ]);
    all.push(
        "POST /PAGEKEY/order HTTP/1.1\r\nHost: HOST\r\nX-Lobestone-Token: TOKEN\r\nTransfer-Encoding: chunked\r\n\r\n\
         5\r\n{\"do\"\r\n0\r\n\r\n"
            .into(),
    );
    // Two on one connection, the second without a body that was announced.
    all.push("GET /PAGEKEY/status HTTP/1.1\r\nHost: HOST\r\n\r\nPUT / HTTP/1.1\r\nHost: HOST\r\nExpect: 100-continue\r\nContent-Length: 9\r\n\r\n".into());
    all.into_iter().map(String::into_bytes).collect()
}

const TARGETS: [Target; 5] = [
    Target::Reader,
    Target::Campaign,
    Target::Robot,
    Target::Revisions,
    Target::Requests,
];

#[test]
fn mutated_files_do_no_harm() {
    for target in TARGETS {
        let corpus = corpus_of(target);
        // Of measurement files and requests some are wrong on purpose.
        if !matches!(target, Target::Reader | Target::Requests) {
            let place = Place::of(target);
            for (i, bytes) in corpus.iter().enumerate() {
                assert!(
                    run(target, bytes, &place),
                    "{target:?}: file {i} of the corpus is not read"
                );
            }
        }
        let runs = match target {
            Target::Requests => 300,
            _ => 4000,
        };
        let outcome = fuzz(target, &corpus, 1, runs, Duration::from_secs(60));
        assert!(outcome.read > 0, "{target:?}: nothing is read to its end");
    }
}

#[test]
#[ignore = "writes the seeds of cargo-fuzz: tests/fuzz/README.md"]
fn corpus_for_cargo_fuzz() {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus");
    for target in [Target::Reader, Target::Campaign, Target::Robot, Target::Revisions] {
        let folder = fuzz.join(format!("{target:?}").to_lowercase());
        std::fs::create_dir_all(&folder).unwrap();
        for (i, bytes) in corpus_of(target).iter().enumerate() {
            std::fs::write(folder.join(format!("seed-{i:02}")), bytes).unwrap();
        }
    }
}

#[test]
#[ignore = "runs as long as FUZZ_SECONDS says"]
fn fuzz_for_long() {
    let number = |name: &str, otherwise: u64| {
        std::env::var(name)
            .ok()
            .and_then(|v| v.parse().ok())
            .unwrap_or(otherwise)
    };
    let (seconds, seed) = (number("FUZZ_SECONDS", 60), number("FUZZ_SEED", 1));
    for (target, share) in TARGETS.into_iter().zip([0.5, 0.15, 0.1, 0.1, 0.15]) {
        let time = Duration::from_secs_f64(seconds as f64 * share);
        let found = fuzz(target, &corpus_of(target), seed, u64::MAX, time);
        println!(
            "{target:?}: seeds {seed} to {}, {} runs, {} read, slowest {:.3} s, memory +{} MB",
            seed + found.runs - 1,
            found.runs,
            found.read,
            found.slowest.as_secs_f64(),
            found.memory_mb
        );
    }
}

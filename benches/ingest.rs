//! Reading speed in MB/s on files made here: UFF 58 ASCII, UFF 58b, DynoWare export, FRF CSV.

use std::fmt::Write as _;
use std::hint::black_box;
use std::path::PathBuf;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use lobestone::ingest::{ByteOrder, Encoding58, FrfRecord, Quantity, frf_dataset, read_file, uff58_bytes};
use num_complex::Complex64;

fn frfs(count: i64, lines: usize) -> Vec<FrfRecord> {
    let frf = |node: i64| {
        let frequency_hz: Vec<f64> = (0..lines).map(|i| 3.0 + 0.25 * i as f64).collect();
        let value = frequency_hz
            .iter()
            .map(|f| 1.0 / Complex64::new(1e6 * (node as f64 + 10.0 - f * f), 3e4 * f))
            .collect();
        let response = format!("{node}X").parse().ok();
        FrfRecord {
            name: format!("{node}X/1X"),
            response,
            reference: "1X".parse().ok(),
            quantity: Some(Quantity::Receptance),
            frequency_hz,
            value,
            coherence: None,
        }
    };
    (1..=count).map(frf).collect()
}

/// Force signal that fills its digits.
fn force(i: usize, channel: usize) -> f64 {
    100.0 * ((i * (channel + 3)) as f64 * 0.0137).sin() + 7.0
}

fn dynoware(samples: usize, separator: char, decimal: char) -> Vec<u8> {
    let mut text = String::from("Sampling rate [Hz]:,5000\nTime,Fx,Fy,Fz,Mz\ns,N,N,N,Nm\n")
        .replace(',', &separator.to_string());
    for i in 0..samples {
        let mut row = format!("{:.4}", i as f64 / 5000.0);
        for channel in 0..4 {
            let _ = write!(row, "{separator}{:.3}", force(i, channel));
        }
        text.push_str(&if decimal == '.' {
            row
        } else {
            row.replace('.', &decimal.to_string())
        });
        text.push('\n');
    }
    text.into_bytes()
}

fn frf_csv(frfs: &[FrfRecord]) -> Vec<u8> {
    let mut text = String::from("frequency_hz");
    frfs.iter()
        .for_each(|f| text += &format!(",re({0}),im({0})", f.name));
    for (i, frequency) in frfs[0].frequency_hz.iter().enumerate() {
        let _ = write!(text, "\n{frequency}");
        frfs.iter()
            .for_each(|f| text += &format!(",{:.5e},{:.5e}", f.value[i].re, f.value[i].im));
    }
    text.push('\n');
    text.into_bytes()
}

fn reading(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder for the files");
    let frfs = frfs(36, 4000);
    let datasets: Vec<_> = frfs.iter().map(frf_dataset).collect();
    let uff = |binary, double| uff58_bytes(&datasets, Encoding58 { binary, double });
    let files = [
        ("uff58-ascii", uff(None, true)),
        ("uff58b-binary", uff(Some(ByteOrder::Little), true)),
        ("dynoware-comma", dynoware(200_000, ',', '.')),
        ("dynoware-semicolon-decimal-comma", dynoware(200_000, ';', ',')),
        ("frf-csv", frf_csv(&frfs)),
    ];
    let mut group = c.benchmark_group("read");
    group.sample_size(20);
    for (name, bytes) in files {
        let path: PathBuf = folder.path().join(name);
        std::fs::write(&path, &bytes).expect("a file to read");
        group.throughput(Throughput::Bytes(bytes.len() as u64));
        group.bench_function(name, |b| {
            b.iter(|| read_file(black_box(&path)).expect("a readable file"))
        });
    }
    group.finish();
}

criterion_group!(benches, reading);
criterion_main!(benches);

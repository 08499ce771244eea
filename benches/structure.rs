//! Calibration of a full 3×3 campaign, and FRF synthesis from the robot model.

use std::path::Path;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use lobestone::campaign::Campaign;
use lobestone::identify::frfs::calibrate::calibrate;
use lobestone::identify::{Options, StructureCase};

fn campaign() -> Campaign {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/blind/frf-9000");
    Campaign::load(&folder).expect("a sound campaign")
}

fn structure(c: &mut Criterion) {
    let campaign = campaign();
    let case = StructureCase::load(&campaign).expect("a sound campaign");
    let mut group = c.benchmark_group("structure");
    group.sample_size(20).measurement_time(Duration::from_secs(8));
    group.bench_function("read_and_estimate_noise", |b| {
        b.iter(|| StructureCase::load(&campaign))
    });
    group.bench_function("calibrate_6_postures_54_frfs_218_lines", |b| {
        b.iter(|| calibrate(&case.model, &case.data, None, Options::default()))
    });
    let theta = case.model.nominal_theta();
    // One element is one FRF at one line.
    group.throughput(Throughput::Elements(case.data.value_count() as u64));
    group.bench_function("synthesis", |b| b.iter(|| case.model.predict(&theta, &case.data)));
    group.finish();
}

criterion_group!(benches, structure);
criterion_main!(benches);

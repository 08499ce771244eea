//! Modal analysis of a set of FRFs in memory: 12 responses at 3 references, 7 modes, two of them close.

use std::f64::consts::TAU;
use std::time::Instant;

use criterion::{Criterion, criterion_group};
use lobestone::analysis::ModalAnalysis;
use lobestone::analysis::modes::modal::{FrfInput, FrfReading};
use lobestone::modal::Settings;
use num_complex::Complex64;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const POLES: [(f64, f64); 7] = [
    (6.4, 0.03),
    (8.2, 0.028),
    (13.8, 0.03),
    (14.05, 0.0256),
    (19.3, 0.025),
    (33.0, 0.02),
    (56.0, 0.018),
];

fn settings() -> Settings {
    Settings {
        band_hz: Some([3.0, 70.0]),
        ..Settings::default()
    }
}

/// The set of scripts/compare_sdypy_ema.py, but for its random numbers.
fn set(noise: f64) -> Vec<FrfInput> {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let shapes: Vec<Vec<f64>> = POLES
        .iter()
        .map(|_| {
            let sign = |random: &mut ChaCha8Rng| if random.random() { 1.0 } else { -1.0 };
            (0..12)
                .map(|_| sign(&mut random) * random.random_range(0.3..1.0))
                .collect()
        })
        .collect();
    let frequency_hz: Vec<f64> = (1..=280).map(|k| 0.25 * f64::from(k)).collect();
    let name = |dof: usize| format!("{}{}", dof / 3 + 1, ["X", "Y", "Z"][dof % 3]);
    (0..36)
        .map(|k| {
            let (i, j) = (k / 3, k % 3);
            let receptance_m_per_n = frequency_hz
                .iter()
                .map(|f| {
                    let h: Complex64 = POLES
                        .iter()
                        .zip(&shapes)
                        .map(|((f0, zeta), phi)| {
                            let (w, w0) = (TAU * f, TAU * f0);
                            0.005 * phi[i] * phi[j] / Complex64::new(w0 * w0 - w * w, 2.0 * zeta * w0 * w)
                        })
                        .sum();
                    let size = (-random.random_range(1e-12..1.0f64).ln()).sqrt();
                    h + Complex64::from_polar(noise * h.norm() * size, random.random_range(0.0..TAU))
                })
                .collect();
            FrfInput {
                name: format!("{}/{}", name(i), name(j)),
                set: "set".into(),
                dofs: Some([name(i), name(j)]),
                frequency_hz: frequency_hz.clone(),
                receptance_m_per_n,
                coherence: None,
                added_decay_per_s: 0.0,
            }
        })
        .collect()
}

fn modal(c: &mut Criterion) {
    for noise in [0.0, 0.02] {
        let inputs = set(noise);
        c.bench_function(&format!("modal/36_frfs_7_modes_noise_{noise}"), |b| {
            b.iter(|| ModalAnalysis::of(inputs.clone(), Vec::new(), &settings()));
        });
    }
}

criterion_group!(benches, modal);

/// For scripts/compare_sdypy_ema.py: the time that the computation alone takes for each file, the fastest of three runs.
fn seconds_of_files(files: &[String]) -> lobestone::Result<Vec<f64>> {
    let sets: Vec<Vec<FrfInput>> = files
        .iter()
        .map(|file| {
            let analysis = ModalAnalysis::of_files(&[file], false, &FrfReading::default(), &settings())?;
            let frfs = analysis.sets.into_iter().flat_map(|set| set.frfs);
            Ok(frfs.map(|frf| frf.input).collect())
        })
        .collect::<lobestone::Result<_>>()?;
    sets.into_iter()
        .map(|inputs| {
            let mut fastest = f64::INFINITY;
            for _ in 0..3 {
                let inputs = inputs.clone();
                let began = Instant::now();
                ModalAnalysis::of(inputs, Vec::new(), &settings())?;
                fastest = fastest.min(began.elapsed().as_secs_f64());
            }
            Ok(fastest)
        })
        .collect()
}

fn main() {
    let mut arguments = std::env::args().skip_while(|a| a != "--seconds-json");
    if arguments.next().is_some() {
        let files: Vec<String> = arguments.collect();
        match seconds_of_files(&files) {
            Ok(seconds) => println!("{}", serde_json::json!(seconds)),
            Err(error) => {
                eprintln!("{error}");
                std::process::exit(1);
            }
        }
        return;
    }
    benches();
    Criterion::default().configure_from_args().final_summary();
}

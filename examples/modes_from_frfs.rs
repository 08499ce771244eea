//! Modes of a structure from frequency responses that are in memory: here the FRFs of three known modes, with noise.
//!
//! ```sh
//! cargo run --release --example modes_from_frfs
//! ```

use std::f64::consts::TAU;

use lobestone::Complex64;
use lobestone::modal::{SetMember, Settings, analyse_frfs, global};
use rand::{Rng, SeedableRng};

/// Natural frequency (Hz), damping ratio and mass-normalised shape in x and y (kg^-1/2).
const TRUTH: [(f64, f64, [f64; 2]); 3] = [
    (11.8, 0.031, [0.052, 0.011]),
    (17.3, 0.024, [-0.019, 0.046]),
    (42.6, 0.018, [0.038, 0.033]),
];
/// Standard deviation of the noise as a share of each value.
const NOISE: f64 = 0.02;

fn main() -> lobestone::Result<()> {
    let frequency_hz: Vec<f64> = (0..900).map(|line| 4.0 + 0.1 * f64::from(line)).collect();
    // Response x and y to a force in x: what one direction of hitting gives.
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut measured = |response: usize| -> Vec<Complex64> {
        let frf = frequency_hz.iter().map(|f| receptance(*f, response));
        // Uniform in a square whose sides have that standard deviation.
        let mut noise = || NOISE * 3f64.sqrt() * rng.random_range(-1.0..1.0) / 2f64.sqrt();
        frf.map(|h| h * (1.0 + Complex64::new(noise(), noise())))
            .collect()
    };
    let frfs = [0, 1].map(|response| (frequency_hz.clone(), measured(response)));

    let settings = Settings::default();
    let single = analyse_frfs(&frfs, &settings)?;
    let members: Vec<SetMember> = (frfs.iter().zip(&single).enumerate())
        .map(
            |(response, ((frequency_hz, receptance_m_per_n), modes))| SetMember {
                frequency_hz,
                receptance_m_per_n,
                modes,
                dofs: Some([response, 0]),
            },
        )
        .collect();
    let found = global(&members, &settings)?;

    println!("frequency, Hz        true    damping, %          true   shape y/x   true");
    for (mode, (frequency_hz, damping_ratio, [x, y])) in found.modes.iter().zip(TRUTH) {
        let component = |dof| mode.shape.iter().find(|(d, _)| *d == dof).map(|(_, c)| c.re);
        let ratio = component(1).zip(component(0)).map_or(f64::NAN, |(y, x)| y / x);
        println!(
            "{:7.3} ± {:.3}  {frequency_hz:9.3}    {:6.3} ± {:.3}  {:8.3}   {ratio:9.2}  {:5.2}",
            mode.frequency_hz,
            mode.frequency_std_hz,
            100.0 * mode.damping_ratio,
            100.0 * mode.damping_std,
            100.0 * damping_ratio,
            y / x,
        );
    }
    for warning in &found.warnings {
        println!("warning: {warning}");
    }
    Ok(())
}

/// Displacement in x (0) or y (1) per force in x, m/N.
fn receptance(frequency_hz: f64, response: usize) -> Complex64 {
    let omega = TAU * frequency_hz;
    let of_mode = |(hz, damping_ratio, shape): &(f64, f64, [f64; 2])| {
        let own = TAU * hz;
        let dynamic = Complex64::new(own * own - omega * omega, 2.0 * damping_ratio * own * omega);
        shape[response] * shape[0] / dynamic
    };
    TRUTH.iter().map(of_mode).sum()
}

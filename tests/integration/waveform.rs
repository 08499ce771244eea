//! The waveform model on force campaigns: baseline, effects, ranking.

use std::path::Path;

use lobestone::campaign::Campaign;
use lobestone::effects::cutting::{CuttingInstance, instances};
use lobestone::identify::cutting_data::processes;
use lobestone::identify::levenberg_marquardt::Stopping;
use lobestone::identify::{CuttingData, CuttingModel, CuttingProblem, Fit, LeastSquares, minimise};

fn fit(model: &CuttingModel, data: &CuttingData, start: &[f64], iterations: u64) -> Option<Fit> {
    let stopping = Stopping {
        max_iterations: iterations as usize,
        relative_decrease: 1e-8,
    };
    minimise(&CuttingProblem { model, data }, start, &model.bounds(), stopping).ok()
}

fn extended(base: &CuttingModel, data: &CuttingData, theta: &[f64], instance: CuttingInstance) -> Option<(CuttingModel, Fit)> {
    let model = base.with_effect(instance, data);
    let own = base.parameters.len();
    let summary = base.summary(data);
    let mut starts = vec![model.nominal_theta()[own..].to_vec()];
    for natural in instance.effect.starts(instance.variant, &summary) {
        starts.push(model.parameters[own..].iter().zip(natural).map(|(p, v)| p.internal(v)).collect());
    }
    let problem = CuttingProblem { model: &model, data };
    let mut ranked: Vec<(f64, Vec<f64>)> = starts
        .into_iter()
        .map(|s| {
            let start = [theta, s.as_slice()].concat();
            (problem.cost(&start).unwrap_or(f64::INFINITY), start)
        })
        .collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut looks: Vec<Fit> = ranked.iter().take(4).filter_map(|s| fit(&model, data, &s.1, 5)).collect();
    looks.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let best = looks.iter().take(2).filter_map(|l| fit(&model, data, &l.theta, 40)).min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    Some((model, best))
}

fn nrms(model: &CuttingModel, data: &CuttingData, theta: &[f64]) -> (f64, f64) {
    let fits = CuttingProblem { model, data }.fits(theta).unwrap();
    let c = lobestone::discrepancy::CuttingComparison::new(data, &fits);
    (c.totals.nrms, c.totals.noise_floor_nrms)
}

/// Prints the ranking of all effects on every campaign of a folder: PRACTICE=/somewhere cargo test --release ranking -- --ignored --nocapture
#[test]
#[ignore = "prints a table for campaigns outside the project"]
fn ranking() {
    let Ok(folder) = std::env::var("PRACTICE") else { return };
    let only = std::env::var("ONLY").unwrap_or_default();
    let mut names: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()).collect();
    names.sort();
    for dir in names.iter().filter(|d| d.join("campaign.toml").exists()) {
        let name = dir.file_name().unwrap().to_string_lossy().to_string();
        if !only.split(',').any(|o| name.contains(o)) {
            continue;
        }
        report(&name, dir);
    }
}

fn report(name: &str, dir: &Path) {
    let clock = std::time::Instant::now();
    let Ok(campaign) = Campaign::load(dir) else { return };
    let Some(&process) = processes(&campaign).first() else { return };
    let data = CuttingData::load(&campaign, process).unwrap();
    let loaded = clock.elapsed().as_secs_f64();
    let base = CuttingModel::new(&data, true).unwrap();
    let first = fit(&base, &data, &base.nominal_theta(), 40).unwrap();
    let dof = data.value_count() as f64;
    let (e, floor) = nrms(&base, &data, &first.theta);
    println!(
        "\n== {name}: loaded {loaded:.2} s, base {:.2} s, {} values, chi2/dof {:.3}, nrms {:.4} floor {:.4}, converged {} ({} it)",
        clock.elapsed().as_secs_f64() - loaded,
        data.value_count(),
        2.0 * first.cost / dof,
        e,
        floor,
        first.converged,
        first.iterations
    );
    for w in &data.warnings {
        println!("   {w}");
    }
    let show = |model: &CuttingModel, fit: &Fit, from: usize| {
        let inverse = fit.hessian.clone().cholesky().map(|c| c.inverse());
        let of = |i: usize| {
            let p = &model.parameters[i];
            let std = inverse.as_ref().map_or(f64::NAN, |m| p.natural_std(fit.theta[i], m[(i, i)].sqrt()));
            format!("{}={:.4}±{:.4}", p.name.rsplit('.').next().unwrap(), p.natural(fit.theta[i]), std)
        };
        (from..model.parameters.len()).map(of).collect::<Vec<_>>().join(" ")
    };
    println!("   {}", show(&base, &first, 0));
    for c in data.cuts.iter().filter(|c| c.vibration.is_some()) {
        let v = c.vibration.as_ref().unwrap();
        println!("   cut {} line {:.1} Hz", c.id, v.frequency_hz);
        if std::env::var("LINES").is_ok() {
            for l in &v.lines {
                println!("      shift {} {:?}", l.shift, l.channels);
            }
        }
    }
    let fits = CuttingProblem { model: &base, data: &data }.fits(&first.theta).unwrap();
    let worst: Vec<String> = fits
        .iter()
        .zip(&data.cuts)
        .map(|(f, c)| format!("{}:{:.2}", c.id, f.chi2 / c.value_count() as f64))
        .collect();
    println!("   chi2/n by cut {}", worst.join(" "));
    let summary = base.summary(&data);
    let mut rows = Vec::new();
    for instance in instances() {
        if let Some(why) = instance.effect.obstacle(&summary) {
            println!("   {:26} not tried: {why}", format!("{instance:?}"));
            continue;
        }
        let clock = std::time::Instant::now();
        let Some((model, fit)) = extended(&base, &data, &first.theta, instance) else {
            println!("   {instance:?} failed");
            continue;
        };
        let extra = model.parameters.len() - base.parameters.len();
        let delta = 2.0 * (fit.cost - first.cost) + extra as f64 * dof.ln();
        rows.push((delta, model, fit, instance, clock.elapsed().as_secs_f64()));
    }
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (delta, model, fit, instance, seconds) in &rows {
        let (e, _) = nrms(model, &data, &fit.theta);
        println!(
            "   {:26} dBIC {delta:12.1} chi2/dof {:9.3} nrms {e:.4} {seconds:6.2} s {} it{} {}",
            format!("{instance:?}"),
            2.0 * fit.cost / dof,
            fit.iterations,
            if fit.converged { "" } else { " NOT CONVERGED" },
            show(model, fit, base.parameters.len())
        );
    }
    println!("   total {:.2} s", clock.elapsed().as_secs_f64());
    let clock = std::time::Instant::now();
    let study = lobestone::identify::CuttingStudy::new(data.clone());
    match lobestone::discrepancy::diagnose(&study, &base) {
        Ok(d) => {
            println!(
                "   VERDICT {:?} {} confidence {:.2}, indistinguishable {:?}, companion {:?}, {:.2} s",
                d.verdict,
                d.winner().map_or("-".into(), |c| c.label()),
                d.confidence,
                d.indistinguishable,
                d.companion,
                clock.elapsed().as_secs_f64()
            );
            for c in d.candidates.iter().take(3) {
                println!(
                    "      {:26} dBIC {:.1} p {:.2e} chi2 {:.3} held-out {:.4} (base {:.4}) bound {}",
                    c.label(),
                    c.delta_bic,
                    c.p_value,
                    c.reduced_chi2,
                    c.held_out.map_or(f64::NAN, |h| h.nrms()),
                    d.baseline.held_out.map_or(f64::NAN, |h| h.nrms()),
                    c.at_bound
                );
            }
        }
        Err(e) => println!("   diagnose failed: {e}"),
    }
}

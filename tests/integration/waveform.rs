//! The waveform model on force campaigns: baseline, effects, ranking.

use std::path::Path;

use crate::support::{blind, document, truth};
use lobestone::analysis::Workbench;
use lobestone::campaign::Campaign;
use lobestone::discrepancy::{CuttingComparison, DiagnosisVerdict};
use lobestone::effects::{Cutting, Instance, Known, Registry};
use lobestone::identify::forces::asynchronous_lines::{AsynchronousLines, VibrationLine};
use lobestone::identify::forces::cutting_data::processes;
use lobestone::identify::forces::cutting_study::calibrate_cutting;
use lobestone::identify::levenberg_marquardt::Stopping;
use lobestone::identify::{
    CuttingData, CuttingModel, CuttingProblem, CuttingStudy, Fit, LeastSquares, minimise,
};

fn fit(model: &CuttingModel, data: &CuttingData, start: &[f64], iterations: u64) -> Option<Fit> {
    let stopping = Stopping {
        max_iterations: iterations as usize,
        relative_decrease: 1e-8,
    };
    minimise(&CuttingProblem { model, data }, start, &model.bounds(), stopping).ok()
}

fn extended(
    base: &CuttingModel,
    data: &CuttingData,
    theta: &[f64],
    instance: Instance<Cutting>,
) -> Option<(CuttingModel, Fit)> {
    let model = base.with_effect(instance, &base.known(data));
    let own = base.parameters.len();
    let mut starts = vec![model.nominal_theta()[own..].to_vec()];
    for natural in instance.effect.starts(instance.at(), &base.known(data), &[]) {
        starts.push(
            model.parameters[own..]
                .iter()
                .zip(natural)
                .map(|(p, v)| p.internal(v))
                .collect(),
        );
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
    let mut looks: Vec<Fit> = ranked
        .iter()
        .take(4)
        .filter_map(|s| fit(&model, data, &s.1, 5))
        .collect();
    looks.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let best = looks
        .iter()
        .take(2)
        .filter_map(|l| fit(&model, data, &l.theta, 40))
        .min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    Some((model, best))
}

fn nrms(model: &CuttingModel, data: &CuttingData, theta: &[f64]) -> (f64, f64) {
    let fits = CuttingProblem { model, data }.fits(theta).unwrap();
    let c = CuttingComparison::new(data, &fits);
    (c.totals.nrms, c.totals.noise_floor_nrms)
}

fn loaded(name: &str) -> (CuttingData, CuttingModel) {
    let campaign = Campaign::load(&blind(name)).unwrap();
    let data = CuttingData::on(&Workbench::new(&campaign), processes(&campaign.cuts)[0]).unwrap();
    assert!(data.warnings.is_empty(), "{:?}", data.warnings);
    let model = CuttingModel::new(&data, true).unwrap();
    (data, model)
}

/// On records with nothing hidden the waveform fit leaves noise, and its coefficients are the true ones within what it says.
#[test]
fn undisturbed_records_are_fitted_to_their_noise() {
    for (name, edges) in [("force-9400", 3), ("force-9439", 2)] {
        let (data, model) = loaded(name);
        let calibration = calibrate_cutting(&model, &data).unwrap();
        assert!(calibration.converged());
        assert!(
            (0.85..1.15).contains(&calibration.reduced_chi2),
            "{name}: {}",
            calibration.reduced_chi2
        );
        let truth = truth(name);
        let mut edge_count = 0;
        for p in &calibration.parameters {
            let label: String = p.name[..1].to_uppercase() + &p.name[1..3];
            let value = truth["true_coefficients"][&label].as_f64().unwrap();
            let off = (p.value - value).abs();
            assert!(
                off < 4.0 * p.std_error,
                "{name} {label}: {} ± {} for {value}",
                p.value,
                p.std_error
            );
            let edge = p.unit == "N/mm";
            edge_count += usize::from(edge);
            // An edge coefficient next to zero has no relative error worth the name.
            let tolerance = if edge {
                0.05 * value.abs().max(1.0)
            } else {
                0.01 * value
            };
            assert!(off < tolerance, "{name} {label}: {} for {value}", p.value);
        }
        assert_eq!(edge_count, edges);
        let (e, floor) = nrms(&model, &data, &calibration.theta);
        assert!(e < 1.1 * floor, "{name}: {e} against {floor}");
    }
}

#[test]
fn undisturbed_records_lack_nothing() {
    for name in ["force-9400", "force-9439"] {
        let (data, model) = loaded(name);
        let diagnosis = lobestone::discrepancy::diagnose(&CuttingStudy::new(data), &model).unwrap();
        let first = diagnosis.candidates.first().map(|c| (c.label(), c.delta_bic));
        assert_eq!(diagnosis.verdict, DiagnosisVerdict::None, "{name}: {first:?}");
    }
}

/// Two cuts whose records are those of a vibrating tool, made by the model itself.
fn with_vibration(data: &CuttingData) -> CuttingData {
    let mut data = data.clone();
    data.summary.vibration_hz = Some(431.0);
    for cut in data.cuts.iter_mut().take(2) {
        let mut own = (**cut).clone();
        let lines = (-2..=2).map(|shift: i64| VibrationLine {
            shift,
            channels: (0..3)
                .map(|c| (c, 20.0 / (1.0 + shift.abs() as f64), 0.5))
                .collect(),
        });
        own.vibration = Some(AsynchronousLines {
            frequency_hz: 431.0,
            lines: lines.collect(),
        });
        own.setting.has_vibration = true;
        *cut = std::sync::Arc::new(own);
    }
    let base = CuttingModel::new(&data, true).unwrap();
    let model = base.with_effect(Registry::cutting().find(&(), "chatter")[0], &base.known(&data));
    let fits = CuttingProblem {
        model: &model,
        data: &data,
    }
    .fits(&model.nominal_theta())
    .unwrap();
    for (cut, fit) in data.cuts.iter_mut().zip(fits).take(2) {
        let mut own = (**cut).clone();
        for (channel, fit) in own.channels.iter_mut().zip(fit.channels) {
            let (Some(channel), Some(fit)) = (channel, fit) else {
                continue;
            };
            channel.orders = fit.orders;
            channel.level = fit.level.iter().zip(&fit.zero).map(|(l, z)| l + z).collect();
        }
        *cut = std::sync::Arc::new(own);
    }
    data
}

/// Derivatives of the misfit by every parameter of every effect, the phase and the zero lines projected out, against
/// differences.
#[test]
fn gradients_of_all_effects_equal_differences() {
    for name in ["force-9400", "force-9439"] {
        let (plain, _) = loaded(name);
        let plain = plain.filtered(|i| i < 4);
        for instance in Registry::cutting().instances(&()) {
            let chatter = instance.label() == "chatter";
            let data = if chatter {
                with_vibration(&plain)
            } else {
                plain.clone()
            };
            let base = CuttingModel::new(&data, instance.label() != "edge-force").unwrap();
            let mut summary = base.summary(&data);
            // The few cuts of this test are enough for a gradient.
            (summary.sequence_length, summary.feeds) = (4, 4);
            (summary.full_holes, summary.pilot_holes) = (2, 2);
            summary.speed_m_per_min = [50.0, 90.0];
            if instance.effect.obstacle(&Known::cuts(summary.clone())).is_some() {
                continue;
            }
            let model = base.with_effect(instance, &base.known(&data));
            let problem = CuttingProblem {
                model: &model,
                data: &data,
            };
            let mut theta = model.nominal_theta();
            for (i, t) in theta.iter_mut().enumerate() {
                // Off the nominal values, where nothing is special.
                *t += 0.02 * t.abs().max(0.02) * (1.0 + 0.3 * i as f64);
            }
            let gradient = problem.linearise(&theta).unwrap().gradient;
            for (i, p) in model.parameters.iter().enumerate() {
                let h = 1e-6 * theta[i].abs().max(1e-2);
                let at = |sign: f64| {
                    let mut moved = theta.clone();
                    moved[i] += sign * h;
                    problem.cost(&moved).unwrap()
                };
                let difference = (at(1.0) - at(-1.0)) / (2.0 * h);
                let scale = gradient[i]
                    .abs()
                    .max(difference.abs())
                    .max(1e-6 * at(0.0) / h * 1e-3);
                let off = (gradient[i] - difference).abs() / scale.max(1e-9);
                assert!(
                    off < 2e-2,
                    "{name} {instance:?} {}: {} {difference}",
                    p.name,
                    gradient[i]
                );
            }
        }
    }
}

#[test]
fn compare_says_where_the_waveform_is_off() {
    for (name, axes) in [
        ("force-9400", &["Fx", "Fy", "Fz"][..]),
        ("force-9439", &["Fz", "Mz"][..]),
    ] {
        let dir = blind(name);
        let document = document(&["compare", dir.to_str().unwrap(), "--domain", "cutting"]);
        assert_eq!(document["domain"], "cutting");
        let error = &document["error"];
        let number = |v: &serde_json::Value| v.as_f64().unwrap();
        assert!(
            number(&error["nrms"]) < 1.1 * number(&error["noise_floor_nrms"]),
            "{error}"
        );
        assert!(
            number(&error["held_out_nrms"]) < 1.2 * number(&error["noise_floor_nrms"]),
            "{error}"
        );
        assert!(error["mean_abs_db"].is_number());
        for axis in axes {
            assert!(document["by_axis"][axis].is_number(), "{}", document["by_axis"]);
        }
        // The drilled holes of this campaign share one speed.
        for (key, least) in [("by_cut", 4), ("by_speed", 1), ("by_feed", 2)] {
            assert!(
                document[key].as_object().is_some_and(|o| o.len() >= least),
                "{key}: {}",
                document[key]
            );
        }
    }
}

/// A gain on one record is a real misfit of that cut.
#[test]
fn a_cut_that_does_not_fit_is_named_by_its_error() {
    let (data, model) = loaded("force-9400");
    let mut spoilt = data.clone();
    let mut own = (*spoilt.cuts[1]).clone();
    for channel in own.channels.iter_mut().flatten() {
        channel.orders.iter_mut().for_each(|c| *c *= 1.3);
    }
    spoilt.cuts[1] = std::sync::Arc::new(own);
    let calibration = calibrate_cutting(&model, &spoilt).unwrap();
    let fits = CuttingProblem {
        model: &model,
        data: &spoilt,
    }
    .fits(&calibration.theta)
    .unwrap();
    let comparison = CuttingComparison::new(&spoilt, &fits);
    let worst = comparison
        .cuts
        .iter()
        .max_by(|a, b| a.chi2_per_value.total_cmp(&b.chi2_per_value))
        .unwrap();
    assert_eq!(worst.cut, spoilt.cuts[1].id);
    assert!(worst.chi2_per_value > 3.0, "{worst:?}");
}

#[test]
fn cfc_gives_the_waveforms_coefficients_beside_those_of_the_means() {
    let dir = blind("force-9400");
    let document = document(&["cfc", dir.to_str().unwrap()]);
    let truth = truth("force-9400");
    for group in document["groups"].as_array().unwrap() {
        let ktc = &group["waveform"]["ktc_n_per_mm2"];
        let value = truth["true_coefficients"]["Ktc"].as_f64().unwrap();
        let off = (ktc["value"].as_f64().unwrap() - value).abs();
        assert!(off < 4.0 * ktc["std_error"].as_f64().unwrap(), "{ktc}");
        assert!(group["waveform"]["chi2_per_value"].as_f64().unwrap() < 1.3);
    }
}

/// Prints the ranking of all effects on every campaign of a folder: PRACTICE=/somewhere cargo test --release ranking -- --ignored --nocapture
#[test]
#[ignore = "prints a table for campaigns outside the project"]
fn ranking() {
    let Ok(folder) = std::env::var("PRACTICE") else {
        return;
    };
    let only = std::env::var("ONLY").unwrap_or_default();
    let mut names: Vec<_> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
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
    let Some(&process) = processes(&campaign.cuts).first() else {
        return;
    };
    let data = CuttingData::on(&Workbench::new(&campaign), process).unwrap();
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
        first.converged(),
        first.iterations
    );
    for w in &data.warnings {
        println!("   {w}");
    }
    let show = |model: &CuttingModel, fit: &Fit, from: usize| {
        let inverse = fit.hessian.clone().cholesky().map(|c| c.inverse());
        let of = |i: usize| {
            let p = &model.parameters[i];
            let std = inverse
                .as_ref()
                .map_or(f64::NAN, |m| p.natural_std(fit.theta[i], m[(i, i)].sqrt()));
            format!(
                "{}={:.4}±{:.4}",
                p.name.rsplit('.').next().unwrap(),
                p.natural(fit.theta[i]),
                std
            )
        };
        (from..model.parameters.len())
            .map(of)
            .collect::<Vec<_>>()
            .join(" ")
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
    let fits = CuttingProblem {
        model: &base,
        data: &data,
    }
    .fits(&first.theta)
    .unwrap();
    let worst: Vec<String> = fits
        .iter()
        .zip(&data.cuts)
        .map(|(f, c)| format!("{}:{:.2}", c.id, f.chi2 / c.value_count() as f64))
        .collect();
    println!("   chi2/n by cut {}", worst.join(" "));
    let summary = base.summary(&data);
    let mut rows = Vec::new();
    for instance in Registry::cutting().instances(&()) {
        if let Some(why) = instance.effect.obstacle(&Known::cuts(summary.clone())) {
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
        if std::env::var("PARTS").is_ok_and(|p| p == instance.effect.id()) {
            let fits = CuttingProblem { model, data: &data }.fits(&fit.theta).unwrap();
            for (c, f) in data.cuts.iter().zip(&fits) {
                let mut text = format!("      cut {} {:.2}:", c.id, f.chi2 / c.value_count() as f64);
                for (ch, m) in c.channels.iter().zip(&f.channels) {
                    let (Some(ch), Some(m)) = (ch, m) else { continue };
                    let z =
                        |n: usize| 2.0 * (m.orders[n] - ch.orders[n]).norm_sqr() / ch.order_std[n].powi(2);
                    let orders: f64 = (0..ch.orders.len()).map(z).sum();
                    let worst = (0..ch.orders.len())
                        .max_by(|a, b| z(*a).total_cmp(&z(*b)))
                        .unwrap_or(0);
                    let level: f64 = (0..ch.level.len())
                        .map(|b| ((m.level[b] + m.zero[b] - ch.level[b]) / ch.level_std[b]).powi(2))
                        .sum();
                    text += &format!(
                        " orders {orders:.0}/{} (worst {} {:.0}) level {level:.0}/{};",
                        2 * ch.orders.len(),
                        worst + 1,
                        z(worst),
                        ch.level.len()
                    );
                }
                println!("{text}");
            }
        }
        println!(
            "   {:26} dBIC {delta:12.1} chi2/dof {:9.3} nrms {e:.4} {seconds:6.2} s {} it{} {}",
            format!("{instance:?}"),
            2.0 * fit.cost / dof,
            fit.iterations,
            if fit.converged() { "" } else { " NOT CONVERGED" },
            show(model, fit, base.parameters.len())
        );
    }
    println!("   total {:.2} s", clock.elapsed().as_secs_f64());
    let clock = std::time::Instant::now();
    let study = CuttingStudy::new(data.clone());
    match lobestone::discrepancy::diagnose(&study, &base) {
        Ok(d) => {
            println!(
                "   VERDICT {:?} {} confidence {:.2}, indistinguishable {:?}, companions {:?}, {:.2} s",
                d.verdict,
                d.winner().map_or("-".into(), |c| c.label()),
                d.confidence,
                d.indistinguishable,
                d.companions,
                clock.elapsed().as_secs_f64()
            );
            for c in d.candidates.iter().take(3) {
                println!(
                    "      {:26} dBIC {:.1} p {:.2e} chi2 {:.3} held-out {:.4} (base {:.4}) bound {}",
                    c.label(),
                    c.delta_bic,
                    c.p_value,
                    c.reduced_chi2,
                    c.held_out.as_ref().map_or(f64::NAN, |h| h.nrms()),
                    d.baseline.held_out.as_ref().map_or(f64::NAN, |h| h.nrms()),
                    c.at_bound
                );
            }
        }
        Err(e) => println!("   diagnose failed: {e}"),
    }
}

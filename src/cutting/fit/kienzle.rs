//! Kienzle's law next to the linear-edge law: Fᵢ = kᵢ1.1 · b · h^(1−mᵢ) for each component (Kienzle & Victor, Spezifische
//! Schnittkräfte bei der Metallbearbeitung, Werkstattstechnik und Maschinenbau 47 (1957) 224–225), h and b in mm. In milling
//! h = c sin φ at each angle (Martellotti 1941), averaged over a turn; along a drill's lip h is the same everywhere; round the
//! nose of a turning tool each bit of the edge has its own (see [`crate::cutting::force_model::turning`]).
//!
//! Both laws have as many parameters, so that no information criterion tells more than their likelihoods do. What a
//! difference of likelihoods is worth is found by simulation from either law (Cox, Tests of separate families of hypotheses,
//! 4th Berkeley Symposium, 1961; Williams, Biometrics 26 (1970) 23–32), with the scatter that each leaves: that holds for
//! few cuts, too.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::cutting::cutting_trials::CuttingTrials;
use crate::cutting::fit::group::{ForceGroup, KnownValue, distinct};
use crate::cutting::fit::regression::{CoefficientFit, Observation, fit, r2};
use crate::cutting::force_model::average_force::{average_row, feed_mm};
use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::force_model::kienzle_law::{
    EXPONENTS, KienzleLaw, KienzleLawFit, KienzleTerm, components, linear_deviance, terms,
};
use crate::cutting::identify::CfcResult;
use crate::data::{CutGeometry, Process, Tool};
use crate::stop;

/// A force component under Kienzle's law.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct KienzleComponent {
    /// `tangential`, `radial`, `axial` or, of a drill, `feed`.
    #[serde(rename = "component")]
    pub name: &'static str,
    /// Symbol of the specific force: `kt1.1` is the kc1.1 of the tables.
    #[serde(skip)]
    pub label: &'static str,
    /// Specific force at b = h = 1 mm, N/mm²; `None` where the data does not determine it.
    #[serde(rename = "k1_1_n_per_mm2")]
    pub k1_1: Option<KnownValue>,
    /// How the specific force falls with chip thickness; `None` where the data does not determine it.
    pub m: Option<KnownValue>,
}

/// Which law the averages prefer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preferred {
    /// Force = cutting coefficient × chip area + edge coefficient × width.
    LinearEdge,
    /// Force = kᵢ1.1 · b · h^(1−mᵢ).
    Kienzle,
}

/// A cut that would tell the laws apart better than those at hand.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct TellingFeed {
    /// Per tooth (milling), per revolution (drilling, turning), everything else as in the first cut.
    pub feed_mm: f64,
    /// Average on which the laws differ most there.
    pub axis: ForceAxis,
    /// Kienzle's law less the linear-edge law there (N; N·m).
    pub difference: f64,
    /// The same in standard errors of what one such cut and both fits know.
    pub sigmas: f64,
}

/// Kienzle's law fitted to the averages of a group, and how it stands to the linear-edge law.
#[derive(Debug, Clone, PartialEq)]
pub struct KienzleFit {
    /// How the cuts of the group were made.
    pub process: Process,
    /// Tangential, radial and axial force; of a drill tangential and feed force.
    pub components: Vec<KienzleComponent>,
    /// False where the fit did not settle.
    pub converged: bool,
    /// By axis (x, y, z, torque).
    pub r2: [Option<f64>; 4],
    /// BIC of the linear-edge law less that of Kienzle's: positive where Kienzle's fits better.
    pub delta_bic: f64,
    /// Chance of a difference as much in favour of Kienzle's law where the linear-edge law is true; `None` where the cuts
    /// leave nothing to judge by.
    pub p_linear_edge: Option<f64>,
    /// The other way round.
    pub p_kienzle: Option<f64>,
    /// `None` where the data cannot tell, or bears neither out.
    pub preferred: Option<Preferred>,
    /// Where nothing is preferred.
    pub telling: Option<TellingFeed>,
}

/// Simulations from each law.
const DRAWS: usize = 99;
/// Steps of a fit to a simulation, which begins at the truth.
const STEPS_FROM_TRUTH: usize = 4;
const SEED: u64 = 1957;
/// Chance of calling a law refuted that is true.
const FALSE_ALARM: f64 = 0.01;
/// A smaller difference of BIC is no evidence (Kass & Raftery 1995): two feeds fit both laws alike, to rounding.
const BARE_MENTION: f64 = 2.0;
const STARTS: [f64; 3] = [0.2, 0.45, 0.7];
/// Standard errors that a force must stand above nothing for its exponent to mean something.
const CLEAR: f64 = 3.0;

/// Kienzle's law for each of `groups` (of `result`); `None` where a group's cuts hold no average.
pub fn kienzle(trials: &CuttingTrials, result: &CfcResult, groups: &[ForceGroup]) -> Vec<Option<KienzleFit>> {
    groups
        .iter()
        .map(|group| of_group(trials, result, group))
        .collect()
}

fn of_group(trials: &CuttingTrials, result: &CfcResult, group: &ForceGroup) -> Option<KienzleFit> {
    let (mut observations, mut geometries) = (Vec::new(), Vec::new());
    for cut in result.cuts.iter().filter(|c| group.cuts.contains(&c.id)) {
        let geometry = &trials.cuts[cut.cut].geometry;
        for &axis in ForceAxis::of(group.process) {
            let Some(average) = cut.averages[axis.index()] else {
                continue;
            };
            observations.push(Observation {
                cut: cut.cut,
                axis,
                row: average_row(trials.tool, geometry, axis).ok()?,
                value: average.value,
                std_error: average.std_error,
            });
            geometries.push(*geometry);
        }
    }
    fit_both(trials.tool, group.process, &observations, &geometries)
}

fn fit_both(
    tool: &Tool,
    process: Process,
    observations: &[Observation],
    geometries: &[CutGeometry],
) -> Option<KienzleFit> {
    let linear = fit(observations)?;
    let terms: Vec<Vec<KienzleTerm>> = observations
        .iter()
        .zip(geometries)
        .map(|(o, g)| terms(tool, g, o.axis))
        .collect::<Option<_>>()?;
    let chips = || terms.iter().flatten().map(|t| t.chip_mm.ln());
    let names = components(process);
    let law = KienzleLaw {
        terms: &terms,
        components: names.len(),
        reference_mm: (chips().sum::<f64>() / chips().count().max(1) as f64).exp(),
    };
    let mut best = STARTS
        .iter()
        .filter_map(|m| law.fit(observations, law.start(observations, *m)?, 50))
        .min_by(|a, b| {
            law.deviance(observations, a)
                .total_cmp(&law.deviance(observations, b))
        })?;
    let delta_bic = linear_deviance(observations, &linear) - law.deviance(observations, &best);
    let freedom: f64 = linear.dof.iter().sum();
    let chance = (freedom > 0.5 && delta_bic.is_finite())
        .then(|| chances(&law, observations, &linear, &best, delta_bic));
    let (p_linear_edge, p_kienzle) = (chance.map(|c| c[0]), chance.map(|c| c[1]));
    let preferred = match (refuted(p_linear_edge), refuted(p_kienzle)) {
        _ if delta_bic.abs() < BARE_MENTION => None,
        (true, false) => Some(Preferred::Kienzle),
        (false, true) => Some(Preferred::LinearEdge),
        _ => None,
    };
    let linearised: Vec<Observation> = observations
        .iter()
        .zip(&terms)
        .map(|(o, terms)| Observation {
            row: law.jacobian(terms, &best.theta),
            ..o.clone()
        })
        .collect();
    best.linear = best.linear.covering(&linearised);
    let fitted: Vec<f64> = terms.iter().map(|t| law.predict(t, &best.theta)).collect();
    let as_one: Vec<Observation> = observations
        .iter()
        .zip(fitted)
        .map(|(o, f)| Observation {
            row: vec![f],
            ..o.clone()
        })
        .collect();
    let components: Vec<KienzleComponent> = (0..names.len())
        .map(|j| component(names[j], j, &law, &best))
        .collect();
    // What a law without any exponent says of another feed is nothing.
    let is_determined = components.iter().any(|c| c.m.is_some());
    Some(KienzleFit {
        process,
        components,
        converged: best.converged,
        r2: r2(&as_one, &[1.0]),
        delta_bic,
        p_linear_edge,
        p_kienzle,
        preferred,
        telling: match preferred {
            None if is_determined => telling_feed(tool, &law, observations, geometries, &linear, &best),
            _ => None,
        },
    })
}

fn component(
    name: (&'static str, &'static str),
    j: usize,
    law: &KienzleLaw,
    best: &KienzleLawFit,
) -> KienzleComponent {
    let m_at = law.components + j;
    let (force, m) = (best.theta[j], best.theta[m_at]);
    let inside = m > EXPONENTS[0] && m < EXPONENTS[1];
    let errors = best.linear.std_error[j].zip(best.linear.std_error[m_at]);
    let known = errors.filter(|(error, _)| inside && best.converged && force.abs() > CLEAR * error);
    let covariance = |a: usize, b: usize| best.linear.covariance[(a, b)];
    // k1.1 = q h₀^(m−1): d ln k = dq/q + ln h₀ dm.
    let (ln, k) = (law.reference_mm.ln(), force * law.reference_mm.powf(m - 1.0));
    let variance = covariance(j, j) / (force * force)
        + 2.0 * ln * covariance(j, m_at) / force
        + ln * ln * covariance(m_at, m_at);
    KienzleComponent {
        name: name.0,
        label: name.1,
        k1_1: known.map(|_| KnownValue {
            value: k,
            std_error: Some(k.abs() * variance.max(0.0).sqrt()),
        }),
        m: known.map(|(_, error)| KnownValue {
            value: m,
            std_error: Some(error),
        }),
    }
}

/// Chances of a difference of deviances as far out, where the linear-edge law and where Kienzle's law is true.
fn chances(
    law: &KienzleLaw,
    observations: &[Observation],
    linear: &CoefficientFit,
    best: &KienzleLawFit,
    found: f64,
) -> [f64; 2] {
    let of_linear: Vec<f64> = observations.iter().map(|o| linear.predict(&o.row)).collect();
    let of_kienzle: Vec<f64> = law.terms.iter().map(|t| law.predict(t, &best.theta)).collect();
    let normal = Normal::standard();
    let truths = [(&of_linear, &linear.weight), (&of_kienzle, &best.linear.weight)];
    [0, 1].map(|which| {
        let (mean, weight) = truths[which];
        let as_far = |number: usize| -> Option<bool> {
            stop::point();
            let mut random = ChaCha8Rng::seed_from_u64(SEED);
            random.set_stream((2 * number + which) as u64);
            let drawn: Vec<Observation> = observations
                .iter()
                .zip(mean)
                .zip(weight)
                .map(|((o, mean), w)| {
                    let error = normal.inverse_cdf(random.random_range(f64::EPSILON..1.0));
                    Observation {
                        value: mean + error / w.sqrt(),
                        ..o.clone()
                    }
                })
                .collect();
            let difference = linear_deviance(&drawn, &fit(&drawn)?)
                - law.deviance(&drawn, &law.fit(&drawn, best.theta.clone(), STEPS_FROM_TRUTH)?);
            Some(match which {
                0 => difference >= found,
                _ => difference <= found,
            })
        };
        // A draw that cannot be fitted speaks for neither.
        let outcomes: Vec<bool> = (0..DRAWS).into_par_iter().filter_map(as_far).collect();
        let far = outcomes.iter().filter(|f| **f).count();
        (1 + far) as f64 / (1 + outcomes.len()) as f64
    })
}

/// The feed, of half the least, the middle and twice the greatest, at which one more cut tells most.
fn telling_feed(
    tool: &Tool,
    law: &KienzleLaw,
    observations: &[Observation],
    geometries: &[CutGeometry],
    linear: &CoefficientFit,
    best: &KienzleLawFit,
) -> Option<TellingFeed> {
    let feeds = distinct(geometries.iter().map(feed_mm));
    let (least, greatest) = (*feeds.first()?, *feeds.last()?);
    let middle = (feeds.len() == 2).then(|| (least * greatest).sqrt());
    let candidates = [Some(0.5 * least), middle, Some(2.0 * greatest)];
    let at = |feed: f64, o: &Observation, geometry: &CutGeometry, weight: f64| -> Option<TellingFeed> {
        let mut geometry = *geometry;
        match &mut geometry {
            CutGeometry::Milling {
                feed_per_tooth_mm, ..
            } => *feed_per_tooth_mm = feed,
            CutGeometry::Drilling { feed_per_rev_mm, .. } | CutGeometry::Turning { feed_per_rev_mm, .. } => {
                *feed_per_rev_mm = feed;
            }
        }
        let row = average_row(tool, &geometry, o.axis).ok()?;
        let terms = terms(tool, &geometry, o.axis)?;
        let difference = law.predict(&terms, &best.theta) - linear.predict(&row);
        let variance = 1.0 / weight
            + linear.prediction_variance(&row)
            + best
                .linear
                .prediction_variance(&law.jacobian(&terms, &best.theta));
        let sigmas = difference.abs() / variance.sqrt();
        sigmas.is_finite().then_some(TellingFeed {
            feed_mm: feed,
            axis: o.axis,
            difference,
            sigmas,
        })
    };
    let first = observations.first()?.cut;
    let each = observations.iter().zip(geometries).zip(&linear.weight);
    each.filter(|((o, _), _)| o.cut == first)
        .flat_map(|((o, g), w)| {
            candidates
                .iter()
                .flatten()
                .filter_map(move |feed| at(*feed, o, g, *w))
                .collect::<Vec<_>>()
        })
        .max_by(|a, b| a.sigmas.total_cmp(&b.sigmas))
}

impl KienzleFit {
    /// In a sentence: which law, or what to measure.
    pub fn reading(&self) -> String {
        let chance = |p: Option<f64>| p.map_or(String::new(), |p| format!(" (p {})", chance_text(p)));
        match self.preferred {
            Some(Preferred::Kienzle) => format!(
                "the averages prefer Kienzle's law: ΔBIC {:.1}, too much for chance under the linear-edge law{}",
                self.delta_bic,
                chance(self.p_linear_edge)
            ),
            Some(Preferred::LinearEdge) => format!(
                "the averages prefer the linear-edge law: ΔBIC {:.1}, too much for chance under Kienzle's{}",
                self.delta_bic,
                chance(self.p_kienzle)
            ),
            None if refuted(self.p_linear_edge) && refuted(self.p_kienzle) => {
                "neither law is borne out by how the averages follow the feed".into()
            }
            None => format!(
                "the averages cannot tell the two laws apart{}",
                self.what_to_measure()
            ),
        }
    }

    fn what_to_measure(&self) -> String {
        let per = match self.process {
            Process::Milling => "tooth",
            Process::Drilling | Process::Turning => "turn",
        };
        match &self.telling {
            Some(t) => {
                let digits = |v: f64| crate::text::figures(v, 2);
                let worth = if t.sigmas >= CLEAR {
                    String::new()
                } else {
                    ": repeat it, or spread the feeds wider".to_string()
                };
                format!(
                    "; a cut at {} mm per {per} would show a difference of {} {} on {}, {:.1} standard errors{worth}",
                    digits(t.feed_mm),
                    digits(t.difference.abs()),
                    t.axis.unit(),
                    t.axis.label(),
                    t.sigmas
                )
            }
            None => format!("; cut at least four feeds per {per} over a factor of five"),
        }
    }
}

/// Whether a law that has this chance is called refuted.
fn refuted(chance: Option<f64>) -> bool {
    chance.is_some_and(|p| p <= FALSE_ALARM)
}

fn chance_text(p: f64) -> String {
    // So many draws cannot show a chance below one in as many.
    if p <= 1.0 / DRAWS as f64 {
        format!("below {}", 1.0 / (DRAWS + 1) as f64 * 2.0)
    } else {
        format!("= {p:.2}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Immersion, ToolKind};
    use approx::assert_relative_eq;
    use std::f64::consts::PI;

    fn tool() -> Tool {
        Tool {
            kind: ToolKind::Endmill,
            diameter_mm: 10.0,
            teeth: 2,
            helix_deg: 30.0,
            corner_radius_mm: 0.0,
            lead_angle_deg: 90.0,
            half_point_angle_deg: None,
            web_thickness_mm: None,
            chisel_edge_angle_deg: 125.0,
            each_tooth: Vec::new(),
        }
    }

    fn milling(feed_per_tooth_mm: f64, immersion: Immersion) -> CutGeometry {
        CutGeometry::Milling {
            feed_per_tooth_mm,
            axial_depth_mm: 3.0,
            immersion,
        }
    }

    fn drilling(feed_per_rev_mm: f64) -> CutGeometry {
        CutGeometry::Drilling {
            feed_per_rev_mm,
            pilot_diameter_mm: 3.0,
            hole_depth_mm: None,
        }
    }

    /// Mean forces of straight teeth over a turn, angle by angle: what each component's force per width `law(component, h)`
    /// (N/mm) makes.
    fn turn_means(geometry: &CutGeometry, law: &dyn Fn(usize, f64) -> f64) -> [f64; 3] {
        let CutGeometry::Milling {
            feed_per_tooth_mm,
            axial_depth_mm,
            immersion,
        } = *geometry
        else {
            panic!("milling");
        };
        let steps = 100_000;
        let mut sum = [0.0; 3];
        for k in 0..steps {
            let angle = 2.0 * PI * (k as f64 + 0.5) / steps as f64;
            if angle < immersion.start_rad || angle > immersion.exit_rad {
                continue;
            }
            let (sin, cos) = angle.sin_cos();
            let force = [0, 1, 2].map(|i| law(i, feed_per_tooth_mm * sin) * axial_depth_mm);
            sum[0] += -force[0] * cos - force[1] * sin;
            sum[1] += force[0] * sin - force[1] * cos;
            sum[2] += force[2];
        }
        sum.map(|s| s * tool().teeth as f64 / steps as f64)
    }

    const KIENZLE: [(f64, f64); 3] = [(1500.0, 0.25), (400.0, 0.45), (250.0, 0.35)];

    fn kienzle_law(i: usize, h: f64) -> f64 {
        KIENZLE[i].0 * h.powf(1.0 - KIENZLE[i].1)
    }

    fn linear_law(i: usize, h: f64) -> f64 {
        [900.0, 300.0, 150.0][i] * h + [16.0, 19.0, 8.0][i]
    }

    type Averages = (Vec<Observation>, Vec<CutGeometry>);

    fn exact(feeds: &[f64], immersions: &[Immersion], law: &dyn Fn(usize, f64) -> f64) -> Averages {
        let (mut observations, mut geometries) = (vec![], vec![]);
        let cuts = immersions
            .iter()
            .flat_map(|i| feeds.iter().map(move |f| milling(*f, *i)));
        for (cut, geometry) in cuts.enumerate() {
            let means = turn_means(&geometry, law);
            for (axis, value) in ForceAxis::ALL.into_iter().zip(means) {
                observations.push(Observation {
                    cut,
                    axis,
                    row: average_row(&tool(), &geometry, axis).unwrap(),
                    value,
                    std_error: 0.0,
                });
                geometries.push(geometry);
            }
        }
        (observations, geometries)
    }

    fn noisy((observations, geometries): &Averages, noise: f64, seed: u64) -> KienzleFit {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut error = || Normal::standard().inverse_cdf(random.random_range(1e-9..1.0));
        let observations: Vec<Observation> = observations
            .iter()
            .map(|o| Observation {
                value: o.value + noise * error(),
                std_error: noise,
                ..o.clone()
            })
            .collect();
        fitted(&observations, geometries)
    }

    fn fitted(observations: &[Observation], geometries: &[CutGeometry]) -> KienzleFit {
        fit_both(&tool(), Process::Milling, observations, geometries).unwrap()
    }

    const FEEDS: [f64; 6] = [0.02, 0.04, 0.08, 0.12, 0.16, 0.2];
    const PART: Immersion = Immersion {
        start_rad: 1.9,
        exit_rad: PI,
    };

    #[test]
    fn kienzle_averages_give_back_their_law_and_prefer_it() {
        for immersions in [&[Immersion::SLOT][..], &[Immersion::SLOT, PART]] {
            let exact = exact(&FEEDS, immersions, &kienzle_law);
            let fit = fitted(&exact.0, &exact.1);
            assert!(fit.converged && fit.preferred == Some(Preferred::Kienzle));
            for (c, (k, m)) in fit.components.iter().zip(KIENZLE) {
                assert_relative_eq!(c.k1_1.unwrap().value, k, max_relative = 1e-4);
                assert_relative_eq!(c.m.unwrap().value, m, epsilon = 1e-4);
            }
            let mut off = vec![];
            for seed in 0..20 {
                let fit = noisy(&exact, 0.3, seed);
                assert_eq!(fit.preferred, Some(Preferred::Kienzle), "{}", fit.reading());
                for (c, (k, m)) in fit.components.iter().zip(KIENZLE) {
                    let (k1, m1) = (c.k1_1.unwrap(), c.m.unwrap());
                    off.push((k1.value - k) / k1.std_error.unwrap());
                    off.push((m1.value - m) / m1.std_error.unwrap());
                }
            }
            let rms = (off.iter().map(|o| o * o).sum::<f64>() / off.len() as f64).sqrt();
            assert!((0.7..1.3).contains(&rms), "{rms}");
            assert!(off.iter().all(|o| o.abs() < 5.0), "{off:?}");
        }
    }

    #[test]
    fn linear_edge_averages_prefer_the_linear_edge_law() {
        let exact = exact(&FEEDS, &[Immersion::SLOT], &linear_law);
        assert_eq!(fitted(&exact.0, &exact.1).preferred, Some(Preferred::LinearEdge));
        for seed in 0..10 {
            let fit = noisy(&exact, 0.3, seed);
            assert_eq!(fit.preferred, Some(Preferred::LinearEdge), "{}", fit.reading());
            assert!(fit.delta_bic < -10.0 && fit.telling.is_none());
        }
    }

    /// The chance of preferring the wrong law is what it is said to be, at noise that leaves the matter open.
    #[test]
    fn the_wrong_law_is_hardly_ever_preferred() {
        type Case<'a> = (&'a dyn Fn(usize, f64) -> f64, Preferred);
        let laws: [Case; 2] = [
            (&kienzle_law, Preferred::LinearEdge),
            (&linear_law, Preferred::Kienzle),
        ];
        for (law, wrong) in laws {
            let exact = exact(&FEEDS[..4], &[Immersion::SLOT], law);
            for noise in [1.5, 5.0] {
                let found = (0..20).filter(|seed| noisy(&exact, noise, *seed).preferred == Some(wrong));
                assert!(found.count() <= 1, "{wrong:?} at {noise} N");
            }
        }
    }

    #[test]
    fn two_feeds_cannot_tell_and_say_what_would() {
        let fit = noisy(
            &exact(&[0.05, 0.15, 0.05, 0.15], &[Immersion::SLOT], &kienzle_law),
            0.3,
            4,
        );
        assert_eq!(fit.preferred, None);
        assert!(fit.delta_bic.abs() < 1e-3, "{}", fit.delta_bic);
        let telling = fit.telling.unwrap();
        assert!(telling.sigmas > 3.0 && telling.feed_mm != 0.05, "{telling:?}");
        assert!(fit.reading().contains("cannot tell"), "{}", fit.reading());
        // Two points give a power law, with its error.
        let m = fit.components[0].m.unwrap();
        assert!((m.value - KIENZLE[0].1).abs() < 4.0 * m.std_error.unwrap());

        let one = noisy(&exact(&[0.1], &[Immersion::SLOT], &kienzle_law), 0.3, 4);
        assert!(one.components.iter().all(|c| c.m.is_none() && c.k1_1.is_none()));
        assert_eq!((one.preferred, one.p_kienzle, one.telling), (None, None, None));
        assert!(
            one.reading().contains("cut at least four feeds"),
            "{}",
            one.reading()
        );
    }

    #[test]
    fn a_drill_follows_the_law_along_its_lips() {
        let drill = Tool {
            kind: ToolKind::Drill,
            diameter_mm: 8.0,
            helix_deg: 30.0,
            corner_radius_mm: 0.0,
            lead_angle_deg: 90.0,
            half_point_angle_deg: Some(59.0),
            web_thickness_mm: Some(1.2),
            chisel_edge_angle_deg: 125.0,
            each_tooth: Vec::new(),
            teeth: 2,
        };
        let kappa = 59f64.to_radians();
        let (mut observations, mut geometries) = (vec![], vec![]);
        for (cut, feed) in [0.05, 0.08, 0.12, 0.2, 0.3].into_iter().enumerate() {
            let geometry = drilling(feed);
            let h = 0.5 * feed * kappa.sin();
            // Lip by lip, slice by slice along the radius.
            let slices = 1000;
            let (mut thrust, mut torque) = (0.0, 0.0);
            for s in 0..slices {
                let dr = 2.5 / f64::from(slices);
                let r = 1.5 + (f64::from(s) + 0.5) * dr;
                thrust += 2.0 * 800.0 * (dr / kappa.sin()) * h.powf(0.6) * kappa.sin();
                torque += 2.0 * 1700.0 * (dr / kappa.sin()) * h.powf(0.74) * r / 1000.0;
            }
            for (axis, value) in [(ForceAxis::Z, thrust), (ForceAxis::Mz, torque)] {
                observations.push(Observation {
                    cut,
                    axis,
                    row: average_row(&drill, &geometry, axis).unwrap(),
                    value,
                    std_error: 0.0,
                });
                geometries.push(geometry);
            }
        }
        let fit = fit_both(&drill, Process::Drilling, &observations, &geometries).unwrap();
        assert_eq!(fit.preferred, Some(Preferred::Kienzle));
        for (c, (k, m)) in fit.components.iter().zip([(1700.0, 0.26), (800.0, 0.4)]) {
            assert_relative_eq!(c.k1_1.unwrap().value, k, max_relative = 1e-5);
            assert_relative_eq!(c.m.unwrap().value, m, epsilon = 1e-5);
        }
    }
}

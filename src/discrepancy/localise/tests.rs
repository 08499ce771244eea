use std::sync::Arc;

use num_complex::Complex64;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::data::{AxesRef, Axis, BodyRef, MeasuredDof, Point, RobotSection};
use crate::effects::Registry;
use crate::identify::frfs::frf_data::{FrfBlock, FrfDatum};
use crate::identify::rest::{LIKE_A_PLACE, LIKE_A_RESONANCE, RestTest};
use crate::identify::{FrfData, Options};
use crate::robot::RobotModel;
use crate::robot::fixture::{TAP_POSTURES, irb6640};

pub(in crate::discrepancy) fn model() -> StructureModel {
    let section = RobotSection {
        model: "irb6640".into(),
        mass_tolerance: None,
        stiffness_tolerance: 0.3,
        links: Default::default(),
    };
    let point = |node, body| Point {
        node,
        body,
        position_m: [0.0; 3],
        axes: AxesRef::Base,
    };
    let points = vec![point(1, BodyRef::Tool), point(2, BodyRef::Link(3))];
    StructureModel::new(RobotModel::new(irb6640()), points, &section)
}

/// 3 × 3 at the tool and three responses on link 3, four postures; FRFs of `truth` with joints up to 12 % off and 2 % noise.
fn measured(truth: &StructureModel, own: &[f64], seed: u64) -> FrfData {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut theta = truth.nominal_theta();
    let count = theta.len() - own.len();
    for t in &mut theta[..6] {
        *t += random.random_range(-0.12..0.12);
    }
    for (t, (value, p)) in theta[count..]
        .iter_mut()
        .zip(own.iter().zip(&truth.parameters[count..]))
    {
        *t = p.internal(*value);
    }
    measured_at(truth, &TAP_POSTURES, |_| theta.clone(), &mut random)
}

/// The same of any postures, each with parameters of its own (solver's scale).
pub(in crate::discrepancy) fn measured_at(
    truth: &StructureModel,
    postures: &[[f64; 6]],
    theta: impl Fn(usize) -> Vec<f64>,
    random: &mut ChaCha8Rng,
) -> FrfData {
    let dof = |point, axis| MeasuredDof {
        point,
        axis,
        negative: false,
    };
    let outputs: Vec<(usize, Axis)> = (0..2).flat_map(|p| Axis::ALL.map(|a| (p, a))).collect();
    let frequency_hz: Vec<f64> = (0..200).map(|i| 4.0 + 0.3 * f64::from(i)).collect();
    let blocks = postures.iter().enumerate().map(|(posture, q)| {
        let pairs =
            (0..2usize).flat_map(|p| (0..3usize).flat_map(move |a| (0..3usize).map(move |i| (p, a, i))));
        let frfs = pairs
            .filter(|(p, _, i)| *p == 0 || *i == 0)
            .map(|(point, axis, input)| FrfDatum {
                name: String::new(),
                posture,
                response: dof(point, Axis::ALL[axis]),
                reference: dof(0, Axis::ALL[input]),
                response_outputs: [3 * point, 3 * point + 1, 3 * point + 2],
                input,
                sign: 1.0,
                receptance: vec![Complex64::ZERO; frequency_hz.len()],
                noise_std: vec![1.0; frequency_hz.len()],
            });
        FrfBlock {
            posture,
            force_level_n: None,
            conditions: Default::default(),
            kinematics: truth.robot.kinematics(q).unwrap(),
            frequency_hz: frequency_hz.clone(),
            outputs: outputs.clone(),
            frfs: frfs.collect(),
        }
    });
    let mut data = FrfData {
        blocks: blocks.map(Arc::new).collect(),
        posture_ids: (1..=postures.len()).map(|p| format!("p{p}")).collect(),
    };
    for block in &mut data.blocks {
        let alone = FrfData {
            blocks: vec![block.clone()],
            posture_ids: data.posture_ids.clone(),
        };
        let mut exact = truth.predict(&theta(block.posture), &alone).unwrap().into_iter();
        drop(alone);
        for frf in &mut Arc::get_mut(block).unwrap().frfs {
            let clean = exact.next().unwrap();
            let rms = (clean.iter().map(|h| h.norm_sqr()).sum::<f64>() / clean.len() as f64).sqrt();
            for (k, h) in clean.iter().enumerate() {
                let std = (0.02 * h.norm()).hypot(0.002 * rms);
                // Two uniform parts with the variance of the complex normal.
                let mut part = || random.random_range(-1.0..1.0) * 1.5f64.sqrt() * std;
                frf.receptance[k] = h + Complex64::new(part(), part());
                frf.noise_std[k] = std;
            }
        }
    }
    data
}

type Hidden<'a> = (Spot, DrawnForm, &'a [f64]);

fn found(hidden: Option<Hidden>, seed: u64) -> Localisation {
    found_of(hidden.as_slice(), seed)
}

fn found_of(hidden: &[Hidden], seed: u64) -> Localisation {
    let bare = model();
    let data = measured(&bare, &[], seed);
    let truth = hidden.iter().fold(bare.clone(), |model, (spot, form, _)| {
        let known = model.known(&data.summary());
        model.with_effect(drawn::instance(*spot, *form), &known)
    });
    let own: Vec<f64> = hidden.iter().flat_map(|h| h.2).copied().collect();
    let study = StructureStudy::new(measured(&truth, &own, seed), Options::default());
    localise(&study, &bare).unwrap()
}

fn first_or_tied(found: &Localisation, spot: Spot) -> bool {
    let first = &found.places[0];
    first.spot == spot || first.tied_with.contains(&spot.label())
}

#[test]
fn a_resonator_on_link_5_is_found_and_weighed() {
    let spot = Spot::LinkAxis(5, 2);
    let truth = [5.0, 27.0, 0.04];
    let found = found(Some((spot, DrawnForm::Resonator, &truth)), 11);
    assert!(found.significant);
    assert!(first_or_tied(&found, spot), "{:?}", found.places[0].spot);
    let place = found.places.iter().find(|p| p.spot == spot).unwrap();
    let best = place.best.as_ref().unwrap();
    assert_eq!(best.first.form(), DrawnForm::Resonator);
    for (estimate, truth) in best.first.parameters.iter().zip(truth) {
        assert!((estimate.value / truth - 1.0).abs() < 0.15, "{estimate:?}");
        assert!(
            (estimate.value - truth).abs() < 4.0 * estimate.std_error,
            "{estimate:?}"
        );
    }
    assert!(place.left < 1.1, "{}", place.left);
}

#[test]
fn a_clamp_at_the_tool_is_a_spring_to_the_ground() {
    let spot = Spot::ToolGround(2);
    let found = found(Some((spot, DrawnForm::Spring, &[3e5])), 12);
    assert!(
        found.significant && first_or_tied(&found, spot),
        "{:?}",
        found.places[0].spot
    );
    let place = found.places.iter().find(|p| p.spot == spot).unwrap();
    let stiffness = &place.best.as_ref().unwrap().first.parameters[0];
    assert!((stiffness.value / 3e5 - 1.0).abs() < 0.05, "{stiffness:?}");
    // The drawn curve says the same without any form.
    let inside: Vec<f64> = place
        .curve
        .iter()
        .filter(|c| c.std < 3e4)
        .map(|c| c.stiffness.re)
        .collect();
    let mean = inside.iter().sum::<f64>() / inside.len() as f64;
    assert!(
        inside.len() > 20 && (mean / 3e5 - 1.0).abs() < 0.15,
        "{} {mean}",
        inside.len()
    );
}

#[test]
fn a_tilting_bearing_is_drawn_in_series() {
    let spot = Spot::Bearing(3, 3);
    let found = found(Some((spot, DrawnForm::Spring, &[2e6])), 13);
    assert!(
        found.significant && first_or_tied(&found, spot),
        "{:?}",
        found.places[0].spot
    );
    let place = found.places.iter().find(|p| p.spot == spot).unwrap();
    let stiffness = &place.best.as_ref().unwrap().first.parameters[0];
    assert!((stiffness.value / 2e6 - 1.0).abs() < 0.15, "{stiffness:?}");
}

/// A part that swings along two axes of a link, with another frequency along each.
#[test]
fn two_displacements_of_one_place_are_found_together() {
    let (first, second) = (Spot::LinkAxis(4, 2), Spot::LinkAxis(4, 0));
    let truth = [[7.0, 13.4, 0.036], [7.0, 19.8, 0.031]];
    let hidden = [
        (first, DrawnForm::Resonator, &truth[0][..]),
        (second, DrawnForm::Resonator, &truth[1][..]),
    ];
    let found = found_of(&hidden, 14);
    let place = &found.places[0];
    let best = place.best.as_ref().unwrap();
    let other = best.second.as_ref().expect("two displacements");
    assert!(found.significant && found.partial_share().is_none() && place.left < 1.1);
    assert!(found.explained_share().unwrap() > 0.95);
    for (spot, truth) in [first, second].into_iter().zip(truth) {
        let parameters = if place.spot == spot {
            &best.first.parameters
        } else {
            &other.parameters
        };
        assert!([place.spot, other.spot].contains(&spot));
        for (estimate, truth) in parameters.iter().zip(truth) {
            assert!(
                (estimate.value / truth - 1.0).abs() < 0.15,
                "{spot:?} {estimate:?}"
            );
        }
    }
}

/// What hangs between arm and hall pulls along no axis of either.
#[test]
fn a_hose_is_a_spring_to_the_ground_along_a_direction_of_its_own() {
    let spot = Spot::LinkGround(4, 0);
    let truth = [4e4, 300.0, 0.5, -0.3];
    let found = found(Some((spot, DrawnForm::ObliqueSpringDamper, &truth)), 15);
    assert!(
        found.significant && found.places[0].left < 1.1,
        "{:?}",
        found.places[0].spot
    );
    assert!(first_or_tied(&found, spot), "{:?}", found.places[0].spot);
    let place = found.places.iter().find(|p| p.spot == spot).unwrap();
    let stiffness = &place.best.as_ref().unwrap().first.parameters[0];
    assert!((stiffness.value / truth[0] - 1.0).abs() < 0.15, "{stiffness:?}");
}

/// A foot plate that slides both ways, so soft that it leads the joints far away: along either axis alone it explains little.
#[test]
fn a_base_that_slides_both_ways_is_found_and_weighed() {
    let found = found(Some((Spot::Base(0), DrawnForm::IsotropicSpring, &[3e6])), 16);
    let place = &found.places[0];
    assert!(
        found.significant && first_or_tied(&found, Spot::Base(0)) && place.left < 1.1,
        "{:?} {}",
        place.spot,
        place.left
    );
    let best = place.best.as_ref().unwrap();
    let stiffness = &best.first.parameters[0];
    assert!((stiffness.value / 3e6 - 1.0).abs() < 0.05, "{stiffness:?}");
    assert!(
        best.in_words(|_| String::new())
            .starts_with("an isotropic spring")
    );
}

/// Kinematics makes what gives way behind the gear of joint 1 and what turns under the base one place, but only one of them has a rotor.
#[test]
fn a_soft_servo_of_joint_1_is_a_rotor_behind_its_gear() {
    let spot = Spot::Drive(1);
    let truth = [1.8e6, 2.5e4, 450.0];
    let found = found(Some((spot, DrawnForm::RotorOnSpring, &truth)), 17);
    let place = &found.places[0];
    assert!(
        found.significant && place.spot == spot && place.left < 1.05,
        "{:?} {}",
        place.spot,
        place.left
    );
    assert!(place.tied_with.is_empty(), "{:?}", place.tied_with);
    for (estimate, truth) in place.best.as_ref().unwrap().first.parameters.iter().zip(truth) {
        assert!((estimate.value / truth - 1.0).abs() < 0.15, "{estimate:?}");
    }
}

/// A second axis that is so faint that the coarse view does not show it; what is asked for by its form is that form.
#[test]
fn a_faint_second_resonator_is_judged_by_all_data() {
    let hidden = [
        (
            Spot::LinkAxis(3, 2),
            DrawnForm::Resonator,
            &[4.0, 22.3, 0.032][..],
        ),
        (
            Spot::LinkAxis(3, 0),
            DrawnForm::Resonator,
            &[4.6, 30.8, 0.021][..],
        ),
    ];
    let found = found_of(&hidden, 18);
    let place = &found.places[0];
    let best = place.best.as_ref().unwrap();
    let spots: Vec<Spot> = best.parts().map(|part| part.spot).collect();
    assert!(found.significant && place.left < 1.05, "{}", place.left);
    assert!(hidden.iter().all(|(spot, ..)| spots.contains(spot)), "{spots:?}");
    for part in best.parts() {
        let request = part.instance.request();
        assert!(best.requests().contains(&request), "{request}");
        assert_eq!(request, format!("branch@{}:form=resonator", part.spot.label()));
    }
}

#[test]
fn nothing_is_drawn_where_nothing_is_missing() {
    for seed in [21, 22] {
        let found = found(None, seed);
        assert!(!found.significant, "{:?}", found.places[0].spot);
    }
}

/// What tests of one place find in what the calibrated model leaves of `data`: one law, one resonance. Those that look everywhere find
/// nothing.
fn left_at_a_place(data: FrfData) -> [RestTest; 2] {
    let bare = model();
    let study = StructureStudy::new(data, Options::default());
    let calibrated = study.calibrate(&bare).unwrap();
    let rest = study.rest(&bare, &calibrated.theta).unwrap();
    let (place, others): (Vec<RestTest>, Vec<RestTest>) = rest.tests.iter().partition(|t| t.is_of_a_place());
    assert!(
        !others.is_empty() && others.iter().all(|t| !t.is_significant()),
        "{others:?}"
    );
    let place: [RestTest; 2] = place.try_into().unwrap();
    assert_eq!(place.map(|t| t.looks_like), [LIKE_A_PLACE, LIKE_A_RESONANCE]);
    place
}

fn measured_with(instance: Instance<Structure>, own: &[f64], seed: u64) -> FrfData {
    let bare = model();
    let data = measured(&bare, &[], seed);
    measured(
        &bare.with_effect(instance, &bare.known(&data.summary())),
        own,
        seed,
    )
}

/// Far below what the tests see that look everywhere.
#[test]
fn a_law_at_one_place_is_seen_where_nothing_else_sees_it() {
    let clamp = drawn::instance(Spot::ToolGround(2), DrawnForm::Spring);
    let [faint, _] = left_at_a_place(measured_with(clamp, &[1.2e3], 12));
    assert!(faint.is_significant() && faint.sigmas() > 5.0, "{faint:?}");
    for seed in [21, 22, 23] {
        for nothing in left_at_a_place(measured(&model(), &[], seed)) {
            assert!(
                nothing.p_value > 1e-3 && nothing.sigmas().abs() < 3.5,
                "{nothing:?}"
            );
        }
    }
}

/// A law with one size for many lines does not see what changes its sign within them.
#[test]
fn a_faint_resonance_is_seen_at_its_frequency() {
    const HZ: f64 = 27.0;
    let bare = model();
    let hung = Registry::structure().find(&bare.robot.spec, "local-resonator@link-3")[2];
    let on_the_link = measured_with(hung, &[0.4, HZ, 0.04], 12);
    // The ground of the sensor at the tool, the same at all postures.
    let mut on_a_table = measured(&bare, &[], 13);
    for block in &mut on_a_table.blocks {
        let block = Arc::make_mut(block);
        let own = |hz: f64| 2e-9 / Complex64::new(1.0 - (hz / HZ).powi(2), 0.06 * hz / HZ);
        for frf in &mut block.frfs {
            if (frf.response, frf.reference.axis) == (frf.reference, Axis::X) {
                let lines = frf.receptance.iter_mut().zip(&block.frequency_hz);
                lines.for_each(|(h, hz)| *h += own(*hz));
            }
        }
    }
    for data in [on_the_link, on_a_table] {
        let [law, resonance] = left_at_a_place(data);
        assert!(
            resonance.is_significant() && resonance.p_value < law.p_value,
            "{resonance:?} {law:?}"
        );
        let hz = resonance.frequency_hz.unwrap();
        assert!((hz / HZ - 1.0).abs() < 0.03, "{hz}");
    }
}

//! Each mistake made in data of the model itself, and found again.

use std::sync::Arc;

use num_complex::Complex64;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::mistakes;
use super::scene::{Made, predict};
use super::*;
use crate::data::{AxesRef, Axis, BodyRef, MeasuredDof, Point, RobotSection};
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::{FrfBlock, FrfData, FrfDatum};
use crate::identify::frfs::frf_problem::FrfProblem;
use crate::identify::levenberg_marquardt::{Stopping, minimise};
use crate::identify::{rest, rest_patterns};
use crate::robot::RobotModel;
use crate::robot::fixture::{TAP_POSTURES, irb6640};

const RELATIVE_NOISE: f64 = 0.02;

fn model() -> StructureModel {
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

/// Where the truth stands: stiffnesses off the robot file by up to 20 %.
fn truth(model: &StructureModel) -> Vec<f64> {
    let shifts = [0.1, -0.2, 0.15, 0.05, -0.1, 0.2, 0.1];
    let nominal = model.nominal_theta();
    nominal.iter().zip(shifts).map(|(t, s)| t + s).collect()
}

/// Four postures; all axes of tool and link 3 for hits at the tool.
fn arrangement(model: &StructureModel) -> FrfData {
    let frequency_hz: Vec<f64> = (0..240).map(|k| 4.0 + 0.25 * f64::from(k)).collect();
    let lines = frequency_hz.len();
    let blocks = TAP_POSTURES.iter().enumerate().map(|(posture, joints)| {
        let outputs: Vec<(usize, Axis)> = (0..2).flat_map(|p| Axis::ALL.map(|a| (p, a))).collect();
        let dof = |point, axis| MeasuredDof {
            point,
            axis,
            negative: false,
        };
        let pairs = (0..2)
            .flat_map(|p| Axis::ALL.map(|a| (p, a)))
            .flat_map(|r| Axis::ALL.map(|b| (r, b)));
        let frfs = pairs.map(|((point, axis), reference)| FrfDatum {
            name: String::new(),
            posture,
            response: dof(point, axis),
            reference: dof(0, reference),
            response_outputs: [3 * point, 3 * point + 1, 3 * point + 2],
            input: reference.index(),
            sign: 1.0,
            receptance: vec![Complex64::ZERO; lines],
            noise_std: vec![1.0; lines],
        });
        Arc::new(FrfBlock {
            posture,
            force_level_n: None,
            conditions: Default::default(),
            kinematics: model.robot.kinematics(joints).unwrap(),
            frequency_hz: frequency_hz.clone(),
            outputs,
            frfs: frfs.collect(),
        })
    });
    FrfData {
        blocks: blocks.collect(),
        posture_ids: ["a", "b", "c", "d"].map(String::from).into(),
    }
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (random.random_range(1e-12..1.0), random.random_range(0.0..1.0));
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// Files with `made`, with noise.
fn measured(model: &StructureModel, made: Option<Made>, seed: u64) -> FrfData {
    let mut data = arrangement(model);
    let curves = predict(model, &truth(model), &data, made).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut curves = curves.into_iter();
    for block in &mut data.blocks {
        for frf in &mut Arc::make_mut(block).frfs {
            let curve = curves.next().unwrap();
            for ((h, std), c) in frf.receptance.iter_mut().zip(&mut frf.noise_std).zip(curve) {
                *std = (RELATIVE_NOISE * c.norm()).max(1e-9);
                let noise = Complex64::new(normal(&mut random), normal(&mut random));
                *h = c + noise * (*std * std::f64::consts::FRAC_1_SQRT_2);
            }
        }
    }
    data
}

/// Fits the baseline as the commands do and looks for mistakes.
fn check(model: &StructureModel, data: &FrfData) -> SetupCheck {
    let problem = FrfProblem::likelihood(model, data);
    let fit = minimise(&problem, &truth(model), &model.bounds(), Stopping::default()).unwrap();
    examine(model, data, &fit.theta, None, None, || None).unwrap()
}

#[test]
fn nothing_is_found_where_nothing_is_wrong() {
    let model = model();
    for seed in 0..3 {
        let check = check(&model, &measured(&model, None, seed));
        assert!(check.findings.is_empty(), "{:?}", check.findings);
    }
}

/// Every mistake with a size, its kind named and its size within four standard errors.
#[test]
fn mistakes_are_found_with_their_size() {
    let model = model();
    let all = mistakes::all(&model, &arrangement(&model));
    let at = |posture: Option<usize>| FrfGroup {
        posture,
        ..FrfGroup::ALL
    };
    let tau = std::f64::consts::TAU;
    // Index among the mistakes, where, sizes, kind, value told.
    let cases: [(usize, FrfGroup, &[f64], &str, f64); 11] = [
        (2, at(None), &[0.8], "encoder-offset", 0.8),
        (4, at(Some(1)), &[-2.0], "encoder-offset", -2.0),
        (7, at(None), &[0.03, -0.02, 0.01], "point-position", 37.42),
        (8, at(Some(2)), &[0.1], "channel-gain", 0.1f64.exp()),
        (9, at(Some(0)), &[3.0, -4.0, 2.0], "hit-direction", 29f64.sqrt()),
        (11, at(None), &[1.5], "exponential-window", 1.5),
        (12, at(None), &[tau], "sensor-high-pass", 1.0),
        (16, at(None), &[3.0], "sensor-mass", 3.0),
        (17, at(Some(1)), &[8e-4], "late-channel", 0.8),
        (18, at(None), &[0.0625], "coarse-lines", 0.25),
        (
            15,
            at(Some(1)),
            &[1.0 / (tau * 100.0)],
            "amplifier-low-pass",
            100.0,
        ),
    ];
    for (seed, (index, group, values, kind, told)) in cases.into_iter().enumerate() {
        let made = Made {
            mistake: all[index].as_ref(),
            group,
            values,
        };
        let check = check(&model, &measured(&model, Some(made), seed as u64));
        let found = check
            .likely()
            .unwrap_or_else(|| panic!("{kind}: {:?}", check.findings));
        assert_eq!(found.kind, kind, "{found:?}");
        let (value, error) = (found.value.unwrap(), found.std_error.unwrap());
        assert!((value - told).abs() < 4.0 * error, "{found:?}, made {told}");
        assert!(error < 0.2 * told.abs(), "{found:?}");
    }
}

/// All FRFs of one posture with the wrong sign.
#[test]
fn a_sign_of_a_whole_posture_is_found() {
    let model = model();
    let data = measured(&model, None, 5);
    let check_of = |data: &FrfData| check(&model, data).likely().cloned();
    let mut turned = data.clone();
    for frf in &mut Arc::make_mut(&mut turned.blocks[3]).frfs {
        for h in &mut frf.receptance {
            *h = -*h;
        }
    }
    let found = check_of(&turned).expect("a sign");
    assert_eq!((found.kind, found.place.as_str()), ("channel-sign", "posture d"));
}

/// A channel that records noise alone at one posture is no file of another quantity, which would hide the structure as well.
#[test]
fn a_channel_that_shows_nothing_is_found() {
    let model = model();
    let mut data = measured(&model, None, 5);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut normal = || crate::statistics::nearly_normal(&mut random) * std::f64::consts::FRAC_1_SQRT_2;
    let block = Arc::make_mut(&mut data.blocks[3]);
    let axis = block.frfs[0].response.axis;
    for frf in block.frfs.iter_mut().filter(|f| f.response.axis == axis) {
        for (h, std) in frf.receptance.iter_mut().zip(&frf.noise_std) {
            *h = Complex64::new(normal(), normal()) * *std;
        }
    }
    let check = check(&model, &data);
    let found = check.likely().expect("a dead channel");
    assert_eq!(
        (found.kind, found.place.as_str(), found.value),
        (
            "dead-channel",
            format!("posture d, response {}", axis.letter()).as_str(),
            Some(0.0)
        )
    );
}

/// A file filed under another posture, exchanged files, and signs.
#[test]
fn wrong_readings_are_found() {
    let model = model();
    let data = measured(&model, None, 5);
    let mut swapped = data.clone();
    let kinematics: Vec<_> = data.blocks.iter().map(|b| b.kinematics.clone()).collect();
    for (from, to) in [(0, 2), (2, 0)] {
        Arc::make_mut(&mut swapped.blocks[from]).kinematics = kinematics[to].clone();
    }
    let check_of = |data: &FrfData| check(&model, data).likely().cloned();
    let found = check_of(&swapped).expect("a swap");
    assert_eq!(found.kind, "posture-swap");
    assert_eq!(found.place, "postures a and c");

    let mut conjugated = data.clone();
    for block in &mut conjugated.blocks {
        for frf in &mut Arc::make_mut(block).frfs {
            for h in &mut frf.receptance {
                *h = h.conj();
            }
        }
    }
    assert_eq!(
        check_of(&conjugated).expect("conjugated").kind,
        "phase-conjugated"
    );

    let mut twice = data.clone();
    let mut again = data.blocks[0].as_ref().clone();
    again.posture = 1;
    // Measured another time: not the same numbers.
    for frf in &mut again.frfs {
        frf.posture = 1;
        frf.receptance.iter_mut().for_each(|h| *h *= 1.0 + 1e-6);
    }
    twice.blocks.push(Arc::new(again));
    let found = check_of(&twice).expect("duplicates");
    assert_eq!(found.kind, "duplicates");
    assert!(found.place.starts_with("posture b"), "{found:?}");
}

/// Measured at a posture that is in no list: no mistake has a name for it, and without it the others agree. Where an effect explains it
/// as well, nothing is said against the files.
#[test]
fn a_posture_that_contradicts_all_others_is_told() {
    let model = model();
    let mut data = measured(&model, None, 8);
    let block = Arc::make_mut(&mut data.blocks[2]);
    for (joint, off_rad) in [0.4, -0.3, 0.25, -0.5, 0.35, 0.6].into_iter().enumerate() {
        block.kinematics = block.kinematics.turned(joint + 1, off_rad);
    }
    let told = check(&model, &data);
    let found = told.likely().unwrap_or_else(|| panic!("{:?}", told.findings));
    assert_eq!(
        (found.kind, found.place.as_str()),
        ("posture-apart", "posture c contradicts all others")
    );
    assert!(found.remedy.contains("leaves 1.0"), "{}", found.remedy);
    let explained = Rival {
        label: "contact@tool".into(),
        gain_share: 0.999,
        parameters: 2,
    };
    let check = examine(&model, &data, &truth(&model), None, None, || Some(explained)).unwrap();
    assert!(check.likely().is_none(), "{:?}", check.findings);
    // Three postures of which none is wrong.
    assert!(check_without(&model, &data, 2).findings.is_empty());
}

/// The noise of few lines may be understated: a misfit of nine times the noise there, and no greater error than elsewhere.
#[test]
fn a_posture_with_understated_noise_contradicts_none() {
    let model = model();
    let mut data = measured(&model, None, 10);
    for frf in &mut Arc::make_mut(&mut data.blocks[2]).frfs {
        frf.noise_std.iter_mut().for_each(|std| *std /= 3.0);
    }
    let check = check(&model, &data);
    assert!(
        check.findings.iter().all(|f| f.kind != "posture-apart"),
        "{:?}",
        check.findings
    );
}

/// Hits and responses along X and Y of the tool alone, exchanged at one posture.
#[test]
fn axes_exchanged_at_one_posture_are_found() {
    let model = model();
    let mut data = measured(&model, None, 9);
    for block in &mut data.blocks {
        Arc::make_mut(block).frfs.retain(|f| {
            f.response.point == 0 && f.response.axis == f.reference.axis && f.response.axis != Axis::Z
        });
    }
    let block = Arc::make_mut(&mut data.blocks[1]);
    let [x, y] = [0, 1].map(|k| (block.frfs[k].receptance.clone(), block.frfs[k].noise_std.clone()));
    (block.frfs[0].receptance, block.frfs[0].noise_std) = y;
    (block.frfs[1].receptance, block.frfs[1].noise_std) = x;
    let check = check(&model, &data);
    let found = check.likely().unwrap_or_else(|| panic!("{:?}", check.findings));
    assert_eq!(found.kind, "axes", "{found:?}");
    assert!(found.place.starts_with("posture b"), "{found:?}");
    // The robot turned by a quarter about its first joint looks the same.
    assert!(
        found
            .remedy
            .contains("cannot tell it from encoder-offset (joint 1, posture b)"),
        "{found:?}"
    );
}

/// Without one posture.
fn check_without(model: &StructureModel, data: &FrfData, posture: usize) -> SetupCheck {
    check(model, &data.filtered(|p| p != posture))
}

/// Angles that the controller counts otherwise, and files in millimetres.
#[test]
fn other_conventions_and_units_are_found() {
    let model = model();
    let data = measured(&model, None, 5);
    let filed = |turn: &dyn Fn(&[f64]) -> f64| {
        let mut data = data.clone();
        for block in &mut data.blocks {
            let block = Arc::make_mut(block);
            let angles_rad = block.kinematics.joint_angles_rad(&model.robot.spec);
            block.kinematics = block.kinematics.turned(3, turn(&angles_rad));
        }
        check(&model, &data)
            .likely()
            .cloned()
            .expect("another convention")
    };
    let reversed = filed(&|q| -2.0 * q[2]);
    assert_eq!(
        (reversed.kind, reversed.place.as_str()),
        ("joint-convention", "joint 3, counted the other way round")
    );
    let linked = filed(&|q| q[1]);
    assert_eq!(
        (linked.kind, linked.place.as_str()),
        ("joint-convention", "joint 3, counted together with joint 2")
    );
    let zero = filed(&|_| -std::f64::consts::FRAC_PI_2);
    assert_eq!((zero.kind, zero.value), ("encoder-offset", Some(90.0)));

    let mut millimetres = data.clone();
    for block in &mut millimetres.blocks {
        for frf in &mut Arc::make_mut(block).frfs {
            frf.receptance.iter_mut().for_each(|h| *h *= 1e3);
            frf.noise_std.iter_mut().for_each(|std| *std *= 1e3);
        }
    }
    let found = check(&model, &millimetres).likely().cloned().expect("a factor");
    assert_eq!(found.kind, "channel-gain");
    assert!((found.value.unwrap() / 1e3 - 1.0).abs() < 0.01, "{found:?}");
    assert!(found.remedy.contains("mm called m"), "{}", found.remedy);
}

/// Another sampling rate than was written down, at one posture: accelerance on frequencies that are too low.
#[test]
fn another_frequency_axis_is_found_with_its_ratio() {
    let model = model();
    for (seed, ratio) in [(6, 1.28), (7, 0.5)] {
        let mut data = measured(&model, None, seed);
        let block = Arc::make_mut(&mut data.blocks[2]);
        block.frequency_hz.iter_mut().for_each(|f| *f /= ratio);
        for frf in &mut block.frfs {
            frf.receptance.iter_mut().for_each(|h| *h *= ratio * ratio);
            frf.noise_std.iter_mut().for_each(|std| *std *= ratio * ratio);
        }
        let check = check(&model, &data);
        let found = check.likely().unwrap_or_else(|| panic!("{:?}", check.findings));
        assert_eq!(
            (found.kind, found.place.as_str()),
            ("frequency-axis", "posture c")
        );
        let (value, error) = (found.value.unwrap(), found.std_error.unwrap());
        assert!((value - ratio).abs() < 4.0 * error && error < 1e-3, "{found:?}");
    }
}

/// The numbers of one posture in another order, with the point elsewhere; no single joint that is off explains them.
#[test]
fn mistyped_angles_are_found() {
    let model = model();
    let data = measured(&model, None, 5);
    let typed = |turns: fn(&[f64]) -> [(usize, f64); 2]| {
        let mut data = data.clone();
        let block = Arc::make_mut(&mut data.blocks[2]);
        let angles_rad = block.kinematics.joint_angles_rad(&model.robot.spec);
        for (joint, turn) in turns(&angles_rad) {
            block.kinematics = block.kinematics.turned(joint, turn);
        }
        let check = check(&model, &data);
        let found = check.likely().unwrap_or_else(|| panic!("{:?}", check.findings));
        (found.kind, found.place.clone(), found.value)
    };
    let exchanged = typed(|q| [(2, q[2] - q[1]), (3, q[1] - q[2])]);
    assert_eq!(
        exchanged,
        ("joint-angles", "joints 2 and 3, posture c".into(), None)
    );
    let (kind, place, value) = typed(|q| [(1, -0.9 * q[0]), (2, 0.0)]);
    assert_eq!((kind, place.as_str()), ("encoder-offset", "joint 1, posture c"));
    let right = data.blocks[2].kinematics.joint_angles_rad(&model.robot.spec)[0];
    assert!(
        (value.unwrap() - 0.9 * right.to_degrees()).abs() < 0.1,
        "{value:?}"
    );
}

/// One quantity taken for another in all files: the model is led far away, where another power looks nearer than the right one.
#[test]
fn another_quantity_in_all_files_is_found() {
    let model = model();
    for power in [-2, 2] {
        let mut data = measured(&model, None, 5);
        for block in &mut data.blocks {
            let block = Arc::make_mut(block);
            for frf in &mut block.frfs {
                let lines = block.frequency_hz.iter().zip(&mut frf.receptance);
                for ((f, h), std) in lines.zip(&mut frf.noise_std) {
                    let factor = Complex64::new(0.0, std::f64::consts::TAU * f).powi(power);
                    *h *= factor;
                    *std *= factor.norm();
                }
            }
        }
        let check = check(&model, &data);
        let found = check.likely().unwrap_or_else(|| panic!("{:?}", check.findings));
        assert_eq!((found.kind, found.value), ("quantity", Some(f64::from(power))));
    }
}

/// Apparent mass where accelerance is expected: both hold two derivatives.
#[test]
fn force_per_motion_is_found() {
    let model = model();
    let mut data = measured(&model, None, 5);
    let block = Arc::make_mut(&mut data.blocks[1]);
    let omega = block.frequency_hz.iter().map(|f| std::f64::consts::TAU * f);
    let omega: Vec<f64> = omega.collect();
    for frf in &mut block.frfs {
        for ((h, std), w) in frf.receptance.iter_mut().zip(&mut frf.noise_std).zip(&omega) {
            let read = (*h * w.powi(4)).finv();
            *std *= read.norm() / h.norm();
            *h = read;
        }
    }
    let check = check(&model, &data);
    let found = check.likely().unwrap_or_else(|| panic!("{:?}", check.findings));
    assert_eq!((found.kind, found.place.as_str()), ("quantity", "posture b"));
    assert!(found.remedy.contains("force per motion"), "{}", found.remedy);
}

/// The same numbers for two directions or two postures, and magnitudes alone, need no model to be seen; a reciprocal pair may be alike.
#[test]
fn copies_and_magnitudes_are_found() {
    let model = model();
    let data = measured(&model, None, 5);
    let points = &model.points;
    let receptance = |block: usize, response: usize, reference: Axis| {
        let frf = data.blocks[block].frfs.iter().find(|f| {
            (f.response.point, f.response.axis, f.reference.axis) == (0, Axis::ALL[response], reference)
        });
        frf.unwrap().receptance.clone()
    };
    let told = |block: usize, response: usize, reference: Axis, with: Vec<Complex64>| {
        let mut data = data.clone();
        let frfs = &mut Arc::make_mut(&mut data.blocks[block]).frfs;
        let frf = frfs.iter_mut().find(|f| {
            (f.response.point, f.response.axis, f.reference.axis) == (0, Axis::ALL[response], reference)
        });
        frf.unwrap().receptance = with;
        let told = numbers::without_model(&data, points);
        told.into_iter().map(|f| (f.kind, f.place)).collect::<Vec<_>>()
    };
    assert_eq!(numbers::without_model(&data, points), []);
    let directions = told(1, 2, Axis::X, receptance(1, 0, Axis::X));
    assert_eq!(
        directions,
        [("duplicates", "posture b: 1X/1X and 1Z/1X".to_string())]
    );
    let postures = told(3, 0, Axis::X, receptance(1, 0, Axis::X));
    assert_eq!(postures, [("duplicates", "postures b and d: 1X/1X".to_string())]);
    assert_eq!(told(1, 2, Axis::X, receptance(1, 0, Axis::Z)), []);
    let magnitudes = receptance(1, 0, Axis::X)
        .iter()
        .map(|h| Complex64::from(-h.norm()))
        .collect();
    assert_eq!(
        told(1, 0, Axis::X, magnitudes),
        [("phase-missing", "posture b".to_string())]
    );
}

/// Hits that were off at one posture are what every laboratory has, and are taken; what is the same in all files is not.
#[test]
fn small_errors_take_what_differs_between_postures_and_no_more() {
    let model = model();
    let all = mistakes::all(&model, &arrangement(&model));
    let share_taken = |index: usize, group: FrfGroup, values: &[f64]| {
        let made = Made {
            mistake: all[index].as_ref(),
            group,
            values,
        };
        let data = measured(&model, Some(made), 7);
        let problem = FrfProblem::likelihood(&model, &data);
        let fit = minimise(&problem, &truth(&model), &model.bounds(), Stopping::default()).unwrap();
        let mut curves = model.rest(&fit.theta, &data).unwrap();
        let tests = rest_patterns::test(&curves);
        let before = *rest::largest(&tests).expect("it shows");
        let after = absorb_slips(&model, &data, &fit.theta, &curves).unwrap();
        assert!(after.price > 0.0 && after.evidence > 0.0);
        let beyond = rest_patterns::test_beyond(&mut curves, after);
        let same = beyond
            .tests
            .iter()
            .find(|t| t.looks_like == before.looks_like)
            .unwrap();
        1.0 - same.excess / before.excess
    };
    let posture = FrfGroup {
        posture: Some(0),
        ..FrfGroup::ALL
    };
    let taken = share_taken(9, posture, &[2.0, -1.5, 1.0]);
    assert!(taken > 0.9, "{taken}");
    // Too large for slopes alone.
    let taken = share_taken(9, posture, &[12.0, -9.0, 6.0]);
    assert!(taken > 0.9, "{taken}");
    let taken = share_taken(16, FrfGroup::ALL, &[3.0]);
    assert!(taken < 0.7, "{taken}");
}

/// Two postures and every sixth line: enough to see what a mistake does to a file.
fn few(model: &StructureModel) -> FrfData {
    let mut data = arrangement(model).filtered(|posture| posture < 2);
    for block in &mut data.blocks {
        let block = Arc::make_mut(block);
        block.frequency_hz = block.frequency_hz.iter().copied().step_by(6).collect();
        for frf in &mut block.frfs {
            frf.receptance.truncate(block.frequency_hz.len());
            frf.noise_std.truncate(block.frequency_hz.len());
        }
    }
    data
}

/// Curves with the mistake of this index at these sizes in all files, and without.
fn spoilt(model: &StructureModel, index: usize, values: &[f64]) -> [scene::Curves; 2] {
    let data = few(model);
    let all = mistakes::all(model, &data);
    let made = Made {
        mistake: all[index].as_ref(),
        group: FrfGroup::ALL,
        values,
    };
    [Some(made), None].map(|made| predict(model, &truth(model), &data, made).unwrap())
}

/// Filters at their corner, 19 Hz: of first order they turn by 45° and let 1/√2 through, Butterworth's second order turns by 90°.
#[test]
fn filters_do_to_a_file_what_their_corner_says() {
    let model = model();
    let line = 10;
    let corner_rad = std::f64::consts::TAU * few(&model).blocks[0].frequency_hz[line];
    let i = Complex64::i();
    let cases = [
        (12, corner_rad, i / (1.0 + i)),
        (14, corner_rad, (i / (1.0 + i)).powi(2)),
        (13, 1.0 / corner_rad, 1.0 / (1.0 + i)),
        (15, 1.0 / corner_rad, 1.0 / (i * std::f64::consts::SQRT_2)),
        (8, 0.3, Complex64::from(0.3f64.exp())),
        // Late by a quarter of the period.
        (17, 0.25 * std::f64::consts::TAU / corner_rad, -i),
    ];
    for (index, value, expected) in cases {
        let [with, without] = spoilt(&model, index, &[value]);
        for (with, without) in with.iter().zip(&without) {
            assert!((with[line] / without[line] - expected).norm() < 1e-9, "{index}");
        }
    }
}

/// A quarter turn about z: who hits along x hits along y, and who measures x measures y.
#[test]
fn a_quarter_turn_takes_one_axis_for_another() {
    let model = model();
    let at = |response: usize, reference: usize| 3 * response + reference;
    let [hit, plain] = spoilt(&model, 9, &[0.0, 0.0, 90.0]);
    let [sensor, _] = spoilt(&model, 10, &[0.0, 0.0, 90.0]);
    for line in 0..plain[0].len() {
        for k in 0..3 {
            assert!(
                (hit[at(k, 0)][line] - plain[at(k, 1)][line]).norm() < 1e-9 * plain[at(k, 1)][line].norm()
            );
            assert!(
                (sensor[at(0, k)][line] - plain[at(1, k)][line]).norm() < 1e-9 * plain[at(1, k)][line].norm()
            );
            assert!(
                (hit[at(k, 2)][line] - plain[at(k, 2)][line]).norm() < 1e-9 * plain[at(k, 2)][line].norm()
            );
        }
    }
}

/// A light sensor adds its inertia's force −m s² x to the hit (s = iω); one of a thousand tonnes stands still, and so does the point.
#[test]
fn a_sensors_mass_loads_the_point_that_it_sits_on() {
    let model = model();
    let mass = 1e-3;
    let [light, plain] = spoilt(&model, 16, &[mass]);
    let [heavy, _] = spoilt(&model, 16, &[1e6]);
    let frequency_hz = &few(&model).blocks[0].frequency_hz;
    for (line, hz) in frequency_hz.iter().enumerate() {
        let inertia = mass * (std::f64::consts::TAU * hz).powi(2);
        for response in 0..3 {
            for reference in 0..3 {
                let at = |a: usize, b: usize| plain[3 * a + b][line];
                let through: Complex64 = (0..3).map(|a| at(response, a) * at(a, reference)).sum();
                let change = light[3 * response + reference][line] - at(response, reference);
                assert!((change - through * inertia).norm() < 0.01 * through.norm() * inertia);
                assert!(
                    heavy[3 * response + reference][line].norm() < 1e-2 * at(reference, reference).norm()
                );
            }
        }
    }
}

/// A window that decays by d moves every pole by d: H at s + d, which of a smooth function is H + d dH/ds.
#[test]
fn an_exponential_window_moves_the_poles() {
    let model = model();
    let decay = 1e-3;
    let [with, without] = spoilt(&model, 11, &[decay]);
    let mut data = few(&model);
    let step_hz = 1e-3;
    let mut beside = |sign: f64| {
        for block in &mut data.blocks {
            let block = Arc::make_mut(block);
            block.frequency_hz.iter_mut().for_each(|f| *f += sign * step_hz);
        }
        predict(&model, &truth(&model), &data, None).unwrap()
    };
    let (above, below) = (beside(1.0), beside(-2.0));
    for (k, curve) in with.iter().enumerate() {
        for line in 0..curve.len() {
            let ds = Complex64::i() * (2.0 * step_hz * std::f64::consts::TAU);
            let slope = (above[k][line] - below[k][line]) / ds;
            let change = curve[line] - without[k][line];
            assert!(
                (change - slope * decay).norm() < 0.01 * slope.norm() * decay,
                "{k} {line}"
            );
        }
    }
}

/// A gain of one posture that is 1 % too large: to first order it is found with its size, and takes away the χ² that it made but
/// for what stiffnesses and damping can do.
#[test]
fn the_score_of_a_gain_is_its_size_and_what_it_cost() {
    let model = model();
    let mut data = few(&model);
    let theta = truth(&model);
    let all = mistakes::all(&model, &data);
    let group = FrfGroup {
        posture: Some(1),
        ..FrfGroup::ALL
    };
    let made = Made {
        mistake: all[8].as_ref(),
        group,
        values: &[0.01],
    };
    let mut curves = predict(&model, &theta, &data, Some(made)).unwrap().into_iter();
    for block in &mut data.blocks {
        for frf in &mut Arc::make_mut(block).frfs {
            frf.receptance = curves.next().unwrap();
            frf.noise_std = frf.receptance.iter().map(|h| 0.02 * h.norm()).collect();
        }
    }
    let plain = predict(&model, &theta, &data, None).unwrap();
    let chi2: f64 = scene::weighted(&plain, &data).iter().map(|r| r * r).sum();
    // Of each line of eighteen FRFs, 2 · (0.01 / 0.02)².
    assert!((chi2 / (18.0 * 40.0 * 0.5) - 1.0).abs() < 0.05, "{chi2}");
    let linearised = score::Linearised::new(&model, &data, &theta).unwrap();
    let scores = linearised.scores(all[8].as_ref()).unwrap();
    let own = scores.iter().find(|s| s.group == group).unwrap();
    // Between its usual size and nothing the prior leaves it; the parameters cannot stand in for a gain.
    assert!((own.values[0] / 0.01 - 1.0).abs() < 0.1, "{own:?}");
    assert!(
        own.gain > 0.7 * chi2 && own.gain < 1.05 * chi2,
        "{own:?} of {chi2}"
    );
    let best = scores.iter().max_by(|a, b| a.gain.total_cmp(&b.gain)).unwrap();
    assert_eq!(best.group, group);
}

/// A finding that is hardly one, and one that was taken out of the measurements while they were read: neither keeps a verdict from being
/// certain, and only the latter was there for sure.
#[test]
fn what_was_taken_out_is_no_longer_likely() {
    let finding = |confidence: f64| SetupFinding {
        kind: "spindle-speed-variation",
        place: "all cuts".into(),
        value: Some(0.2),
        std_error: Some(0.01),
        unit: "rad",
        confidence,
        remedy: "look".into(),
    };
    let check = |confidences: &[f64], last_taken_out: usize| SetupCheck {
        findings: confidences.iter().map(|c| finding(*c)).collect(),
        last_taken_out,
        ..SetupCheck::default()
    };
    for (confidences, last_taken_out, likely, taken_out) in [
        (vec![], 0, None, vec![]),
        (vec![0.3], 0, None, vec![]),
        (vec![0.9, 0.2], 0, Some(0.9), vec![]),
        (vec![0.97], 1, None, vec![0.97]),
        (vec![0.3, 0.97], 1, None, vec![0.97]),
        (vec![0.8, 0.97], 1, Some(0.8), vec![0.97]),
    ] {
        let check = check(&confidences, last_taken_out);
        assert_eq!(check.likely().map(|f| f.confidence), likely, "{confidences:?}");
        let out: Vec<f64> = check.taken_out().iter().map(|f| f.confidence).collect();
        assert_eq!(out, taken_out, "{confidences:?}");
    }
}

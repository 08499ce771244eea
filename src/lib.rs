//! Lobestone fits physical models of machining robots to measurements and says which physics the model lacks.
//!
//! Two kinds of measurement go in: frequency response functions (FRFs) of the robot's structure, from hammer tests, and
//! records of cutting forces from a dynamometer. Out come modes, a calibrated robot model, cutting force coefficients, the
//! effect that is missing (or that none is, or none that is known), and the depths of cut that stay free of chatter.
//!
//! The program `lobestone` works on campaign folders; the library works on plain values as well. Three ways in:
//!
//! # From FRFs to modes
//!
//! ```
//! use lobestone::Complex64;
//! use lobestone::modal::{Settings, analyse_frf};
//!
//! // Receptance in m/N on lines in Hz. Yours is measured; this one has a mode at 12 Hz with 3 % damping.
//! let frequency_hz: Vec<f64> = (0..400).map(|line| 4.0 + 0.05 * f64::from(line)).collect();
//! let receptance = |f: &f64| 1e-6 / Complex64::new(1.0 - (f / 12.0).powi(2), 2.0 * 0.03 * f / 12.0);
//! let receptance_m_per_n: Vec<Complex64> = frequency_hz.iter().map(receptance).collect();
//!
//! let found = analyse_frf(&frequency_hz, &receptance_m_per_n, &Settings::default())?;
//! let mode = found.modes[0].best();
//! assert!((mode.frequency_hz - 12.0).abs() < 0.001);
//! assert!((mode.damping_ratio - 0.03).abs() < 1e-4);
//! # Ok::<(), lobestone::Error>(())
//! ```
//!
//! [`modal::global`] takes several FRFs of one structure together and gives mode shapes, too.
//!
//! # From a robot and its FRFs to a calibrated model and a verdict
//!
//! ```
//! use lobestone::analysis::structure::{StructureAnalysis, study_of};
//! use lobestone::data::{AxesRef, BodyRef, MeasuredDof, MeasuredFrf, Point, Posture, RobotSpec};
//! use lobestone::discrepancy::diagnose;
//! use lobestone::identify::{Options, StructureCase};
//!
//! let robot = RobotSpec::load("irb6640", ".".as_ref())?; // built in; yours is a file
//! let joints_deg = [[135.0, -2.0, 53.0, 83.0, 30.0, -117.0], [135.0, 20.0, 26.0, 30.0, 80.0, -150.0]];
//! let postures = joints_deg.map(|q| Posture { id: format!("{q:?}"), joints_deg: q.to_vec() });
//! let tool_point = Point { node: 1, body: BodyRef::Tool, position_m: [0.0; 3], axes: AxesRef::Base };
//! let frfs: Vec<MeasuredFrf> = measured(&robot, &postures, &tool_point)?; // X and Y, 35 kg on the flange
//!
//! let case = StructureCase::new(robot, &postures, vec![tool_point], frfs)?;
//! let case = StructureAnalysis::of_case(case, Options::default())?.settled_case();
//! let diagnosis = diagnose(&study_of(&case, Options::default()), &case.model)?;
//! let missing = diagnosis.winner().expect("more than noise is left");
//! assert_eq!(missing.label(), "payload");
//! assert!((missing.parameters[0].value - 35.0).abs() < 4.0 * missing.parameters[0].std_error); // kg
//! #
//! # /// What the model with that payload says, and 1 % noise.
//! # fn measured(robot: &RobotSpec, postures: &[Posture], at: &Point) -> lobestone::Result<Vec<MeasuredFrf>> {
//! #     use lobestone::Complex64;
//! #     use rand::{Rng, SeedableRng};
//! #     let frequency_hz: Vec<f64> = (0..280).map(|line| 4.0 + 0.2 * f64::from(line)).collect();
//! #     let mut frfs = Vec::new();
//! #     for posture in 0..postures.len() {
//! #         for axis in [lobestone::data::Axis::X, lobestone::data::Axis::Y] {
//! #             let dof = MeasuredDof { point: 0, axis, negative: false };
//! #             frfs.push(MeasuredFrf {
//! #                 posture, response: dof, reference: dof, name: format!("{posture} {axis:?}"),
//! #                 frequency_hz: frequency_hz.clone(), receptance_m_per_n: vec![Complex64::ONE; frequency_hz.len()],
//! #                 coherence: None, force_level_n: None, file: Default::default(),
//! #             });
//! #         }
//! #     }
//! #     let case = StructureCase::new(robot.clone(), postures, vec![at.clone()], frfs.clone())?;
//! #     let payload = lobestone::effects::Registry::structure().find(robot, "payload")[0];
//! #     let model = case.model.with_effect(payload, &case.model.known(&case.data.summary()));
//! #     let mut theta = model.nominal_theta();
//! #     let last = theta.len() - 1;
//! #     theta[last] = model.parameters[last].internal(35.0);
//! #     let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
//! #     for (frf, exact) in frfs.iter_mut().zip(model.predict(&theta, &case.data)?) {
//! #         let scale = exact.iter().map(|h| h.norm()).sum::<f64>() / exact.len() as f64;
//! #         let mut noise = || 0.01 * scale * rng.random_range(-1.7..1.7);
//! #         frf.receptance_m_per_n = exact.iter().map(|h| h + Complex64::new(noise(), noise())).collect();
//! #     }
//! #     Ok(frfs)
//! # }
//! # Ok::<(), lobestone::Error>(())
//! ```
//!
//! # From coefficients and modes to stability lobes
//!
//! ```
//! use lobestone::lobes::{AxisMode, ModalFrf, RegenerativeForce, SpeedLimit, StabilitySolver, speed_grid};
//!
//! let mode = |axis, frequency_hz| AxisMode { axis, frequency_hz, damping_ratio: 0.03, stiffness_n_per_m: 1.2e6 };
//! let frf = ModalFrf::from_axis_modes(&[mode(0, 12.3), mode(1, 17.8)])?;
//! // Drilling in aluminium: Ktc and Krc in N/mm², half point angle in rad, two lips.
//! let force = RegenerativeForce::drilling_lateral(1014.2, 619.9, 1.178, 2)?;
//! let solver = StabilitySolver::new(force, &frf);
//!
//! let limit = solver.absolute_limit().expect("these modes can chatter");
//! let curve = solver.curve(&speed_grid([100.0, 1500.0, 10.0])?);
//! let best = &solver.best(&curve, 1)[0];
//! println!("{:.3} mm at every speed, {:?} mm at {:.0} rpm", limit.depth_mm, best.depth_mm, best.spindle_rpm);
//! assert!(limit.depth_mm > 0.0 && best.depth_mm.is_none_or(|depth| depth > limit.depth_mm));
//! # Ok::<(), lobestone::Error>(())
//! ```
//!
//! `examples/` has six programs of this kind, to be run with `cargo run --release --example modes_from_frfs`.
//!
//! # The rooms
//!
//! Each knows only those above it.
//!
//! | module | what is in it |
//! |---|---|
//! | [`data`] | what was measured, on what: FRFs, records, postures, points, tools, cuts as plain values |
//! | [`signal`] | drift of charge amplifiers, steady windows, spectra, noise of FRFs and records |
//! | [`modal`] | modes from FRFs, one by one and together; from hammer hits and from accelerations alone |
//! | [`robot`] | kinematics, the chain of compliant elements, its FRF and static stiffness, inverse kinematics |
//! | [`cutting`] | force models of milling, drilling and turning, averages of records, regression of coefficients |
//! | [`lobes`] | stability limits over spindle speed, by several solvers; best speeds, redundancy, maps |
//! | [`effects`] | physical effects that a model may lack, one file each |
//! | [`identify`] | parameters with priors, the least-squares solver, a model and its data ready to be fitted |
//! | [`discrepancy`] | where a model fails, which effect it lacks, what to measure next, mistakes of the setup |
//! | [`ingest`] | readers of laboratory files: UFF, DynoWare, TDMS, LVM, MAT, CSV |
//! | [`campaign`] | a folder of measurements and its `campaign.toml` |
//! | [`revision`] | what a campaign's model has learned so far |
//! | [`analysis`] | whole analyses, as the commands and the report need them: the place to begin |
#![cfg_attr(
    feature = "report",
    doc = "| [`thesis`] | the IRB 6640 case study (feature `report`) |"
)]
#![cfg_attr(
    feature = "lab",
    doc = "| [`simulate`] | the virtual lab: campaigns whose truth is known (feature `lab`) |"
)]
#![cfg_attr(
    feature = "report",
    doc = "| [`report`] | figures, pages and tables (feature `report`) |"
)]
#![cfg_attr(
    feature = "serve",
    doc = "| [`serve`](crate) | the page in a browser, reached through the command (feature `serve`) |"
)]
#![cfg_attr(feature = "cli", doc = "| [`commands`] | the command line (feature `cli`) |")]
//!
//! Below all of them: [`error`], [`files`], [`parameter`], [`progress`], [`statistics`], [`stop`], [`text`], [`threads`], and [`builtin`] data.
//!
//! # Features
//!
//! `cli`, `serve`, `report` and `lab` (together: `program`) and `parquet` are on by default. A program that only calculates
//! says `default-features = false` and builds none of the crates for terminals, web pages, pictures and tables.
//!
//! # Conventions
//!
//! SI inside; where a laboratory counts in mm, degrees, rpm or N/mm², the name says it (`depth_mm`). FRFs are receptances in
//! m/N for e^{+iωt}, frequencies in Hz ascending. Results do not depend on the number of threads after [`sums_in_order`]. The
//! library prints nothing: [`progress`] tells how far long work is, and [`stop`] ends it.

#![warn(missing_docs)]

/// The page for developers, whose example is compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../docs/adding-an-effect.md")]
pub struct AddingAnEffect;

pub mod analysis;
pub mod builtin;
pub mod campaign;
#[cfg(feature = "cli")]
pub mod commands;
pub mod cutting;
pub mod data;
pub mod discrepancy;
pub mod effects;
pub mod error;
pub mod files;
pub mod identify;
pub mod ingest;
pub mod lobes;
pub mod modal;
pub mod parameter;
pub mod progress;
#[cfg(feature = "report")]
pub mod report;
pub mod revision;
pub mod robot;
// Reached through the command only.
#[cfg(feature = "serve")]
#[cfg_attr(not(feature = "cli"), allow(dead_code, unused_imports))]
pub(crate) mod serve;
pub mod signal;
#[cfg(feature = "lab")]
pub mod simulate;
pub mod statistics;
pub mod stop;
pub mod text;
#[cfg(feature = "report")]
pub mod thesis;
pub mod threads;

pub use analysis::{ModalAnalysis, StructureAnalysis};
pub use campaign::Campaign;
pub use error::{Error, InputError, Result};
pub use identify::StructureCase;
/// The complex number of FRFs; of the crate `num-complex`.
pub use num_complex::Complex64;
pub use threads::sums_in_order;

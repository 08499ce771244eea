//! What `lobestone modal` found, as docs/json.md has it.

use num_complex::Complex64;
use serde::Serialize;

use crate::analysis::modes::modal_export::scaled_modes;
use crate::analysis::{ModalAnalysis, SetModes};
use crate::commands::measure::modal_files::FilesWritten;
use crate::modal::quality::{Quality, QualityGrade, SetQuality};
use crate::modal::scaling::{DrivingPoint, ScaledMode};
use crate::modal::stabilisation::Stabilisation;
use crate::modal::{Disturbance, FrfMode, GlobalMode, Hit, ModeEstimate, RejectedMode, SineLine};
use crate::report::modal_page::driving_points;

#[derive(Serialize)]
pub(super) struct ModalDocument<'a> {
    frfs: Vec<Frf<'a>>,
    global: Vec<Global<'a>>,
    rejected: Vec<Rejected<'a>>,
    quality: Option<&'a SetQuality>,
    sets: Vec<Set<'a>>,
    tracked: Vec<Tracked<'a>>,
    hits: Vec<FileHits<'a>>,
    #[serde(flatten)]
    files: &'a FilesWritten,
    warnings: &'a [String],
}

impl<'a> ModalDocument<'a> {
    /// `campaign`: a set is a posture; else it is a file.
    pub fn new(analysis: &'a ModalAnalysis, campaign: bool, files: &'a FilesWritten) -> Self {
        let name = |set: &'a SetModes| match campaign {
            true => SetName::Posture(&set.set),
            false => SetName::File(&set.set),
        };
        let sets = || analysis.sets.iter().map(|set| (set, name(set)));
        let tracks = analysis.tracks();
        ModalDocument {
            frfs: sets().flat_map(|(set, name)| Frf::of(set, name)).collect(),
            global: sets().flat_map(|(set, name)| Global::of(set, name)).collect(),
            rejected: sets()
                .flat_map(|(set, name)| {
                    set.global
                        .rejected
                        .iter()
                        .map(move |pole| Rejected { set: name, pole })
                })
                .collect(),
            quality: analysis.quality(),
            sets: sets().map(|(set, name)| Set::of(set, name)).collect(),
            tracked: tracks
                .iter()
                .map(|track| Tracked {
                    modes: sets()
                        .zip(&track.mode_of_set)
                        .map(|((set, name), mode)| ModeOfSet::of(set, name, *mode))
                        .collect(),
                })
                .collect(),
            hits: analysis
                .hits
                .iter()
                .map(|(file, hits)| FileHits { file, hits })
                .collect(),
            files,
            warnings: &analysis.warnings,
        }
    }
}

/// What a set of FRFs is called; the key says what it is.
#[derive(Clone, Copy, Serialize)]
#[serde(rename_all = "lowercase")]
enum SetName<'a> {
    Posture(&'a str),
    File(&'a str),
}

/// One FRF by itself.
#[derive(Serialize)]
struct Frf<'a> {
    name: &'a str,
    #[serde(flatten)]
    set: SetName<'a>,
    modes: Vec<Estimate<'a>>,
    warnings: Vec<&'a String>,
    quality: &'a Quality,
}

impl<'a> Frf<'a> {
    fn of(set: &'a SetModes, name: SetName<'a>) -> impl Iterator<Item = Frf<'a>> {
        set.frfs.iter().map(move |frf| Frf {
            name: &frf.input.name,
            set: name,
            modes: frf.modes.modes.iter().flat_map(Estimate::of).collect(),
            warnings: frf.modes.warnings.iter().chain(&frf.modes.remarks).collect(),
            quality: &frf.quality,
        })
    }
}

/// The answer of one method for a mode.
#[derive(Serialize)]
struct Estimate<'a> {
    #[serde(flatten)]
    estimate: &'a ModeEstimate,
    recommended: bool,
    #[serde(flatten)]
    why: Option<WhyRecommended<'a>>,
}

/// Of the recommended one.
#[derive(Serialize)]
struct WhyRecommended<'a> {
    reason: &'a str,
    disturbance: Option<Disturbance>,
}

impl<'a> Estimate<'a> {
    fn of(mode: &'a FrfMode) -> impl Iterator<Item = Estimate<'a>> {
        mode.estimates.iter().map(|estimate| {
            let recommended = estimate.method == mode.recommended;
            Estimate {
                estimate,
                recommended,
                why: recommended.then_some(WhyRecommended {
                    reason: &mode.reason,
                    disturbance: mode.disturbance,
                }),
            }
        })
    }
}

/// A mode that the FRFs of a set share.
#[derive(Serialize)]
struct Global<'a> {
    #[serde(flatten)]
    set: SetName<'a>,
    #[serde(flatten)]
    mode: &'a GlobalMode,
    shape: Vec<ShapePart<'a>>,
    modal_constants: Vec<ModalConstant<'a>>,
    /// Where a driving point gives the mode one.
    #[serde(skip_serializing_if = "Option::is_none")]
    scale: Option<ModeScale<'a>>,
}

impl<'a> Global<'a> {
    fn of(set: &'a SetModes, name: SetName<'a>) -> impl Iterator<Item = Global<'a>> {
        let modes = set.global.modes.iter().zip(scaled_modes(set));
        modes.map(move |(mode, scale)| Global {
            set: name,
            mode,
            shape: mode
                .shape
                .iter()
                .map(|(dof, z)| ShapePart::of(set, *dof, *z))
                .collect(),
            modal_constants: ModalConstant::of(set, mode).collect(),
            scale: scale.map(|scale| ModeScale::of(set, &scale)),
        })
    }
}

/// One degree of freedom of a shape whose largest component is 1.
#[derive(Serialize)]
struct ShapePart<'a> {
    dof: Option<&'a str>,
    re: f64,
    im: f64,
}

impl<'a> ShapePart<'a> {
    fn of(set: &'a SetModes, dof: usize, z: Complex64) -> Self {
        let name = match set.dofs.is_empty() {
            true => set.frfs.get(dof).map(|f| &f.input.name),
            false => set.dofs.get(dof),
        };
        ShapePart {
            dof: name.map(String::as_str),
            re: z.re,
            im: z.im,
        }
    }
}

#[derive(Serialize)]
struct ModalConstant<'a> {
    frf: &'a str,
    re_per_kg: f64,
    im_per_kg: f64,
    std_per_kg: f64,
}

impl<'a> ModalConstant<'a> {
    fn of(set: &'a SetModes, mode: &'a GlobalMode) -> impl Iterator<Item = ModalConstant<'a>> {
        set.frfs
            .iter()
            .zip(&mode.constants)
            .filter_map(|(frf, constant)| {
                let (value, std_per_kg) = (*constant)?;
                Some(ModalConstant {
                    frf: &frf.input.name,
                    re_per_kg: value.re,
                    im_per_kg: value.im,
                    std_per_kg,
                })
            })
    }
}

/// Modal mass and modal A of the shape whose largest component is 1, and the shape of unity modal mass.
#[derive(Serialize)]
struct ModeScale<'a> {
    driving_point: &'a str,
    modal_mass_kg: f64,
    modal_mass_std_kg: f64,
    modal_a_re_kg_per_s: f64,
    modal_a_im_kg_per_s: f64,
    unity_mass_shape: Vec<UnityMassPart<'a>>,
}

/// 1/√kg.
#[derive(Serialize)]
struct UnityMassPart<'a> {
    dof: &'a str,
    re: f64,
    im: f64,
    real_normal: f64,
}

impl<'a> ModeScale<'a> {
    fn of(set: &'a SetModes, scale: &ScaledMode) -> Self {
        let name = |dof: usize| set.dofs.get(dof).map_or("", String::as_str);
        let parts = scale.unity_mass.iter().zip(&scale.real_normal);
        ModeScale {
            driving_point: name(scale.driving_dof),
            modal_mass_kg: scale.modal_mass_kg,
            modal_mass_std_kg: scale.modal_mass_std_kg,
            modal_a_re_kg_per_s: scale.modal_a.re,
            modal_a_im_kg_per_s: scale.modal_a.im,
            unity_mass_shape: parts
                .map(|(&(dof, z), &(_, real_normal))| UnityMassPart {
                    dof: name(dof),
                    re: z.re,
                    im: z.im,
                    real_normal,
                })
                .collect(),
        }
    }
}

/// What resembled a mode.
#[derive(Serialize)]
struct Rejected<'a> {
    #[serde(flatten)]
    set: SetName<'a>,
    #[serde(flatten)]
    pole: &'a RejectedMode,
}

/// How far a set can be trusted.
#[derive(Serialize)]
struct Set<'a> {
    #[serde(flatten)]
    set: SetName<'a>,
    verdict: QualityGrade,
    why: &'a str,
    quality: &'a SetQuality,
    sine_lines: &'a [SineLine],
    mac: &'a [Vec<f64>],
    stabilisation: &'a Stabilisation,
    driving_points: Vec<DrivingPoint>,
}

impl<'a> Set<'a> {
    fn of(set: &'a SetModes, name: SetName<'a>) -> Self {
        Set {
            set: name,
            verdict: set.verdict,
            why: &set.why,
            quality: &set.global.quality,
            sine_lines: &set.global.sine_lines,
            mac: &set.global.mac,
            stabilisation: &set.global.stabilisation,
            driving_points: driving_points(set),
        }
    }
}

/// The same mode from set to set.
#[derive(Serialize)]
struct Tracked<'a> {
    modes: Vec<ModeOfSet<'a>>,
}

#[derive(Serialize)]
struct ModeOfSet<'a> {
    #[serde(flatten)]
    set: SetName<'a>,
    frequency_hz: Option<f64>,
    frequency_std_hz: Option<f64>,
    damping_ratio: Option<f64>,
    damping_std: Option<f64>,
}

impl<'a> ModeOfSet<'a> {
    fn of(set: &'a SetModes, name: SetName<'a>, mode: Option<usize>) -> Self {
        let mode = mode.map(|k| &set.global.modes[k]);
        ModeOfSet {
            set: name,
            frequency_hz: mode.map(|m| m.frequency_hz),
            frequency_std_hz: mode.map(|m| m.frequency_std_hz),
            damping_ratio: mode.map(|m| m.damping_ratio),
            damping_std: mode.map(|m| m.damping_std),
        }
    }
}

/// Hammer hits of a raw record.
#[derive(Serialize)]
struct FileHits<'a> {
    file: &'a str,
    hits: &'a [Hit],
}

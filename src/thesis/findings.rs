//! What the tables of the case study come to in a few numbers.

use super::case_study::{CaseStudy, ComparedRow, case_study};
use super::measured_lobes::thesis_force;
use crate::Result;

/// Smallest and largest of a set of ratios.
pub type Range = [f64; 2];

/// The study, and what its tables come to.
pub struct ThesisFindings {
    /// The tables themselves.
    pub study: CaseStudy,
    /// Static stiffness, model / measured: as published, ours before and after calibration on the modal table.
    pub static_published: Option<Range>,
    /// Static stiffness, model / measured: ours before calibration.
    pub static_before: Option<Range>,
    /// Static stiffness, model / measured: ours after calibration.
    pub static_after: Option<Range>,
    /// Frequency of the strongest mode, published model / measured, and ours before.
    pub frequency_published: Option<Range>,
    /// Frequency of the strongest mode, before / measured.
    pub frequency_before: Option<Range>,
    /// On the configuration that was not fitted: after / measured, and before / measured.
    pub predicted_after: Option<Range>,
    /// On the configuration that was not fitted: before / measured.
    pub predicted_before: Option<Range>,
    /// The same for the peak real receptance.
    pub receptance_after: Option<Range>,
    /// Peak real receptance on the configuration that was not fitted: after / measured.
    pub predicted_receptance_after: Option<Range>,
    /// Speeds of the commercial program's tips over ours from the measured minima: second and first region.
    pub speed_second_region: Option<Range>,
    /// Speeds of the commercial program's tips over ours, first region.
    pub speed_first_region: Option<Range>,
    /// Depths, likewise, both regions.
    pub depth: Option<Range>,
    /// The thesis's own program's depths over the commercial program's.
    pub published_depth: Option<Range>,
    /// Teeth behind the lobes.
    pub teeth: usize,
}

fn range(ratios: impl Iterator<Item = f64>) -> Option<Range> {
    ratios
        .filter(|r| r.is_finite())
        .fold(None, |range, r| match range {
            None => Some([r, r]),
            Some([low, high]) => Some([low.min(r), high.max(r)]),
        })
}

fn over_measured(rows: &[ComparedRow], value: impl Fn(&ComparedRow) -> Option<f64>) -> Option<Range> {
    range(rows.iter().filter_map(|row| Some(value(row)? / row.measured?)))
}

impl ThesisFindings {
    /// # Errors
    /// As [`case_study`].
    pub fn run() -> Result<Self> {
        Ok(Self::of(case_study()?, thesis_force()?.teeth))
    }

    fn of(study: CaseStudy, teeth: usize) -> Self {
        let predicted = |row: &ComparedRow| !row.fitted;
        let tips = |region: usize| {
            study.lobes.iter().filter_map(move |row| {
                let ours = match region {
                    0 => row.from_measurements.second_region?,
                    _ => row.from_measurements.first_region?,
                };
                Some((*row.commercial.get(region)?, ours))
            })
        };
        let speeds = |region| range(tips(region).map(|(theirs, ours)| theirs.spindle_rpm / ours.spindle_rpm));
        let depth = tips(0)
            .chain(tips(1))
            .filter_map(|(theirs, ours)| Some(theirs.depth_mm? / ours.depth_mm?));
        let published_depth = study.lobes.iter().flat_map(|row| {
            row.published_program
                .iter()
                .zip(&row.commercial)
                .filter_map(|(a, b)| Some(a.depth_mm? / b.depth_mm?))
        });
        ThesisFindings {
            static_published: over_measured(&study.static_stiffness, |r| r.published_model),
            static_before: over_measured(&study.static_stiffness, |r| Some(r.before)),
            static_after: over_measured(&study.static_stiffness, |r| Some(r.after)),
            frequency_published: over_measured(&study.frequencies, |r| r.published_model),
            frequency_before: over_measured(&study.frequencies, |r| Some(r.before)),
            predicted_after: over_measured(&study.frequencies, |r| predicted(r).then_some(r.after)),
            predicted_before: over_measured(&study.frequencies, |r| predicted(r).then_some(r.before)),
            receptance_after: over_measured(&study.receptances, |r| r.fitted.then_some(r.after)),
            predicted_receptance_after: over_measured(&study.receptances, |r| {
                predicted(r).then_some(r.after)
            }),
            speed_second_region: speeds(0),
            speed_first_region: speeds(1),
            depth: range(depth),
            published_depth: range(published_depth),
            teeth,
            study,
        }
    }

    /// Whether calibrating on the modal table moved the static stiffness further from its measurement.
    pub fn static_got_worse(&self) -> bool {
        let distance = |[low, high]: Range| low.ln().abs().max(high.ln().abs());
        match (self.static_before, self.static_after) {
            (Some(before), Some(after)) => distance(after) > distance(before),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ranges_are_those_of_the_tables() {
        let findings = ThesisFindings::run().unwrap();
        // docs/physics.md and the thesis's own tables.
        let [low, high] = findings.static_published.unwrap();
        assert!(low > 1.0 && high > 10.0 && high < 10.5, "{low} {high}");
        assert!(findings.static_got_worse());
        let [low, high] = findings.speed_second_region.unwrap();
        assert!(low > 1.25 && high < 1.45, "{low} {high}");
        let [low, high] = findings.speed_first_region.unwrap();
        assert!(low > 1.8 && high < 1.9, "{low} {high}");
        assert_eq!(findings.teeth, 2);
    }
}

//! What part of a model's residual an added effect takes away, and where.

use num_complex::Complex64;
use serde::{Serialize, Serializer};

use crate::data::Point;
use crate::discrepancy::comparison::error_sums::{BANDS, Sums, band_edges_hz, band_of};
use crate::discrepancy::comparison::place::{Amounts, DominantRegion, above_noise, excess};
use crate::identify::FrfData;

/// The residual before and after.
///
/// "Above noise" is the excess E = Σ|model − measured|²/σ² − N over N complex values, which noise alone leaves at 0 ± √N.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Explained {
    /// Over everything.
    #[serde(flatten)]
    pub total: Part,
    /// One a posture.
    #[serde(serialize_with = "by_name")]
    pub by_posture: Vec<NamedPart>,
    /// Response axis, reference axis: `XX`, `XY`, …
    #[serde(serialize_with = "by_name")]
    pub by_direction: Vec<NamedPart>,
    /// Node number of the response.
    #[serde(serialize_with = "by_name")]
    pub by_point: Vec<NamedPart>,
    /// One a band in which something was measured.
    pub by_band: Vec<BandPart>,
    /// Where what it takes away stood.
    pub taken_from: DominantRegion,
    /// Where what is left above noise stands; `None` where nothing is.
    pub left_at: Option<DominantRegion>,
}

/// One group of values before and after.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Part {
    /// Error over the signal before.
    pub nrms_before: f64,
    /// Error over the signal after.
    pub nrms_after: f64,
    /// Error over noise: 1 where only noise is left.
    pub times_noise_before: Option<f64>,
    /// The same after.
    pub times_noise_after: Option<f64>,
    /// Share of the group's own excess that is taken away, at most 1; negative where it grows. `None` where no more than
    /// noise was there before.
    pub share: Option<f64>,
    /// Share of everything taken away that was in this group; the groups of one kind add up to 1.
    pub of_all: f64,
}

/// Values of one name before and after.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedPart {
    /// What the group has in common: a posture, a direction, a point.
    pub name: String,
    /// Its values.
    pub part: Part,
}

/// An object with a key for each name.
fn by_name<S: Serializer>(parts: &[NamedPart], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(parts.iter().map(|p| (&p.name, p.part)))
}

/// Values of one frequency band before and after.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BandPart {
    /// Lower edge, Hz.
    pub from_hz: f64,
    /// Upper edge, Hz.
    pub to_hz: f64,
    /// Its values.
    #[serde(flatten)]
    pub part: Part,
}

#[derive(Debug, Clone, Copy, Default)]
struct Change {
    before: Sums,
    after: Sums,
}

impl Change {
    fn add(&mut self, other: Change) {
        self.before.add(other.before);
        self.after.add(other.after);
    }

    fn gain(&self) -> f64 {
        self.before.weighted - self.after.weighted
    }

    fn left(&self) -> f64 {
        excess(&self.after)
    }

    fn part(&self, all: &Change) -> Part {
        Part {
            nrms_before: self.before.nrms(),
            nrms_after: self.after.nrms(),
            times_noise_before: self.before.times_noise(),
            times_noise_after: self.after.times_noise(),
            share: above_noise(&self.before).then(|| (self.gain() / excess(&self.before)).min(1.0)),
            of_all: if all.gain() != 0.0 {
                self.gain() / all.gain()
            } else {
                0.0
            },
        }
    }
}

/// Changes by name, in order of first appearance.
#[derive(Default)]
struct Groups(Vec<(String, Change)>);

impl Groups {
    fn add(&mut self, name: &str, change: Change) {
        match self.0.iter_mut().find(|(n, _)| n == name) {
            Some((_, c)) => c.add(change),
            None => self.0.push((name.to_string(), change)),
        }
    }

    fn parts(&self, all: &Change) -> Vec<NamedPart> {
        let named = |(name, change): &(String, Change)| NamedPart {
            name: name.clone(),
            part: change.part(all),
        };
        self.0.iter().map(named).collect()
    }

    fn amounts(&self, amount: fn(&Change) -> f64) -> Amounts {
        let mut amounts = Amounts::default();
        for (name, change) in &self.0 {
            amounts.add(name, amount(change));
        }
        amounts
    }
}

impl Explained {
    /// `before` and `after`: predictions in the order of `data.frfs()`, m/N on the same lines.
    pub fn new(
        data: &FrfData,
        points: &[Point],
        before: &[Vec<Complex64>],
        after: &[Vec<Complex64>],
    ) -> Self {
        let edges = band_edges_hz(data);
        let mut all = Change::default();
        let mut bands = vec![Change::default(); BANDS];
        let (mut postures, mut directions, mut nodes) =
            (Groups::default(), Groups::default(), Groups::default());
        for ((block, frf), (before, after)) in data.frfs().zip(before.iter().zip(after)) {
            let mut own = Change::default();
            for (k, (b, a)) in before.iter().zip(after).enumerate() {
                let sums = |model| Sums::of_line(model, frf.receptance[k], frf.noise_std[k]);
                let line = Change {
                    before: sums(*b),
                    after: sums(*a),
                };
                own.add(line);
                bands[band_of(&edges, block.frequency_hz[k])].add(line);
            }
            all.add(own);
            postures.add(&data.posture_ids[frf.posture], own);
            let axes = [frf.response.axis.letter(), frf.reference.axis.letter()];
            directions.add(&axes.iter().collect::<String>(), own);
            nodes.add(&points[frf.response.point].node.to_string(), own);
        }
        let place = |amount: fn(&Change) -> f64| {
            let bands: Vec<f64> = bands.iter().map(amount).collect();
            DominantRegion::new(
                &edges,
                &bands,
                &directions.amounts(amount),
                &postures.amounts(amount),
                &nodes.amounts(amount),
            )
        };
        Explained {
            total: all.part(&all),
            by_posture: postures.parts(&all),
            by_direction: directions.parts(&all),
            by_point: nodes.parts(&all),
            by_band: (0..BANDS)
                .filter(|&i| bands[i].before.values > 0)
                .map(|i| BandPart {
                    from_hz: edges[i],
                    to_hz: edges[i + 1],
                    part: bands[i].part(&all),
                })
                .collect(),
            taken_from: place(Change::gain),
            left_at: above_noise(&all.after).then(|| place(Change::left)),
        }
    }

    /// In a plain sentence or two; `effect` is its name.
    pub fn sentence(&self, effect: &str) -> String {
        let Some(share) = self.total.share else {
            return format!(
                "{effect} takes away nothing that stands above the noise line by line: only all lines together can speak for it."
            );
        };
        let mut text = format!(
            "{effect} takes away {} % of what stood above the noise: mostly {}.",
            per_cent(share),
            self.taken_from.words()
        );
        if let Some(left) = &self.left_at {
            text += &format!(" What is left above the noise sits mostly {}.", left.words());
        }
        text
    }
}

/// Whole per cents, but 100 only where nothing is left to the eye.
fn per_cent(share: f64) -> String {
    let percent = 100.0 * share;
    match percent {
        p if (99.0..99.95).contains(&p) => format!("{p:.1}"),
        p => format!("{p:.0}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(before: f64, after: f64) -> Change {
        let sums = |weighted| Sums {
            weighted,
            values: 100,
            ..Default::default()
        };
        Change {
            before: sums(before),
            after: sums(after),
        }
    }

    #[test]
    fn the_share_is_of_what_stands_above_noise() {
        let all = change(1100.0, 100.0);
        assert_eq!(all.part(&all).share, Some(1.0));
        assert_eq!(change(1100.0, 600.0).part(&all).share, Some(0.5));
        assert_eq!(change(1100.0, 600.0).part(&all).of_all, 0.5);
        assert_eq!(change(1100.0, 1200.0).part(&all).share, Some(-0.1));
        // 120 of 100 expected, whose standard deviation is 10, may be chance.
        assert_eq!(change(120.0, 100.0).part(&all).share, None);
    }

    #[test]
    fn amounts_are_what_each_group_gains() {
        let mut groups = Groups::default();
        for (name, gain) in [("p1", 10.0), ("p2", 500.0), ("p3", 20.0), ("p4", 480.0)] {
            groups.add(name, change(100.0 + gain, 100.0));
        }
        assert_eq!(groups.amounts(Change::gain).holding_most(), ["p2", "p4"]);
    }
}

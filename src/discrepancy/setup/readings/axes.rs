use std::sync::Arc;

use super::super::finding::SetupFinding;
use super::super::group::FrfGroup;
use super::super::reading::FileReading;
use super::proposal::Proposed;
use super::table::{DistanceTable, distance};
use crate::data::{Axis, Point};
use crate::identify::frfs::frf_data::FrfData;

/// Whose axes are misnamed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MisnamedAxes {
    /// Those of the sensor and of the hammer alike: another coordinate system.
    Both,
    Response,
    Reference,
}

/// A signed permutation: what the files call axis i is in truth `sign[i]` times axis `to[i]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    pub to: [usize; 3],
    pub sign: [f64; 3],
}

impl Turn {
    pub const NONE: Turn = Turn {
        to: [0, 1, 2],
        sign: [1.0; 3],
    };

    /// All 48.
    pub fn all() -> Vec<Turn> {
        let orders = [[0, 1, 2], [1, 0, 2], [2, 1, 0], [0, 2, 1], [1, 2, 0], [2, 0, 1]];
        let signs = |k: usize| std::array::from_fn(|i| if k >> i & 1 == 1 { -1.0 } else { 1.0 });
        orders
            .into_iter()
            .flat_map(|to| (0..8).map(move |k| Turn { to, sign: signs(k) }))
            .collect()
    }

    /// `X is in truth −Y, Y is in truth X`: what changes among the axes in use.
    pub fn words(&self, names: [&str; 3], used: [bool; 3]) -> String {
        let changed = (0..3).filter(|&i| used[i] && (self.to[i] != i || self.sign[i] < 0.0));
        let list: Vec<String> = changed
            .map(|i| {
                let sign = if self.sign[i] < 0.0 { "−" } else { "" };
                format!("{} is in truth {sign}{}", names[i], names[self.to[i]])
            })
            .collect();
        list.join(", ")
    }
}

/// Axes exchanged or of the wrong sign in a group of files.
pub struct Axes {
    pub group: FrfGroup,
    pub role: MisnamedAxes,
    pub turn: Turn,
    used: [bool; 3],
}

impl Axes {
    /// True axes and sign of an FRF that the file puts at `response`, `reference`.
    fn truth(&self, response: usize, reference: usize) -> (usize, usize, f64) {
        let Turn { to, sign } = self.turn;
        match self.role {
            MisnamedAxes::Both => (to[response], to[reference], sign[response] * sign[reference]),
            MisnamedAxes::Response => (to[response], reference, sign[response]),
            MisnamedAxes::Reference => (response, to[reference], sign[reference]),
        }
    }
}

impl FileReading for Axes {
    fn corrected(&self, data: &FrfData) -> FrfData {
        let mut data = data.clone();
        for block in &mut data.blocks {
            let block = Arc::make_mut(block);
            for k in 0..block.frfs.len() {
                if !self.group.holds(&block.frfs[k]) {
                    continue;
                }
                let frf = &mut block.frfs[k];
                let (a, b, sign) = self.truth(frf.response.axis.index(), frf.reference.axis.index());
                frf.response.axis = Axis::ALL[a];
                frf.reference.axis = Axis::ALL[b];
                frf.sign *= sign;
                let output = (frf.reference.point, frf.reference.axis);
                let known = block.outputs.iter().position(|o| *o == output);
                block.frfs[k].input = known.unwrap_or_else(|| {
                    block.outputs.push(output);
                    block.outputs.len() - 1
                });
            }
        }
        data
    }

    fn finding(&self, data: &FrfData, points: &[Point]) -> SetupFinding {
        let (who, only_signs) = match self.role {
            MisnamedAxes::Both => ("sensor and hammer", false),
            MisnamedAxes::Response => ("sensor", self.turn.to == [0, 1, 2]),
            MisnamedAxes::Reference => ("hammer", self.turn.to == [0, 1, 2]),
        };
        let words = self.turn.words(["X", "Y", "Z"], self.used);
        SetupFinding {
            // One axis the other way round on one side is a channel's polarity.
            kind: if only_signs { "channel-sign" } else { "axes" },
            place: format!("{}, {who}: {words}", self.group.label(data, points)),
            value: None,
            std_error: None,
            unit: "",
            confidence: 0.0,
            remedy: format!(
                "Rename the directions of these FRFs, or set the point's axes in campaign.toml: what the files call {words}."
            ),
        }
    }

    fn tried(&self) -> f64 {
        200.0
    }
}

/// Which axes occur among the FRFs of a group, by role.
fn used(data: &FrfData, group: &FrfGroup, role: MisnamedAxes) -> [bool; 3] {
    let mut used = [false; 3];
    for (_, frf) in data.frfs().filter(|(_, f)| group.holds(f)) {
        if role != MisnamedAxes::Reference {
            used[frf.response.axis.index()] = true;
        }
        if role != MisnamedAxes::Response {
            used[frf.reference.axis.index()] = true;
        }
    }
    used
}

pub fn proposed(table: &DistanceTable, data: &FrfData) -> Vec<Proposed> {
    // Each FRF under every true pair of axes and sign: all readings are sums of these.
    let apart: Vec<[[[f64; 2]; 3]; 3]> = data
        .frfs()
        .enumerate()
        .map(|(i, (_, frf))| {
            std::array::from_fn(|a| {
                std::array::from_fn(|b| {
                    [1.0, -1.0].map(|sign| distance(table.between[a][b][i].iter().map(|m| m * sign), frf))
                })
            })
        })
        .collect();
    let mut groups = FrfGroup::postures(data);
    let points = data.response_points();
    if points.len() > 1 {
        groups.extend(points.into_iter().map(|p| FrfGroup {
            response_point: Some(p),
            ..FrfGroup::ALL
        }));
    }
    let mut all = Vec::new();
    for group in groups {
        for role in [
            MisnamedAxes::Both,
            MisnamedAxes::Response,
            MisnamedAxes::Reference,
        ] {
            let used = used(data, &group, role);
            let mut seen: Vec<Vec<(usize, usize, f64)>> = Vec::new();
            for turn in Turn::all() {
                let reading = Axes {
                    group,
                    role,
                    turn,
                    used,
                };
                let truths: Vec<(usize, usize, f64)> = data
                    .frfs()
                    .filter(|(_, f)| group.holds(f))
                    .map(|(_, f)| reading.truth(f.response.axis.index(), f.reference.axis.index()))
                    .collect();
                // The same for these FRFs as another one, or as none.
                if seen.contains(&truths) || turn == Turn::NONE {
                    seen.push(truths);
                    continue;
                }
                seen.push(truths);
                let gain = table.gain(data, &group, |i, f| {
                    let (a, b, sign) = reading.truth(f.response.axis.index(), f.reference.axis.index());
                    apart[i][a][b][usize::from(sign < 0.0)]
                });
                all.push(Proposed {
                    reading: Box::new(reading),
                    gain,
                });
            }
        }
    }
    all
}

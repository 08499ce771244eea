//! The same numbers under two names.

use std::collections::HashMap;

use super::super::finding::SetupFinding;
use super::names::{dofs, first_of};
use super::{LEAST_LINES, SURE};
use crate::data::Point;
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// Two FRFs that may hold the same numbers: measured twice under one name, or one taken for its reciprocal.
fn may_be_alike(a: &FrfDatum, b: &FrfDatum) -> bool {
    let place = |frf: &FrfDatum| [frf.response, frf.reference].map(|dof| (dof.point, dof.axis));
    let [first, second] = place(a);
    a.posture == b.posture && (place(b) == [first, second] || place(b) == [second, first])
}

/// One finding for each pair of postures that share numbers, or for each posture in which directions do.
pub fn copies(data: &FrfData, points: &[Point]) -> Vec<SetupFinding> {
    let bits = |frf: &FrfDatum| -> Vec<[u64; 2]> {
        let values = frf.receptance.iter();
        values
            .map(|h| [h.re.abs().to_bits(), h.im.abs().to_bits()])
            .collect()
    };
    let mut first: HashMap<Vec<[u64; 2]>, &FrfDatum> = HashMap::new();
    // Postures, and the names of what they share, in the order of the data.
    let mut shared: Vec<([usize; 2], Vec<String>)> = Vec::new();
    for (_, frf) in data.frfs().filter(|(_, f)| f.receptance.len() >= LEAST_LINES) {
        let known = *first.entry(bits(frf)).or_insert(frf);
        // It may be this one itself.
        if may_be_alike(known, frf) {
            continue;
        }
        let postures = [known.posture, frf.posture];
        let name = match (
            known.posture == frf.posture,
            dofs(known, points),
            dofs(frf, points),
        ) {
            (true, a, b) => format!("{a} and {b}"),
            (false, a, b) if a == b => a,
            (false, a, b) => format!("{a} as {b}"),
        };
        match shared.iter_mut().find(|(p, _)| *p == postures) {
            Some((_, names)) => names.push(name),
            None => shared.push((postures, vec![name])),
        }
    }
    shared
        .into_iter()
        .map(|([a, b], names)| {
            let id = |p: usize| data.posture_ids.get(p).map_or("?", |id| id);
            let names = first_of(&names);
            let (place, which) = match a == b {
                true => (format!("posture {}: {names}", id(a)), "directions"),
                false => (
                    format!("postures {} and {}: {names}", id(a), id(b)),
                    "postures",
                ),
            };
            let remedy = format!(
                "The files give the same numbers for these {which}: one measurement under two names. Export the missing one, or take \
                 the wrong one out."
            );
            SetupFinding::without_size("duplicates", place, SURE, remedy)
        })
        .collect()
}

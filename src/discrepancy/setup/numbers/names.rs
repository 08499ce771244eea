//! What FRFs are called in a finding.

use crate::data::Point;
use crate::identify::frfs::frf_data::FrfDatum;

/// `1X/1Y`, response before reference.
pub fn dofs(frf: &FrfDatum, points: &[Point]) -> String {
    let [response, reference] = [&frf.response, &frf.reference].map(|dof| {
        format!(
            "{}{}",
            points.get(dof.point).map_or(0, |p| p.node),
            dof.axis.letter()
        )
    });
    format!("{response}/{reference}")
}

/// `1X/1X, 1X/1Y, 1X/1Z and 6 more`.
pub fn first_of(names: &[String]) -> String {
    const SHOWN: usize = 3;
    match names.split_at_checked(SHOWN) {
        Some((shown, more)) if !more.is_empty() => format!("{} and {} more", shown.join(", "), more.len()),
        _ => names.join(", "),
    }
}

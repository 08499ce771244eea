//! Degrees of freedom in the names of files, variables and columns: sets with one FRF a file say there what was measured
//! where (`FRF_12Z_1X.csv`, `resp3Y_ref1Z.frf`, `H_1X_2Z`).

use crate::data::{Axis, Dof};

const RESPONSE_WORDS: [&str; 9] = [
    "resp", "response", "rsp", "out", "output", "acc", "accel", "sensor", "rov",
];
const REFERENCE_WORDS: [&str; 10] = [
    "ref",
    "reference",
    "exc",
    "excitation",
    "in",
    "input",
    "hammer",
    "ham",
    "force",
    "drive",
];

#[derive(Clone, Copy, PartialEq)]
enum Side {
    Response,
    Reference,
    Unsaid,
}

fn side(word: &str) -> Side {
    let word = word.to_lowercase();
    if RESPONSE_WORDS.contains(&word.as_str()) {
        Side::Response
    } else if REFERENCE_WORDS.contains(&word.as_str()) {
        Side::Reference
    } else {
        Side::Unsaid
    }
}

/// `12Z`, `-12Z`, `12-Z`, `12Z-`, with letters before it that may say which side it is.
fn dof_of_token(token: &str) -> Option<(Side, Dof)> {
    let letters = token.find(|c: char| !c.is_alphabetic())?;
    let (word, rest) = token.split_at(letters);
    let digits = rest
        .find(|c: char| !c.is_ascii_digit())
        .filter(|n| (1..=6).contains(n))?;
    let (node, direction) = rest.split_at(digits);
    let bare = direction.trim_matches(['+', '-']);
    let axis = match bare {
        "X" | "x" => Axis::X,
        "Y" | "y" => Axis::Y,
        "Z" | "z" => Axis::Z,
        _ => return None,
    };
    let dof = Dof {
        node: node.parse().ok()?,
        axis,
        negative: direction.contains('-'),
    };
    Some((side(word), dof))
}

/// Response and reference where a name says both.
pub(super) fn both(name: &str) -> Option<(Dof, Dof)> {
    let (response, reference) = dofs(name);
    response.zip(reference)
}

/// Response and reference that a name says. Words decide (`resp`, `ref`, …), else the order: response first.
pub(super) fn dofs(name: &str) -> (Option<Dof>, Option<Dof>) {
    let mut found: Vec<(Side, Dof)> = Vec::new();
    let mut before = Side::Unsaid;
    let tokens = name.split(|c: char| !(c.is_alphanumeric() || c == '+' || c == '-'));
    for token in tokens.flat_map(halves).filter(|t| !t.is_empty()) {
        match dof_of_token(token) {
            Some((Side::Unsaid, dof)) => found.push((before, dof)),
            Some(said) => found.push(said),
            None => {}
        }
        before = side(token);
    }
    match found.as_slice() {
        [(Side::Reference, dof)] => (None, Some(*dof)),
        [(_, dof)] => (Some(*dof), None),
        [
            (Side::Reference, reference),
            (Side::Response | Side::Unsaid, response),
        ]
        | [
            (Side::Response | Side::Unsaid, response),
            (Side::Reference | Side::Unsaid, reference),
        ] => (Some(*response), Some(*reference)),
        [(Side::Unsaid, reference), (Side::Response, response)] => (Some(*response), Some(*reference)),
        _ => (None, None),
    }
}

/// `1X-2Z` is two, `1-Z` and `1Z-` are one.
fn halves(token: &str) -> Vec<&str> {
    if dof_of_token(token).is_some() {
        return vec![token];
    }
    token.split('-').collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_say_where_was_measured() {
        for (name, response, reference) in [
            ("FRF_12Z_1X", "12Z", "1X"),
            ("H_1X_2-Z", "1X", "2-Z"),
            ("resp3Y_ref1Z", "3Y", "1Z"),
            ("ref_1Z_resp_3Y", "3Y", "1Z"),
            ("pos A hammer 2x acc 7z-", "7-Z", "2X"),
            ("plate 1X-2Z", "1X", "2Z"),
            ("H(5Y,1Z)", "5Y", "1Z"),
            ("wing_17z", "17Z", ""),
            ("ref1X", "", "1X"),
            ("measurement_0", "", ""),
            ("2024-03-12 pos 3", "", ""),
            ("1X_2X_3X", "", ""),
            ("H1_2", "", ""),
        ] {
            let text = |d: Option<Dof>| d.map_or(String::new(), |d| d.to_string());
            let (a, b) = dofs(name);
            assert_eq!(
                (text(a).as_str(), text(b).as_str()),
                (response, reference),
                "{name}"
            );
        }
    }
}

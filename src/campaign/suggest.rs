//! What the writer may have meant.

/// The candidate nearest to `word`, if one is near enough to be a slip of the finger or only has more
/// behind it: most often the unit (`helix` for `helix_deg`).
pub fn closest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // A longer word is no slip, and the distance costs length × length.
    if word.len() > 64 {
        return None;
    }
    let word = word.to_lowercase();
    let candidates: Vec<&str> = candidates.into_iter().collect();
    let unit_left_out = |candidate: &&&str| {
        candidate
            .strip_prefix(word.as_str())
            .is_some_and(|rest| rest.starts_with('_'))
    };
    if let Some(longer) = candidates.iter().find(unit_left_out) {
        return Some(longer);
    }
    candidates
        .into_iter()
        .map(|candidate| (distance(&word, &candidate.to_lowercase()), candidate))
        .filter(|(distance, candidate)| *distance <= 1 + candidate.len().min(word.len()) / 4)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Levenshtein distance in characters.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let above = row[j + 1];
            row[j + 1] = (diagonal + usize::from(ca != *cb)).min(above + 1).min(row[j] + 1);
            diagonal = above;
        }
    }
    row[b.len()]
}

/// Text of a file as a message may show it: short, without control characters.
pub fn shown(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut out: String = text
        .chars()
        .take(LONGEST)
        .map(|c| if c.is_control() { '\u{fffd}' } else { c })
        .collect();
    if text.chars().nth(LONGEST).is_some() {
        out.push('…');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_are_recognised_and_strangers_are_not() {
        let keys = ["feed_per_tooth_mm", "feed_per_rev_mm", "id", "file"];
        assert_eq!(closest("feeed_per_tooth_mm", keys), Some("feed_per_tooth_mm"));
        assert_eq!(closest("Feed_per_rev_mm", keys), Some("feed_per_rev_mm"));
        assert_eq!(closest("fiel", keys), Some("file"));
        assert_eq!(closest("feed_per_tooth", keys), Some("feed_per_tooth_mm"));
        assert_eq!(closest("operator", keys), None);
        assert_eq!(closest(&"x".repeat(100_000), keys), None);
    }

    #[test]
    fn distances_are_levenshtein() {
        assert_eq!(distance("kitten", "sitting"), 3);
        assert_eq!(distance("", "abc"), 3);
        assert_eq!(distance("ζ", "z"), 1);
    }

    #[test]
    fn shown_text_is_short_and_printable() {
        assert_eq!(shown("a\u{1b}[31m\nb"), "a\u{fffd}[31m\u{fffd}b");
        assert_eq!(shown(&"é".repeat(100)).chars().count(), 61);
    }
}

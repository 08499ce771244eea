//! Lists in order of merit.

/// Of entries with the same key keeps the one that comes first.
pub(super) fn keep_first_of_each<T, K: PartialEq>(ranked: &mut Vec<T>, key: impl Fn(&T) -> K) {
    let mut known = Vec::new();
    ranked.retain(|entry| {
        let key = key(entry);
        let new = !known.contains(&key);
        if new {
            known.push(key);
        }
        new
    });
}

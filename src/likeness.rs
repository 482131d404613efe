//! What somebody who wrote a name that is not there may have meant.

/// `names`, the likest to `wanted` first.
pub(crate) fn by_likeness(wanted: &str, mut names: Vec<String>) -> Vec<String> {
    let small = wanted.to_lowercase();
    names.sort_by_cached_key(|name| unlikeness(&small, &name.to_lowercase()));
    names
}

/// What holds the other comes first, then what has fewest edits for its length, in thousandths.
fn unlikeness(a: &str, b: &str) -> (bool, usize) {
    (!b.contains(a), 1000 * edits(a, b) / a.chars().count().max(b.chars().count()).max(1))
}

/// How many letters must be put in, taken out or changed to make `b` of `a` (Levenshtein).
pub(crate) fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, other) in b.iter().enumerate() {
            let change = diagonal + usize::from(letter != *other);
            diagonal = row[j + 1];
            row[j + 1] = change.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_likest_name_comes_first() {
        assert_eq!((edits("albedo", "albdo"), edits("", "ab"), edits("kitten", "sitting")), (1, 2, 3));
        assert!(unlikeness("lft", "rgba_left") < unlikeness("lft", "a"));
        assert!(unlikeness("key", "view.combined_key") < unlikeness("key", "view.ao"));
        let sorted = by_likeness("Albdo", ["depth", "albedo"].map(str::to_owned).to_vec());
        assert_eq!(sorted, ["albedo", "depth"]);
    }
}

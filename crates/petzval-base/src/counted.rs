//! Numbers with their nouns.

/// A number with its noun: `1 point`, `3 points`. The noun takes an s.
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_singular() {
        let all = [0, 1, 2].map(|count| counted(count, "held-out photograph"));
        assert_eq!(all, ["0 held-out photographs", "1 held-out photograph", "2 held-out photographs"]);
    }
}

//! How much memory the reading of one file may take: a small multiple of its size. What a file announces (sizes,
//! counts, compressed data) is taken from this budget before it is allocated, so that a small file cannot claim
//! much memory, and the error says so.

use crate::InputError;

/// Granted to every file, however small: compressed small files expand a lot.
const FLOOR: usize = 64 << 20;
/// Bytes of memory for each byte of the file. Compressed 16-bit samples become 8-byte numbers: about 4 × 4, held
/// once as unpacked bytes and once as numbers.
const TIMES: usize = 32;

/// Memory that is left for one file.
#[derive(Debug)]
pub(crate) struct Budget {
    left: usize,
    whole: usize,
    file: usize,
}

impl Budget {
    /// For a file of so many bytes.
    pub fn for_file(bytes: usize) -> Self {
        let whole = bytes.saturating_mul(TIMES).saturating_add(FLOOR);
        Budget {
            left: whole,
            whole,
            file: bytes,
        }
    }

    /// Bytes that may still be taken.
    pub fn left(&self) -> usize {
        self.left
    }

    /// Takes memory for `what`.
    ///
    /// # Errors
    /// The budget is used up; the error names `what` and the budget.
    pub fn take(&mut self, bytes: usize, what: &str) -> Result<(), InputError> {
        match self.left.checked_sub(bytes) {
            Some(left) => {
                self.left = left;
                Ok(())
            }
            None => Err(self.exceeded(what)),
        }
    }

    /// Gives back what was taken for a while only.
    pub fn give_back(&mut self, bytes: usize) {
        self.left = self.left.saturating_add(bytes).min(self.whole);
    }

    /// What [`Budget::take`] says where memory does not suffice.
    pub fn exceeded(&self, what: &str) -> InputError {
        InputError::new(format!(
            "{what} takes more than the {} MB of memory granted to a file of {:.3} MB: damaged, or made to exhaust the \
             memory",
            self.whole >> 20,
            self.file as f64 / f64::from(1 << 20)
        ))
        .remedy("check where the file comes from; if its data are right, save them uncompressed (UFF 58, CSV)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_budget_is_a_small_multiple_of_the_file_and_says_when_it_is_used_up() {
        let mut budget = Budget::for_file(1 << 20);
        assert_eq!(budget.left(), 96 << 20);
        budget.take(96 << 20, "x").unwrap();
        let error = budget.take(1, "channel Sx").unwrap_err();
        assert!(
            error.problem.starts_with("channel Sx takes more than the 96 MB"),
            "{error}"
        );
    }
}

//! How the values of a dataset 58 are written, and what is said where they are too few.

use crate::InputError;

/// Form of the ordinate, record 7: 2 real single, 4 real double, 5 complex single, 6 complex double.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OrdinateForm {
    pub complex: bool,
    pub double: bool,
    pub even: bool,
}

impl OrdinateForm {
    /// Column widths of one ASCII point, repeated over the line.
    pub fn columns(self) -> Vec<usize> {
        let value = if self.double { 20 } else { 13 };
        let mut columns = if self.even { vec![] } else { vec![13] };
        columns.resize(columns.len() + self.values(), value);
        columns
    }

    pub fn values(self) -> usize {
        1 + usize::from(self.complex)
    }

    pub fn numbers_per_point(self) -> usize {
        self.values() + usize::from(!self.even)
    }
}

/// A record with fewer points than it announces: where they are missing is not known, so every later one may stand at a
/// wrong frequency or time.
pub(crate) fn too_short(title: &str, found: usize, announced: usize, at_end: bool) -> InputError {
    let why = if at_end {
        "the file ends within its data"
    } else {
        "lines of it are lost"
    };
    InputError::new(format!(
        "{}: dataset 58 announces {announced} points and holds {found}: {why}",
        named(title)
    ))
    .remedy("export or copy the file again")
}

pub(crate) fn named(title: &str) -> &str {
    if title.is_empty() {
        "a record without name"
    } else {
        title
    }
}

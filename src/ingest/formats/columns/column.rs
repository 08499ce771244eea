//! A table of named columns, and arrays that say the same.

use num_complex::Complex64;

/// What stands in a column or an array, one value after the other.
#[derive(Debug, Clone, PartialEq)]
pub enum Cells {
    /// Empty: no value.
    Text(Vec<String>),
    /// NaN: no value. It is written as nothing, and as NaN where the format has nothing for nothing (NPZ, MAT).
    Number(Vec<f64>),
    /// As for numbers.
    Complex(Vec<Complex64>),
}

impl Cells {
    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Cells::Text(v) => v.len(),
            Cells::Number(v) => v.len(),
            Cells::Complex(v) => v.len(),
        }
    }

    /// Are there no values?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A named column. Complex ones become two where a format has no complex numbers: `model_re_m_per_n`, `model_im_m_per_n`.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedColumn {
    /// What it is: `model`.
    pub quantity: String,
    /// Its unit as names have it (`m_per_n`); empty where it has none.
    pub unit: &'static str,
    /// One a row.
    pub cells: Cells,
}

impl NamedColumn {
    /// A column of names.
    pub fn text(quantity: &str, cells: Vec<String>) -> Self {
        NamedColumn {
            quantity: quantity.into(),
            unit: "",
            cells: Cells::Text(cells),
        }
    }

    /// A column of numbers; what there is none of is NaN.
    pub fn numbers(quantity: &str, unit: &'static str, cells: Vec<f64>) -> Self {
        NamedColumn {
            quantity: quantity.into(),
            unit,
            cells: Cells::Number(cells),
        }
    }

    /// As [`numbers`](Self::numbers), where some are not there.
    pub fn known(quantity: &str, unit: &'static str, cells: impl IntoIterator<Item = Option<f64>>) -> Self {
        let cells = cells.into_iter().map(|c| c.unwrap_or(f64::NAN));
        NamedColumn::numbers(quantity, unit, cells.collect())
    }

    /// A column of complex numbers.
    pub fn complex(quantity: &str, unit: &'static str, cells: Vec<Complex64>) -> Self {
        NamedColumn {
            quantity: quantity.into(),
            unit,
            cells: Cells::Complex(cells),
        }
    }

    /// Quantity and unit.
    pub fn name(&self) -> String {
        self.named("")
    }

    fn named(&self, part: &str) -> String {
        let parts = [self.quantity.as_str(), part, self.unit];
        let parts: Vec<&str> = parts.into_iter().filter(|p| !p.is_empty()).collect();
        parts.join("_")
    }

    /// Itself, or real and imaginary part.
    fn parts(&self) -> Vec<(String, Cells)> {
        match &self.cells {
            Cells::Complex(z) => vec![
                (self.named("re"), Cells::Number(z.iter().map(|z| z.re).collect())),
                (self.named("im"), Cells::Number(z.iter().map(|z| z.im).collect())),
            ],
            cells => vec![(self.name(), cells.clone())],
        }
    }
}

/// An array of one or two dimensions.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedArray {
    /// With its unit; letters, digits and underscores, a letter first.
    pub name: String,
    /// Length, or rows and columns; their product is the number of cells.
    pub shape: Vec<usize>,
    /// Row after row.
    pub cells: Cells,
}

/// A table, and how programs that have arrays see it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ColumnTable {
    /// Of the file, without its ending.
    pub name: String,
    /// All of one length.
    pub columns: Vec<NamedColumn>,
    /// Empty: an array a column.
    pub arrays: Vec<NamedArray>,
}

impl ColumnTable {
    /// A table whose arrays are its columns.
    pub fn new(name: impl Into<String>, columns: Vec<NamedColumn>) -> Self {
        ColumnTable {
            name: name.into(),
            columns,
            arrays: Vec::new(),
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |c| c.cells.len())
    }

    /// Columns of text and real numbers, by name.
    pub fn plain_columns(&self) -> Vec<(String, Cells)> {
        self.columns.iter().flat_map(NamedColumn::parts).collect()
    }

    /// The table as arrays.
    pub fn as_arrays(&self) -> Vec<NamedArray> {
        if !self.arrays.is_empty() {
            return self.arrays.clone();
        }
        let array = |column: &NamedColumn| NamedArray {
            name: column.name(),
            shape: vec![column.cells.len()],
            cells: column.cells.clone(),
        };
        self.columns.iter().map(array).collect()
    }
}

/// The shortest text that reads back as the same number; nothing for what is no number.
pub(super) fn number_text(value: f64) -> String {
    match value {
        v if !v.is_finite() => String::new(),
        v if v.fract() == 0.0 && v.abs() < 1e15 => format!("{v}"),
        v => format!("{v:?}"),
    }
}

/// A text as the name of a variable of MATLAB and Python: letters, digits and underscores, a letter first.
pub fn variable_name(text: &str) -> String {
    let name: String = text
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    match name.chars().next() {
        Some(c) if c.is_ascii_alphabetic() => name,
        _ => format!("x{name}"),
    }
}

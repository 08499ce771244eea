//! All rows of a table, however its decimal sign and its separator collide.

use crate::InputError;
use crate::ingest::tables::split_comma;
use crate::ingest::tables::table::{Header, Table, holds};
use crate::ingest::text::Notes;

impl Header {
    /// Reads all rows.
    ///
    /// # Errors
    /// A row that has not as many numbers as there are columns; the last row of a file may be cut short.
    pub fn read(&self, bytes: &[u8], rate_hz: Option<f64>, notes: &mut Notes) -> Result<Table, InputError> {
        let data = bytes.get(self.data_at..).unwrap_or_default();
        if self.decimal_comma_between_commas {
            return split_comma::read(data, self, rate_hz, notes);
        }
        if holds(data, b'"') {
            return self.read_quoted(data, notes);
        }
        self.read_rows(data, self.data_line, true, notes)
    }
}

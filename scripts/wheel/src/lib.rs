//! Lobestone for Python: numbers in and out as numpy arrays, documents as the command prints them with `--json`. What
//! users see is the package around it (`python/lobestone`); nothing is computed here or there.

mod campaign;
mod cfc;
mod errors;
mod lobes;
mod modal;
mod program;
mod work;

use pyo3::prelude::*;

/// The compiled part of `lobestone`; its functions are described where the package calls them.
#[pymodule]
mod _native {
    use super::*;

    #[pymodule_export]
    use super::campaign::{document, frfs, held};
    #[pymodule_export]
    use super::cfc::coefficients;
    #[pymodule_export]
    use super::lobes::zero_order;
    #[pymodule_export]
    use super::modal::fit;
    #[pymodule_export]
    use super::program::command;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        lobestone::sums_in_order();
        module.add("VERSION", env!("CARGO_PKG_VERSION"))
    }
}

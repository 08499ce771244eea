//! The `[[contact]]` tables.

use crate::Result;
use crate::campaign::form::bounds::Bounds;
use crate::campaign::form::keys::{self, names};
use crate::campaign::form::section::Section;
use crate::data::{Contact, ContactDirection};

pub(super) fn read(top: &Section<'_>) -> Result<Vec<Contact>> {
    let words = [
        ("axial", ContactDirection::Axial),
        ("lateral", ContactDirection::Lateral),
        ("x", ContactDirection::X),
        ("y", ContactDirection::Y),
    ];
    let sections = top.sections("contact", &names(&keys::CONTACT))?;
    sections
        .iter()
        .map(|section| {
            let direction = section.choice("direction", &words)?;
            let stiffness = section.number("stiffness_n_per_m", Bounds::NOT_NEGATIVE)?;
            Ok(Contact {
                name: section.text("name")?.unwrap_or_default().to_string(),
                direction: section.required("direction", direction, "\"axial\"")?,
                stiffness_n_per_m: section.required("stiffness_n_per_m", stiffness, "5e6")?,
                damping_ns_per_m: section
                    .number("damping_ns_per_m", Bounds::NOT_NEGATIVE)?
                    .unwrap_or(0.0),
                preload_n: section.number("preload_n", Bounds::NOT_NEGATIVE)?,
            })
        })
        .collect()
}

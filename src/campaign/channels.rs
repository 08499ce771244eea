//! `[[channel]]`: what the channels of force files are, where the files do not say it.

use super::schema::CutChannel;
use crate::Result;
use crate::campaign::form::bounds::Bounds;
use crate::campaign::form::keys::{self, names};
use crate::campaign::form::section::Section;
use crate::data::ChannelRole;
use crate::data::Cut;
use crate::ingest::{ChannelRule, Gain, Measures, Source, unit_of_charge_or_other};

const NAMES: [(&str, Measures); 5] = [
    ("fx", Measures::Force(ChannelRole::ForceX)),
    ("fy", Measures::Force(ChannelRole::ForceY)),
    ("fz", Measures::Force(ChannelRole::ForceZ)),
    ("mz", Measures::Force(ChannelRole::TorqueZ)),
    ("time", Measures::Time),
];

/// `cuts`: those that a channel may be limited to.
pub(super) fn channels(top: &Section<'_>, cuts: &[Cut]) -> Result<Vec<CutChannel>> {
    let mut out: Vec<CutChannel> = Vec::new();
    for section in top.sections("channel", &names(&keys::CHANNEL))? {
        let measures = section.required("name", section.choice("name", &NAMES)?, "\"fx\"")?;
        let name = section.text("name")?.unwrap_or_default();
        let cut = section.text("cut")?.map(str::to_string);
        if let Some(id) = cut.as_deref().filter(|id| cuts.iter().all(|c| c.id != *id)) {
            return Err(section
                .error("cut", format!("there is no cut {id:?}"))
                .remedy("write the id of a [[cut]], or leave it out: the channel is that of all cuts then")
                .into());
        }
        if out.iter().any(|c| c.rule.measures == measures && c.cut == cut) {
            return Err(section
                .error("name", "given twice for the same cuts")
                .remedy("one [[channel]] for each force; `cut` limits one to a single cut")
                .into());
        }
        let source = match (section.text("in_file")?, section.whole("column", 1, 10_000)?) {
            (Some(_), Some(_)) => {
                return Err(section
                    .error("column", "given together with in_file: only one of them can hold")
                    .remedy("in_file for files with names, column for files without")
                    .into());
            }
            (None, Some(at)) => Source::Column(usize::try_from(at).unwrap_or(1)),
            (in_file, None) => Source::Name(in_file.unwrap_or(name).to_string()),
        };
        let unit = match section.text("unit")? {
            Some(label) => Some(unit_of_charge_or_other(label).ok_or_else(|| {
                section
                    .error("unit", format!("{label:?} is no unit known here"))
                    .remedy("such as N, kN, V, mV, pC, N·m; s, ms for the time")
            })?),
            None => None,
        };
        let gain = match (
            section.text("gain")?,
            section.number("gain_n_per_unit", Bounds::ANY)?,
        ) {
            (Some(text), None) => Gain::parse(text).map_err(|problem| {
                section
                    .error("gain", problem)
                    .remedy("such as gain = \"500 N/V\", \"-3.9 pC/N\" or \"10 mV/N\"")
            })?,
            (None, Some(number)) if number != 0.0 => Gain::PerUnit(number),
            (None, None) => Gain::None,
            _ => {
                return Err(section
                    .error("gain_n_per_unit", "given together with gain, or zero")
                    .remedy("give one of the two")
                    .into());
            }
        };
        let sign = section.whole("sign", -1, 1)?.unwrap_or(1);
        if sign == 0 {
            return Err(section.error("sign", "is 0").remedy("write 1 or -1").into());
        }
        out.push(CutChannel {
            cut,
            rule: ChannelRule {
                measures,
                source,
                unit,
                gain,
                offset: section.number("offset", Bounds::ANY)?.unwrap_or(0.0),
                is_reversed: sign < 0,
                rate_hz: section.number("rate_hz", Bounds::POSITIVE)?,
            },
        });
    }
    Ok(out)
}

//! What a user means by `EFFECT[@SITE][:choice=value]`.

use super::effect::{Domain, Effect, Instance, Known};
use super::registry::Registry;
use super::site::{Site, WrittenEffect};
use crate::text::{closest, shown_briefly};
use crate::{InputError, Result};

/// The instances of an effect that a user asked for: one for each discrete choice, or that of the choice that is stated
/// (`branch@link-3.z:form=resonator`).
///
/// # Errors
/// One that says what there is where the effect, its site or the choice is none, or a site is missing; the reason where
/// this robot or this data cannot show the effect.
pub fn requested<D: Domain>(
    registry: &Registry<D>,
    known: &Known<'_, D>,
    name: &str,
) -> Result<Vec<Instance<D>>> {
    let wrong = |problem: String, remedy: String| InputError::new(problem).key("EFFECT").remedy(remedy);
    let WrittenEffect {
        label: name,
        id,
        site,
        values: choice,
    } = WrittenEffect::of(name);
    let Some(effect) = registry.effect(id) else {
        let ids: Vec<&str> = registry.tried().iter().map(|e| e.id()).collect();
        let near =
            closest(id, ids.iter().copied()).map_or(String::new(), |near| format!("did you mean {near}? "));
        let remedy = format!("{near}there are: {}", ids.join(", "));
        return Err(wrong(format!("there is no effect \"{}\"", shown_briefly(id)), remedy).into());
    };
    let found = registry.find(known.object, name);
    if found.is_empty() {
        let (problem, remedy) = no_such_site(effect, site, &effect.sites(known.object));
        return Err(wrong(problem, remedy).into());
    }
    if let Some(obstacle) = effect.obstacle(known) {
        let remedy = "measure what it needs, or see what `lobestone diagnose DIR` proposes".to_string();
        return Err(wrong(format!("this campaign cannot show {name}: {obstacle}"), remedy).into());
    }
    let Some(choice) = choice else { return Ok(found) };
    let chosen = |instance: &&Instance<D>| {
        instance
            .variant_label()
            .is_some_and(|(key, value)| choice.split_once('=') == Some((key, value)))
    };
    match found.iter().find(chosen) {
        Some(instance) => Ok(vec![*instance]),
        None => {
            let all: Vec<String> = found.iter().map(Instance::request).collect();
            let problem = format!("{name} has no choice \"{}\"", shown_briefly(choice));
            Err(wrong(problem, format!("write {}", all.join(" or "))).into())
        }
    }
}

fn no_such_site<D: Domain>(effect: &dyn Effect<D>, site: Option<&str>, sites: &[Site]) -> (String, String) {
    let id = effect.id();
    let named: Vec<String> = sites
        .iter()
        .filter_map(|s| Some(format!("{id}@{}", s.label()?)))
        .collect();
    match site {
        _ if sites.is_empty() => (
            format!("{id} has no place on this robot"),
            "see what `lobestone diagnose DIR` proposes".into(),
        ),
        Some(site) if named.is_empty() => (
            format!(
                "{id} sits nowhere in particular, so not at \"{}\"",
                shown_briefly(site)
            ),
            format!("write {id}"),
        ),
        Some(site) => (
            format!("{id} cannot sit at \"{}\"", shown_briefly(site)),
            format!("on this robot there are: {}", named.join(", ")),
        ),
        None => (
            format!("{id} needs a site"),
            format!("on this robot there are: {}", named.join(", ")),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::DataSummary;
    use crate::robot::fixture::irb6640;

    const DATA: DataSummary = DataSummary {
        force_levels: 1,
        postures: 4,
        lowest_hz: 3.0,
        highest_hz: 80.0,
    };

    #[test]
    fn names_mean_instances() {
        let robot = irb6640();
        for (name, count) in [
            ("payload", 1),
            ("joint-transverse-compliance@joint-3", 1),
            ("local-resonator@link-2", 3),
        ] {
            let found = requested(&Registry::structure(), &Known::robot(&robot, DATA), name).unwrap();
            assert_eq!(found.len(), count, "{name}");
            assert!(found.iter().all(|i| i.label() == name));
            // What one of them is called asks for that one.
            for instance in &found {
                let own = requested(
                    &Registry::structure(),
                    &Known::robot(&robot, DATA),
                    &instance.request(),
                );
                assert_eq!(own.unwrap(), [*instance], "{name}");
            }
        }
        let name = "branch@link-3.z:form=resonator";
        let found = requested(&Registry::structure(), &Known::robot(&robot, DATA), name).unwrap();
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].request(), name);
    }

    #[test]
    fn what_is_wrong_is_said_with_what_there_is() {
        let robot = irb6640();
        for (name, problem, remedy) in [
            ("payloud", "no effect \"payloud\"", "did you mean payload?"),
            ("", "no effect \"\"", "time-delay, sensor-misalignment"),
            ("local-resonator", "needs a site", "local-resonator@link-3"),
            (
                "local-resonator@link-9",
                "cannot sit at \"link-9\"",
                "local-resonator@link-3",
            ),
            ("payload@link-2", "nowhere in particular", "write payload"),
            (
                "local-resonator@link-3:direction=w",
                "has no choice \"direction=w\"",
                "local-resonator@link-3:direction=x",
            ),
            ("payload:form=spring", "has no choice", "write payload"),
            (
                "amplitude-dependent-stiffness@joint-1",
                "two hammer levels",
                "measure",
            ),
        ] {
            let error = requested(&Registry::structure(), &Known::robot(&robot, DATA), name)
                .unwrap_err()
                .to_string();
            assert!(
                error.contains(problem) && error.contains(remedy),
                "{name}: {error}"
            );
        }
    }
}

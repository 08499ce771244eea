use crate::effects::cutting::common::{milling_only, one_helix_only, teeth_as_listed};
use crate::effects::cutting::{CutPhysics, CutSetting, Cutting, OwnTeeth};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, NEGLIGIBLE, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::Dual;

/// Teeth stand at radii of their own: one is chipped or missing, or inserts are set differently.
pub struct ToothRadii;

/// One tooth stands short.
const ONE: usize = 0;
/// Each has its own.
const EACH: usize = 1;
/// Times the largest feed by which a tooth is short that certainly cuts nothing.
const MISSING: f64 = 2.0;

impl Effect<Cutting> for ToothRadii {
    fn id(&self) -> &'static str {
        "tooth-radii"
    }

    fn explanation(&self) -> &'static str {
        "The teeth do not stand at one radius: one is chipped or missing (`teeth` \"one\": `short_mm` short of the others; by more \
         than the feed per tooth it cuts nothing), or inserts sit at heights of their own (\"each\": `offset_mm` of the second and \
         the following teeth beyond the first, in the order in which they cut). A short tooth leaves its chip to the next one. \
         Which tooth is the first, forces cannot tell. Once known it belongs into campaign.toml: `tooth_radius_offset_mm` of \
         `[tool]`."
    }

    fn fingerprint(&self) -> &'static str {
        "Lines at once per revolution and its multiples, off the tooth-passing comb: one tooth lower than the others and the \
         next one higher by as much, the same at every feed above the offset."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Look at every tooth under a magnifier; measure the radii on a setting device, by a laser or with a dial gauge \
             at each tooth. Turn the tool in its holder by 180°: chipped teeth and inserts go with the tool, runout of the holder \
             does not.",
            typical: "Radial differences of seated inserts 10 to 50 µm, of ground solid tools below 5 µm; chips of an edge 10 to \
             300 µm; a missing insert counts as a whole feed per tooth and more.",
            best_measured: "Feeds below and above the offset, ten turns or more in the steady part and at least 30 samples a tooth; \
             four teeth or more tell a chipped one from runout.",
            sources: &[
                "Kline, W. A.; DeVor, R. E. (1983): The effect of runout on cutting geometry and forces in end milling. \
                 International Journal of Machine Tool Design and Research 23(2–3).",
                "Altintas, Y.; Yellowley, I.; Tlusty, J. (1988): The detection of tool breakage in milling operations. ASME Journal of \
                 Engineering for Industry 110(3).",
            ],
        }
    }

    fn variants(&self, _site: Site) -> Vec<usize> {
        vec![ONE, EACH]
    }

    fn variant_label(&self, variant: usize) -> Option<(&'static str, &'static str)> {
        Some(("teeth", if variant == ONE { "one" } else { "each" }))
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        let general = milling_only(data).or_else(|| one_helix_only(data));
        general.or_else(|| teeth_as_listed(data)).or_else(|| {
            (data.teeth < 3).then(|| {
                "of two teeth a short one is what runout looks like, too (runout is tried)".to_string()
            })
        })
    }

    fn choice_obstacle(&self, variant: usize, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        (variant == EACH && data.teeth < 4)
            .then(|| "radii of three teeth are what runout looks like, too (runout is tried)".to_string())
    }

    fn parameters(&self, at: At, Known { data, .. }: &Known<Cutting>) -> Vec<Parameter> {
        let feed = data.largest_feed_mm.clamp(1e-3, 10.0);
        if at.variant == ONE {
            // Centred where the tooth is missing: there the data say nothing of how much, and nothing else must pull.
            return vec![Parameter::logarithmic(
                "short_mm",
                "mm",
                MISSING * feed,
                2.0,
                [2e-4, 20.0],
            )];
        }
        let prior = Prior { mean: 0.0, std: feed };
        (0..data.teeth.saturating_sub(1))
            .map(|j| Parameter::linear(format!("offset_mm[{j}]"), "mm", 0.0, prior, [-20.0, 20.0]))
            .collect()
    }

    fn starts(&self, at: At, Known { data, .. }: &Known<Cutting>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        let feed = data.smallest_feed_mm.clamp(1e-3, 10.0);
        if at.variant == ONE {
            // The misfit has a kink wherever the tooth leaves the cut at one of the feeds: a start between any two of them.
            let most = data.largest_feed_mm.clamp(feed, 10.0);
            let small = [0.1, 0.5].map(|share| vec![share * feed]);
            let large = [0.1, 0.4, 0.7, 0.95].map(|share| vec![feed * (most / feed).powf(share)]);
            return [small.as_slice(), large.as_slice()].concat();
        }
        // One tooth proud of the others.
        let mut proud = vec![0.0; data.teeth.saturating_sub(1)];
        if let Some(first) = proud.first_mut() {
            *first = 0.3 * feed;
        }
        vec![proud]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[
                UsualSize::new("short_mm", SizeRange::Log(0.01, 0.3), FollowsSize::Power(1.0)),
                UsualSize::new("offset_mm", SizeRange::Either(0.03), FollowsSize::Power(1.0)),
            ]
        }
    }

    fn impossible(&self, _site: Site, _object: &(), sizes: &[Size]) -> Option<String> {
        let shown = (1000.0, "µm");
        match sizes {
            [short] => short.outside(
                "a tooth short by an amount",
                [5e-4, 10.0],
                shown,
                "no tool is ground truer, and no tooth is that long",
            ),
            each => each.iter().find_map(|offset| {
                offset.outside(
                    "a radius beyond the first tooth's",
                    [-10.0, 10.0],
                    shown,
                    "no tooth is that long",
                )
            }),
        }
    }

    fn vanishing(&self, at: At, p: &[Parameter]) -> Option<Vec<f64>> {
        match at.variant {
            ONE => Some(vec![NEGLIGIBLE * p[0].nominal]),
            _ => Some(vec![0.0; p.len()]),
        }
    }

    fn apply(&self, at: At, values: &[Dual], setting: &CutSetting, physics: &mut CutPhysics) {
        let own = physics.own_teeth.get_or_insert_with(OwnTeeth::default);
        match at.variant {
            ONE => own.add_radius(0, setting.teeth, values[0].scale(-1.0)),
            _ => {
                for (j, offset) in values.iter().enumerate() {
                    own.add_radius(j + 1, setting.teeth, offset.clone());
                }
            }
        }
    }
}

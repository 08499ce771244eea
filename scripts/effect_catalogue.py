#!/usr/bin/env python3
"""Writes docs/effects.md from what the program says of its effects.

    python3 scripts/effect_catalogue.py [path of lobestone]

Pictures and look-alikes are those of scripts/effect_fingerprints.py. A test (tests/integration/book.rs) fails while the page lacks
an effect or tells it otherwise than the program.
"""

import json
import pathlib
import subprocess
import sys
import textwrap

ROOT = pathlib.Path(__file__).resolve().parent.parent

INTRO = """\
# Effects

The physics that a model may lack, as `diagnose` tries it, `add` adds it and `simulate` hides it. Written by
`scripts/effect_catalogue.py` from what the program itself says (`lobestone explain`); usual sizes are rules of thumb unless a
source is named with them. Formulas: one file an effect in `src/effects` and `src/effects/cutting`, with their sources. How to
add one: [adding an effect](adding-an-effect.md).

```sh
lobestone explain
lobestone explain tool-flexibility
```

The pictures show one campaign each in which the effect hides at a usual size (`scripts/effect_fingerprints.py`). For FRFs: the error
in multiples of the noise, by posture, direction and band, of the model without the effect after its joints were tuned, and with it; and the
FRF that it changes most. For forces: a turn of the tool, the drill's averages, or (chatter) the error by order of rotation. **Look-alikes** are other effects, and the share of what
this one leaves above the noise that each explains in that campaign in its stead: nine tenths and more are hard to tell apart, less
than half is seen at once.
"""

PICTURES = ROOT / "docs/pictures/effects"
# Share from which on another effect looks alike.
ALIKE = 0.1
CAPTIONS = {"": "what it does to a measurement", "-frf": "an FRF without and with it"}
HEADINGS = {"structure": "On the structure (FRFs)", "cutting": "On cutting forces and their records"}


def paragraph(text):
    return textwrap.fill(text, 120, break_long_words=False, break_on_hyphens=False) + "\n\n"


def fingerprint(identity, look_alikes):
    """Pictures of an effect, and what comes nearest to it."""
    text = ""
    for suffix, caption in CAPTIONS.items():
        if (PICTURES / f"{identity}{suffix}.png").exists():
            text += f"![{identity}: {caption}](pictures/effects/{identity}{suffix}.png)\n\n"
    if identity not in look_alikes:
        return text
    near = look_alikes[identity]["nearest"]
    alike = [f"`{n['effect']}` ({100 * n['share']:.0f} %)" for n in near if n["share"] >= ALIKE]
    if alike:
        return text + paragraph("**Look-alikes.** " + ", ".join(alike) + ".")
    most = max((n["share"] for n in near), default=0.0)
    return text + paragraph(f"**Look-alikes.** None: nothing else explains more than {100 * most:.0f} % of it.")


def main():
    program = sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "target/release/lobestone")
    said = subprocess.run([program, "explain", "--json"], check=True, capture_output=True).stdout
    page = INTRO
    look_alikes = json.loads((PICTURES / "look-alikes.json").read_text())
    for domain, heading in HEADINGS.items():
        page += f"\n## {heading}\n\n"
        for effect in json.loads(said)["effects"]:
            if effect["domain"] != domain:
                continue
            sites = f" at {', '.join(effect['sites'])} (of the IRB 6640)" if effect["sites"] else ""
            page += f"### `{effect['effect']}`{sites}\n\n"
            page += paragraph(effect["explanation"])
            page += paragraph("**How it shows.** " + effect["fingerprint"])
            page += paragraph("**In the lab.** " + effect["lab_check"])
            page += paragraph("**Best measured.** " + effect["best_measured"])
            page += fingerprint(effect["effect"], look_alikes)
            page += paragraph("**Usual sizes.** " + effect["typical"])
            for source in effect["sources"]:
                page += paragraph("Source: " + source)
    (ROOT / "docs/effects.md").write_text(page.rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Writes docs/effects.md from what the program says of its effects.

    python3 scripts/effect_catalogue.py [path of lobestone]

A test (tests/integration/book.rs) fails while the page lacks an effect or tells it otherwise than the program.
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
"""

HEADINGS = {"structure": "On the structure (FRFs)", "cutting": "On cutting forces and their records"}


def paragraph(text):
    return textwrap.fill(text, 120, break_long_words=False, break_on_hyphens=False) + "\n\n"


def main():
    program = sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "target/release/lobestone")
    said = subprocess.run([program, "explain", "--json"], check=True, capture_output=True).stdout
    page = INTRO
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
            page += paragraph("**Usual sizes.** " + effect["typical"])
            for source in effect["sources"]:
                page += paragraph("Source: " + source)
    (ROOT / "docs/effects.md").write_text(page.rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

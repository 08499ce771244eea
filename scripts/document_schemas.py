#!/usr/bin/env python3
"""JSON Schemas of the documents that commands print with --json: draws them from documents, or holds documents against them.

usage: document_schemas.py draw  PROGRAM [COMMAND…]   writes src/commands/write/documents/*.json (all that it can run, or these commands)
       document_schemas.py check PROGRAM               every document is valid by the schema that PROGRAM prints for it, and no key of
                                                       it is unknown to the schema (needs the package jsonschema)

`draw` runs the commands below on the campaigns of this repository and puts together what it sees: a key that every document of a
command has is required at the top; numbers may be null. What the commands below do not print is kept from the file that is there.
After a key was added: build, draw, look at the difference, build again.
"""

import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "src/commands/write/documents"
BLIND = ROOT / "tests/data/blind"
# Objects whose names are not keys of the program but of the campaign: postures, cuts, effects' parameters.
MAPS = {
    "by_posture", "by_direction", "by_point", "by_cut", "by_axis", "by_speed", "by_feed", "by_order", "errors", "size", "variant",
    "counts", "quantiles", "last", "settings",
}
# What the commands below do not show, by its key: lists that are empty and values that are null there.
TEXT, NUMBER = {"type": ["null", "string"]}, {"type": ["null", "number"]}
UNSEEN = {
    **dict.fromkeys(
        ["warnings", "effects", "stands_out", "reasons", "indistinguishable", "images", "missing", "sites", "unreadable", "not_used",
         "out_of_reach", "inseparable", "joints", "companions", "chosen_anew"],
        {"type": "array", "items": {"type": "string"}},
    ),
    **dict.fromkeys(["not_converged_because", "best_guess", "companion", "looks_like", "too_little_data", "site", "cut_list", "next_step",
                     "beside", "lead_beside"], TEXT),
    **dict.fromkeys(["share", "small_errors_share", "std_error", "std_error_bootstrap", "time_constant_s", "last_sigmas", "change_sigmas",
                     "reciprocity_nrms", "elbow_deg", "frequency_scatter"], NUMBER),
    "revision": {"type": ["integer", "null"]},
    "residual_peaks_hz": {"type": "array", "items": NUMBER},
    "setup": {"type": "array", "items": {"type": "object", "properties": {
        "kind": {"type": "string"}, "where": TEXT, "value": {}, "std_error": NUMBER, "unit": TEXT, "confidence": NUMBER, "remedy": TEXT,
    }}},
}
# Keys that other programs rely on: always there.
NEVER_NULL = {"verdict", "domain", "name", "dir", "html", "kind", "path", "format", "process", "method", "unit", "error", "iterations",
              "converged", "out", "what", "places", "truth"}
KEY = re.compile(r"^[a-z][a-z0-9_]*$")
# Of commands on a campaign with both sides.
SIDES = {"compare", "diagnose", "history", "undo"}
SECTIONS = {
    "redundancy": '[lobes.redundancy]\nposture = "p1"\nstep_deg = 60.0\n',
}


def runs(work):
    """Command lines; each list is one campaign's, in its order."""

    def copy(name, source=None):
        target = work / name
        shutil.copytree(source or BLIND / name, target)
        return target

    both, plain, payload = copy("both", ROOT / "datasets/campaigns/first-cell"), copy("frf-9112"), copy("frf-9114")
    nine, milling, drilling = copy("frf-9000"), copy("force-9400"), copy("force-9439")
    angle = copy("angle", BLIND / "frf-9112")
    lobes = (
        '\n[lobes]\nprocess = "drilling"\nsource = "model"\nktc_n_per_mm2 = 1000.0\nkrc_n_per_mm2 = 600.0\nteeth = 2\n'
        "half_point_angle_deg = 67.5\nspindle_rpm = [100.0, 400.0, 50.0]\n"
    )
    with (angle / "campaign.toml").open("a") as file:
        file.write(lobes + SECTIONS["redundancy"])
    nights = work / "nights.csv"
    nights.write_text("campaign,robot,date\nfrf-9112,r1,2026-11-22\nforce-9400,r1,2026-11-23\nnowhere,r1,2026-11-24\n")
    uff = plain / "frf/p1.uff"
    out = work / "out"
    return [
        ["inspect", uff, milling / "force/cut01.txt", drilling / "force/cut14.txt"],
        ["cfc", milling],
        ["cfc", milling, "--robust", "--nonnegative-edges"],
        ["cfc", drilling],
        ["cfc", both],
        ["cfc", ROOT / "datasets/campaigns/milling-wear"],
        ["modal", plain],
        ["modal", BLIND / "frf-9302"],
        ["modal", uff, "--together"],
        ["modal", uff, "--export", out / "modes"],
        ["model", plain],
        ["model", plain, "--matrices"],
        ["calibrate", plain],
        ["calibrate", plain, "--free", "masses"],
        ["compare", plain],
        ["compare", milling],
        ["compare", both],
        ["diagnose", plain],
        ["diagnose", payload],
        ["diagnose", milling],
        ["diagnose", copy("links", ROOT / "tests/data/links/both")],
        ["localise", payload],
        ["plan", plain],
        ["plan", payload],
        ["explain"],
        ["explain", "runout"],
        ["add", payload, "tool-flexibility"],
        ["add", plain, "time-delay"],
        ["add", milling, "runout"],
        ["compare", payload],
        ["calibrate", payload],
        ["history", payload],
        ["history", milling],
        ["undo", payload],
        ["undo", milling],
        ["history", plain],
        ["lobes", nine],
        ["lobes", both],
        ["lobes", angle],
        ["report", plain, "--no-diagnosis"],
        ["export", nine, "--what", "frf,lobes", "--format", "csv,uff", "--out", out / "numbers"],
        ["simulate", "--out", out / "lab", "--kind", "direct", "--seed", "11"],
        ["batch", nights, "--out", out / "batch", "--do", "calibrate"],
        ["fleet", out / "batch"],
        ["thesis"],
        ["completions", "bash"],
        ["man"],
        ["man", "--out", out / "man"],
        ["init", both, "--force"],
        ["init", drilling, "--force"],
    ]


def documents(program, wanted):
    with tempfile.TemporaryDirectory() as folder:
        for line in runs(Path(folder)):
            command = line[0]
            if wanted and command not in wanted:
                continue
            done = subprocess.run([program, *map(str, line), "--json"], capture_output=True, text=True)
            try:
                yield command, json.loads(done.stdout)
            except json.JSONDecodeError:
                raise SystemExit(f"{' '.join(map(str, line))}: status {done.returncode}\n{done.stderr}") from None


def kind(value):
    return {bool: "boolean", int: "integer", float: "number", str: "string", list: "array", dict: "object",
            type(None): "null"}[type(value)]


class Node:
    """What was seen at one place of the documents."""

    def __init__(self):
        self.kinds, self.keys, self.items, self.entries = set(), {}, None, None
        self.always = None

    def see(self, value, name=""):
        self.kinds.add(kind(value))
        if isinstance(value, list):
            self.items = self.items or Node()
            for item in value:
                self.items.see(item)
        elif isinstance(value, dict):
            if name in MAPS or not all(KEY.match(key) for key in value):
                self.entries = self.entries or Node()
                for entry in value.values():
                    self.entries.see(entry)
                return
            self.always = set(value) if self.always is None else self.always & set(value)
            for key, inner in value.items():
                # The parameters of an effect are named by the effect, those of a fit stand in a list.
                inside = "size" if key == "parameters" and isinstance(inner, dict) else key
                self.keys.setdefault(key, Node()).see(inner, inside)

    def schema(self, name="", top=False):
        kinds = set(self.kinds)
        if kinds <= {"null"} or (kinds <= {"null", "array"} and not (self.items and self.items.kinds)):
            return UNSEEN.get(name, {"type": sorted(kinds)} if "array" in kinds else {})
        # A number that does not exist is null (docs/json.md).
        if "number" in kinds:
            kinds = (kinds - {"integer"}) | {"null"}
        # So may anything else be, however often it was seen, but for lists, which are empty.
        if name and "array" not in kinds and name not in NEVER_NULL:
            kinds.add("null")
        out = {"type": min(kinds) if len(kinds) == 1 else sorted(kinds)}
        if self.items is not None:
            out["items"] = self.items.schema()
        if self.entries is not None:
            out["additionalProperties"] = self.entries.schema()
        if self.keys:
            out["properties"] = {key: self.keys[key].schema(key) for key in sorted(self.keys)}
            if top and self.always:
                out["required"] = sorted(self.always)
        return out


def draw(program, wanted):
    seen = {}
    for command, document in documents(program, wanted):
        top = seen.setdefault(command, Node())
        sides = [document["structure"], document["cutting"]] if command in SIDES and "structure" in document else [document]
        for side in sides:
            top.see(side)
    for command, node in sorted(seen.items()):
        schema = {
            "$schema": "http://json-schema.org/draft-04/schema#",
            "title": f"lobestone {command} --json",
            "description": f"What the keys mean: docs/json.md, {command}. More keys may be added.",
            **node.schema(top=True),
        }
        if command in SIDES:
            # A campaign with both sides has both, and nothing else but the next step.
            schema["required"] = ["next_step"]
            schema["properties"] |= {"structure": {"$ref": "#"}, "cutting": {"$ref": "#"}}
            schema["properties"] = dict(sorted(schema["properties"].items()))
        (FOLDER / f"{command}.json").write_text(json.dumps(schema, indent=1, ensure_ascii=False) + "\n")
        print(f"{command}: {len(schema['properties'])} keys")


def unknown(value, schema, root, at="$"):
    """Places of keys that the schema does not name."""
    if schema.get("$ref") == "#":
        schema = root
    if not schema:
        # Anything: what is there was never seen.
        return
    if isinstance(value, list):
        for k, item in enumerate(value):
            yield from unknown(item, schema.get("items", {}), root, f"{at}[{k}]")
    elif isinstance(value, dict):
        for key, inner in value.items():
            if key in schema.get("properties", {}):
                yield from unknown(inner, schema["properties"][key], root, f"{at}.{key}")
            elif "additionalProperties" in schema:
                yield from unknown(inner, schema["additionalProperties"], root, f"{at}.{key}")
            else:
                yield f"{at}.{key}"


def check(program):
    import jsonschema

    wrong, count, schemas = [], 0, {}
    for command, document in documents(program, []):
        if command not in schemas:
            printed = subprocess.run([program, "schema", command], capture_output=True, text=True, check=True).stdout
            schemas[command] = json.loads(printed)
            jsonschema.Draft4Validator.check_schema(schemas[command])
        schema = schemas[command]
        count += 1
        wrong += [f"{command}: {e.json_path}: {e.message[:200]}" for e in jsonschema.Draft4Validator(schema).iter_errors(document)]
        wrong += [f"{command}: {at} is not in the schema" for at in unknown(document, schema, schema)]
    # The check must be able to fail.
    broken = {"next_step": 5}
    assert list(jsonschema.Draft4Validator(schemas["calibrate"]).iter_errors(broken))
    assert list(unknown({"no_such_key": 1}, schemas["calibrate"], schemas["calibrate"])) == ["$.no_such_key"]
    if wrong:
        raise SystemExit("\n".join(sorted(set(wrong))))
    print(f"{count} documents of {len(schemas)} commands are what their schemas say")


if __name__ == "__main__":
    action, program, *wanted = sys.argv[1:]
    draw(program, wanted) if action == "draw" else check(program)

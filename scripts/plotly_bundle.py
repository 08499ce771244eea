#!/usr/bin/env python3
"""Makes src/report/interactive/plotly.min.js.gz: plotly.js with only what the figures of a report use.

    python3 scripts/plotly_bundle.py [--out FILE]

The whole of plotly.js is 1.4 MB compressed, and every report carries it; with these kinds of traces it is 0.5 MB. Made as plotly.js
describes it ("custom bundle"), from the package in the npm registry, in a folder that is removed afterwards. Needs node and
npm; only whoever changes VERSION or TRACES runs it. The licence is in src/report/interactive/plotly-LICENSE.txt.
"""

import argparse
import gzip
import pathlib
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
OUT = ROOT / "src/report/interactive/plotly.min.js.gz"
VERSION = "3.0.1"
TRACES = "scatter,heatmap,scatter3d"
# What plotly.js' own script for bundles imports: its development dependencies, as its package.json has them.
TOOLS = [
    "esbuild@0.23.1", "esbuild-plugin-environment@0.4.0", "esbuild-plugin-glsl@1.2.2", "esbuild-style-plugin@1.6.3",
    "esbuild-plugin-browserify-adapter@0.1.4", "fs-extra@10", "minimist@1", "prepend-file@2", "run-series@1", "stream-browserify@3",
    "autoprefixer@10", "postcss@8", "tailwindcss@3",
]  # fmt: skip


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--out", type=pathlib.Path, default=OUT)
    out = arguments.parse_args().out
    with tempfile.TemporaryDirectory() as folder:
        install = ["npm", "install", "--prefix", folder, "--ignore-scripts", "--no-audit", "--no-fund"]
        subprocess.run([*install, f"plotly.js@{VERSION}", *TOOLS], check=True)
        package = pathlib.Path(folder) / "node_modules/plotly.js"
        bundle = ["node", "tasks/custom_bundle.mjs", "--out", "lobestone", "--traces", TRACES, "--strict"]
        subprocess.run(bundle, cwd=package, check=True)
        script = (package / "dist/plotly-lobestone.min.js").read_bytes()
        licence = (package / "LICENSE").read_text()
    if not script.startswith(b"/**\n* plotly.js (lobestone - minified) v" + VERSION.encode()):
        raise SystemExit("the bundle is not what was asked for")
    # Without a date, so that the same version gives the same file.
    out.write_bytes(gzip.compress(script, 9, mtime=0))
    out.with_name("plotly-LICENSE.txt").write_text(
        f"plotly.js {VERSION} (https://github.com/plotly/plotly.js), a bundle of {TRACES.replace(',', ', ')} made by\n"
        "scripts/plotly_bundle.py. Licences of what it contains stand at the end of the script itself.\n\n" + licence
    )
    print(f"wrote {out}: {out.stat().st_size} bytes")


if __name__ == "__main__":
    main()

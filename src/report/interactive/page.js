// Joins the figures of a report: unpacks plotly.js and the figures, draws them, and lets models and FRFs be chosen.
// Where the browser lacks what this needs, the page keeps its static images.
"use strict";
const parsed = new Promise((done) => document.addEventListener("DOMContentLoaded", done));
(async () => {
  // Before anything is laid out, so that no image is seen that a figure then takes the place of.
  if (!("DecompressionStream" in window)) return;
  document.documentElement.classList.add("live");
  await parsed;
  const config = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d"] };
  const unpack = async (id) => {
    const letters = atob(document.getElementById(id).textContent);
    const bytes = new Uint8Array(letters.length);
    for (let k = 0; k < letters.length; k += 1) bytes[k] = letters.charCodeAt(k);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).text();
  };
  const sums = (differences) => {
    let sum = 0;
    return differences.map((d) => (sum += d));
  };
  // As packed.rs packs them: ln of the magnitude in 1e-4, phase in 0.01°.
  const magnitudes = (packed) => sums(packed).map((n) => (n > -1e6 ? Number(Math.exp(n * 1e-4).toPrecision(5)) : null));
  /** Lists of numbers as packed.rs has them in its table, and what refers to them as it was. */
  const numbers = (list) => {
    if (Array.isArray(list)) return list;
    let whole = list.steps;
    for (let k = 0; k < list.order; k += 1) whole = sums(whole);
    return whole.map((n) => n / 10 ** list.decimals);
  };
  const whole = (value, arrays) => {
    if (Array.isArray(value)) return value.map((v) => whole(v, arrays));
    if (value === null || typeof value !== "object") return value;
    if ("$" in value) return arrays[value.$];
    return Object.fromEntries(Object.entries(value).map(([key, v]) => [key, whole(v, arrays)]));
  };
  const phases = (packed, lowest) => sums(packed).map((n) => lowest + ((((n * 0.01 - lowest) % 360) + 360) % 360));
  // A line has a gap where the phase jumps from one end of its range to the other.
  const unbroken = (x, y) => {
    const points = { x: [], y: [] };
    y.forEach((value, k) => {
      if (k > 0 && Math.abs(value - y[k - 1]) > 180) { points.x.push(x[k]); points.y.push(null); }
      points.x.push(x[k]);
      points.y.push(value);
    });
    return points;
  };
  const inPlane = (magnitude, phase) => ({
    x: magnitude.map((m, k) => m * Math.cos((phase[k] * Math.PI) / 180)),
    y: magnitude.map((m, k) => m * Math.sin((phase[k] * Math.PI) / 180)),
  });

  class Explorer {
    constructor(root, data) {
      Object.assign(this, { root, data, frf: data.worst[0] ?? 0, model: data.models.length - 1, band: null, maps: [] });
      this.chosen = {};
      for (const key of ["posture", "response", "reference"]) {
        const select = (this.chosen[key] = root.querySelector(`select[name=${key}]`));
        select.addEventListener("change", () => this.choose(key, select.value));
      }
      root.querySelector(".worse").addEventListener("click", () => this.step(-1));
      root.querySelector(".better").addEventListener("click", () => this.step(1));
    }

    /** Buttons for the models; every bar of them on the page says the same. */
    addBar(bar) {
      this.data.models.forEach((model, k) => {
        const button = document.createElement("button");
        button.type = "button";
        button.textContent = `${model.title}: ${model.error}`;
        button.addEventListener("click", () => this.show(this.frf, k));
        bar.append(button);
      });
      (this.bars ??= []).push(bar);
      this.press();
    }

    press() {
      for (const bar of this.bars ?? []) {
        [...bar.children].forEach((button, k) => button.setAttribute("aria-pressed", String(k === this.model)));
      }
    }

    /** The FRF with `value` for `key` that shares most with the present one. */
    choose(key, value) {
      const now = this.data.frfs[this.frf];
      const shared = (f) => ["posture", "response", "reference"].filter((k) => k !== key && f[k] === now[k]).length;
      const those = this.data.frfs.map((f, k) => [f, k]).filter(([f]) => f[key] === value);
      those.sort((a, b) => shared(b[0]) - shared(a[0]));
      this.band = null;
      this.show(those[0][1], this.model);
    }

    /** Along the FRFs ordered by error against noise. */
    step(by) {
      const order = this.data.worst;
      const place = Math.min(Math.max(order.indexOf(this.frf) + by, 0), order.length - 1);
      this.band = null;
      this.show(order[place], this.model);
    }

    fill() {
      const { frfs } = this.data;
      const now = frfs[this.frf];
      const offered = {
        posture: frfs,
        response: frfs.filter((f) => f.posture === now.posture),
        reference: frfs.filter((f) => f.posture === now.posture && f.response === now.response),
      };
      for (const [key, those] of Object.entries(offered)) {
        const names = [...new Set(those.map((f) => f[key]))];
        this.chosen[key].replaceChildren(...names.map((name) => new Option(name, name, false, name === now[key])));
      }
    }

    /** Draws once the page around it is open: in a closed part there is no size to draw in. */
    async show(frf, model) {
      Object.assign(this, { frf, model });
      const { data, root } = this;
      this.drawn = isOpen(root);
      if (!this.drawn) {
        this.press();
        for (const map of this.maps) await map(model);
        return;
      }
      const f = data.frfs[frf];
      const m = data.models[model];
      this.fill();
      this.press();
      root.querySelector(".stated").textContent =
        `Posture ${f.posture}, response ${f.response}, force ${f.reference}, model ${m.title}: error ${m.errors[frf]} ` +
        `(${m.times[frf]} times the noise of this FRF, ${f.noise}). All FRFs together: error ${m.error}, noise ${data.noise}.`;
      root.dataset.frf = frf;
      root.dataset.model = model;
      const x = data.grids[f.grid];
      const measured = { magnitude: magnitudes(f.magnitude), phase: phases(f.phase, f.lowest) };
      const modelled = { magnitude: magnitudes(sums(m.magnitude[frf])), phase: phases(sums(m.phase[frf]), f.lowest) };
      const filled = [
        { x, y: magnitudes(f.level) },
        { x, y: measured.magnitude },
        { x, y: measured.phase },
        { x, y: modelled.magnitude },
        unbroken(x, modelled.phase),
      ];
      const name = (trace) => (trace.name === "model" ? { ...trace, name: `model ${escape(m.title)}` } : trace);
      const bode = data.bode.data.map((trace, k) => ({ ...name(trace), ...filled[k] }));
      const plane = [measured, modelled].map((c) => ({ ...inPlane(c.magnitude, c.phase), customdata: x }));
      const nyquist = data.nyquist.data.map((trace, k) => ({ ...name(trace), ...plane[k] }));
      // What was zoomed into stays in view while models are changed, not when another FRF comes.
      const look = (layout) => ({ ...structuredClone(layout), uirevision: `${frf} ${this.band}` });
      const layout = look(data.bode.layout);
      layout.yaxis2.range = [f.lowest - 15, f.lowest + 375];
      if (this.band) {
        layout.shapes = [{ type: "rect", layer: "below", xref: "x", yref: "paper", x0: this.band[0], x1: this.band[1],
          y0: 0, y1: 1, line: { width: 0 }, fillcolor: "rgba(250,178,112,0.28)" }];
      }
      await Plotly.react(root.querySelector(".bode"), bode, layout, config);
      await Plotly.react(root.querySelector(".nyquist"), nyquist, look(data.nyquist.layout), config);
      for (const map of this.maps) await map(model);
    }
  }

  let webgl;
  const inSpace = () => {
    if (webgl === undefined) {
      const context = document.createElement("canvas").getContext("webgl");
      context?.getExtension("WEBGL_lose_context")?.loseContext();
      webgl = !!context;
    }
    return webgl;
  };
  const isSpatial = (plot) => "scene" in plot.layout || !!plot.choice?.plots.some((p) => "scene" in p.plot.layout);

  /** Whether an element is not within a part that is folded up. */
  const isOpen = (element) => !element.closest("details:not([open])");

  const escape = (name) => name.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

  /** Draws a figure in place of its image; maps of the error follow the model of `explorer` and lead to its FRFs. */
  const draw = async (figure, plot, explorer) => {
    const heading = figure.querySelector(".heading");
    const div = figure.querySelector(".plot");
    if (isSpatial(plot) && !inSpace()) {
      // No figure that turns without WebGL: the image stays.
      figure.classList.add("still");
      return;
    }
    if (plot.data.some((trace) => trace.type === "heatmap")) figure.classList.add("map");
    await Plotly.newPlot(div, plot.data, plot.layout, config);
    if (plot.choice) {
      const label = figure.querySelector(".choice");
      const select = document.createElement("select");
      select.append(...plot.choice.plots.map(({ name }, k) => new Option(name, k)));
      select.addEventListener("change", () => {
        const chosen = plot.choice.plots[select.value].plot;
        heading.textContent = chosen.title;
        div.style.height = `${chosen.height}px`;
        Plotly.react(div, chosen.data, chosen.layout, config);
      });
      label.append(`${plot.choice.what} `, select);
    }
    if (explorer && plot.stages) {
      explorer.addBar(figure.querySelector(".models"));
      const follow = async (model) => {
        const stage = plot.stages[model];
        heading.textContent = stage.title;
        await Plotly.restyle(div, { z: [stage.z], text: [stage.text] }, [0]);
      };
      explorer.maps.push(follow);
      if (explorer.model !== plot.stages.length - 1) await follow(explorer.model);
    }
    const lead = explorer && plot.links && ((row, column) => {
      const frf = plot.links.frf[row]?.[column];
      if (!Number.isInteger(frf)) return;
      explorer.band = plot.links.bands_hz[column] ?? null;
      open(explorer.root);
      explorer.show(frf, explorer.model);
      explorer.root.scrollIntoView({ behavior: "smooth" });
    });
    if (lead) div.on("plotly_click", (event) => lead(...[].concat(event.points[0].pointIndex)));
    if (!plot.choice && plot.data.every((trace) => trace.type === "heatmap")) byKeyboard(figure, div, lead, explorer);
  };

  /** A map without a mouse: arrow keys choose a cell, which is marked and told; Enter does what a click does. */
  const byKeyboard = (figure, div, lead, explorer) => {
    const at = { table: 0, row: 0, column: 0 };
    const told = document.createElement("p");
    told.className = "told";
    told.setAttribute("aria-live", "polite");
    figure.append(told);
    div.tabIndex = 0;
    div.setAttribute("role", "application");
    const does = lead ? "Arrow keys choose a cell, Enter shows its FRF." : "Arrow keys choose a cell.";
    div.setAttribute("aria-label", `${div.getAttribute("aria-label")}. ${does}`);
    const plain = (html) => new DOMParser().parseFromString(html, "text/html").body.textContent;
    const show = () => {
      const { xaxis = "x", yaxis = "y", text } = div.data[at.table];
      const name = (axis, k) => plain(div.layout[axis[0] + "axis" + axis.slice(1)].ticktext[k]);
      told.textContent = `${name("y", at.row)}, ${name(xaxis, at.column)}: ${text[at.row][at.column] ?? "no value"}`;
      const cell = { x0: at.column - 0.5, x1: at.column + 0.5, y0: at.row - 0.5, y1: at.row + 0.5 };
      const mark = { type: "rect", xref: xaxis, yref: yaxis, ...cell, line: { color: "#0b57d0", width: 3 } };
      Plotly.relayout(div, { shapes: [mark] });
      div.querySelector(".shapelayer path")?.scrollIntoView({ block: "nearest", behavior: "instant" });
      Plotly.Fx.hover(div, { xval: at.column, yval: at.row }, xaxis + yaxis);
    };
    const steps = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] };
    div.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey) return;
      if (event.key === "Enter" && lead) {
        lead(at.row, at.column);
        explorer.chosen.posture.focus({ preventScroll: true });
      } else if (steps[event.key]) {
        const { z } = div.data[at.table];
        const [down, right] = steps[event.key];
        at.row = Math.min(Math.max(at.row + down, 0), z.length - 1);
        at.column += right;
        // From one map to the one next to it.
        if (at.column < 0) [at.table, at.column] = at.table > 0 ? [at.table - 1, z[0].length - 1] : [0, 0];
        else if (at.column >= z[0].length) {
          [at.table, at.column] = at.table + 1 < div.data.length ? [at.table + 1, 0] : [at.table, z[0].length - 1];
        }
        show();
      } else return;
      event.preventDefault();
    });
    div.addEventListener("focus", () => div.matches(":focus-visible") && show());
    div.addEventListener("blur", () => {
      Plotly.relayout(div, { shapes: [] });
      Plotly.Fx.unhover(div);
    });
  };

  /** Opens all folds around an element. */
  const open = (element) => {
    for (let fold = element.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
  };

  const live = [...document.querySelectorAll("[data-plot], [data-explorer]")];
  const opened = () => live.some(isOpen);
  // Begun at once, so that the first figure that is opened need not wait for it.
  const [script, described] = [unpack("plotly"), unpack("figures")];
  if (!opened()) {
    // Nothing to draw before a reader opens a part of the page.
    document.documentElement.dataset.ready = "true";
    await new Promise((done) => document.addEventListener("toggle", () => opened() && done(), true));
  }
  const library = document.createElement("script");
  library.textContent = await script;
  document.head.append(library);
  const { figures, explorers, arrays: table } = JSON.parse(await described);
  const arrays = table.map(numbers);

  // Every figure with the explorer before it, which its map follows; drawn when its part of the page is open.
  let explorer = null;
  const waiting = new Set();
  for (const element of live) {
    if (element.dataset.explorer !== undefined) {
      explorer = new Explorer(element, explorers[element.dataset.explorer]);
      explorer.addBar(element.querySelector(".models"));
    }
    waiting.add({ element, explorer });
  }
  /** How far out of the window, px. */
  const away = ({ element }) => {
    const { top, bottom } = element.getBoundingClientRect();
    return Math.max(top - window.innerHeight, -bottom, 0);
  };
  /** How far ahead of the reader figures are drawn: drawing all of a long page at once would keep it from answering for seconds. */
  const near = (part) => away(part) < 1.5 * window.innerHeight;
  const due = (part) =>
    isOpen(part.element) && near(part) && (part.element.dataset.explorer === undefined || !part.explorer.drawn);
  // What the reader sees comes first.
  const next = () => [...waiting].filter(due).sort((a, b) => away(a) - away(b))[0];
  const drawOpen = async () => {
    for (let part = next(); part; part = next()) {
      const { element, explorer } = part;
      if (element.dataset.explorer === undefined) {
        waiting.delete(part);
        await draw(element, whole(figures[element.dataset.plot], arrays), explorer);
      } else {
        // It stays: folded up, it may be told to show something else.
        await explorer.show(explorer.frf, explorer.model);
      }
      // Lets the page answer between two figures.
      await new Promise((done) => setTimeout(done));
    }
  };
  // After the window has grown plotly.js leaves a legend where it was on the narrow one, over the curves.
  let settled = 0;
  window.addEventListener("resize", () => {
    clearTimeout(settled);
    settled = setTimeout(() => {
      for (const div of document.querySelectorAll(".js-plotly-plot")) {
        const y = div.layout.legend?.y;
        if (y !== undefined && isOpen(div)) Plotly.relayout(div, { "legend.y": y });
      }
    }, 400);
  });
  let drawing = drawOpen();
  const goOn = () => (drawing = drawing.then(drawOpen));
  document.addEventListener("toggle", goOn, true);
  // Not on every pixel scrolled.
  let pausing = 0;
  const moved = () => {
    pausing ||= setTimeout(() => {
      pausing = 0;
      goOn();
    }, 100);
  };
  window.addEventListener("scroll", moved, { passive: true });
  window.addEventListener("resize", moved);
  await drawing;
  document.documentElement.dataset.ready = "true";
})().catch((error) => {
  document.documentElement.classList.remove("live");
  console.error(error);
});

// In the page of `lobestone serve`: where the reader is, for the next drawing of the report, in which parts may have grown or be gone: the
// last sections and folds that begin above the window, nearest first, and how far above (px), how far the page is scrolled (px), and what is
// unfolded. Told only once the reader is there again: a page that was just read has folds of its own.
if (window.parent !== window) {
  const root = document.documentElement;
  // Nothing is seen before the reader is there again: else the top of the page would flash.
  const seen = (yes) => (root.style.visibility = yes ? "" : "hidden");
  seen(false);
  setTimeout(() => seen(true), 3000);
  const folds = () => [...document.querySelectorAll("details")];
  const foldName = (fold) => `${fold.closest("[id]")?.id ?? ""}: ${fold.querySelector(":scope > summary")?.textContent ?? ""}`;
  const parts = () => [...document.querySelectorAll("section[id], details")];
  const name = (part) => (part.matches("details") ? foldName(part) : part.id);
  const folded = (part) => part.parentElement.closest("details:not([open])") !== null;
  const topOf = (part) => part.getBoundingClientRect().top;
  const tell = () => {
    const above = parts().filter((part) => !folded(part) && topOf(part) < 1).slice(-5).reverse();
    const lobestonePlace = {
      above: above.map((part) => ({ name: name(part), by: -topOf(part) })),
      scrolled: window.scrollY,
      unfolded: folds().filter((fold) => fold.open).map(foldName),
    };
    window.parent.postMessage({ lobestonePlace }, "*");
  };
  // There the reader has buttons and this page, no terminal.
  const pressed = {
    add: (words) => ["press ", bold("Add"), ` beside ${words.at(-1)}`],
    diagnose: () => ["press ", bold("Diagnose")],
    lobes: () => seenIn("lobes"),
    cfc: () => seenIn("records"),
    localise: () => seenIn("missing-physics"),
  };
  const bold = (text) => Object.assign(document.createElement("strong"), { textContent: text });
  const seenIn = (id) => {
    const title = document.querySelector(`section#${id} h2`)?.textContent.replace(/^\d+\. /, "");
    return title && ["see ", Object.assign(document.createElement("a"), { href: `#${id}`, textContent: title })];
  };
  const noTerminal = () => {
    for (const code of document.querySelectorAll("code.command")) {
      const [, command, ...words] = code.textContent.trim().split(/\s+/);
      const instead = pressed[command]?.(words);
      if (instead) code.replaceWith(...instead);
    }
  };
  window.addEventListener("message", (event) => {
    const place = event.data?.lobestonePlace;
    if (event.source !== window.parent || !Array.isArray(place?.above) || !Array.isArray(place.unfolded)) return;
    noTerminal();
    for (const fold of folds()) if (place.unfolded.includes(foldName(fold))) fold.open = true;
    const there = place.above.map(({ name: n, by }) => ({ part: parts().find((part) => name(part) === n), by })).find(({ part }) => part);
    // Figures above are still to be drawn, and are not as high as their images: until the reader scrolls, what was at the top stays there.
    let [settling, expected] = [true, 0];
    const settle = () => {
      const top = there ? window.scrollY + topOf(there.part) + there.by : place.scrolled;
      window.scrollTo({ top, behavior: "instant" });
      expected = window.scrollY;
    };
    const scrolled = () => {
      if (settling && Math.abs(window.scrollY - expected) >= 1) {
        settling = false;
        root.style.overflowAnchor = "";
      }
      tell();
    };
    root.style.overflowAnchor = "none";
    settle();
    new ResizeObserver(() => (settling ? settle() : tell())).observe(document.body);
    seen(true);
    window.addEventListener("scroll", scrolled, { passive: true });
    document.addEventListener("toggle", tell, true);
  });
}

// A link into a part that is folded up opens it; paper has everything open.
parsed.then(() => {
  const follow = () => {
    const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    const fold = target && (target.querySelector(":scope > details") ?? target.closest("details"));
    if (fold) fold.open = true;
  };
  window.addEventListener("hashchange", follow);
  follow();
  let folded = [];
  window.addEventListener("beforeprint", () => {
    folded = [...document.querySelectorAll("details:not([open])")];
    for (const fold of folded) fold.open = true;
  });
  window.addEventListener("afterprint", () => folded.forEach((fold) => (fold.open = false)));
});

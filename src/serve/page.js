// The page of `lobestone serve`: shows what `state` and `status` say, sends what is clicked as orders. Before there is a campaign
// it shows the beginning (begin.js).
"use strict";

const $ = (id) => document.getElementById(id);
const meta = (name) => document.querySelector(`meta[name="${name}"]`).content;

/** A node. Text is only ever set as text: nothing that a file says can become a part of the page. */
function make(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.filter((c) => c !== null && c !== undefined));
  return node;
}

/** Three significant digits, as the commands print them. */
function percent(share) {
  if (share === null || share === undefined) return "–";
  const value = 100 * share;
  if (value === 0) return "0 %";
  const decimals = Math.max(0, 2 - Math.floor(Math.log10(Math.abs(value))));
  return `${value.toFixed(Math.min(decimals, 6))} %`;
}

const TITLES = {
  structure: { name: "Robot model against FRFs", folds: "postures" },
  cutting: { name: "Force model against force records", folds: "cuts" },
};

let shown = null;      // the state that the page shows
let busy = false;      // a job is being done
let lastSeen = null;   // number of the last job whose end was told; null before the first look
let unreadable = false; // the alert says why the campaign cannot be read
let running = null;    // number of the job that is being done
let asked = null;      // stamp for which a report was asked for

// ---- orders ----

/** What the server answers, or `{refused: why}`; throws where nobody answers. */
async function post(path, body) {
  const answer = await fetch(path, { method: "POST", headers: { "X-Lobestone-Token": meta("token") }, body });
  const text = await answer.text();
  let told = {};
  try { told = JSON.parse(text); } catch { /* a plain sentence */ }
  return answer.ok ? told : { refused: told.refused ?? text };
}

/** `quiet`: not what the reader asked for, so a refusal need not be told. */
async function send(order, quiet = false) {
  if (busy) return;
  setBusy(true);
  if (!quiet) alertUser("");
  try {
    const { refused } = await post("order", JSON.stringify(order));
    if (refused) {
      if (!quiet) alertUser(refused);
      await showState();
    }
  } catch {
    gone();
  }
  look();
}

function alertUser(text) {
  setText($("alert"), text);
  $("alert").hidden = !text;
}

const GONE = "lobestone does not answer: it was ended, or the computer slept. Start `lobestone serve` again and open the address that it prints.";

function gone() {
  if ($("begin").hidden) alertUser(GONE);
  else Begin.tell(GONE);
}

function setBusy(now) {
  busy = now;
  for (const button of document.querySelectorAll("#loop button:not(#cancel), #leave")) {
    const never = button.dataset.never === "true";
    button.setAttribute("aria-disabled", String(busy || never));
  }
}

// ---- how far it is ----

let timer = null;

async function look() {
  clearTimeout(timer);
  try {
    const answer = await fetch("status");
    if (!answer.ok) throw new Error(answer.statusText);
    await follow(await answer.json());
    timer = setTimeout(look, busy ? 400 : 2000);
  } catch {
    gone();
    timer = setTimeout(look, 5000);
  }
}

async function follow(status) {
  if (status.session !== meta("session")) {
    // Another run of the server: this page's secret is worth nothing any more.
    location.reload();
    return;
  }
  const { job, last } = status;
  running = job?.number ?? null;
  // What failed before the page was opened is no news.
  if (lastSeen === null) lastSeen = job || !last ? 0 : last.number;
  setBusy(job !== null);
  showJob(job);
  // The first look, also while something is being done.
  if ($("begin").hidden && $("loop").hidden) await showState();
  if (job !== null) return;
  if (last && last.number !== lastSeen) {
    lastSeen = last.number;
    if (!last.ok) alertUser(last.text);
    if (last.ok && last.text) {
      $("said-text").textContent = last.text;
      $("said").hidden = false;
    }
    await showState();
  } else if ($("begin").hidden && (!shown || shown.stamp !== status.stamp)) {
    await showState();
  }
  // Drawn of another state of the folder, or not at all.
  if (shown && !shown.problem && shown.drawn_of !== status.stamp && asked !== status.stamp) {
    asked = status.stamp;
    send({ do: "refresh" }, true);
  }
}

function showJob(job) {
  $("job").hidden = job === null;
  if (job === null) return;
  const name = job.name.charAt(0).toUpperCase() + job.name.slice(1);
  setText($("job-name"), name);
  setText($("job-time"), `${Math.floor(job.seconds)} s`);
  setText($("cancel"), job.cancelled ? "Cancelling …" : "Cancel");
  const bar = $("job-bar");
  if (job.part && job.part.total > 0) {
    bar.max = job.part.total;
    bar.value = job.part.done;
    setText($("job-stage"), `${job.stage}: ${job.part.label}, ${job.part.done} of ${job.part.total}`);
  } else {
    bar.removeAttribute("value");
    setText($("job-stage"), job.stage);
  }
}

/** Readers read a live region aloud when it changes, so it changes only when there is news. */
function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

// ---- what is there ----

async function showState() {
  const answer = await fetch("state");
  if (!answer.ok) {
    alertUser(await answer.text());
    return;
  }
  const state = await answer.json();
  $("begin").hidden = !state.begin;
  $("loop").hidden = !!state.begin;
  $("leave").hidden = !state.can_leave;
  if (state.begin) {
    shown = null;
    setText($("name"), "New campaign");
    document.title = "New campaign – lobestone";
    setText($("folder"), "");
    Begin.show();
    return;
  }
  if (unreadable) alertUser("");
  unreadable = !!state.problem;
  if (state.problem) {
    shown = null;
    alertUser(state.problem);
    $("sides").replaceChildren(make("p", {}, "The campaign cannot be read; correct what is said above, then press “Read files again”."));
    return;
  }
  const drawnBefore = shown ? shown.report : null;
  shown = state;
  setText($("name"), state.name);
  document.title = `${state.name} – lobestone`;
  setText($("folder"), state.dir);
  const focused = document.activeElement?.dataset?.key;
  const chosen = [...document.querySelectorAll("#sides select")].map((s) => [s.id, s.value]);
  const scrolled = $("bench").scrollTop;
  const open = [...document.querySelectorAll("#sides details[open]")].map((d) => d.dataset.key);
  const effects = new Map(state.effects.map((e) => [e.effect, e]));
  const before = state.problems.map((p) => make("div", { class: "warning" }, p));
  const sides = state.sides.map((side) => sideNode(side, effects));
  if (sides.length > 1) {
    before.push(make("nav", { "aria-label": "Sides of the campaign" },
      ...state.sides.map((side) => make("a", { href: `#${side.side}` }, TITLES[side.side].name))));
  }
  if (!sides.length) sides.push(make("p", {}, "This campaign has nothing to compare a model with (no FRFs of a robot, no force records)."));
  $("sides").replaceChildren(...before, ...sides);
  for (const key of open) {
    const again = document.querySelector(`details[data-key="${CSS.escape(key)}"]`);
    if (again) again.open = true;
  }
  for (const [id, value] of chosen) {
    const again = document.getElementById(id);
    if ([...(again?.options ?? [])].some((o) => o.value === value)) again.value = value;
  }
  if (focused) document.querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus({ preventScroll: true });
  $("bench").scrollTop = scrolled;
  setBusy(busy);
  $("frame").hidden = !state.report;
  $("no-report").hidden = !!state.report;
  if (state.report && state.report !== drawnBefore) $("frame").src = `${meta("report")}?drawn=${state.report}`;
}

function button(label, key, order, extra = {}) {
  const { never, hint, first } = extra;
  return make("button", {
    type: "button", class: first ? "first" : null, "data-key": key, "data-never": never ? "true" : null,
    "aria-label": hint ?? null, title: hint ?? null,
    onclick: (event) => { if (event.currentTarget.getAttribute("aria-disabled") !== "true") send(order); },
  }, label);
}

function sideNode(side, effects) {
  const { revisions, noise_floor_nrms: recordedNoise, warnings } = side.history;
  const head = revisions.at(-1);
  // As it was recorded, where it was recorded of these data; else as it was fitted when the report was drawn.
  const recorded = head && head.same_data ? { ...head, noise_floor_nrms: recordedNoise } : null;
  const now = recorded ?? side.now ?? head ?? null;
  const { name, folds } = TITLES[side.side];
  const node = make("section", { class: "side", id: side.side, "aria-labelledby": `${side.side}-title` },
    make("h2", { id: `${side.side}-title` }, name));
  node.append(make("p", { class: "muted head" }, head ? `Revision ${title(head)}` : "Baseline: no effect was added yet"));
  const was = revisions.length > 1 && now === recorded ? revisions.at(-2).nrms : null;
  if (now) node.append(figures(now, was, folds));
  for (const warning of warnings ?? []) node.append(make("div", { class: "warning" }, warning));
  const rows = revisions.length ? revisions : now ? [{ ...now, revision: 0, effects: [], progress: null }] : [];
  if (rows.length) node.append(errorTable(rows, folds));
  if (head?.progress === false) {
    node.append(make("div", { class: "warning" }, `Revision ${head.revision} was no progress: the error on ${folds} left out of ` +
      "the fit did not fall by more than chance would let it. Undo takes it back."));
  }
  const last = revisions.length ? revisions.at(-1).effects.at(-1) : null;
  node.append(make("div", { class: "actions" },
    button("Diagnose", `${side.side}-diagnose`, { do: "diagnose", side: side.side },
      { first: true, hint: "Diagnose: try every effect of the library and say which one is missing" }),
    button(last ? `Undo ${last}` : "Undo", `${side.side}-undo`, { do: "undo", side: side.side, head: side.head },
      { never: !side.can_undo, hint: side.can_undo ? null : "Undo: there is no added effect to take back" })));
  if (side.diagnosis) node.append(...diagnosisNodes(side, effects, folds));
  else node.append(make("p", { class: "muted" }, "What this model lacks was not looked for yet: press Diagnose."));
  node.append(otherEffect(side, effects));
  return node;
}

const title = (revision) => revision.effects.length ? `${revision.revision}: + ${revision.effects.at(-1)}` : "0: baseline";

function figures(now, was, folds) {
  const times = now.noise_floor_nrms > 0 ? now.nrms / now.noise_floor_nrms : null;
  const entry = (name, value, kind) => make("div", {}, make("dt", {}, name), make("dd", { class: kind }, value));
  const list = make("dl", { class: "big" },
    entry(was === null ? "error now" : `error now (was ${percent(was)})`, percent(now.nrms), times === null ? null : times < 1.5 ? "good now" : "bad now"),
    entry("noise floor", percent(now.noise_floor_nrms)));
  if (now.held_out_nrms !== null && now.held_out_nrms !== undefined)
    list.append(entry(`on ${folds} left out`, percent(now.held_out_nrms)));
  return list;
}

const SVG = "http://www.w3.org/2000/svg";

function draw(tag, attributes, ...children) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

/** One bar a revision, all on one scale, with the noise floor as a line. */
function errorTable(rows, folds) {
  const largest = Math.max(...rows.map((r) => Math.max(r.nrms, r.noise_floor_nrms ?? 0)));
  const share = (value) => (largest > 0 ? Math.max(0.3, 100 * value / largest) : 0);
  const body = rows.map((r, i) => {
    const bars = draw("svg", { viewBox: "0 0 100 18", preserveAspectRatio: "none", role: "img",
      "aria-label": `error ${percent(r.nrms)}, noise ${percent(r.noise_floor_nrms)}` },
      draw("rect", { class: r.progress === false ? "stuck" : "fall", x: 0, y: 2, height: 14, width: share(r.nrms) }));
    if (r.noise_floor_nrms) {
      const x = share(r.noise_floor_nrms);
      bars.append(draw("line", { class: "noise", x1: x, x2: x, y1: 0, y2: 18 }));
    }
    return make("tr", { class: i === rows.length - 1 ? "head" : null },
      make("th", { scope: "row" }, title(r), r.progress === false ? make("span", { class: "tag" }, "not progress") : null),
      make("td", { class: "num" }, percent(r.nrms)),
      make("td", { class: "num" }, percent(r.held_out_nrms)),
      make("td", { class: "chart" }, bars));
  });
  return make("table", { class: "errors" },
    make("caption", {}, "The error, revision by revision; the red line is the noise floor"),
    make("thead", {}, make("tr", {},
      make("th", { scope: "col" }, "revision"), make("th", { scope: "col", class: "num" }, "error"),
      make("th", { scope: "col", class: "num" }, `left-out ${folds}`), make("td"))),
    make("tbody", {}, ...body));
}

const SHOWN = 5;

function diagnosisNodes(side, effects, folds) {
  const d = side.diagnosis;
  const verdict = make("div", { class: `verdict ${d.verdict}` }, make("p", { class: "answer" }, d.answer));
  const fingerprint = d.effect && effects.get(d.effect)?.fingerprint;
  if (fingerprint) verdict.append(make("p", {}, make("strong", {}, "How it shows: "), fingerprint));
  const check = d.effect && effects.get(d.effect)?.lab_check;
  if (check) verdict.append(make("p", {}, make("strong", {}, "Check in the laboratory: "), check));
  if (d.indistinguishable.length)
    verdict.append(make("p", {}, make("strong", {}, "These data cannot tell it from: "), d.indistinguishable.join(", ")));
  verdict.append(make("p", {}, make("strong", {}, "Most telling further measurement: "), d.next_measurement.what));
  const nodes = [make("h3", {}, "What is missing"), verdict];
  for (const warning of d.warnings ?? []) nodes.push(make("div", { class: "warning" }, warning));
  if (d.lead?.add) nodes.push(drawnNode(side, d.lead));
  if (!d.candidates.length) return nodes;
  const row = (c) => {
    const label = c.site ? `${c.effect}@${c.site}` : c.effect;
    const what = effects.get(c.effect);
    return make("tr", {},
      make("th", { scope: "row" }, label, c.at_bound ? make("span", { class: "tag" }, "at the end of its range") : null,
        what ? explanation(what, `${side.side}-${label}`) : null),
      make("td", { class: "num" }, percent(c.nrms)),
      make("td", { class: "num" }, percent(c.held_out_nrms)),
      make("td", {}, button("Add", `${side.side}-add-${label}`, { do: "add", side: side.side, head: side.head, effect: label },
        { hint: `Add ${label} to the model and fit everything again` })));
  };
  const table = (candidates) => make("table", { class: "candidates" },
    make("thead", {}, make("tr", {},
      make("th", { scope: "col" }, "effect"), make("th", { scope: "col", class: "num" }, "error with it"),
      make("th", { scope: "col", class: "num" }, `left-out ${folds}`), make("td"))),
    make("tbody", {}, ...candidates.map(row)));
  nodes.push(make("h3", {}, "Candidates, best first"), table(d.candidates.slice(0, SHOWN)));
  if (d.candidates.length > SHOWN)
    nodes.push(make("details", { "data-key": `${side.side}-more` },
      make("summary", {}, `${d.candidates.length - SHOWN} more`), table(d.candidates.slice(SHOWN))));
  return nodes;
}

/** What the data draw where no effect of the library explains them. */
function drawnNode(side, lead) {
  const one = ({ place, form, add }) => make("li", {}, `${form} at ${place} `,
    button("Add", `${side.side}-add-${add}`, { do: "add", side: side.side, head: side.head, effect: add },
      { hint: `Add ${add} to the model and fit everything again` }));
  const rest = lead.left === null ? "" : ` With it ${lead.left.toFixed(2)} times the variance of the noise is left.`;
  return make("div", {}, make("h3", {}, "What the data draw"),
    make("p", {}, `It has no name here, but where it acts and how can be put into the model.${rest}`),
    make("ul", { class: "drawn" }, ...[lead, lead.second].filter((l) => l?.add).map(one)));
}

function explanation(effect, key) {
  const list = make("dl", {});
  for (const [name, text] of [
    ["What it is", effect.explanation], ["How it shows", effect.fingerprint],
    ["How to check it in the lab", effect.lab_check], ["What measurement shows it best", effect.best_measured],
    ["Usual sizes (rules of thumb)", effect.typical],
  ]) list.append(make("dt", {}, name), make("dd", {}, text));
  return make("details", { "data-key": `${key}-explained` }, make("summary", {}, "what is it?"), list);
}

/** Any effect of the library, also without a diagnosis. */
function otherEffect(side, effects) {
  const there = side.history.revisions.at(-1)?.effects ?? [];
  const labels = [];
  for (const effect of effects.values()) {
    if (effect.domain !== side.side) continue;
    const own = effect.sites.length ? effect.sites.map((s) => `${effect.effect}@${s}`) : [effect.effect];
    labels.push(...own.filter((label) => !there.includes(label)));
  }
  const select = make("select", { id: `${side.side}-other`, "data-key": `${side.side}-other` },
    ...labels.map((label) => make("option", { value: label }, label)));
  const add = make("button", { type: "button", "data-key": `${side.side}-other-add`, "aria-label": "Add the chosen effect",
    onclick: (event) => {
      if (event.currentTarget.getAttribute("aria-disabled") !== "true")
        send({ do: "add", side: side.side, head: side.head, effect: select.value });
    } }, "Add");
  return make("details", { "data-key": `${side.side}-other-open` },
    make("summary", {}, "Add an effect of your own choice"),
    make("div", { class: "other" }, make("label", { for: `${side.side}-other`, class: "muted" }, "effect"), select, add));
}

// The report in its frame has no origin: where its reader is and what is unfolded it tells, and is told again after it was drawn anew.
let reportPlace = { above: [], scrolled: 0, unfolded: [] };
window.addEventListener("message", (event) => {
  if (event.source === $("frame").contentWindow && event.data?.lobestonePlace) reportPlace = event.data.lobestonePlace;
});
$("frame").addEventListener("load", () => $("frame").contentWindow.postMessage({ lobestonePlace: reportPlace }, "*"));

$("cancel").addEventListener("click", async () => {
  if (running === null) return;
  try {
    await post("cancel", JSON.stringify({ number: running }));
  } catch {
    gone();
  }
  look();
});

/** Back to the beginning, for another campaign. */
$("leave").addEventListener("click", async (event) => {
  if (event.currentTarget.getAttribute("aria-disabled") === "true") return;
  const { refused } = await post("begin", JSON.stringify({ do: "leave" }));
  if (refused) alertUser(refused);
  else location.reload();
});

$("refresh").addEventListener("click", (event) => {
  if (event.currentTarget.getAttribute("aria-disabled") !== "true") send({ do: "refresh" });
});
look();

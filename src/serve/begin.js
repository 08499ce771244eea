// The beginning of the page: a folder is chosen, or made of what is dropped here; then its campaign file is completed and written.
// What is typed is kept here as answers; what follows from it the server says.
"use strict";

const Begin = (() => {
  let place = null;            // the folder that is shown, as the server told it
  let draft = null;            // the campaign file in the making, as the server told it
  let dropped = [];            // [path, File]
  let wish = null;             // folder, name, answers …
  let asking = 0;              // numbers the questions: only the last answer counts
  let stopCopying = null;

  const main = () => $("begin");
  const ask = (request) => post("begin", JSON.stringify(request));

  function tell(text) {
    const alert = $("begin-alert");
    if (!alert) return;
    setText(alert, text);
    alert.hidden = !text;
    if (text) alert.scrollIntoView({ block: "nearest" });
  }

  /** The answer, or null where it was refused or another question was asked meanwhile. */
  async function answer(request) {
    const number = ++asking;
    main().setAttribute("aria-busy", "true");
    try {
      const told = await ask(request);
      if (number !== asking) return null;
      tell(told.refused ?? "");
      return told.refused ? null : told;
    } catch {
      tell(GONE);
      return null;
    } finally {
      if (number === asking) main().removeAttribute("aria-busy");
    }
  }

  const button = (label, onclick, extra = {}) => make("button", { type: "button", onclick, ...extra }, label);
  const alertNode = () => make("div", { id: "begin-alert", role: "alert", class: "alert", hidden: true });
  const megabytes = (bytes) => `${(bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0)} MB`;

  function show() {
    if (!place && !draft) go(null);
  }

  // ---- which folder ----

  async function go(folder) {
    const told = await answer({ do: "look", folder });
    if (!told) {
      if (!place) main().replaceChildren(alertNode(), make("p", {}, "The folders of this computer cannot be shown."));
      return;
    }
    place = told;
    draft = null;
    choosing();
  }

  function choosing() {
    const typed = make("input", { id: "path", type: "text", value: place.folder, spellcheck: "false", autocomplete: "off",
      onkeydown: (event) => { if (event.key === "Enter") go(typed.value); } });
    const entry = (name, path, campaign) => make("li", {},
      button(name, () => go(path), { class: "entry", "data-key": `go-${path}` }),
      campaign ? make("span", { class: "tag" }, "campaign") : null);
    const list = make("ul", { class: "folders", "aria-label": `Folders in ${place.folder}` });
    if (place.parent) list.append(entry("↑ folder above", place.parent, false));
    if (place.home && place.home !== place.folder) list.append(entry("⌂ home folder", place.home, false));
    list.append(...place.folders.map((f) => entry(f.name, f.path, f.campaign)));
    const files = place.files.length
      ? make("details", {}, make("summary", {}, `${place.files.length} files lie directly in it`),
        make("ul", { class: "files" }, ...place.files.slice(0, 200).map((name) => make("li", {}, name))))
      : make("p", { class: "muted" }, "No file lies directly in it.");
    const use = place.campaign
      ? button("Open this campaign", () => open(place.folder), { class: "first", id: "use" })
      : button("Make a campaign of this folder", () => begin(place.folder), { class: "first", id: "use" });
    main().replaceChildren(alertNode(), make("div", { class: "two" },
      make("section", { "aria-labelledby": "from-here" },
        make("h2", { id: "from-here" }, "A folder on this computer"),
        make("p", { class: "muted" }, "The one that your measurement files lie in (subfolders count). Files stay where they are and are never changed."),
        make("div", { class: "line" }, make("label", { for: "path" }, "Folder"), typed, button("Go", () => go(typed.value), { id: "go" })),
        list, place.cut_short ? make("p", { class: "muted" }, "There are more; type the path.") : null, files,
        make("div", { class: "actions" }, use)),
      dropNode()));
    copyNode();
  }

  // ---- dropped files ----

  function dropNode() {
    const input = (id, label, extra) => make("span", {}, make("label", { for: id, class: "pick" }, label),
      make("input", { id, type: "file", multiple: true, class: "hidden-input", ...extra, onchange: (event) => {
        take([...event.target.files].map((file) => [file.webkitRelativePath || file.name, file]));
      } }));
    return make("section", { "aria-labelledby": "from-elsewhere" },
      make("h2", { id: "from-elsewhere" }, "Files dropped here"),
      make("p", { class: "muted" }, "They are copied into a new folder on this computer. Nothing leaves the computer."),
      make("div", { class: "drop", id: "drop" }, make("p", {}, "Drop files or a folder anywhere on this page, or choose"),
        make("div", { class: "actions" }, input("pick-files", "Files …", {}), input("pick-folder", "A folder …", { webkitdirectory: true }))),
      make("div", { id: "copy" }));
  }

  /** Files in what was dropped, folders too. */
  async function filesOf(items) {
    const found = [];
    async function walk(entry, path) {
      if (entry.isFile) {
        const file = await new Promise((done, failed) => entry.file(done, failed));
        found.push([path + entry.name, file]);
        return;
      }
      const reader = entry.createReader();
      for (;;) {
        const some = await new Promise((done, failed) => reader.readEntries(done, failed));
        if (!some.length) return;
        for (const child of some) await walk(child, `${path}${entry.name}/`);
      }
    }
    const entries = [...items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
    for (const entry of entries) await walk(entry, "");
    return found;
  }

  function take(files) {
    dropped = files.filter(([path]) => !path.split("/").some((part) => part.startsWith(".")));
    copyNode();
  }

  /** Where all come from one folder its name is the new one's. */
  function commonFolder() {
    const first = dropped[0]?.[0].split("/");
    if (!first || first.length < 2 || !dropped.every(([path]) => path.startsWith(`${first[0]}/`))) return "";
    return first[0];
  }

  function copyNode() {
    if (!$("copy")) return;
    if (!dropped.length) {
      $("copy").replaceChildren();
      return;
    }
    const size = dropped.reduce((sum, [, file]) => sum + file.size, 0);
    const name = make("input", { id: "new-name", type: "text", value: commonFolder() || "campaign", autocomplete: "off" });
    $("copy").replaceChildren(
      make("p", {}, `${dropped.length} files, ${megabytes(size)}.`),
      make("div", { class: "line" }, make("label", { for: "new-name" }, "New folder"), name),
      make("p", { class: "muted" }, `in ${place.folder} (choose another place on the left)`),
      make("div", { class: "actions" }, button("Copy and go on", () => copy(name.value), { class: "first", id: "copy-files" })));
  }

  async function copy(name) {
    const made = await answer({ do: "folder", parent: place.folder, name });
    if (!made) return;
    const common = commonFolder();
    const files = dropped.map(([path, file]) => [common ? path.slice(common.length + 1) : path, file]);
    const bar = make("progress", { max: files.length, value: 0, "aria-label": "files copied" });
    const said = make("p", { role: "status" }, "");
    stopCopying = new AbortController();
    const { signal } = stopCopying;
    $("copy").replaceChildren(bar, said, button("Cancel", () => stopCopying.abort(), { id: "copy-cancel" }));
    const failed = [];
    for (const [i, [path, file]] of files.entries()) {
      if (signal.aborted) break;
      setText(said, `${i + 1} of ${files.length}: ${path}`);
      const refused = await send(made.folder, path, file, signal);
      if (refused) failed.push(`${path}: ${refused}`);
      bar.value = i + 1;
    }
    dropped = [];
    if (signal.aborted) {
      await go(made.folder);
      tell("Cancelled: what was copied until then lies in this folder.");
      return;
    }
    const there = await answer({ do: "look", folder: made.folder });
    if (there?.campaign) await open(made.folder);
    else await begin(made.folder);
    if (failed.length) tell(`Not copied:\n${failed.join("\n")}`);
  }

  /** Why a file was not taken, or null. A line that names it goes before it. */
  async function send(folder, name, file, signal) {
    try {
      const answer = await fetch("upload", { method: "POST", headers: { "X-Lobestone-Token": meta("token") }, signal,
        body: new Blob([`${JSON.stringify({ folder, name })}\n`, file]) });
      const text = await answer.text();
      if (answer.ok) return null;
      try { return JSON.parse(text).refused ?? text; } catch { return text; }
    } catch (error) {
      return error.message;
    }
  }

  // ---- the campaign file ----

  async function open(dir) {
    if (await answer({ do: "open", dir })) location.reload();
  }

  async function begin(dir) {
    wish = { dir, name: null, answers: [], left_out: [], cut_list: null, again: true };
    main().replaceChildren(alertNode());
    if (await reading(dir, () => go(dir))) return;
    main().append(button("Choose another folder", () => go(dir)));
  }

  /** Has the files of a folder read, shows how far that is, and ends it where that is wanted: then `back` is done. False: it failed. */
  async function reading(dir, back) {
    const bar = make("progress", { "aria-label": "files read" });
    const said = make("p", { role: "status" }, "Reading the files of the folder …");
    let over = false;
    const cancel = button("Cancel", async () => {
      if (over) return;
      over = true;
      asking += 1; // Whatever is answered now to what was asked before is no news.
      try { await ask({ do: "stop", dir }); } catch { /* `back` says that nobody answers */ }
      node.remove();
      main().removeAttribute("aria-busy");
      await back();
      tell("Cancelled while the files were read; nothing was written.");
    }, { id: "read-cancel" });
    const node = make("section", { id: "reading" }, said, make("div", { class: "line" }, bar, cancel));
    $("begin-alert").after(node);
    const look = async () => {
      if (over) return;
      try {
        const { files } = await ask({ do: "reading", dir });
        if (files && !over) {
          bar.max = files.total;
          bar.value = files.done;
          setText(said, `Reading the files of the folder: ${files.done} of ${files.total}`);
        }
      } catch { /* the question that matters fails, too */ }
      setTimeout(look, 300);
    };
    setTimeout(look, 300);
    const done = await redraft();
    if (over) return true;
    over = true;
    node.remove();
    return done;
  }

  async function redraft() {
    const told = await answer({ do: "draft", wish });
    wish.again = false;
    if (!told) return false;
    draft = told;
    if (wish.name === null) wish.name = told.name;
    drafting();
    return true;
  }

  /** The same folder, read once more; the answers stay. */
  async function readAgain() {
    if ($("reading")) return;
    wish.again = true;
    await reading(wish.dir, () => {});
  }

  const tableName = (table) => `${table.kind} ${table.name}`.trim();

  function set(table, key, value) {
    wish.answers = wish.answers.filter(([t, k]) => t !== table || k !== key);
    if (value.trim()) wish.answers.push([table, key, value]);
  }

  const short = (what) => what.split(/[:(]/)[0].trim();

  /** A field, and under it why it has a value that nobody gave. */
  function fieldNode(table, field, label) {
    const name = tableName(table);
    const key = `${name}.${field.key}`;
    const value = field.value ?? "";
    if (!field.what) return make("span", {}, value);
    const missing = field.required && !field.value;
    const attributes = { "data-key": key, "aria-label": label ?? `${short(field.what)}, ${name}`, title: field.what,
      class: missing ? "missing" : field.guessed ? "guessed" : null, "aria-invalid": missing ? "true" : null,
      onchange: (event) => { set(name, field.key, event.target.value); redraft(); } };
    const input = field.choices.length
      ? make("select", attributes, ...["", ...field.choices].map((c) => make("option", { value: c, selected: c === value }, c || "…")))
      : make("input", { ...attributes, type: "text", value, placeholder: missing ? field.example : null, autocomplete: "off", spellcheck: "false",
        size: Math.min(42, Math.max(7, value.length + 1)) });
    return make("span", { class: "field" }, input, field.guessed ? make("small", { class: "why" }, `guessed: ${field.guessed}`) : null,
      missing ? make("small", { class: "why need" }, "fill in") : null);
  }

  const wide = (label, node) => make("div", { class: "wide", tabindex: "0", role: "region", "aria-label": label }, node);
  const tables = (kind) => draft.tables.filter((t) => t.kind === kind);

  /** Tables of one kind as rows, a column a key. */
  function rowsNode(rows, caption, before = []) {
    const keys = [];
    for (const row of rows) for (const field of row.fields) if (!keys.some((f) => f.key === field.key)) keys.push(field);
    const head = make("tr", {}, ...before.map((b) => make("th", { scope: "col" }, b.title)),
      ...keys.map((f) => make("th", { scope: "col", title: f.what || null }, f.what ? short(f.what) : f.key)));
    const names = { cut: "all cuts", frf: "all files" };
    const alike = (f) => f.what && f.key !== "posture";
    const all = rows.length > 2 && names[rows[0].kind]
      ? make("tr", { class: "all" }, ...before.map(() => make("td")),
        ...keys.map((f, i) => make("td", {}, i === 0 ? names[rows[0].kind] : alike(f) ? allNode(rows, f, names[rows[0].kind]) : null)))
      : null;
    const body = rows.map((row) => make("tr", {}, ...before.map((b) => make("td", {}, b.cell(row))),
      ...keys.map((f) => {
        const own = row.fields.find((field) => field.key === f.key);
        return make("td", {}, own ? fieldNode(row, own) : null);
      })));
    return wide(caption, make("table", { class: "form" }, make("caption", {}, caption), make("thead", {}, head), make("tbody", {}, all, ...body)));
  }

  /** One value for all rows. */
  function allNode(rows, field, of) {
    const onchange = (event) => {
      for (const row of rows) if (row.fields.some((f) => f.key === field.key)) set(tableName(row), field.key, event.target.value);
      redraft();
    };
    const attributes = { "data-key": `all.${field.key}`, "aria-label": `${short(field.what)}, ${of}`, onchange };
    return field.choices.length
      ? make("select", attributes, ...["", ...field.choices].map((c) => make("option", { value: c }, c || "…")))
      : make("input", { ...attributes, type: "text", size: 7, autocomplete: "off" });
  }

  /** Whether a file belongs to the campaign. */
  function useNode(path) {
    return make("input", { type: "checkbox", checked: !wish.left_out.includes(path), "data-key": `use-${path}`, "aria-label": `use ${path}`,
      onchange: (event) => {
        wish.left_out = wish.left_out.filter((p) => p !== path);
        if (!event.target.checked) wish.left_out.push(path);
        redraft();
      } });
  }

  function leftOutNode(paths) {
    const out = paths.filter((path) => wish.left_out.includes(path));
    if (!out.length) return null;
    return make("p", { class: "muted" }, "Left out: ", ...out.map((path) => make("label", { class: "out" }, useNode(path), path)));
  }

  function robotNode() {
    const [robot] = tables("robot");
    if (!robot) return null;
    const field = robot.fields[0];
    const given = field.value ?? "";
    const names = draft.robots.includes(given) || !given ? draft.robots : [...draft.robots, given];
    const select = make("select", { id: "robot", "data-key": "robot.model", class: given ? null : "missing", "aria-invalid": given ? null : "true",
      onchange: (event) => { set("robot", "model", event.target.value); redraft(); } },
      ...["", ...names].map((name) => make("option", { value: name, selected: name === given }, name || "choose …")));
    const file = make("input", { id: "robot-file", type: "file", accept: ".toml", class: "hidden-input", onchange: async (event) => {
      const [chosen] = event.target.files;
      if (!chosen) return;
      const refused = await send(wish.dir, chosen.name, chosen);
      if (refused) { tell(refused); return; }
      set("robot", "model", chosen.name);
      wish.again = true;
      redraft();
    } });
    return make("section", { "aria-labelledby": "robot-title" }, make("h2", { id: "robot-title" }, "Robot"),
      make("div", { class: "line" }, make("label", { for: "robot" }, "Model"), select,
        make("span", {}, make("label", { for: "robot-file", class: "pick" }, "A robot file …"), file)),
      make("p", { class: "muted" }, field.guessed ? `guessed: ${field.guessed}` : "Built-in robots, and robot files (TOML) in the folder. A file that you choose is copied there."),
      draft.robot_problem ? make("div", { class: "warning" }, draft.robot_problem) : null);
  }

  function posturesNode() {
    const postures = tables("posture");
    if (!postures.length) return null;
    const files = tables("frf");
    const of = (id) => files.filter((f) => f.fields.some((x) => x.key === "posture" && x.value === id)).length;
    return make("section", { "aria-labelledby": "postures-title" }, make("h2", { id: "postures-title" }, "Postures"),
      make("p", { class: "muted" }, "Joint angles in degrees, base first, as the controller shows them."),
      make("div", { class: "cards" }, ...postures.map((posture) => {
        const picture = draft.pictures[posture.name];
        const drawn = picture
          ? document.importNode(new DOMParser().parseFromString(picture, "image/svg+xml").documentElement, true)
          : make("p", { class: "posture none muted" }, "The picture comes with robot and angles.");
        return make("div", { class: "card" }, drawn, make("h3", {}, posture.name, make("small", {}, ` ${of(posture.name)} ${of(posture.name) === 1 ? "file" : "files"}`)),
          ...posture.fields.filter((f) => f.what).map((f) => fieldNode(posture, f)));
      })));
  }

  function measurementsNode() {
    const known = new Map(draft.frfs.map((f) => [f.file, f]));
    const files = tables("frf");
    if (!draft.frfs.length) return null;
    const before = [
      { title: "use", cell: (row) => useNode(row.name) },
      { title: "nodes", cell: (row) => known.get(row.name)?.nodes.join(", ") ?? "" },
    ];
    return make("section", { "aria-labelledby": "frf-title" }, make("h2", { id: "frf-title" }, "FRF files and their postures"),
      rowsNode(files, "Each file and the posture it was measured in; the first row fills a column", before), leftOutNode(draft.frfs.map((f) => f.file)),
      make("h3", {}, "Measured points"), rowsNode(tables("point"), "Where each node of the files sits"));
  }

  function cutsNode() {
    if (!draft.forces.length) return null;
    const cuts = tables("cut");
    const file = (row) => row.fields.find((f) => f.key === "file")?.value;
    const lists = draft.cut_lists.length
      ? make("div", { class: "line" }, make("label", { for: "cut-list" }, "List of cuts"),
        make("select", { id: "cut-list", "data-key": "cut-list", onchange: (event) => { wish.cut_list = event.target.value; redraft(); } },
          ...["", ...draft.cut_lists].map((l) => make("option", { value: l, selected: l === (draft.cut_list ?? "") }, l || "none"))))
      : make("p", { class: "muted" }, "A list of cuts (CSV with English, German, French or Spanish column names) in the folder would fill the table.");
    return make("section", { "aria-labelledby": "cuts-title" }, make("h2", { id: "cuts-title" }, "Tool and cuts"),
      rowsNode(tables("tool"), "The tool"), rowsNode(tables("dynamometer"), "The dynamometer's axes"),
      make("h3", {}, "Cuts"), lists, ...draft.passed_over.map((note) => make("p", { class: "muted" }, note)),
      rowsNode(cuts, "One row a cut; the first row fills a column", [{ title: "use", cell: (row) => useNode(file(row)) }]),
      leftOutNode(draft.forces));
  }

  function standNode() {
    const { missing, guessed } = draft;
    const jump = (m) => {
      const key = m.table === "robot" ? "robot.model" : `${`${m.table} ${m.of[0]}`.trim()}.${m.key}`;
      return button(`${short(m.what)}${m.of.length > 1 ? ` (${m.of.length})` : ""}`, () => {
        const field = document.querySelector(`[data-key="${CSS.escape(key)}"]`);
        field?.scrollIntoView({ block: "center" });
        field?.focus();
      }, { class: "entry" });
    };
    const state = missing.length
      ? make("p", {}, make("strong", {}, "Still missing: "), ...missing.flatMap((m, i) => (i ? [" · ", jump(m)] : [jump(m)])))
      : make("p", {}, make("strong", { class: "good" }, "Complete."), guessed.length ? ` Look at the ${guessed.length} guesses before you go on.` : "");
    const ready = !missing.length && !draft.problem && !draft.campaign;
    return make("section", { class: "stand", "aria-labelledby": "stand-title" },
      make("h2", { id: "stand-title" }, "The campaign"),
      make("div", { class: "line" }, make("label", { for: "campaign-name" }, "Name"),
        make("input", { id: "campaign-name", "data-key": "name", type: "text", value: wish.name, autocomplete: "off",
          onchange: (event) => { wish.name = event.target.value; redraft(); } })),
      make("p", { class: "muted" }, draft.dir),
      draft.campaign ? make("div", { class: "warning" }, "There is a campaign.toml already; it is never replaced from here.") : null,
      state, draft.problem ? make("div", { class: "warning" }, draft.problem) : null,
      make("div", { class: "actions" },
        button("Write campaign.toml and begin", (event) => { if (event.currentTarget.getAttribute("aria-disabled") !== "true") write(); },
          { class: "first", id: "write", "data-key": "write", "aria-disabled": String(!ready) }),
        button("Read files again", readAgain, { "data-key": "again" }),
        button("Choose another folder", () => go(draft.dir), { "data-key": "other" })));
  }

  async function write() {
    if (await answer({ do: "write", wish })) location.reload();
  }

  function endNode() {
    const guesses = draft.guessed.length
      ? make("details", { "data-key": "guesses" }, make("summary", {}, `${draft.guessed.length} guesses and their reasons`),
        wide("Guesses", make("table", {}, make("thead", {}, make("tr", {}, ...["of", "key", "value", "reason"].map((t) => make("th", { scope: "col" }, t)))),
          make("tbody", {}, ...draft.guessed.map((g) => make("tr", {}, ...[g.table, g.key, g.value, g.why].map((t) => make("td", {}, t))))))))
      : null;
    const unused = draft.not_used.length
      ? make("details", { "data-key": "unused" }, make("summary", {}, `${draft.not_used.length} files are not used`),
        make("ul", {}, ...draft.not_used.map((f) => make("li", {}, make("strong", {}, f.file), `: ${f.why}`))))
      : null;
    return make("section", { "aria-labelledby": "end-title" }, make("h2", { id: "end-title" }, "What will be written"), guesses, unused,
      make("details", { "data-key": "toml" }, make("summary", {}, "campaign.toml as it stands"), make("pre", { tabindex: "0" }, draft.toml)));
  }

  function drafting() {
    const focused = document.activeElement?.dataset?.key;
    const open = [...main().querySelectorAll("details[open]")].map((d) => d.dataset.key);
    const scrolled = [...main().querySelectorAll(".wide")].map((w) => [w.getAttribute("aria-label"), w.scrollLeft]);
    const top = window.scrollY;
    const told = $("begin-alert")?.textContent ?? "";
    const nothing = !draft.frfs.length && !draft.forces.length
      ? make("div", { class: "warning" }, "The folder holds no FRFs and no force records that can be read (UFF 58, CSV, DynoWare text export, TDMS, MAT). See the files that are not used.") : null;
    main().replaceChildren(...[alertNode(), standNode(), nothing, robotNode(), posturesNode(), measurementsNode(), cutsNode(), endNode()].filter(Boolean));
    tell(told);
    for (const key of open) {
      const again = main().querySelector(`details[data-key="${CSS.escape(key ?? "")}"]`);
      if (again) again.open = true;
    }
    for (const [label, left] of scrolled) {
      const again = [...main().querySelectorAll(".wide")].find((w) => w.getAttribute("aria-label") === label);
      if (again) again.scrollLeft = left;
    }
    if (focused) main().querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus({ preventScroll: true });
    window.scrollTo(0, top);
  }

  // ---- drag and drop ----

  const choosingNow = () => !main().hidden && !draft && place && $("drop");
  window.addEventListener("dragover", (event) => {
    event.preventDefault();
    if (choosingNow()) $("drop").classList.add("over");
  });
  window.addEventListener("dragleave", () => $("drop")?.classList.remove("over"));
  window.addEventListener("drop", async (event) => {
    event.preventDefault();
    $("drop")?.classList.remove("over");
    if (!choosingNow()) return;
    try {
      take(await filesOf(event.dataTransfer.items));
    } catch (error) {
      tell(`What was dropped cannot be read: ${error.message}`);
    }
  });

  return { show, tell };
})();

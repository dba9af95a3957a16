"use strict";
(() => {
  const $ = (id) => document.getElementById(id);
  const { stages, images, prompts } = JSON.parse($("data").textContent);
  const svgMap = $("map"), slider = $("slider"), timeline = $("timeline");
  const home = svgMap.getAttribute("viewBox");
  const NS = "http://www.w3.org/2000/svg";
  const isEmbedded = parent !== self;
  let at = 0, now = 0, timer = null;

  const svg = (name, attributes = {}, parent = null, hint = "") => {
    const made = document.createElementNS(NS, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (hint) { const words = document.createElementNS(NS, "title"); words.textContent = hint; made.append(words); }
    if (parent) parent.append(made);
    return made;
  };
  const html = (name, words = "", css = "") => {
    const made = document.createElement(name);
    made.textContent = words;
    if (css) made.className = css;
    return made;
  };
  const picture = (index, alt) => {
    const made = html("img");
    made.src = `data:image/jpeg;base64,${images[index]}`;
    made.alt = alt;
    return made;
  };
  const count = (num, noun, nouns) => `${num} ${num === 1 ? noun : nouns}`;
  const cardOf = (id) => $(id).closest(".card");
  const metres = (x, y, [px, py]) => `${(Math.hypot(x - px, y - py) / 100).toFixed(1)} m`;

  // Rounds hold what is new in them: here they are made whole, once a stage.
  const whole = new Map();
  const wholeStage = (index) => {
    if (whole.has(index)) return whole.get(index);
    let grid = null, cells = null, entries = new Map(), frontiers = [], counters = {};
    const rounds = stages[index].rounds.map((round) => {
      if (round.grid) { grid = round.grid; cells = new Uint8Array(grid[0] * grid[1]); }
      if (round.cells !== undefined) cells = patched(cells, round.cells);
      if (round.e || round.x) {
        entries = new Map(entries);
        for (const id of round.x ?? []) entries.delete(id);
        for (const entry of round.e ?? []) entries.set(entry[0], entry);
      }
      if (round.f) frontiers = round.f;
      const before = counters;
      if (round.counters) counters = { ...counters, ...round.counters };
      return { ...round, grid, cells, entries, frontiers, counters, before };
    });
    whole.set(index, rounds);
    return rounds;
  };
  const patched = (before, text) => {
    const cells = before.slice();
    let cell = 0;
    for (const [, length, letter] of text.matchAll(/([0-9a-z]+)([A-E])/g)) {
      const end = cell + parseInt(length, 36);
      if (letter !== "E") cells.fill(letter.charCodeAt(0) - 65, cell, end);
      cell = end;
    }
    return cells;
  };

  const colour = (name, alpha) => {
    const value = getComputedStyle(svgMap).getPropertyValue(name).trim();
    const [r, g, b] = [1, 3, 5].map((i) => parseInt(value.slice(i, i + 2), 16));
    return [r, g, b, Math.round(255 * alpha)];
  };
  const canvas = document.createElement("canvas");
  const drawCells = (round) => {
    const image = $("cells");
    $("fog").setAttribute("d", "");
    if (!round.cells) { image.setAttribute("width", 0); image.setAttribute("height", 0); image.removeAttribute("href"); return; }
    const [rows, cols, cell, left, bottom] = round.grid;
    const colours = [colour("--fog", 0.4), colour("--free", 0.13), colour("--blocked", 0.62), colour("--explored", 0.3)];
    canvas.width = cols; canvas.height = rows;
    const pixels = new ImageData(cols, rows);
    for (let row = 0; row < rows; row++) {
      for (let col = 0; col < cols; col++) {
        // Rows go north, pixels go down.
        pixels.data.set(colours[round.cells[row * cols + col]], 4 * ((rows - 1 - row) * cols + col));
      }
    }
    canvas.getContext("2d").putImageData(pixels, 0, 0);
    const place = { x: left, y: bottom - rows * cell, width: cols * cell, height: rows * cell, href: canvas.toDataURL() };
    for (const [key, value] of Object.entries(place)) image.setAttribute(key, value);
    // All that the map does not reach is unknown too.
    const [x, y, width, height] = home.split(" ").map(Number);
    $("fog").setAttribute("d", `M${x - width} ${y - height}h${3 * width}v${3 * height}h${-3 * width}zM${left} ${place.y}h${place.width}v${place.height}h${-place.width}z`);
  };

  const cone = (x, y, yawDeg, fovDeg, reach, attributes, parent) => {
    const point = (deg) => `${(x + reach * Math.sin(deg * Math.PI / 180)).toFixed(0)} ${(y - reach * Math.cos(deg * Math.PI / 180)).toFixed(0)}`;
    const d = `M${x} ${y}L${point(yawDeg - fovDeg / 2)}A${reach} ${reach} 0 0 1 ${point(yawDeg + fovDeg / 2)}Z`;
    return svg("path", { ...attributes, d }, parent);
  };

  const drawEntries = (stage, round) => {
    const u = stage.unit, group = $("entries"), tags = $("tags");
    group.replaceChildren(); tags.replaceChildren();
    const candidates = new Set(round.cand ?? []);
    const rank = ([id, label]) => (id === round.chosen ? 3 : candidates.has(id) ? 2 : label === stage.noun ? 1 : 0);
    const ordered = [...round.entries.values()].sort((a, b) => rank(a) - rank(b) || b[4] * b[5] - a[4] * a[5]);
    const [ax, ay] = round.p, boxes = [[ax - 2 * u, ay - 2 * u, ax + 2 * u, ay + 2 * u]];
    for (const entry of ordered) {
      const [id, label, x, y, width, depth, seen, isStale, isTarget, place] = entry;
      const w = Math.max(width, 1.4 * u), h = Math.max(depth, 1.4 * u);
      const css = ["entry", candidates.has(id) ? "candidate" : "", id === round.chosen ? "chosen" : "", isStale ? "stale" : ""];
      const g = svg("g", { class: css.filter(Boolean).join(" "), "data-id": id }, group,
        `${label} #${id}, seen ${seen} times${evaluatorWords(entry) ? `\nevaluator: ${evaluatorWords(entry)}` : ""}`);
      svg("rect", { x: x - w / 2, y: y - h / 2, width: w, height: h, rx: 0.4 * u, "stroke-width": 0.3 * u }, g);
      if (isStale) {
        const arm = Math.min(0.9 * u, w / 2);
        svg("path", { d: `M${x - arm} ${y - arm}l${2 * arm} ${2 * arm}m0 ${-2 * arm}l${-2 * arm} ${2 * arm}`, "stroke-width": 0.4 * u }, g);
        if (Array.isArray(place)) {
          const line = svg("g", { class: rank(entry) ? "now stressed" : "now" }, group, `${label} #${id} stands here now (evaluator)`);
          svg("path", { d: `M${x} ${y}L${place[0]} ${place[1]}`, "stroke-width": (rank(entry) ? 0.45 : 0.3) * u, "stroke-dasharray": `${u} ${0.6 * u}` }, line);
          svg("circle", { cx: place[0], cy: place[1], r: (rank(entry) ? 1 : 0.7) * u, "stroke-width": 0.35 * u }, line);
        }
      }
    }
    // Names of those that matter in this round, none over another; a whole memory on offer is not named.
    const isNamed = (entry) => rank(entry) > 1 + (candidates.size > 8) || rank(entry) === 1;
    const size = 2.1 * u, [left, , wide] = home.split(" ").map(Number);
    for (const [id, label, x, y, width, depth, , isStale] of ordered.filter(isNamed).reverse()) {
      const words = `${label} #${id}`, half = 0.32 * size * words.length, h = Math.max(depth, 1.4 * u) / 2, w = Math.max(width, 1.4 * u) / 2;
      const places = [[x, y - h - 0.5 * size], [x, y + h + 1.1 * size], [x + w + half + 0.4 * u, y + 0.35 * size], [x - w - half - 0.4 * u, y + 0.35 * size], [x, y - h - 1.6 * size], [x, y + h + 2.2 * size]];
      const box = ([cx, cy]) => [cx - half, cy - 0.8 * size, cx + half, cy + 0.3 * size];
      for (const place of places) place[0] = Math.max(left + half, Math.min(left + wide - half, place[0]));
      const free = places.find((place) => { const b = box(place); return !boxes.some((o) => b[0] < o[2] && o[0] < b[2] && b[1] < o[3] && o[1] < b[3]); });
      if (!free) continue;
      boxes.push(box(free));
      const tag = svg("text", { x: free[0], y: free[1], "text-anchor": "middle", "font-size": size, "stroke-width": 0.45 * size,
        class: `tag${isStale ? " stale" : ""}${id === round.chosen ? " chosen" : ""}` }, tags);
      tag.textContent = words;
    }
  };
  const evaluatorWords = ([, , x, y, , , , isStale, isTarget, place]) => {
    const target = isTarget ? "the target" : "";
    if (!isStale) return target;
    const where = place === "gone" ? "gone from the house" : place ? `now ${metres(x, y, place)} away` : "nothing of the kind ever stood here";
    return `stale${target ? ` (${target})` : ""}: ${where}`;
  };

  const drawHeat = (round) => {
    const group = $("heat"), [edge, squares] = round.heat ?? [0, []];
    group.replaceChildren();
    const most = Math.max(...squares.map((square) => square[2]), 1e-9);
    for (const [x, y, percent] of squares) {
      // The root shows small probabilities, too.
      const opacity = (0.75 * Math.sqrt(percent / most)).toFixed(3);
      svg("rect", { x: x - edge / 2, y: y - edge / 2, width: edge, height: edge, "fill-opacity": opacity }, group, `${percent}% likely here`);
    }
  };

  const drawFrontiers = (stage, round) => {
    const u = stage.unit, group = $("frontiers");
    group.replaceChildren();
    for (const [id, x, y, deg] of round.frontiers) {
      const g = svg("g", { class: `frontier${id === round.frontier ? " chosen" : ""}`, transform: `translate(${x} ${y})rotate(${deg})` }, group, `frontier #${id}`);
      const s = id === round.frontier ? 1.5 * u : u;
      svg("path", { d: `M0 ${-1.3 * s}L${s} ${1.2 * s}L0 ${0.5 * s}L${-s} ${1.2 * s}Z`, "stroke-width": 0.25 * u }, g);
    }
  };

  const drawWay = (stage, rounds) => {
    const u = stage.unit, group = $("way"), last = Math.max(1, rounds.length - 1);
    group.replaceChildren();
    const gone = svg("g", { class: "path way", "stroke-width": 0.8 * u }, group);
    rounds.slice(0, now).forEach((round, index) => {
      if (round.path) svg("path", { class: `t${Math.min(9, Math.floor(10 * index / (last + 1)))}`, d: round.path }, gone, `round ${index + 1}: ${round.choice ?? ""}`);
    });
    const round = rounds[now];
    if (round.to) svg("path", { class: "goto", d: `M${round.p[0]} ${round.p[1]}L${round.to[0]} ${round.to[1]}`, "stroke-width": 0.3 * u, "stroke-dasharray": `${0.5 * u} ${0.8 * u}`, "stroke-linecap": "round" }, group, "where it wants to go");
    if (round.path && round.len) svg("path", { class: "step", d: round.path, "stroke-width": 1.1 * u }, group, "this round's step");
  };

  const drawAgent = (stage, round) => {
    const u = stage.unit, [x, y, yaw] = round.p, group = $("agent"), fov = $("fov");
    group.replaceChildren(); fov.replaceChildren();
    const views = round.v.length ? round.v : [[0, 0]];
    views.forEach(([, offset], index) => {
      const isHeading = index === views.length - 1;
      cone(x, y, yaw + offset, stage.fov || 90, isHeading ? 170 : 130, { class: `fov${isHeading ? " heading" : ""}`, "stroke-width": 0.2 * u }, fov);
    });
    const g = svg("g", { class: "agent", transform: `translate(${x} ${y})rotate(${yaw})` }, group, "the agent");
    svg("path", { d: `M0 ${-2.7 * u}L${1.9 * u} ${1.8 * u}L0 ${0.9 * u}L${-1.9 * u} ${1.8 * u}Z`, "stroke-width": 0.5 * u }, g);
    // The start and the end have no mark under the agent itself.
    for (const start of document.querySelectorAll("#ends .start")) start.style.display = now ? "" : "none";
    const isLast = now === stage.rounds.length - 1, isHere = stage.end && Math.hypot(stage.end[0] - x, stage.end[1] - y) < 4 * u;
    for (const end of document.querySelectorAll("#ends .terminal")) {
      end.style.display = isLast ? "" : "none";
      if (isHere) end.setAttribute("transform", `translate(${x - stage.end[0] + 3.6 * u} ${y - stage.end[1] - 3.6 * u})`);
    }
  };

  const list = (id, pairs) => {
    $(id).replaceChildren(...pairs.flatMap(([name, value]) => [html("dt", name), html("dd", value)]));
  };
  const words = (value) => (typeof value === "string" ? value : JSON.stringify(value));

  const tellRound = (stage, round, rounds) => {
    const views = round.v;
    const heading = $("heading");
    heading.hidden = !views.length;
    if (views.length) {
      heading.src = `data:image/jpeg;base64,${images[views[views.length - 1][0]]}`;
      heading.alt = `What the agent sees ahead in round ${now + 1}`;
    }
    $("heading-words").textContent = views.length ? `heading view${round.seen ? " · target in a view of this round (evaluator)" : ""}` : "no views: this stage was not run again";
    $("sides").replaceChildren(...views.slice(0, -1).map(([index, offset]) => {
      const figure = html("figure"), side = `${Math.abs(offset)}° ${offset < 0 ? "left" : "right"}`;
      figure.append(picture(index, `View ${side}`), html("figcaption", side));
      return figure;
    }));
    const isError = !round.action;
    $("choice").textContent = isError ? "The stage errored in this round." : round.choice || round.action;
    const { reason = "", ...details } = round.details ?? {};
    $("reason").textContent = words(reason);
    $("truth").textContent = round.truth ?? "";
    list("facts", [
      ...(isError ? [] : [["action", round.action + (round.failed ? ", failed" : "") + (round.why ? ` (${round.why})` : "")]]),
      ...(round.len === undefined ? [] : [["walked", `${round.len.toFixed(2)} m`]]),
      ...(round.n ? [["knows", stage.tells ? `${count(round.n[0], "entry", "entries")}, ${count(round.n[1], "frontier", "frontiers")}` : "this agent does not tell"]] : []),
      ["stands at", `x ${(round.p[0] / 100).toFixed(2)} m, z ${(-round.p[1] / 100).toFixed(2)} m, looks ${Math.round(((round.p[2] % 360) + 360) % 360)}°`],
      ...Object.entries(details).filter(([, value]) => value !== null).map(([name, value]) => [name.replaceAll("_", " "), words(value)]),
      ...(round.note ? [["note", round.note]] : []),
    ]);
    tellQuestions(stage, round, rounds);
    tellCounters(round);
    tellMemory(stage, round);
  };

  let isPromptOpen = null;  // as the reader left it
  const tellQuestions = (stage, round, rounds) => {
    const box = $("questions");
    box.replaceChildren();
    if (!round.q) {
      let last = now - 1;
      while (last >= 0 && !rounds[last].q) last--;
      const none = last < 0 ? "No question so far." : "No question in this round: the agent follows its decision of ";
      const line = html("p", none, "quiet");
      if (last >= 0) {
        const link = html("a", `round ${last + 1}`);
        link.href = `#stage=${stage.k}&round=${last + 1}`;
        line.append(link, ".");
      }
      box.append(line);
      return;
    }
    round.q.forEach(([kind, outcome, answer, prompt, offered, meaning], index) => {
      const div = html("div", "", "question");
      const tries = round.q.length > 1 ? ` ${index + 1} of ${round.q.length}` : "";
      div.append(html("b", `${kind}${tries} `), html("span", outcome, `chip ${outcome}`));
      const text = html("p", "", "answer"), [head, ...rest] = answer.split("\n");
      text.append(html("b", meaning || head), rest.join("\n"));
      if (meaning) text.append(html("span", `In the prompt's words: ${head}`, "quiet"));
      const details = html("details", "", "prompt"), summary = html("summary", "The prompt");
      details.append(summary);
      if (offered) details.append(html("p", offered, "quiet offered"));
      let said = "", pictures = null;
      for (const part of prompts[prompt]) {
        const [role, content] = Array.isArray(part) ? part : ["user", part];
        if (role !== said && (role !== "user" || said)) details.append(html("span", role, "role"));
        if (role !== said) pictures = null;
        said = role;
        if (typeof content !== "number") {
          details.append(html("p", content));
          pictures = null;
          continue;
        }
        // An image stands under the line that names it; such pairs stand side by side.
        const before = details.lastElementChild, figure = html("figure");
        let title = "";
        if (before?.tagName === "P") {
          const lines = before.textContent.split("\n");
          title = lines.pop();
          if (lines.length) before.textContent = lines.join("\n"); else before.remove();
          if (details.lastElementChild?.className === "pictures") pictures = details.lastElementChild;
        }
        if (!pictures) { pictures = html("div", "", "pictures"); details.append(pictures); }
        figure.append(html("figcaption", title), picture(content, title || "image of the prompt"));
        pictures.append(figure);
      }
      details.open = isPromptOpen ?? round.q.length < 4;
      summary.addEventListener("click", () => { isPromptOpen = !details.open; });
      const isAgain = index > 0 && round.q[index - 1][3] === prompt;
      div.append(text, ...(isAgain ? [html("p", "The same question again.", "quiet")] : [details]));
      box.append(div);
    });
  };

  const tellCounters = (round) => {
    const rows = Object.entries(round.counters).filter(([name, count]) => count || round.before[name]).map(([name, count]) => {
      const row = html("tr"), more = count - (round.before[name] ?? 0);
      const isNew = now > 0 && more !== 0;
      row.append(html("td", name.replaceAll("_", " ")), html("td", String(count)), html("td", isNew ? `${more > 0 ? "+" : ""}${more}` : "", "up"));
      return row;
    });
    $("counters").tBodies[0].replaceChildren(...rows);
    cardOf("counters").hidden = !rows.length;
  };

  const tellMemory = (stage, round) => {
    const candidates = new Set(round.cand ?? []);
    const rank = ([id]) => (id === round.chosen ? 2 : candidates.has(id) ? 1 : 0);
    const far = ([, , x, y]) => Math.hypot(x - round.p[0], y - round.p[1]);
    const entries = [...round.entries.values()].sort((a, b) => rank(b) - rank(a) || far(a) - far(b));
    const numStale = entries.filter((entry) => entry[7]).length;
    $("num-entries").textContent = `${entries.length}${numStale ? `, ${numStale} stale (evaluator)` : ""}; candidates first, then the nearest`;
    $("memory").hidden = !entries.length;
    $("memory").tBodies[0].replaceChildren(...entries.map((entry) => {
      const row = html("tr", "", ["", "candidate", "chosen"][rank(entry)]);
      const name = `${entry[1]} #${entry[0]}${["", " · candidate", " · chosen"][rank(entry)]}`;
      row.append(html("td", name), html("td", `${entry[6]}×`), html("td", metres(entry[2], entry[3], round.p)), html("td", evaluatorWords(entry), "evaluator"));
      const light = (isLit) => $("entries").querySelector(`[data-id="${entry[0]}"]`)?.classList.toggle("lit", isLit);
      row.tabIndex = -1;
      row.addEventListener("pointerenter", () => light(true));
      row.addEventListener("pointerleave", () => light(false));
      return row;
    }));
  };

  const drawTimeline = (stage, rounds) => {
    timeline.replaceChildren();
    const step = 1000 / Math.max(1, rounds.length), gap = rounds.length > 120 ? 0 : 0.08 * step;
    rounds.forEach((round, index) => {
      const x = step * index, width = step - gap;
      svg("rect", { class: `mark m-${round.kind}`, x, y: 4, width, height: 8 }, timeline, `round ${index + 1}: ${round.choice ?? "error"}`);
      if (round.seen) svg("rect", { class: "seen", x: x + 0.25 * width, y: 0, width: 0.5 * width, height: 3 }, timeline);
      if (round.q) svg("rect", { class: "asked", x, y: 13.4, width, height: 2 }, timeline);
      if (stage.during?.[0] === index) svg("rect", { class: "changes", x: x - 2, y: 0, width: 4, height: 16 }, timeline, `the house changes: ${stage.during[1]}`);
    });
    // The thumb of a range moves within it: so wide that it stands under its mark.
    const inset = 50 / Math.max(1, rounds.length);
    slider.style.margin = `0 calc(${inset}% - 8px)`;
    slider.style.width = `calc(${100 - 2 * inset}% + 16px)`;
    if (rounds.length) svg("rect", { class: "now", y: 1.5, width: step - gap, height: 13 }, timeline);
  };

  const tellStage = (stage) => {
    document.querySelectorAll("[role=tab]").forEach((tab, index) => {
      tab.setAttribute("aria-selected", index === at);
      tab.tabIndex = index === at ? 0 : -1;
    });
    $("verdict").replaceChildren(html("b", stage.words), ` · ${stage.sentence}`);
    $("verdict").title = stage.sentence;
    $("sentence").textContent = stage.sentence;
    list("stage-facts", stage.facts);
    $("goal").textContent = stage.goal;
    $("lost").textContent = stage.lost;
    $("reference").hidden = !stage.reference;
    if (stage.reference) $("reference").src = stage.reference;
    const badge = $("replay"), warning = $("warning");
    const isSame = !stage.whyNot && !stage.differences.length;
    badge.textContent = isSame ? "✓ replay equals the record, byte for byte" : !stage.whyNot ? "replay differs from the record" : "as recorded, not run again";
    badge.classList.toggle("poor", !isSame);
    warning.hidden = isSame;
    warning.textContent = !stage.whyNot
      ? `This stage did not repeat as recorded: the agent is not deterministic, or something that it depends on has changed. The new run is shown. ${stage.differences.join("; ")}.`
      : `Not run again: this is what the record holds, without views, map and questions. ${stage.whyNot}`;
    svgMap.style.setProperty("--u", stage.unit);
    slider.max = Math.max(0, stage.rounds.length - 1);
  };

  // The house may change during a stage: what is drawn of it depends on the round.
  const showHouse = (stage) => {
    for (const part of document.querySelectorAll("[data-of]")) {
      const { of, first = 0, until = Infinity } = part.dataset;
      part.style.display = Number(of) === at && Number(first) <= now && now < Number(until) ? "" : "none";
    }
    const isChanged = stage.during && now >= stage.during[0];
    $("changed").textContent = isChanged ? `${stage.changed}; since round ${stage.during[0] + 1}: ${stage.during[1]}` : stage.changed;
  };

  const show = () => {
    const stage = stages[at], rounds = wholeStage(at);
    now = Math.max(0, Math.min(now, rounds.length - 1));
    slider.value = now;
    showHouse(stage);
    slider.disabled = rounds.length < 2;
    if (!rounds.length) {
      $("where").textContent = "no rounds";
      for (const id of ["heat", "entries", "tags", "frontiers", "way", "agent", "fov"]) $(id).replaceChildren();
      $("cells").removeAttribute("href");
      $("fog").setAttribute("d", "");
      $("heading").hidden = true;
      $("sides").replaceChildren();
      for (const id of ["reason", "truth", "heading-words"]) $(id).textContent = "";
      $("choice").textContent = `No round: ${stage.sentence}`;
      $("facts").replaceChildren();
      for (const id of ["questions", "counters", "memory"]) cardOf(id).hidden = true;
      return;
    }
    const round = rounds[now];
    cardOf("memory").hidden = !stage.hasBelief;
    cardOf("questions").hidden = !stage.rounds.some(({ q }) => q);
    const hasPlaces = stage.rounds.some((round) => round.heat);
    for (const part of document.querySelectorAll(".belief")) {
      part.hidden = !stage.hasBelief || (part.classList.contains("places") && !hasPlaces);
    }
    $("untold").hidden = stage.hasBelief || Boolean(stage.whyNot);
    $("where").textContent = `round ${now + 1} of ${rounds.length} (budget ${stage.budget})`;
    slider.setAttribute("aria-valuetext", `round ${now + 1}: ${round.choice ?? "error"}`);
    timeline.querySelector(".now").setAttribute("x", now * 1000 / rounds.length);
    drawCells(round);
    drawHeat(round);
    drawEntries(stage, round);
    drawFrontiers(stage, round);
    drawWay(stage, rounds);
    drawAgent(stage, round);
    tellRound(stage, round, rounds);
    if ($("follow").checked) closeUp(round);
    const place = `#stage=${stage.k}&round=${now + 1}`;
    if (isEmbedded) parent.postMessage(place, "*");
    else if (location.hash !== place) history.replaceState(null, "", place);
  };
  const enter = (index, round = 0) => {
    at = index; now = round;
    tellStage(stages[at]);
    drawTimeline(stages[at], stages[at].rounds);
    show();
  };
  const go = (round) => { now = round; show(); };

  const stop = () => { clearInterval(timer); timer = null; $("play").textContent = "▶ play"; $("play").setAttribute("aria-label", "Play"); };
  const play = () => {
    if (timer) { stop(); return; }
    const num = stages[at].rounds.length;
    if (now >= num - 1) go(0);
    $("play").textContent = "⏸ pause"; $("play").setAttribute("aria-label", "Pause");
    timer = setInterval(() => { if (now >= num - 1) stop(); else go(now + 1); }, num > 100 ? 120 : 700);
  };

  const closeUp = ({ p: [x, y] }) => svgMap.setAttribute("viewBox", `${x - 400} ${y - 400} 800 800`);
  const wholeMap = () => svgMap.setAttribute("viewBox", home);
  $("follow").addEventListener("change", () => { if (!$("follow").checked) wholeMap(); show(); });
  const pointOf = (event) => new DOMPoint(event.clientX, event.clientY).matrixTransform(svgMap.getScreenCTM().inverse());
  svgMap.addEventListener("wheel", (event) => {
    event.preventDefault();
    const { x, y } = pointOf(event), box = svgMap.viewBox.baseVal, scale = event.deltaY > 0 ? 1.15 : 1 / 1.15;
    svgMap.setAttribute("viewBox", [x - (x - box.x) * scale, y - (y - box.y) * scale, box.width * scale, box.height * scale].join(" "));
  }, { passive: false });
  let grip = null;
  svgMap.addEventListener("pointerdown", (event) => { grip = pointOf(event); svgMap.setPointerCapture(event.pointerId); });
  svgMap.addEventListener("pointermove", (event) => {
    if (!grip) return;
    const { x, y } = pointOf(event), box = svgMap.viewBox.baseVal;
    svgMap.setAttribute("viewBox", [box.x + grip.x - x, box.y + grip.y - y, box.width, box.height].join(" "));
  });
  for (const name of ["pointerup", "pointercancel"]) svgMap.addEventListener(name, () => { grip = null; });
  svgMap.addEventListener("dblclick", () => { $("follow").checked = false; wholeMap(); });

  addEventListener("click", ({ target }) => {
    if (target.matches?.("#sides img, .pictures img")) target.parentElement.classList.toggle("big");
  });

  const layers = [...document.querySelectorAll("[data-layer]")];
  const applyLayers = () => {
    for (const { dataset: { layer }, checked } of layers) {
      for (const part of document.querySelectorAll(`[data-show=${layer}]`)) part.style.display = checked ? "" : "none";
      svgMap.classList.toggle(layer, checked);
    }
  };
  for (const layer of layers) layer.addEventListener("change", applyLayers);

  slider.addEventListener("input", () => { stop(); go(Number(slider.value)); });
  timeline.addEventListener("click", (event) => {
    const box = timeline.getBoundingClientRect();
    stop(); go(Math.floor(stages[at].rounds.length * (event.clientX - box.left) / box.width));
  });
  const moves = { first: () => go(0), back: () => go(now - 1), next: () => go(now + 1), last: () => go(stages[at].rounds.length - 1) };
  for (const [id, move] of Object.entries(moves)) $(id).addEventListener("click", () => { stop(); move(); });
  $("play").addEventListener("click", play);
  const tabs = [...document.querySelectorAll("[role=tab]")];
  tabs.forEach((tab, index) => tab.addEventListener("click", () => { stop(); enter(index); }));
  if (isEmbedded) {
    addEventListener("click", (event) => {
      const link = event.target.closest?.("a[href]");
      if (link) { event.preventDefault(); parent.postMessage(link.getAttribute("href"), "*"); }
    });
  }
  document.addEventListener("keydown", (event) => {
    if (isEmbedded && event.key === "Escape") parent.postMessage("close", "*");
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const isTab = event.target.getAttribute?.("role") === "tab";
    if (isTab && (event.key === "ArrowLeft" || event.key === "ArrowRight")) {
      const index = (at + (event.key === "ArrowRight" ? 1 : tabs.length - 1)) % tabs.length;
      stop(); enter(index); tabs[index].focus(); event.preventDefault();
      return;
    }
    const isSpaceTaken = event.target.matches?.("button, summary, a, input[type=checkbox]");
    const keys = { ArrowLeft: moves.back, ArrowRight: moves.next, Home: moves.first, End: moves.last };
    const move = keys[event.key];
    if (move) { stop(); move(); event.preventDefault(); }
    else if (event.key === " " && !isSpaceTaken) { play(); event.preventDefault(); }
    else if (event.key === "[" || event.key === "]") {
      const index = at + (event.key === "]" ? 1 : -1);
      if (stages[index]) { stop(); enter(index); }
    }
  });
  const enterPlace = () => {
    const place = new URLSearchParams(location.hash.slice(1) || document.body.dataset.place);
    const index = stages.findIndex((stage) => stage.k === Number(place.get("stage")));
    enter(Math.max(0, index), Math.max(0, (Number(place.get("round")) || 1) - 1));
  };
  addEventListener("hashchange", () => { stop(); enterPlace(); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", show);
  applyLayers();
  enterPlace();
})();

"use strict";
(() => {
  const all = (query, root = document) => [...root.querySelectorAll(query)];

  // What is large stands packed in the page and is unpacked when it is looked at.
  const unpacked = async (script) => {
    const bytes = Uint8Array.from(atob(script.textContent), (letter) => letter.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).text();
  };
  let hidden = new Set();
  const hideAgents = (root) => { for (const part of all("[data-agent]", root)) part.hidden = hidden.has(part.dataset.agent); };
  const prepare = (root) => {
    for (const svg of all(".cell svg.map", root)) svg.setAttribute("tabindex", "0");
    hideAgents(root);
  };
  const fill = async (section) => {
    const script = section.querySelector("script.packed");
    if (!script) return;
    waiting.unobserve(section);
    script.classList.remove("packed");
    const text = await unpacked(script);
    script.remove();
    section.insertAdjacentHTML("beforeend", text);
    section.classList.remove("waiting");
    prepare(section);
  };
  const waiting = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) if (isIntersecting) fill(target);
  }, { rootMargin: "600px" });
  for (const script of all(".task > script.packed")) {
    script.parentNode.classList.add("waiting");
    waiting.observe(script.parentNode);
  }

  // Episodes: filters act on the overview's rows and on the tasks alike.
  const filters = document.getElementById("filters");
  if (filters) {
    const search = filters.querySelector("input[type=search]");
    const [which, cause, order] = ["which", "cause", "order"].map((id) => document.getElementById(id));
    const tasks = all("[data-task]");
    tasks.forEach((task, i) => { task.dataset.place = i; });
    const apply = () => {
      const words = search.value.trim().toLowerCase().split(/\s+/);
      let shown = 0, total = 0;
      for (const task of tasks) {
        const data = task.dataset;
        task.hidden = !(words.every((word) => data.words.includes(word))
          && (!which.value || +data[which.value] > 0)
          && (!cause.value || data.causes.split(" ").includes(cause.value)));
        if (task.tagName === "TR") { total += 1; shown += !task.hidden; }
      }
      const by = order.value;
      for (const parent of new Set(tasks.map((task) => task.parentNode))) {
        const inside = tasks.filter((task) => task.parentNode === parent);
        inside.sort((a, b) => (by ? b.dataset[by] - a.dataset[by] : 0) || a.dataset.place - b.dataset.place);
        parent.append(...inside);
      }
      const off = new Set(all("input[type=checkbox]", filters).filter((box) => !box.checked).map((box) => box.value));
      hidden = off;
      hideAgents(document);
      filters.querySelector("output").textContent = `${shown === total ? "" : `${shown} of `}${total} ${total === 1 ? "task" : "tasks"}`;
    };
    filters.addEventListener("input", apply);
    apply();
  }

  // A click on a map opens it large, with a slider over its rounds.
  const dialog = document.getElementById("zoom");
  const slider = dialog.querySelector("input"), told = dialog.querySelector("output");
  let rounds = [], casing = null, view = null;
  const show = () => {
    const now = +slider.value;
    rounds.forEach((round, i) => { round.style.display = i <= now ? "" : "none"; });
    if (casing) casing.style.display = now === rounds.length - 1 ? "" : "none";
    told.textContent = rounds.length ? rounds[now].querySelector("title").textContent : "";
    if (view && rounds.length) {
      const [x, y, yaw] = rounds[now].dataset.p.split(",").map(Number);
      view.setAttribute("transform", `translate(${x} ${y})rotate(${yaw})`);
    }
  };
  slider.addEventListener("input", show);
  prepare(document);
  document.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && event.target.matches?.(".cell svg.map")) open(event.target);
  });
  document.addEventListener("click", (event) => {
    const svg = event.target.closest(".cell svg.map");
    if (svg) open(svg);
  });
  const open = (svg) => {
    const cell = svg.closest(".cell"), task = svg.closest(".task"), big = dialog.querySelector(".big");
    const copy = svg.cloneNode(true);
    big.replaceChildren(copy);
    const { stage, agent } = cell.dataset;
    dialog.querySelector("h3").textContent = `${task.querySelector("h3").firstChild.textContent} · ${agent} · stage ${stage}`;
    dialog.querySelector(".say").textContent = task.querySelectorAll(".goal")[stage - 1].querySelector(".say")?.textContent ?? "";
    // Lines that are right for a small picture are too thick for a large one.
    for (const part of all("[stroke-width]", copy)) part.setAttribute("stroke-width", part.getAttribute("stroke-width") * 0.6);
    rounds = all(".r", copy);
    casing = copy.querySelector(".casing");
    view = document.createElementNS("http://www.w3.org/2000/svg", "path");
    const reach = svg.viewBox.baseVal.width / 28;
    view.setAttribute("class", "view");
    view.setAttribute("stroke-width", reach / 14);
    view.setAttribute("d", `M0 0L${-reach} ${-reach}A${reach * 1.42} ${reach * 1.42} 0 0 1 ${reach} ${-reach}Z`);
    if (rounds.length) copy.append(view);
    slider.max = Math.max(0, rounds.length - 1);
    slider.value = slider.max;
    slider.parentNode.hidden = rounds.length < 2;
    show();
    dialog.showModal();
  };
  for (const box of all("dialog")) {
    box.querySelector(".close").addEventListener("click", () => box.close());
    box.addEventListener("click", (event) => { if (event.target === box) box.close(); });
  }

  // An episode round by round: `#replay=PAGE&stage=3&round=2` opens it, in a frame that can reach nothing.
  const player = document.getElementById("player");
  let speaker = null, shown = "";
  const play = async () => {
    // What the frame before still has to say is not listened to.
    speaker = null;
    const { hash } = location, [name, ...place] = hash.slice(1).split("&");
    const script = name.startsWith("replay=") && document.getElementById(name);
    if (!script) { if (player.open) player.close(); return; }
    const text = await unpacked(script);
    if (location.hash !== hash) return;
    player.querySelector("b").textContent = script.dataset.title;
    const where = place.join("&").replace(/[^a-z0-9=&]/g, "").replaceAll("&", "&amp;");
    const frame = player.querySelector("iframe").cloneNode();
    frame.srcdoc = text.replace('<body class="viewer"', `<body data-place="${where}" class="viewer embedded"`);
    player.querySelector("iframe").replaceWith(frame);
    speaker = frame.contentWindow;
    shown = hash;
    if (!player.open) player.showModal();
  };
  player.addEventListener("close", () => {
    player.querySelector("iframe").removeAttribute("srcdoc");
    if (location.hash.startsWith("#replay=")) history.replaceState(null, "", location.pathname + location.search);
  });
  addEventListener("message", ({ source, data }) => {
    // After a new address, the frame may still speak of the old one before `hashchange` comes.
    if (source !== speaker || location.hash !== shown) return;
    if (data === "close") player.close();
    else if (/^#stage=\d+&round=\d+$/.test(data)) {
      shown = `${shown.split("&")[0]}&${data.slice(1)}`;
      history.replaceState(null, "", shown);
    } else if (typeof data === "string" && /^[\w.-]+\.html#/.test(data)) location.hash = `replay=${data.replace("#", "&")}`;
  });
  addEventListener("hashchange", play);
  play();
})();

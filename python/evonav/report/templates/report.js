"use strict";
(() => {
  const all = (query, root = document) => [...root.querySelectorAll(query)];

  // Tables: a click on a header sorts by it.
  const key = (row, column) => {
    const text = row.cells[column].textContent.trim();
    const number = parseFloat(text.replace("−", "-"));
    return Number.isNaN(number) ? text.toLowerCase() : number;
  };
  for (const head of all("table.sortable thead th")) {
    head.addEventListener("click", () => {
      const body = head.closest("table").tBodies[0], column = head.cellIndex;
      const sign = head.getAttribute("aria-sort") === "descending" ? 1 : -1;
      all("th", head.parentNode).forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
      const order = (a, b) => (a < b ? -1 : a > b ? 1 : 0);
      body.append(...[...body.rows].sort((a, b) => sign * order(key(a, column), key(b, column))));
    });
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
      for (const part of all("[data-agent]")) part.hidden = off.has(part.dataset.agent);
      filters.querySelector("output").textContent = shown === total ? `${total} tasks` : `${shown} of ${total} tasks`;
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
  const maps = all(".cell svg.map");
  for (const svg of maps) svg.setAttribute("tabindex", "0");
  document.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && maps.includes(event.target)) open(event.target);
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
  dialog.addEventListener("click", (event) => { if (event.target === dialog) dialog.close(); });
})();

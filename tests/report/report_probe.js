// Works a report as a reader would, and returns what it found.
(async () => {
  const found = { errors: [] };
  addEventListener("error", (event) => found.errors.push(String(event.message)));
  const all = (css, root = document) => [...root.querySelectorAll(css)];
  const wait = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
  const until = async (is) => { for (let i = 0; i < 200 && !is(); i++) await wait(50); return is(); };
  const visible = (css) => all(css).filter((part) => !part.hidden && part.getClientRects().length).length;
  const input = (id, value) => {
    const box = id === "search" ? document.querySelector("#filters input[type=search]") : document.getElementById(id);
    box.value = value;
    box.dispatchEvent(new Event("input", { bubbles: true }));
    return document.querySelector("#filters output").textContent;
  };
  try {
    found.tables = all("table").length;
    found.rows = all(".headline tbody tr").map((row) => row.cells[0].textContent);
    found.packed = all(".task > script.packed").length;
    for (const section of all(".task")) { section.scrollIntoView(); await until(() => !section.querySelector("script")); }
    found.cells = all("figure.cell").length;
    found.maps = all(".cell svg.map").filter((map) => map.getBoundingClientRect().width > 50 && map.querySelector("path, use")).length;
    found.uses = all(".cell svg.map use").every((use) => document.querySelector(use.getAttribute("href")));
    found.squares = all(".overview i").length;
    for (const image of all("img")) { image.loading = "eager"; await image.decode(); }
    found.overflow = document.documentElement.scrollWidth - document.documentElement.clientWidth;
    found.nothing = input("search", "no such task");
    found.noTasks = visible(".task");
    found.everything = input("search", "");
    found.failures = input("which", "failures");
    input("which", "");
    const first = () => document.querySelector(".task").id;
    found.byName = first();
    input("order", "failures");
    found.byFailures = first();
    input("order", "");
    const box = document.querySelector("#filters input[type=checkbox]"), agent = box.value;
    const shown = () => all(".cell").filter((cell) => cell.dataset.agent === agent && !cell.hidden).length;
    found.before = shown();
    box.click();
    found.without = shown();
    box.click();
    const head = document.querySelector(".headline thead th:nth-child(2)");
    head.click();
    found.sorted = head.getAttribute("aria-sort");
    const map = document.querySelector(".cell.success svg.map, .cell.failure svg.map");
    const zoom = document.getElementById("zoom");
    if (map) {
      map.dispatchEvent(new MouseEvent("click", { bubbles: true }));
      found.zoom = [zoom.open, all(".big svg .r", zoom).length];
      const slider = zoom.querySelector("input");
      slider.value = 0;
      slider.dispatchEvent(new Event("input"));
      found.round = [zoom.querySelector("output").textContent, all(".big svg .r", zoom).filter((part) => part.style.display !== "none").length];
      zoom.querySelector(".close").click();
      found.zoomClosed = !zoom.open;
    }
    const link = document.querySelector('figcaption a[href^="#replay="], #replays a[href^="#replay="]');
    if (link) {
      const player = document.getElementById("player");
      link.click();
      // The frame is closed to us: it tells the round that it shows.
      const place = link.getAttribute("href");
      await until(() => player.open && player.querySelector("iframe").srcdoc);
      found.place = place;
      const second = place.replace(/stage=.*/, "stage=2");
      location.hash = second;
      // What the frame says of the first place may still be on its way: it must not change the address back.
      const source = player.querySelector("iframe").contentWindow;
      dispatchEvent(new MessageEvent("message", { source, data: "#stage=1&round=1" }));
      await until(() => location.hash.startsWith(`${second}&`));
      found.replay = [player.open, location.hash, player.querySelector("iframe").getAttribute("sandbox"), player.querySelector("b").textContent];
      let seen = null;
      try { seen = player.querySelector("iframe").contentDocument; } catch (error) { seen = null; }
      found.apart = seen === null;
      player.querySelector(".close").click();
      await until(() => location.hash === "");
      found.replayClosed = [player.open, location.hash];
    }
    found.groups = all(".failure-group").length;
    // What a text may have become: elements and attributes that no page of ours has.
    found.tags = [...new Set(all("*").map((part) => part.localName))].sort();
    found.handlers = all("*").flatMap((part) => [...part.attributes]).filter(({ name, value }) =>
      name.startsWith("on") || (["href", "src", "action", "formaction", "xlink:href"].includes(name) && /^\s*(javascript|vbscript):/i.test(value))).map(({ name }) => name);
    found.hacked = self.hacked ?? 0;
  } catch (error) {
    found.errors.push(String(error.stack));
  }
  return found;
})();

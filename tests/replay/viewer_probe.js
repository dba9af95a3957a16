// Works the page as a reader would, and returns what it found.
(async () => {
  const found = { errors: [], rounds: [] };
  addEventListener("error", (event) => found.errors.push(String(event.message)));
  const $ = (id) => document.getElementById(id);
  const settled = () => new Promise((resolve) => setTimeout(resolve, 30));
  const press = (key) => document.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
  const loaded = (image) => image.hidden || (image.complete && image.naturalWidth > 0);
  const seen = (css) => [...document.querySelectorAll(css)].filter((part) => part.style.display !== "none").length;
  const look = async () => {
    await settled();
    found.rounds.push({
      hash: location.hash,
      where: $("where").textContent,
      slider: Number($("slider").value),
      stage: document.querySelector("[role=tab][aria-selected=true]").textContent,
      choice: $("choice").textContent,
      goal: $("goal").textContent,
      truth: $("truth").textContent,
      questions: $("questions").textContent,
      chips: [...document.querySelectorAll("#questions .chip")].map((chip) => chip.textContent),
      prompts: document.querySelectorAll("#questions .prompt img").length,
      entries: document.querySelectorAll("#entries .entry").length,
      stale: document.querySelectorAll("#entries .entry.stale").length,
      candidates: document.querySelectorAll("#entries .entry.candidate").length,
      memory: document.querySelectorAll("#memory tbody tr").length,
      frontiers: document.querySelectorAll("#frontiers .frontier").length,
      counters: document.querySelectorAll("#counters tr").length,
      way: document.querySelectorAll("#way .way path").length,
      agent: $("agent").firstElementChild?.getAttribute("transform") ?? "",
      views: document.querySelectorAll("#sides img").length,
      cones: document.querySelectorAll("#fov path").length,
      cells: ($("cells").getAttribute("href") ?? "").length,
      terminal: [...document.querySelectorAll("#ends [data-of]")].filter((part) => part.style.display !== "none").flatMap((part) => [...part.querySelectorAll(".terminal")]).filter((part) => part.style.display !== "none").length,
      images: [...document.images].every(loaded),
      overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
      untold: !$("untold").hidden,
      toggles: [...document.querySelectorAll(".layers .belief")].filter((part) => !part.hidden).length,
      knows: $("facts").textContent.includes("this agent does not tell"),
      bold: document.querySelectorAll(".answer b b, #reason b").length,
    });
  };
  try {
    const tabs = document.querySelectorAll("[role=tab]");
    for (let index = 0; index < tabs.length; index++) {
      tabs[index].click();
      await look();
      $("slider").value = Math.floor(Number($("slider").max) / 2);
      $("slider").dispatchEvent(new Event("input"));
      await look();
      press("End");
      await look();
    }
    press("ArrowLeft"); await settled(); found.left = Number($("slider").value);
    press("Home"); await settled(); found.home = Number($("slider").value);
    press("ArrowRight"); await settled(); found.right = Number($("slider").value);
    press("["); await settled(); found.before = document.querySelector("[role=tab][aria-selected=true]").textContent;
    press(" "); await new Promise((resolve) => setTimeout(resolve, 1600)); press(" ");
    found.played = Number($("slider").value);
    location.hash = "#stage=1&round=2"; await settled();
    found.linked = $("where").textContent;
    const truth = document.querySelector("[data-layer=truth]");
    found.stars = seen("[data-show=truth]");
    truth.click();
    found.starsHidden = seen("[data-show=truth]");
    truth.click();
    const map = $("map"), box = map.getAttribute("viewBox");
    $("follow").click(); found.closeUp = map.getAttribute("viewBox") !== box;
    $("follow").click(); found.whole = map.getAttribute("viewBox") === box;
    found.labels = [...document.querySelectorAll("button")].every((button) => button.textContent.trim() || button.getAttribute("aria-label"));
    found.alts = [...document.images].every((image) => image.alt);
    found.handlers = [...document.querySelectorAll("*")].flatMap((part) => [...part.attributes]).filter(({ name, value }) =>
      name.startsWith("on") || (["href", "src", "action", "formaction", "xlink:href"].includes(name) && /^\s*(javascript|vbscript):/i.test(value))).map(({ name }) => name);
  } catch (error) {
    found.errors.push(String(error.stack));
  }
  return found;
})();

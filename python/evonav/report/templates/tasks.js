"use strict";
(() => {
  const form = document.getElementById("filters"), cards = [...document.querySelectorAll(".card")];
  const search = form.querySelector("input"), mode = document.getElementById("mode"), rooms = document.getElementById("rooms");
  const apply = () => {
    const words = search.value.trim().toLowerCase().split(/\s+/);
    let shown = 0;
    for (const card of cards) {
      const data = card.dataset;
      card.hidden = !(words.every((word) => data.words.includes(word)) && (!rooms.value || data.rooms === rooms.value)
        && (!mode.value || data.modes.split(" ").includes(mode.value)));
      shown += !card.hidden;
    }
    form.querySelector("output").textContent = `${shown === cards.length ? "" : `${shown} of `}${cards.length} ${cards.length === 1 ? "task" : "tasks"}`;
  };
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("input", apply);
  apply();
})();

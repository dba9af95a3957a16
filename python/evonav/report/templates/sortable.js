"use strict";
(() => {
  const all = (query, root = document) => [...root.querySelectorAll(query)];

  // Tables: a click on a header sorts by it.
  const key = (row, column) => {
    const text = row.cells[column].textContent.trim().replace("−", "-");
    return /^[+-]?\d+(\.\d+)?(?![\d.-])/.test(text) ? parseFloat(text) : text.toLowerCase();
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
})();

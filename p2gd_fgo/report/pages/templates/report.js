"use strict";
// A first cell that says what the one above it says is not shown again.
const fold = (body) => {
  const first = (row) => row.cells[0].textContent;
  Array.from(body.rows).forEach((row, k, rows) => {
    row.classList.toggle("same", k > 0 && first(row) === first(rows[k - 1]));
  });
};
// A table that goes on to the right fades there.
for (const box of document.querySelectorAll(".scroll")) {
  const look = () => {
    box.classList.toggle("more", box.scrollLeft + box.clientWidth < box.scrollWidth - 2);
  };
  box.addEventListener("scroll", look, { passive: true });
  window.addEventListener("resize", look);
  look();
}
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.querySelector("tbody.rows");
  const value = (row, column) => {
    const cell = row.cells[column];
    const order = cell.dataset.order;
    return order === undefined ? cell.textContent.trim() : Number(order);
  };
  const before = (a, b) => {
    if (a === "" || a === "–") return b === "" || b === "–" ? 0 : Infinity;
    if (b === "" || b === "–") return -Infinity;
    if (typeof a === "number" && typeof b === "number") return a - b;
    return String(a).localeCompare(String(b), "en", { numeric: true });
  };
  for (const button of table.querySelectorAll("thead button")) {
    const head = button.closest("th");
    const column = Number(head.dataset.column);
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      for (const other of table.querySelectorAll("th[aria-sort]")) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const rows = Array.from(body.rows, (row) => [value(row, column), row]);
      rows.sort(([a], [b]) => {
        const order = before(a, b);
        return down && Number.isFinite(order) ? -order : order;
      });
      body.append(...rows.map(([, row]) => row));
      fold(body);
    });
  }
}

"use strict";
// Tables sort by the column that is clicked: numbers as numbers, the rest as text; again turns the order round.
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  const sort = (column) => {
    const up = heads[column].getAttribute("aria-sort") !== "ascending";
    heads.forEach((head) => head.removeAttribute("aria-sort"));
    heads[column].setAttribute("aria-sort", up ? "ascending" : "descending");
    const value = (row) => row.cells[column].textContent;
    const order = (a, b) => {
      const [x, y] = [parseFloat(value(a)), parseFloat(value(b))];
      if (!isNaN(x) && !isNaN(y)) return x - y;
      return value(a).localeCompare(value(b));
    };
    const rows = [...table.tBodies[0].rows].sort((a, b) => (up ? order(a, b) : order(b, a)));
    table.tBodies[0].append(...rows);
  };
  heads.forEach((head, column) => {
    head.addEventListener("click", () => sort(column));
    head.addEventListener("keydown", (event) => { if (event.key === "Enter") sort(column); });
  });
}
// Pictures flip between image, reference and error map: one by clicking, all by the keys 1 to 3.
const show = (figure, at) => {
  const images = [...figure.querySelectorAll("img")];
  images.forEach((image, i) => image.classList.toggle("shown", i === at % images.length));
};
const figures = [...document.querySelectorAll("figure.flip")];
for (const figure of figures) {
  figure.addEventListener("click", () => {
    const at = [...figure.querySelectorAll("img")].findIndex((image) => image.classList.contains("shown"));
    show(figure, at + 1);
  });
}
document.addEventListener("keydown", (event) => {
  if ("123".includes(event.key)) figures.forEach((figure) => show(figure, "123".indexOf(event.key)));
});

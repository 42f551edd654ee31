// Drawings over the picture.

const SVG = "http://www.w3.org/2000/svg";

// A shape, the last one of its parent's if it has one.
export const element = (name, attributes, parent) => {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  parent?.append(made);
  return made;
};

// A drawing below those that are there already, whose shapes are replaced all together.
export class Overlay {
  constructor(svg, name) {
    this.group = element("g", { class: name, "aria-hidden": "true" });
    svg.prepend(this.group);
  }

  show(shapes) {
    if (shapes.length || this.group.childNodes.length) this.group.replaceChildren(...shapes);
  }
}

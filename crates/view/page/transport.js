// What brings indirect light to the picked place, drawn over the picture: the points whose functions cover it, and the senders of
// its links, larger where they are stronger.

import { project } from "./math.js";
import { Overlay, element } from "./overlay.js";

// Links that are drawn as lines, too.
const LINES = 40;

export class Transport {
  constructor(state, svg) {
    this.state = state;
    this.overlay = new Overlay(svg, "transport");
  }

  // Draws it in a picture of this size on the screen.
  draw(box) {
    const { picked, links, eye } = this.state;
    const transport = links ? picked?.transport : null;
    if (!transport) {
      this.overlay.show([]);
      return;
    }
    const on = ([x, y, z]) => project(eye, [x, y, z], box.width, box.height);
    const nodes = [];
    const here = on(picked.position);
    const most = Math.max(...transport.links.map((link) => Math.abs(link[3])), 1e-30);
    transport.links.forEach((link, i) => {
      const there = on(link);
      if (!there) return;
      const share = Math.abs(link[3]) / most;
      const sign = link[3] < 0 ? "takes" : "gives";
      if (here && i < LINES) {
        nodes.push(element("line", { x1: here.x, y1: here.y, x2: there.x, y2: there.y, class: sign, "stroke-opacity": 0.15 + 0.6 * share, "stroke-width": 0.7 + 1.8 * share }));
      }
      nodes.push(element("circle", { cx: there.x, cy: there.y, r: 1.5 + 7 * Math.sqrt(share), class: sign }));
    });
    for (const point of transport.points) {
      const there = on(point);
      if (there) nodes.push(element("circle", { cx: there.x, cy: there.y, r: 2 + 8 * Math.sqrt(Math.max(0, point[3])), class: "point" }));
    }
    if (here) nodes.push(element("path", { d: `M${here.x - 9} ${here.y}h18M${here.x} ${here.y - 9}v18`, class: "place" }));
    this.overlay.show(nodes);
  }
}

// What the drawing shows, in words.
export function inWords({ points, links, of }) {
  if (!points.length) return "No point is near this place.";
  const strongest = links.length ? `the strongest gives ${Number(links[0][3].toPrecision(3))} of a sender's radiosity` : "none";
  const shown = links.length < of ? `; the ${links.length} strongest are drawn` : "";
  return `${points.length} points (white), ${of} links (amber give light, blue take away what coarser ones gave too much)${shown}; ${strongest}.`;
}

// The lightcut of the picked place, drawn over the picture: a box around each cluster of lights, the fuller the more it lights the place.

import { project } from "./math.js";
import { Overlay, element } from "./overlay.js";

// Boxes that are drawn.
const BOXES = 300;

export class Clusters {
  constructor(state, svg) {
    this.state = state;
    this.overlay = new Overlay(svg, "clusters");
  }

  // Draws them in a picture of this size on the screen.
  draw(box) {
    const { picked, clusters, eye } = this.state;
    const cut = (clusters && picked?.clusters?.cut) || [];
    // A lamp gives more than any wall: each kind by its own brightest.
    const most = (indirect) => Math.max(...cut.filter((cluster) => cluster.indirect === indirect).map((cluster) => cluster.share), 1e-30);
    const brightest = new Map([[true, most(true)], [false, most(false)]]);
    const nodes = [];
    for (const cluster of cut.filter((cluster) => !cluster.distant).slice(0, BOXES)) {
      const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [0, 1, 2].map((k) => ((i >> k) & 1 ? cluster.high[k] : cluster.low[k])));
      const seen = corners.map((corner) => project(eye, corner, box.width, box.height));
      // What reaches behind the eye has no outline.
      if (seen.includes(null)) continue;
      const share = Math.sqrt(cluster.share / brightest.get(cluster.indirect));
      const look = { class: cluster.indirect ? "indirect" : "direct", "fill-opacity": 0.04 + 0.4 * share, "stroke-opacity": 0.25 + 0.75 * share };
      nodes.push(cluster.lights > 1
        ? element("polygon", { points: outline(seen).map(({ x, y }) => `${x.toFixed(1)},${y.toFixed(1)}`).join(" "), ...look })
        : element("circle", { cx: seen[0].x, cy: seen[0].y, r: 2 + 4 * share, ...look }));
    }
    this.overlay.show(nodes);
  }
}

// The convex outline of points, by the monotone chain (Andrew 1979).
export function outline(points) {
  const sorted = [...points].sort((a, b) => a.x - b.x || a.y - b.y);
  const half = (all) => {
    const chain = [];
    for (const p of all) {
      while (chain.length > 1) {
        const [a, b] = chain.slice(-2);
        if ((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x) > 0) break;
        chain.pop();
      }
      chain.push(p);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

// What the drawing shows, in words.
export function clustersInWords({ cut, of, lights }) {
  if (!cut.length) return "No light reaches this place.";
  const virtual = cut.filter((cluster) => cluster.indirect).length;
  const half = cut.findIndex((_, i) => cut.slice(0, i + 1).reduce((sum, cluster) => sum + cluster.share, 0) >= 0.5) + 1;
  const distant = cut.filter((cluster) => cluster.distant).length;
  const far = distant ? ` ${distant} are infinitely far, and not drawn.` : "";
  return `${of} clusters stand for ${lights.toLocaleString("en")} lights (blue) and points that pass light on (green: ${virtual}); ${half} of them give half of the light.${far}`;
}

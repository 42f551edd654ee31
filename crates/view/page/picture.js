// How the picture is shown, and what it is made of: tone mapping, waveform, points and links and lightcut of the picked place, expected error.

import { make } from "./make.js";
import { clustersInWords } from "./clusters.js";
import { inWords } from "./transport.js";
import { drawWaveform } from "./waveform.js";

const TONES = { neutral: "Neutral", filmic: "Filmic", reinhard: "Reinhard", clipped: "None: white is cut off" };
const percent = (share) => `${(100 * share).toFixed(1)} %`;

export class PictureCard {
  constructor(panel) {
    Object.assign(this, { panel, state: panel.state });
    this.waveform = make("canvas", { id: "waveform", role: "img", "aria-label": "Waveform" });
  }

  build() {
    const { state, panel } = this;
    const tone = make("select", { "aria-label": "Tone mapping", title: "How brightness becomes what the screen shows", onchange: () => state.view({ tone: tone.value }) },
      ...Object.entries(TONES).map(([value, label]) => make("option", { value }, label)));
    const links = this.toggle("Points and links", "Draws what brings indirect light to the picked place: points whose functions cover it, and senders of their links",
      () => state.links, () => state.view({ links: !state.links }, { structure: true, links: true }));
    const clusters = this.toggle("Light clusters", "Draws the lightcut of the picked place: which clusters of lights, and of points that pass light on, stand for all of them there",
      () => state.clusters, () => state.view({ clusters: !state.clusters }, { structure: true, links: true }));
    const wave = this.toggle("Waveform", "Red, green and blue along the row of the picked place, in per cent of the screen's white",
      () => state.row !== null, () => state.view({ row: state.row === null ? this.pickedRow() : null }, { structure: true }));
    panel.fills.push(() => (tone.value = state.tone));
    const rows = [make("label", { class: "row wide" }, make("span", {}, "Tones"), tone), make("div", { class: "buttons" }, links, clusters, wave)];
    if (state.row !== null) {
      rows.push(panel.row("Row", { low: 0, high: state.size[1] - 1, step: 1, title: "Row of the picture, from its top" }, () => state.row, (value) =>
        state.view({ row: Math.round(Math.max(0, Math.min(state.size[1] - 1, value))) }, { overlay: true })), this.waveform);
      panel.fills.push(() => this.draw());
    }
    if (state.links) rows.push(make("p", { class: "note" }, state.picked?.transport ? inWords(state.picked.transport) : "Click on a surface in the picture."));
    if (state.clusters) rows.push(make("p", { class: "note" }, state.picked?.clusters ? clustersInWords(state.picked.clusters) : "Click on a surface in the picture."));
    rows.push(make("p", { class: "note" }, this.expected()));
    return [make("h2", {}, "Picture"), make("section", { class: "card" }, make("div", { class: "body" }, ...rows))];
  }

  toggle(label, title, on, onclick) {
    const button = make("button", { title, onclick }, label);
    this.panel.fills.push(() => button.setAttribute("aria-pressed", String(on())));
    return button;
  }

  // The middle one where nothing was picked.
  pickedRow() {
    const { pickedAt, size } = this.state;
    return Math.min(size[1] - 1, Math.floor((pickedAt?.y ?? 0.5) * size[1]));
  }

  // What the bake said of itself.
  expected() {
    const { estimates, points } = this.state.hello;
    if (!points) return "This asset has no points.";
    if (!estimates || estimates.error_indirect === undefined) return "The bake did not measure its error.";
    const { error_indirect: error, error_noise: noise = 0, bias_indirect: bias = 0 } = estimates;
    return `As the bake measured itself, indirect light errs by ${percent(error)} ± ${percent(noise)} a pixel, its mean by ${bias < 0 ? "−" : "+"}${percent(Math.abs(bias))}.`;
  }

  draw() {
    const picture = document.getElementById("picture");
    if (this.state.row === null || !this.waveform.isConnected) return;
    // A coarse picture has fewer rows.
    const row = Math.floor(((this.state.row + 0.5) / this.state.size[1]) * picture.height);
    drawWaveform(this.waveform, picture, row);
  }
}

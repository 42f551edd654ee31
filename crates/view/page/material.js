// The picked material: its model and parameters, as an edit.

import { clamp, hexOf, ofHex } from "./math.js";
import { make } from "./make.js";

// Parameters of each model, as material edits have them.
const MODELS = {
  metallic_roughness: { label: "Metallic-roughness (glTF)", has: ["roughness", "metallic"] },
  lambert: { label: "Matt (Lambert)", has: [] },
  phong: { label: "Phong", has: ["specular", "roughness"] },
  ward: { label: "Ward, anisotropic", has: ["specular", "roughness_u", "roughness_v", "rotation_deg"] },
};
const SHARE = { low: 0, high: 1, step: 0.01 };
const ROWS = {
  roughness: ["Roughness", SHARE], metallic: ["Metallic", SHARE],
  roughness_u: ["Roughness along", { ...SHARE, title: "Roughness along the tangent" }],
  roughness_v: ["Roughness across", { ...SHARE, title: "Roughness across the tangent" }],
  rotation_deg: ["Turn", { low: -180, high: 180, step: 1, unit: "°", title: "Turns the tangent" }],
};

export class MaterialCard {
  constructor(panel) {
    Object.assign(this, { panel, state: panel.state });
  }

  // The set of materials that edits go on from.
  variants() {
    const { panel, state } = this;
    const names = state.hello.variants.map(({ name }) => name);
    const select = make("select", { "aria-label": "Variant", title: "Which of the scene's sets of materials is shown", onchange: () => {
      state.work((work) => (work.variant = names[select.value] ?? null));
      state.endGesture();
    } }, make("option", { value: -1 }, "As baked"), ...names.map((name, i) => make("option", { value: i }, name)));
    panel.fills.push(() => (select.value = names.indexOf(state.variant)));
    return make("label", { class: "row wide" }, make("span", {}, "Variant"), select);
  }

  build() {
    const { panel, state } = this;
    const hit = state.picked;
    const heading = make("h2", {}, "Material");
    const variants = state.hello.variants.length ? [this.variants()] : [];
    if (!hit) return [heading, ...variants, make("p", { class: "note" }, "Click on a surface in the picture.")];
    const own = state.hello.materials[state.inPlaceOf(hit.material)] ?? {};
    const edit = () => state.edits[hit.material] ?? {};
    const now = () => ({
      model: own.model ?? "metallic_roughness", base_color: own.base_color?.slice(0, 3) ?? [1, 1, 1], roughness: own.roughness ?? 1,
      metallic: own.metallic ?? 0, specular: own.specular ?? [0.04, 0.04, 0.04], roughness_u: own.roughness ?? 1,
      roughness_v: own.roughness ?? 1, rotation_deg: 0, ...edit(),
    });
    const change = (to, { gesture, moving, structure = false } = {}) => state.work((work) => {
      work.edits = { ...work.edits, [hit.material]: to };
    }, { gesture, moving, structure });
    const set = (part, options) => change({ ...edit(), ...part }, options);
    const color = (label, name) => {
      const input = make("input", { type: "color", "aria-label": label, title: `${label}: reflectance`,
        oninput: () => set({ [name]: ofHex(input.value).map((x) => Number(x.toFixed(5))) }, { gesture: `${label} ${hit.material}`, moving: true }),
        onchange: () => state.endGesture() });
      panel.fills.push(() => document.activeElement !== input && (input.value = hexOf(now()[name])));
      return make("label", { class: "row wide" }, make("span", {}, label), input);
    };
    const model = make("select", { "aria-label": "Model", title: "How the material reflects", onchange: () => {
      // Parameters of another model would be refused.
      const kept = Object.entries(edit()).filter(([name]) => name === "base_color" || MODELS[model.value].has.includes(name));
      change({ ...Object.fromEntries(kept), model: model.value }, { structure: true });
      state.endGesture();
    } }, ...Object.entries(MODELS).map(([value, { label }]) => make("option", { value }, label)));
    panel.fills.push(() => (model.value = now().model));
    const rows = MODELS[now().model].has.map((name) => {
      if (name === "specular") return color("Specular", name);
      const [label, spec] = ROWS[name];
      return panel.row(label, spec, () => now()[name], (value, options) => set({ [name]: clamp(value, spec.low, spec.high) }, options));
    });
    const reset = make("button", { onclick: () => {
      state.work((work) => {
        const { [hit.material]: _, ...rest } = work.edits;
        work.edits = rest;
      });
      state.endGesture();
    } }, "As it was baked");
    return [heading, ...variants, make("section", { class: "card" }, make("div", { class: "body" },
      make("p", { class: "note" }, `${hit.name || `material ${hit.material}`} · ${hit.distance.toFixed(2)} m away`),
      make("label", { class: "row wide" }, make("span", {}, "Model"), model),
      color("Base colour", "base_color"), ...rows, make("div", { class: "buttons" }, reset)))];
  }
}

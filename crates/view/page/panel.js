// The list of lights with their values, and the picked material. Built anew when what there is changes, else only filled.

import { at, clamp, hexOf, kelvinOf, length, ofHex, ofKelvin, scale, sub, withValue } from "./math.js";
import * as lights from "./lights.js";
import { make } from "./make.js";
import { PictureCard } from "./picture.js";
import { MaterialCard } from "./material.js";
import { PLACE, sunDirection } from "./sun.js";

// Strengths that the slider reaches, decades; numbers may go beyond.
const DECADES = [-4, 6];

const shown = (x) => String(Number(x.toPrecision(4)));

export class Panel {
  constructor(state, root) {
    Object.assign(this, { state, root, fills: [], hues: new Map(), stale: false, pressed: false });
    this.picture = new PictureCard(this);
    this.material = new MaterialCard(this);
    state.on((what) => {
      this.stale ||= what.structure;
      this.renew();
    });
    // What is pressed stays where it is until it is let go: a button that was taken away in between is never clicked. The click comes in
    // the same task as its pointerup.
    root.addEventListener("pointerdown", ({ button, target }) => (this.pressed = button === 0 && Boolean(target.closest("button, [type=range]"))));
    for (const end of ["pointerup", "pointercancel"]) addEventListener(end, () => setTimeout(() => {
      this.pressed = false;
      if (this.stale) this.renew();
    }));
  }

  renew() {
    if (!this.stale) this.fill();
    else if (!this.pressed) this.build();
  }

  // A slider with a number beside it, for one value.
  row(label, { unit = "", low, high, step = 0.01, log = false, title }, read, write) {
    const toSlider = (v) => (log ? Math.log10(Math.max(v, 1e-30)) : v);
    const ofSlider = (v) => (log ? Number((10 ** v).toPrecision(4)) : v);
    const id = `${label} ${unit}`.trim();
    const [from, to] = log ? [Math.log10(low), Math.log10(high)] : [low, high];
    const change = (value, moving) => write(value, { gesture: `row ${label} ${this.state.selected}`, moving });
    const rest = () => this.state.endGesture();
    const slider = make("input", {
      type: "range", min: from, max: to, step: log ? 0.01 : step, "aria-label": id, title,
      oninput: () => change(ofSlider(Number(slider.value)), true), onchange: rest,
    });
    const number = make("input", {
      type: "number", step: "any", min: low >= 0 ? 0 : null, "aria-label": `${id}, number`, title,
      onchange: () => {
        const value = Number(number.value);
        // What is no number stays what it was.
        if (number.value !== "" && Number.isFinite(value) && Math.abs(value) <= 1e30) change(log || low >= 0 ? Math.max(0, value) : value, false);
        rest();
        number.value = shown(read());
      },
    });
    this.fills.push(() => {
      const value = read();
      if (document.activeElement !== slider || !slider.matches(":active")) slider.value = toSlider(value);
      if (document.activeElement !== number) number.value = shown(value);
    });
    return make("label", { class: "row", title: title ?? (unit ? `${label} in ${unit}` : label) }, make("span", {}, label), slider, number);
  }

  xyz(label, unit, read, write) {
    const inputs = ["x", "y", "z"].map((axis, i) => {
      const input = make("input", {
        type: "number", step: "any", "aria-label": `${label} ${axis}, ${unit}`, title: `${axis}, ${unit}`,
        onchange: () => {
          const value = Number(input.value);
          if (input.value !== "" && Number.isFinite(value) && Math.abs(value) < 1e9) write(read().map((x, k) => (k === i ? value : x)));
          this.state.endGesture();
          input.value = shown(read()[i]);
        },
      });
      return input;
    });
    this.fills.push(() => inputs.forEach((input, i) => document.activeElement !== input && (input.value = shown(read()[i]))));
    return make("div", { class: "row tall" }, make("span", {}, `${label}, ${unit}`), make("div", { class: "xyz" }, ...inputs));
  }

  build() {
    const { state } = this;
    if (!state.sequence) return;
    this.stale = false;
    const scroll = this.root.scrollTop;
    const focused = document.activeElement?.getAttribute?.("aria-label");
    const inside = this.root.contains(document.activeElement);
    this.fills = [];
    const add = make("select", { "aria-label": "Add a light", title: "Add a light in front of the camera", onchange: () => this.add(add) },
      make("option", { value: "" }, "+ Add"),
      ...["point", "spot", "sphere", "rect", "directional", "sun_sky"].map((type) => make("option", { value: type }, lights.KINDS[type].label)));
    const list = state.sequence.lights.slice(0, 500).map((light) => this.card(light));
    if (!list.length) list.push(make("p", { class: "note" }, "No light shines. Add one."));
    const more = state.sequence.lights.length - list.length;
    if (more > 0) list.push(make("p", { class: "note" }, `${more} more lights are in the sequence and shine.`));
    this.root.replaceChildren(make("h2", {}, `Lights (${state.sequence.lights.length})`, add), ...list, ...this.material.build(), ...this.picture.build());
    this.fill();
    this.root.scrollTop = scroll;
    if (inside && focused) this.root.querySelector(`[aria-label="${CSS.escape(focused)}"]`)?.focus();
  }

  fill() {
    for (const fill of this.fills) fill();
  }

  add(select) {
    const type = select.value;
    if (!type) return;
    const { state } = this;
    const light = lights.made(type, state.sequence.lights, state.eye);
    state.work((work) => {
      work.sequence = { ...work.sequence, lights: [...work.sequence.lights, light] };
      work.selected = light.name;
    });
    state.endGesture();
  }

  card(light) {
    const { state } = this;
    const { name } = light;
    const spec = lights.kind(light);
    const chosen = state.selected === name;
    const now = () => state.light(name) ?? light;
    const swatch = make("span", { class: "swatch" });
    const small = make("small", {});
    const title = make("button", { class: "title", "aria-expanded": String(chosen), title: `${spec.label}: show its values`,
      "aria-label": `${name}, ${spec.label}`, onclick: () => state.view({ selected: chosen ? null : name }, { structure: true }) },
      swatch, make("b", {}, name), small);
    const toggle = (letter, label, hint, on, flip) => {
      const button = make("button", { class: "toggle", "aria-label": `${label} ${name}`, title: hint, onclick: () => {
        state.work(flip, { structure: false });
        state.endGesture();
      } }, letter);
      this.fills.push(() => button.setAttribute("aria-pressed", String(on())));
      return button;
    };
    const solo = toggle("S", "Solo", "Solo: this light alone", () => state.solo === name, (work) => (work.solo = work.solo === name ? null : name));
    const mute = toggle("M", "Mute", "Mute: off, and left out of what is saved", () => state.muted.includes(name), (work) =>
      (work.muted = work.muted.includes(name) ? work.muted.filter((n) => n !== name) : [...work.muted, name]));
    const card = make("section", { class: "card", "aria-label": name }, make("div", { class: "head" }, title, solo, mute));
    card.classList.toggle("chosen", chosen);
    this.fills.push(() => {
      const rgb = lights.strength(now(), state.time);
      const most = Math.max(...rgb);
      swatch.style.background = hexOf(scale(rgb, 1 / (most || 1)));
      small.textContent = `${spec.label} · ${shown(most)} ${spec.unit}`;
      card.classList.toggle("mute", !state.shines(now()));
    });
    if (chosen) card.append(this.body(name, spec, now));
    return card;
  }

  // The colour of a light whose strength is 0 is remembered.
  hue(light) {
    const rgb = lights.strength(light, this.state.time);
    const most = Math.max(...rgb);
    if (most > 0) this.hues.set(light.name, scale(rgb, 1 / most));
    return this.hues.get(light.name) ?? [1, 1, 1];
  }

  body(name, spec, now) {
    const { state } = this;
    const change = (how, options) => state.change(name, how, options);
    const level = () => Math.max(...lights.strength(now(), state.time));
    const paint = (rgb, options) => change((light) => lights.withStrength(light, state.time, rgb), options);
    const label = spec.strength === "scale" ? "Brightness" : "Intensity";
    const rows = [this.row(label, { unit: spec.unit, low: 10 ** DECADES[0], high: 10 ** DECADES[1], log: true, title: `${label} in ${spec.unit}, of the strongest of red, green and blue` },
      level, (value, options) => paint(scale(this.hue(now()), value), options))];
    const color = make("input", { type: "color", "aria-label": `Colour of ${name}`, title: "Colour",
      oninput: () => {
        const rgb = ofHex(color.value);
        const most = Math.max(...rgb);
        if (most > 0) paint(scale(rgb, level() / most), { gesture: `colour ${name}`, moving: true });
      },
      onchange: () => state.endGesture() });
    const kelvin = make("input", { type: "range", class: "kelvin", min: 1700, max: 12000, step: 50, "aria-label": `Colour temperature of ${name}, kelvin`, title: "Colour temperature",
      oninput: () => paint(scale(ofKelvin(Number(kelvin.value)), level()), { gesture: `kelvin ${name}`, moving: true }), onchange: () => state.endGesture() });
    const said = make("output", {});
    this.fills.push(() => {
      const hue = this.hue(now());
      if (document.activeElement !== color) color.value = hexOf(hue);
      const k = kelvinOf(hue);
      if (!kelvin.matches(":active")) kelvin.value = k;
      said.textContent = `≈ ${clamp(k, 1700, 25000)} K`;
    });
    rows.push(make("label", { class: "row", title: "Colour temperature of a black body" }, make("span", {}, "Temperature"), kelvin, said));
    rows.push(make("label", { class: "row wide" }, make("span", {}, "Colour"), color));
    if (spec.place) rows.push(this.xyz("Position", "m", () => lights.place(now(), state.time), (xyz) => change((light) => lights.withPlace(light, state.time, xyz))));
    if (spec.aim) {
      const aim = () => lights.aim(now(), state.time);
      const turn = (part) => (value, options) => {
        // By hand: it stands where no date says any more.
        const { [name]: _, ...suns } = state.suns;
        state.suns = suns;
        change((light) => lights.withAim(light, state.time, { ...lights.aim(light, state.time), [part]: value }), options);
      };
      rows.push(this.row("Height", { unit: "°", low: -90, high: 90, step: 0.5, title: "Where the light comes from: degrees above the horizon" }, () => aim().elevation, turn("elevation")));
      rows.push(this.row("Azimuth", { unit: "°", low: -180, high: 180, step: 1, title: "Where the light comes from: degrees from +Z towards +X" }, () => aim().azimuth, turn("azimuth")));
    }
    if (spec.towards) rows.push(this.sun(name, spec, now));
    for (const field of spec.fields) {
      rows.push(this.row(field.label, field, () => lights.field(now(), field, state.time), (value, options) => {
        const fit = field.name === "radius" ? Math.max(1e-6, value) : clamp(value, field.name === "rotation_deg" ? -1e6 : field.low, field.name === "rotation_deg" ? 1e6 : field.high);
        change((light) => cones(lights.withField(light, field.name, state.time, fit, field.default), field.name, state.time), options);
      }));
    }
    if (spec.size) {
      for (const [edge, text] of [["edge_u", "Width"], ["edge_v", "Depth"]]) {
        rows.push(this.row(text, { unit: "m", low: 0.01, high: 100, log: true }, () => length(at(now()[edge], state.time)), (value, options) => change((light) => {
          const old = at(light[edge], state.time);
          return { ...light, [edge]: withValue(light[edge], state.time, scale(old, Math.max(1e-4, value) / length(old))) };
        }, options)));
      }
    }
    const named = make("input", { type: "text", value: name, "aria-label": `Name of ${name}`, maxlength: 120, onchange: () => this.rename(name, named.value.trim()) });
    rows.push(make("label", { class: "row wide" }, make("span", {}, "Name"), named));
    rows.push(make("div", { class: "buttons" },
      make("button", { onclick: () => this.duplicate(name) }, "Duplicate"),
      make("button", { onclick: () => this.remove(name) }, "Delete")));
    return make("div", { class: "body" }, ...rows);
  }

  // The sun by date, time and place.
  sun(name, spec, now) {
    const { state } = this;
    const where = () => state.suns[name] ?? PLACE;
    const put = (change, { gesture = null, moving = false } = {}) => state.work((work) => {
      work.suns = { ...work.suns, [name]: { ...where(), ...change } };
      const towards = sunDirection(work.suns[name]).map((x) => Number(x.toFixed(6)));
      work.sequence = { ...work.sequence, lights: work.sequence.lights.map((light) => (light.name === name ? { ...light, [spec.aim]: withValue(light[spec.aim], state.time, towards) } : light)) };
    }, { gesture, moving, structure: false });
    const date = make("input", { type: "date", "aria-label": `Date of ${name}`, title: "Day and month; the year makes no difference",
      onchange: () => {
        const [, month, day] = date.value.split("-");
        if (day) put({ day: `${month}-${day}` });
        state.endGesture();
      } });
    const said = make("legend", {});
    this.fills.push(() => {
      if (document.activeElement !== date) date.value = `2025-${where().day}`;
      const high = lights.aim(now(), state.time).elevation;
      said.textContent = `By date and place${state.suns[name] ? (high < 0 ? ": below the horizon" : "") : " (now by hand)"}`;
    });
    const row = (label, key, spec) => this.row(label, spec, () => where()[key], (value, options) => put({ [key]: clamp(value, spec.low, spec.high) }, options));
    return make("fieldset", {}, said,
      make("label", { class: "row wide" }, make("span", {}, "Date"), date),
      row("Time", "hours", { unit: "h", low: 0, high: 24, step: 0.05, title: "Hours of the clock there" }),
      row("Latitude", "latitude", { unit: "°", low: -90, high: 90, step: 0.1, title: "Degrees north of the equator" }),
      row("Longitude", "longitude", { unit: "°", low: -180, high: 180, step: 0.1, title: "Degrees east of Greenwich" }),
      row("Time zone", "zone", { unit: "h", low: -12, high: 14, step: 0.25, title: "Hours ahead of UTC, summer time included" }),
      row("North", "north", { unit: "°", low: -180, high: 180, step: 1, title: "Where north is: degrees from −Z towards +X" }));
  }

  rename(name, to) {
    const { state } = this;
    if (!to || state.light(to)) return this.build();
    state.work((work) => {
      work.sequence = { ...work.sequence, lights: work.sequence.lights.map((light) => (light.name === name ? { ...light, name: to } : light)) };
      work.muted = work.muted.map((n) => (n === name ? to : n));
      if (work.solo === name) work.solo = to;
      const { [name]: sun, ...suns } = work.suns;
      work.suns = sun ? { ...suns, [to]: sun } : suns;
      work.selected = to;
    });
    state.endGesture();
  }

  duplicate(name) {
    const { state } = this;
    const copy = { ...state.light(name), name: lights.freeName(state.sequence.lights, name) };
    state.work((work) => {
      work.sequence = { ...work.sequence, lights: [...work.sequence.lights, copy] };
      work.selected = copy.name;
    });
    state.endGesture();
  }

  remove(name) {
    this.state.work((work) => {
      work.sequence = { ...work.sequence, lights: work.sequence.lights.filter((light) => light.name !== name) };
      work.muted = work.muted.filter((n) => n !== name);
      if (work.solo === name) work.solo = null;
      work.selected = work.sequence.lights[0]?.name ?? null;
    });
    this.state.endGesture();
  }
}

// The inner cone stays within the outer one.
function cones(light, changed, time) {
  if (light.type !== "spot") return light;
  const [inner, outer] = [at(light.inner_angle_deg ?? 0, time), at(light.outer_angle_deg, time)];
  if (inner <= outer) return light;
  const other = changed === "inner_angle_deg" ? "outer_angle_deg" : "inner_angle_deg";
  return { ...light, [other]: withValue(light[other], time, changed === "inner_angle_deg" ? inner : outer) };
}

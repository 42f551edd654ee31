// What the page shows and what was changed: undo and redo, kept in the browser and in the address.

import { at, isKeyed } from "./math.js";

const MOST_UNDO = 200;
// What the address holds, beside what the browser keeps.
const VIEW = ["eye", "time", "exposure", "tone", "layer", "by", "size", "selected"];
// What undo brings back.
const WORK = ["sequence", "muted", "solo", "edits", "variant", "suns"];

const copy = (value) => JSON.parse(JSON.stringify(value));
const pick = (from, names) => Object.fromEntries(names.map((name) => [name, from[name]]));

export class State {
  constructor() {
    this.listeners = [];
    this.past = [];
    this.future = [];
    this.hello = null;
    // Counts changes of what the server is told of lights and of materials.
    this.lightsVersion = 0;
    this.materialsVersion = 0;
    Object.assign(this, {
      sequence: null, muted: [], solo: null, edits: {}, variant: null, eye: null, time: 0, exposure: null, tone: "neutral", layer: "beauty",
      by: "asset", size: [640, 360], selected: null, picked: null,
      // Where suns stand by date and place, by the lights' names.
      suns: {},
      // Whether points and links of the picked place are drawn, whether its lightcut is, and the row whose waveform is.
      links: false, clusters: false, row: null,
    });
  }

  on(listener) {
    this.listeners.push(listener);
  }

  tell(what = {}) {
    for (const listener of this.listeners) listener(what);
  }

  // Takes up an asset: its own state, else what was kept of it, else what the address says.
  begin(hello) {
    const before = this.hello;
    const again = before?.hash === hello.hash;
    // Baked anew in the same place: the work goes on with it.
    const renewed = !again && before?.asset === hello.asset && String(before.offset) === String(hello.offset);
    this.hello = hello;
    if (renewed) {
      const named = (from, i) => from.materials[i]?.name;
      this.edits = Object.fromEntries(Object.entries(this.edits).filter(([i]) => named(before, i) === named(hello, i)));
      if (!this.variantShown()) this.variant = null;
      this.picked = null;
      this.keep();
    } else if (!again) {
      this.sequence = copy(hello.sequence);
      this.eye = firstEye(hello);
      Object.assign(this, { muted: [], solo: null, edits: {}, variant: null, suns: {}, time: 0, past: [], future: [], picked: null });
      this.recall();
      this.readAddress();
      if (!this.sequence.lights.some((light) => light.name === this.selected)) {
        this.selected = this.sequence.lights[0]?.name ?? null;
      }
    }
    this.lightsVersion++;
    this.materialsVersion++;
    this.tell({ structure: true });
    return renewed;
  }

  get key() {
    return `relight:${this.hello?.hash}:${this.hello?.lights_file ?? ""}`;
  }

  recall() {
    try {
      const kept = JSON.parse(localStorage.getItem(this.key));
      if (Array.isArray(kept?.sequence?.lights)) Object.assign(this, { suns: {}, variant: null }, pick(kept, WORK.filter((name) => name in kept)));
    } catch {
      // What can't be read was not kept.
    }
  }

  keep() {
    try {
      localStorage.setItem(this.key, JSON.stringify(pick(this, WORK)));
    } catch {
      // Full or forbidden: work goes on.
    }
  }

  readAddress() {
    try {
      const view = JSON.parse(decodeURIComponent(location.hash.slice(1)));
      for (const name of VIEW) if (view[name] !== undefined) this[name] = view[name];
      const fine = (xyz) => Array.isArray(xyz) && xyz.length === 3 && xyz.every(Number.isFinite);
      if (!fine(this.eye?.position) || !fine(this.eye?.look_at) || !fine(this.eye?.up)) this.eye = firstEye(this.hello);
    } catch {
      // No view, or none of ours.
    }
  }

  writeAddress() {
    const round = (x) => (typeof x === "number" ? Number(x.toPrecision(7)) : x);
    const text = JSON.stringify(pick(this, VIEW), (_, value) => round(value));
    history.replaceState(null, "", "#" + encodeURIComponent(text));
  }

  // Call before a change that undo shall take back; changes of one gesture share a label until `gesture` changes.
  mark(gesture) {
    if (gesture && gesture === this.gesture) return;
    this.gesture = gesture;
    this.past.push(copy(pick(this, WORK)));
    if (this.past.length > MOST_UNDO) this.past.shift();
    this.future = [];
  }

  endGesture() {
    this.gesture = null;
    this.keep();
    this.tell({ rest: true });
  }

  back(from, to) {
    if (!from.length) return;
    to.push(copy(pick(this, WORK)));
    Object.assign(this, from.pop());
    this.gesture = null;
    if (!this.light(this.selected)) this.selected = this.sequence.lights[0]?.name ?? null;
    this.lightsVersion++;
    this.materialsVersion++;
    this.keep();
    this.tell({ structure: true });
  }

  undo() {
    this.back(this.past, this.future);
  }

  redo() {
    this.back(this.future, this.past);
  }

  light(name) {
    return this.sequence?.lights.find((light) => light.name === name);
  }

  // Changes one light by a function; moving: more changes follow at once.
  change(name, change, { gesture = null, moving = false } = {}) {
    this.mark(gesture);
    this.sequence.lights = this.sequence.lights.map((light) => (light.name === name ? change(light) : light));
    this.lightsVersion++;
    if (!moving && !gesture) this.keep();
    this.tell({ moving });
  }

  // Changes anything else that undo knows.
  work(change, { gesture = null, structure = true, moving = false } = {}) {
    this.mark(gesture);
    change(this);
    this.lightsVersion++;
    this.materialsVersion++;
    if (!gesture) this.keep();
    this.tell({ structure, moving });
  }

  // Changes what is looked at: no undo.
  view(change, what = {}) {
    Object.assign(this, change);
    this.tell(what);
  }

  shines(light) {
    return this.solo ? light.name === this.solo : !this.muted.includes(light.name);
  }

  // The lighting sequence as it shines.
  shining() {
    const { frames, fps } = this.sequence;
    return { relight_sequence: 1, frames, fps, lights: this.sequence.lights.filter((light) => this.shines(light)) };
  }

  // The sequence as a file: in the coordinates of the scene's file, seen from here.
  file() {
    const offset = this.hello.offset;
    const moved = (value) => {
      if (isKeyed(value)) return { ...value, keys: value.keys.map(([f, v]) => [f, moved(v)]) };
      return value.map((x, i) => x + offset[i]);
    };
    const far = offset.some((x) => x !== 0);
    const lights = this.shining().lights.map((light) => renamed(light, (name) => this.hello.embedded?.[name])).map((light) => {
      if (!far) return light;
      const out = { ...light };
      for (const name of ["position", "center"]) if (out[name]) out[name] = moved(out[name]);
      return out;
    });
    const camera = { ...this.eye };
    if (far) for (const name of ["position", "look_at"]) camera[name] = moved(camera[name]);
    return { ...this.shining(), camera, lights };
  }

  // The variant of materials that is shown, if the asset has it.
  variantShown() {
    return this.hello.variants.find(({ name }) => name === this.variant);
  }

  // The number of the material that is shown in place of one.
  inPlaceOf(material) {
    return this.variantShown()?.materials.find(([of]) => of === material)?.[1] ?? material;
  }

  get edited() {
    return Boolean(this.variantShown()) || Object.keys(this.edits).length > 0;
  }

  // The material edits as a file.
  materials() {
    const edits = Object.entries(this.edits).map(([material, edit]) => ({ material: Number(material), ...edit }));
    return { relight_materials: 1, ...(this.variantShown() ? { variant: this.variant } : {}), edits };
  }
}

// A light with other names of its maps, where a function has any.
export function renamed(light, nameOf) {
  const { file } = light;
  if (light.type !== "environment" || !file) return light;
  const other = (name) => nameOf(name) ?? name;
  return { ...light, file: typeof file === "string" ? other(file) : { ...file, keys: file.keys.map(([f, name]) => [f, other(name)]) } };
}

// The sequence's camera, else the scene's first, else one from outside that sees all.
export function firstEye(hello) {
  const { cameras, sequence } = hello;
  const own = sequence.camera;
  const track = own?.node ? cameras.find((camera) => camera.name === own.node) : (own ?? cameras[0]);
  return eyeOf(track, 0) ?? outside(hello);
}

export function eyeOf(track, time) {
  if (!track) return null;
  return {
    position: at(track.position, time), look_at: at(track.look_at, time), up: at(track.up ?? [0, 1, 0], time),
    vfov_deg: at(track.vfov_deg, time),
  };
}

export function outside(hello) {
  const [low, high] = hello.bounds ?? [[-1, -1, -1], [1, 1, 1]];
  const middle = low.map((x, i) => (x + high[i]) / 2);
  const size = Math.hypot(...low.map((x, i) => high[i] - x)) || 1;
  return {
    position: [middle[0] + 0.5 * size, middle[1] + 0.35 * size, middle[2] + 0.8 * size],
    look_at: middle, up: [0, 1, 0], vfov_deg: 45,
  };
}

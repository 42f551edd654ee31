// The picture: the camera by mouse, touch and keyboard, and handles of lights drawn over it.

import { add, axes, clamp, cross, degrees, direction, dot, length, onLine, onPlane, project, radians, scale, sub, unit } from "./math.js";
import { kind, place, strength, withPlace } from "./lights.js";
import { Clusters } from "./clusters.js";
import { element } from "./overlay.js";
import { Transport } from "./transport.js";

const AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const NAMES = ["x", "y", "z"];
// Length of an axis handle and radius of a lamp's, in pixels of the screen.
const ARM = 62;
// How far a pointer may wander in a click, pixels.
const CLICK = 4;

export class Stage {
  constructor(state, frame, { pick }) {
    Object.assign(this, { state, frame, pick });
    this.canvas = frame.querySelector("#picture");
    this.svg = frame.querySelector("svg");
    this.transport = new Transport(state, this.svg);
    this.clusters = new Clusters(state, this.svg);
    this.rowline = element("line", { class: "rowline" }, this.svg);
    // Called with the picture's box whenever that is placed.
    this.placed = [];
    this.handles = new Map();
    this.pointers = new Map();
    this.keys = new Set();
    frame.addEventListener("pointerdown", (event) => this.down(event));
    frame.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) frame.addEventListener(name, (event) => this.up(event));
    frame.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    frame.addEventListener("contextmenu", (event) => event.preventDefault());
    frame.addEventListener("keydown", (event) => this.key(event));
    frame.addEventListener("keyup", (event) => this.keys.delete(event.code));
    frame.addEventListener("blur", () => this.keys.clear());
    new ResizeObserver(() => this.place()).observe(frame);
    state.on(() => this.place());
  }

  draw(bitmap) {
    if (this.canvas.width !== bitmap.width || this.canvas.height !== bitmap.height) {
      [this.canvas.width, this.canvas.height] = [bitmap.width, bitmap.height];
    }
    this.canvas.getContext("2d").drawImage(bitmap, 0, 0);
  }

  // The picture's box within the frame, pixels of the screen.
  get box() {
    const { clientWidth, clientHeight } = this.frame;
    const [w, h] = this.state.size;
    const k = Math.min(clientWidth / w, clientHeight / h);
    return { x: (clientWidth - w * k) / 2, y: (clientHeight - h * k) / 2, width: w * k, height: h * k };
  }

  at(event) {
    const rect = this.frame.getBoundingClientRect();
    const box = this.box;
    return { x: event.clientX - rect.left - box.x, y: event.clientY - rect.top - box.y, ...{ width: box.width, height: box.height } };
  }

  ray({ x, y, width, height }) {
    return direction(this.state.eye, x, y, width, height);
  }

  // ---- the camera

  get reach() {
    return length(sub(this.state.eye.look_at, this.state.eye.position)) || 1;
  }

  look(eye, moving = true) {
    if (![...eye.position, ...eye.look_at].every((x) => Math.abs(x) < 1e9)) return;
    this.state.view({ eye }, { moving, eye: true });
  }

  orbit(dx, dy) {
    const { eye } = this.state;
    const up = unit(eye.up, [0, 1, 0]);
    const from = sub(eye.position, eye.look_at);
    const far = length(from);
    const { right } = axes(eye);
    const turned = (v, axis, angle) =>
      add(add(scale(v, Math.cos(angle)), scale(cross(axis, v), Math.sin(angle))), scale(axis, dot(axis, v) * (1 - Math.cos(angle))));
    const height = degrees(Math.asin(clamp(dot(unit(from), up), -1, 1)));
    const tilt = clamp(height + dy, -88, 88) - height;
    let to = turned(from, right, -radians(tilt));
    to = turned(to, up, radians(dx));
    this.look({ ...eye, position: add(eye.look_at, scale(unit(to), far)) });
  }

  // Moves eye and target together; metres to the right, up and forward.
  shift(x, y, z) {
    const { eye } = this.state;
    const { right, up, forward } = axes(eye);
    const by = add(add(scale(right, x), scale(up, y)), scale(forward, z));
    this.look({ ...eye, position: add(eye.position, by), look_at: add(eye.look_at, by) });
  }

  pan(dx, dy) {
    const k = (2 * this.reach * Math.tan(radians(this.state.eye.vfov_deg) / 2)) / this.box.height;
    this.shift(-dx * k, dy * k, 0);
  }

  dolly(factor) {
    const { eye } = this.state;
    const from = scale(sub(eye.position, eye.look_at), factor);
    if (length(from) > 1e-4) this.look({ ...eye, position: add(eye.look_at, from) });
  }

  turn(dx, dy) {
    const { eye } = this.state;
    const { right, up, forward } = axes(eye);
    const ahead = unit(add(forward, add(scale(right, Math.tan(radians(dx))), scale(up, Math.tan(radians(dy))))));
    if (Math.abs(dot(ahead, unit(eye.up, [0, 1, 0]))) > 0.999) return;
    this.look({ ...eye, look_at: add(eye.position, scale(ahead, this.reach)) });
  }

  wheel(event) {
    event.preventDefault();
    this.dolly(Math.exp(clamp(event.deltaY, -200, 200) * 0.0012));
    this.restSoon();
  }

  restSoon() {
    clearTimeout(this.resting);
    this.resting = setTimeout(() => this.state.tell({ rest: true }), 160);
  }

  // ---- pointers

  down(event) {
    if (event.target.closest("button")) return;
    // Focus goes to what was grabbed.
    const grip = event.target.closest("[data-light]");
    (grip ?? this.frame).focus({ preventScroll: true });
    event.preventDefault();
    this.frame.setPointerCapture(event.pointerId);
    const at = this.at(event);
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    this.gesture = { id: event.pointerId, start: at, wandered: 0, pan: event.button !== 0 || event.shiftKey };
    if (grip) {
      const name = grip.dataset.light;
      const light = this.state.light(name);
      if (this.state.selected !== name) this.state.view({ selected: name }, { structure: true });
      const from = place(light, this.state.time);
      Object.assign(this.gesture, { name, from, axis: grip.dataset.axis, label: `drag ${name} ${performance.now()}` });
      this.gesture.offset = this.dragged(at, event.shiftKey, from);
    }
  }

  move(event) {
    const last = this.pointers.get(event.pointerId);
    if (!last) return;
    const [dx, dy] = [event.clientX - last.x, event.clientY - last.y];
    if (this.pointers.size === 2 && !this.gesture?.name) this.pinch(event, dx, dy);
    [last.x, last.y] = [event.clientX, event.clientY];
    const gesture = this.gesture;
    if (this.pointers.size !== 1 || gesture?.id !== event.pointerId) return;
    gesture.wandered += Math.abs(dx) + Math.abs(dy);
    if (gesture.wandered < CLICK) return;
    if (gesture.name) this.drag(event);
    else if (gesture.pan) this.pan(dx, dy);
    else this.orbit((-dx * 180) / this.box.height, (dy * 120) / this.box.height);
  }

  // Two fingers: their middle pans, their distance comes nearer.
  pinch(event, dx, dy) {
    const [a, b] = [...this.pointers.values()];
    const other = this.pointers.get(event.pointerId) === a ? b : a;
    const before = Math.hypot(event.clientX - dx - other.x, event.clientY - dy - other.y);
    const after = Math.hypot(event.clientX - other.x, event.clientY - other.y);
    this.gesture = null;
    if (before > 10 && after > 10) this.dolly(before / after);
    this.pan(dx / 2, dy / 2);
  }

  up(event) {
    this.pointers.delete(event.pointerId);
    const gesture = this.gesture;
    if (gesture?.id === event.pointerId) {
      this.gesture = null;
      if (gesture.wandered < CLICK && !gesture.name && event.type === "pointerup") {
        const { x, y, width, height } = gesture.start;
        if (x >= 0 && y >= 0 && x < width && y < height) this.pick(x / width, y / height);
      }
      if (gesture.name) this.state.endGesture();
    }
    this.restSoon();
  }

  // ---- handles

  // Where a pointer takes a lamp: along an axis, on the horizontal plane, or on the one that faces the eye.
  dragged(at, flat, from) {
    const { eye } = this.state;
    const ray = this.ray(at);
    const { axis } = this.gesture;
    if (axis) return onLine(eye.position, ray, from, AXES[axis]);
    return onPlane(eye.position, ray, from, flat ? [0, 1, 0] : axes(eye).forward);
  }

  drag(event) {
    const { name, from, offset, label } = this.gesture;
    const to = this.dragged(this.at(event), event.shiftKey, from);
    if (!to || !offset) return;
    this.put(name, add(from, sub(to, offset)), label);
  }

  put(name, xyz, gesture) {
    const [low, high] = this.state.hello.bounds ?? [[-1e6, -1e6, -1e6], [1e6, 1e6, 1e6]];
    // A lamp that slips to the horizon would be lost: it stays within twice the scene around it.
    const room = Math.max(...low.map((x, i) => high[i] - x)) || 1;
    const kept = xyz.map((x, i) => Number(clamp(x, low[i] - room, high[i] + room).toPrecision(6)));
    if (kept.every(Number.isFinite)) {
      this.state.change(name, (light) => withPlace(light, this.state.time, kept), { gesture, moving: true });
    }
  }

  key(event) {
    const grip = event.target.closest?.("[data-light]");
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = event.shiftKey ? 5 : 1;
    const arrows = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], PageUp: [0, 0, 1], PageDown: [0, 0, -1] };
    const arrow = arrows[event.code];
    if (grip && (event.code === "Enter" || event.code === "Space")) {
      this.state.view({ selected: grip.dataset.light }, { structure: true });
      event.preventDefault();
    } else if (grip && arrow) {
      event.preventDefault();
      const name = grip.dataset.light;
      const from = place(this.state.light(name), this.state.time);
      const { right, up, forward } = axes(this.state.eye);
      const depth = Math.max(1e-3, dot(sub(from, this.state.eye.position), forward));
      const k = 0.01 * step * depth;
      const by = add(add(scale(right, arrow[0] * k), scale(up, arrow[1] * k)), scale(forward, arrow[2] * k));
      this.put(name, add(from, by), `keys ${name}`);
      clearTimeout(this.nudged);
      this.nudged = setTimeout(() => this.state.endGesture(), 400);
    } else if (arrow) {
      event.preventDefault();
      if (arrow[2]) this.dolly(arrow[2] > 0 ? 0.95 : 1.05);
      else this.orbit(arrow[0] * 3 * step, arrow[1] * 3 * step);
      this.restSoon();
    } else if (/^Key[WASDQE]$/.test(event.code)) {
      event.preventDefault();
      this.keys.add(event.code);
      this.walk();
    }
  }

  // Walks while keys are held, as fast as the scene is large.
  walk() {
    if (this.walking) return;
    let last = performance.now();
    const step = (now) => {
      if (!this.keys.size) {
        this.walking = null;
        return this.restSoon();
      }
      const held = (code) => (this.keys.has(code) ? 1 : 0);
      const [low, high] = this.state.hello.bounds ?? [[-1, -1, -1], [1, 1, 1]];
      const size = Math.hypot(...low.map((x, i) => high[i] - x));
      const way = Math.min(0.1, (now - last) / 1000) * 0.12 * size;
      last = now;
      this.shift((held("KeyD") - held("KeyA")) * way, (held("KeyE") - held("KeyQ")) * way, (held("KeyW") - held("KeyS")) * way);
      this.walking = requestAnimationFrame(step);
    };
    this.walking = requestAnimationFrame(step);
  }

  // Puts canvas and handles where they belong.
  place() {
    const { state } = this;
    if (!state.eye || !state.sequence) return;
    const box = this.box;
    for (const part of [this.canvas, this.svg]) {
      Object.assign(part.style, { left: `${box.x}px`, top: `${box.y}px`, width: `${box.width}px`, height: `${box.height}px` });
    }
    for (const placed of this.placed) placed(box);
    this.transport.draw(box);
    this.clusters.draw(box);
    this.rowline.style.display = state.row === null ? "none" : "";
    const y = ((state.row ?? 0) + 0.5) * (box.height / state.size[1]);
    for (const [name, value] of Object.entries({ x1: 0, x2: box.width, y1: y, y2: y })) this.rowline.setAttribute(name, value);
    const seen = new Set();
    for (const light of state.sequence.lights) {
      const where = place(light, state.time);
      const on = where && project(state.eye, where, box.width, box.height);
      if (!on || on.x < -20 || on.y < -20 || on.x > box.width + 20 || on.y > box.height + 20) continue;
      if (seen.size >= 200) break;
      seen.add(light.name);
      this.handle(light, where, on, box);
    }
    for (const [name, parts] of this.handles) {
      if (!seen.has(name)) {
        parts.group.remove();
        this.handles.delete(name);
      }
    }
  }

  handle(light, where, on, box) {
    const { state } = this;
    let parts = this.handles.get(light.name);
    if (!parts) {
      const group = element("g", { class: "handle" }, this.svg);
      const arms = AXES.map((_, i) => {
        const arm = element("g", { class: `arm ${NAMES[i]}`, "data-light": light.name, "data-axis": i }, group);
        element("line", { class: "hit" }, arm);
        element("line", { class: "line" }, arm);
        element("circle", { r: 6 }, arm);
        return arm;
      });
      const lamp = element("g", { class: "lamp", tabindex: 0, role: "button", "data-light": light.name }, group);
      element("circle", { class: "hit", r: 22 }, lamp);
      element("circle", { class: "ring", r: 11 }, lamp);
      element("circle", { class: "core", r: 5 }, lamp);
      const label = element("text", { class: "name", x: 17, y: 5 }, lamp);
      label.textContent = light.name;
      parts = { group, arms, lamp };
      this.handles.set(light.name, parts);
    }
    const chosen = state.selected === light.name;
    parts.group.classList.toggle("chosen", chosen);
    parts.group.classList.toggle("mute", !state.shines(light));
    parts.lamp.setAttribute("transform", `translate(${on.x} ${on.y})`);
    const text = where.map((x) => x.toFixed(2)).join(", ");
    parts.lamp.setAttribute("aria-label", `${kind(light).label} ${light.name} at ${text} m: drag it, or move it by arrow keys and page up and down`);
    const rgb = strength(light, state.time);
    const most = Math.max(...rgb, 1e-30);
    parts.lamp.querySelector(".core").style.fill = `rgb(${rgb.map((v) => Math.round(255 * (v / most) ** (1 / 2.2))).join(" ")})`;
    parts.arms.forEach((arm, i) => {
      const tip = chosen && project(state.eye, add(where, scale(AXES[i], (0.3 * on.depth * this.state.eye.vfov_deg) / 60)), box.width, box.height);
      const [dx, dy] = tip ? [tip.x - on.x, tip.y - on.y] : [0, 0];
      const far = Math.hypot(dx, dy);
      // One that points at the eye can't be drawn along.
      arm.style.display = far > 8 ? "" : "none";
      if (far <= 8) return;
      const k = Math.min(1, ARM / far) + (far < ARM ? 0 : 0);
      const [x, y] = [on.x + dx * k, on.y + dy * k];
      for (const line of arm.querySelectorAll("line")) {
        line.setAttribute("x1", on.x + (dx / far) * 13);
        line.setAttribute("y1", on.y + (dy / far) * 13);
        line.setAttribute("x2", x);
        line.setAttribute("y2", y);
      }
      const knob = arm.querySelector("circle");
      knob.setAttribute("cx", x);
      knob.setAttribute("cy", y);
    });
  }
}

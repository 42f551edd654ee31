// Puts state, socket, picture and panel together.

import { isKeyed, keysOf, withKey, withoutKey } from "./math.js";
import { freeName, kind } from "./lights.js";
import { Beside } from "./beside.js";
import { Link, wishOf } from "./link.js";
import { Panel } from "./panel.js";
import { Stage } from "./stage.js";
import { State, eyeOf, outside, renamed } from "./state.js";

const $ = (id) => document.getElementById(id);
const LAYERS = { beauty: "Beauty", direct: "Direct light", indirect: "Indirect light", emission: "Light seen itself", albedo: "Reflectance", normal: "Normals", depth: "Distance" };
// How long nothing may change before the picture is refined, milliseconds.
const REST = 140;
// Frames of a still that gets keys.
const NEW_FRAMES = 48;

const state = new State();
const panel = new Panel(state, $("panel"));
const stage = new Stage(state, $("stage"), { pick });
const beside = new Beside(state, $("stage"));
stage.placed.push((box) => beside.place(box), (box) => {
  Object.assign($("legend").style, { left: `${box.x + box.width / 2}px`, top: `${box.y + box.height - 34}px` });
});

function pick(x, y) {
  state.pickedAt = { x, y };
  if (state.row !== null) state.view({ row: Math.min(state.size[1] - 1, Math.floor(y * state.size[1])) }, { overlay: true });
  link.pick(x, y, state);
}

// ---- what goes out

let wanted = null;
let resting = 0;
let frames = [];

// At most one wish per picture of the screen; the last one of a movement asks for refinement.
function want(moving) {
  if (wanted === null) requestAnimationFrame(send);
  wanted = moving || wanted === true;
  document.body.dataset.wanted = "";
  if (moving) {
    clearTimeout(resting);
    resting = setTimeout(() => want(false), REST);
  }
}

function send() {
  const moving = wanted;
  wanted = null;
  const asked = link.show(state, moving);
  // For whoever waits for the picture of the newest wish: none is named until it is sent.
  if (asked !== null) document.body.dataset.wanted = asked;
}

state.on((what) => {
  if (!state.hello) return;
  // The same picture, with something else drawn over it.
  if (what.overlay) return;
  if (what.links && (state.links || state.clusters) && state.pickedAt) link.pick(state.pickedAt.x, state.pickedAt.y, state);
  if (what.moving) $("hint").classList.add("gone");
  want(Boolean(what.moving));
  refresh(what);
  if (!what.moving) state.writeAddress();
});

// ---- what comes in

// Stops that make the middle of the picture a middle grey, as the server last said.
let auto = null;
function exposeByItself() {
  if (auto !== null) state.view({ exposure: Math.max(-100, Math.min(100, Math.round(10 * auto) / 10)) });
}

const link = new Link({
  seen({ head, bitmap, latency }) {
    if (head.stage === "beside") {
      beside.draw(bitmap, head);
      bitmap.close();
      document.body.dataset.beside = head.apart?.samples ?? "none";
      return figures(head, null);
    }
    stage.draw(bitmap);
    bitmap.close();
    auto = head.auto_exposure ?? auto;
    if (state.exposure === null) exposeByItself();
    if (head.stage === "coarse") beside.stale();
    panel.picture.draw();
    legend(head.scale);
    $("busy").hidden = true;
    document.body.dataset.stage = head.stage;
    document.body.dataset.shown = head.id;
    const now = performance.now();
    frames = [...frames.filter((time) => now - time < 1000), now];
    figures(head, latency);
    if ($("status").classList.contains("bad")) say("Connected");
  },
  told(name, value) {
    if (name === "hello") hello(value);
    if (name === "refused") say(value.what, true);
    if (name === "picked") {
      state.view({ picked: value.hit && { ...value.hit, transport: value.hit.transport ?? undefined, clusters: value.hit.clusters ?? undefined } }, { structure: true });
      say(value.hit ? `${value.hit.name || "Unnamed material"}, ${value.hit.distance.toFixed(2)} m away` : "Nothing is there");
    }
  },
  state(connected, words) {
    $("dot").classList.toggle("on", connected);
    say(words, !connected);
  },
});

// False colours from where to where.
function legend(scale) {
  const [low, high] = $("legend").querySelectorAll("output");
  $("legend").hidden = !scale;
  if (!scale) return;
  low.textContent = String(Math.round(scale[0]));
  high.textContent = `${Math.round(scale[1])} nodes or more`;
}

function say(words, bad = false) {
  $("status").textContent = words;
  $("status").title = words;
  $("status").classList.toggle("bad", bad);
}

function hello(value) {
  document.title = `${value.asset.split("/").pop()} – relight view`;
  $("asset").textContent = value.asset.split("/").pop();
  $("asset").title = `${value.asset}: ${value.triangles.toLocaleString("en")} triangles, ${value.points.toLocaleString("en")} points`;
  $("camera").replaceChildren(
    new Option("Free", ""),
    ...value.cameras.map((camera, i) => new Option(camera.name || `Camera ${i + 1}`, String(i))),
    new Option("From outside", "outside"),
  );
  const renewed = state.begin(value);
  const same = value.cameras.findIndex((camera) => JSON.stringify(eyeOf(camera, state.time)) === JSON.stringify(state.eye));
  $("camera").value = same < 0 ? "" : String(same);
  if (renewed) say(`${value.asset} was baked anew; this is the new one`);
  if (!value.points) say("This asset has no points: light is path-traced, which is slow");
}

const WORDS = {
  expose: "rays", weigh: "weights", lights: "lights", direct_points: "points", bounces: "bounces", transfer: "transfer", flatten: "flatten",
  direct_pixels: "direct", reconstruct: "indirect", resolve: "pixels", illumination_cut: "cut", shade: "cuts", render: "path tracing", encode: "encoding",
};

// Milliseconds by stage; the longest is what limits.
function figures(head, latency) {
  const times = Object.entries(head.times).filter(([, time]) => time >= 0.5).sort((a, b) => b[1] - a[1]);
  const all = times.map(([name, time]) => `${WORDS[name] ?? name} ${time.toFixed(1)}`);
  $("stages").textContent = all.slice(0, 4).join(" · ");
  $("stages").title = `Milliseconds: ${all.join(", ")}. ${head.choice}`;
  const shape = { coarse: "moving", middle: "refining", final: "at rest", beside: "path tracing" }[head.stage];
  const rate = frames.length > 2 ? `${frames.length} fps` : "";
  $("speed").textContent = [`${head.width}×${head.height} ${shape}`, `${head.total.toFixed(0)} ms`, rate].filter(Boolean).join(" · ");
  $("speed").title = `Made in ${head.total.toFixed(1)} ms${latency === null ? "" : `, shown ${latency.toFixed(0)} ms after it was asked for`}. ${times.length ? `Most of it: ${all[0]} ms.` : ""}`;
}

// ---- the bar

function layerGroups() {
  const each = (names) => Object.fromEntries(names);
  const { levels = 0, cuts } = state.hello;
  const numbers = [...Array(levels).keys()];
  return [
    ["Picture", LAYERS],
    ["One light", each(state.sequence.lights.slice(0, 200).map((light) => [`light.${light.name}`, `Only ${light.name}`]))],
    ["Indirect light level by level", levels < 2 ? {} : each(numbers.map((n) => [`level.${n}`, n ? `Levels 0 to ${n}` : "Level 0, the coarsest"]))],
    ["What a level adds (grey: nothing)", levels < 2 ? {} : each(numbers.slice(1).map((n) => [`detail.${n}`, `Level ${n} alone`]))],
    ["Visibility cuts", cuts ? { cut_size: "Size of the cuts", nodes: "Nodes that are shaded" } : {}],
  ];
}

function refresh(what) {
  const groups = layerGroups();
  const layers = Object.assign({}, ...groups.map(([, group]) => group));
  const names = Object.keys(layers).join("\n");
  if ($("layer").dataset.names !== names) {
    $("layer").replaceChildren(...groups.filter(([, group]) => Object.keys(group).length).map(([label, group]) => {
      const part = document.createElement("optgroup");
      part.label = label;
      part.append(...Object.entries(group).map(([value, text]) => new Option(text, value)));
      return part;
    }));
    $("layer").dataset.names = names;
  }
  if (!(state.layer in layers)) state.layer = "beauty";
  $("layer").value = state.layer;
  $("size").value = state.size.join("x");
  const exposure = state.exposure ?? 0;
  $("exposure").value = exposure;
  $("exposure-value").textContent = `${exposure >= 0 ? "+" : "−"}${Math.abs(exposure).toFixed(1)} EV`;
  $("by").value = state.by;
  $("undo").disabled = !state.past.length;
  $("redo").disabled = !state.future.length;
  if (what.eye) $("camera").value = "";
  const { frames: count, fps } = state.sequence;
  // A still has room for keys.
  const last = (count > 1 ? count : NEW_FRAMES) - 1;
  $("time").max = last;
  $("time").value = state.time;
  $("frame").textContent = count > 1 ? `${Math.round(state.time)} / ${last} · ${fps} fps` : "still";
  const light = state.light(state.selected);
  const keys = [...new Set(light ? Object.values(light).flatMap((value) => keysOf(value)) : [])];
  $("ticks").replaceChildren(...keys.map((key) => {
    const tick = document.createElement("span");
    tick.style.left = `calc(8px + (100% - 16px) * ${key / Math.max(1, last)})`;
    return tick;
  }));
  $("key").disabled = !light;
  $("unkey").disabled = !keys.includes(Math.round(state.time));
}

$("camera").onchange = ({ target }) => {
  const eye = target.value === "outside" ? outside(state.hello) : eyeOf(state.hello.cameras[Number(target.value)], state.time);
  if (target.value !== "" && eye) state.view({ eye });
};
$("layer").onchange = ({ target }) => state.view({ layer: target.value });
$("size").onchange = ({ target }) => state.view({ size: target.value.split("x").map(Number) });
$("exposure").oninput = ({ target }) => state.view({ exposure: Number(target.value) }, { moving: true });
$("exposure").ondblclick = () => state.view({ exposure: 0 });
$("auto").onclick = exposeByItself;
$("by").onchange = ({ target }) => look(target.value);
function look(by) {
  state.view({ by });
  beside.stale();
}
$("undo").onclick = () => state.undo();
$("redo").onclick = () => state.redo();

// ---- time

let playing = null;
function play() {
  if (playing) {
    cancelAnimationFrame(playing);
    playing = null;
    state.tell({ rest: true });
  } else {
    let last = performance.now();
    const step = (now) => {
      const { frames: count, fps } = state.sequence;
      const time = count > 1 ? (state.time + ((now - last) / 1000) * fps) % count : 0;
      last = now;
      state.view({ time: Math.min(time, count - 1e-3) }, { moving: true });
      playing = requestAnimationFrame(step);
    };
    playing = requestAnimationFrame(step);
  }
  $("play").textContent = playing ? "❚❚" : "▶";
  $("play").setAttribute("aria-label", playing ? "Pause" : "Play");
  if (!playing) state.view({ time: Math.round(state.time) });
}
$("play").onclick = play;
$("time").oninput = ({ target }) => {
  const frame = Number(target.value);
  // A still becomes a sequence when time is first used.
  if (state.sequence.frames < 2) state.sequence = { ...state.sequence, frames: NEW_FRAMES };
  state.view({ time: frame }, { moving: true });
};
const keyed = (light) => [kind(light).strength, kind(light).place, kind(light).aim].filter((name) => name && light[name] !== undefined);
const withEach = (how) => (light) => keyed(light).reduce((done, name) => ({ ...done, [name]: how(done[name], Math.round(state.time)) }), light);
$("key").onclick = () => {
  if (state.sequence.frames < 2) state.sequence = { ...state.sequence, frames: NEW_FRAMES };
  state.change(state.selected, withEach(withKey));
};
$("unkey").onclick = () => state.change(state.selected, withEach(withoutKey));

// ---- files

function download(name, content, type = "application/json") {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([content], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
const stem = () => $("asset").textContent.replace(/\.relight$/, "");
const json = (value) => `${JSON.stringify(value, null, 2)}\n`;
function saveLights() {
  download(`${stem()}.lights.json`, json(state.file()));
  const mute = state.sequence.lights.length - state.shining().lights.length;
  say(mute ? `Saved without ${mute} light${mute > 1 ? "s" : ""} that ${mute > 1 ? "are" : "is"} off` : "Saved");
}
$("save").onclick = saveLights;
$("load").onclick = () => $("file").click();
$("file").onchange = ({ target }) => {
  if (target.files[0]) take(target.files[0]);
  target.value = "";
};

async function take(file) {
  if (/\.(hdr|exr)$/i.test(file.name)) return takeMap(file);
  try {
    if (file.size > 16 << 20) throw new Error("larger than 16 MiB");
    const text = JSON.parse(await file.text());
    if (text.relight_sequence !== 1 || !Array.isArray(text.lights)) throw new Error("no lighting sequence of relight");
    const camera = text.camera;
    const offset = state.hello.offset;
    const moved = (value) => (isKeyed(value) ? { ...value, keys: value.keys.map(([f, v]) => [f, moved(v)]) } : value.map((x, i) => x - offset[i]));
    const here = (thing) => {
      const out = { ...thing };
      for (const name of ["position", "center", "look_at"]) if (out[name]) out[name] = moved(out[name]);
      return out;
    };
    // Maps that stand in the text and are known have short names here.
    const known = new Map(Object.entries(state.hello.embedded ?? {}).map(([name, map]) => [map, name]));
    const lights = text.lights.map((light) => renamed(here(light), (map) => known.get(map)));
    state.work((work) => {
      work.sequence = { frames: text.frames ?? 1, fps: text.fps ?? 24, lights };
      Object.assign(work, { muted: [], solo: null, time: 0, selected: text.lights[0]?.name ?? null });
    });
    const eye = camera?.node ? eyeOf(state.hello.cameras.find((c) => c.name === camera.node), 0) : camera && eyeOf(here(camera), 0);
    if (eye) state.view({ eye });
    state.endGesture();
    say(`Opened ${file.name}`);
  } catch (error) {
    say(`${file.name}: ${error.message}`, true);
  }
}

async function takeMap(file) {
  say(`Reading ${file.name} …`);
  try {
    const answer = await fetch(`maps/${encodeURIComponent(file.name)}`, { method: "POST", body: file });
    if (!answer.ok) throw new Error(await answer.text());
    const map = await answer.json();
    const light = { name: freeName(state.sequence.lights, "environment"), type: "environment", file: map.file, scale: [1, 1, 1], rotation_deg: 0 };
    state.work((work) => {
      // The sky around is one: the new map takes the place of the last.
      const others = work.sequence.lights.filter((other) => other.type !== "environment");
      work.sequence = { ...work.sequence, lights: [...others, light] };
      work.selected = light.name;
    });
    state.endGesture();
    say(`${map.file}: ${map.width} × ${map.height} pixels${map.repaired ? `, ${map.repaired} values repaired` : ""}`);
  } catch (error) {
    say(`${file.name}: ${error.message}`, true);
  }
}

addEventListener("dragover", (event) => {
  event.preventDefault();
  document.body.classList.add("drop");
});
addEventListener("dragleave", (event) => !event.relatedTarget && document.body.classList.remove("drop"));
addEventListener("drop", (event) => {
  event.preventDefault();
  document.body.classList.remove("drop");
  if (event.dataTransfer.files[0]) take(event.dataTransfer.files[0]);
});

// ---- render this

const quoted = (word) => (/^[\w./:@%+=,-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);
$("render").onclick = () => {
  const frame = Math.round(state.time);
  const { edited } = state;
  const words = ["relight", "play", state.hello.asset, "--lights", `${stem()}.lights.json`];
  if (edited) words.push("--materials", `${stem()}.materials.json`);
  words.push("--size", state.size.join("x"), "--frames", `${frame}-${frame}`, "-o", "frame.exr");
  if (state.by === "path") words.push("--integrator", "path");
  $("command").textContent = words.map(quoted).join(" ");
  $("mats").hidden = !edited;
  $("dialog").showModal();
};
$("copy").onclick = async () => {
  try {
    await navigator.clipboard.writeText($("command").textContent);
    $("copy").textContent = "Copied";
  } catch {
    getSelection().selectAllChildren($("command"));
  }
  setTimeout(() => ($("copy").textContent = "Copy"), 1500);
};
$("json").onclick = saveLights;
$("mats").onclick = () => download(`${stem()}.materials.json`, json(state.materials()));
$("exr").onclick = async () => {
  const button = $("exr");
  button.disabled = true;
  button.textContent = "Rendering …";
  try {
    const show = { ...wishOf(state, 0, false), time: Math.round(state.time), layer: "beauty", lights: state.shining(), materials: state.materials() };
    const answer = await fetch("render.exr", { method: "POST", body: JSON.stringify(show) });
    if (!answer.ok) throw new Error(await answer.text());
    download("frame.exr", await answer.blob(), "image/x-exr");
  } catch (error) {
    say(error.message, true);
  }
  button.disabled = false;
  button.textContent = "Download frame.exr";
};

// ---- keys and theme

addEventListener("keydown", (event) => {
  const typing = event.target.matches("input[type=text], input[type=number]");
  const command = event.ctrlKey || event.metaKey;
  if (command && event.code === "KeyZ" && !typing) {
    event.preventDefault();
    if (event.shiftKey) state.redo();
    else state.undo();
  } else if (command && event.code === "KeyS") {
    event.preventDefault();
    saveLights();
  } else if (!command && !typing && event.code === "KeyX") exposeByItself();
  else if (!command && !typing && event.code === "KeyP") look({ asset: "path", path: "both", both: "asset" }[state.by] ?? "asset");
  else if (!command && !typing && event.code === "KeyK") play();
});

function theme(name) {
  document.documentElement.dataset.theme = name;
  try {
    localStorage.setItem("relight:theme", name);
  } catch {
    // It lasts as long as the page.
  }
}
theme(localStorage.getItem("relight:theme") ?? (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark"));
$("theme").onclick = () => {
  theme(document.documentElement.dataset.theme === "light" ? "dark" : "light");
  panel.picture.draw();
};

// Vectors, cameras as relight has them, values over time, colours.

export const add = (a, b) => a.map((x, i) => x + b[i]);
export const sub = (a, b) => a.map((x, i) => x - b[i]);
export const scale = (a, s) => a.map((x) => x * s);
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const length = (a) => Math.hypot(...a);
export const unit = (a, or = [0, 0, -1]) => {
  const l = length(a);
  return l > 0 && Number.isFinite(l) ? scale(a, 1 / l) : or;
};
export const clamp = (x, low, high) => Math.min(high, Math.max(low, x));
export const radians = (degrees) => (degrees * Math.PI) / 180;
export const degrees = (angle) => (angle * 180) / Math.PI;

// Axes of a camera: right, up, forward are unit vectors, tan is that of half the vertical field of view.
export function axes(eye) {
  const forward = unit(sub(eye.look_at, eye.position));
  const side = cross(forward, eye.up);
  const right = unit(side, unit(cross(forward, [1, 0, 0]), [0, 0, 1]));
  return { right, up: cross(right, forward), forward, tan: Math.tan(radians(eye.vfov_deg) / 2) };
}

// Where a point is in a picture of so many pixels; null behind the eye.
export function project(eye, point, width, height) {
  const { right, up, forward, tan } = axes(eye);
  const to = sub(point, eye.position);
  const depth = dot(to, forward);
  if (!(depth > 1e-6 * length(to))) return null;
  const k = height / 2 / (tan * depth);
  return { x: width / 2 + dot(to, right) * k, y: height / 2 - dot(to, up) * k, depth, perMetre: k };
}

// Unit direction through a place of the picture.
export function direction(eye, x, y, width, height) {
  const { right, up, forward, tan } = axes(eye);
  const a = ((2 * x - width) / height) * tan;
  const b = ((height - 2 * y) / height) * tan;
  return unit(add(forward, add(scale(right, a), scale(up, b))));
}

// Where a ray meets a plane; null where it doesn't in front of it.
export function onPlane(origin, ray, point, normal) {
  const slope = dot(ray, normal);
  if (Math.abs(slope) < 1e-4) return null;
  const t = dot(sub(point, origin), normal) / slope;
  return t > 0 && Number.isFinite(t) ? add(origin, scale(ray, t)) : null;
}

// The place on a line (point, unit axis) nearest to a ray; null where they run alike.
export function onLine(origin, ray, point, axis) {
  const w = sub(point, origin);
  const b = dot(axis, ray);
  const d = 1 - b * b;
  if (d < 1e-3) return null;
  return add(point, scale(axis, (b * dot(ray, w) - dot(axis, w)) / d));
}

export const isKeyed = (value) => value !== null && typeof value === "object" && Array.isArray(value.keys);
export const keysOf = (value) => (isKeyed(value) ? value.keys.map((key) => key[0]) : []);
const mix = (a, b, u, v) =>
  Array.isArray(a) ? a.map((x, i) => x * u + b[i] * v) : a * u + b * v;

// A value of a sequence at a frame, as relight's Animated::at.
export function at(value, frame) {
  if (!isKeyed(value)) return value;
  const { keys, interpolation = "linear" } = value;
  let next = keys.findIndex((key) => key[0] > frame);
  if (next === 0) return keys[0][1];
  if (next < 0) return keys[keys.length - 1][1];
  if (interpolation === "step") return keys[next - 1][1];
  const [[f0, v0], [f1, v1]] = [keys[next - 1], keys[next]];
  const t = (frame - f0) / (f1 - f0);
  if (interpolation === "linear") return mix(v0, v1, 1 - t, t);
  const slope = (a, b) => mix(b[1], a[1], (f1 - f0) / (b[0] - a[0]), -(f1 - f0) / (b[0] - a[0]));
  const m0 = slope(keys[Math.max(0, next - 2)], keys[next]);
  const m1 = slope(keys[next - 1], keys[Math.min(keys.length - 1, next + 1)]);
  const [t2, t3] = [t * t, t * t * t];
  const points = mix(v0, v1, 2 * t3 - 3 * t2 + 1, 3 * t2 - 2 * t3);
  return mix(points, mix(m0, m1, t3 - 2 * t2 + t, t3 - t2), 1, 1);
}

// The value with another one at a frame: in a value with keys, a key.
export function withValue(value, frame, now) {
  if (!isKeyed(value)) return now;
  const keys = value.keys.filter((key) => key[0] !== frame);
  keys.push([frame, now]);
  keys.sort((a, b) => a[0] - b[0]);
  return { ...value, keys };
}

export function withKey(value, frame) {
  const keyed = isKeyed(value) ? value : { keys: [], interpolation: "linear" };
  return withValue(keyed, frame, at(value, frame));
}

export function withoutKey(value, frame) {
  if (!isKeyed(value)) return value;
  const keys = value.keys.filter((key) => key[0] !== frame);
  return keys.length ? { ...value, keys } : at(value, frame);
}

// sRGB <-> linear, one component (IEC 61966-2-1).
export const toSrgb = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
export const toLinear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
const hex2 = (v) => Math.round(clamp(v, 0, 1) * 255).toString(16).padStart(2, "0");
export const hexOf = (rgb) => "#" + rgb.map((v) => hex2(toSrgb(clamp(v, 0, 1)))).join("");
export const ofHex = (hex) =>
  [1, 3, 5].map((i) => toLinear(parseInt(hex.slice(i, i + 2), 16) / 255));

// Linear Rec. 709 of a black body, its largest component 1. Source: the chromaticities of Planck's locus by Kim et al. 2002.
export function ofKelvin(kelvin) {
  const t = clamp(kelvin, 1667, 25000);
  const [a, b, c, d] =
    t <= 4000
      ? [-0.2661239e9, -0.2343589e6, 0.8776956e3, 0.17991]
      : [-3.0258469e9, 2.1070379e6, 0.2226347e3, 0.24039];
  const x = a / t ** 3 + b / t ** 2 + c / t + d;
  const [e, f, g, h] =
    t <= 2222
      ? [-1.1063814, -1.3481102, 2.18555832, -0.20219683]
      : t <= 4000
        ? [-0.9549476, -1.37418593, 2.09137015, -0.16748867]
        : [3.081758, -5.8733867, 3.75112997, -0.37001483];
  const y = e * x ** 3 + f * x ** 2 + g * x + h;
  const [X, Z] = [x / y, (1 - x - y) / y];
  const rgb = [
    3.2404542 * X - 1.5371385 - 0.4985314 * Z,
    -0.969266 * X + 1.8760108 + 0.041556 * Z,
    0.0556434 * X - 0.2040259 + 1.0572252 * Z,
  ].map((v) => Math.max(0, v));
  return scale(rgb, 1 / Math.max(...rgb));
}

// The temperature whose colour is most like this one, by the ratio of red to blue.
export function kelvinOf(rgb) {
  const ratio = (c) => (c[0] + 1e-6) / (c[2] + 1e-6);
  let [low, high] = [1667, 25000];
  for (let i = 0; i < 40; i++) {
    const middle = Math.sqrt(low * high);
    if (ratio(ofKelvin(middle)) > ratio(rgb)) low = middle;
    else high = middle;
  }
  return Math.round(low / 10) * 10;
}

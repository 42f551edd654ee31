// What kinds of lights there are: which value is their strength, where they are, what else they have.

import { add, at, isKeyed, scale, sub, unit, withValue } from "./math.js";

const angle = (name, label) => ({ name, label, unit: "°", low: 0, high: 90, step: 0.5 });

export const KINDS = {
  point: { label: "Point lamp", strength: "intensity", unit: "W/sr", place: "position", fields: [] },
  spot: {
    label: "Spot", strength: "intensity", unit: "W/sr", place: "position", aim: "direction",
    fields: [angle("inner_angle_deg", "Inner cone"), angle("outer_angle_deg", "Outer cone")],
  },
  ies: { label: "Measured lamp", strength: "scale", unit: "×", place: "position", fields: [] },
  directional: { label: "Parallel light", strength: "irradiance", unit: "W/m²", aim: "direction", fields: [] },
  rect: { label: "Panel", strength: "radiance", unit: "W/(m² sr)", place: "center", size: true, fields: [] },
  sphere: {
    label: "Globe", strength: "radiance", unit: "W/(m² sr)", place: "center",
    fields: [{ name: "radius", label: "Radius", unit: "m", low: 0.001, high: 1e4, step: 0.01, log: true }],
  },
  environment: {
    label: "Environment map", strength: "scale", unit: "×",
    fields: [{ name: "rotation_deg", label: "Turn", unit: "°", low: -180, high: 180, step: 1, default: 0 }],
  },
  sun_sky: {
    label: "Sun and sky", strength: "scale", unit: "×", aim: "sun_direction", towards: true,
    fields: [{ name: "turbidity", label: "Turbidity", unit: "", title: "Haze of the air: 2 very clear, 10 hazy", low: 2, high: 10, step: 0.1, default: 3 }],
  },
  weather: {
    label: "Weather", strength: "scale", unit: "×",
    fields: [
      { name: "hours", label: "Time", unit: "h", low: 0, high: 24, step: 0.25, default: 12 },
      { name: "rotation_deg", label: "Turn", unit: "°", low: -180, high: 180, step: 1, default: 0 },
    ],
  },
  emissive: { label: "Glowing surfaces", strength: "scale", unit: "×", fields: [] },
};

export const kind = (light) => KINDS[light.type] ?? KINDS.emissive;

// Strength as three components, whatever the file has.
export function strength(light, time) {
  const value = at(light[kind(light).strength] ?? 1, time);
  return Array.isArray(value) ? value : [value, value, value];
}

export function withStrength(light, time, rgb) {
  const name = kind(light).strength;
  const old = light[name] ?? 1;
  // A factor that was one number in some keys is three in all.
  const wide = (v) => (Array.isArray(v) ? v : [v, v, v]);
  const base = isKeyed(old) ? { ...old, keys: old.keys.map(([f, v]) => [f, wide(v)]) } : wide(old);
  return { ...light, [name]: withValue(base, time, rgb) };
}

export const place = (light, time) => {
  const name = kind(light).place;
  return name ? at(light[name], time) : null;
};

export const withPlace = (light, time, xyz) => {
  const name = kind(light).place;
  return name ? { ...light, [name]: withValue(light[name], time, xyz) } : light;
};

export const field = (light, spec, time) => at(light[spec.name] ?? spec.default ?? 0, time);
export const withField = (light, name, time, value, or) => ({
  ...light,
  [name]: withValue(light[name] ?? or ?? value, time, value),
});

// Elevation and azimuth, degrees, of where light comes from; azimuth from +Z towards +X.
export function aim(light, time) {
  const spec = kind(light);
  const d = unit(at(light[spec.aim], time), [0, 1, 0]);
  const from = spec.towards ? d : scale(d, -1);
  return {
    elevation: (Math.asin(Math.max(-1, Math.min(1, from[1]))) * 180) / Math.PI,
    azimuth: (Math.atan2(from[0], from[2]) * 180) / Math.PI,
  };
}

export function withAim(light, time, { elevation, azimuth }) {
  const spec = kind(light);
  // Straight up or down the azimuth would be lost.
  const [e, a] = [(Math.max(-89.9, Math.min(89.9, elevation)) * Math.PI) / 180, (azimuth * Math.PI) / 180];
  const from = [Math.cos(e) * Math.sin(a), Math.sin(e), Math.cos(e) * Math.cos(a)];
  const d = spec.towards ? from : scale(from, -1);
  return { ...light, [spec.aim]: withValue(light[spec.aim], time, d) };
}

// A name that no other light has.
export function freeName(lights, base) {
  const taken = new Set(lights.map((light) => light.name));
  let name = base;
  for (let i = 2; taken.has(name); i++) name = `${base} ${i}`;
  return name;
}

// A new light in front of the camera, about as bright as the scene is large.
export function made(type, lights, eye) {
  const to = sub(eye.look_at, eye.position);
  const where = add(eye.position, scale(to, 0.6));
  const far = Math.hypot(...to);
  const power = Number((0.5 * far * far).toPrecision(2));
  const name = freeName(lights, { point: "lamp", sun_sky: "day", rect: "panel", sphere: "globe" }[type] ?? type);
  const side = Number((0.15 * far).toPrecision(2));
  const body = {
    point: { position: where, intensity: [power, power, power] },
    spot: {
      position: where, direction: [0, -1, 0.0001], inner_angle_deg: 20, outer_angle_deg: 35,
      intensity: [power, power, power],
    },
    directional: { direction: [0.3, -1, 0.2], irradiance: [3, 3, 3] },
    rect: { center: where, edge_u: [side, 0, 0], edge_v: [0, 0, side], radiance: [20, 20, 20] },
    sphere: { center: where, radius: side / 4, radiance: [50, 50, 50] },
    sun_sky: { sun_direction: [0.4, 0.7, 0.5], turbidity: 3, scale: [0.05, 0.05, 0.05] },
  }[type];
  return { name, type, ...body };
}

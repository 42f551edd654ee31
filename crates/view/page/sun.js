// Where the sun stands by date, time and place. Source: Spencer 1971, "Fourier series representation of the position of the sun", as
// relight's weather lights have it: a few hundredths of a degree, no refraction.

import { radians } from "./math.js";

// Days before each month.
const BEFORE = [0, 31, 59, 90, 120, 151, 181, 212, 243, 273, 304, 334];

export const PLACE = { day: "06-21", hours: 12, latitude: 47, longitude: 8, zone: 1, north: 0 };

// Unit vector towards the sun: +Y up; +X east and -Z north, turned by `north` degrees clockwise seen from above.
// day: "MM-DD"; hours of the clock of a zone that many hours ahead of UTC; degrees north and east.
export function sunDirection({ day, hours, latitude, longitude, zone, north }) {
  const [month, date] = day.split("-").map(Number);
  const time = 24 * (BEFORE[month - 1] + Math.min(date, month === 2 ? 28 : 31) - 1) + hours;
  const g = (2 * Math.PI * time) / 8760;
  const { cos, sin } = Math;
  const declination = 0.006918 - 0.399912 * cos(g) + 0.070257 * sin(g) - 0.006758 * cos(2 * g) + 0.000907 * sin(2 * g)
    - 0.002697 * cos(3 * g) + 0.00148 * sin(3 * g);
  // Of the sun's clock before the even one, radians.
  const ahead = 0.000075 + 0.001868 * cos(g) - 0.032077 * sin(g) - 0.014615 * cos(2 * g) - 0.040849 * sin(2 * g);
  const hour = ((hours - 12 - zone) * Math.PI) / 12 + radians(longitude) + ahead;
  const place = radians(latitude);
  const northward = cos(place) * sin(declination) - sin(place) * cos(declination) * cos(hour);
  const east = -cos(declination) * sin(hour);
  const up = sin(place) * sin(declination) + cos(place) * cos(declination) * cos(hour);
  const turn = radians(north);
  return [east * cos(turn) + northward * sin(turn), up, east * sin(turn) - northward * cos(turn)];
}

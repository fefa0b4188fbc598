// Lengths and areas on the organ. Places are parts of the surface, so they move with it; where a
// cut gives it other triangles, a place goes to the triangle that is nearest to it at rest.

import type { Replica, Vec3 } from '../replica';
import type { SurfacePlace } from '../scene';
import { distance } from './course';

export const kMostPlaces = 40;

interface Place {
  at: SurfacePlace;
  rest: Vec3;
  version: number;
}

const mix = (values: ArrayLike<number>, size: number, place: SurfacePlace): Vec3 =>
  [0, 1, 2].map(k =>
    place.corners.reduce(
      (sum, corner, i) => sum + (values[corner * size + k] ?? 0) * (place.shares[i] ?? 0),
      0,
    ),
  ) as Vec3;
const minus = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a: Vec3, b: Vec3): Vec3 => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

export class Measure {
  private places: Place[] = [];
  constructor(private readonly replica: Replica) {}

  get count(): number {
    return this.places.length;
  }
  add(at: SurfacePlace): void {
    if (this.places.length >= kMostPlaces) return;
    const rest = this.replica.rest();
    this.places.push({ at, rest: mix(rest, 4, at), version: this.replica.geometryVersion });
  }
  removeLast(): void {
    this.places.pop();
  }
  clear(): void {
    this.places = [];
  }

  // Where they are in the newest picture, m.
  positions(): Vec3[] {
    const now = this.replica.positions();
    return this.places.map(place => {
      if (place.version !== this.replica.geometryVersion) this.find(place);
      return mix(now, 3, place.at);
    });
  }

  // Goes to the triangle around the vertex that is nearest at rest.
  private find(place: Place): void {
    const rest = this.replica.rest(),
      triangles = this.replica.triangles();
    const at = (i: number): Vec3 => [rest[i * 4] ?? 0, rest[i * 4 + 1] ?? 0, rest[i * 4 + 2] ?? 0];
    let vertex = 0,
      nearest = Infinity;
    for (let i = 0; i * 4 < rest.length; i++) {
      const far = distance(at(i), place.rest);
      if (far < nearest) [vertex, nearest] = [i, far];
    }
    let best: SurfacePlace = { corners: [vertex, vertex, vertex], shares: [1, 0, 0] },
      least = Infinity;
    for (let t = 0; t + 2 < triangles.length; t += 3) {
      const corners: Vec3 = [triangles[t] ?? 0, triangles[t + 1] ?? 0, triangles[t + 2] ?? 0];
      if (!corners.includes(vertex)) continue;
      const candidate = {
        corners,
        shares: sharesIn(place.rest, at(corners[0]), at(corners[1]), at(corners[2])),
      };
      const far = distance(mix(rest, 4, candidate), place.rest);
      if (far < least) [best, least] = [candidate, far];
    }
    place.at = best;
    place.version = this.replica.geometryVersion;
  }
}

// Of the place in a triangle that is near to a point: its shares are cut to the triangle.
function sharesIn(p: Vec3, a: Vec3, b: Vec3, c: Vec3): Vec3 {
  const n = cross(minus(b, a), minus(c, a)),
    whole = n[0] ** 2 + n[1] ** 2 + n[2] ** 2;
  if (whole < 1e-24) return [1, 0, 0];
  const share = (from: Vec3, to: Vec3): number => {
    const part = cross(minus(to, from), minus(p, from));
    return Math.max(0, (part[0] * n[0] + part[1] * n[1] + part[2] * n[2]) / whole);
  };
  const raw: Vec3 = [share(b, c), share(c, a), share(a, b)],
    sum = raw[0] + raw[1] + raw[2];
  return [raw[0] / sum, raw[1] / sum, raw[2] / sum];
}

// Along straight lines from place to place, m.
export const lengthOf = (places: Vec3[]): number =>
  places.slice(1).reduce((sum, p, i) => sum + distance(p, places[i] ?? p), 0);
// Returns the area of the polygon with these corners, m2: that of its shadow on the plane that
// shows it largest.
export function areaOf(places: Vec3[]): number {
  const sum: Vec3 = [0, 0, 0],
    first = places[0];
  if (!first) return 0;
  for (let i = 1; i + 1 < places.length; i++) {
    const part = cross(minus(places[i] ?? first, first), minus(places[i + 1] ?? first, first));
    for (let k = 0; k < 3; k++) sum[k] = (sum[k] ?? 0) + (part[k] ?? 0);
  }
  return Math.hypot(...sum) / 2;
}

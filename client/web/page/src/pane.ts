// One of the views of a picture: a part of the canvas, where it looks from, and whom it follows.

import { PerspectiveCamera, Quaternion, Vector3 } from 'three';
import type { Lens, Replica, Tool } from './replica';

const kSettleSeconds = 0.15;
const kBehind = 0.24,
  kAbove = 0.07; // m from the tip, of a view along a tool
const kNear = 0.02,
  kLensNear = 0.003; // m, where no tissue is nearer

export type ViewCount = 1 | 2 | 4;
// Left, top, width and height as shares of the canvas, from its upper left.
export type Part = readonly [number, number, number, number];

// Two views stand beside each other, or one above the other where the canvas is higher than wide.
export function partsOf(count: ViewCount, isHigh: boolean): Part[] {
  if (count === 1) return [[0, 0, 1, 1]];
  if (count === 2)
    return isHigh
      ? [
          [0, 0, 1, 0.5],
          [0, 0.5, 1, 0.5],
        ]
      : [
          [0, 0, 0.5, 1],
          [0.5, 0, 0.5, 1],
        ];
  return [
    [0, 0, 0.5, 0.5],
    [0.5, 0, 0.5, 0.5],
    [0, 0.5, 0.5, 0.5],
    [0.5, 0.5, 0.5, 0.5],
  ];
}

export class Pane {
  readonly camera = new PerspectiveCamera(32.0, 1, kNear, 6);
  readonly target = new Vector3();
  part: Part = [0, 0, 1, 1];
  follows: number | null = null; // a participant's slot
  isAlong = false; // it looks along that one's tool, instead of keeping its direction
  isFramed = false;
  seesWith: number | null = null; // the slot of a tool, in place of its own camera
  private readonly lensCamera = new PerspectiveCamera(70, 1, kLensNear, 6);
  private lens: Lens | null = null;

  // `yaw` turns a view around the organ, so that several differ; `pitch` is how far from above.
  constructor(
    private readonly yaw: number,
    private readonly pitch: number,
  ) {}

  // The camera that draws.
  get drawn(): PerspectiveCamera {
    return this.lens ? this.lensCamera : this.camera;
  }
  get isEndoscope(): boolean {
    return this.lens?.isEndoscope ?? false;
  }
  // Sees as a lens does; null: from its own place.
  lookThrough(lens: Lens | null): void {
    this.lens = lens;
    if (!lens) return;
    const { lensCamera: c } = this;
    c.position.set(...lens.eye);
    c.up.set(...lens.up);
    c.lookAt(c.position.clone().add(new Vector3(...lens.forward)));
    c.fov = (Math.atan(lens.tanHalfHeight) * 360) / Math.PI;
    c.aspect = this.camera.aspect;
    c.updateProjectionMatrix();
  }

  // Steps back out of tissue, and lets the near plane cut none of it away.
  keepClear(replica: Replica): void {
    const camera = this.drawn,
      forward = camera.getWorldDirection(new Vector3()),
      { x, y, z } = camera.position;
    const [back, nearest] = replica.clearEye(
      [x, y, z],
      [forward.x, forward.y, forward.z],
      this.lens !== null,
    );
    camera.position.addScaledVector(forward, -back);
    const up = Math.tan((camera.fov * Math.PI) / 360),
      usual = this.lens ? kLensNear : kNear,
      near = Math.min(usual, nearest / Math.hypot(1, up, up * camera.aspect));
    if (near === camera.near) return;
    camera.near = near;
    camera.updateProjectionMatrix();
  }

  has(x: number, y: number): boolean {
    const [left, top, width, height] = this.part;
    return x >= left && x < left + width && y >= top && y < top + height;
  }
  // From a place of the canvas to one of this part, both as shares.
  inside(x: number, y: number): [number, number] {
    const [left, top, width, height] = this.part;
    return [(x - left) / width, (y - top) / height];
  }

  frame(centre: Vector3, radius: number): void {
    const distance = ((radius / 0.2867) * 0.9) / Math.min(1, this.camera.aspect * 0.9),
      flat = Math.cos(this.pitch) * distance;
    this.target.copy(centre);
    this.camera.position.set(
      centre.x + Math.sin(this.yaw) * flat,
      centre.y + Math.sin(this.pitch) * distance,
      centre.z + Math.cos(this.yaw) * flat,
    );
    this.isFramed = true;
  }

  follow(tools: Tool[], seconds: number): void {
    const tool = tools.find(t => t.slot >> 1 === this.follows);
    if (!tool) return;
    const share = 1 - Math.exp(-seconds / kSettleSeconds),
      tip = new Vector3(...tool.tip);
    if (!this.isAlong) {
      const step = tip.sub(this.target).multiplyScalar(share);
      this.target.add(step);
      this.camera.position.add(step);
      return;
    }
    const eye = new Vector3(0, 0, kBehind)
      .applyQuaternion(new Quaternion(...tool.orientation))
      .add(tip);
    eye.y += kAbove;
    this.target.lerp(tip, share);
    this.camera.position.lerp(eye, share);
  }

  // Turns the view by so many radians.
  turn(yaw: number, pitch: number): void {
    const offset = this.camera.position.clone().sub(this.target),
      length = offset.length();
    const to = Math.asin(Math.max(-1, Math.min(1, offset.y / length))) + pitch,
      around = Math.atan2(offset.x, offset.z) + yaw;
    const up = Math.max(-1.5, Math.min(1.5, to));
    offset
      .set(Math.sin(around) * Math.cos(up), Math.sin(up), Math.cos(around) * Math.cos(up))
      .multiplyScalar(length);
    this.camera.position.copy(this.target).add(offset);
  }
  zoom(factor: number): void {
    this.camera.position.sub(this.target).multiplyScalar(factor).add(this.target);
  }
}

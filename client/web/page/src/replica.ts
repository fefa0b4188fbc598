// The native client's replica as a WebAssembly module (client/web/wasm): messages go in, arrays to
// draw come out. Views of the module's memory hold until the next call of any function here.

import { numberOf, type MessageName } from './envelope';
import type { Exports } from './exports';

export type Vec3 = [number, number, number];
export const enum Overlay {
  None = 0,
  Regions = 1,
  Holds = 2,
}
export const enum Verb {
  None = 0,
  Push = 1,
  Grasp = 2,
  Cut = 3,
}

export interface Look {
  dark: Float32Array;
  light: Float32Array;
  lines: Float32Array;
  figures: Float32Array;
}

export interface Tool {
  slot: number;
  verb: Verb;
  hasClaim: boolean;
  isSilent: boolean;
  isInside: boolean;
  contactNodes: number;
  tip: Vec3; // m, where the tissue lets it be
  orientation: [number, number, number, number];
  hand: Vec3; // m, where the hand has it
  forceN: Vec3; // the tissue's force on the tool
  torqueNm: Vec3;
  penetrationM: number;
}

// The organ's fine surface, per vertex but for the triangles; `parted`: triangles that a cut has
// parted.
export interface Fine {
  geometryVersion: number; // changes with vertices and triangles
  motionVersion: number; // changes with what moves
  pictureVersion: number; // changes with the picture
  parted: number;
  positions: Float32Array<ArrayBuffer>;
  normals: Float32Array<ArrayBuffer>;
  lips: Int8Array<ArrayBuffer>;
  overlay: Uint8Array<ArrayBuffer>;
  rest: Float32Array<ArrayBuffer>; // x, y, z, rim
  texture: Float32Array<ArrayBuffer>; // u, v
  triangles: Uint32Array<ArrayBuffer>;
}

export interface Pointer {
  participant: number;
  position: Vec3;
} // slot; m

// Lost is what was shed: it lies on the organ, has dripped off, or was sucked off.
export interface Blood {
  shedMl: number;
  onSurfaceMl: number;
  drippedMl: number;
  suckedMl: number;
  mlPerMinute: number;
  openVessels: number;
}

// The view of a person who sees with a tool: metres and unit vectors in the world.
export interface Lens {
  eye: Vec3;
  forward: Vec3;
  up: Vec3;
  tanHalfHeight: number;
  isEndoscope: boolean;
}
// A hand has its tool there, and asks this of it; isDue: the session is to be told.
export interface HandSample {
  isDue: boolean;
  verb: Verb;
  tip: Vec3; // m
  orientation: [number, number, number, number];
}
// How the picture lies in the world: m and unit vectors, and its size in pixels.
export interface Rays {
  eye: Vec3;
  right: Vec3;
  up: Vec3;
  forward: Vec3;
  tanHalfHeight: number;
  width: number;
  height: number;
}
// Mouse and keys do this now.
export interface HandInput {
  x: number; // pixels of the picture
  y: number;
  wheel: number; // notches, away from the person positive
  isOverScene: boolean;
  left: boolean;
  camera: boolean; // the mouse moves the view
  shift: boolean;
  control: boolean;
  push: boolean;
  grasp: boolean;
  cut: boolean;
  deeper: boolean;
  nearer: boolean;
  rollLeft: boolean;
  rollRight: boolean;
}
// What an instrument looks like is made from this.
export interface Shape {
  radiusM: number;
  lengthM: number;
  halfWidthM: number;
  edgeM: number;
  form: number;
}
export interface Mesh {
  positions: Float32Array;
  normals: Float32Array;
  materials: Uint8Array;
}

const kToolFloats = 23,
  kMeshBytes = 28;
const kDiverged = 'the module ended: reload the page';

export class Replica {
  private constructor(private readonly e: Exports) {}

  // `source`: the module's bytes, or the answer that brings them.
  static async load(source: BufferSource | Promise<Response>): Promise<Replica> {
    const wasi = new Proxy(
      {},
      {
        get: (_, name) => () => {
          if (name === 'proc_exit') throw new Error(kDiverged);
          return 52; // there is no such thing here
        },
      },
    );
    const imports = { wasi_snapshot_preview1: wasi as WebAssembly.ModuleImports };
    const { instance } =
      source instanceof Promise
        ? await WebAssembly.instantiateStreaming(source, imports)
        : await WebAssembly.instantiate(source, imports);
    const e = instance.exports as unknown as Exports;
    e._initialize();
    e.restart();
    return new Replica(e);
  }

  restart(): void {
    this.e.restart();
  }
  get memoryBytes(): number {
    return this.e.memory.buffer.byteLength;
  }

  // One Envelope. Throws, with a line for people, if it cannot be right.
  receive(envelope: Uint8Array, nowMs: number): void {
    this.put(envelope);
    if (!this.e.receive(envelope.length, nowMs)) throw new Error(this.error());
  }
  // A message as a recording has it, by the name of its field in Envelope.
  receiveBare(name: MessageName, message: Uint8Array, nowMs: number): void {
    this.put(message);
    if (!this.e.receive_bare(numberOf(name), message.length, nowMs)) throw new Error(this.error());
  }
  // A FineSurface as a recording's organ has it. If it cannot be drawn, fineFault says why.
  receiveFineSurface(message: Uint8Array): void {
    this.put(message);
    this.e.receive_fine_surface(message.length);
  }
  // Envelopes for the server.
  takeOutbox(): Uint8Array[] {
    const size = this.e.outbox_size();
    if (size === 0) return [];
    const all = new Uint8Array(this.e.memory.buffer, this.e.outbox(), size).slice();
    this.e.outbox_clear();
    const view = new DataView(all.buffer),
      out: Uint8Array[] = [];
    for (let at = 0; at < size;) {
      const length = view.getUint32(at, true);
      out.push(all.subarray(at + 4, at + 4 + length));
      at += 4 + length;
    }
    return out;
  }

  get frames(): number {
    return this.e.frames();
  }
  get mismatches(): number {
    return this.e.mismatches();
  }
  get crc(): number {
    return this.e.surface_crc() >>> 0;
  }
  get ownCrc(): number {
    return this.e.own_crc() >>> 0;
  }
  get isInStep(): boolean {
    return this.e.is_in_step() !== 0;
  }
  get newestTick(): number {
    return this.e.newest_tick();
  }
  get newestFrame(): number {
    return this.e.newest_frame();
  }
  get newestServerUs(): number {
    return this.e.newest_server_us();
  }
  get shownTick(): number {
    return this.e.shown_tick();
  }

  // Computes the picture of this moment; false until there is one.
  update(nowMs: number, triangleBudget: number, overlay: Overlay): boolean {
    return this.e.update(nowMs, triangleBudget, overlay) !== 0;
  }
  get geometryVersion(): number {
    return this.e.geometry_version();
  }
  get vertexCount(): number {
    return this.e.vertices();
  }
  positions(): Float32Array {
    return this.floats(this.e.positions_at(), this.e.vertices() * 3);
  }
  normals(): Float32Array {
    return this.floats(this.e.normals_at(), this.e.vertices() * 3);
  }
  // The normals of wounds' rims, elsewhere as normals(), and the cube root of how deep blood
  // stands, of 5.1 mm, in shares of 127.
  lips(): Int8Array {
    return new Int8Array(this.e.memory.buffer, this.e.lips_at(), this.e.vertices() * 4);
  }
  rest(): Float32Array {
    return this.floats(this.e.rest_at(), this.e.vertices() * 4);
  }
  overlay(): Uint8Array {
    return new Uint8Array(this.e.memory.buffer, this.e.overlay_at(), this.e.vertices() * 4);
  }
  triangles(): Uint32Array {
    return new Uint32Array(this.e.memory.buffer, this.e.triangles_at(), this.e.triangles() * 3);
  }

  // Counts the triangles of the outside, which are the first ones.
  get outerTriangles(): number {
    return this.e.outer_triangles();
  }

  // Null: the organ has none, or it is not here yet.
  fine(): Fine | null {
    const { e } = this;
    if (e.fine_is_shown() === 0) return null;
    const n = e.fine_vertices(),
      { buffer } = e.memory as { buffer: ArrayBuffer };
    return {
      geometryVersion: e.fine_geometry_version(),
      motionVersion: e.fine_motion_version(),
      pictureVersion: e.fine_picture_version(),
      parted: e.fine_parted(),
      positions: new Float32Array(buffer, e.fine_positions_at(), n * 3),
      normals: new Float32Array(buffer, e.fine_normals_at(), n * 3),
      lips: new Int8Array(buffer, e.fine_lips_at(), n * 4),
      overlay: new Uint8Array(buffer, e.fine_overlay_at(), n * 4),
      rest: new Float32Array(buffer, e.fine_rest_at(), n * 4),
      texture: new Float32Array(buffer, e.fine_texture_at(), n * 2),
      triangles: new Uint32Array(buffer, e.fine_triangles_at(), e.fine_triangles() * 3),
    };
  }
  // Returns the file of its picture, a PNG or JPEG; null: it has none.
  finePicture(): Uint8Array<ArrayBuffer> | null {
    const bytes = this.e.fine_picture_bytes();
    return bytes === 0
      ? null
      : new Uint8Array(
          this.e.memory.buffer as ArrayBuffer,
          this.e.fine_picture_at(),
          bytes,
        ).slice();
  }
  // One line for people: why the fine surface, or its picture, is not drawn; empty: nothing is
  // wrong.
  get fineFault(): string {
    return this.textAt(this.e.fine_fault());
  }

  tools(): Tool[] {
    const count = this.e.tools(),
      f = this.floats(this.e.tools_at(), count * kToolFloats),
      out: Tool[] = [];
    const at = (i: number): number => f[i] ?? 0,
      three = (i: number): Vec3 => [at(i), at(i + 1), at(i + 2)];
    for (let i = 0; i < f.length; i += kToolFloats)
      out.push({
        slot: at(i),
        verb: at(i + 1),
        hasClaim: at(i + 2) > 0,
        isSilent: at(i + 3) > 0,
        isInside: at(i + 4) > 0,
        contactNodes: at(i + 5),
        tip: three(i + 6),
        orientation: [at(i + 9), at(i + 10), at(i + 11), at(i + 12)],
        hand: three(i + 13),
        forceN: three(i + 16),
        torqueNm: three(i + 19),
        penetrationM: at(i + 22),
      });
    return out;
  }

  // Whether a tool of this participant is held back, or was a moment ago.
  waits(participant: number): boolean {
    return ((this.e.waiting_tools() >>> (2 * participant)) & 3) !== 0;
  }

  // Says how much has bled so far; null: the session does not bleed.
  blood(): Blood | null {
    const at = this.e.blood();
    if (at === 0) return null;
    const [
      shedMl = 0,
      onSurfaceMl = 0,
      drippedMl = 0,
      suckedMl = 0,
      mlPerMinute = 0,
      openVessels = 0,
    ] = new Float64Array(this.e.memory.buffer, at, 6);
    return { shedMl, onSurfaceMl, drippedMl, suckedMl, mlPerMinute, openVessels };
  }

  // Who points where.
  pointers(): Pointer[] {
    const count = this.e.pointers(),
      f = this.floats(this.e.pointers_at(), count * 4);
    return Array.from({ length: count }, (_, i) => ({
      participant: f[i * 4] ?? 0,
      position: [f[i * 4 + 1] ?? 0, f[i * 4 + 2] ?? 0, f[i * 4 + 3] ?? 0],
    }));
  }
  pointerColour(slot: number): number {
    return this.e.pointer_colour(slot) >>> 0;
  }

  // The hand, 0 right and 1 left, has that instrument, and lets go.
  takeInHand(hand: number, shape: Shape & { gripN: number }): void {
    const { radiusM, lengthM, halfWidthM, edgeM, gripN, form } = shape;
    this.e.hand_take(hand, radiusM, lengthM, halfWidthM, edgeM, gripN, form);
  }
  // Mouse and keys move that hand.
  moveHand(hand: number, rays: Rays, input: HandInput, seconds: number): void {
    const { eye, right, up, forward, tanHalfHeight, width, height } = rays,
      { x, y, wheel } = input;
    const flags = [
      input.isOverScene,
      input.left,
      input.camera,
      input.shift,
      input.control,
      input.push,
      input.grasp,
      input.cut,
      input.deeper,
      input.nearer,
      input.rollLeft,
      input.rollRight,
    ].map(Number);
    const all = [...eye, ...right, ...up, ...forward, tanHalfHeight, width, height, x, y, wheel];
    this.floats(this.e.hand_input(), all.length + flags.length).set([...all, ...flags]);
    this.e.hand_switch(hand);
    this.e.hand_update(seconds);
  }
  // Null: the pointer was not over the picture yet.
  handSample(hand: number, nowMs: number): HandSample | null {
    const at = this.e.hand_sample(hand, nowMs);
    if (at === 0) return null;
    const [isDue = 0, verb = 0, x = 0, y = 0, z = 0, qx = 0, qy = 0, qz = 0, qw = 1] = this.floats(
      at,
      9,
    );
    return { isDue: isDue > 0, verb, tip: [x, y, z], orientation: [qx, qy, qz, qw] };
  }
  // Returns the point that a lesson's hands follow; null: there is none.
  lessonTarget(): Vec3 | null {
    const at = this.e.lesson_target();
    if (at === 0) return null;
    const [x = 0, y = 0, z = 0] = this.floats(at, 3);
    return [x, y, z];
  }
  // All that is drawn on the organ.
  drawing(): Mesh {
    return this.mesh(this.e.drawing_at());
  }
  // Surgical thread, and the pegs that stand there.
  threads(): Mesh {
    return this.mesh(this.e.threads_at());
  }
  // How the server is told of a place on the organ; null: there is none yet.
  attach(place: Vec3): { triangle: number; weights: [number, number] } | null {
    const at = this.e.attach(...place);
    if (at === 0) return null;
    const [triangle = 0, b = 0, c = 0] = this.floats(at, 3);
    return { triangle, weights: [b, c] };
  }

  // The jaw moves about a line along x, `hinge` from the tip; null: nothing moves.
  makeTool(shape: Shape, colour: number): { body: Mesh; jaw: Mesh | null; hinge: number } {
    const body = this.mesh(
      this.e.make_tool(
        shape.radiusM,
        shape.lengthM,
        shape.halfWidthM,
        shape.edgeM,
        shape.form,
        colour,
      ),
    );
    const jaw = this.mesh(this.e.jaw());
    return { body, jaw: jaw.materials.length > 0 ? jaw : null, hinge: this.e.hinge() };
  }
  // How far each jaw is opened, rad, and how many seconds it takes to get there.
  jawMotion(form: number, verb: number, hasClaim: boolean): { opening: number; seconds: number } {
    return {
      opening: this.e.jaw_opening(form, verb, hasClaim),
      seconds: this.e.jaw_seconds(form, verb, hasClaim),
    };
  }
  // How somebody sees with the tool in that slot.
  lens(slot: number, shape: Shape): Lens {
    const f = this.floats(this.e.lens(slot, shape.radiusM, shape.form), 11),
      at = (i: number): number => f[i] ?? 0;
    return {
      eye: [at(0), at(1), at(2)],
      forward: [at(3), at(4), at(5)],
      up: [at(6), at(7), at(8)],
      tanHalfHeight: at(9),
      isEndoscope: at(10) > 0,
    };
  }
  // By how much an eye has to step back out of tissue, m, and how far tissue is then at least.
  // `forward` is of unit length.
  clearEye(eye: Vec3, [x, y, z]: Vec3, isLens: boolean): [number, number] {
    const at = this.e.clear_eye(...eye, Math.atan2(x, z), Math.asin(y), isLens),
      [back = 0, nearest = 0] = this.floats(at, 2);
    return [back, nearest];
  }
  // Returns how the organ looks, outside or where it is cut: colours of its parts in the troughs of
  // its pattern, on its heights, of lines on it; and figures.
  look(isInside: boolean): Look {
    const f = this.floats(this.e.look(isInside), 32).slice();
    return {
      dark: f.subarray(0, 12),
      light: f.subarray(12, 24),
      lines: f.subarray(24, 28),
      figures: f.subarray(28, 32),
    };
  }
  makeArrow(lengthM: number, radiusM: number, colour: number): Mesh {
    return this.mesh(this.e.make_arrow(lengthM, radiusM, colour));
  }
  // From a tool to the hand, along +z.
  makeHandLine(lengthM: number, colour: number): Mesh {
    return this.mesh(this.e.make_hand_line(lengthM, colour));
  }
  // 0xrrggbb, of a participant.
  slotColour(slot: number): number {
    return this.e.slot_colour(slot) >>> 0;
  }
  // The relief of tissue, or the lobules of cut tissue.
  pattern(size: number, isInside: boolean): Uint8Array {
    // First the call: memory that grows takes its views away.
    const at = isInside ? this.e.lobules(size) : this.e.noise(size);
    return new Uint8Array(this.e.memory.buffer, at, size ** 3 * 4).slice();
  }

  private floats(at: number, count: number): Float32Array {
    return new Float32Array(this.e.memory.buffer, at, count);
  }
  private put(data: Uint8Array): void {
    const at = this.e.input(data.length);
    if (at === 0) throw new Error(`a message of ${data.length} bytes is larger than any may be`);
    new Uint8Array(this.e.memory.buffer, at, data.length).set(data);
  }
  private error(): string {
    return this.textAt(this.e.error());
  }
  private textAt(at: number): string {
    const bytes = new Uint8Array(this.e.memory.buffer);
    return new TextDecoder().decode(bytes.slice(at, bytes.indexOf(0, at)));
  }
  private mesh(at: number): Mesh {
    const count = this.e.mesh_vertices(),
      view = new DataView(this.e.memory.buffer, at, count * kMeshBytes);
    const out: Mesh = {
      positions: new Float32Array(count * 3),
      normals: new Float32Array(count * 3),
      materials: new Uint8Array(count * 4),
    };
    for (let i = 0; i < count; i++)
      for (let k = 0; k < 3; k++) {
        out.positions[i * 3 + k] = view.getFloat32(i * kMeshBytes + k * 4, true);
        out.normals[i * 3 + k] = view.getFloat32(i * kMeshBytes + 12 + k * 4, true);
      }
    for (let i = 0; i < count; i++)
      for (let k = 0; k < 4; k++) out.materials[i * 4 + k] = view.getUint8(i * kMeshBytes + 24 + k);
    return out;
  }
}

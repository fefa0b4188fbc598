// The hands of a person who holds instruments: mouse, touch and keys move one of them over the first
// view, by the rules of the native window, which the module brings (client/web/wasm/page_hand.h).
//
//   left button, one finger   what the instrument is for      wheel, W and S   deeper, nearer
//   F, Space, X               push, grasp, cut                Q and E          turn it
//   Tab over the picture, G   the other hand                  1 to 9           another instrument
//   I, J, K, L                up, left, down, right, for whoever has no mouse; Shift: a quarter
//   a gamepad                 all of it: gamepad.ts
//
// Samples leave as often as the window's, also while nothing is drawn. A page that is hidden lets go
// of everything, and says so: its browser would soon call it too rarely to hold anything.

import { create } from '@bufbuild/protobuf';
import { Pad, type PadState } from './gamepad';
import { instruments } from './gen/instruments';
import { ToolShapeSchema, type Participant, type ToolShape } from './gen/proto/wire_pb';
import type { KeyLine } from './keys';
import { Verb, type HandInput, type HandSample, type Replica, type Tool } from './replica';
import type { Picture } from './scene';
import type { Session } from './session';

export type Instrument = (typeof instruments)[number];
export const kFirst = ['grasper', 'scalpel']; // names, of the right hand and the left
const kSampleMs = 8,
  kWheelPixels = 100, // a notch
  kMostSeconds = 0.1, // between two moves: a page that stood still does not jump
  kStepPixels = 160, // a second
  kPadPixels = 400, // a second, of a stick that is fully aside
  kPadNotches = 12, // of the wheel a second
  kPadTurn = 1.2, // rad/s, of the view
  kPadRoll = 0.2, // of a stick, from which it turns the instrument
  kComesMs = 300; // a tip that was elsewhere comes to where a finger, or a first click, is

const indexOf = (name: string): number => instruments.findIndex(one => one.name === name);
const shapeOf = (one: Instrument): ToolShape => create(ToolShapeSchema, one);
// Two shapes are the same if this is, after they were floats on the wire.
const keyOf = (shape: ToolShape): string =>
  [
    shape.radiusM,
    shape.lengthM,
    shape.reachM,
    shape.halfWidthM ?? 0,
    shape.friction ?? 0.2,
    shape.gripN ?? 8,
    shape.edgeM ?? 0.02,
    shape.form,
  ]
    .map(Math.fround)
    .join();

interface Hand {
  instrument: number; // of the table; -1: none of it
  shape: Instrument | ToolShape;
  asked: string[]; // keys of shapes that the list of people has not had yet
  listed: string;
  sample: HandSample | null; // where it is now
}

const kKeys: Record<string, keyof HandInput> = {
  f: 'push',
  ' ': 'grasp',
  x: 'cut',
  w: 'deeper',
  s: 'nearer',
  q: 'rollLeft',
  e: 'rollRight',
};
// For the list of keys.
export const handKeys: KeyLine[] = [
  { keys: 'F, Space, X', does: 'push, grasp, cut' },
  { keys: 'W, S', does: 'deeper, nearer' },
  { keys: 'Q, E', does: 'turn the instrument' },
  { keys: 'G; Tab over the picture', does: 'the other hand' },
  { keys: '1 to 9', does: 'another instrument' },
  { keys: 'I, J, K, L', does: 'move it without a mouse; with Shift in small steps' },
  { keys: 'Gamepad: left stick', does: 'move it' },
  { keys: 'Gamepad: right stick', does: 'deeper, nearer; turn it' },
  { keys: 'Gamepad: right trigger', does: 'use it: hold, cut or push' },
  { keys: 'Gamepad: left trigger, A, B', does: 'push, grasp, cut' },
  { keys: 'Gamepad: right bumper, left bumper', does: 'the other hand, the next instrument' },
  { keys: 'Gamepad: cross', does: 'turn the view' },
];
const kSteps: Record<string, readonly [number, number]> = {
  i: [0, -1],
  j: [-1, 0],
  k: [0, 1],
  l: [1, 0],
};
const types = (target: EventTarget | null): boolean =>
  target instanceof HTMLElement && target.closest('input, textarea, select, button, a') !== null;

export class Hands {
  moved = 0;
  hasLetGo = false; // the page was hidden since the person last did something
  private readonly hands: Hand[] = kFirst.map(name => ({
    instrument: indexOf(name),
    shape: instruments[indexOf(name)]!,
    asked: [],
    listed: '',
    sample: null,
  }));
  private own: number | null = null; // slot of the participant
  private readonly input: HandInput = {
    x: 0,
    y: 0,
    wheel: 0,
    isOverScene: false,
    left: false,
    camera: false,
    shift: false,
    control: false,
    push: false,
    grasp: false,
    cut: false,
    deeper: false,
    nearer: false,
    rollLeft: false,
    rollRight: false,
  };
  private usesFromMs: number | null = null; // from then on what is pressed counts
  private readonly steps = new Set<string>(); // keys of kSteps that are held
  private readonly fingers = new Set<number>();
  readonly pad = new Pad();
  private timer = 0;
  private lastMs = 0;
  private canvas: HTMLCanvasElement | null = null;
  private readonly ended = new AbortController();

  constructor(
    private readonly replica: Replica,
    private readonly session: Session,
    private readonly picture: Picture,
    private readonly onChange: () => void,
  ) {
    this.hands.forEach((hand, i) => this.hold(i, hand.shape));
    picture.holdsTools = true;
    picture.asHeld = tools => this.asHeld(tools);
    this.listen(picture.canvas);
    this.timer = window.setInterval(() => this.move(), kSampleMs);
  }
  dispose(): void {
    this.ended.abort();
    window.clearInterval(this.timer);
    this.picture.holdsTools = false;
    this.picture.asHeld = tools => tools;
  }

  get count(): number {
    return this.hands.length;
  }
  chosen(hand: number): number {
    return this.hands[hand]?.instrument ?? -1;
  }
  // The hand that moves takes that instrument of the table.
  take(instrument: number): void {
    const hand = this.hands[this.moved],
      one = instruments[instrument];
    if (!hand || !one || hand.instrument === instrument) return;
    hand.instrument = instrument;
    hand.asked.push(keyOf(shapeOf(one)));
    this.hold(this.moved, one);
    this.session.change(this.moved, shapeOf(one));
    this.onChange();
  }
  switchHand(): void {
    this.moved = (this.moved + 1) % this.hands.length;
    this.onChange();
  }
  // A hand that was given another instrument has it from then on. Those that it has asked for itself
  // appear in the list later, in the same order.
  heed(own: number | null, people: Participant[]): void {
    this.own = own;
    const tools = people.find(p => p.slot === own)?.tool ?? [];
    this.hands.forEach((hand, i) => {
      const shape = tools[i];
      if (!shape) return;
      const key = keyOf(shape),
        isNew = hand.listed !== '' && hand.listed !== key;
      hand.listed = key;
      if (!isNew) return;
      const asked = hand.asked.indexOf(key);
      if (asked >= 0) {
        hand.asked.splice(0, asked + 1);
        return;
      }
      hand.asked = [];
      hand.instrument = instruments.findIndex(one => keyOf(shapeOf(one)) === key);
      this.hold(i, shape);
    });
  }

  private hold(hand: number, shape: Instrument | ToolShape): void {
    const { radiusM, lengthM, form } = shape;
    this.hands[hand]!.shape = shape;
    this.replica.takeInHand(hand, {
      radiusM,
      lengthM,
      halfWidthM: shape.halfWidthM ?? 0,
      edgeM: shape.edgeM ?? 0.02,
      gripN: shape.gripN ?? 8,
      form,
    });
  }

  // One's own tool is drawn where the hand has it now; where tissue keeps it, as the session says.
  private asHeld(tools: Tool[]): Tool[] {
    return tools.map(tool => {
      const sample = tool.slot >> 1 === this.own ? this.hands[tool.slot & 1]?.sample : null;
      if (!sample) return tool;
      const hand = sample.tip;
      if (tool.contactNodes > 0 || (tool.hasClaim && tool.verb === Verb.Grasp))
        return { ...tool, hand };
      return { ...tool, hand, tip: sample.tip, orientation: sample.orientation };
    });
  }

  private move(): void {
    const now = performance.now(),
      seconds = Math.min(kMostSeconds, (now - this.lastMs) / 1000);
    this.lastMs = now;
    if (this.session.state !== 'live' || this.replica.frames === 0 || document.hidden) return;
    this.step(seconds);
    this.input.left = this.usesFromMs !== null && now >= this.usesFromMs;
    const pad = document.hasFocus() ? this.pad.read(now) : null,
      input = pad ? this.withPad(pad, seconds) : this.input;
    this.replica.moveHand(this.moved, this.picture.rays().rays, input, seconds);
    this.input.wheel = 0;
    this.hands.forEach((hand, i) => {
      hand.sample = this.replica.handSample(i, now);
      if (hand.sample?.isDue) this.session.sample(i, hand.sample);
    });
    if (this.pad.name === '') return;
    const own = this.replica.tools().find(tool => tool.slot === (this.own ?? -1) * 2 + this.moved);
    this.pad.feel(own ? Math.hypot(...own.forceN) : 0, now);
  }
  // The pad's share is added to that of mouse and keys.
  private withPad(pad: PadState, seconds: number): HandInput {
    const { input } = this;
    this.hasLetGo = false;
    for (const button of pad.began) {
      if (button === 'otherHand') this.switchHand();
      else this.take((this.chosen(this.moved) + 1) % instruments.length);
    }
    this.shift(pad.right * kPadPixels * seconds, pad.down * kPadPixels * seconds);
    if (pad.yaw !== 0 || pad.pitch !== 0)
      this.picture.turn(-pad.yaw * kPadTurn * seconds, pad.pitch * kPadTurn * seconds);
    return {
      ...input,
      wheel: input.wheel + pad.deeper * kPadNotches * seconds,
      left: input.left || pad.use,
      push: input.push || pad.push,
      grasp: input.grasp || pad.grasp,
      cut: input.cut || pad.cut,
      rollLeft: input.rollLeft || pad.roll < -kPadRoll,
      rollRight: input.rollRight || pad.roll > kPadRoll,
    };
  }
  // Keys move the pointer.
  private step(seconds: number): void {
    if (this.steps.size === 0) return;
    const way = kStepPixels * seconds * (this.input.shift ? 0.25 : 1);
    for (const key of this.steps) {
      const [right, down] = kSteps[key] ?? [0, 0];
      this.shift(right * way, down * way);
    }
  }
  // Moves the pointer by pixels, from the middle at first.
  private shift(right: number, down: number): void {
    const { input } = this,
      { width, height } = this.picture.rays().rays;
    if (!input.isOverScene && !this.hands[this.moved]?.sample)
      Object.assign(input, { x: width / 2, y: height / 2 });
    input.x = Math.max(0, Math.min(width - 1, input.x + right));
    input.y = Math.max(0, Math.min(height - 1, input.y + down));
    input.isOverScene = true;
  }
  // While a button is held, for fingers, which have no wheel: 1 deeper, -1 nearer, 0 neither.
  goDeeper(way: number): void {
    this.input.deeper = way > 0;
    this.input.nearer = way < 0;
  }
  private letGo(): void {
    this.usesFromMs = null;
    Object.assign(this.input, { camera: false, isOverScene: false });
    for (const key of Object.values(kKeys)) Object.assign(this.input, { [key]: false });
    this.fingers.clear();
    this.steps.clear();
    this.hands.forEach((hand, i) => {
      this.hold(i, hand.shape);
      if (hand.sample) this.session.sample(i, { ...hand.sample, verb: Verb.None });
    });
    this.hasLetGo = true;
    this.onChange();
  }

  private listen(canvas: HTMLCanvasElement): void {
    this.canvas = canvas;
    const { signal } = this.ended;
    const on = (kind: string, does: (event: PointerEvent) => void): void =>
      canvas.addEventListener(kind, event => does(event as PointerEvent), { signal });
    on('pointerdown', event => this.press(event));
    on('pointermove', event => this.follow(event));
    for (const kind of ['pointerup', 'pointercancel']) on(kind, event => this.lift(event));
    on('pointerleave', () => {
      this.input.isOverScene = false;
    });
    on('contextmenu', event => event.preventDefault());
    canvas.addEventListener('wheel', event => this.roll(event), { signal, passive: false });
    // Before the picture's own keys.
    const first = { signal, capture: true };
    window.addEventListener('keydown', event => this.key(event, true), first);
    window.addEventListener('keyup', event => this.key(event, false), first);
    // Whatever is held elsewhere, nobody hears that it was let go.
    window.addEventListener('blur', () => this.letGo(), { signal });
    document.addEventListener('visibilitychange', () => document.hidden && this.letGo(), {
      signal,
    });
  }
  private follow(event: PointerEvent): void {
    const rect = (event.currentTarget as HTMLElement).getBoundingClientRect(),
      { part } = this.picture.rays();
    this.input.x = event.clientX - rect.left - part[0] * rect.width;
    this.input.y = event.clientY - rect.top - part[1] * rect.height;
    this.input.isOverScene =
      this.input.x < part[2] * rect.width && this.input.y < part[3] * rect.height;
    this.input.shift = event.shiftKey;
    this.input.control = event.ctrlKey;
  }
  private press(event: PointerEvent): void {
    this.follow(event);
    this.hasLetGo = false;
    this.canvas?.focus({ preventScroll: true });
    const now = performance.now();
    if (event.pointerType === 'touch') {
      this.fingers.add(event.pointerId);
      this.usesFromMs = this.fingers.size === 1 ? now + kComesMs : null;
      this.input.camera = this.fingers.size > 1;
    } else {
      if (event.button === 0)
        this.usesFromMs = this.hands[this.moved]?.sample ? now : now + kComesMs;
      this.input.camera = (event.buttons & 6) !== 0;
    }
    this.canvas?.setPointerCapture(event.pointerId);
  }
  private lift(event: PointerEvent): void {
    this.fingers.delete(event.pointerId);
    if (event.pointerType === 'touch' || (event.buttons & 1) === 0) this.usesFromMs = null;
    this.input.camera =
      event.pointerType === 'touch' ? this.fingers.size > 0 : (event.buttons & 6) !== 0;
    if (event.pointerType === 'touch' && this.fingers.size === 0) this.input.isOverScene = false;
  }
  private roll(event: WheelEvent): void {
    event.preventDefault();
    if (event.ctrlKey) this.picture.zoom(event.deltaY > 0 ? 1 / 0.9 : 0.9);
    else this.input.wheel -= event.deltaY / kWheelPixels;
  }
  // Keys count wherever the focus is, unless something there takes them.
  private key(event: KeyboardEvent, isDown: boolean): void {
    this.input.shift = event.shiftKey;
    this.input.control = event.ctrlKey;
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key,
      held = kKeys[name];
    if (held !== undefined && !isDown) Object.assign(this.input, { [held]: false });
    if (!isDown) this.steps.delete(name);
    if (event.ctrlKey || event.metaKey || event.altKey || types(event.target)) return;
    const isTab = name === 'Tab' && this.input.isOverScene && !event.shiftKey;
    const digit = /^[1-9]$/.test(name) ? Number(name) : 0;
    if (held !== undefined) Object.assign(this.input, { [held]: isDown });
    else if (name in kSteps) isDown && this.steps.add(name);
    else if (!(isTab || name === 'g' || digit > 0)) return;
    event.preventDefault();
    event.stopPropagation();
    if (!isDown || event.repeat) return;
    this.hasLetGo = false;
    if (isTab || name === 'g') this.switchHand();
    else if (digit > 0) this.take(digit - 1);
  }
}

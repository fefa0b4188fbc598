// A gamepad as one hand, by the browser's Gamepad API, in its standard mapping:
//
//   left stick      moves the instrument over the picture    right trigger   what it is for
//   right stick     deeper, nearer; turns it                  left trigger    push
//   A, B            grasp, cut                                cross           turns the view
//   right bumper    the other hand                            left bumper     the next instrument
//
// A stick says a speed. There are no forces: the pad's motors rumble with their size instead, as with
// the native client (client/device/gamepad_device.h).

const kDeadZone = 0.12,
  kPressed = 0.3, // of a trigger
  kFullRumbleN = 2,
  kRumbleMs = 200,
  kRenewMs = 100,
  kChangeMs = 40,
  kStep = 0.05, // of strength, which a hand can tell apart
  kLookMs = 1000; // between two looks for a pad

export type PadButton = 'otherHand' | 'nextInstrument';
// Sticks are -1 to 1, and the view's turn is in steps.
export interface PadState {
  right: number;
  down: number;
  deeper: number;
  roll: number;
  yaw: number;
  pitch: number;
  use: boolean;
  push: boolean;
  grasp: boolean;
  cut: boolean;
  began: PadButton[]; // pressed since the last state
}

// Slow near the middle, so that a hand can be fine.
const share = (value: number | undefined): number => {
  const size = Math.min(1, Math.max(0, (Math.abs(value ?? 0) - kDeadZone) / (1 - kDeadZone)));
  return Math.sign(value ?? 0) * size * size;
};

export class Pad {
  name = ''; // of the pad; empty: there is none
  private pad: Gamepad | null = null;
  private lookedMs = -kLookMs;
  private readonly held = new Set<PadButton>();
  private strength = 0;
  private rumbledMs = 0;

  // Null: there is no pad, or it does nothing now.
  read(nowMs: number): PadState | null {
    if (this.pad === null && nowMs - this.lookedMs < kLookMs) return null;
    this.lookedMs = nowMs;
    this.pad =
      navigator.getGamepads().find(one => one?.connected && one.mapping === 'standard') ?? null;
    this.name = this.pad?.id ?? '';
    if (this.pad === null) return null;
    const { axes, buttons } = this.pad,
      value = (i: number): number => buttons[i]?.value ?? 0,
      isDown = (i: number): boolean => value(i) > kPressed;
    const began: PadButton[] = [];
    for (const [button, i] of [
      ['otherHand', 5],
      ['nextInstrument', 4],
    ] as const) {
      if (isDown(i) && !this.held.has(button)) began.push(button);
      if (isDown(i)) this.held.add(button);
      else this.held.delete(button);
    }
    const state = {
      right: share(axes[0]),
      down: share(axes[1]),
      roll: share(axes[2]),
      deeper: -share(axes[3]),
      yaw: value(15) - value(14),
      pitch: value(12) - value(13),
      use: isDown(7),
      push: isDown(6),
      grasp: isDown(0),
      cut: isDown(1),
      began,
    };
    const isIdle = Object.values(state).every(one => one === 0 || one === false || one === began);
    return isIdle && began.length === 0 ? null : state;
  }

  // Rumbles with the size of a force.
  feel(newton: number, nowMs: number): void {
    const motor = this.pad?.vibrationActuator;
    if (!motor) return;
    const wanted = Math.round(Math.min(1, newton / kFullRumbleN) / kStep) * kStep,
      sinceMs = nowMs - this.rumbledMs;
    const isChanged = wanted !== this.strength && (wanted === 0 || sinceMs >= kChangeMs);
    if (!isChanged && !(wanted > 0 && sinceMs >= kRenewMs)) return;
    this.strength = wanted;
    this.rumbledMs = nowMs;
    const effect = { duration: kRumbleMs, strongMagnitude: wanted, weakMagnitude: wanted };
    // A pad that was pulled out rumbles no more, which is no fault.
    motor.playEffect('dual-rumble', effect).catch(() => undefined);
  }
}

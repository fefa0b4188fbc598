// The timeline with what happened on it, and the controls of the clock.

import type { JSX } from 'preact';
import type { KeyLine } from '../keys';
import { kSpeeds } from '../player';
import type { RecordedEvent } from '../recording';
import { clock } from '../stage';
import type { Bookmark } from './marks';

const kMostMarks = 600,
  kStep = 2000,
  kFrame = 16; // ticks
export type Range = [number, number]; // ticks

// What the controls move.
export interface Clock {
  readonly tick: number;
  readonly isPlaying: boolean;
  readonly speed: number;
  readonly range: Range | null;
  readonly first: number;
  readonly last: number;
  seek(tick: number): void;
  toggle(): void;
  setSpeed(speed: number): void;
  setRange(range: Range | null): void;
}

// The start and the end of what is played again and again; each may be set first.
export function withStart(clock: Clock, tick: number): Range {
  return [tick, clock.range && clock.range[1] > tick ? clock.range[1] : clock.last];
}
export function withEnd(clock: Clock, tick: number): Range {
  return [clock.range && clock.range[0] < tick ? clock.range[0] : clock.first, tick];
}

export const kClockKeys: KeyLine[] = [
  { keys: 'Space, K', does: 'play, pause' },
  { keys: '←, →', does: '2 s back, forward; also J and ;' },
  { keys: ', .', does: 'a frame back, forward' },
  { keys: 'Home, End', does: 'to the start, to the end' },
  { keys: '<, >', does: 'slower, faster' },
  { keys: 'I, O, X', does: 'loop start, loop end, no loop' },
];

// What keys do. Returns false for others.
export function keyActs(clock: Clock, key: string): boolean {
  const faster = (by: number): void =>
    clock.setSpeed(
      kSpeeds[Math.max(0, Math.min(kSpeeds.length - 1, kSpeeds.indexOf(clock.speed) + by))] ?? 1,
    );
  const acts: Record<string, () => void> = {
    k: clock.toggle,
    ',': () => clock.seek(clock.tick - kFrame),
    '.': () => clock.seek(clock.tick + kFrame),
    j: () => clock.seek(clock.tick - kStep),
    ';': () => clock.seek(clock.tick + kStep),
    Home: () => clock.seek(clock.first),
    End: () => clock.seek(clock.last),
    '<': () => faster(-1),
    '>': () => faster(1),
    i: () => clock.setRange(withStart(clock, clock.tick)),
    o: () => clock.setRange(withEnd(clock, clock.tick)),
    x: () => clock.setRange(null),
    ' ': clock.toggle,
    ArrowLeft: () => clock.seek(clock.tick - kStep),
    ArrowRight: () => clock.seek(clock.tick + kStep),
  };
  acts[key]?.();
  return acts[key] !== undefined;
}

export function Timeline(props: {
  clock: Clock;
  events: RecordedEvent[];
  marks: Bookmark[];
}): JSX.Element {
  const { clock: c } = props,
    length = Math.max(1, c.last - c.first);
  const at = (el: HTMLElement | null, from: number, to = from): void => {
    if (!el) return;
    el.style.left = `${((from - c.first) / length) * 100}%`;
    if (to > from) el.style.width = `${((to - from) / length) * 100}%`;
  };
  return (
    <div class="timeline">
      <div class="marks" aria-hidden="true">
        {c.range && (
          <i key="range" class="range" ref={el => at(el, c.range?.[0] ?? 0, c.range?.[1] ?? 0)} />
        )}
        {props.events.slice(0, kMostMarks).map((event, i) => (
          <i key={i} class={event.kind} ref={el => at(el, event.tick)} />
        ))}
        {props.marks.map(mark => (
          <i
            key={`${mark.tick} ${mark.name}`}
            class="bookmark"
            title={mark.name}
            ref={el => at(el, mark.tick)}
          />
        ))}
      </div>
      <input
        type="range"
        min={c.first}
        max={c.last}
        step={kFrame}
        value={c.tick}
        aria-label="Time"
        aria-valuetext={clock(c.tick / 1000)}
        onInput={event => c.seek(Number(event.currentTarget.value))}
      />
    </div>
  );
}

export function Controls(props: { clock: Clock }): JSX.Element {
  const { clock: c } = props;
  return (
    <div class="controls">
      <button class="main" onClick={c.toggle} title="Play, pause (space bar)">
        {c.isPlaying ? 'Pause' : 'Play'}
      </button>
      <button onClick={() => c.seek(c.tick - kStep)} title="Back (left arrow)">
        Back 2 s
      </button>
      <button onClick={() => c.seek(c.tick + kStep)} title="Forward (right arrow)">
        Forward 2 s
      </button>
      <label class="choice">
        Speed
        <select
          value={String(c.speed)}
          onChange={event => c.setSpeed(Number(event.currentTarget.value))}
        >
          {kSpeeds.map(speed => (
            <option key={speed} value={String(speed)}>
              {speed}×
            </option>
          ))}
        </select>
      </label>
      <span class="loop" role="group" aria-label="Loop">
        <button onClick={() => c.setRange(withStart(c, c.tick))} title="The loop begins here (I)">
          Loop start
        </button>
        <button onClick={() => c.setRange(withEnd(c, c.tick))} title="The loop ends here (O)">
          Loop end
        </button>
        {c.range && (
          <button onClick={() => c.setRange(null)} title="Loop no more (X)">
            Loop {clock(c.range[0] / 1000)} to {clock(c.range[1] / 1000)} ×
          </button>
        )}
      </span>
      <span class="time">
        {clock(c.tick / 1000)} / {clock(c.last / 1000)}
      </span>
    </div>
  );
}

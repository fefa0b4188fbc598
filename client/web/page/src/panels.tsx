// Lists beside the picture: who is here and does what, what happened, forces over time.

import type { ComponentChildren, JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import { Role, type Participant } from './gen/proto/wire_pb';
import type { Forces } from './forces';
import { kDashes, Plot } from './plot';
import type { RecordedEvent } from './recording';
import type { Tool } from './replica';
import { clock, doing, forceOf, newtons } from './stage';

const kRoles: Record<number, string> = {
  [Role.SURGEON]: 'surgeon',
  [Role.ASSISTANT]: 'assistant',
  [Role.INSTRUCTOR]: 'instructor',
  [Role.OBSERVER]: 'observer',
};
export const hex = (colour: number): string => `#${colour.toString(16).padStart(6, '0')}`;

export function People(props: {
  people: Participant[];
  tools: Tool[];
  own: number | null;
  colourOf(slot: number): number;
  follows: number | null;
  onFollow(slot: number | null): void;
  waits?(slot: number): boolean;
  extra?: (person: Participant) => ComponentChildren;
}): JSX.Element {
  return (
    <section aria-labelledby="people">
      <h2 id="people">
        People <small>{props.people.length}</small>
      </h2>
      <ul class="people">
        {props.people.map(p => {
          const tools = props.tools.filter(t => t.slot >> 1 === p.slot),
            newton = tools.reduce((sum, t) => sum + forceOf(t), 0);
          const has = p.tool.length > 0,
            state = p.isAway
              ? 'connection lost'
              : p.frozenBy !== ''
                ? `held still by ${p.frozenBy}`
                : p.lentTools !== 0
                  ? 'was handed an instrument'
                  : has && props.waits?.(p.slot)
                    ? 'is held back: moves too fast'
                    : has
                      ? doing(tools, p.tool)
                      : 'watches';
          return (
            <li key={p.slot} class={p.isAway ? 'away' : ''}>
              <span
                class={has ? 'dot' : 'dot none'}
                ref={el => el?.style.setProperty('--own', hex(props.colourOf(p.slot)))}
                aria-hidden="true"
              />
              <span class="who">
                <b>{p.name}</b>
                {props.own === p.slot && ' (you)'}
                <small>{kRoles[p.role] ?? 'unknown role'}</small>
              </span>
              <span class="does">{state}</span>
              {has && <span class="force">{newtons(newton)}</span>}
              {has && (
                <button
                  aria-pressed={props.follows === p.slot}
                  onClick={() => props.onFollow(props.follows === p.slot ? null : p.slot)}
                  aria-label={`Follow ${p.name}`}
                >
                  Follow
                </button>
              )}
              {props.extra?.(p)}
            </li>
          );
        })}
        {props.people.length === 0 && <li class="none">Nobody yet.</li>}
      </ul>
    </section>
  );
}

export function Events(props: {
  events: RecordedEvent[];
  now: number;
  onSeek?: (tick: number) => void;
  empty: string;
}): JSX.Element {
  const list = useRef<HTMLOListElement>(null),
    count = props.events.length;
  useEffect(() => {
    const el = list.current;
    if (el && !props.onSeek) el.scrollTop = el.scrollHeight;
  }, [count]);
  return (
    <section class="grow" aria-labelledby="events">
      <h2 id="events">Events</h2>
      <ol
        class="events"
        ref={list}
        aria-live={props.onSeek ? 'off' : 'polite'}
        tabIndex={0}
        aria-label="Events"
      >
        {props.events.slice(-400).map((event, i) => (
          <li key={i} class={`${event.kind}${event.tick > props.now ? ' later' : ''}`}>
            {props.onSeek ? (
              <button onClick={() => props.onSeek?.(event.tick)}>
                <time>{clock(event.tick / 1000)}</time> {event.text}
              </button>
            ) : (
              <>
                <time>{clock(event.tick / 1000)}</time> {event.text}
              </>
            )}
          </li>
        ))}
        {count === 0 && <li class="none">{props.empty}</li>}
      </ol>
    </section>
  );
}

interface PlotProps {
  forces: Forces;
  from: number; // ticks
  to: number;
  now: number; // tick of the picture
  nameOf(slot: number): string;
  colourOf(slot: number): number;
  onSeek?: (tick: number) => void;
  height: number;
}

// Forces over time; a click goes there.
export function ForcePlot(props: PlotProps): JSX.Element {
  const { forces } = props,
    [seconds, ...values] = forces.columns(props.from, props.to, 600);
  const series = forces.slots.map((slot, i) => ({
    name: props.nameOf(slot),
    colour: hex(props.colourOf(slot)),
    dash: kDashes[i % kDashes.length] ?? [],
    values: values[i] ?? [],
  }));
  return (
    <Plot
      data={{ seconds, series, unit: 'N', what: 'Force', version: forces.version }}
      now={props.now}
      height={props.height}
      onSeek={props.onSeek}
    />
  );
}

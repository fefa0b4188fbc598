// Lists beside the picture: who is here and does what, what happened, forces over time.

import type { ComponentChildren, JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import uPlot from 'uplot';
import { Role, type Participant } from './gen/proto/wire_pb';
import type { Forces } from './forces';
import type { RecordedEvent } from './recording';
import type { Tool } from './replica';
import { clock, doing, forceOf, newtons } from './stage';

const kRoles: Record<number, string> = { [Role.SURGEON]: 'surgeon', [Role.ASSISTANT]: 'assistant', [Role.INSTRUCTOR]: 'instructor', [Role.OBSERVER]: 'observer' };
export const hex = (colour: number): string => `#${colour.toString(16).padStart(6, '0')}`;
// Lines differ by more than colour.
const kDashes: number[][] = [[], [8, 4], [2, 3], [10, 3, 2, 3]];

export function People(props: { people: Participant[]; tools: Tool[]; own: number | null; colourOf(slot: number): number; follows: number | null; onFollow(slot: number | null): void; extra?: (person: Participant) => ComponentChildren }): JSX.Element {
  return (
    <section aria-labelledby="people">
      <h2 id="people">People <small>{props.people.length}</small></h2>
      <ul class="people">
        {props.people.map(p => {
          const tools = props.tools.filter(t => t.slot >> 1 === p.slot), newton = tools.reduce((sum, t) => sum + forceOf(t), 0);
          const has = p.tool.length > 0, state = p.isAway ? 'connection lost' : p.frozenBy !== '' ? `held still by ${p.frozenBy}` : has ? doing(tools) : 'watches';
          return (
            <li key={p.slot} class={p.isAway ? 'away' : ''}>
              <span class={has ? 'dot' : 'dot none'} ref={el => el?.style.setProperty('--own', hex(props.colourOf(p.slot)))} aria-hidden="true" />
              <span class="who"><b>{p.name}</b>{props.own === p.slot && ' (you)'}<small>{kRoles[p.role] ?? 'unknown role'}</small></span>
              <span class="does">{state}</span>
              {has && <span class="force">{newtons(newton)}</span>}
              {has && <button aria-pressed={props.follows === p.slot} onClick={() => props.onFollow(props.follows === p.slot ? null : p.slot)} aria-label={`Follow ${p.name}`}>Follow</button>}
              {props.extra?.(p)}
            </li>
          );
        })}
        {props.people.length === 0 && <li class="none">Nobody yet.</li>}
      </ul>
    </section>
  );
}

export function Events(props: { events: RecordedEvent[]; now: number; onSeek?: (tick: number) => void; empty: string }): JSX.Element {
  const list = useRef<HTMLOListElement>(null), count = props.events.length;
  useEffect(() => {
    const el = list.current;
    if (el && !props.onSeek) el.scrollTop = el.scrollHeight;
  }, [count]);
  return (
    <section class="grow" aria-labelledby="events">
      <h2 id="events">Events</h2>
      <ol class="events" ref={list} aria-live={props.onSeek ? 'off' : 'polite'} tabIndex={0} aria-label="Events">
        {props.events.slice(-400).map((event, i) => (
          <li key={i} class={`${event.kind}${event.tick > props.now ? ' later' : ''}`}>
            {props.onSeek
              ? <button onClick={() => props.onSeek?.(event.tick)}><time>{clock(event.tick / 1000)}</time> {event.text}</button>
              : <><time>{clock(event.tick / 1000)}</time> {event.text}</>}
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
  const box = useRef<HTMLDivElement>(null), plot = useRef<uPlot | null>(null), latest = useRef(props), drawn = useRef('');
  latest.current = props;
  useEffect(() => {
    const size = new ResizeObserver(() => plot.current?.setSize({ width: box.current?.clientWidth ?? 300, height: props.height }));
    if (box.current) size.observe(box.current);
    return () => {
      size.disconnect();
      plot.current?.destroy();
    };
  }, []);
  useEffect(() => {
    const { forces, from, to, nameOf, colourOf, height } = props, slots = forces.slots, text = getComputedStyle(document.documentElement).getPropertyValue('--text').trim();
    const series = slots.map(slot => nameOf(slot)).join('|') + text;
    const data = forces.columns(from, to, 600) as unknown as uPlot.AlignedData;
    if (drawn.current !== series || !plot.current) {
      plot.current?.destroy();
      const axis: uPlot.Axis = { stroke: text, grid: { stroke: 'rgba(128,128,128,0.25)', width: 1 }, ticks: { show: false }, font: '12px system-ui', size: 34 };
      plot.current = new uPlot({
        width: box.current?.clientWidth ?? 300, height, legend: { show: false }, padding: [8, 8, 0, 0],
        cursor: { drag: { x: false, y: false }, points: { show: false } },
        scales: { x: { time: false }, y: { range: (_u, _min, max) => [0, Math.max(0.5, (max ?? 0) * 1.1)] } },
        axes: [{ ...axis, values: (_u, ticks) => ticks.map(s => clock(s).replace(/\.0$/, '')) }, { ...axis, values: (_u, ticks) => ticks.map(n => `${n} N`), size: 46 }],
        series: [{}, ...slots.map((slot, i) => ({ label: nameOf(slot), stroke: hex(colourOf(slot)), width: 1.5, dash: kDashes[(i >> 1) % kDashes.length] ?? [], points: { show: false }, spanGaps: true }))],
        hooks: { draw: [u => line(u, latest.current.now / 1000, text)] },
      }, data, box.current!);
      drawn.current = series;
      const over = plot.current.over;
      over.addEventListener('click', event => {
        const seconds = plot.current?.posToVal(event.clientX - over.getBoundingClientRect().left, 'x');
        if (seconds !== undefined) latest.current.onSeek?.(seconds * 1000);
      });
    } else {
      plot.current.setData(data);
    }
  }, [props.forces.version, props.from, props.to, Math.floor(props.now / 50)]);
  const greatest = props.forces.slots.map(slot => `${props.nameOf(slot)} ${newtons(props.forces.greatest(slot))}`).join(', ');
  return <div class="plot" ref={box} role="img" aria-label={`Forces over time. Greatest: ${greatest || 'none yet'}.`} />;
}

function line(u: uPlot, seconds: number, colour: string): void {
  const x = u.valToPos(seconds, 'x', true);
  if (x < u.bbox.left || x > u.bbox.left + u.bbox.width) return;
  u.ctx.save();
  u.ctx.strokeStyle = colour;
  u.ctx.lineWidth = 1.5;
  u.ctx.beginPath();
  u.ctx.moveTo(x, u.bbox.top);
  u.ctx.lineTo(x, u.bbox.top + u.bbox.height);
  u.ctx.stroke();
  u.ctx.restore();
}

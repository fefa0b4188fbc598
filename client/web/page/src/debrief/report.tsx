// A report of a recording for paper: events, plots, and pictures of its bookmarks.

import type { JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import { useEscape } from '../keys';
import type { RecordedEvent } from '../recording';
import type { PlotData } from '../plot';
import { clock } from '../stage';

export interface Shot {
  title: string;
  tick: number;
  url: string;
} // a picture as a data URL
export interface ReportContent {
  name: string;
  organ: string;
  startMs: number;
  lastTick: number;
  people: string[];
  events: RecordedEvent[];
  plots: PlotData[];
  shots: Shot[];
}

export const kMostShots = 24;
const kMostRows = 400,
  kWidth = 680,
  kHeight = 150,
  kLeft = 64,
  kBottom = 20,
  kTop = 8;

// Lines on white paper; dashes tell them apart without colour.
function Lines(props: { data: PlotData }): JSX.Element {
  const { seconds, series, unit, what } = props.data,
    from = seconds[0] ?? 0,
    to = Math.max(from + 1, seconds.at(-1) ?? 0);
  const most =
    series.reduce((top, s) => s.values.reduce<number>((a, v) => Math.max(a, v ?? 0), top), 0) || 1;
  const x = (s: number): number => kLeft + ((s - from) / (to - from)) * (kWidth - kLeft - 8),
    y = (v: number): number => kHeight - kBottom - (v / most) * (kHeight - kBottom - kTop);
  const points = (values: (number | null)[]): string =>
    values
      .map((v, i) => (v === null ? '' : `${x(seconds[i] ?? 0).toFixed(1)},${y(v).toFixed(1)}`))
      .join(' ');
  return (
    <figure>
      <figcaption>
        {what}, {unit}
      </figcaption>
      <svg viewBox={`0 0 ${kWidth} ${kHeight}`} role="img" aria-label={`${what} over time`}>
        {[0, 0.5, 1].map(part => (
          <g key={part}>
            <line
              x1={kLeft}
              x2={kWidth - 8}
              y1={y(most * part)}
              y2={y(most * part)}
              stroke="#bbb"
            />
            <text x={kLeft - 6} y={y(most * part) + 4} text-anchor="end" font-size="11">
              {(most * part).toFixed(most < 10 ? 2 : 0)}
            </text>
            <text
              x={x(from + (to - from) * part)}
              y={kHeight - 4}
              text-anchor={part === 0 ? 'start' : part === 1 ? 'end' : 'middle'}
              font-size="11"
            >
              {clock(from + (to - from) * part)}
            </text>
          </g>
        ))}
        {series.map((s, i) => (
          <polyline
            key={i}
            points={points(s.values)}
            fill="none"
            stroke={s.colour}
            stroke-width="1.5"
            stroke-dasharray={s.dash.join(' ')}
          />
        ))}
      </svg>
      <p class="legend">
        {series.map((s, i) => (
          <span key={i}>
            <svg width="36" height="8" aria-hidden="true">
              <line
                x1="0"
                x2="36"
                y1="4"
                y2="4"
                stroke={s.colour}
                stroke-width="2"
                stroke-dasharray={s.dash.join(' ')}
              />
            </svg>{' '}
            {s.name}
          </span>
        ))}
      </p>
    </figure>
  );
}

export function Report(props: { content: ReportContent; onClose(): void }): JSX.Element {
  const { content: c } = props,
    box = useRef<HTMLDivElement>(null);
  useEffect(() => box.current?.focus(), []);
  useEscape(true, props.onClose);
  return (
    <div
      class="report"
      role="dialog"
      aria-label="Report"
      tabIndex={-1}
      ref={box}
      onKeyDown={event => {
        if (event.key !== 'Escape') event.stopPropagation();
      }}
    >
      <p class="row screen">
        <button class="main" onClick={() => window.print()}>
          Print
        </button>
        <button onClick={props.onClose}>Back</button>
      </p>
      <h1>{c.name}</h1>
      <p>
        {new Date(c.startMs).toLocaleString()}
        {`, ${clock(c.lastTick / 1000)} long, organ: ${c.organ}. `}
        {c.people.length > 0 && `With tools: ${c.people.join(', ')}.`}
      </p>
      {c.shots.length > 0 && <h2>Bookmarks</h2>}
      <div class="shots">
        {c.shots.map((shot, i) => (
          <figure key={i}>
            <img src={shot.url} alt={`The picture at ${clock(shot.tick / 1000)}`} />
            <figcaption>
              {clock(shot.tick / 1000)} {shot.title}
            </figcaption>
          </figure>
        ))}
      </div>
      <h2>Over time</h2>
      {c.plots.map(data => (
        <Lines key={data.what} data={data} />
      ))}
      <h2>Events</h2>
      <table>
        <thead>
          <tr>
            <th>time</th>
            <th>event</th>
          </tr>
        </thead>
        <tbody>
          {c.events.slice(0, kMostRows).map((event, i) => (
            <tr key={i}>
              <td>{clock(event.tick / 1000)}</td>
              <td>{event.text}</td>
            </tr>
          ))}
        </tbody>
      </table>
      {c.events.length > kMostRows && (
        <p>{c.events.length - kMostRows} more events are in the table that Take along saves.</p>
      )}
    </div>
  );
}

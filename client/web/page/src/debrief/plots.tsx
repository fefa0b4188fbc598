// What tools did over the time of a recording: force, speed and way of their tips, and what they
// held.

import type { JSX } from 'preact';
import { useMemo, useState } from 'preact/hooks';
import { kDashes, Plot, type PlotData } from '../plot';
import { Verb } from '../replica';
import { clock } from '../stage';
import type { Course, Hold, Quantity } from './course';
import type { Range } from './transport';

const kRows = 600,
  kMostHolds = 600,
  kHeight = 110;
const kUnits: Record<Quantity, string> = { force: 'N', speed: 'mm/s', path: 'mm' };
export const kQuantities: Record<Quantity, string> = {
  force: 'Force',
  speed: 'Speed of the tip',
  path: 'Way of the tip',
};
const kChoices = {
  force: 'Force, N',
  speed: 'Speed of the tip, mm/s',
  path: 'Way of the tip, mm',
  holds: 'Who holds what',
};

// Names and colours of tools, by their slots.
export interface ToolGuide {
  nameOf(tool: number): string;
  colourOf(tool: number): string;
}

export function courseData(
  course: Course,
  what: Quantity,
  from: number,
  to: number,
  guide: ToolGuide,
): PlotData {
  const [seconds, ...values] = course.columns(what, from, to, kRows);
  const series = course.slots.map((tool, i) => ({
    name: guide.nameOf(tool),
    colour: guide.colourOf(tool),
    dash: kDashes[i % kDashes.length] ?? [],
    values: values[i] ?? [],
  }));
  return { seconds, series, unit: kUnits[what], what: kQuantities[what], version: course.version };
}

export function Plots(props: {
  course: Course;
  from: number;
  to: number;
  now: number;
  range: Range | null;
  guide: ToolGuide;
  onSeek(tick: number): void;
}): JSX.Element {
  const { course, from, to, guide } = props,
    [shown, setShown] = useState<keyof typeof kChoices>('force');
  const names = course.slots.map(tool => guide.nameOf(tool)).join();
  const data = useMemo(
    () => (shown === 'holds' ? null : courseData(course, shown, from, to, guide)),
    [course.version, shown, names],
  );
  const holds = useMemo(() => (shown === 'holds' ? course.holds() : []), [course.version, shown]);
  return (
    <div class="plots">
      <label class="choice">
        Over time
        <select
          value={shown}
          onChange={event => setShown(event.currentTarget.value as keyof typeof kChoices)}
        >
          {Object.entries(kChoices).map(([key, text]) => (
            <option key={key} value={key}>
              {text}
            </option>
          ))}
        </select>
      </label>
      {data ? (
        <Plot
          data={data}
          now={props.now}
          range={props.range}
          height={kHeight}
          onSeek={props.onSeek}
        />
      ) : (
        <Holds
          holds={holds}
          tools={course.slots}
          from={from}
          to={to}
          now={props.now}
          guide={guide}
          onSeek={props.onSeek}
        />
      )}
    </div>
  );
}

const kVerbs: Record<number, string> = {
  [Verb.Push]: 'pushes',
  [Verb.Grasp]: 'holds',
  [Verb.Cut]: 'cuts',
};

// A row for each tool: bars where its claim on tissue was in effect.
function Holds(props: {
  holds: Hold[];
  tools: number[];
  from: number;
  to: number;
  now: number;
  guide: ToolGuide;
  onSeek(tick: number): void;
}): JSX.Element {
  const length = Math.max(1, props.to - props.from),
    share = (tick: number): string => `${((tick - props.from) / length) * 100}%`;
  const said = (hold: Hold): string =>
    `${props.guide.nameOf(hold.tool)} ${kVerbs[hold.verb] ?? 'touches'}, ` +
    `${clock(hold.from / 1000)} to ${clock(hold.to / 1000)}`;
  return (
    <div class="holds" role="list" aria-label="Who held what">
      {props.tools.map(tool => (
        <div class="hold" role="listitem" key={tool}>
          <span class="who">{props.guide.nameOf(tool)}</span>
          <span class="bars">
            {props.holds
              .filter(h => h.tool === tool)
              .slice(0, kMostHolds)
              .map(hold => (
                <button
                  key={`${hold.from}`}
                  class={`verb${hold.verb}`}
                  title={said(hold)}
                  aria-label={said(hold)}
                  onClick={() => props.onSeek(hold.from)}
                  ref={el => {
                    if (!el) return;
                    el.style.left = share(hold.from);
                    el.style.width = share(Math.min(hold.to, props.to) - hold.from + props.from);
                    el.style.setProperty('--own', props.guide.colourOf(tool));
                  }}
                />
              ))}
            <i
              ref={el => {
                if (el) el.style.left = share(props.now);
              }}
            />
          </span>
        </div>
      ))}
      {props.tools.length === 0 && <p class="none">Nobody had a tool yet.</p>}
    </div>
  );
}

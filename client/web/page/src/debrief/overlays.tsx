// Measure, and ways of tool tips: what is drawn on the picture besides.

import type { JSX } from 'preact';
import { kMostPlaces } from './measure';

export type MeasureKind = 'off' | 'distance' | 'area';
export const kWhole = 0; // seconds of a way: all of it
const kSeconds = [5, 15, 60, kWhole];

export function MeasurePanel(props: {
  kind: MeasureKind;
  count: number;
  said: string;
  onKind(kind: MeasureKind): void;
  onUndo(): void;
  onClear(): void;
}): JSX.Element {
  const { kind, count } = props;
  const switchTo = (to: MeasureKind): void => props.onKind(kind === to ? 'off' : to);
  return (
    <section aria-labelledby="measure" class="measure">
      <h2 id="measure">Measure</h2>
      <div class="row">
        <button aria-pressed={kind === 'distance'} onClick={() => switchTo('distance')}>
          Distance
        </button>
        <button aria-pressed={kind === 'area'} onClick={() => switchTo('area')}>
          Area
        </button>
        {kind !== 'off' && (
          <button disabled={count === 0} onClick={props.onUndo}>
            Remove the last
          </button>
        )}
        {kind !== 'off' && (
          <button disabled={count === 0} onClick={props.onClear}>
            Clear
          </button>
        )}
      </div>
      <p role="status">{kind === 'off' ? '' : props.said}</p>
      {kind !== 'off' && count < kMostPlaces && (
        <p class="hint">
          Click points on the organ. With keys: turn the organ, and Enter takes the point in the
          middle of the picture.
        </p>
      )}
    </section>
  );
}

export function PathsPanel(props: {
  isShown: boolean;
  seconds: number;
  onShow(isShown: boolean): void;
  onSeconds(seconds: number): void;
}): JSX.Element {
  return (
    <section aria-labelledby="paths">
      <h2 id="paths">Tip paths</h2>
      <div class="row">
        <button aria-pressed={props.isShown} onClick={() => props.onShow(!props.isShown)}>
          Show
        </button>
        <label class="choice">
          of
          <select
            value={String(props.seconds)}
            onChange={event => props.onSeconds(Number(event.currentTarget.value))}
          >
            {kSeconds.map(s => (
              <option key={s} value={String(s)}>
                {s === kWhole ? 'all of it' : `the last ${s} s`}
              </option>
            ))}
          </select>
        </label>
      </div>
    </section>
  );
}

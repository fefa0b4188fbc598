// A plot over time: lines of values, a line where the picture is. A click goes there.

import type { JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import uPlot from 'uplot';
import { clock } from './stage';
import { useTheme } from './theme';

export interface Series {
  name: string;
  colour: string;
  dash: number[];
  values: (number | null)[];
}
export interface PlotData {
  seconds: number[];
  series: Series[];
  unit: string;
  what: string;
  version: number;
}

// Lines differ by more than colour.
export const kDashes: number[][] = [[], [8, 4], [2, 3], [10, 3, 2, 3]];

const format = (value: number, unit: string): string =>
  `${value.toFixed(unit === 'N' && value < 10 ? 2 : value < 100 ? 1 : 0)} ${unit}`;

export function Plot(props: {
  data: PlotData;
  now: number;
  range?: [number, number] | null;
  height: number;
  onSeek?: ((tick: number) => void) | undefined;
}): JSX.Element {
  const box = useRef<HTMLDivElement>(null),
    plot = useRef<uPlot | null>(null),
    latest = useRef(props),
    drawn = useRef('');
  latest.current = props;
  const { data } = props,
    theme = useTheme();
  useEffect(() => {
    const size = new ResizeObserver(() =>
      plot.current?.setSize({
        width: box.current?.clientWidth ?? 300,
        height: latest.current.height,
      }),
    );
    if (box.current) size.observe(box.current);
    return () => {
      size.disconnect();
      plot.current?.destroy();
    };
  }, []);
  useEffect(() => {
    const text = getComputedStyle(document.documentElement).getPropertyValue('--text').trim();
    const look = JSON.stringify([data.series.map(s => [s.name, s.colour]), data.unit, text]),
      columns = [data.seconds, ...data.series.map(s => s.values)] as unknown as uPlot.AlignedData;
    if (drawn.current === look && plot.current) return plot.current.setData(columns);
    plot.current?.destroy();
    const axis: uPlot.Axis = {
      stroke: text,
      grid: { stroke: 'rgba(128,128,128,0.25)', width: 1 },
      ticks: { show: false },
      font: '12px system-ui',
      size: 34,
    };
    const made = new uPlot(
      {
        width: box.current?.clientWidth ?? 300,
        height: props.height,
        legend: { show: false },
        padding: [8, 8, 0, 0],
        cursor: { drag: { x: false, y: false }, points: { show: false } },
        scales: {
          x: { time: false },
          y: {
            range: (_u, _min, max) => [0, Math.max(data.unit === 'N' ? 0.5 : 5, (max ?? 0) * 1.1)],
          },
        },
        axes: [
          { ...axis, values: (_u, ticks) => ticks.map(s => clock(s).replace(/\.0$/, '')) },
          {
            ...axis,
            values: (_u, ticks) => ticks.map(n => (data.unit === 'N' ? `${n} N` : String(n))),
            size: 46,
          },
        ],
        series: [
          {},
          ...data.series.map(s => ({
            label: s.name,
            stroke: s.colour,
            width: 1.5,
            dash: s.dash,
            points: { show: false },
            spanGaps: true,
          })),
        ],
        hooks: {
          drawClear: [u => band(u, latest.current.range ?? null)],
          draw: [u => line(u, latest.current.now / 1000, text)],
        },
      },
      columns,
      box.current!,
    );
    made.over.addEventListener('click', event => {
      const seconds = made.posToVal(event.clientX - made.over.getBoundingClientRect().left, 'x');
      if (Number.isFinite(seconds)) latest.current.onSeek?.(seconds * 1000);
    });
    plot.current = made;
    drawn.current = look;
  }, [data.version, data.what, data.seconds.length, data.seconds[0], data.series.length, theme]);
  useEffect(() => plot.current?.redraw(false), [Math.floor(props.now / 50), props.range]);
  const greatest = data.series
    .map(
      s =>
        `${s.name} ${format(
          s.values.reduce<number>((top, v) => Math.max(top, v ?? 0), 0),
          data.unit,
        )}`,
    )
    .join(', ');
  return (
    <div
      class="plot"
      ref={box}
      role="img"
      aria-label={`${data.what} over time. Greatest: ${greatest || 'none yet'}.`}
    />
  );
}

function line(u: uPlot, seconds: number, colour: string): void {
  const x = u.valToPos(seconds, 'x', true);
  if (x < u.bbox.left || x > u.bbox.left + u.bbox.width) return;
  u.ctx.save();
  u.ctx.strokeStyle = colour;
  u.ctx.lineWidth = 1.5;
  u.ctx.setLineDash([]);
  u.ctx.beginPath();
  u.ctx.moveTo(x, u.bbox.top);
  u.ctx.lineTo(x, u.bbox.top + u.bbox.height);
  u.ctx.stroke();
  u.ctx.restore();
}
function band(u: uPlot, range: [number, number] | null): void {
  if (!range) return;
  const [from, to] = range.map(tick => u.valToPos(tick / 1000, 'x', true)) as [number, number];
  u.ctx.save();
  u.ctx.fillStyle = 'rgb(108 196 255 / 0.14)';
  u.ctx.fillRect(from, u.bbox.top, to - from, u.bbox.height);
  u.ctx.restore();
}

// What is drawn on the picture besides: ways of tool tips, and distances and areas that a person
// measures.

import type { JSX } from 'preact';
import { useRef, useState } from 'preact/hooks';
import { useEscape } from '../keys';
import type { Replica } from '../replica';
import type { Picture } from '../scene';
import type { Course } from './course';
import { areaOf, lengthOf, Measure } from './measure';
import { MeasurePanel, PathsPanel, kWhole, type MeasureKind } from './overlays';
import type { ToolGuide } from './plots';
import { sketch, type Line } from './sketch';

const kMostTrace = 2000,
  kOwn = '#ffe36e',
  kDash = [6, 4];

export interface Overlays {
  lines(): Line[];
  draw(picture: Picture): void; // on the canvas over the picture
  onPlace: ((x: number, y: number) => void) | undefined; // a click takes a place
  panels: JSX.Element;
  canvas: JSX.Element;
}

// `now`: the tick of the picture. `from`: where the recording begins.
export function useOverlays(
  replica: Replica,
  course: Course,
  picture: () => Picture | null,
  guide: ToolGuide,
  from: number,
  now: () => number,
): Overlays {
  const [kind, setKind] = useState<MeasureKind>('off'),
    [, redraw] = useState(0),
    [hasPaths, setHasPaths] = useState(false),
    [seconds, setSeconds] = useState(15);
  const measure = useRef(new Measure(replica)),
    over = useRef<HTMLCanvasElement>(null);
  const choose = (to: MeasureKind): void => {
    if (to === 'off') measure.current.clear();
    setKind(to);
  };
  useEscape(kind !== 'off', () => choose('off'));
  const said = (): string => {
    const places = measure.current.positions();
    if (kind === 'distance')
      return places.length < 2 ? '' : `${(lengthOf(places) * 1e3).toFixed(1)} mm`;
    return kind === 'off' || places.length < 3 ? '' : `${(areaOf(places) * 1e6).toFixed(0)} mm²`;
  };
  const lines = (): Line[] => {
    const out: Line[] = [],
      tick = now();
    if (hasPaths)
      for (const tool of course.slots)
        out.push({
          places: course.trace(
            tool,
            seconds === kWhole ? from : tick - seconds * 1000,
            tick,
            kMostTrace,
          ),
          colour: guide.colourOf(tool),
          dash: (tool & 1) === 1 ? kDash : [],
        });
    if (kind !== 'off' && measure.current.count > 0)
      out.push({
        places: measure.current.positions(),
        colour: kOwn,
        dash: [],
        isClosed: kind === 'area',
        hasDots: true,
        text: said(),
      });
    return out;
  };
  const change = (act: () => void): void => {
    act();
    redraw(n => n + 1);
  };
  return {
    lines,
    draw(drawn) {
      const canvas = over.current,
        to = canvas?.getContext('2d');
      if (!canvas || !to) return;
      const ratio = Math.min(2, window.devicePixelRatio || 1),
        width = Math.round(canvas.clientWidth * ratio),
        height = Math.round(canvas.clientHeight * ratio);
      if (canvas.width !== width || canvas.height !== height)
        [canvas.width, canvas.height] = [width, height];
      to.clearRect(0, 0, width, height);
      sketch(to, drawn, lines(), ratio);
    },
    onPlace:
      kind === 'off'
        ? undefined
        : (x, y) => {
            const place = picture()?.pickSurface(x, y);
            if (place) change(() => measure.current.add(place));
          },
    canvas: <canvas class="sketch" ref={over} aria-hidden="true" />,
    panels: (
      <>
        <MeasurePanel
          kind={kind}
          count={measure.current.count}
          said={said()}
          onKind={choose}
          onUndo={() => change(() => measure.current.removeLast())}
          onClear={() => change(() => measure.current.clear())}
        />
        <PathsPanel
          isShown={hasPaths}
          seconds={seconds}
          onShow={setHasPaths}
          onSeconds={setSeconds}
        />
      </>
    ),
  };
}

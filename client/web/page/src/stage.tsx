// The picture with what lies on it: labels, overlays, keys and buttons of the view.

import { useEffect, useRef, useState } from 'preact/hooks';
import type { ComponentChildren, JSX } from 'preact';
import { ToolForm, ToolShapeSchema, type Participant, type ToolShape } from './gen/proto/wire_pb';
import { create } from '@bufbuild/protobuf';
import { Overlay, Verb, type Replica, type Shape, type Tool, type Vec3 } from './replica';
import type { Part, ViewCount } from './pane';
import type { Guide } from './instruments';
import { Picture } from './scene';
import { KeysHelp, useEscape, useKeys, type KeyLine } from './keys';
import { PaneChoices } from './views';

export function forceOf(tool: Tool): number {
  return Math.hypot(...tool.forceN);
}
export const newtons = (n: number): string => `${n.toFixed(n < 10 ? 2 : 1)} N`;
export const clock = (seconds: number): string =>
  `${Math.floor(seconds / 60)}:${(seconds % 60).toFixed(1).padStart(4, '0')}`;

const kClickPixels = 5;
const kLeastForViews = 480; // pixels: on a phone there is one view
const kPlain: ToolShape = create(ToolShapeSchema, { radiusM: 0.005, lengthM: 0.3 });

// Answers the picture about people, from the newest list of them.
export function guideOf(people: () => Participant[], colourOf: (slot: number) => number): Guide {
  const owner = (slot: number): Participant | undefined => people().find(p => p.slot === slot >> 1);
  return {
    shapeOf(slot): Shape {
      const shape = owner(slot)?.tool[slot & 1] ?? kPlain;
      return {
        radiusM: shape.radiusM,
        lengthM: shape.lengthM,
        halfWidthM: shape.halfWidthM ?? 0,
        edgeM: shape.edgeM ?? 0.02,
        form: shape.form,
      };
    },
    labelOf(tool) {
      const name = owner(tool.slot)?.name ?? `hand ${(tool.slot >> 1) + 1}`,
        newton = forceOf(tool);
      return {
        text: newton >= 0.05 ? `${name}  ${newtons(newton)}` : name,
        colour: colourOf(tool.slot >> 1),
      };
    },
    pointerLabel(participant) {
      return `${people().find(p => p.slot === participant)?.name ?? 'somebody'} points here`;
    },
  };
}

// `shapes`: of the person's tools, by number.
export function doing(tools: Tool[], shapes: Participant['tool']): string {
  const tool = tools.find(t => t.verb !== Verb.None) ?? tools[0];
  if (!tool) return '';
  if (tool.isSilent) return 'silent';
  if (tool.isInside) return 'inside tissue';
  const form = shapes[tool.slot & 1]?.form,
    pushes =
      form === ToolForm.SUCTION ? 'sucks' : form === ToolForm.COAGULATOR ? 'seals' : 'pushes';
  const what =
    { [Verb.None]: '', [Verb.Push]: pushes, [Verb.Grasp]: 'grasps', [Verb.Cut]: 'cuts' }[
      tool.verb
    ] ?? '';
  if (what === '') return tool.contactNodes > 0 ? 'touches' : 'free';
  return tool.hasClaim
    ? tool.verb === Verb.Grasp
      ? 'holds'
      : what
    : tool.verb === Verb.Grasp
      ? 'wants to grasp'
      : what;
}

// Who lends a view: in a session an endoscope, in a recording any tool.
export interface Lender {
  slot: number;
  text: string;
}
export function lendersOf(people: Participant[], tools: Tool[], isRecording: boolean): Lender[] {
  return tools.flatMap(({ slot }) => {
    const owner = people.find(p => p.slot === slot >> 1),
      form = owner?.tool[slot & 1]?.form,
      second = (slot & 1) === 1 ? ', left hand' : '';
    const isEndoscope = form === ToolForm.ENDOSCOPE || form === ToolForm.ENDOSCOPE_30;
    if (!owner || !(isEndoscope || isRecording)) return [];
    const degrees = form === ToolForm.ENDOSCOPE ? 0 : 30;
    const what = isEndoscope ? `the ${degrees}° endoscope` : 'the tool';
    return [{ slot, text: `${what} of ${owner.name}${second}` }];
  });
}

interface StageProps {
  replica: Replica;
  guide: Guide;
  isOld: boolean; // the picture is not of now
  isRecording?: boolean;
  isSecond?: boolean; // of two: keys are its own only while it has the focus
  moreKeys?: KeyLine[]; // of what is around it, for the list of keys
  follows: number | null;
  people: Participant[];
  onFollow(slot: number | null): void;
  onPicture(nowMs: number): void; // before each picture
  onDrawn?: (picture: Picture) => void; // while its pixels are there
  // Where this person clicks, as a share of the canvas from its upper left; then a click takes a
  // place.
  onPlace?: ((x: number, y: number) => void) | undefined;
  onReady(picture: Picture): void;
  // Where this person points, if the role may; null: nowhere any more.
  onPoint?: (place: Vec3 | null) => void;
  tools?: ComponentChildren; // more buttons of the view
  keys?: KeyLine[]; // of the person's hands, which come before the picture's
  children?: ComponentChildren;
}

export function Stage(props: StageProps): JSX.Element {
  const canvas = useRef<HTMLCanvasElement>(null),
    labels = useRef<HTMLDivElement>(null),
    box = useRef<HTMLDivElement>(null);
  const picture = useRef<Picture | null>(null),
    latest = useRef(props);
  const [overlay, setOverlay] = useState(Overlay.Holds),
    [arrows, setArrows] = useState(true),
    [fault, setFault] = useState(''),
    [read, setRead] = useState(''),
    [points, setPoints] = useState(false),
    [sees, setSees] = useState<number | null>(null);
  const [views, setViews] = useState<ViewCount>(1),
    [active, setActive] = useState(0),
    [parts, setParts] = useState<Part[]>([]);
  const place = useRef<[number, number] | null>(null),
    hasPointed = useRef(false);
  latest.current = props;

  useEffect(() => {
    let id = 0,
      drawn: Picture;
    try {
      drawn = new Picture(canvas.current!, labels.current!, props.replica, props.guide);
    } catch (error) {
      setFault(error instanceof Error ? error.message : String(error));
      return undefined;
    }
    picture.current = drawn;
    drawn.onLetGo = view => {
      if (view !== 0) return;
      latest.current.onFollow(null);
      setSees(null);
    };
    drawn.onActive = setActive;
    props.onReady(drawn);
    const size = new ResizeObserver(() => {
      if (!box.current) return;
      if (box.current.clientWidth < kLeastForViews) setViews(1);
      drawn.resize(box.current.clientWidth, box.current.clientHeight);
      setParts(drawn.parts);
    });
    size.observe(box.current!);
    const step = (now: number): void => {
      id = requestAnimationFrame(step);
      latest.current.onPicture(now);
      if (!drawn.draw(performance.now())) return;
      canvas.current?.setAttribute('data-drawn', '1');
      latest.current.onDrawn?.(drawn);
    };
    id = requestAnimationFrame(step);
    return () => {
      cancelAnimationFrame(id);
      size.disconnect();
      drawn.dispose();
    };
  }, []);

  useEffect(() => {
    if (!picture.current) return;
    picture.current.overlay = overlay;
    picture.current.showsArrows = arrows;
  }, [overlay, arrows]);
  // While the pointer is on the organ, its place goes to everybody ten times a second: tissue moves
  // under it.
  useEffect(() => {
    if (picture.current) picture.current.turns = !points;
    if (!points) return undefined;
    const timer = window.setInterval(() => {
      const at = place.current && picture.current ? picture.current.pick(...place.current) : null;
      if (at !== null || hasPointed.current) latest.current.onPoint?.(at);
      hasPointed.current = at !== null;
    }, 100);
    return () => {
      window.clearInterval(timer);
      if (hasPointed.current) latest.current.onPoint?.(null);
      hasPointed.current = false;
    };
  }, [points]);
  const onMove = (event: PointerEvent): void => {
    const rect = (event.currentTarget as HTMLElement).getBoundingClientRect();
    place.current = [
      (event.clientX - rect.left) / rect.width,
      (event.clientY - rect.top) / rect.height,
    ];
  };
  // A drag turns the view: only a click that stays where it began takes a place.
  const pressed = useRef<[number, number] | null>(null);
  const onPress = (event: PointerEvent): void => {
    onMove(event);
    pressed.current = event.button === 0 ? [event.clientX, event.clientY] : null;
  };
  const onRelease = (event: PointerEvent): void => {
    const from = pressed.current;
    pressed.current = null;
    if (
      from &&
      place.current &&
      Math.hypot(event.clientX - from[0], event.clientY - from[1]) < kClickPixels
    )
      props.onPlace?.(...place.current);
  };
  const mayPoint = props.onPoint !== undefined;
  useEffect(() => {
    if (!mayPoint) setPoints(false);
  }, [mayPoint]);
  useEffect(() => picture.current?.follow(0, props.follows), [props.follows]);
  useEffect(() => picture.current?.seeWith(0, sees), [sees]);
  useEffect(() => {
    if (!picture.current) return;
    picture.current.views = views;
    setParts(picture.current.parts);
  }, [views]);
  const lack = picture.current?.fineFault ?? '';
  const mayDivide = (box.current?.clientWidth ?? 0) >= kLeastForViews;

  const reset = (): void => {
    picture.current?.resetView();
    if (active !== 0) return;
    props.onFollow(null);
    setSees(null);
  };
  const lenders = lendersOf(props.people, props.replica.tools(), props.isRecording ?? false);
  const seeWithNext = (): void =>
    setSees(lenders[lenders.findIndex(one => one.slot === sees) + 1]?.slot ?? null);
  const reach = props.isRecording ? 'r' : 'o'; // of a recording O ends a loop
  useKeys((key, event) => {
    const p = picture.current,
      step = event.shiftKey ? 0.02 : 0.1,
      hasFocus = event.target === canvas.current;
    const isOthers = event.target instanceof HTMLCanvasElement && !hasFocus;
    if (!p || isOthers || (props.isSecond && !hasFocus)) return false;
    // Of a recording left and right move its time, unless the picture has the focus.
    const sideways = !props.isRecording || hasFocus;
    const acts: Record<string, () => void> = {
      ...(sideways ? { ArrowLeft: () => p.turn(-step, 0), ArrowRight: () => p.turn(step, 0) } : {}),
      ArrowUp: () => p.turn(0, step),
      ArrowDown: () => p.turn(0, -step),
      ...(props.onPlace ? { Enter: () => props.onPlace?.(0.5, 0.5) } : {}),
      '+': () => p.zoom(0.9),
      '=': () => p.zoom(0.9),
      '-': () => p.zoom(1 / 0.9),
      c: reset,
      ...(mayPoint ? { p: () => setPoints(!points) } : {}),
      l: () => setOverlay(overlay === Overlay.Holds ? Overlay.None : Overlay.Holds),
      [reach]: () => setOverlay(overlay === Overlay.Regions ? Overlay.None : Overlay.Regions),
      a: () => setArrows(!arrows),
      ...(lenders.length > 0 ? { t: seeWithNext } : {}),
      ...(mayDivide ? { v: () => setViews(views === 1 ? 2 : views === 2 ? 4 : 1) } : {}),
      ...(views > 1
        ? Object.fromEntries(parts.map((_, i) => [String(i + 1), () => p.activate(i)]))
        : {}),
    };
    acts[key]?.();
    return acts[key] !== undefined;
  });
  useEscape(sees !== null, () => setSees(null));
  useEscape(points, () => setPoints(false));

  const lines: KeyLine[] = [
    ...(props.keys ?? []),
    {
      keys: props.isRecording ? '↑ ↓; ← → in the picture' : 'arrow keys',
      does: 'turn the view; with Shift in small steps',
    },
    { keys: '+, -', does: 'nearer, farther' },
    { keys: 'C', does: 'the view as at the start' },
    ...(props.keys ? [] : [{ keys: 'L', does: 'who holds what' }]),
    { keys: reach.toUpperCase(), does: 'how far each force reaches' },
    { keys: 'A', does: 'force arrows' },
    { keys: 'T', does: 'see through an endoscope, or the next one' },
    ...(mayDivide ? [{ keys: 'V, then 1 to 4', does: 'two or four views; which one moves' }] : []),
    ...(mayPoint ? [{ keys: 'P', does: 'point: everybody sees where your pointer is' }] : []),
    ...(props.isRecording ? [{ keys: 'Enter', does: 'measuring: take the middle' }] : []),
  ];
  const keys = views === 2 ? '1 and 2' : '1 to 4';
  return (
    <div
      class={`stage${props.isOld ? ' old' : ''}${points || props.onPlace ? ' points' : ''}`}
      ref={box}
    >
      <canvas
        ref={canvas}
        tabIndex={0}
        role="img"
        onPointerMove={onMove}
        onPointerDown={onPress}
        onPointerUp={onRelease}
        onPointerLeave={() => {
          place.current = null;
        }}
        aria-label={
          'The organ and the instruments. ' +
          'Arrow keys turn the view, plus and minus zoom, C resets it.' +
          (views > 1 ? ` View ${active + 1} of ${views} is moved; ${keys} choose another.` : '')
        }
      />
      <div class="labels" ref={labels} aria-hidden="true" />
      {views > 1 && picture.current && (
        <PaneChoices
          picture={picture.current}
          parts={parts}
          active={active}
          people={props.people}
          lenders={lenders}
        />
      )}
      {fault && (
        <p class="banner fault" role="alert">
          {fault}
        </p>
      )}
      {lack !== '' && lack !== read && (
        <p class="banner" role="status" title="Click to close" onClick={() => setRead(lack)}>
          {lack}
        </p>
      )}
      {props.children}
      <div class="view" role="toolbar" aria-label="View">
        <button onClick={reset} title="The view as at the start (C)">
          Reset view
        </button>
        <label class="choice">
          Follow
          <select
            value={props.follows === null ? '' : String(props.follows)}
            onChange={e =>
              props.onFollow(e.currentTarget.value === '' ? null : Number(e.currentTarget.value))
            }
          >
            <option value="">nobody</option>
            {props.people
              .filter(p => p.tool.length > 0)
              .map(p => (
                <option key={p.slot} value={String(p.slot)}>
                  {p.name}
                </option>
              ))}
          </select>
        </label>
        {(lenders.length > 0 || sees !== null) && (
          <label class="choice" title="See through an endoscope (T)">
            See with
            <select
              value={sees === null ? '' : String(sees)}
              onChange={e =>
                setSees(e.currentTarget.value === '' ? null : Number(e.currentTarget.value))
              }
            >
              <option value="">own eyes</option>
              {lenders.map(one => (
                <option key={one.slot} value={String(one.slot)}>
                  {one.text}
                </option>
              ))}
            </select>
          </label>
        )}
        <button
          aria-pressed={overlay === Overlay.Holds}
          onClick={() => setOverlay(overlay === Overlay.Holds ? Overlay.None : Overlay.Holds)}
          title="Who holds what (L)"
        >
          Holds
        </button>
        <button
          aria-pressed={overlay === Overlay.Regions}
          onClick={() => setOverlay(overlay === Overlay.Regions ? Overlay.None : Overlay.Regions)}
          title={`How far each force reaches (${reach.toUpperCase()})`}
        >
          Reach
        </button>
        {mayPoint && (
          <button
            aria-pressed={points}
            onClick={() => setPoints(!points)}
            title="Show everybody the point under the pointer (P)"
          >
            Point
          </button>
        )}
        <button
          aria-pressed={arrows}
          onClick={() => setArrows(!arrows)}
          title="Force arrows, 20 mm per newton (A)"
        >
          Arrows
        </button>
        {mayDivide && (
          <label class="choice" title="Several views at once (V)">
            Views
            <select
              value={String(views)}
              onChange={e => setViews(Number(e.currentTarget.value) as ViewCount)}
            >
              {[1, 2, 4].map(n => (
                <option key={n} value={String(n)}>
                  {n}
                </option>
              ))}
            </select>
          </label>
        )}
        {props.tools}
        {!props.isSecond && <KeysHelp lines={[...(props.moreKeys ?? []), ...lines]} />}
      </div>
    </div>
  );
}

// What an instructor does in a session with people and their tools, and what everybody says.

import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { TeachAction, type Participant, type Participants } from './gen/proto/wire_pb';
import { useEscape } from './keys';
import type { Replica } from './replica';
import type { Picture } from './scene';
import type { Session } from './session';

const kMostText = 500,
  kMostReason = 200,
  kMostName = 32;
const kPieceMs = 250,
  kPiecePoints = 32,
  kLeastPixels = 5,
  kViewMs = 100;

const bytesOf = (text: string): number => new TextEncoder().encode(text).length;
// What the server takes: a pasted text may hold characters that cannot be seen.
const lineOf = (text: string): string =>
  text.replace(/[\p{C}\u2028\u2029\u{E0000}-\u{10FFFF}]/gu, ' ').trim();

// One thing that has to be asked before it is done; `field`: what the person types for it.
export interface Question {
  title: string;
  verb: string;
  field?: { label: string; value: string; most: number; mayBeEmpty?: boolean };
  act(text: string): void;
}

export function Ask(props: { question: Question; onDone(): void }): JSX.Element {
  const { question } = props,
    [text, setText] = useState(question.field?.value ?? '');
  const first = useRef<HTMLInputElement & HTMLButtonElement>(null);
  useEffect(() => first.current?.focus(), []);
  const fits =
    !question.field ||
    ((lineOf(text) !== '' || question.field.mayBeEmpty === true) &&
      bytesOf(lineOf(text)) <= question.field.most);
  const submit = (event: Event): void => {
    event.preventDefault();
    if (!fits) return;
    question.act(lineOf(text));
    props.onDone();
  };
  return (
    <div class="ask" role="alertdialog" aria-label={question.title}>
      <form onSubmit={submit}>
        <p>{question.title}</p>
        {question.field && (
          <label>
            {question.field.label}
            <input value={text} onInput={e => setText(e.currentTarget.value)} ref={first} />
          </label>
        )}
        <button class="main" disabled={!fits} {...(question.field ? {} : { ref: first })}>
          {question.verb}
        </button>
        <button type="button" onClick={props.onDone}>
          Cancel
        </button>
      </form>
    </div>
  );
}

// What may be done with one person, beside the name.
export function Manage(props: {
  session: Session;
  person: Participant;
  people: Participant[];
  own: number | null;
  onAsk(question: Question): void;
}): JSX.Element | null {
  const { session, person: p } = props,
    [isOpen, setIsOpen] = useState(false);
  useEscape(isOpen, () => setIsOpen(false));
  const act = (action: TeachAction, text = ''): void => session.teach(action, p, text);
  const hasTools = p.tool.length > 0,
    isFrozen = p.frozenBy !== '';
  const receivers = props.people.filter(one => one.slot !== p.slot && one.tool.length > 0);
  const handOver = (choice: string): void => {
    const [slot, tool] = choice.split(' ').map(Number),
      receiver = receivers.find(one => one.slot === slot);
    if (receiver !== undefined && tool !== undefined) session.handOver(p, tool, receiver);
    setIsOpen(false);
  };
  const rename = (): void =>
    props.onAsk({
      title: `Rename ${p.name}, for everybody?`,
      verb: 'Rename',
      field: { label: 'New name', value: p.name, most: kMostName },
      act: text => act(TeachAction.TEACH_RENAME, text),
    });
  const expel = (): void =>
    props.onAsk({
      title:
        `Put ${p.name} out of the session? ` +
        'The join code lets nobody in again until you admit them.',
      verb: 'Put out',
      field: { label: 'Reason, which everybody reads', value: '', most: kMostReason },
      act: text => act(TeachAction.TEACH_EXPEL, text),
    });
  return (
    <>
      <button
        class={`manage${hasTools ? ' below' : ''}`}
        aria-expanded={isOpen}
        onClick={() => setIsOpen(!isOpen)}
        aria-label={`Manage ${p.name}`}
      >
        Manage
      </button>
      {isOpen && (
        <div class="acts">
          {hasTools && (
            <button
              aria-pressed={isFrozen}
              onClick={() => act(isFrozen ? TeachAction.TEACH_RELEASE : TeachAction.TEACH_FREEZE)}
              title="The tools stay where they are, whatever the hands do"
            >
              {isFrozen ? 'Release tools' : 'Freeze tools'}
            </button>
          )}
          {hasTools && (
            <button
              onClick={() => act(TeachAction.TEACH_TAKE_CLAIM)}
              title="Jaws open and blades go up, until the hand has let go"
            >
              Make let go
            </button>
          )}
          {hasTools && receivers.length > 0 && (
            <select
              aria-label={`Hand over an instrument of ${p.name}`}
              title="It goes on holding, and moves with the receiver's hand"
              value=""
              onChange={e => handOver(e.currentTarget.value)}
            >
              <option value="">Hand over ...</option>
              {receivers.flatMap(r =>
                p.tool.map((_, i) => (
                  <option
                    key={`${r.slot} ${i}`}
                    value={`${r.slot} ${i}`}
                  >{`${p.tool.length > 1 ? `${i === 0 ? 'right' : 'left'} hand ` : ''}to ${r.name}`}</option>
                )),
              )}
            </select>
          )}
          <button
            aria-pressed={p.leadsView}
            onClick={() =>
              act(p.leadsView ? TeachAction.TEACH_END_VIEW : TeachAction.TEACH_GIVE_VIEW)
            }
            title="Everybody may follow this person's view"
          >
            {p.leadsView ? 'End the view' : 'Give the view'}
          </button>
          <button onClick={rename}>Rename</button>
          {props.own !== p.slot && p.role !== 3 && (
            <button class="bad" onClick={expel}>
              Put out
            </button>
          )}
        </div>
      )}
    </>
  );
}

// Who waits, and whether newcomers may come in.
export function Door(props: { session: Session; list: Participants | null }): JSX.Element | null {
  const { session, list } = props;
  if (list === null) return null;
  return (
    <section class="door" aria-label="Newcomers">
      <button
        aria-pressed={list.isClosed}
        onClick={() =>
          session.teach(list.isClosed ? TeachAction.TEACH_OPEN : TeachAction.TEACH_CLOSE)
        }
      >
        {list.isClosed ? 'Open to newcomers' : 'Close to newcomers'}
      </button>
      {list.waiting.map(name => (
        <p key={name}>
          <b>{name}</b> wants to come in{' '}
          <button
            onClick={() => session.teach(TeachAction.TEACH_ADMIT, null, name)}
            aria-label={`Admit ${name}`}
          >
            Admit
          </button>
        </p>
      ))}
    </section>
  );
}

export function Say(props: { session: Session; mayNote: boolean }): JSX.Element {
  const [text, setText] = useState(''),
    size = bytesOf(lineOf(text)),
    fits = size > 0 && size <= kMostText;
  const send = (action: TeachAction): void => {
    if (!fits) return;
    props.session.teach(action, null, lineOf(text));
    setText('');
  };
  return (
    <form
      class="say"
      onSubmit={event => {
        event.preventDefault();
        send(TeachAction.TEACH_CHAT);
      }}
    >
      <input
        value={text}
        aria-label="A line for everybody"
        placeholder="A line for everybody"
        autocomplete="off"
        onInput={e => setText(e.currentTarget.value)}
      />
      <button disabled={!fits}>Send</button>
      {props.mayNote && (
        <button
          type="button"
          disabled={!fits}
          title="A note with this time, for the debrief"
          onClick={() => send(TeachAction.TEACH_NOTE)}
        >
          Note
        </button>
      )}
      {size > kMostText && (
        <p class="fault" role="alert">{`Too long: ${size} of ${kMostText} bytes.`}</p>
      )}
    </form>
  );
}

// Draws on the organ while it is on. The line goes out in pieces, so that it is seen as it grows.
function usePen(
  isOn: boolean,
  session: Session,
  replica: Replica,
  picture: { current: Picture | null },
): void {
  useEffect(() => {
    const canvas = picture.current?.canvas,
      box = canvas?.parentElement;
    if (!isOn || !canvas || !box) return undefined;
    let points: { triangle: number; weights: [number, number] }[] = [],
      isDown = false,
      last: [number, number] = [0, 0],
      sentMs = 0;
    const flush = (isEnd: boolean): void => {
      if (points.length > (isEnd ? 0 : 1)) session.stroke(points);
      points = isEnd ? [] : points.slice(-1); // the next piece begins where this one ends
      sentMs = performance.now();
    };
    const add = (event: PointerEvent): void => {
      const rect = canvas.getBoundingClientRect();
      last = [event.clientX, event.clientY];
      const at =
        picture.current?.pick(
          (event.clientX - rect.left) / rect.width,
          (event.clientY - rect.top) / rect.height,
        ) ?? null;
      const place = at === null ? null : replica.attach(at);
      if (place === null) return flush(true); // beside the organ the line has a gap
      points.push(place);
      if (points.length >= kPiecePoints || performance.now() - sentMs > kPieceMs) flush(false);
    };
    // Before the canvas: what draws does not turn the view.
    const onDown = (event: PointerEvent): void => {
      if (event.target !== canvas || event.button !== 0) return;
      event.stopPropagation();
      canvas.setPointerCapture(event.pointerId);
      isDown = true;
      sentMs = performance.now();
      add(event);
    };
    const onMove = (event: PointerEvent): void => {
      if (!isDown) return;
      event.stopPropagation();
      if (Math.hypot(event.clientX - last[0], event.clientY - last[1]) >= kLeastPixels) add(event);
    };
    const onUp = (event: PointerEvent): void => {
      if (!isDown) return;
      event.stopPropagation();
      isDown = false;
      flush(true);
    };
    box.addEventListener('pointerdown', onDown, true);
    box.addEventListener('pointermove', onMove, true);
    box.addEventListener('pointerup', onUp, true);
    box.addEventListener('pointercancel', onUp, true);
    return () => {
      box.removeEventListener('pointerdown', onDown, true);
      box.removeEventListener('pointermove', onMove, true);
      box.removeEventListener('pointerup', onUp, true);
      box.removeEventListener('pointercancel', onUp, true);
    };
  }, [isOn]);
}

// Buttons of the picture: drawing, and the view to follow.
export function ViewTools(props: {
  session: Session;
  replica: Replica;
  picture: { current: Picture | null };
  mayDraw: boolean;
  leader: Participant | undefined;
  own: number | null;
}): JSX.Element {
  const { session, picture, leader, own } = props,
    [draws, setDraws] = useState(false),
    [follows, setFollows] = useState(false);
  useEscape(draws, () => setDraws(false));
  usePen(draws && props.mayDraw, session, props.replica, picture);
  const leads = leader !== undefined && leader.slot === own;
  useEffect(() => {
    if (!leads) return undefined;
    const timer = window.setInterval(() => {
      const view = picture.current?.view();
      if (view) session.view(view.eye, view.target);
    }, kViewMs);
    return () => window.clearInterval(timer);
  }, [leads]);
  // Whoever turns the view follows nobody.
  const followed = useRef(false);
  followed.current = follows && leader !== undefined && !leads;
  useEffect(() => {
    if (!followed.current) return undefined;
    const p = picture.current;
    session.onView = view => p?.look(view.eye, view.target);
    if (session.lastView) p?.look(session.lastView.eye, session.lastView.target);
    if (p) p.onTurn = () => setFollows(false);
    return () => {
      session.onView = () => undefined;
      if (p) p.onTurn = () => undefined;
    };
  }, [followed.current]);
  return (
    <>
      {props.mayDraw && (
        <button
          aria-pressed={draws}
          onClick={() => setDraws(!draws)}
          title="Draw on the organ, for everybody"
        >
          Draw
        </button>
      )}
      {props.mayDraw && (
        <button
          onClick={() => session.teach(TeachAction.TEACH_WIPE)}
          title="Wipe what is drawn, for everybody"
        >
          Wipe
        </button>
      )}
      {leader && !leads && (
        <button
          aria-pressed={follows}
          onClick={() => setFollows(!follows)}
        >{`View of ${leader.name}`}</button>
      )}
      {leads && (
        <span class="choice shared" role="status">
          Others may follow your view
        </span>
      )}
    </>
  );
}

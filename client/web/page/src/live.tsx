// A session that runs: watch it, hold instruments, or as instructor mark the organ and return it.

import type { JSX } from 'preact';
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import {
  LessonAction,
  RecordingStatus,
  TeachAction,
  type Envelope,
  type LessonProgress,
  type LessonStage,
  type Participant,
  type Participants,
  type SessionPace,
} from './gen/proto/wire_pb';
import { Forces } from './forces';
import { BloodPanel } from './blood';
import { LessonPanel } from './goals';
import { Marks, Pace } from './conduct';
import { Ask, Door, Manage, Say, ViewTools, type Question } from './lesson';
import { Invite } from './invite';
import { Hands, handKeys, kFirst } from './hands';
import { useEscape } from './keys';
import { holdsTools, type Link } from './link';
import { Events, ForcePlot, People } from './panels';
import { changesOf, kindOf, kindOfTeaching, type EventKind, type RecordedEvent } from './recording';
import type { Replica } from './replica';
import type { Picture } from './scene';
import { Session } from './session';
import { clock, forceOf, guideOf, Stage } from './stage';
import { ThemeButton } from './theme';
import { Tray } from './tray';

const kPanelMs = 100,
  kShownTicks = 30_000,
  kMostEvents = 500,
  kNoticeMs = 4000; // how long one is told what has become of one's own instrument

export function Live(props: {
  link: Link;
  replica: Replica;
  onEnd(why: string): void;
}): JSX.Element {
  const { replica } = props;
  const [, redraw] = useState(0),
    [follows, setFollows] = useState<number | null>(null),
    [asks, setAsks] = useState<Question | null>(null);
  const people = useRef<Participant[]>([]),
    list = useRef<Participants | null>(null),
    events = useRef<RecordedEvent[]>([]);
  const forces = useMemo(() => new Forces(), []),
    own = useRef<number | null>(null),
    recording = useRef(''),
    isRecorded = useRef<boolean | null>(null),
    crc = useRef('');
  const picture = useRef<Picture | null>(null),
    hands = useRef<Hands | null>(null),
    notice = useRef({ text: '', untilMs: 0 }),
    stage = useRef<LessonStage | null>(null),
    progress = useRef<LessonProgress | null>(null);
  const pace = useRef<SessionPace | null>(null),
    marks = useRef<string[]>([]),
    mayPace = useRef(false);
  const guide = useMemo(
    () =>
      guideOf(
        () => people.current,
        slot => replica.slotColour(slot),
      ),
    [],
  );

  const session = useMemo(() => {
    const note = (tick: number, kind: EventKind, text: string): void => {
      if (text === '') return;
      const last = events.current.at(-1);
      // A refused grasp is tried again and again.
      if (last?.text === text && kind === 'refusal') return;
      events.current.push({ tick, kind, text });
      if (events.current.length > kMostEvents) events.current.shift();
    };
    const onMessage = (envelope: Envelope, tick: number): void => {
      const { case: kind, value } = envelope.message;
      if (kind === 'welcome') {
        own.current = value.participant;
        mayPace.current = value.protocolMinor >= 18;
        pace.current = null; // what differs from the usual is told anew
        marks.current = [];
      }
      if (kind === 'participants') {
        for (const text of changesOf(list.current, value)) note(tick, 'people', text);
        list.current = value;
        people.current = [...value.participant].sort((a, b) => a.slot - b.slot);
        hands.current?.heed(own.current, people.current);
      }
      if (kind === 'claimEvent') {
        note(Number(value.tick), kindOf(value.outcome), value.text);
        if (value.tool >> 1 === own.current && kindOf(value.outcome) !== 'grant')
          notice.current = { text: value.text, untilMs: performance.now() + kNoticeMs };
      }
      if (kind === 'markEvent')
        note(Number(value.tick), value.isDone ? 'cut' : 'refusal', value.text);
      if (kind === 'teachEvent')
        note(
          Number(value.tick),
          value.isDone && !value.isTrouble ? kindOfTeaching(value.action) : 'refusal',
          value.text,
        );
      if (kind === 'lessonStage') {
        if (stage.current?.beginTick !== value.beginTick) progress.current = null;
        stage.current = value;
      }
      if (kind === 'sessionPace') pace.current = value;
      if (kind === 'markList') marks.current = value.name;
      if (kind === 'lessonProgress') progress.current = value;
      if (kind === 'recordingState') {
        recording.current = value.text; // empty while nothing is wrong
        isRecorded.current =
          value.status === RecordingStatus.RECORDING_WHOLE ||
          value.status === RecordingStatus.RECORDING_GAPPED;
      }
      if (kind === 'barrier')
        crc.current = replica.ownCrc === value.surfaceCrc >>> 0 ? 'same' : 'other';
    };
    return new Session(
      props.link,
      replica,
      { onMessage, onChange: () => redraw(n => n + 1) },
      holdsTools(props.link.role) ? kFirst : [],
    );
  }, []);

  useEffect(() => {
    const timer = window.setInterval(() => {
      for (const tool of replica.tools())
        forces.add(replica.newestTick, tool.slot >> 1, forceOf(tool));
      forces.forget(replica.newestTick - 2 * kShownTicks);
      redraw(n => n + 1);
    }, kPanelMs);
    return () => {
      window.clearInterval(timer);
      hands.current?.dispose();
      session.leave();
    };
  }, []);
  useEffect(() => {
    if (session.state === 'ended') props.onEnd(session.why);
  }, [session.state]);
  // Tests and curious people read figures here.
  useEffect(() => {
    Object.assign(window, {
      trocar: {
        replica,
        session,
        hands: () => hands.current,
        picture: () => picture.current,
        barrier: () => crc.current,
      },
    });
  }, []);

  const now = Math.max(0, replica.newestTick),
    age = session.shownAgeMs;
  const isPaused = session.state === 'live' && (pace.current?.isPaused ?? false),
    rate = pace.current?.rate ?? 1;
  const isOld = session.state === 'away' || (!isPaused && age !== null && age > 1000),
    isLate = !isPaused && age !== null && age > session.oldAfterMs;
  // Buttons stay where they are while the connection is lost, and do nothing.
  const isLive = session.state === 'live',
    wasIn = session.state !== 'joining';
  const mayMark = props.link.role === 'instructor' && wasIn;
  const leader = people.current.find(p => p.leadsView);
  const end = (): void =>
    setAsks({
      title: 'End the session for everybody? The recording is closed.',
      verb: 'End for everybody',
      act: () => session.teach(TeachAction.TEACH_END),
    });
  const lead = {
    next: () => session.lead(LessonAction.LESSON_NEXT),
    restart: () =>
      setAsks({
        title: 'Begin the lesson anew, from its first stage? The tissue stays as it is.',
        verb: 'Restart',
        act: () => session.lead(LessonAction.LESSON_RESTART),
      }),
  };
  useEscape(asks !== null, () => setAsks(null));
  return (
    <div class="layout">
      <header>
        <h1>Trocar</h1>
        <span class="time">{clock(now / 1000)}</span>
        <span
          class={`age${isOld ? ' old' : isLate ? ' late' : ''}`}
          role="status"
          title="How old the picture is that you see"
        >
          {session.state === 'joining'
            ? 'joining'
            : session.state === 'away'
              ? `old since ${Math.round((performance.now() - session.awaySince) / 1000)} s`
              : isPaused
                ? 'paused'
                : age === null
                  ? 'live'
                  : `${Math.max(0, Math.round(age))} ms old`}
        </span>
        {isRecorded.current !== null && (
          <span class="age">{isRecorded.current ? 'recorded' : 'not recorded'}</span>
        )}
        {recording.current && <span class="age late">{recording.current}</span>}
        <span class="space" />
        {mayMark && (
          <span class="lead" inert={!isLive}>
            {mayPace.current && <Pace session={session} pace={pace.current} />}
            <Marks session={session} marks={marks.current} onAsk={setAsks} />
            <button class="bad" onClick={end}>
              End session
            </button>
          </span>
        )}
        <ThemeButton />
        <button onClick={session.leave}>Leave</button>
      </header>
      <main>
        <Stage
          replica={replica}
          guide={guide}
          isOld={isOld}
          follows={follows}
          people={people.current}
          onFollow={setFollows}
          onPicture={() => undefined}
          {...(holdsTools(props.link.role) ? { keys: handKeys } : {})}
          onReady={p => {
            picture.current = p;
            if (!holdsTools(props.link.role)) return;
            hands.current = new Hands(replica, session, p, () => redraw(n => n + 1));
            hands.current.heed(own.current, people.current);
          }}
          tools={
            wasIn && (
              <ViewTools
                session={session}
                replica={replica}
                picture={picture}
                mayDraw={mayMark}
                leader={leader}
                own={own.current}
              />
            )
          }
          {...(mayMark ? { onPoint: place => session.point(place) } : {})}
        >
          {session.state === 'away' && (
            <p class="banner" role="alert">
              {session.why} The picture is old; the page comes back by itself.
            </p>
          )}
          {hands.current && performance.now() < notice.current.untilMs && (
            <p class="banner" role="status">
              {notice.current.text}
            </p>
          )}
          {isPaused && (
            <p
              class="banner"
              role="status"
            >{`${pace.current?.by || 'Somebody'} has paused the session.`}</p>
          )}
          {isLive && !isPaused && rate < 1 && (
            <p class="banner" role="status">
              {`Time is slow, ${Math.round(rate * 100)} % of real speed. Go on.`}
            </p>
          )}
          {session.state === 'joining' && <p class="banner">Joining the session</p>}
          {session.state === 'live' && replica.frames === 0 && (
            <p class="banner">Waiting for the organ</p>
          )}
        </Stage>
        {asks !== null && <Ask key={asks.title} question={asks} onDone={() => setAsks(null)} />}
      </main>
      <aside>
        {hands.current && (
          <Tray
            hands={hands.current}
            tools={replica.tools().filter(tool => tool.slot >> 1 === own.current)}
            onDone={() => picture.current?.canvas.focus({ preventScroll: true })}
          />
        )}
        {stage.current && (
          <LessonPanel
            goal={{
              stage: stage.current,
              progress: progress.current,
              seconds: progress.current?.seconds ?? 0,
            }}
            {...(mayMark ? { lead } : {})}
            {...(hands.current
              ? {
                  answer: () => session.lead(LessonAction.LESSON_ANSWER, hands.current?.moved ?? 0),
                }
              : {})}
          />
        )}
        <BloodPanel blood={replica.blood()} />
        <People
          people={people.current}
          tools={replica.tools()}
          own={own.current}
          colourOf={slot => replica.slotColour(slot)}
          follows={follows}
          onFollow={setFollows}
          waits={slot => replica.waits(slot)}
          {...(mayMark
            ? {
                extra: person => (
                  <Manage
                    session={session}
                    person={person}
                    people={people.current}
                    own={own.current}
                    onAsk={setAsks}
                  />
                ),
              }
            : {})}
        />
        {mayMark && (
          <div inert={!isLive}>
            <Door session={session} list={list.current} />
            <Invite link={props.link} />
          </div>
        )}
        <section aria-labelledby="forces">
          <h2 id="forces">
            Forces <small>last 30 s</small>
          </h2>
          <ForcePlot
            forces={forces}
            from={Math.max(0, now - kShownTicks)}
            to={now}
            now={now}
            height={130}
            nameOf={slot => people.current.find(p => p.slot === slot)?.name ?? `hand ${slot + 1}`}
            colourOf={slot => replica.slotColour(slot)}
          />
        </section>
        <Events events={events.current} now={now} empty="Nothing has happened yet." />
        {wasIn && (
          <div inert={!isLive}>
            <Say session={session} mayNote={mayMark} />
          </div>
        )}
      </aside>
    </div>
  );
}

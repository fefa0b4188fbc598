// A recording: choose one, play it, go to what happened.

import type { JSX } from 'preact';
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import { BloodPanel } from './blood';
import { Beside, BesideChoice, type Other } from './debrief/beside';
import { toBinary } from '@bufbuild/protobuf';
import { Bookmarks } from './debrief/bookmarks';
import { Check } from './debrief/check';
import {
  joined,
  keepBookmarks,
  keptBookmarks,
  readBookmarks,
  bookmarksText,
  type Bookmark,
} from './debrief/marks';
import { Controls, kClockKeys, keyActs, Timeline, type Clock } from './debrief/transport';
import { Course, type Quantity } from './debrief/course';
import { eventsTable, forcesTable, Still } from './debrief/export';
import { useOverlays } from './debrief/measuring';
import { courseData, kQuantities, Plots, type ToolGuide } from './debrief/plots';
import { readAll, take } from './debrief/reading';
import { kMostShots, Report, type ReportContent, type Shot } from './debrief/report';
import { Take } from './debrief/take';
import { LessonStageSchema } from './gen/proto/wire_pb';
import { LessonPanel } from './goals';
import { useEscape, useKeys } from './keys';
import { recordingLink, type Link, type Moment } from './link';
import { Events, hex, People } from './panels';
import { kSpeeds, Player } from './player';
import { EventLog, traffic, type Recording } from './recording';
import type { Replica } from './replica';
import type { Picture } from './scene';
import { guideOf, Stage } from './stage';
import { ThemeButton } from './theme';

export function RecordingList(props: { link: Link; onChoose(name: string): void }): JSX.Element {
  const [list, setList] = useState<{ name: string; bytes: number; changed: number }[] | null>(null),
    [fault, setFault] = useState('');
  useEffect(() => {
    void (async () => {
      try {
        const answer = await fetch('recordings', {
          headers: { Authorization: `Bearer ${props.link.recordingsKey}` },
        });
        if (!answer.ok) throw new Error(await answer.text());
        setList((await answer.json()) as { name: string; bytes: number; changed: number }[]);
      } catch (error) {
        setFault(error instanceof Error ? error.message : String(error));
      }
    })();
  }, []);
  return (
    <main class="sheet">
      <div class="corner">
        <ThemeButton />
      </div>
      <h1>Recordings</h1>
      {fault && (
        <p class="fault" role="alert">
          {fault}
        </p>
      )}
      {list === null && !fault && <p>Loading the list</p>}
      {list?.length === 0 && <p>There is none yet.</p>}
      <ul class="files">
        {list?.map(file => (
          <li key={file.name}>
            <button onClick={() => props.onChoose(file.name)}>
              <b>{file.name}</b>
              <small>
                {new Date(file.changed * 1000).toLocaleString()}
                {` · ${(file.bytes / 1e6).toFixed(1)} MB`}
              </small>
            </button>
          </li>
        ))}
      </ul>
    </main>
  );
}

interface DebriefProps {
  replica: Replica;
  recording: Recording;
  name: string;
  link: Link;
  onClose(): void;
}

export function Debrief(props: DebriefProps): JSX.Element {
  const { replica, recording } = props;
  const [, redraw] = useState(0),
    [follows, setFollows] = useState<number | null>(null),
    [copied, setCopied] = useState('');
  const [marks, setMarks] = useState<Bookmark[]>([]),
    [fault, setFault] = useState(''),
    [isWhole, setIsWhole] = useState(false),
    [other, setOther] = useState<Other | null>(null),
    [report, setReport] = useState<ReportContent | null>(null);
  const still = useMemo(() => new Still(), []);
  const course = useMemo(() => new Course(), []),
    log = useMemo(() => new EventLog(), []),
    picture = useRef<Picture | null>(null);
  const player = useMemo(() => {
    replica.restart();
    const made = new Player(recording, replica, () => redraw(n => n + 1));
    if (props.link.speed !== null && kSpeeds.includes(props.link.speed))
      made.speed = props.link.speed;
    return made;
  }, []);
  const people = player.people?.participant ?? [];
  // The replica draws what belongs to the stage that was on.
  const stage = log.stageAt(player.tick);
  useEffect(() => {
    try {
      replica.receiveBare(
        'lessonStage',
        stage ? toBinary(LessonStageSchema, stage) : new Uint8Array(),
        performance.now(),
      );
    } catch (error) {
      setFault(error instanceof Error ? error.message : String(error));
    }
  }, [stage]);
  const toolGuide = useMemo(
    (): ToolGuide => ({
      nameOf: tool =>
        (log.names.get(tool >> 1) ?? `hand ${(tool >> 1) + 1}`) +
        ((tool & 1) === 1 ? ', left hand' : ''),
      colourOf: tool => hex(replica.slotColour(tool >> 1)),
    }),
    [],
  );
  const overlays = useOverlays(
    replica,
    course,
    () => picture.current,
    toolGuide,
    recording.firstTick,
    () => player.tick,
  );
  const guide = useMemo(
    () =>
      guideOf(
        () => player.people?.participant ?? [],
        slot => replica.slotColour(slot),
      ),
    [],
  );

  useEffect(() => {
    let isGone = false;
    Object.assign(window, {
      trocar: { replica, player, recording, log, traffic, picture: () => picture.current },
    });
    try {
      setMarks(
        joined(
          keptBookmarks(recording.startNs),
          props.link.bookmarks ? readBookmarks(props.link.bookmarks) : [],
        ),
      );
    } catch (error) {
      setMarks(keptBookmarks(recording.startNs));
      setFault(error instanceof Error ? error.message : String(error));
    }
    void (async () => {
      await player.seek(
        props.link.seconds === null ? recording.firstTick : props.link.seconds * 1000,
      );
      try {
        if (await readAll(recording, log, course, () => isGone)) setIsWhole(true);
        else player.onItem = item => take(item, log, course);
      } catch (error) {
        setFault(error instanceof Error ? error.message : String(error));
      }
    })();
    const timer = window.setInterval(() => {
      redraw(n => n + 1);
    }, 100);
    return () => {
      isGone = true;
      player.close();
      window.clearInterval(timer);
    };
  }, []);

  useEscape(copied !== '', () => setCopied(''));
  const seek = (tick: number): void => void player.seek(tick);
  const change = (to: Bookmark[]): void => {
    setMarks(to);
    setFault(
      keepBookmarks(recording.startNs, to)
        ? ''
        : 'This browser keeps no bookmarks: copy them as a link, or save them as a file.',
    );
  };
  const time: Clock = {
    tick: player.tick,
    isPlaying: player.isPlaying,
    speed: player.speed,
    range: player.range,
    first: recording.firstTick,
    last: recording.lastTick,
    seek,
    toggle: () => (player.isPlaying ? player.pause() : player.play()),
    setSpeed(speed) {
      player.speed = speed;
      redraw(n => n + 1);
    },
    setRange(range) {
      player.range = range;
      redraw(n => n + 1);
    },
  };
  useKeys(key => keyActs(time, key));
  const share = async (more: Partial<Moment>): Promise<void> => {
    const link = recordingLink(props.link.recordingsKey, props.name, {
      seconds: player.tick / 1000,
      ...more,
    });
    try {
      await navigator.clipboard.writeText(link);
      setCopied('The link is copied.');
    } catch {
      setCopied(link);
    }
  };
  // Goes to each bookmark for its picture, and back.
  const makeReport = async (): Promise<void> => {
    const before = player.tick,
      shots: Shot[] = [];
    player.pause();
    for (const mark of marks.slice(0, kMostShots)) {
      await player.seek(mark.tick);
      await still.next();
      shots.push({
        title: mark.name,
        tick: mark.tick,
        url: still.canvas.toDataURL('image/jpeg', 0.9),
      });
    }
    await player.seek(before);
    const plots = (Object.keys(kQuantities) as Quantity[]).map(what =>
      courseData(course, what, recording.firstTick, recording.lastTick, toolGuide),
    );
    const owners = [...new Set(course.slots.map(tool => toolGuide.nameOf(tool & ~1)))];
    setReport({
      name: props.name,
      organ: recording.organ,
      startMs: Number(recording.startNs / 1_000_000n),
      lastTick: recording.lastTick,
      people: owners,
      events: log.events,
      plots,
      shots,
    });
  };
  const here = (): Partial<Moment> => ({
    view: picture.current?.view() ?? null,
    speed: player.speed,
  });
  return (
    <div class={`layout debrief${other ? ' two' : ''}`}>
      <header>
        <h1>Trocar</h1>
        <span class="file" title={recording.organ}>
          {props.name}
        </span>
        <span class="space" />
        {props.link.recordingsKey && (
          <button onClick={() => void share(here())}>Copy link to this moment</button>
        )}
        <ThemeButton />
        <button onClick={props.onClose}>Close</button>
      </header>
      <main>
        <div class="half">
          <Stage
            replica={replica}
            guide={guide}
            isOld={false}
            isRecording
            moreKeys={kClockKeys}
            follows={follows}
            people={people}
            onFollow={setFollows}
            onPicture={now => player.advance(now)}
            onPlace={overlays.onPlace}
            onDrawn={drawn => {
              overlays.draw(drawn);
              still.drawn(drawn, overlays.lines(), replica.tools(), guide);
            }}
            onReady={p => {
              picture.current = p;
              if (props.link.view) p.look(props.link.view.eye, props.link.view.target);
            }}
          >
            {overlays.canvas}
            {(player.fault || fault) && (
              <p class="banner fault" role="alert">
                {player.fault || fault}
              </p>
            )}
            {copied && (
              <p
                class="banner"
                role="status"
                title="Click or Esc to close"
                onClick={() => setCopied('')}
              >
                {copied}
              </p>
            )}
          </Stage>
        </div>
        {other && <Beside key={other.name} other={other} first={player} firstEvents={log.events} />}
      </main>
      <aside>
        {stage && (
          <LessonPanel
            goal={{
              stage,
              progress: null,
              seconds: Math.max(0, player.tick - Number(stage.beginTick)) / 1000,
            }}
          />
        )}
        <BloodPanel blood={replica.blood()} />
        <People
          people={people}
          tools={replica.tools()}
          own={null}
          colourOf={slot => replica.slotColour(slot)}
          follows={follows}
          onFollow={setFollows}
        />
        <Events events={log.events} now={player.tick} onSeek={seek} empty="Looking for events" />
        <Bookmarks
          marks={marks}
          now={player.tick}
          name={props.name}
          onChange={change}
          onSeek={seek}
          onCopy={
            props.link.recordingsKey ? all => void share({ bookmarks: bookmarksText(all) }) : null
          }
        />
        {overlays.panels}
        <Take
          name={props.name}
          isWhole={isWhole}
          still={still}
          forces={() => forcesTable(course, tool => toolGuide.nameOf(tool))}
          events={() => eventsTable(log.events)}
          onReport={makeReport}
        />
        <BesideChoice recordingsKey={props.link.recordingsKey} other={other} onOther={setOther} />
        {props.link.recordingsKey && (
          <Check name={props.name} recordingsKey={props.link.recordingsKey} onSeek={seek} />
        )}
      </aside>
      <footer>
        <Plots
          course={course}
          from={recording.firstTick}
          to={recording.lastTick}
          now={player.tick}
          range={player.range}
          guide={toolGuide}
          onSeek={seek}
        />
        <Timeline clock={time} events={log.events} marks={marks} />
        <Controls clock={time} />
      </footer>
      {report && <Report content={report} onClose={() => setReport(null)} />}
    </div>
  );
}

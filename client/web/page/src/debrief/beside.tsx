// A second recording beside the first one: on the same clock, or so that an event of one comes
// together with an event of the other.

import type { JSX } from 'preact';
import { useEffect, useMemo, useState } from 'preact/hooks';
import { millilitres } from '../blood';
import { Player } from '../player';
import { EventLog, ofFile, overHttp, Recording, type RecordedEvent } from '../recording';
import { Replica } from '../replica';
import { clock, guideOf, Stage } from '../stage';
import { Course } from './course';
import { readAll } from './reading';

const kMostChoices = 500,
  kFrame = 16,
  kApart = 400; // ticks; farther apart than that, it seeks
const kHurry = 0.2; // it plays faster or slower by this share at most

export interface Other {
  name: string;
  recording: Recording;
  replica: Replica;
}

export function BesideChoice(props: {
  recordingsKey: string;
  other: Other | null;
  onOther(other: Other | null): void;
}): JSX.Element {
  const [names, setNames] = useState<string[]>([]),
    [fault, setFault] = useState('');
  const key = props.recordingsKey;
  useEffect(() => {
    if (!key) return;
    void (async () => {
      try {
        const answer = await fetch('recordings', { headers: { Authorization: `Bearer ${key}` } });
        if (!answer.ok) throw new Error(await answer.text());
        setNames(((await answer.json()) as { name: string }[]).map(file => file.name));
      } catch (error) {
        setFault(error instanceof Error ? error.message : String(error));
      }
    })();
  }, []);
  const open = async (name: string, opening: Promise<Recording>): Promise<void> => {
    setFault('');
    try {
      const [recording, replica] = await Promise.all([
        opening,
        Replica.load(fetch('replica.wasm')),
      ]);
      props.onOther({ name, recording, replica });
    } catch (error) {
      setFault(error instanceof Error ? error.message : String(error));
    }
  };
  const take = (input: HTMLInputElement): void => {
    const file = input.files?.[0];
    input.value = '';
    if (file) void open(file.name, Recording.open(ofFile(file)));
  };
  return (
    <section aria-labelledby="beside" class="beside">
      <h2 id="beside">Compare with another</h2>
      {props.other ? (
        <div class="row">
          <span class="file">{props.other.name}</span>
          <button onClick={() => props.onOther(null)}>Close</button>
        </div>
      ) : (
        <>
          {key && (
            <label class="choice">
              Recording
              <select
                value=""
                onChange={event => {
                  const name = event.currentTarget.value;
                  if (name)
                    void open(
                      name,
                      overHttp(`recordings/${encodeURIComponent(name)}`, key).then(Recording.open),
                    );
                }}
              >
                <option value="">none</option>
                {names.map(name => (
                  <option key={name} value={name}>
                    {name}
                  </option>
                ))}
              </select>
            </label>
          )}
          <label class="drop">
            Or from a file
            <input type="file" accept=".mcap" onChange={event => take(event.currentTarget)} />
          </label>
        </>
      )}
      {fault && (
        <p class="fault" role="alert">
          {fault}
        </p>
      )}
    </section>
  );
}

// Lets a player keep up with the first one, `offset` ticks apart.
export function keepUp(second: Player, first: Player, offset: number): void {
  const { firstTick, lastTick } = second.recording,
    wanted = Math.max(firstTick, Math.min(lastTick, first.tick + offset));
  const apart = Math.abs(second.tick - wanted),
    isRunning = first.isPlaying && !first.isSeeking && wanted === first.tick + offset;
  second.speed =
    first.speed * (1 + Math.max(-kHurry, Math.min(kHurry, (wanted - second.tick) / 1000)));
  second.isPlaying = isRunning && second.fault === '';
  if (
    !second.isSeeking &&
    second.fault === '' &&
    apart > (isRunning ? kApart * Math.max(1, first.speed) : kFrame)
  )
    void second.seek(wanted);
}

function EventChoice(props: {
  label: string;
  events: RecordedEvent[];
  onTick(tick: number | null): void;
}): JSX.Element {
  return (
    <label class="choice">
      {props.label}
      <select
        onChange={event =>
          props.onTick(
            event.currentTarget.value === ''
              ? null
              : (props.events[Number(event.currentTarget.value)]?.tick ?? null),
          )
        }
      >
        <option value="">its start</option>
        {props.events.slice(0, kMostChoices).map((event, i) => (
          <option key={i} value={String(i)}>
            {clock(event.tick / 1000)} {event.text}
          </option>
        ))}
      </select>
    </label>
  );
}

export function Beside(props: {
  other: Other;
  first: Player;
  firstEvents: RecordedEvent[];
}): JSX.Element {
  const { recording, replica, name } = props.other;
  const [, redraw] = useState(0),
    [here, setHere] = useState<number | null>(null),
    [there, setThere] = useState<number | null>(null),
    [fault, setFault] = useState('');
  const log = useMemo(() => new EventLog(), []),
    course = useMemo(() => new Course(), []);
  const player = useMemo(() => new Player(recording, replica, () => redraw(n => n + 1)), []);
  const guide = useMemo(
    () =>
      guideOf(
        () => player.people?.participant ?? [],
        slot => replica.slotColour(slot),
      ),
    [],
  );
  const [follows, setFollows] = useState<number | null>(null);
  const blood = replica.blood();
  const offset = (there ?? recording.firstTick) - (here ?? props.first.recording.firstTick);
  useEffect(() => {
    let isGone = false;
    Object.assign(window, { trocarBeside: { player, replica } });
    readAll(recording, log, course, () => isGone).then(
      () => redraw(n => n + 1),
      error => setFault(error instanceof Error ? error.message : String(error)),
    );
    void player.seek(props.first.tick + offset);
    return () => {
      isGone = true;
      player.close();
    };
  }, []);
  return (
    <div class="half">
      <Stage
        replica={replica}
        guide={guide}
        isOld={false}
        isRecording
        isSecond
        follows={follows}
        people={player.people?.participant ?? []}
        onFollow={setFollows}
        onReady={() => undefined}
        onPicture={now => {
          keepUp(player, props.first, offset);
          player.advance(now);
        }}
      >
        <details class="aligned">
          <summary>
            <b>{name}</b> <span class="time">{clock(player.tick / 1000)}</span>
            {blood && blood.shedMl > 0 && (
              <span class="time">{` blood lost ${millilitres(blood.shedMl)}`}</span>
            )}{' '}
            Align
          </summary>
          <EventChoice label="Where the first has" events={props.firstEvents} onTick={setHere} />
          <EventChoice label="this one has" events={log.events} onTick={setThere} />
        </details>
        {(player.fault || fault) && (
          <p class="banner fault" role="alert">
            {player.fault || fault}
          </p>
        )}
      </Stage>
    </div>
  );
}

// A recording: choose one, play it, go to what happened.

import type { JSX } from 'preact';
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import { Forces } from './forces';
import { recordingLink, type Link } from './link';
import { Events, ForcePlot, People } from './panels';
import { kSpeeds, Player } from './player';
import { traffic, type RecordedEvent, type Recording } from './recording';
import type { Replica } from './replica';
import type { Picture } from './scene';
import { clock, guideOf, Stage } from './stage';

// Larger recordings are not read whole for the plot: it shows what was played.
const kWholeBytes = 100e6;

export function RecordingList(props: { link: Link; onChoose(name: string): void }): JSX.Element {
  const [list, setList] = useState<{ name: string; bytes: number; changed: number }[] | null>(null), [fault, setFault] = useState('');
  useEffect(() => {
    void (async () => {
      try {
        const answer = await fetch('recordings', { headers: { Authorization: `Bearer ${props.link.recordingsKey}` } });
        if (!answer.ok) throw new Error(await answer.text());
        setList(await answer.json() as { name: string; bytes: number; changed: number }[]);
      } catch (error) {
        setFault(error instanceof Error ? error.message : String(error));
      }
    })();
  }, []);
  return (
    <div class="sheet">
      <h1>Recordings</h1>
      {fault && <p class="fault" role="alert">{fault}</p>}
      {list === null && !fault && <p>Loading the list</p>}
      {list?.length === 0 && <p>There is none yet.</p>}
      <ul class="files">
        {list?.map(file => (
          <li key={file.name}>
            <button onClick={() => props.onChoose(file.name)}><b>{file.name}</b><small>{new Date(file.changed * 1000).toLocaleString()} · {(file.bytes / 1e6).toFixed(1)} MB</small></button>
          </li>
        ))}
      </ul>
    </div>
  );
}

interface DebriefProps { replica: Replica; recording: Recording; name: string; link: Link; onClose(): void }

export function Debrief(props: DebriefProps): JSX.Element {
  const { replica, recording } = props;
  const [, redraw] = useState(0), [follows, setFollows] = useState<number | null>(null), [events, setEvents] = useState<RecordedEvent[]>([]), [copied, setCopied] = useState('');
  const forces = useMemo(() => new Forces(), []), picture = useRef<Picture | null>(null);
  const player = useMemo(() => {
    replica.restart();
    return new Player(recording, replica, () => redraw(n => n + 1));
  }, []);
  const people = player.people?.participant ?? [];
  const guide = useMemo(() => guideOf(() => player.people?.participant ?? [], slot => replica.slotColour(slot)), []);

  useEffect(() => {
    let isGone = false;
    Object.assign(window, { trocar: { replica, player, recording, traffic, picture: () => picture.current } });
    void (async () => {
      await player.seek(props.link.seconds === null ? recording.firstTick : props.link.seconds * 1000);
      try {
        const all = await recording.events();
        if (isGone) return;
        setEvents(all);
        if (recording.bytes > kWholeBytes) return;
        for await (const { tick, state } of recording.states(0, recording.lastTick)) {
          if (isGone) return;
          for (const tool of state.tool) forces.add(tick, tool.tool >> 1, Math.hypot(tool.forceN?.x ?? 0, tool.forceN?.y ?? 0, tool.forceN?.z ?? 0));
          // The picture goes before the plot.
          if (tick % 1024 === 0) await new Promise(resolve => setTimeout(resolve, 0));
        }
      } catch (error) {
        player.fault = error instanceof Error ? error.message : String(error);
      }
    })();
    const timer = window.setInterval(() => {
      for (const tool of replica.tools()) forces.add(Math.max(0, replica.newestTick), tool.slot >> 1, Math.hypot(...tool.forceN));
      redraw(n => n + 1);
    }, 100);
    return () => {
      isGone = true;
      window.clearInterval(timer);
    };
  }, []);

  const seek = (tick: number): void => void player.seek(tick);
  const toggle = (): void => (player.isPlaying ? player.pause() : player.play());
  const faster = (by: number): void => {
    player.speed = kSpeeds[Math.max(0, Math.min(kSpeeds.length - 1, kSpeeds.indexOf(player.speed) + by))] ?? 1;
    redraw(n => n + 1);
  };
  const onKey = (event: KeyboardEvent): void => {
    const target = event.target as HTMLElement;
    if (event.ctrlKey || event.metaKey || event.altKey || target.tagName === 'SELECT') return;
    const isButton = target.tagName === 'BUTTON';
    const acts: Record<string, () => void> = {
      k: toggle, ',': () => seek(player.tick - 16), '.': () => seek(player.tick + 16), j: () => seek(player.tick - 2000), ';': () => seek(player.tick + 2000),
      Home: () => seek(recording.firstTick), End: () => seek(recording.lastTick), '<': () => faster(-1), '>': () => faster(1),
      ...(isButton ? {} : { ' ': toggle }),
      ...(target.tagName === 'INPUT' ? {} : { ArrowLeft: () => seek(player.tick - 2000), ArrowRight: () => seek(player.tick + 2000) }),
    };
    const act = acts[event.key];
    if (!act) return;
    act();
    event.preventDefault();
  };
  const share = async (): Promise<void> => {
    const link = recordingLink(props.link.recordingsKey, props.name, player.tick / 1000);
    try {
      await navigator.clipboard.writeText(link);
      setCopied('The link is copied.');
    } catch {
      setCopied(link);
    }
  };
  const length = recording.lastTick - recording.firstTick;
  const nameOf = (slot: number): string => people.find(p => p.slot === slot)?.name ?? `hand ${slot + 1}`;
  return (
    <div class="layout debrief" onKeyDown={onKey}>
      <header>
        <h1>Trocar</h1>
        <span class="file" title={recording.organ}>{props.name}</span>
        <span class="space" />
        {props.link.recordingsKey && <button onClick={() => void share()}>Copy link to this moment</button>}
        <button onClick={props.onClose}>Close</button>
      </header>
      <main>
        <Stage replica={replica} guide={guide} isOld={false} follows={follows} people={people} onFollow={setFollows} onPicture={now => player.advance(now)} onReady={p => { picture.current = p; }}>
          {player.fault && <p class="banner fault" role="alert">{player.fault}</p>}
          {copied && <p class="banner" role="status" onClick={() => setCopied('')}>{copied}</p>}
        </Stage>
      </main>
      <aside>
        <People people={people} tools={replica.tools()} own={null} colourOf={slot => replica.slotColour(slot)} follows={follows} onFollow={setFollows} />
        <Events events={events} now={player.tick} onSeek={seek} empty="Looking for events" />
      </aside>
      <footer>
        <ForcePlot forces={forces} from={recording.firstTick} to={recording.lastTick} now={player.tick} height={110} nameOf={nameOf} colourOf={slot => replica.slotColour(slot)} onSeek={seek} />
        <div class="timeline">
          <div class="marks" aria-hidden="true">
            {length > 0 && events.slice(0, 600).map((event, i) => <i key={i} class={event.kind} ref={el => { if (el) el.style.left = `${((event.tick - recording.firstTick) / length) * 100}%`; }} />)}
          </div>
          <input type="range" min={recording.firstTick} max={recording.lastTick} step={16} value={player.tick} aria-label="Time" aria-valuetext={clock(player.tick / 1000)}
            onInput={event => seek(Number(event.currentTarget.value))} />
        </div>
        <div class="controls">
          <button class="main" onClick={toggle} title="Space">{player.isPlaying ? 'Pause' : 'Play'}</button>
          <button onClick={() => seek(player.tick - 2000)} title="Left arrow">− 2 s</button>
          <button onClick={() => seek(player.tick + 2000)} title="Right arrow">+ 2 s</button>
          <label class="choice">Speed
            <select value={String(player.speed)} onChange={event => { player.speed = Number(event.currentTarget.value); redraw(n => n + 1); }}>
              {kSpeeds.map(speed => <option key={speed} value={String(speed)}>{speed}×</option>)}
            </select>
          </label>
          <span class="time">{clock(player.tick / 1000)} / {clock(recording.lastTick / 1000)}</span>
        </div>
      </footer>
    </div>
  );
}

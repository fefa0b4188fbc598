// The page: what its link asks for, or the choice.

import { render, type JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import 'uplot/dist/uPlot.min.css';
import './page.css';
import { Debrief, RecordingList } from './debrief';
import { kRoles, nameFault, readLink, rememberName, type Link, type Role } from './link';
import { Live } from './live';
import { Practice, whyOver } from './practice';
import { ofFile, overHttp, Recording } from './recording';
import { Replica } from './replica';
import { ThemeButton } from './theme';

const kRoleText: Record<Role, string> = {
  observer: 'an observer: you watch',
  surgeon: 'a surgeon: you hold instruments',
  assistant: 'an assistant: you hold instruments, too',
  instructor: 'an instructor: you watch and lead the lesson',
};

type Where =
  | { is: 'start'; why: string }
  | { is: 'live'; link: Link }
  | { is: 'practice'; why: string }
  | { is: 'list' }
  | { is: 'loading'; name: string }
  | { is: 'debrief'; name: string; recording: Recording };

function Start(props: {
  link: Link;
  why: string;
  onJoin(link: Link): void;
  onFile(file: File): void;
}): JSX.Element {
  const [code, setCode] = useState(props.link.code),
    [name, setName] = useState(props.link.name),
    [role, setRole] = useState(props.link.role),
    [fault, setFault] = useState('');
  const submit = (event: Event): void => {
    event.preventDefault();
    const wrong =
      nameFault(name.trim()) ||
      (code.trim() === '' ? 'Type the join code that the host gave you.' : '');
    setFault(wrong);
    if (wrong) return;
    rememberName(name.trim());
    // A whole link may be pasted, of this page or of the native client.
    const pasted = code.includes('#')
      ? readLink(code.slice(code.indexOf('#'))).code
      : code.trim().replace(/^trocar:\/\/[^/]*\//, '');
    props.onJoin({ ...props.link, code: pasted, name: name.trim(), role });
  };
  return (
    <main>
      <div class="corner">
        <ThemeButton />
      </div>
      <form class="sheet" onSubmit={submit}>
        <h1>Join a session</h1>
        {props.why && (
          <p class="fault" role="alert">
            {props.why}
          </p>
        )}
        <label>
          Your name
          <input
            name="name"
            value={name}
            maxLength={32}
            autocomplete="nickname"
            onInput={e => setName(e.currentTarget.value)}
            autofocus={name === ''}
          />
        </label>
        <label>
          Join code
          <input
            name="code"
            value={code}
            autocomplete="off"
            spellcheck={false}
            placeholder="7K3M-9QXZ-4T2B-WN8C"
            onInput={e => setCode(e.currentTarget.value)}
          />
        </label>
        <fieldset>
          <legend>You are</legend>
          {kRoles.map(kind => (
            <label key={kind} class="radio">
              <input
                type="radio"
                name="role"
                value={kind}
                checked={role === kind}
                onChange={() => setRole(kind)}
              />
              {kRoleText[kind]}
            </label>
          ))}
        </fieldset>
        {fault && (
          <p class="fault" role="alert">
            {fault}
          </p>
        )}
        <button class="main">Join</button>
        <hr />
        <label class="drop">
          Or open a recording: drop a file here, or choose one
          <input
            type="file"
            accept=".mcap"
            onChange={e => {
              const file = e.currentTarget.files?.[0];
              if (file) props.onFile(file);
            }}
          />
        </label>
      </form>
    </main>
  );
}

function Page(props: { replica: Replica }): JSX.Element {
  const [link, setLink] = useState(() => readLink(location.hash));
  const [where, setWhere] = useState<Where>(() =>
    link.recordingsKey
      ? link.file
        ? { is: 'loading', name: link.file }
        : { is: 'list' }
      : { is: link.practiceKey ? 'practice' : 'start', why: '' },
  );
  const say = (error: unknown): string => (error instanceof Error ? error.message : String(error));

  const open = (name: string, opening: Promise<Recording>): void => {
    setWhere({ is: 'loading', name });
    opening.then(
      recording => setWhere({ is: 'debrief', name, recording }),
      error => setWhere({ is: 'start', why: say(error) }),
    );
  };
  const choose = (name: string): void =>
    open(
      name,
      overHttp(`recordings/${encodeURIComponent(name)}`, link.recordingsKey).then(Recording.open),
    );
  const drop = (file: File): void => {
    setLink({ ...link, recordingsKey: '', seconds: null });
    open(file.name, Recording.open(ofFile(file)));
  };
  useEffect(() => {
    if (where.is === 'loading' && link.recordingsKey) choose(where.name);
    else if (where.is === 'start' && link.code && link.name) setWhere({ is: 'live', link });
    const onDrop = (event: DragEvent): void => {
      event.preventDefault();
      const file = event.dataTransfer?.files[0];
      if (file) drop(file);
    };
    const onOver = (event: DragEvent): void => event.preventDefault();
    const onHash = (): void => location.reload();
    window.addEventListener('drop', onDrop);
    window.addEventListener('dragover', onOver);
    window.addEventListener('hashchange', onHash);
    return () => {
      window.removeEventListener('drop', onDrop);
      window.removeEventListener('dragover', onOver);
      window.removeEventListener('hashchange', onHash);
    };
  }, []);

  switch (where.is) {
    case 'live':
      return (
        <Live
          link={where.link}
          replica={props.replica}
          onEnd={why => {
            props.replica.restart();
            if (link.practiceKey)
              void whyOver(link.practiceKey).then(over => {
                setLink({ ...link, name: where.link.name });
                setWhere({ is: 'practice', why: over || why });
              });
            else {
              setLink({ ...where.link });
              setWhere({ is: 'start', why });
            }
          }}
        />
      );
    case 'practice':
      return (
        <Practice
          link={link}
          why={where.why}
          onReady={ready => setWhere({ is: 'live', link: ready })}
        />
      );
    case 'list':
      return <RecordingList link={link} onChoose={choose} />;
    case 'loading':
      return (
        <main class="sheet">
          <h1>{where.name}</h1>
          <p role="status">Opening the recording</p>
        </main>
      );
    case 'debrief':
      return (
        <Debrief
          key={where.name}
          replica={props.replica}
          recording={where.recording}
          name={where.name}
          link={link}
          onClose={() => setWhere(link.recordingsKey ? { is: 'list' } : { is: 'start', why: '' })}
        />
      );
    default:
      return (
        <Start
          link={link}
          why={where.why}
          onJoin={joined => {
            props.replica.restart();
            setWhere({ is: 'live', link: joined });
          }}
          onFile={drop}
        />
      );
  }
}

const box = document.getElementById('page')!;
Replica.load(fetch('replica.wasm')).then(
  replica => render(<Page replica={replica} />, box),
  () => {
    box.textContent =
      'This browser cannot show a session: it needs WebAssembly with SIMD, as all have since 2023.';
  },
);

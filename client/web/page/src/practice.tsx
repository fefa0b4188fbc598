// Practice alone: a name, then the queue until the machine has room, then a session of one's own.

import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import { nameFault, rememberName, type Link } from './link';
import { ThemeButton } from './theme';

const kAskMs = 2000,
  kTicket = 'trocar-practice';

type Answer =
  | { state: 'waiting'; ticket: string; number: number; wait_s: number | null }
  | { state: 'starting'; ticket: string }
  | { state: 'ready'; ticket: string; session: string; code: string; left_s: number }
  | { state: 'over'; ticket: string; why: string }
  | { state: 'full' };

// A page that is loaded again comes back to its session.
let ticket = kept();
function kept(): string {
  try {
    return sessionStorage.getItem(kTicket) ?? '';
  } catch {
    return '';
  }
}
function keep(now: string): void {
  ticket = now;
  try {
    sessionStorage.setItem(kTicket, now);
  } catch {
    /* a browser that keeps nothing: it begins anew */
  }
}

async function ask(key: string): Promise<Answer> {
  const reply = await fetch(`practice?ticket=${ticket}`, {
    headers: { authorization: `Bearer ${key}` },
  });
  if (!reply.ok) throw new Error((await reply.text()).trim());
  const answer: Answer = await reply.json();
  if (answer.state !== 'full') keep(answer.ticket);
  return answer;
}
// Why the session is over that this page had; empty: it is not, or nobody knows.
export async function whyOver(key: string): Promise<string> {
  const answer = await ask(key).catch(() => null);
  return answer?.state === 'over' ? answer.why : '';
}

function told(answer: Answer | null): string {
  if (answer?.state === 'starting') return 'Your session begins.';
  if (answer?.state !== 'waiting') return 'Asking for a session.';
  const { number, wait_s: wait } = answer,
    minutes = wait === null ? 0 : Math.ceil(wait / 60);
  const place = number === 1 ? 'You are next.' : `${number - 1} people are before you.`;
  if (wait === null) return `${place} The machine is busy with other sessions.`;
  return `${place} It takes ${minutes} ${minutes === 1 ? 'minute' : 'minutes'} at most.`;
}

export function Practice(props: {
  link: Link;
  why: string;
  onReady(link: Link): void;
}): JSX.Element {
  const { link } = props,
    [name, setName] = useState(link.name),
    [waits, setWaits] = useState(false),
    [answer, setAnswer] = useState<Answer | null>(null),
    [fault, setFault] = useState(props.why);
  useEffect(() => {
    if (!waits) return undefined;
    const look = async (): Promise<void> => {
      const next = await ask(link.practiceKey);
      setAnswer(next);
      if (next.state === 'full') throw new Error('Too many people wait here: come back later.');
      if (next.state === 'over') {
        keep('');
        await look();
      }
      if (next.state === 'ready')
        props.onReady({ ...link, name, role: 'surgeon', code: next.code, session: next.session });
    };
    const tick = (): void => {
      look().catch(error => {
        setWaits(false);
        setFault(error instanceof TypeError ? 'The page does not answer.' : error.message);
      });
    };
    tick();
    const timer = window.setInterval(tick, kAskMs);
    return () => window.clearInterval(timer);
  }, [waits]);

  const submit = (event: Event): void => {
    event.preventDefault();
    const wrong = nameFault(name.trim());
    setFault(wrong);
    if (wrong) return;
    rememberName(name.trim());
    setAnswer(null);
    setWaits(true);
  };
  return (
    <main>
      <div class="corner">
        <ThemeButton />
      </div>
      <form class="sheet" onSubmit={submit}>
        <h1>Practise alone</h1>
        {fault && (
          <p class="fault" role="alert">
            {fault}
          </p>
        )}
        {waits ? (
          <>
            <p role="status">{told(answer)}</p>
            <p>Keep this page open. It goes on by itself.</p>
            <button type="button" onClick={() => setWaits(false)}>
              Do not wait
            </button>
          </>
        ) : (
          <>
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
            <button class="main">Begin</button>
          </>
        )}
      </form>
    </main>
  );
}

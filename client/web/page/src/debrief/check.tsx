// Does a recording verify? The server simulates it again when somebody asks, and the page waits
// beside.

import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import { clock } from '../stage';

interface Answer {
  state: string;
  text: string;
  tick: number | null;
}
const kAgainMs = 1000;
const kPending = ['waiting', 'running', 'growing'];

function readAnswer(given: unknown): Answer {
  const { state, text, tick } = given as Record<string, unknown>;
  if (typeof state !== 'string' || typeof text !== 'string')
    throw new Error('The server gave an answer that this page does not know.');
  return { state, text, tick: typeof tick === 'number' ? tick : null };
}

export function Check(props: {
  name: string;
  recordingsKey: string;
  onSeek(tick: number): void;
}): JSX.Element {
  const [answer, setAnswer] = useState<Answer | null>(null),
    [fault, setFault] = useState('');
  const ask = async (what: 'check' | 'checked'): Promise<void> => {
    try {
      const got = await fetch(`recordings/${encodeURIComponent(props.name)}/${what}`, {
        headers: { Authorization: `Bearer ${props.recordingsKey}` },
      });
      if (!got.ok) throw new Error((await got.text()).trim());
      setAnswer(readAnswer(await got.json()));
      setFault('');
    } catch (error) {
      setFault(error instanceof Error ? error.message : String(error));
    }
  };
  useEffect(() => void ask('checked'), []);
  const isPending = answer !== null && kPending.includes(answer.state);
  useEffect(() => {
    if (!isPending) return undefined;
    const timer = window.setInterval(() => void ask('check'), kAgainMs);
    return () => window.clearInterval(timer);
  }, [isPending]);

  const tick = answer?.tick ?? null;
  const said =
    answer === null
      ? ''
      : ({
          verified: `Verified: ${answer.text}.`,
          different: `It differs at ${clock((tick ?? 0) / 1000)}, tick ${tick}: ${answer.text}.`,
          unknown: `It cannot be told: ${answer.text}.`,
          failed: `The check came to no end: ${answer.text}.`,
          'not asked': '',
        }[answer.state] ?? answer.text);
  return (
    <section aria-labelledby="check" class="check">
      <h2 id="check">Verify</h2>
      <p role="status" class={answer?.state === 'different' ? 'fault' : (answer?.state ?? '')}>
        {fault || said || 'The server can simulate it again and compare all that it says.'}
      </p>
      {tick !== null && <button onClick={() => props.onSeek(tick)}>Go there</button>}
      {(answer === null || answer.state === 'not asked' || answer.state === 'failed') && (
        <button onClick={() => void ask('check')}>Verify recording</button>
      )}
    </section>
  );
}

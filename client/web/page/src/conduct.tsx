// What an instructor does with the session as a whole: its time, and the marks to return to.

import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { MarkAction, TeachAction, type SessionPace } from './gen/proto/wire_pb';
import type { Question } from './lesson';
import type { Session } from './session';

const kRates = [1, 0.75, 0.5, 0.25],
  kMostName = 32;

export function Pace(props: { session: Session; pace: SessionPace | null }): JSX.Element {
  const { session, pace } = props,
    isPaused = pace?.isPaused ?? false,
    rate = pace?.rate ?? 1;
  return (
    <>
      <button
        aria-pressed={isPaused}
        title="Time stands still for everybody, and tools stay where they are"
        onClick={() => session.teach(isPaused ? TeachAction.TEACH_GO_ON : TeachAction.TEACH_PAUSE)}
      >
        {isPaused ? 'Go on' : 'Pause all'}
      </button>
      <label class="choice" title="How fast simulated time goes, for everybody">
        Time
        <select
          aria-label="Time"
          value={String(rate)}
          onChange={e => session.slow(Number(e.currentTarget.value))}
        >
          {(kRates.includes(rate) ? kRates : [...kRates, rate]).map(one => (
            <option key={one} value={String(one)}>{`${Math.round(one * 100)} %`}</option>
          ))}
        </select>
      </label>
    </>
  );
}

const titleOf = (name: string): string => (name === '' ? 'the mark without a name' : `"${name}"`);

// Several marks stand side by side, each with a name; the empty one is a name, too.
export function Marks(props: {
  session: Session;
  marks: string[];
  onAsk(question: Question): void;
}): JSX.Element {
  const { session, marks, onAsk } = props,
    [chosen, setChosen] = useState('');
  const name = marks.includes(chosen) ? chosen : (marks[0] ?? '');
  const set = (): void =>
    onAsk({
      title: 'Mark the organ as it is now? A mark of the same name is replaced.',
      verb: 'Mark',
      field: { label: 'Name, or nothing', value: '', most: kMostName, mayBeEmpty: true },
      act: text => session.mark(MarkAction.MARK_SET, text),
    });
  const go = (): void =>
    onAsk({
      title:
        `Return the organ to ${titleOf(name)}, for everybody? ` +
        'Cuts made since then are undone.',
      verb: 'Return',
      act: () => session.mark(MarkAction.MARK_RETURN, name),
    });
  return (
    <>
      <button onClick={set}>Mark organ</button>
      {marks.length > 1 && (
        <select
          aria-label="Which mark"
          value={name}
          onChange={e => setChosen(e.currentTarget.value)}
        >
          {marks.map(one => (
            <option key={one} value={one}>
              {one === '' ? 'without a name' : one}
            </option>
          ))}
        </select>
      )}
      <button onClick={go}>Return to mark</button>
    </>
  );
}

// Keys: they act wherever the focus is, unless somebody types in a field; Esc leaves what one is in;
// and the list of them all.

import type { JSX } from 'preact';
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';

export interface KeyLine {
  keys: string;
  does: string;
}

// Where keys belong to what has the focus: letters to a field, and Enter and the space bar to a
// button, too.
function isTakenBy(target: EventTarget | null, key: string): boolean {
  if (target instanceof HTMLInputElement && target.type === 'range')
    return key.startsWith('Arrow') || ['Home', 'End', 'PageUp', 'PageDown'].includes(key);
  if (
    target instanceof HTMLInputElement ||
    target instanceof HTMLTextAreaElement ||
    target instanceof HTMLSelectElement
  )
    return true;
  if (!(target instanceof HTMLElement)) return false;
  if (key === 'Enter' || key === ' ') return target.closest('button, summary, a') !== null;
  // A list that scrolls.
  return (key === 'ArrowUp' || key === 'ArrowDown') && target.closest('ol[tabindex]') !== null;
}

// `act` returns whether it did something.
export function useKeys(act: (key: string, event: KeyboardEvent) => boolean): void {
  const latest = useRef(act);
  latest.current = act;
  useEffect(() => {
    const onKey = (event: KeyboardEvent): void => {
      if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return;
      if (isTakenBy(event.target, event.key)) return;
      const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
      if (latest.current(key, event)) event.preventDefault();
    };
    window.addEventListener('keydown', onKey);
    return () => window.removeEventListener('keydown', onKey);
  }, []);
}

// What Esc leaves, the newest last.
const open: (() => void)[] = [];
window.addEventListener('keydown', event => {
  if (event.key !== 'Escape' || event.defaultPrevented) return;
  const leave = open.pop();
  if (leave) leave();
  else if (document.activeElement instanceof HTMLElement) document.activeElement.blur();
});

// While `isIn`, Esc does `leave`, unless something was entered since.
export function useEscape(isIn: boolean, leave: () => void): void {
  const latest = useRef(leave);
  latest.current = leave;
  // At once: a slow picture may keep other effects from running before the key comes.
  useLayoutEffect(() => {
    if (!isIn) return undefined;
    const mine = (): void => latest.current();
    open.push(mine);
    return () => {
      const at = open.indexOf(mine);
      if (at >= 0) open.splice(at, 1);
    };
  }, [isIn]);
}

const kAlways: KeyLine[] = [
  { keys: 'Esc', does: 'leave what you are in: this list, a question, drawing, measuring' },
  { keys: 'Tab', does: 'to the next button, list or field' },
  { keys: 'H, ?', does: 'this list' },
];

// A button, and with it or H a list of all keys.
export function KeysHelp(props: { lines: KeyLine[] }): JSX.Element {
  const [isShown, setIsShown] = useState(false),
    close = useRef<HTMLButtonElement>(null);
  useKeys(key => {
    if (key !== 'h' && key !== '?') return false;
    setIsShown(!isShown);
    return true;
  });
  useEscape(isShown, () => setIsShown(false));
  useEffect(() => {
    if (isShown) close.current?.focus();
  }, [isShown]);
  return (
    <>
      <button aria-expanded={isShown} onClick={() => setIsShown(!isShown)} title="All keys (H)">
        Keys
      </button>
      {isShown && (
        <div class="keys" role="dialog" aria-label="Keys">
          <dl>
            {[...props.lines, ...kAlways].map(line => (
              <div key={line.keys}>
                <dt>{line.keys}</dt>
                <dd>{line.does}</dd>
              </div>
            ))}
          </dl>
          <button ref={close} onClick={() => setIsShown(false)}>
            Close
          </button>
        </div>
      )}
    </>
  );
}

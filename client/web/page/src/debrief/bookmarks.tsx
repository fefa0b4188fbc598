// Bookmarks of a recording: add, go there, rename by adding anew, pass on.

import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { clock } from '../stage';
import {
  bookmarksText,
  joined,
  kMostBookmarks,
  kMostName,
  readBookmarks,
  type Bookmark,
} from './marks';
import { save } from './save';

interface Props {
  marks: Bookmark[];
  now: number; // tick
  name: string; // the recording's
  onChange(marks: Bookmark[]): void;
  onSeek(tick: number): void;
  onCopy: ((marks: Bookmark[]) => void) | null; // copies a link; null: this recording has none
}

export function Bookmarks(props: Props): JSX.Element {
  const [name, setName] = useState(''),
    [fault, setFault] = useState('');
  const add = (event: Event): void => {
    event.preventDefault();
    if (props.marks.length >= kMostBookmarks)
      return setFault(`There are ${kMostBookmarks} already: remove one first.`);
    setFault('');
    props.onChange(
      joined(props.marks, [
        { tick: Math.round(props.now), name: name.trim() || `Moment ${props.marks.length + 1}` },
      ]),
    );
    setName('');
  };
  const take = async (input: HTMLInputElement): Promise<void> => {
    const file = input.files?.[0];
    input.value = '';
    if (!file) return;
    try {
      props.onChange(
        joined(props.marks, readBookmarks(file.size > 1e6 ? 'too long' : await file.text())),
      );
      setFault('');
    } catch (error) {
      setFault(error instanceof Error ? error.message : String(error));
    }
  };
  return (
    <section aria-labelledby="bookmarks" class="bookmarks">
      <h2 id="bookmarks">
        Bookmarks <small>{props.marks.length}</small>
      </h2>
      <form onSubmit={add}>
        <input
          aria-label="Name of the bookmark"
          placeholder="Name"
          maxLength={kMostName}
          value={name}
          onInput={e => setName(e.currentTarget.value)}
        />
        <button>Add here</button>
      </form>
      {fault && (
        <p class="fault" role="alert">
          {fault}
        </p>
      )}
      <ul>
        {props.marks.map(mark => (
          <li key={`${mark.tick} ${mark.name}`}>
            <button class="go" onClick={() => props.onSeek(mark.tick)}>
              <time>{clock(mark.tick / 1000)}</time> {mark.name}
            </button>
            <button
              onClick={() => props.onChange(props.marks.filter(m => m !== mark))}
              aria-label={`Remove ${mark.name}`}
            >
              ×
            </button>
          </li>
        ))}
      </ul>
      <div class="row">
        {props.onCopy && (
          <button disabled={props.marks.length === 0} onClick={() => props.onCopy?.(props.marks)}>
            Copy as a link
          </button>
        )}
        <button
          disabled={props.marks.length === 0}
          onClick={() =>
            save(
              `${props.name}.bookmarks.json`,
              new Blob([bookmarksText(props.marks)], { type: 'application/json' }),
            )
          }
        >
          Save as a file
        </button>
        <label class="drop">
          Add from a file
          <input type="file" accept=".json" onChange={e => void take(e.currentTarget)} />
        </label>
      </div>
    </section>
  );
}

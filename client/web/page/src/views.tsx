// What stands on several views: a frame around the one that is moved, and what each of the others
// shows.

import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import type { Participant } from './gen/proto/wire_pb';
import type { Part } from './pane';
import type { Picture } from './scene';
import type { Lender } from './stage';

const percent = (share: number): string => `${share * 100}%`;

// The first view follows whom the buttons below the picture say.
export function PaneChoices(props: {
  picture: Picture;
  parts: Part[];
  active: number;
  people: Participant[];
  lenders: Lender[];
}): JSX.Element {
  const { picture } = props,
    [choices, setChoices] = useState<Record<number, string>>({});
  const hands = props.people.filter(p => p.tool.length > 0);
  const choose = (view: number, value: string): void => {
    const [slot = '', kind = ''] = value.split(' ');
    picture.follow(view, slot === '' || kind === 'lens' ? null : Number(slot), kind === 'along');
    picture.seeWith(view, kind === 'lens' ? Number(slot) : null);
    picture.activate(view);
    setChoices(before => ({ ...before, [view]: value }));
  };
  useEffect(() => {
    const before = picture.onLetGo;
    picture.onLetGo = view => {
      before(view);
      setChoices(known => ({ ...known, [view]: '' }));
    };
    return () => {
      picture.onLetGo = before;
      for (const view of [1, 2, 3]) {
        picture.follow(view, null);
        picture.seeWith(view, null);
      }
    };
  }, []);
  return (
    <>
      {props.parts.map((part, view) => (
        <div
          key={view}
          class={`pane${view === props.active ? ' active' : ''}`}
          style={{
            left: percent(part[0]),
            top: percent(part[1]),
            width: percent(part[2]),
            height: percent(part[3]),
          }}
        >
          {view > 0 && (
            <select
              value={choices[view] ?? ''}
              aria-label={`View ${view + 1} shows`}
              onChange={e => choose(view, e.currentTarget.value)}
            >
              <option value="">free view</option>
              {hands.map(p => (
                <option key={`${p.slot}f`} value={`${p.slot} follow`}>{`follows ${p.name}`}</option>
              ))}
              {props.lenders.map(one => (
                <option
                  key={`${one.slot}l`}
                  value={`${one.slot} lens`}
                >{`with ${one.text}`}</option>
              ))}
              {hands.map(p => (
                <option
                  key={`${p.slot}a`}
                  value={`${p.slot} along`}
                >{`along the tool of ${p.name}`}</option>
              ))}
            </select>
          )}
        </div>
      ))}
    </>
  );
}

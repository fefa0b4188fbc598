// What a person holds: the instruments that there are, which hand moves, and what it feels.

import type { JSX } from 'preact';
import { instruments } from './gen/instruments';
import type { Hands } from './hands';
import type { Tool } from './replica';
import { forceOf, newtons } from './stage';

const kFullBar = 5; // N
const nameOf = (hand: number): string => (hand === 0 ? 'right hand' : 'left hand');

// `tools`: the person's own. `onDone`: keys are for the picture again.
export function Tray(props: { hands: Hands; tools: Tool[]; onDone(): void }): JSX.Element {
  const { hands } = props,
    chosen = hands.chosen(hands.moved);
  return (
    <section class="tray" aria-labelledby="tray">
      <h2 id="tray">
        Your {nameOf(hands.moved)}
        <button
          title="Tab over the picture, or G"
          onClick={() => {
            hands.switchHand();
            props.onDone();
          }}
        >
          Other hand
        </button>
      </h2>
      {hands.hasLetGo && (
        <p class="fault" role="status">
          The page was not in front: your instruments have let go.
        </p>
      )}
      <ul class="forces" aria-label="Forces on your instruments">
        {Array.from({ length: hands.count }, (_, hand) => {
          const tool = props.tools.find(one => (one.slot & 1) === hand),
            newton = tool ? forceOf(tool) : 0;
          return (
            <li key={hand}>
              <span>{`${nameOf(hand)}: ${instruments[hands.chosen(hand)]?.name ?? 'another instrument'}`}</span>
              <meter min={0} max={kFullBar} high={3} value={Math.min(newton, kFullBar)}>
                {newtons(newton)}
              </meter>
              <span class="number">{newtons(newton)}</span>
            </li>
          );
        })}
      </ul>
      <div class="row" role="group" aria-label="Instruments">
        {instruments.map((one, i) => (
          <button
            key={one.name}
            aria-pressed={i === chosen}
            title={i < 9 ? `${one.text} (${i + 1})` : one.text}
            onClick={() => {
              hands.take(i);
              props.onDone();
            }}
          >
            {one.name}
          </button>
        ))}
      </div>
      <div class="row" role="group" aria-label="Depth">
        {([1, -1] as const).map(way => (
          <button
            key={way}
            title={
              way > 0
                ? 'While you hold it; or the wheel, or W'
                : 'While you hold it; or the wheel, or S'
            }
            onPointerDown={() => hands.goDeeper(way)}
            onPointerUp={() => hands.goDeeper(0)}
            onPointerLeave={() => hands.goDeeper(0)}
          >
            {way > 0 ? 'Deeper' : 'Nearer'}
          </button>
        ))}
      </div>
      {hands.pad.name !== '' && (
        <p class="how">{`Gamepad: ${hands.pad.name}. H shows its keys.`}</p>
      )}
      <p class="how">
        Left button or one finger: use it. Right button or two fingers: the view. F push, Space
        grasp, X cut, Q and E turn. Without a mouse: I, J, K and L move it.
      </p>
    </section>
  );
}

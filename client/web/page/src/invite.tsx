// Links for others, which an instructor hands out: one for each role, as text and as a QR code that
// a phone reads from the screen.

import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { useEscape } from './keys';
import type { Link } from './link';

interface Invitation {
  role: string;
  url: string;
  width: number; // modules of the QR code in a row
  modules: string; // row by row, 1 is dark
}

const kMargin = 4; // modules

async function ask(link: Link): Promise<Invitation[]> {
  const answer = await fetch(`links${link.session ? `?session=${link.session}` : ''}`, {
    headers: { authorization: `Bearer ${link.code}` },
  });
  if (!answer.ok) throw new Error((await answer.text()).trim());
  const invitations: Invitation[] = await answer.json();
  if (invitations.length === 0)
    throw new Error('The session runs on another machine: its server has printed the codes.');
  return invitations;
}

function Code(props: { of: Invitation }): JSX.Element {
  const { width, modules, role } = props.of,
    size = width + 2 * kMargin;
  const dark = [...modules].map((digit, i) =>
    digit === '1' ? `M${(i % width) + kMargin} ${Math.floor(i / width) + kMargin}h1v1h-1z` : '',
  );
  return (
    <svg viewBox={`0 0 ${size} ${size}`} role="img" aria-label={`QR code of the ${role}'s link`}>
      <rect width={size} height={size} fill="#fff" />
      <path d={dark.join('')} fill="#000" />
    </svg>
  );
}

export function Invite(props: { link: Link }): JSX.Element {
  const [shown, setShown] = useState<Invitation[] | null>(null),
    [chosen, setChosen] = useState(0),
    [fault, setFault] = useState(''),
    [copied, setCopied] = useState('');
  const close = (): void => setShown(null);
  useEscape(shown !== null, close);
  const open = (): void => {
    setFault('');
    setCopied('');
    ask(props.link).then(setShown, error => setFault(error instanceof Error ? error.message : ''));
  };
  const copy = (one: Invitation): void => {
    navigator.clipboard.writeText(one.url).then(
      () => setCopied(one.role),
      () => setFault('The browser does not let the page copy: mark the link and copy it.'),
    );
  };
  const one = shown?.[chosen] ?? shown?.[0];
  return (
    <section class="invite" aria-label="Links for others">
      <button aria-expanded={shown !== null} onClick={shown === null ? open : close}>
        Links for others
      </button>
      {fault && (
        <p class="fault" role="alert">
          {fault}
        </p>
      )}
      {shown !== null && one !== undefined && (
        <>
          <div class="row" role="group" aria-label="Role">
            {shown.map((each, i) => (
              <button key={each.role} aria-pressed={each === one} onClick={() => setChosen(i)}>
                {each.role}
              </button>
            ))}
          </div>
          <Code of={one} />
          <p class="link">{one.url}</p>
          <button onClick={() => copy(one)}>
            {copied === one.role ? 'Copied' : `Copy the ${one.role}'s link`}
          </button>
        </>
      )}
    </section>
  );
}
